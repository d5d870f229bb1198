"""Levenberg and Marquardt's search for the point that explains a record best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.identification.blocks import LARGEST_MOVE, Normal
from fantoccini.identification.fit import Fit
from fantoccini.identification.point import Point, Predicted, Weights

FIRST_DAMPING = 1e-3
LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e8
_LEAST_FALL = 0.01
"""Of the cost, from which on a search goes on: a hundredth of what one deviation costs is less."""
LARGEST_FACTOR = 4.0
"""By which a positive number may grow or shrink in one move."""


@dataclass(frozen=True, eq=False)
class Found:
    """Where a search ended.

    Attributes:
        at: the point.
        predicted: what it predicts.
        normal: the normal equations there.
        cost: there.
        moves: that were taken.
        settled: whether the last move reduced the cost by less than the tolerance.
    """

    at: Point
    predicted: Predicted
    normal: Normal
    cost: float
    moves: int
    settled: bool


def search(
    fit: Fit,
    at: Point,
    first: Point,
    weights: Weights,
    positive: MaskRows,
    *,
    moves: int,
    tolerance: float,
    extrapolated: bool = False,
    held: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Found:
    """Moves a point until the cost no longer falls.

    Args:
        fit: the record and its model.
        at: where the search begins.
        first: the guess of the first state.
        weights: of residuals.
        positive: (P,) bool, unknowns that stay above zero.
        moves: largest number.
        tolerance: relative fall of the cost that ends the search.
        extrapolated: residuals of steps of no length; derivatives stay those of steps of dt.
        held: leave the unknowns as they are, and move the states alone.
        progress: called with the cost after every move.
    """
    damping, taken, settled = np.full(len(at.q_D), FIRST_DAMPING), 0, False
    shared = FIRST_DAMPING
    predicted = fit.predict(at, extrapolated=extrapolated)
    at = fit.freed(at, predicted)
    normal = _normal(fit, at, first, weights, predicted)
    costs = fit.costs(at, first, predicted, weights)
    tries = failed = 0
    while taken < moves and not settled and tries < 4 * moves:
        tries += 1
        if held:
            by, theta = _step(_states_alone(normal), damping, shared)[0], 0.0 * at.theta
        else:
            by, theta = _step(normal, damping, shared)
        trial = fit.moved(at, by, _bounded(at.theta, theta, positive) - at.theta)
        seen = fit.predict(trial, extrapolated=extrapolated)
        new = fit.costs(trial, first, seen, weights)
        rise = new - costs
        bad = _wide(rise[:-1] > 0.02 * costs[:-1] + 1.0)
        if not np.sum(new) < np.sum(costs):
            damping = np.where(bad, np.minimum(16.0 * damping, MOST_DAMPING), damping)
            failed += 1
            if failed > 2 or not np.any(bad):
                shared *= 8.0
            settled = shared > MOST_DAMPING
            continue
        damping = np.where(bad, 4.0 * damping, np.maximum(damping / 4.0, LEAST_DAMPING))
        failed = 0
        fall = float(np.sum(costs) - np.sum(new))
        settled = fall <= max(tolerance * float(np.sum(costs)), _LEAST_FALL)
        shared, taken = max(LEAST_DAMPING, shared / 8.0), taken + 1
        at, costs = fit.freed(trial, seen), new
        if progress is not None:
            progress(float(np.sum(costs)))
        predicted, normal = seen, _normal(fit, at, first, weights, seen)
    return Found(at, predicted, normal, float(np.sum(costs)), taken, settled)


def _wide(bad: MaskRows) -> MaskRows:
    """Segments that went wrong, and the one after each: its gap is theirs."""
    return np.asarray(bad | np.append(False, bad[:-1]) | np.append(bad[1:], False))


def _normal(fit: Fit, at: Point, first: Point, weights: Weights, predicted: Predicted) -> Normal:
    _, J, ends = fit.jacobian(at)
    return fit.normal(at, first, predicted, J, ends, weights)


def _states_alone(normal: Normal) -> Normal:
    none = np.zeros(0)
    return Normal(normal.H, normal.next, normal.border[..., :0], none[:, None], normal.g, none)


def _step(normal: Normal, damping: Array, shared: float) -> tuple[Array, Array]:
    """A move in which no state goes too far; the damping of those that would is raised."""
    while True:
        by, theta = normal.step(damping, shared)
        n = by.shape[1] // 2
        far = np.maximum(
            np.max(np.abs(by[:, :n]), axis=1) / LARGEST_MOVE[0],
            np.max(np.abs(by[:, n:]), axis=1) / LARGEST_MOVE[1],
        )
        if not np.any(far > 1.0) or np.min(damping[far > 1.0]) >= MOST_DAMPING:
            return by, theta
        damping[far > 1.0] *= np.maximum(4.0, far[far > 1.0] ** 2)


def _bounded(theta: Array, move: Array, positive: MaskRows) -> Array:
    """theta moved, where positive numbers change by a bounded factor."""
    to = theta + move
    low, high = theta / LARGEST_FACTOR, theta * LARGEST_FACTOR
    return np.where(positive, np.clip(to, low, high), to)
