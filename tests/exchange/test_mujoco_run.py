"""Simulations in MuJoCo compared with event-driven ones: motion, tensions and limit forces."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.mujoco import mujoco_run

pytestmark = pytest.mark.medium

MIXED = """
puppet: mixed
bodies:
  # A trolley that is driven, with mass; under it an arm on a ball joint whose twist is limited.
  - name: trolley
    joint: {type: prismatic, axis: [1, 0, 0], at: [0, 0, 1], driven: true}
    mass: 1.0
    inertia: [0.01, 0.01, 0.01]
  - name: arm
    parent: trolley
    joint:
      type: ball
      name: shoulder
      damping: 0.01
      orientation: {axis: [0, 1, 0], angle: 30 deg}
      twist: {axis: [1, 0, 0], lower: -20 deg, upper: 25 deg}
    mass: 0.3
    com: [0.2, 0.1, 0]
    inertia: [2.0e-3, 4.0e-3, 4.0e-3]
  - name: slider
    parent: arm
    joint:
      {type: prismatic, name: slot, axis: [1, 0, 0], damping: 1.0, limits: {upper: 0.2}}
    mass: 0.2
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  # And a lamp that nods, held by a wire.
  - name: lamp
    joint: {type: revolute, axis: [0, 1, 0], at: [0, 0.5, 0], damping: 5.0e-3}
    mass: 0.2
    com: [0.1, 0, 0]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  # A bob on a cone.
  - name: bob
    joint:
      {type: ball, name: neck, at: [0, -0.5, 0], damping: 5.0e-3,
       cone: {max: 20 deg, axis: [0.3, 0, 1]}}
    mass: 0.2
    com: [0, 0, 0.1]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
strings:
  - name: line
    path: [{body: arm, at: [0.4, 0, 0]}, {world: [0.5, 0, 1.5]}, {driven: [z], at: [1, 0.2, 1]}]
    length: driven
  - name: stay
    path: [{body: lamp, at: [0.2, 0, 0]}, {world: [0.3, 0.5, 0.3]}]
    length: 0.3
    wire: true
pose: {line.length: 1.3}
"""


@pytest.fixture(scope="module")
def mixed() -> fan.Marionette:
    return fan.loads(MIXED)


@pytest.fixture(scope="module")
def start(mixed) -> fan.State:
    return mixed.rest({"shoulder.rotation": [0.0, 0.3, 0.0], "lamp": 0.3})


def test_a_free_flight_agrees_to_six_digits():
    """The full marionette, thrown and pushed, before a string or limit is reached."""
    puppet = fan.puppets.marionette()
    lengths = {f"{s.name}.length": 1.5 for s in puppet.tree.strings}
    x = puppet.state(lengths | {"elbow_left": 0.5, "elbow_right": 0.7, "knee_joint_left": 0.4})
    x = x.replace(v_D=np.random.default_rng(0).normal(size=25))
    pushed = fan.Input.hold(puppet).with_forces({"torso.y": [(0.0, 2.0), (0.1, 2.0)]})
    ours = fan.simulate(puppet, x, pushed, t_end=0.1)
    theirs = mujoco_run(puppet, x, pushed, 0.1, 1e-3)
    assert not ours.events and theirs.t[-1] == 0.1
    assert np.abs(theirs.q_D[-1] - ours.q_D[-1]).max() < 1e-6
    assert np.abs(theirs.v_D[-1] - ours.v_D[-1]).max() < 1e-6
    for part in ("kinetic", "potential"):
        assert theirs.ledger[part][-1] == pytest.approx(ours.ledger[part][-1], rel=1e-6)


def test_driven_joints_wires_cones_twists_and_slots_move_together(mixed, start):
    moves = {"trolley": [(0, 0.0), (0.4, 0.2)], "line.z": [(0, 1.0), (0.4, 1.1)]}
    inputs = fan.Input.waypoints(mixed, moves)
    ours = fan.simulate(mixed, start, inputs, t_end=3.0, method=fan.Event(rtol=1e-8, atol=1e-8))
    theirs = mujoco_run(mixed, start, inputs, 3.0, 1e-3)
    assert theirs.method == "mujoco" and theirs.status is fan.Status.DONE
    assert np.abs(theirs.at(0.4).q_D - ours.at(0.4).q_D).max() < 5e-3
    assert np.abs(theirs.q_D[-1] - ours.q_D[-1]).max() < 1e-3
    assert theirs.violation.values.max() < 2e-3
    # The puppet comes to rest, and soft strings and limits then exert the forces of rigid ones.
    for there, here in ((theirs.tension, ours.tension), (theirs.limit_force, ours.limit_force)):
        assert np.allclose(there.values[-1], here.values[-1], atol=0.01)
    held = {name for name, force in theirs.limit_force.items() if force[-1] > 0.05}
    assert held == {"shoulder.twist.lower", "slot.upper", "neck.cone"}
    assert abs(theirs.tension["stay"][-1]) > 0.1 and theirs.tension["line"][-1] > 0.1


def test_violations_are_proportional_to_the_square_of_the_step(mixed, start):
    """Under a constant force a violation is proportional to the square of the time constant."""
    held = fan.Input.hold(mixed)
    runs = [mujoco_run(mixed, start, held, 0.2, dt) for dt in (2e-3, 1e-3)]
    coarse, fine = (run.violation["line"][-1] for run in runs)
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_a_run_that_diverges_ends_before_it_is_not_finite(mixed, start):
    wild = start.replace(v_D=start.v_D + 1e200 * (np.array(mixed.coordinates.v_D) == "neck.wz"))
    run = mujoco_run(mixed, wild, fan.Input.hold(mixed), 0.2, 1e-3)
    assert run.status is fan.Status.NOT_FINITE and run.t[-1] < 0.2
    assert np.all(np.isfinite(run.q_D))
