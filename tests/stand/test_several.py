"""Stands with several controllers: their files, programs, common start, and continuation."""

from __future__ import annotations

import dataclasses
import os
import re
import sys
import threading

import numpy as np
import pytest
from tests.stand.hoist import STAND

import fantoccini as fan
from fantoccini.base.errors import FileError, StandError, StreamError
from fantoccini.stand import (
    AxisMap,
    Channel,
    Emulator,
    GrblMachine,
    StreamCounts,
    check_stand,
    first_lost_line,
    gcode_lines,
    gcode_program,
    grbl_settings,
    loads_stand,
    positions_together,
    resume_points,
    save_points,
    serial_port,
    set_points,
    stream_together,
)

pytestmark = pytest.mark.medium
N = 8
PUPPET = "puppet: eight\nbodies:\n" + "".join(
    f"  - {{name: bob{k}, joint: {{type: translation, axes: [z]}}, mass: 0.3}}\n" for k in range(N)
)
PUPPET += "strings:\n" + "".join(
    f"  - {{name: line{k}, path: [{{body: bob{k}}}, {{world: [0, 0, 1]}}], length: driven}}\n"
    for k in range(N)
)
AXES = STAND.replace("TORQUE", "0.5").replace("speed: 1\n", "speed: 2\n").split("  winch:\n")
EIGHT = AXES[0].replace("one_winch", "eight") + "".join(
    f"  winch{k}:\n" + AXES[1].replace("line.length", f"line{k}.length") for k in range(N)
)
HOME = "    home: {towards: min, at: 0.2, speed: 0.03}\n"
SHARED = """
controllers:
  left: {type: fluidnc, port: /dev/left, step_rate: 1.0e5, axes: [winch0, winch2, winch4, winch6]}
  right: {type: fluidnc, port: /dev/right, step_rate: 1.0e5, axes: [winch1, winch3, winch5, winch7]}
"""


@pytest.fixture(scope="module")
def eight():
    return fan.loads(PUPPET)


@pytest.fixture(scope="module")
def run(eight):
    """Every line moves by another amount at other times."""
    moves = {
        f"line{k}.length": [(0.1 + 0.02 * k, 0.8), (0.7, 0.4 + 0.03 * k), (1.4, 0.8)]
        for k in range(N)
    }
    start = eight.rest({name: 0.8 for name in moves})
    save_at = np.linspace(0.0, 1.5, 751)
    return fan.simulate(eight, start, fan.Input.waypoints(eight, moves), 1.5, save_at=save_at)


@pytest.fixture(scope="module")
def points(eight, run):
    return set_points(loads_stand(EIGHT + SHARED), run, eight)


def machine_of(part):
    return GrblMachine(grbl_settings(part.map.stand, part.controller, part.rate))


def test_more_axes_than_letters_are_a_mistake_of_the_file(eight, run):
    """FluidNC: X, Y, Z, A, B, C (wiki.fluidnc.com, config/axes)."""
    with pytest.raises(FileError, match="fluidnc moves up to 6 axes, found 8; needed: several"):
        loads_stand(EIGHT + "controller: {type: fluidnc}\n")
    with pytest.raises(StandError, match="grbl moves up to 6 axes, found 8"):
        set_points(loads_stand(EIGHT + SHARED), run, eight, controller="grbl")
    with pytest.raises(FileError, match=r"controller\.names\.winch0: found 'Q'; needed: a letter"):
        renamed = EIGHT + "controller: {type: marlin, names: {winch0: Q}}\n"
        loads_stand(renamed)


WRONG = {
    "an axis without a controller": ("winch7]", "winch5]", "no controller has the axis 'winch7'"),
    "an axis of two controllers": ("winch7]", "winch7, winch0]", "found 'winch0' twice"),
    "no such axis": ("winch7]", "winch7, winch9]", "there is no axis 'winch9'"),
    "one port for two controllers": ("/dev/right", "/dev/left", "found '/dev/left' twice"),
    "no axes": (", axes: [winch1, winch3, winch5, winch7]", "", "right.axes: this key is missing"),
    "another kind": ("right: {type: fluidnc", "right: {type: klipper", "grbl, fluidnc"),
    "both keys": ("controllers:", "controller: {type: grbl}\ncontrollers:", "allowed: one of them"),
    "seven axes": (
        "axes: [winch0, winch2, winch4, winch6]",
        "axes: [winch0, winch2, winch4, winch6, winch1, winch3, winch5, winch7]",
        "controllers.left: fluidnc moves up to 6 axes, found 8",
    ),
    "a name of another's axis": (
        "right: {type: fluidnc,",
        "right: {type: fluidnc, names: {winch0: X},",
        "there is no axis 'winch0'",
    ),
}


