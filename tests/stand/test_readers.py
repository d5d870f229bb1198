"""Foreign readers of our files: a parser of G-code, Jinja2 as in Klipper, ROS messages."""

from __future__ import annotations

import configparser
import json
import shlex

import jinja2
import numpy as np
import pytest
import yaml
from gcodeparser import parse_gcode_lines
from rosbags.typesys import Stores, get_typestore

from fantoccini.stand import gcode, grbl_settings, save_points, set_points

pytestmark = pytest.mark.medium

SEQUENCES = {"home": True, "slack": 0.01, "park": True}


@pytest.mark.parametrize("kind", ["marlin", "fluidnc"])
@pytest.mark.parametrize("sequences", [{}, SEQUENCES])
def test_a_parser_of_gcode_finds_the_set_points_and_their_times(conduct, kind, sequences):
    """Marlin: path over X, Y and Z by F mm/min; FluidNC: F moves a minute (G93)."""
    points = set_points("six_winches", conduct, controller=kind, **sequences)
    settings = grbl_settings(points.map.stand, points.controller, points.rate)
    letters = settings.letters
    text, moves, clock, at, linear = gcode(points), [], 0.0, {}, "G94"
    number = text.splitlines().index("; motion")
    end = text.splitlines().index("; end")
    for line in parse_gcode_lines(text):
        command, values = line.command_str, line.params
        assert command in (
            "G1",
            "G4",
            "G10",
            "G21",
            "G28",
            "G90",
            "G92",
            "G93",
            "G94",
            "M2",
            "M400",
        )
        if command in ("G93", "G94"):
            linear = command
        before = {**at}
        if command in ("G1", "G10", "G92"):
            at |= {a: float(values[a]) for a in letters if a in values}
        if not number < line.line_index < end:
            continue
        if command == "G4":
            clock += values["P"] * (1e-3 if kind == "marlin" else 1.0)
        else:
            assert command == "G1"
            change = np.array([at[a] - before[a] for a in letters])
            length = (
                np.linalg.norm(change[:3]) if np.any(change[:3]) else np.linalg.norm(change[3:])
            )
            clock += 60.0 / values["F"] * (length if linear == "G94" else 1.0)
        moves.append([clock, *(at[a] for a in letters)])
    moves = np.array(moves)
    steps = np.rint(moves[:, 1:] * settings.steps)
    # Every set point with a motion is there, in order; short holds creep by a step.
    counts = points.counts
    moved = np.flatnonzero(np.any(np.diff(counts, axis=0), axis=1)) + 1
    place = 0
    for k in moved:
        same = np.flatnonzero(np.all(steps[place:] == counts[k], axis=1))
        assert len(same), points.motion.t[k]
        place += same[0]
        # Constant speeds are faster than the mean, because of the ramps, but only slightly.
        assert -0.05 < moves[place, 0] - points.motion.t[k] < 1e-3
    # All other rows are within a step of a set point.
    for row in steps:
        assert np.min(np.max(np.abs(counts - row), axis=1)) <= 0.02 * 0.5 * settings.steps[0] + 1


@pytest.mark.parametrize("sequences", [{}, SEQUENCES])
def test_klipper_reads_its_macro(conduct, sequences, tmp_path):
    """The library for configurations and the templates are those of Klipper."""
    points = set_points("six_winches", conduct, controller="klipper", **sequences)
    path = save_points(points, tmp_path / "conduct.cfg")
    config = configparser.RawConfigParser(strict=True, inline_comment_prefixes=(";", "#"))
    with path.open(encoding="utf-8") as file:
        config.read_file(file)
    (section,) = config.sections()
    assert section == "gcode_macro FANTOCCINI" and list(config[section]) == ["gcode"]
    name = section.split()[1]
    assert name.upper() == name and name.replace("_", "A").isalnum()
    template = jinja2.Environment("{%", "%}", "{", "}", undefined=jinja2.StrictUndefined)
    script = template.from_string(config.get(section, "gcode")).render()
    lines = [line.strip() for line in script.split("\n") if line.strip()]
    own = [x.strip() for x in gcode(points).splitlines() if not x.startswith(";")]
    assert lines == own
    at = {axis.name: [] for axis in points.axes}
    for line in lines:
        command, *words = shlex.split(line, comments=True)
        if command == "G4":
            assert len(words) == 1 and float(words[0].removeprefix("P")) > 0.0
            continue
        assert command == "MANUAL_STEPPER"
        values = dict(word.split("=", 1) for word in words)
        assert set(values) <= {
            "STEPPER",
            "ENABLE",
            "SET_POSITION",
            "MOVE",
            "SPEED",
            "ACCEL",
            "SYNC",
            "STOP_ON_ENDSTOP",
        }
        assert float(values.get("SPEED", 1.0)) > 0.0 and float(values.get("ACCEL", 0.0)) >= 0.0
        for key in ("MOVE", "SET_POSITION"):
            if key in values:
                at[values["STEPPER"]].append(float(values[key]))
    for axis, column in zip(points.axes, 1e3 * points.motion.position.T, strict=True):
        changes = column[np.append(True, np.diff(np.round(column, 4)) != 0.0)]
        positions = np.array(at[axis.name])
        first = len(positions) - len(changes) - (1 if sequences else 0)
        np.testing.assert_allclose(
            positions[first : first + len(changes)], changes, atol=1e-4, err_msg=axis.name
        )


@pytest.mark.parametrize("ending", [".json", ".yaml"])
def test_ros_reads_the_trajectory_as_a_message(conduct, ending, tmp_path):
    """Every field, and no other; as bytes of ROS 2 and back."""
    points = set_points("six_winches", conduct, controller="ros2", slack=0.01, park=True)
    path = save_points(points, tmp_path / f"conduct{ending}")
    text = path.read_text(encoding="utf-8")
    store = get_typestore(Stores.ROS2_HUMBLE)
    message = typed_message(
        store,
        "trajectory_msgs/msg/JointTrajectory",
        json.loads(text) if ending == ".json" else yaml.safe_load(text),
    )
    again = store.deserialize_cdr(
        store.serialize_cdr(message, message.__msgtype__), message.__msgtype__
    )
    motion = points.complete_motion()
    assert again.joint_names == [axis.name for axis in points.axes]  # type: ignore[attr-defined]
    assert len(again.points) == len(motion)  # type: ignore[attr-defined]
    for name, values in (
        ("positions", motion.position),
        ("velocities", motion.velocity),
        ("accelerations", motion.acceleration),
    ):
        np.testing.assert_array_equal([getattr(p, name) for p in again.points], values)  # type: ignore[attr-defined]
    stamps = [p.time_from_start for p in again.points]  # type: ignore[attr-defined]
    t = np.array([s.sec + 1e-9 * s.nanosec for s in stamps])
    np.testing.assert_allclose(t, motion.t, atol=1e-9)
    assert np.all(np.diff(t) > 0.0)
    with pytest.raises(TypeError):
        typed_message(store, message.__msgtype__, json.loads('{"joint_names": [], "point": []}'))


def typed_message(store, kind, data):
    """The message of plain data, by the definitions of the message's type."""
    fields = dict(store.fielddefs[kind][1])
    arguments = {}
    for name, value in data.items():
        if name not in fields:
            raise TypeError(name)
        what, detail = fields[name]
        if what == 2:  # another message
            value = typed_message(store, detail, value)
        elif what in (3, 4):  # a list
            inner, of = detail[0]
            value = (
                [typed_message(store, of, x) for x in value]
                if inner == 2
                else value
                if of[0] == "string"
                else np.array(value, np.float64)
            )
        arguments[name] = value
    return store.types[kind](**arguments)
