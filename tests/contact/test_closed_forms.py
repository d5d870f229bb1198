"""Contact by time-stepping converges to closed forms at first order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import (
    G,
    balls_that_meet,
    errors,
    ladder,
    on_slope,
    rocking_block,
    stepped,
    thrown,
)

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

STEPS = (4e-3, 2e-3, 1e-3)
"""Time steps, each half of the previous one [s]."""


def converges(
    values: list[float], exact: float, order: float = 1.0, max_error: float = np.inf
) -> None:
    """Assert that errors shrink at an order as steps halve, or are rounding."""
    deviations = errors(values, exact)
    assert deviations[-1] <= max_error, deviations
    for coarse, fine in pairwise(deviations):
        assert fine <= coarse * 0.5**order * 1.3 + 1e-10 * abs(exact), deviations


@pytest.mark.parametrize("slope", [0.1, 0.5, 1.0])
def test_a_block_on_a_slope_below_the_threshold_stays_for_ever(slope):
    """Static friction holds up to tan(slope) = mu, without creep; friction dissipates nothing."""
    marionette = on_slope(slope, 1.05 * np.tan(slope))
    run = stepped(marionette, marionette.state({"body.z": 0.05}), 5.0, 2e-3)
    assert np.max(np.abs(run.q_D - run.q_D[0])) < 1e-9
    assert abs(run.ledger["friction"][-1]) < 1e-9
    force = run.contact.force_on("body", len(run))
    assert np.allclose(force[1:], [-G * np.sin(slope), 0.0, G * np.cos(slope)], atol=1e-6)


@pytest.mark.parametrize("slope", [0.3, 0.8])
def test_a_block_above_the_threshold_slides_at_its_acceleration(slope):
    """a = g (sin - mu cos), and friction's loss is mu N times the displacement."""
    mu = 0.6 * np.tan(slope)
    marionette, a = on_slope(slope, mu), G * (np.sin(slope) - mu * np.cos(slope))
    x0 = marionette.state({"body.z": 0.05})
    runs = [stepped(marionette, x0, 0.5, dt) for dt in STEPS]
    converges([run["body.x"][-1] for run in runs], a * 0.5**2 / 2, max_error=1e-2)
    exact = mu * G * np.cos(slope) * a * 0.5**2 / 2
    converges([run.ledger["friction"][-1] for run in runs], exact, max_error=2e-2)
    assert runs[-1].contact.gap.min() > -1e-9
    assert np.allclose(runs[-1].contact.normal_force.sum() / (len(runs[-1])), G * np.cos(slope))


@pytest.mark.parametrize("mu", [0.1, 0.7])
def test_a_block_that_slides_stops_after_its_way(mu):
    """s = v^2 / (2 mu g); it stays there."""
    marionette = on_slope(0.0, mu)
    x0 = thrown(marionette, {"body.z": 0.05}, {"body.x": 1.0, "body.y": 0.7})
    speed = np.hypot(1.0, 0.7)
    t_end = speed / (mu * G) * 1.2
    runs = [stepped(marionette, x0, t_end, dt) for dt in STEPS]
    displacement = [np.hypot(run["body.x"][-1], run["body.y"][-1]) for run in runs]
    converges(displacement, speed**2 / (2 * mu * G), max_error=5e-3)
    assert np.max(np.abs(runs[-1].v_D[-1])) < 1e-9
    assert np.allclose(runs[-1]["body.y"][-1] / runs[-1]["body.x"][-1], 0.7, rtol=1e-9)


def test_a_ball_thrown_sliding_comes_to_roll_at_five_sevenths_of_its_speed():
    """v = 5/7 v0 from t = 2 v0 / (7 mu g) on; friction dissipates 1/7 of the energy."""
    marionette = on_slope(0.0, 0.3, "sphere")
    x0 = thrown(marionette, {"body.z": 0.1}, {"body.x": 2.0})
    runs = [stepped(marionette, x0, 0.5, dt) for dt in STEPS]
    converges([run["v:body.x"][-1] for run in runs], 10.0 / 7.0, max_error=1e-9)
    converges([run.ledger["friction"][-1] for run in runs], 0.5 * 2.0**2 * 2 / 7, max_error=2e-2)
    roll = 2 * 2.0 / (7 * 0.3 * G)
    displacement = 2.0 * roll - 0.3 * G * roll**2 / 2 + 10.0 / 7.0 * (0.5 - roll)
    converges([run["body.x"][-1] for run in runs], displacement, max_error=5e-3)


