"""Sensitivities of event-driven runs through contact: closed forms, and differences of runs."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import G, balls_that_meet, ladder, on_slope, thrown
from contact.files import ACROBAT, BOX, EGG
from oracles.differences import apart, difference, moved, worst

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

FINE = {"method": fan.Event(rtol=1e-13, atol=1e-13), "effort": False}

BOUNCE = """
puppet: bounce
floor: 0
contact: {friction: 0.3, restitution: 0.6}
bodies:
- name: ball
  joint: {type: prismatic, axis: [0, 0, 1]}
  shapes: [{type: sphere, radius: 0.1, mass: 1}]
"""

SLED = """
puppet: sled
floor: 0
gravity: [%s, 0, -9.6]
contact: {friction: %s}
bodies:
- name: sled
  joint: {type: translation, axes: [x, y, z]}
  shapes: [{type: %s, mass: 1}]
"""
CRATE, RUNNER = "box, size: [0.2, 0.3, 0.1]", "sphere, radius: 0.05"


def tangent(puppet: fan.Marionette, base: fan.State, x: fan.State) -> np.ndarray:
    """(2 n_vD,) tangent vector from one state to another."""
    t = puppet.coordinates
    q = apart(base.q_D, x.q_D, t.n_vD, t.scalars_D, t.quaternions_D)
    return np.concatenate([q, x.v_D - base.v_D])


def end_state(puppet: fan.Marionette, x: fan.State, t_end: float, inputs=None) -> fan.State:
    run = fan.simulate(puppet, x, inputs, t_end, **FINE)
    return run.state(len(run) - 1)


def differences_by_start(
    puppet: fan.Marionette,
    x: fan.State,
    t_end: float,
    directions: np.ndarray,
    step: float,
    inputs=None,
) -> np.ndarray:
    """Differences of runs by their start, along directions (2 n_vD, m)."""
    t = puppet.coordinates
    base = end_state(puppet, x, t_end, inputs)

    def end(d: np.ndarray) -> np.ndarray:
        dq, dv = np.split(directions @ d, 2)
        start = x.replace(q_D=moved(x.q_D, dq, t.scalars_D, t.quaternions_D), v_D=x.v_D + dv)
        return tangent(puppet, base, end_state(puppet, start, t_end, inputs))

    return difference(end, directions.shape[1], step)


def check(
    puppet: fan.Marionette,
    x: fan.State,
    t_end: float,
    events: list[str],
    drop: tuple[int, ...] = (),
    step: float = 1e-4,
    bound: float = 1e-7,
):
    """The last x0 agrees with a difference of runs, except along the directions `drop`."""
    result = fan.dynamics.sensitivity(puppet, x, t_end=t_end)
    assert [event.kind for event in result.run.events] == events
    assert result.differentiable
    directions_kept = np.setdiff1d(np.arange(2 * puppet.coordinates.n_vD), drop)
    directions = np.eye(2 * puppet.coordinates.n_vD)[:, directions_kept]
    expected = differences_by_start(puppet, x, t_end, directions, step)
    assert worst(result.by_x0[-1] @ directions, expected) < bound
    return result


def bounced(z, v, t_end: float, e: float):
    """(z, v) at t_end of a ball of 0.1 m that bounces on a floor."""
    t = 0.0
    while True:
        rest = (v + (v * v + 2.0 * G * (z - 0.1)) ** 0.5) / G
        if (t + rest).real > t_end:
            rest = t_end - t
            return np.array([z + v * rest - G * rest * rest / 2.0, v - G * rest])
        z, v, t = 0.1, -e * (v - G * rest), t + rest


def test_a_bouncing_ball_agrees_with_complex_steps_through_its_closed_form():
    puppet = fan.loads(BOUNCE)
    x = thrown(puppet, {"ball": 0.6}, {"ball": 0.2})
    result = fan.dynamics.sensitivity(puppet, x, t_end=0.9)
    assert len(result.passages) == 2 and result.differentiable
    expected = np.array(
        [bounced(0.6 + 1e-30j * a, 0.2 + 1e-30j * b, 0.9, 0.6).imag / 1e-30 for a, b in np.eye(2)]
    ).T
    assert worst(result.by_x0[-1], expected) < 1e-8
    first = result.passages[0]
    assert first.rows == ("ball|floor",)
    by_hand = np.array([[-0.6, 0.0], [1.6 * G / first.speed, -0.6]])
    assert worst(first.jump, by_hand) < 1e-9


def test_a_sled_that_slides_to_a_stop():
    """Its displacement is v^2/2a along its velocity; then it stays."""
    gravity, mu, normal = 1.9, 0.4, 9.6
    puppet = fan.loads(SLED % (gravity, mu, CRATE))
    straight = check(
        puppet, thrown(puppet, {"sled.z": 0.05}, {"sled.x": 1.0}), 0.6, ["slide", "stick"], (2, 5)
    )
    a = mu * normal - gravity
    assert straight.by_x0[-1][0, 3] == pytest.approx(1.0 / a, rel=1e-8)
    assert straight.passages[-1].rows == ("sled|floor",)
    puppet = fan.loads(SLED % (gravity, mu, RUNNER))
    askew = thrown(puppet, {"sled.z": 0.05}, {"sled.x": 1.0, "sled.y": 0.5})
    check(puppet, askew, 0.6, ["slide", "stick"], (2, 5))


def test_a_sled_pushed_up_a_steep_slope_turns_back():
    """The direction of friction reverses at the stop, and its acceleration jumps."""
    puppet = fan.loads(SLED % (6.0, 0.3, RUNNER))
    x = thrown(puppet, {"sled.z": 0.05}, {"sled.x": -1.0})
    result = check(puppet, x, 0.3, ["slide", "slide"], (2, 5))
    assert len(result.passages) == 1
    up, down = 6.0 + 0.3 * 9.6, 6.0 - 0.3 * 9.6
    # v = down (t - 1/up v0) from the turn on.
    assert result.by_x0[-1][3, 3] == pytest.approx(down / up, rel=1e-7)


def test_a_ball_thrown_sliding_comes_to_roll():
    """It rolls at 5/7 of its speed."""
    puppet = on_slope(0.0, 0.3, "sphere")
    x = thrown(puppet, {"body.z": 0.1}, {"body.x": 1.0})
    result = fan.dynamics.sensitivity(puppet, x, t_end=0.2)
    assert result.by_x0[-1][6, 6] == pytest.approx(5 / 7, rel=1e-8)
    curved = {"body.x": 1.0, "body.y": 0.3, "body.wx": 5.0, "body.wz": 2.0}
    check(puppet, thrown(puppet, {"body.z": 0.1}, curved), 0.3, ["slide", "stick"], (2, 8))


def test_a_rod_that_falls_slips_and_sticks():
    puppet = fan.loads("""
