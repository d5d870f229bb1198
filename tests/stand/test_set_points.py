"""Set points: exported files, and their motion in an emulated controller."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
import yaml
from tests.stand.hoist import HOIST, STAND, lift

import fantoccini as fan
from fantoccini.base.errors import FileError, StandError
from fantoccini.stand import GrblMachine, gcode, grbl_settings, loads_stand, save_points, set_points

pytestmark = pytest.mark.medium

GENTLE = {"line.length": [(0.2, 0.8), (2.0, 0.5), (2.6, 0.5), (4.0, 0.75)]}
ABLE = STAND.replace("TORQUE", "0.5").replace("speed: 1\n", "speed: 2\n")
HOME = ABLE + "    home: {towards: min, at: 0.2, speed: 0.03}\n"


def replay_lines(points, inverse=True):
    """The machine after all lines, and its settings."""
    machine = GrblMachine(grbl_settings(points.map.stand, points.controller, points.rate))
    for line in gcode(points, inverse).splitlines():
        assert machine.answer(line) == "ok", line
    return machine


def step_errors(points, machine):
    """(T, n) steps between motors and plan at all set points."""
    at = machine.positions(machine.dwell_ends[0] + points.motion.t)
    return np.abs(np.rint(at * machine.settings.steps) - points.counts)


@pytest.mark.parametrize("inverse", [True, False])
@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0])
@pytest.mark.parametrize("sequences", [{}, {"home": True, "slack": 0.01, "park": True}])
def test_six_motors_are_within_a_step_at_all_set_points(conduct, rate, inverse, sequences):
    points = set_points("six_winches", conduct, rate=rate, controller="fluidnc", **sequences)
    machine = replay_lines(points, inverse)
    assert np.max(step_errors(points, machine)) <= 1.0
    if sequences:
        home = [axis.file.home.at + 0.002 for axis in points.axes]
        at_end = machine.positions(np.array([machine.time + 1.0]))[0]
        np.testing.assert_allclose(at_end, 1e3 * np.array(home), atol=0.06)  # 1.5 steps


@pytest.mark.parametrize(
    "text",
    [
        ABLE,
        ABLE.replace(
            "moves: {line.length: 1}", "moves: {line.length: -1}\n    reversed: true"
        ).replace("travel: [0.2, 0.9]", "travel: [-0.9, -0.2]"),
        # 160 steps per mm at 1.5 m/s, and a shaft, whose position is in degrees
        ABLE.replace("{type: drum, radius: 0.01}", "{type: screw, lead: 0.02}").replace(
            "inertia: 1.0e-5}", "inertia: 1.0e-7, microsteps: 16}"
        ),
        ABLE.replace("{type: drum, radius: 0.01}", "{type: shaft}")
        .replace("0.5, i", "5, i")
        .replace("inertia: 1.0e-5}", "inertia: 1.0e-5, microsteps: 256}"),
    ],
)
def test_holds_reversals_and_fine_steps(lifted, hoist, text):
    points = set_points(loads_stand(text), lifted, hoist, controller="grbl", force=True)
    assert np.max(step_errors(points, replay_lines(points))) <= 1.0


def test_a_puppet_on_the_emulated_steps_moves_as_in_its_run(hoist):
    x0 = hoist.rest({"line.length": 0.8})
    save_at = np.linspace(0.0, 4.5, 451)
    first = fan.simulate(hoist, x0, fan.Input.waypoints(hoist, GENTLE), 4.5, save_at=save_at)
    points = set_points(loads_stand(ABLE), first, hoist, controller="grbl")
    machine = replay_lines(points)
    t = points.motion.t[::2]
    p = 1e-3 * machine.positions(machine.dwell_ends[0] + t)
    inputs = fan.Input.samples(hoist, t, {"line.length": p[:, 0]})
    again = fan.simulate(hoist, hoist.rest({"line.length": p[0, 0]}), inputs, 4.5, save_at=save_at)
    poses = [hoist.poses(r.resample(save_at).q_D, r.resample(save_at).q_K) for r in (first, again)]
    away = np.linalg.norm(poses[0][..., 3] - poses[1][..., 3], axis=-1)
    assert 0.0 < np.max(away) < 1e-3


def test_marlin_counts_its_path_over_x_y_z_alone(conduct):
    points = set_points("six_winches", conduct, controller="marlin")
    lines = gcode(points).splitlines()
    first = next(line for line in lines[lines.index("; motion") + 1 :] if line.count("A"))
    assert "G93" not in lines and "M2" not in lines and lines[-1] == "M400"
    # The emulator measures paths over all axes; if only the ratio of speeds differs, F must too.
    other = gcode(set_points("six_winches", conduct, controller="grbl"), False).splitlines()
    k = lines.index(first) - lines.index("; motion") + other.index("; motion")
    assert other[k].split("F")[0] == first.split("F")[0]
    assert float(first.split("F")[1]) < float(other[k].split("F")[1])


def test_klipper_follows_the_set_points_by_its_own_rules(conduct):
    """SYNC=0 moves begin at the clock, which G4 advances; ACCEL=0 moves have constant speed."""
    points = set_points("six_winches", conduct, controller="klipper")
    at, until, clock, rows_sent = {}, {}, 0.0, []
    for line in gcode(points).splitlines():
        values = dict(re.findall(r"(\w+)=(\S+)", line))
        if "SET_POSITION" in values:
            at[values["STEPPER"]] = float(values["SET_POSITION"])
        elif "MOVE" in values:
            name, to = values["STEPPER"], float(values["MOVE"])
            assert values["ACCEL"] == "0" and until.get(name, 0.0) <= clock + 1e-6
            until[name] = clock + abs(to - at[name]) / float(values["SPEED"])
            at[name] = to
        elif line == "; motion":
            rows_sent.append([0.0, *at.values()])
        elif line.startswith("G4"):
            clock += 1e-3 * float(line.split("P")[1])
            assert max(until.values(), default=0.0) <= clock + 1e-6
            rows_sent.append([clock, *at.values()])
    rows_sent = np.array(rows_sent)
    np.testing.assert_allclose(rows_sent[:, 0], points.motion.t, atol=1e-6)
    np.testing.assert_allclose(rows_sent[:, 1:], 1e3 * points.motion.position, atol=1e-4)


def test_joint_trajectories_read_back(lifted, hoist, tmp_path):
    points = set_points(loads_stand(HOME), lifted, hoist, controller="ros2", slack=0.02, park=True)
    a, b = save_points(points, tmp_path / "a.json"), save_points(points, tmp_path / "b.yaml")
    read = json.loads(a.read_text())
    assert read == yaml.safe_load(b.read_text())
    assert read["joint_names"] == ["winch"]
    whole = points.complete_motion()
    stamps = [p["time_from_start"] for p in read["points"]]
    t = np.array([s["sec"] + 1e-9 * s["nanosec"] for s in stamps])
    np.testing.assert_allclose(t, whole.t, atol=1e-9)
    for name, values in (("positions", whole.position), ("velocities", whole.velocity)):
        np.testing.assert_array_equal([p[name] for p in read["points"]], values)
    # Slack is let out and wound in, then the run follows, then home.
    p, begin = whole.position[:, 0], len(whole) - np.argmax(whole.position[::-1, 0] == 0.8)
    assert np.all(np.diff(whole.t) > 0.0) and begin > 0
    assert p[0] == pytest.approx(0.8) and np.max(p) == pytest.approx(0.82)
    assert p[-1] == pytest.approx(0.202)
    # Velocities are those of the positions, and low before and after.
    slope = np.gradient(p, whole.t)
    assert np.max(np.abs(slope - whole.velocity[:, 0])) < 0.08  # a dt / 2 at the ends
    assert np.max(np.abs(whole.velocity[whole.t < 0.1])) <= 0.4


@pytest.mark.parametrize(
    ("kind", "column", "scale", "offset", "tolerance"),
    [
        ("csv", "winch [m]", 1.0, 0.0, 1e-8),
        ("odrive", "winch.position", 1.0 / (2.0 * np.pi * 0.01), 0.0, 1e-7),
        ("dynamixel", "winch", 4096.0 / (2.0 * np.pi * 0.01), 2048.0, 0.5),
    ],
)
def test_tables(lifted, hoist, tmp_path, kind, column, scale, offset, tolerance):
    points = set_points(loads_stand(ABLE), lifted, hoist, controller=kind, rate=40.0)
    path = save_points(points, tmp_path / "a.csv")
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["t [s]"]) for row in rows] == pytest.approx(np.arange(61) / 40.0)
    column_values = np.array([float(row[column]) for row in rows])
    np.testing.assert_allclose(
        column_values, offset + scale * points.motion.position[:, 0], atol=tolerance + 1e-9
    )


def test_impossible_motions_of_a_stand_are_refused(lifted, hoist, tmp_path):
    weak = loads_stand(ABLE.replace("0.5, i", "0.01, i"))
    with pytest.raises(StandError, match="cannot"):
        set_points(weak, lifted, hoist, controller="grbl")
    forced = set_points(weak, lifted, hoist, controller="grbl", force=True)
    assert len(forced) == 76 and gcode(forced).splitlines()[-1] == "M2"
    title = "; warning: one_winch cannot do it: at t = 0.000 s the torque"
    assert gcode(forced).splitlines()[1].startswith(title)
    able = loads_stand(ABLE)
    with pytest.raises(FileError, match="controller"):
        set_points(able, lifted, hoist)
    with pytest.raises(FileError, match="home"):
        set_points(able, lifted, hoist, controller="grbl", home=True)
    with pytest.raises(StandError, match="travel is"):
        set_points(able, lifted, hoist, controller="grbl", slack=0.2)
    with pytest.raises(StandError, match="homing is not part"):
        set_points(loads_stand(HOME), lifted, hoist, controller="csv", home=True).complete_motion()
    for kind, name in (("csv", "a.gcode"), ("grbl", "a.json"), ("grbl", "a.cfg")):
        with pytest.raises(StandError, match=r"needed|allowed"):
            save_points(set_points(able, lifted, hoist, controller=kind), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_look_ahead_and_the_port_bound_the_rate(conduct):
    fast = set_points("six_winches", conduct, rate=200.0, controller="grbl")
    with pytest.raises(StandError, match="115200 baud"):
        gcode(fast)
    stand = loads_stand(ABLE + "controller: {type: grbl, planner: 2, baud: 5000000}\n")
    hoist = fan.loads(HOIST)
    with pytest.raises(StandError, match="looks 1 moves ahead"):
        gcode(set_points(stand, lift(hoist), hoist, rate=200.0, force=True))


def test_the_machine_answers_with_grbls_numbers(lifted, hoist):
    points = set_points(loads_stand(ABLE), lifted, hoist, controller="grbl")
    machine = GrblMachine(grbl_settings(points.map.stand, points.controller, points.rate))
    wrong = {
        "G1X1": 22,
        "G7": 20,
        "X": 2,
        "!": 1,
        "$Z": 3,
        "G1X1F" + "0" * 90: 11,
        "G4": 2,
        "X1X2": 25,
        "G92": 26,
        "G1X1F10Q2": 36,
    }
    for line, number in wrong.items():
        assert machine.answer(line) == f"error:{number}", line
    machine.answer("G1X10F600")
    machine.finish()
    assert machine.position[0] == pytest.approx(10.0, abs=0.02)
    assert machine.time >= 1.0