def test_a_hoop_with_backspin_comes_back():
    """For I = m r^2: v = (v0 - r w0) / 2 when it rolls, backwards if w0 > v0 / r."""
    marionette = on_slope(0.0, 0.4, "sphere", mass="1", inertia="[0.01, 0.01, 0.01]")
    x0 = thrown(marionette, {"body.z": 0.1}, {"body.x": 1.0, "body.wy": -30.0})
    run = stepped(marionette, x0, 1.0, 1e-3)
    assert np.isclose(run["v:body.x"][-1], (1.0 - 3.0) / 2, atol=1e-9)
    assert run["body.x"].max() > 0.05


def test_two_balls_that_meet_keep_their_momentum():
    """Inelastic, off-centre and with friction: momentum to rounding, energy never increases."""
    marionette, x0 = balls_that_meet()
    run = stepped(marionette, x0, 1.0, 1e-3)
    assert any(event.kind == "touch" for event in run.events)
    momentum = np.array([marionette.momentum(run.state(i)) for i in (0, len(run) - 1)])
    assert np.allclose(momentum[0], momentum[1], atol=1e-12)
    assert np.all(np.diff(run.ledger["kinetic"]) < 1e-12)
    assert run.ledger["impact"][-1] > 0.1
    assert abs(run.ledger["residual"][-1]) < 1e-9


def test_a_ladder_leaves_the_wall_at_two_thirds_of_its_height():
    """Without friction a ladder's top leaves the wall at 2/3 of its initial height."""
    angle = np.deg2rad(70.0)
    marionette, x0 = ladder(angle)
    heights = []
    for dt in STEPS:
        run = stepped(marionette, x0, 0.75, dt)
        touching = run.contact.involving("rod", "wall").sample
        last = touching.max()
        assert set(np.diff(touching)) == {1}
        heights.append(run["rod.z"][last] - 0.001)
    deviations = errors(heights, 0.5 * np.sin(angle) * 2 / 3)
    assert max(deviations) < 5e-3 and deviations[-1] < 2e-3, deviations


@pytest.mark.parametrize("mu", [0.2, 0.4, 0.6])
def test_a_rod_that_falls_from_the_vertical_slips_at_the_classical_angle(mu):
    """It slips where |F| = mu N: F = 3/4 m g sin(3 cos - 2), N = m g (3 cos - 1)^2 / 4."""
    marionette = fan.loads(f"""
puppet: pencil
floor: 0
contact: {{friction: {mu}}}
bodies:
- name: rod
  joint: {{type: free}}
  shapes: [{{type: sphere, radius: 0.0001, at: [0, 0, -0.5]}}]
  mass: 1
  inertia: [0.0833333333, 0.0833333333, 1.0e-6]
""")
    start = 1e-3
    x0 = marionette.state(
        {
            "rod.x": 0.5 * np.sin(start),
            "rod.z": 0.5 * np.cos(start) + 0.0001,
            "rod.rotation": (np.cos(start / 2), 0.0, np.sin(start / 2), 0.0),
        }
    )
    angle = np.linspace(0.0, np.pi / 2, 200001)
    ratio = np.abs(0.75 * np.sin(angle) * (3 * np.cos(angle) - 2))
    slips = ratio > mu * (3 * np.cos(angle) - 1) ** 2 / 4
    classical = angle[np.argmax(slips)]
    angles = []
    for dt in STEPS[1:]:
        run = stepped(marionette, x0, 2.4, dt)
        sliding = run.contact.sliding_speed > 1e-6
        first = run.contact.sample[np.argmax(sliding)]
        angles.append(2 * np.arcsin(run["rod.qy"][first]))
    assert abs(angles[-1] - classical) < 0.02
    assert abs(angles[-1] - classical) < abs(angles[0] - classical) + 1e-4


def test_a_rocking_block_loses_housners_share_at_every_impact():
    """The ratio of angular velocities is 1 - 3/2 sin^2 a, tan a = width over height."""
    marionette, x0, a = rocking_block(0.05)
    run = stepped(marionette, x0, 1.2, 2e-4)
    w = run["v:block.wy"]
    i = int(np.argmax(np.diff(np.sign(2 * np.arcsin(run["block.qy"]))) != 0))
    before, after = np.abs(w[i - 10 : i - 2]).max(), np.abs(w[i + 4])
    assert abs(after / before - (1 - 1.5 * np.sin(a) ** 2)) < 5e-3
