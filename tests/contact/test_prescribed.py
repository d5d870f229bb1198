"""Overlaps prescribed by the inputs are measured and reported, by both methods."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import Status
from fantoccini.kernel.contract import EventCode

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

PUPPET = """
puppet: hands
floor: 0
gravity: [0, 0, -9.81]
contact: {friction: 0.4}
obstacles:
- {name: wall, type: box, size: [0.001, 2, 2], at: [1, 0, 1]}
bodies:
- name: box
  joint: {type: free, driven: true}
  shapes: [{type: box, size: [0.2, 0.2, 0.2], mass: 1}]
- name: ball
  joint: {type: free, driven: true}
  shapes: [{type: sphere, radius: 0.005, mass: 0.1}]
- {name: bob, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 0.2}]}
pose: {box.z: 0.5, ball.x: 0.5, ball.z: 1.2, bob.x: -1, bob.z: 0.05}
"""
METHODS = ("event", "timestepping")


@pytest.fixture(scope="module")
def hands() -> fan.Marionette:
    return fan.loads(PUPPET)


def moved(hands: fan.Marionette, **ways: list[tuple[float, float]]) -> fan.Input:
    waypoints = {name.replace("_", "."): way for name, way in ways.items()}
    return fan.Input.waypoints(hands, waypoints)


def run(hands: fan.Marionette, inputs: fan.Input, method: str, **more: object) -> fan.Trajectory:
    return fan.simulate(hands, hands.state(), inputs, method=method, throw=False, **more)


def pair_events(motion: fan.Trajectory, name: str) -> list[tuple[str, float]]:
    return [(str(e.kind.value), e.t) for e in motion.events if e.name == name]


@pytest.mark.parametrize("method", METHODS)
def test_a_driven_body_that_passes_through_the_floor_is_reported(hands, method):
    """A box that ends entirely below the floor: status, depth, and the time of the touch."""
    down = moved(hands, box_z=[(0, 0.5), (1, -0.3)])
    motion = run(hands, down, method)
    assert motion.status is Status.OVERSTEPPED
    (touch,) = pair_events(motion, "box|floor")
    assert touch[0] == "touch"
    t = touch[1]
    assert down.evaluate(t)[0][hands.coordinates.q_K.index("box.z")] == pytest.approx(0.1, abs=2e-6)
    with pytest.raises(fan.errors.SimulationError, match=r"box\|floor overlap by 0\.4 m") as error:
        fan.simulate(hands, hands.state(), down, method=method)
    assert error.value.trajectory.t[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("method", METHODS)
def test_driven_bodies_that_pass_through_one_another_or_a_thin_wall_are_reported(hands, method):
    """This holds between two samples, too: motions between checks are bounded."""
    through = moved(hands, ball_x=[(0, 0.5), (0.05, 1.5)])
    motion = run(hands, through, method)
    assert motion.status is Status.OVERSTEPPED
    assert [kind for kind, _ in pair_events(motion, "ball|wall")] == ["touch", "lift"]
    met = moved(
        hands,
        ball_x=[(0, 0.5), (0.5, 0.0)],
        ball_z=[(0, 1.2), (0.5, 1.2)],
        box_z=[(0, 0.5), (0.5, 1.2)],
    )
    motion = run(hands, met, method)
    assert motion.status is Status.OVERSTEPPED
    assert {e.name for e in motion.events} >= {"ball|box"}


@pytest.mark.parametrize("method", METHODS)
def test_driven_bodies_that_only_touch_or_keep_apart_are_sound(hands, method):
    """A box lowered onto the floor overlaps nothing."""
    down = moved(hands, box_z=[(0, 0.5), (0.5, 0.1), (0.6, 0.1), (1, 0.5)])
    motion = run(hands, down, method)
    assert motion.status is Status.DONE
    assert pair_events(motion, "box|floor") == []
    assert run(hands, fan.Input.hold(hands), method, t_end=0.1).status is Status.DONE


def test_batches_and_steppers_report_prescribed_overlaps(hands):
    down = moved(hands, box_z=[(0, 0.5), (0.4, -0.3)])
    up = moved(hands, box_z=[(0, 0.5), (0.4, 0.8)])
    for method in METHODS:
        batch = fan.simulate_batch(hands, hands.state(), [down, up], method=method)
        assert batch.status.tolist() == [Status.OVERSTEPPED, Status.DONE]
        stepper = hands.stepper(hands.state(), method=method)
        touches: list[float] = []
        for _ in range(20):
            stepper.advance(0.02, {"box.z": -10.0})
            touches += stepper.events[stepper.events[:, 1] == EventCode.TOUCH, 0].tolist()
        # The lower face is down after sqrt(2 0.4 / 10) s, and in another event the bob may touch.
        assert np.any(np.isclose(touches, np.sqrt(0.08), atol=1e-5))
        assert stepper.state.t == pytest.approx(0.4)
        assert stepper.violation == pytest.approx(0.4, abs=1e-3)


def test_a_pair_that_does_not_meet_is_not_measured():
    rule = "contact: {friction: 0.4, pairs: [{between: [box, floor], meet: false}]}"
    hands = fan.loads(PUPPET.replace("contact: {friction: 0.4}", rule))
    down = moved(hands, box_z=[(0, 0.5), (1, -0.3)])
    assert run(hands, down, "timestepping").status is Status.DONE
