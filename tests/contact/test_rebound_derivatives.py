"""Derivatives of steps and rollouts with a rebound within a step."""

from __future__ import annotations

import pytest

import fantoccini as fan
from contact.bodies import thrown
from contact.files import BOUNCER
from contact.test_contact_rollout_gradient import Case, check_differences, check_products
from contact.test_contact_step_derivatives import DifferenceSizes, check_step

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

OTHER_AWAY = {"other.x": -50.0, "other.z": 5.0}
# Forces are large, and so is the rounding of their differences.
WIDE = DifferenceSizes(q=1e-6, v=1e-5, a=1e-3)
AT_FLOOR = {"ball.x": 1.5, "ball.y": 0.3, "ball.z": -10.0, "ball.wx": 4.0, "ball.wy": 3.0}

# A heel that springs back, and on a hinge a toe that does not.
SHOE = """
puppet: shoe
floor: 0
contact:
  friction: 0.4
  restitution: 0.8
  pairs: [{between: [toe, floor], restitution: 0}]
bodies:
- {name: heel, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 1}]}
- name: toe
  parent: heel
  joint: {name: hinge, type: revolute, axis: [0, 1, 0]}
  shapes: [{type: sphere, radius: 0.03, mass: 0.4, at: [0.2, 0, 0]}]
"""


@pytest.fixture(scope="module")
def bouncer() -> fan.Marionette:
    return fan.loads(BOUNCER)


@pytest.mark.parametrize("gap", [1e-3, 8e-3, 19e-3])
def test_a_step_with_a_rebound_has_the_derivatives_of_its_touch(bouncer, gap):
    """dz+ = -e dz + ..., across the floor from the touch on; friction changes spin and slides."""
    x = thrown(bouncer, {**OTHER_AWAY, "ball.z": 0.05 + gap}, AT_FLOOR)
    lin = check_step(bouncer, x, ["stick"], steps=WIDE)
    check_step(
        bouncer,
        thrown(bouncer, {**OTHER_AWAY, "ball.z": 0.05 + gap}, AT_FLOOR | {"ball.x": 40.0}),
        ["slide"],
        steps=WIDE,
    )
    z, v_z = 2, 12 + 2
    left = 0.002 - gap / 10.0
    assert lin.A[z, z] == pytest.approx(-0.8, rel=1e-9)
    assert lin.A[z, v_z] == pytest.approx(-0.8 * left - 0.8 * gap / 10.0, rel=1e-9)
    assert lin.A[v_z, v_z] == pytest.approx(-0.8, rel=1e-9)


def test_balls_that_meet_within_a_step_have_its_derivatives(bouncer):
    place = {"ball.z": 5.0, "other.x": 0.12 * 0.8 + 0.012, "other.z": 5.0 + 0.12 * 0.6}
    speed = {"ball.x": 9.0, "ball.y": 0.5, "other.x": -3.0, "other.wz": 5.0}
    check_step(bouncer, thrown(bouncer, place, speed), ["stick"], steps=WIDE)


def test_gradients_of_rollouts_go_through_touches_within_steps(bouncer):
    """The ball rebounds from the floor in the step between two nodes, and continues."""
    x = thrown(bouncer, {**OTHER_AWAY, "ball.z": 0.05 + 0.027}, AT_FLOOR)
    case = Case.of(bouncer, x, 4)
    check_products(case)
    run = check_differences(case)
    assert run.n_contacts.tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize(
    ("along", "modes"), [(0.0, ["stick", "slide"]), (40.0, ["slide", "slide"])]
)
def test_a_landing_in_the_rest_of_a_step_has_its_derivatives(along, modes):
    """Regression: refused. What is left of the step after the touch changes with its start."""
    shoe = fan.loads(SHOE)
    place = {"heel.z": 0.053, "hinge": 0.08}
    speed = {"heel.x": along, "heel.z": -8.0, "heel.wx": 2.0}
    x = thrown(shoe, place, speed)
    check_step(shoe, x, modes, steps=WIDE)
    check_products(Case.of(shoe, x, 3))


def test_simultaneous_or_later_touches_have_no_derivative(bouncer):
    """They are in one group: in a neighbouring state, another ball is struck first."""
    place = {"ball.z": 0.05 + 0.008, "other.x": 0.12 + 0.005, "other.z": 0.05 + 0.008}
    x = thrown(bouncer, place, {"ball.z": -10.0, "ball.x": 4.0})
    with pytest.raises(fan.errors.StateError, match="no derivative"):
        bouncer.linearise_step(x)
    steps = bouncer.linearise_steps(x.q_D, x.v_D, x.q_K, x.v_K)
    assert not steps.settled.all()
