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


def test_balls_that_touch_up_to_rounding_are_struck_at_once():
    """Regression: overlaps of 1e-17 m that close at 1e-14 m/s made a part of a step of length 0."""
    cradle = row_of_balls(7)
    rng = np.random.default_rng(5)
    starts = [(6.370703509446264, 0.0012563378908554091, 5e-3)]
    starts += [
        (*rng.uniform((0.5, 0.0), (8.0, 5e-3)), dt) for dt in (1e-3, 5e-3) for _ in range(30)
    ]
    for speed, gap, dt in starts:
        place = {f"b{k}": 0.1 * k for k in range(7)} | {"b0": -gap}
        run = stepped(cradle, thrown(cradle, place, {"b0": speed}), 5e-3 / speed + 10 * dt, dt)
        assert run.v_D[-1] / speed == pytest.approx([-5 / 7, *[2 / 7] * 6], abs=2e-6)