@pytest.mark.parametrize("old, new, words", WRONG.values(), ids=WRONG)
def test_mistakes_in_controllers_are_located(old, new, words):
    text = SHARED.replace(old, new)
    if words.startswith("controllers.left"):
        text = text[: text.index("  right:")]
    with pytest.raises(FileError) as caught:
        loads_stand(EIGHT + text, "s.yaml")
    assert words in str(caught.value)
    assert all(mistake.line for mistake in caught.value.mistakes)


def test_each_controller_has_its_letters_and_its_step_rate(eight, run, points):
    assert list(points.parts) == ["left", "right"]
    for name, part in points.parts.items():
        odd = name == "right"
        assert [axis.name for axis in part.axes] == [f"winch{k}" for k in range(odd, N, 2)]
        np.testing.assert_array_equal(part.motion.position, points.motion.position[:, odd::2])
        assert grbl_settings(part.map.stand, part.controller, 50.0).letters == "XYZA"
    with pytest.raises(StandError, match=r"several controllers \(left, right\)"):
        gcode_program(points)
    assert set_points(loads_stand(EIGHT + SHARED), run, eight, controller="fluidnc").parts
    slow = loads_stand(
        EIGHT + SHARED.replace("/dev/right, step_rate: 1.0e5", "/dev/right, step_rate: 100")
    )
    check = check_stand(slow, run, eight)
    assert {limit.axis for limit in check.broken} == {f"winch{k}" for k in range(1, N, 2)}
    assert {limit.quantity for limit in check.broken} == {"step rate"}


@pytest.mark.parametrize("slack", [0.0, 0.02])
def test_programs_of_all_controllers_keep_the_same_time(points, slack):
    """All motions begin at the common start, and every axis is within a step."""
    points = dataclasses.replace(points, slack=slack)
    machines = []
    for part in points.parts.values():
        machine = machine_of(part)
        for line in gcode_program(part).text.splitlines():
            assert machine.answer(line) == "ok", line
        machines.append(machine)
    begin = max(machine.dwell_ends[0] for machine in machines)
    at = positions_together(machines, begin + points.motion.t)
    counts = np.concatenate([part.counts for part in points.parts.values()], axis=1)
    steps = np.concatenate([machine.settings.steps for machine in machines])
    assert np.max(np.abs(np.rint(at * steps) - counts)) <= 1.0


def stream_both(emulators, points, programs, hold=None, should_resume=None):
    """Streams all programs; returns their progress, and the error if any."""
    counts = {name: StreamCounts() for name in programs}
    ports = {name: serial_port(emulators[name].port, 115_200) for name in programs}
    with ports["left"] as left, ports["right"] as right:
        channels = [
            Channel(
                port,
                gcode_lines(programs[name].text),
                name=name,
                start=programs[name].first_line,
                counts=counts[name],
            )
            for name, port in (("left", left), ("right", right))
        ]
        try:
            stream_together(channels, hold=hold, should_resume=should_resume, silence=5.0)
        except StreamError as error:
            return counts, error
    return counts, None


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
def test_the_motions_begin_together(points):
    """The first controller is ready long before the second, and waits for it."""
    lines = []
    programs = {name: gcode_program(part) for name, part in points.parts.items()}
    emulators = {
        name: Emulator(
            machine_of(part),
            pace=0.05 if name == "right" else 0.0,
            on_line=lambda text, _, name=name: lines.append((name, text)),
        )
        for name, part in points.parts.items()
    }
    with emulators["left"], emulators["right"]:
        emulators["right"].pace = 0.05
        _, error = stream_both(emulators, points, programs)
    assert error is None
    first_move = min(k for k, (_, text) in enumerate(lines) if re.match(r"G1.*F", text))
    assert {name for name, text in lines[:first_move] if text == "G93"} == {"left", "right"}


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
@pytest.mark.parametrize("event", ["restarts", "is unplugged", "refuses a line", "is stopped"])
def test_after_a_failure_of_one_both_continue_together_from_a_time(points, event):
    programs = {name: gcode_program(part) for name, part in points.parts.items()}
    if event == "refuses a line":
        text = programs["right"].text.splitlines()
        text[programs["right"].first_line + 20] = "G7"
        programs["right"] = dataclasses.replace(programs["right"], text="\n".join(text))
    emulators = {name: Emulator(machine_of(part), pace=0.01) for name, part in points.parts.items()}
    hold = threading.Event()

    def disturb(text, answer):
        right = emulators["right"]
        if len(right.lines) != programs["right"].first_line - 9 + 30:
            return
        if event == "restarts":
            terminal = os.open(right.port, os.O_WRONLY | os.O_NOCTTY)
            os.write(terminal, b"\x18")
            os.close(terminal)
        if event == "is stopped":
            hold.set()
        if event == "is unplugged":
            right.unplug()

    emulators["right"].on_line = disturb
    with emulators["left"], emulators["right"]:
        counts, error = stream_both(emulators, points, programs, hold, lambda: False)
        threading.Event().wait(0.2)
    words = {
        "restarts": "the controller restarted and dropped its lines (Grbl 1.1h",
        "is unplugged": "the connection is lost",
        "refuses a line": "error:20, this command is not known",
        "is stopped": "stopped here",
    }
    assert words[event] in str(error)
    if event != "is stopped":
        assert str(error).startswith("right: line ")
    assert emulators["left"].resets == 1  # the other one is stopped as well
    times = {
        name: programs[name].time_of(
            first_lost_line(
                programs[name].text, counts[name].last_line, points.parts[name].controller.planner
            )
        )
        for name in programs
    }
    t = min(times.values())
    assert 0.05 < t < 1.4
    continued = resume_points(points, t)
    for name, part in continued.parts.items():
        machine = emulators[name].machine
        machine.executed.clear()
        machine.dwell_ends.clear()
        own = gcode_program(part)
        for line in own.text.splitlines():
            assert machine.answer(line) == "ok", line
        at = machine.positions(machine.dwell_ends[0] + part.motion.t) * machine.settings.steps
        np.testing.assert_allclose(np.rint(at), part.counts, atol=1.0)
        np.testing.assert_array_equal(
            part.motion.position[-1], points.parts[name].motion.position[-1]
        )