puppet: rod
floor: 0
contact: {friction: 0.4}
bodies:
- name: foot
  joint: {type: translation, axes: [x, z]}
  shapes: [{type: sphere, radius: 0.02, mass: 0.001}]
- name: rod
  parent: foot
  joint: {type: revolute, axis: [0, 1, 0]}
  shapes: [{type: capsule, from: [0, 0, 0.03], to: [0, 0, 1], radius: 0.001, mass: 1}]
""")
    x = thrown(puppet, {"foot.z": 0.02, "rod": 0.3}, {"rod": 0.5})
    check(puppet, x, 0.4, ["slide", "stick", "slide"], (1, 3, 4))


def test_a_ball_leaves_a_dome():
    """It sticks, slides and lifts, with friction."""
    puppet = fan.loads("""
puppet: dome
obstacles: [{name: dome, type: sphere, radius: 0.5, at: [0, 0, 0]}]
contact: {friction: 0.3}
bodies: [{name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}]
""")
    c, s = np.cos(0.5), np.sin(0.5)
    speed = {"b.x": 0.8 * c, "b.z": -0.8 * s, "b.y": 0.2}
    x = thrown(puppet, {"b.x": 0.6 * s, "b.z": 0.6 * c}, speed)
    result = fan.dynamics.sensitivity(puppet, x, t_end=0.45)
    assert [event.kind for event in result.run.events] == ["slide", "lift"]
    assert result.differentiable and not result.passages
    directions = np.zeros((12, 4))
    directions[9:12, :3] = np.eye(3)
    directions[[6, 8], 3] = c, -s
    expected = differences_by_start(puppet, x, 0.45, directions, 1e-4)
    assert worst(result.by_x0[-1] @ directions, expected) < 1e-7


def test_a_ladder_leaves_its_wall():
    """Derivatives by the initial angle and the initial angular velocity."""
    puppet, x = ladder(1.0)
    t = puppet.coordinates

    def along(angle: float) -> np.ndarray:
        ends = [ladder(angle + d)[1].q_D for d in (-1e-5, 1e-5)]
        return apart(ends[0], ends[1], 6, t.scalars_D, t.quaternions_D) / 2e-5

    result = fan.dynamics.sensitivity(puppet, x, t_end=0.4)
    assert [event.kind for event in result.run.events] == ["lift"]
    base = end_state(puppet, x, 0.4)

    def end(d: np.ndarray) -> np.ndarray:
        start = ladder(1.0 + d[0])[1].replace(v_D=along(1.0 + d[0]) * d[1])
        return tangent(puppet, base, end_state(puppet, start, 0.4))

    directions = np.zeros((12, 2))
    directions[:6, 0] = directions[6:, 1] = along(1.0)
    assert worst(result.by_x0[-1] @ directions, difference(end, 2, 1e-4)) < 1e-7


def test_impacts_with_friction():
    """An egg that slides through two of them, and two balls off-centre."""
    egg = fan.loads(EGG.replace("friction: 0.4", "friction: 0.1, restitution: 0.5"))
    speed = {"egg.x": 2.0, "egg.y": 0.3, "egg.wx": 3.0, "egg.wy": 1.0, "egg.wz": 2.0}
    check(egg, thrown(egg, {"egg.z": -0.7, "egg.x": -3.0}, speed), 0.4, ["touch", "lift"] * 2)
    balls, x = balls_that_meet()
    check(balls, x, 0.4, ["touch", "lift"], step=1e-5)


@pytest.fixture(scope="module")
def acrobat() -> tuple[fan.Marionette, fan.State, dict[str, list[tuple[float, float]]]]:
    """It lands on a rising tray, slides, and hangs on its rope again."""
    puppet = fan.loads(ACROBAT)
    x = puppet.state({"body.z": 0.17, "leg": 0.3, "rope.length": 1.2})
    v_D = np.array([0.1, 0.05, 0.0, 0.1, 0.2, 0.1, 0.3, 0.2, -0.1, 0.3])
    points = {
        "rope.length": [(0, 1.2), (0.1, 1.1), (0.5, 1.05)],
        "tray.z": [(0, -0.02), (0.5, 0.08)],
    }
    return puppet, x.replace(v_D=v_D), points


def test_a_puppet_lands_slides_and_is_caught(acrobat):
    """Derivatives by its start, its parameters, and the waypoints of rope and tray."""
    puppet, x, points = acrobat
    inputs, n = fan.Input.waypoints(puppet, points), puppet.coordinates.n_vD
    along = fan.motion.InputDerivative.of_waypoints(puppet, points)
    result = fan.dynamics.sensitivity(puppet, x, inputs, 0.25, along=along)
    kinds = [event.kind for event in result.run.events]
    assert {"touch", "slide", "catch"} <= set(kinds) and result.differentiable
    assert (
        worst(result.by_x0[-1], differences_by_start(puppet, x, 0.25, np.eye(2 * n), 1e-5, inputs))
        < 1e-7
    )
    base = end_state(puppet, x, 0.25, inputs)

    def by_parameters(d: np.ndarray) -> np.ndarray:
        values = zip(puppet.tree.parameters.items(), d, strict=True)
        other = puppet.with_parameters({name: value + more for (name, value), more in values})
        return tangent(puppet, base, end_state(other, x, 0.25, inputs))

    assert worst(result.by_p[-1], difference(by_parameters, len(puppet.p), 1e-5)) < 1e-7

    def by_points(d: np.ndarray) -> np.ndarray:
        more = iter(d)
        changed_inputs = fan.Input.waypoints(
            puppet,
            {
                name: [(t, q + next(more)) for t, q in waypoints]
                for name, waypoints in points.items()
            },
        )
        q_K, start = np.array(x.q_K), changed_inputs.evaluate(0.0)[0]
        for q, v in puppet.coordinates.scalars_K:
            q_K[q] = start[q] if changed_inputs.named[v] else q_K[q]
        return tangent(puppet, base, end_state(puppet, x.replace(q_K=q_K), 0.25, changed_inputs))

    assert worst(result.along[-1], difference(by_points, len(along), 1e-5)) < 1e-7


def test_the_bundled_marionette_lifts_a_hand_while_it_stands():
    puppet = fan.puppets.promenade()
    x = puppet.rest()
    length = float(x.q_K[puppet.coordinates.q_K.index("hand_left.length")])

    def lift(by: float) -> fan.Input:
        points = {"hand_left.length": [(0.0, length), (0.2, length - 0.05 + by)]}
        return fan.Input.waypoints(puppet, points)

    points = {"hand_left.length": [(0.0, length), (0.2, length - 0.05)]}
    along = fan.motion.InputDerivative.of_waypoints(puppet, points)
    result = fan.dynamics.sensitivity(puppet, x, lift(0.0), 0.1, along=along[1:])
    assert result.differentiable and result.run.contact is not None and len(result.run.contact)
    base = end_state(puppet, x, 0.1, lift(0.0))
    expected = difference(
        lambda d: tangent(puppet, base, end_state(puppet, x, 0.1, lift(d[0]))), 1, 1e-5
    )
    assert worst(result.along[-1], expected) < 1e-7


def test_runs_without_a_derivative_are_not_sharp():
    """Four corners strike at once; bounces accumulate; a box slides aside."""
    box = fan.loads(BOX)
    result = fan.dynamics.sensitivity(box, box.state({"body.z": 0.2}), t_end=0.2)
    assert not result.differentiable
    assert [(p.rows, p.differentiable) for p in result.passages] == [(("body|floor",), False)]
    ball = fan.loads(BOUNCE)
    with pytest.raises(fan.errors.StateError, match=r"bounces accumulate at t = 1\.2"):
        fan.dynamics.sensitivity(ball, ball.state({"ball": 0.6}), t_end=1.5)
    askew = thrown(box, {"body.z": 0.05}, {"body.x": 1.0, "body.y": 0.5})
    with pytest.raises(fan.errors.StateError, match="share force among"):
        fan.dynamics.sensitivity(box, askew, t_end=0.1)


def test_two_feet_that_always_land_together_are_one_touch():
    """A planar table: its feet strike together for neighbouring states, too."""
    table = fan.loads("""
