"""Drives in puppet files: mistakes, and drives in mirrors and in scenes."""

from __future__ import annotations

import pytest

import fantoccini as fan
from fantoccini.base.errors import ExchangeError, PuppetError
from fantoccini.dynamics.mujoco import mjcf
from fantoccini.model.puppet import Puppet, loads
from fantoccini.model.scene import Scene, assembled
from fantoccini.model.tree import grow

pytestmark = pytest.mark.own_puppets

RIG = """\
puppet: rig
mirror: {plane: xz, from: left, to: right}
bodies:
  - {name: weight, joint: {type: free}, mass: 0.3, inertia: [0.001, 0.001, 0.001]}
  - name: bar
    joint: {type: free, driven: true, at: [0, 0, 1]}
    mass: 0.1
    inertia: [0.001, 0.001, 0.001]
  - {name: crank, joint: {type: revolute, axis: [1, 0, 0], driven: true}}
strings:
  - {name: wire_left, path: [{body: weight}, {driven: [x, y], at: [0, 0.2, 1]}], length: driven}
  - {name: stay, path: [{body: weight}, {body: bar}], length: 1}
pose: {bar.rotation: [0, 0, 0.3], wire_left.length: 0.9}
"""
PD = "control: {type: pd, stiffness: 10, damping: 1}"


def rig(*drives: str) -> str:
    return RIG + "drives:\n" + "".join(f"  - {{{d}}}\n" for d in drives)


@pytest.mark.parametrize(
    "drive, key, message",
    [
        (f"on: wire_lft.length, mass: 1, {PD}", "on", "did you mean 'wire_left.length'"),
        (f"on: weight.x, mass: 1, {PD}", "on", "no driven coordinate is called 'weight.x'"),
        (f"on: stay.length, mass: 1, {PD}", "on", "no driven coordinate"),
        (f"on: [bar.x, bar.x], mass: 1, {PD}", "on[1]", "has a drive already, drives[0]"),
        (f"on: [], mass: 1, {PD}", "on", "needed: one or more driven coordinates"),
        (f"on: 5, inertia: 1, {PD}", "on", "found 5; needed: a driven coordinate, or a list"),
        (f"on: true, inertia: 1, {PD}", "on", "found true; needed: a driven coordinate"),
        (f"on: {{a: 1}}, inertia: 1, {PD}", "on", "needed: a driven coordinate, or a list"),
        (f"on: bar.x, {PD}", "", "needed: mass, inertia or both"),
        (f"on: bar.x, inertia: 1e-5, {PD}", "inertia", "needed: the drum"),
        (f"on: bar.x, mass: 1, drum: 0.1, {PD}", "drum", "a drum without a rotor"),
        (
            f"on: crank, mass: 1, {PD}",
            "mass",
            "crank turns; allowed: inertia and gear, but not mass",
        ),
        (f"on: crank, inertia: 1, drum: 0.1, {PD}", "drum", "crank turns"),
        ("on: crank, inertia: 1, motor: {type: servo, torque: 1}", "", "a motor without control"),
        (
            f"on: crank, inertia: 1, motor: {{type: stepper, torque: 1}}, {PD}",
            "",
            "a stepper follows its command by itself",
        ),
        (
            "on: bar.rotation, inertia: 1, motor: {type: stepper, torque: 1}",
            "motor.type",
            "turns about three axes",
        ),
        (
            f"on: crank, inertia: 1, motor: {{type: turbine}}, {PD}",
            "motor.type",
            "allowed: servo, dc, stepper",
        ),
        ("on: crank, inertia: 1, control: {type: pid}", "control.type", "allowed: pd, computed"),
        (f"on: crank, inertia: -1, {PD}", "inertia", "needed: a positive number"),
        (
            "on: crank, inertia: 1, motor: {type: stepper, torque: 1, steps: 1.5}",
            "motor.steps",
            "needed: a whole number",
        ),
    ],
)
def test_mistakes(drive, key, message):
    with pytest.raises(PuppetError) as caught:
        loads(rig(drive))
    (problem,) = caught.value.mistakes
    assert message in problem.message
    assert problem.key == "drives[0]" + (f".{key}" if key else "")
    assert problem.line == RIG.count("\n") + 2


@pytest.mark.parametrize("first, second", [("left", "right"), ("right", "left")])
def test_twins_share_one_drive(first, second):
    """A drive on either twin drives both; one drive may list both names."""
    first_drive, second_drive = (
        f"on: wire_{side}.length, mass: 1, {PD}" for side in (first, second)
    )
    with pytest.raises(PuppetError) as caught:
        loads(rig(first_drive, second_drive))
    (problem,) = caught.value.mistakes
    assert "wire_right.length" in problem.message
    assert "has a drive already, drives[0]" in problem.message
    assert (problem.key, problem.line) == ("drives[1].on", RIG.count("\n") + 3)
    both = loads(rig(f"on: [wire_{first}.length, wire_{second}.length], mass: 1, {PD}"))
    assert len(both.expanded().drives[0].on) == 2


def test_the_schema_accepts_valid_files():
    parts = Puppet.model_json_schema()["$defs"]
    assert [kind["type"] for kind in parts["Drive"]["properties"]["on"]["anyOf"]] == [
        "string",
        "array",
    ]
    for key in ("steps", "microsteps"):
        bounds = parts["StepperMotor"]["properties"][key]
        assert (bounds["minimum"], bounds["maximum"]) == (1, 100_000)


def test_a_file_reads_back():
    puppet = loads(rig(f"on: bar.rotation, inertia: 1e-3, {PD}", f"on: wire_left.x, mass: 1, {PD}"))
    assert loads(puppet.to_yaml()) == puppet


def test_both_twins_get_drives():
    puppet = loads(rig(f"on: [wire_left.length, wire_left.y], mass: 1, {PD}"))
    table = grow(puppet).coordinates
    assert set(table.commands) == {
        f"wire_{side}.{what}" for side in ("left", "right") for what in ("length", "y")
    }
    # Only one axis of this end has a drive: x is moved by hand, y by a motor.
    assert {"wire_right.x", "wire_right.command.y"} <= set(table.q_K)
    assert "wire_right.y" in table.q_D
    start_values = dict(zip(table.q_K, table.start_K, strict=True))
    assert start_values["wire_right.command.y"] == -0.2
    assert start_values["wire_left.command.length"] == 0.9


def test_a_free_joint_with_a_drive_is_split():
    """A motor moves bar.z, on x and y, which hands move; z carries the driven rotation."""
    puppet = loads(rig(f"on: bar.z, mass: 1, {PD}"))
    tree = grow(puppet)
    links = {link.name: link for link in tree.links}
    assert [links[n].role for n in ("bar.carriage1", "bar.carriage2", "bar")] == [
        "driven",
        "dynamic",
        "driven",
    ]
    assert "bar.rotation" in tree.coordinates.rotations


def test_several_puppets_keep_their_drives_apart():
    drive = "on: wire_left.length, mass: {parameter: load, value: 1}, " + PD
    first = loads(rig(drive))
    other = loads(rig(drive).replace("puppet: rig", "puppet: other"))
    tree = grow(assembled(Scene.of(first, other)))
    assert "other.wire_right.length" in tree.coordinates.commands
    assert tree.drives[-1].drive.mass.parameter == "other.load"


def test_exports_that_would_lose_drives_are_refused():
    with pytest.raises(ExchangeError, match="crank: has a drive"):
        mjcf(fan.loads(rig(f"on: crank, inertia: 1, {PD}")))
