"""Random performances, wilder than a puppeteer's: every run reaches its end and keeps the rules."""

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.medium

CASES = [
    ("marionette", 15),
    ("marionette", 21),
    ("marionette", 94),
    ("marionette_bar", 5),
    ("marionette_bar", 19),
    ("stand6", 16),
    ("stand6", 55),
    ("arm3d", 13),
    ("crane", 7),
]
"""Puppets and seeds; most of them once stopped a run or stretched a string."""


def performance(puppet, x0, seed):
    """Waypoints of all driven coordinates: lengths by up to a third, ends by up to 0.4 m."""
    rng, table = np.random.default_rng(seed), puppet.coordinates
    duration, wildness, points = rng.uniform(2, 4), rng.uniform(0.2, 1.5), {}
    for q, _ in table.scalars_K:
        name, start, n = table.q_K[q], x0.q_K[q], rng.integers(2, 6)
        times = np.sort(np.r_[0, rng.uniform(0.15, duration, n)])
        if np.min(np.diff(times)) < 0.1:
            times = np.linspace(0, duration, n + 1)
        if name.endswith(".length"):
            values = start * (1 + wildness * rng.uniform(-0.25, 0.2, n + 1))
        else:
            reach = 3 if puppet.name == "crane" else 1
            values = start + wildness * reach * rng.uniform(-0.25, 0.25, n + 1)
        values[0] = start
        points[name] = list(zip(times, values, strict=True))
    for name in table.rotations:
        turns = [np.zeros(3)] + [0.5 * rng.normal(size=3) for _ in range(3)]
        points[name] = list(zip(np.linspace(0, duration, 4), turns, strict=True))
    return fan.Input.waypoints(puppet, points), duration


@pytest.mark.parametrize(("name", "seed"), CASES)
def test_random_performances(name, seed):
    puppet = getattr(fan.puppets, name)()
    x0 = puppet.rest()
    inputs, duration = performance(puppet, x0, seed)
    run = fan.simulate(puppet, x0, inputs, duration)
    assert run.status is fan.Status.DONE
    assert np.max(run.violation.values) < 2e-11
    assert np.min(run.tension.values) >= 0.0
    assert np.min(run.limit_force.values, initial=0.0) >= 0.0
    energy = np.max(np.abs(run.ledger["work"])) + puppet.weight
    assert np.max(np.abs(run.ledger["residual"])) < 1e-8 * energy
    assert np.all(np.diff(run.ledger["impact"]) > -1e-9 * energy)
    stepped = fan.simulate(puppet, x0, inputs, duration, method="timestepping")
    assert stepped.status is fan.Status.DONE
    assert np.all(np.isfinite(stepped.v_D))
