"""Derivatives of inputs with respect to waypoint values, compared with finite differences."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.motion import Input, InputDerivative

TIMES = np.linspace(-0.2, 3.0, 161)


def motion(table, points: dict) -> np.ndarray:
    """(3, T, n_vK) q_K, v_K and acc_K; q_K is 0 for rotations and coordinates without a name."""
    inputs = Input.waypoints(table, points)
    q, v, acc = inputs.evaluate(TIMES)
    motion_values = np.zeros((3, *v.shape))
    motion_values[1:] = v, acc
    for at, row in table.scalars_K:
        if inputs.named[row]:
            motion_values[0][:, row] = q[:, at]
    return motion_values


def with_shifted_value(points: dict, name: str, k: int, d: float) -> dict:
    changed = {n: list(series) for n, series in points.items()}
    t, value = changed[name][k]
    changed[name][k] = (t, value + d)
    return changed


def central(table, points: dict, name: str, k: int, d: float = 2e-6) -> np.ndarray:
    """Richardson's extrapolation of central differences."""
    half, whole = (
        (
            motion(table, with_shifted_value(points, name, k, h))
            - motion(table, with_shifted_value(points, name, k, -h))
        )
        / (2 * h)
        for h in (0.5 * d, d)
    )
    return (4 * half - whole) / 3


def one_sided(table, points: dict, name: str, k: int, d: float) -> np.ndarray:
    """Richardson's extrapolation of one-sided differences."""
    here = motion(table, points)
    half, whole = (
        (motion(table, with_shifted_value(points, name, k, h)) - here) / h for h in (0.5 * d, d)
    )
    return 2 * half - whole


@pytest.mark.parametrize("seed", range(12))
def test_derivatives_with_respect_to_random_waypoints(table, seed):
    """Turning points, bounded slopes, mean slopes, several coordinates with common breaks."""
    rng = np.random.default_rng(seed)
    points = {}
    for name, at in (("hand.length", 0.8), ("knee.length", 0.7), ("crank", 0.1)):
        t = np.sort(rng.uniform(0.0, 2.5, 6))
        if np.min(np.diff(t)) < 0.05:
            t = np.linspace(0.0, 2.0, 6)
        steps = rng.choice([-1.0, 1.0, 1.0], 6) * rng.choice([0.01, 0.03, 0.08], 6)
        points[name] = list(zip(t, at + np.cumsum(steps * rng.uniform(0.8, 1.2, 6)), strict=True))
    derivatives = InputDerivative.of_waypoints(table, points)
    assert [derivative.name for derivative in derivatives] == [
        f"{n}[{k}]" for n in points for k in range(6)
    ]
    for derivative in derivatives:
        name, k = derivative.name[:-3], int(derivative.name[-2])
        assert derivative.smooth
        wanted, got = central(table, points, name, k), np.array(derivative.evaluate(TIMES))
        for w, g in zip(wanted, got, strict=True):
            assert np.max(np.abs(g - w)) < 1e-6 * max(1.0, np.max(np.abs(w)))


KINKS = {
    "two equal values": [(0, 0.8), (1, 0.8), (2, 0.7)],
    "three equal values": [(0, 0.8), (0.8, 0.8), (2, 0.8)],
    # In intervals of 1 s and 4 s, the mean slope at the middle point is exactly twice the smaller
    # slope of the secants.
    "the bound begins to act": [(0, 0.0), (1, 6.0), (5, 10.0)],
}


@pytest.mark.parametrize("what", KINKS)
@pytest.mark.parametrize("side", ["above", "below"])
def test_where_the_sides_differ(table, what, side):
    """At a kink the derivatives from above and below differ, and are marked as not smooth."""
    points = {"crank": KINKS[what]}
    derivatives = InputDerivative.of_waypoints(table, points, side=side)
    sign = 1.0 if side == "above" else -1.0
    for k, derivative in enumerate(derivatives):
        wanted = one_sided(table, points, "crank", k, sign * 1e-6)
        assert np.max(np.abs(np.array(derivative.evaluate(TIMES)) - wanted)) < 1e-4
    assert not all(derivative.smooth for derivative in derivatives)


def test_mistakes_are_refused(table):
    """Rotations, unknown names and unknown sides are refused."""
    points = {"bar.rotation": [(0, [0, 0, 0]), (1, [0, 0, 1])], "crank": [(0, 0.0), (1, 1.0)]}
    assert len(InputDerivative.of_waypoints(table, points, only=["crank"])) == 2
    with pytest.raises(fan.errors.InputError, match="rotation"):
        InputDerivative.of_waypoints(table, points)
    with pytest.raises(fan.errors.UnknownNameError, match="crank"):
        InputDerivative.of_waypoints(table, points, only=["crnk"])
    with pytest.raises(ValueError, match="above"):
        InputDerivative.of_waypoints(table, points, side="left")
