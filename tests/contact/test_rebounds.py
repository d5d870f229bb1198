"""What springs back within a fixed step touches first, in single runs and in lanes."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import stepped, thrown
from contact.files import BOUNCER
from fantoccini.errors import Status

FAR = {"other.x": -50.0, "other.z": 5.0}


@pytest.fixture(scope="module")
def bouncer() -> fan.Marionette:
    return fan.loads(BOUNCER)


@pytest.mark.parametrize("dt", [2e-3, 1e-3])
@pytest.mark.parametrize("speed", [0.3, 3.0, 10.0, 20.0])
def test_a_ball_turns_where_it_touches_the_floor(bouncer, speed, dt):
    """z = v (t* - t) until it touches at t*, and e v (t - t*) afterwards, at every sample."""
    for high in (0.0131, 0.0204, 0.05):
        x0 = thrown(bouncer, {**FAR, "ball.z": 0.05 + high}, {"ball.z": -speed})
        run = stepped(bouncer, x0, 3 * high / speed, dt)
        way = speed * run.t - high
        assert np.allclose(run["ball.z"] - 0.05, np.where(way < 0, -way, 0.8 * way), atol=1e-12)
        assert run.status is Status.DONE
        assert len(run.contact) and np.max(np.abs(run.contact.gap)) < 1e-12
        assert run.ledger["residual"][-1] == pytest.approx(0.0, abs=1e-12 * speed**2)


def test_a_bullet_turns_at_the_wall(bouncer):
    """At 400 m/s: 0.8 m in a step of 2 ms. Faster ones meet the largest force of the options."""
    x0 = thrown(bouncer, {**FAR, "ball.z": 5.0}, {"ball.x": 400.0})
    run = stepped(bouncer, x0, 0.03, 2e-3)
    way = 400.0 * run.t - 9.9
    assert np.allclose(run["ball.x"], np.where(way < 0, 9.9 + way, 9.9 - 0.8 * way), atol=1e-9)
    assert run.contact.gap.max() < 1e-9


def test_balls_that_meet_touch_before_they_part(bouncer):
    """Head-on: momentum, e times the closing speed, and both where closed form has them."""
    x0 = thrown(
        bouncer, {"ball.x": 0.0, "ball.z": 5.0, "other.x": 1.0, "other.z": 5.0},
        {"ball.x": 10.0, "other.x": -7.0},
    )  # fmt: skip
    run = stepped(bouncer, x0, 0.08, 2e-3)
    t = run.t - (1.0 - 0.12) / 17.0
    common = (0.1 * 10.0 - 0.3 * 7.0) / 0.4
    after = common - 0.8 * 17.0 * 0.75, common + 0.8 * 17.0 * 0.25
    at = 10.0 * 0.88 / 17.0, 1.0 - 7.0 * 0.88 / 17.0
    assert np.allclose(run["ball.x"], at[0] + np.where(t < 0, 10.0, after[0]) * t, atol=1e-12)
    assert np.allclose(run["other.x"], at[1] + np.where(t < 0, -7.0, after[1]) * t, atol=1e-12)
    assert np.max(np.abs(run.contact.gap)) < 1e-12


def test_lanes_turn_where_they_touch(bouncer):
    """Each at its own time within its step, as alone."""
    highs = np.linspace(0.01, 0.05, 9)
    starts = [
        thrown(bouncer, {**FAR, "ball.z": 0.05 + h}, {"ball.z": -15.0, "ball.x": 1.0})
        for h in highs
    ]
    runs = fan.simulate_batch(bouncer, starts, t_end=0.006, method=fan.TimeStepping(dt=2e-3))
    for k, h in enumerate(highs):
        way = 15.0 * runs.t - h
        z = runs.q_D[k, :, bouncer.coordinates.q_D.index("ball.z")] - 0.05
        assert np.allclose(z, np.where(way < 0, -way, 0.8 * way), atol=1e-12)


def test_what_a_bouncing_ball_strikes_stays_on_the_floor():
    """A heavy slab that lies on the floor does not leave it for the ball that falls on it."""
    scene = fan.loads("""
puppet: anvil
floor: 0
contact:
  friction: 0.3
  restitution: 0.8
  pairs: [{between: [slab, floor], restitution: 0}]
bodies:
- {name: slab, joint: {type: free}, shapes: [{type: box, size: [1, 1, 0.1], mass: 5}]}
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 0.5}]}
pose: {slab.z: 0.05, ball.z: 0.3}
""")
    x0 = thrown(scene, {"slab.z": 0.05, "ball.z": 0.163, "ball.x": 0.1}, {"ball.z": -10.0})
    run = stepped(scene, x0, 0.1, 2e-3)
    assert run["ball.z"].min() > 0.15 - 1e-9
    assert np.max(np.abs(run["slab.z"] - 0.05)) < 1e-9
    assert run["v:ball.z"].max() == pytest.approx(8.0, rel=0.01)


def test_a_landing_without_restitution_closes_its_gap_within_the_step():
    """u_n+ = -gap/dt, then rest: legal, at any speed, also where forces brake it."""
    for lift in (0.0, 20.0):
        ball = fan.loads(f"""
puppet: lands
gravity: [0, 0, {lift}]
floor: 0
contact: {{friction: 0.3}}
bodies:
- {{name: ball, joint: {{type: free}}, shapes: [{{type: sphere, radius: 0.05, mass: 0.1}}]}}
""")
        x0 = thrown(ball, {"ball.z": 0.05 + 0.013}, {"ball.z": -10.0})
        run = stepped(ball, x0, 0.004, 2e-3)
        assert run.status is Status.DONE
        assert run["ball.z"][1] == pytest.approx(0.05, abs=1e-12)
        assert run.contact.at(1).gap == pytest.approx([0.0], abs=1e-12)
