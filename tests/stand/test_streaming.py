"""Streaming to the emulated controller over a pseudo-terminal."""

from __future__ import annotations

import dataclasses
import sys
import threading

import numpy as np
import pytest
from tests.stand.hoist import HOIST, STAND, lift

import fantoccini as fan
from fantoccini.base.errors import StandError, StreamError
from fantoccini.stand import (
    Emulator,
    GrblMachine,
    StreamCounts,
    first_lost_line,
    gcode,
    gcode_lines,
    gcode_program,
    grbl_settings,
    loads_stand,
    resume_lines,
    serial_port,
    set_points,
    stream,
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
ABLE = STAND.replace("TORQUE", "0.5").replace("speed: 1\n", "speed: 2\n")


@pytest.fixture(scope="module")
def points():
    hoist = fan.loads(HOIST)
    return set_points(loads_stand(ABLE), lift(hoist), hoist, controller="grbl")


def machine_of(points):
    return GrblMachine(grbl_settings(points.map.stand, points.controller, points.rate))


@pytest.mark.parametrize("counting", [True, False])
def test_a_streamed_motion_is_that_of_the_file(points, counting):
    emulator = Emulator(machine_of(points), pace=1e-3)
    with emulator, serial_port(emulator.port, 115_200) as port:
        done = stream(port, gcode_lines(gcode(points)), counting=counting)
    assert emulator.overrun == 0 and emulator.max_buffered <= 128 and done.max_unanswered <= 127
    assert (done.max_unanswered > 90) == counting  # the buffer is used
    assert emulator.lines == [line.text for line in gcode_lines(gcode(points))]
    machine = emulator.machine
    at = machine.positions(machine.dwell_ends[0] + points.motion.t) * machine.settings.steps
    assert np.max(np.abs(np.rint(at) - points.counts)) <= 1.0


def test_the_emulator_loses_lines_beyond_its_buffer(points):
    """The test above can fail: a stream that counts too high overruns the buffer."""
    emulator = Emulator(machine_of(points), pace=5e-3)
    with emulator, serial_port(emulator.port, 115_200) as port, pytest.raises(StreamError):
        stream(port, gcode_lines(gcode(points)), buffer=2000, silence=0.5)
    assert emulator.overrun > 0


def test_an_error_stops_the_stream_with_line_and_reason(points):
    text = gcode(points).splitlines()
    k = text.index("; motion") + 20
    text[k] = "G7"
    with Emulator(machine_of(points), pace=1e-3) as emulator:
        with serial_port(emulator.port, 115_200) as port, pytest.raises(StreamError) as stopped:
            stream(port, gcode_lines("\n".join(text)))
        threading.Event().wait(0.1)  # time for the reset to arrive
    assert (stopped.value.line, stopped.value.text) == (k + 1, "G7")
    assert "error:20, this command is not known" in str(stopped.value)
    assert emulator.resets == 1
    assert len(emulator.lines) < len(gcode_lines("\n".join(text)))


def test_a_hold_resumes_or_stops(points):
    lines, hold, asked = gcode_lines(gcode(points)), threading.Event(), []

    def hold_at_line_20(at):
        if at.done == 20:
            hold.set()

    for answer in (True, False):
        with Emulator(machine_of(points), pace=5e-3) as emulator:

            def should_resume(progress, emulator=emulator, answer=answer):
                threading.Event().wait(0.1)
                asked.append(emulator.held)
                return answer

            with serial_port(emulator.port, 115_200) as port:
                if answer:
                    stream(
                        port,
                        lines,
                        progress=hold_at_line_20,
                        hold=hold,
                        should_resume=should_resume,
                    )
                    assert emulator.lines == [line.text for line in lines]
                else:
                    counts = StreamCounts()
                    with pytest.raises(StreamError, match="stopped here") as stopped:
                        stream(
                            port,
                            lines,
                            progress=hold_at_line_20,
                            hold=hold,
                            should_resume=should_resume,
                            counts=counts,
                        )
                    assert stopped.value.line > lines[19].number
                    # Answers that arrived during the hold count.
                    assert counts.last_line == lines[len(emulator.lines) - 1].number
    assert asked == [True, True]


def test_a_stream_resumes_from_a_line(points):
    text = gcode(points)
    lines = gcode_lines(text)
    machine = machine_of(points)
    for line in lines[:40]:
        assert machine.answer(line.text) == "ok"
    machine.reset()  # waiting moves are lost
    for line in resume_lines(text, lines[40].number):
        assert machine.answer(line.text) == "ok", line
    t0 = points.motion.t[-1] - points.motion.t
    at = machine.positions(machine.time - t0) * machine.settings.steps
    # The first moves are late after a stop; the end is the same.
    assert abs(np.rint(at[-1, 0]) - points.counts[-1, 0]) <= 1.0
    assert machine.position[0] == pytest.approx(1e3 * points.motion.position[-1, 0], abs=0.02)
    with pytest.raises(StandError, match="no line 9999"):
        resume_lines(text, 9999)


def test_lines_that_a_reset_may_have_lost(points):
    """The line to resume from is the position at the stop, or at most one line before it."""
    text = gcode(points)
    lines = gcode_lines(text)
    for taken in (8, 20, 40, 50, 60):
        machine = machine_of(points)
        for line in lines[:taken]:
            machine.answer(line.text)
        machine.reset()
        first = first_lost_line(text, lines[taken - 1].number, points.controller.planner)
        begin = resume_lines(text, first, 6000.0)
        at = machine.position[0]
        assert [line.text for line in begin[:3]] == ["G21", "G90", "G94"]
        go_back = float(begin[3].text.split("X")[1].split("F")[0])
        assert begin[3].text.endswith("F6000") and go_back == pytest.approx(at, abs=31.0)
        for line in begin:
            assert machine.answer(line.text) == "ok"
        machine.finish()
        assert machine.position[0] == pytest.approx(1e3 * points.motion.position[-1, 0], abs=0.02)


def test_a_program_knows_the_longest_wait_for_an_answer():
    """The emulator times all moves by itself, and executes them as late as the planner allows."""
    home, hoist = "    home: {towards: min, at: 0.2, speed: 0.03}\n", fan.loads(HOIST)
    points = set_points(
        loads_stand(ABLE + home), lift(hoist), hoist, controller="grbl", slack=0.05, park=True
    )
    program, machine, waits = gcode_program(points), machine_of(points), []
    for line in gcode_lines(program.text):
        begun = machine.time
        assert machine.answer(line.text) == "ok"
        waits.append(machine.time - begun)
    assert 1.5 < max(waits) < program.max_wait < 2.0 * max(waits)
    homing = gcode_program(dataclasses.replace(points, home=True))
    assert homing.max_wait > 0.7 / 0.03


def test_silence_and_wrong_ports_are_reported(points):
    with Emulator(machine_of(points)) as emulator:
        emulator.held = True
        refused = pytest.raises(StreamError, match=r"no answer in 0\.3 s")
        with serial_port(emulator.port, 115_200) as port, refused:
            stream(port, gcode_lines("G21\n"), silence=0.3)
    with (
        pytest.raises(StandError, match=r"not_there: No such file or directory$"),
        serial_port("/dev/not_there", 9600),
    ):
        pass
    with pytest.raises(StreamError, match="longer than the buffer"):
        stream(None, gcode_lines("X" * 200))