puppet: table
floor: 0
contact: {friction: 0.3, restitution: 0.5}
bodies:
- name: top
  joint: {type: translation, axes: [x, z]}
  shapes:
  - {type: sphere, radius: 0.05, at: [-0.2, 0, 0], mass: 0.5}
  - {type: sphere, radius: 0.05, at: [0.2, 0, 0], mass: 0.5}
""")
    x = thrown(table, {"top.z": 0.3}, {"top.x": 1.0})
    check(table, x, 0.35, ["touch", "lift"])


def test_five_catches_and_a_bounce_with_friction():
    """A ball on a line that throws it back, and a floor that changes its spin."""
    puppet = fan.loads("""
puppet: swing
floor: 0
contact: {friction: 0.3, restitution: 0.5}
bodies:
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
strings:
- {name: line, path: [{body: ball}, {world: [0, 0, 1.2]}], length: 1.15, restitution: 0.8}
""")
    x = puppet.state()
    q = np.concatenate([[0.35, -0.17, 1.38], x.q_D[3:]])
    x = x.replace(q_D=q, v_D=np.array([1.5, 0.9, -1.57, -0.3, 1.5, 0.3]))
    thrown_back = ["catch", "release"]
    check(puppet, x, 1.83, 4 * thrown_back + ["touch", "lift", *thrown_back], bound=1e-9)