def test_continuing_from_a_time_is_the_same_path_from_rest(points):
    """s rises linearly to ds/dt = 1, within half more than the largest acceleration."""
    for t in (0.0, 0.31, 0.9, 1.45, 1.4999):
        continued = resume_points(points, t)
        m, s = continued.motion, continued.resumed
        assert m.t[0] == 0.0 and s[0] == t and s[-1] == points.motion.t[-1]
        assert np.all(np.diff(m.t) > 0.0) and np.all(np.diff(s) > 0.0)
        T = points.ramp_time
        exact = np.where(m.t < T, t + m.t**2 / (2 * T), t + m.t - T / 2)
        np.testing.assert_allclose(s, exact, atol=1e-6)
        index = np.searchsorted(points.motion.t, s)
        low, high = np.maximum(index - 1, 0), np.minimum(index, len(points.motion.t) - 1)
        p = points.motion.position
        slack = 1e-3
        assert np.all(m.position >= np.minimum(p[low], p[high]) - slack)
        assert np.all(m.position <= np.maximum(p[low], p[high]) + slack)
        np.testing.assert_array_equal(m.velocity[0], 0.0)
    with pytest.raises(
        StandError, match=r"found 1\.5 s to continue from; the set points last 1\.5 s"
    ):
        resume_points(points, 1.5)


def test_half_a_stand_names_what_moves_elsewhere(eight, run, tmp_path):
    half = EIGHT[: EIGHT.index("  winch4:")]
    with pytest.raises(FileError, match=r"line4\.length.*list it under `elsewhere`"):
        check_stand(loads_stand(half), run, eight)
    others = ", ".join(f"line{k}.length" for k in range(4, N))
    stand = loads_stand(
        half + f"elsewhere: [{others}]\ncontroller: {{type: fluidnc, step_rate: 1.0e5}}\n"
    )
    check = check_stand(stand, run, eight)
    whole = check_stand(loads_stand(EIGHT + SHARED), run, eight)
    assert check.ok
    np.testing.assert_allclose(check.torque, whole.torque[:, :4], rtol=1e-9)
    path = save_points(set_points(stand, run, eight), tmp_path / "half.gcode")
    assert "line" not in path.read_text() and "; A = winch3 [mm]" in path.read_text()
    for text, words in (
        ("elsewhere: [line9.length]\n", "line9.length is not a driven coordinate"),
        ("elsewhere: [line0.length]\n", "an axis of this stand moves 'line0.length'"),
    ):
        with pytest.raises(FileError, match=words):
            AxisMap.from_stand(loads_stand(half + text), eight.coordinates)
