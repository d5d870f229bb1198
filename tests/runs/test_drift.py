"""Runs of a thousand seconds: lengths stay right at every accepted step, and energies balance."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.medium

SECONDS = 1000.0

PENDULUM = """
puppet: pendulum
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 0]}], length: 0.7,
     restitution: {parameter: e, value: 0}}
pose: {bob.z: -0.7}
"""

ROD = """
puppet: rod
bodies:
  - {name: rod, joint: {type: free, damping: 0.01}, mass: 0.5, com: [0, 0, 0],
     inertia: [0.001, 0.015, 0.015]}
strings:
  - {name: left, path: [{body: rod, at: [-0.3, 0, 0]}, {world: [-0.4, 0, 0.8]}], length: driven}
  - {name: right, path: [{body: rod, at: [0.3, 0, 0]}, {world: [0.4, 0, 0.8]}], length: driven}
pose: {left.length: 0.9, right.length: 0.9}
"""


def relative(marionette, run) -> float:
    """Largest violation of a string, relative to its length."""
    lengths = marionette.string_lengths(run.q_D, run.q_K)
    return float(np.max(run.violation.values[:, : lengths.shape[1]] / lengths))


def test_a_swing_of_a_thousand_seconds():
    pendulum = fan.loads(PENDULUM)
    x0 = pendulum.state({"v:bob.x": 2.2})
    run = fan.simulate(pendulum, x0, t_end=SECONDS)
    assert not run.events
    assert relative(pendulum, run) < 1e-12
    assert np.max(np.abs(run.ledger["residual"])) < 1e-6


def test_a_thousand_seconds_of_bounces():
    """An elastic string: thousands of catches, without accumulated errors."""
    pendulum = fan.loads(PENDULUM).with_parameters({"e": 1.0})
    run = fan.simulate(pendulum, pendulum.state({"bob.x": 0.1, "bob.z": -0.2}), t_end=SECONDS)
    assert sum(e.kind == "catch" for e in run.events) > 2000
    assert relative(pendulum, run) < 1e-12
    assert np.max(np.abs(run.ledger["residual"])) < 1e-6


def test_a_thousand_seconds_of_slack_and_taut():
    """A rod jerked repeatedly by its two strings: chaotic, so that the number of catches varies."""
    rod = fan.loads(ROD)
    rng, points = np.random.default_rng(0), {}
    times = np.arange(0.0, SECONDS + 0.4, 0.4)
    for name in ("left.length", "right.length"):
        values = 0.9 + rng.uniform(-0.25, 0.1, len(times))
        values[0] = 0.9
        points[name] = list(zip(times, values, strict=True))
    inputs = fan.Input.waypoints(rod, points)
    run = fan.simulate(rod, rod.rest(), inputs, t_end=SECONDS, effort=False)
    assert run.status is fan.Status.DONE
    assert sum(e.kind == "catch" for e in run.events) > 100
    assert relative(rod, run) < 1e-12
    assert np.min(run.tension.values) >= 0.0


@pytest.mark.parametrize("name", ["arm2d", "marionette"])
def test_the_ledger_closes_with_the_tolerance(name):
    """Each smaller tolerance reduces the residual, down to rounding."""
    puppet = getattr(fan.puppets, name)()
    x0 = puppet.rest()
    table = puppet.coordinates
    coordinate = next(n for n in table.q_K if n.endswith(".length"))
    q = x0.q_K[table.q_K.index(coordinate)]
    points = [(0, q), (0.3, 0.8 * q), (0.6, q), (0.8, 0.85 * q), (1.2, q)]
    inputs = fan.Input.waypoints(puppet, {coordinate: points})
    residuals = []
    for tolerance in (1e-5, 1e-8, 1e-11):
        run = fan.simulate(
            puppet, x0, inputs, 1.5, method=fan.Event(rtol=tolerance, atol=tolerance)
        )
        assert any(e.kind == "catch" for e in run.events)
        residuals.append(float(np.max(np.abs(run.ledger["residual"]))))
    scale = puppet.weight * 1.0
    assert residuals[1] < 0.05 * residuals[0]
    assert residuals[2] < 0.05 * residuals[1]
    assert residuals[2] < 1e-9 * scale
