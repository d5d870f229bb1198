"""Restitution of several contacts at once: scaled down only if it would add energy."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import stepped, thrown

pytestmark = pytest.mark.medium


def row_of_balls(n: int) -> fan.Marionette:
    """Balls of 5 cm in a row along x that touch, without gravity."""
    bodies = "".join(
        f"- {{name: b{k}, joint: {{type: prismatic, axis: [1, 0, 0]}}, "
        "shapes: [{type: sphere, radius: 0.05, mass: 1}]}\n"
        for k in range(n)
    )
    pose = ", ".join(f"b{k}: {0.1 * k}" for k in range(n))
    return fan.loads(
        "puppet: cradle\ngravity: [0, 0, 0]\ncontact: {friction: 0, restitution: 1}\n"
        f"bodies:\n{bodies}pose: {{{pose}}}\n"
    )


def test_simultaneous_impacts_of_a_row_of_balls_lose_nothing_to_rounding():
    """e = 1: (-0.6, 0.4, 0.4, 0.4, 0.4) of the incoming speed, from any start."""
    cradle = row_of_balls(5)
    rng = np.random.default_rng(0)
    for _ in range(60):
        speed, gap = rng.uniform(0.5, 3.0), rng.uniform(0.0, 5e-3)
        place = {f"b{k}": 0.1 * k for k in range(5)} | {"b0": -gap}
        x0 = thrown(cradle, place, {"b0": speed})
        run = stepped(cradle, x0, 0.02, 2e-3)
        after = run.v_D[-1] / speed
        assert after == pytest.approx([-0.6, 0.4, 0.4, 0.4, 0.4], abs=1e-7)
        assert run.ledger["kinetic"][-1] == pytest.approx(0.5 * speed**2, rel=1e-7)
