"""Levenberg and Marquardt's search for the point that explains a record best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, MaskRows, OnProgress, Progress, StateError
from fantoccini.lab.identification.blocks import LARGEST_MOVE, Normal
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.point import Jacobians, Point, Predicted
from fantoccini.lab.identification.windows import cheaper, spread

FIRST_DAMPING = 1e-3
LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e8
_LEAST_FALL = 0.01
"""Of the cost: a fall that is smaller ends a search. One standard deviation costs 0.5."""
_STEEP = 0.1
"""Part of the cost by which a move reduces it while the search is far from its end."""
_FAR = 0.1
"""Part of a positive number by which it may move before all derivatives are found anew."""
_MIXED = 3.0
"""The costs of all segments may change by so many times the fall that ends a search."""
LARGEST_FACTOR = 4.0
"""By which a positive number may grow or shrink in one move."""


@dataclass(frozen=True, eq=False)
class Kept:
    """Derivatives that are kept from one move to the next.

    Attributes:
        jacobians: of all segments; those of some are written over.
        theta: (P,) unknowns at which all were found.
        stale: (S,) bool, segments whose derivatives are to be found anew.
    """

    jacobians: Jacobians
    theta: Array
    stale: MaskRows

    @classmethod
    def at(cls, fit: Fit, at: Point) -> Kept:
        """All of a point."""
        return cls(fit.jacobians(at), at.theta, np.zeros(len(at.q_D), dtype=bool))

    def renewed(self, fit: Fit, at: Point, positive: MaskRows) -> Kept:
        """Those of stale segments anew; all where a positive number went far."""
        if np.any(np.abs(at.theta - self.theta)[positive] > _FAR * self.theta[positive]):
            return Kept.at(fit, at)
        if np.any(self.stale):
            fit.jacobians(at, only=self.stale, kept=self.jacobians)
        return replace(self, stale=np.zeros(len(self.stale), dtype=bool))


@dataclass(frozen=True, eq=False)
class Found:
    """Where a search ended.

    Attributes:
        at: the point.
        predicted: what it predicts.
        cost: there.
        moves: that were taken.
        settled: whether the last move changed the costs by little.
        odd: (S,) bool, segments whose derivatives did not tell the last two moves.
        kept: the derivatives.
    """

    at: Point
    predicted: Predicted
    cost: float
    moves: int
    settled: bool
    odd: MaskRows
    kept: Kept


def search(
    cost: Cost,
    at: Point,
    positive: MaskRows,
    kept: Kept | None = None,
    *,
    moves: int,
    tolerance: float,
    extrapolated: bool = False,
    states_only: bool = False,
    progress: OnProgress | None = None,
) -> Found:
    """Moves a point until the cost no longer falls.

    Args:
        cost: of points.
        at: where the search begins.
        positive: (P,) bool, unknowns that stay above zero.
        kept: derivatives from an earlier search.
        moves: largest number, but while the cost falls steeply, four times as many.
        tolerance: relative fall of the cost that ends the search.
        extrapolated: residuals of steps of no length; derivatives stay those of steps of dt.
        states_only: leave the unknowns as they are.
        progress: called with the cost, as ``best``, after every move.
    """
    damping, taken, settled = np.full(len(at.q_D), FIRST_DAMPING), 0, False
    shared = FIRST_DAMPING
    fit = cost.fit
    predicted = fit.predict(at, extrapolated=extrapolated)
    if not predicted.arrived:
        raise StateError(
            "the puppet cannot be simulated with the numbers that the search has come to; begin "
            "nearer to the truth, or take a smaller dt"
        )
    free = fit.freed(at, predicted)
    if kept is None:
        kept = Kept.at(fit, free)
    kept = replace(kept, stale=kept.stale | cost.other(at, free))
    at = free
    normal: Normal | None = None
    parts = cost.parts(at, predicted)
    tries = failed = 0
    odd = stale = np.zeros(len(at.q_D), dtype=bool)
    steep = False
    while (taken < moves or steep) and not settled and tries < 4 * moves:
        tries += 1
        if normal is None:
            kept = kept.renewed(fit, at, positive)
            normal = cost.normal(at, predicted, kept.jacobians)
        if states_only:
            by, theta = _step(normal.of_states(), damping, shared)[0], 0.0 * at.theta
        else:
            by, theta = _step(normal, damping, shared)
        trial = fit.moved(at, by, _bounded(at.theta, theta, positive) - at.theta)
        seen = fit.predict(trial, extrapolated=extrapolated)
        new = cost.parts(trial, seen)
        bad = _bad(parts, new)
        if np.any(bad) and seen.arrived:
            trial, seen, new = _stayed(cost, at, trial, seen, new, bad, extrapolated)
        if not np.sum(new) < np.sum(parts):
            damping = np.where(bad, np.minimum(16.0 * damping, MOST_DAMPING), damping)
            failed += 1
            if failed > 2 or not np.any(bad):
                shared *= 8.0
            settled = shared > MOST_DAMPING
            continue
        damping = np.where(bad, 4.0 * damping, np.maximum(damping / 4.0, LEAST_DAMPING))
        failed = 0
        # Some segments may rise by what others fall: then the search is not at its end.
        change, least = np.abs(parts - new), max(tolerance * float(np.sum(parts)), _LEAST_FALL)
        fall = float(np.sum(parts - new))
        settled = fall <= least and bool(np.sum(change) <= _MIXED * least)
        steep = fall > _STEEP * float(np.sum(parts))
        shared, taken = max(LEAST_DAMPING, shared / 8.0), taken + 1
        before, stale = stale, cost.stale(at, trial, predicted, seen, kept.jacobians)
        free = fit.freed(trial, seen)
        odd, kept = before & stale, replace(kept, stale=stale | cost.other(at, free))
        at, parts, predicted, normal = free, new, seen, None
        if progress is not None:
            progress(Progress(best=float(np.sum(parts))))
    return Found(at, predicted, float(np.sum(parts)), taken, settled, odd, kept)


def _bad(parts: Array, new: Array) -> MaskRows:
    """(S,) bool, segments that went wrong, and those beside them, whose gaps are theirs, too."""
    return spread((new - parts)[:-1] > 0.02 * parts[:-1] + 1.0, 1, 1)


def _stayed(
    cost: Cost,
    at: Point,
    trial: Point,
    seen: Predicted,
    new: Array,
    bad: MaskRows,
    extrapolated: bool,
) -> tuple[Point, Predicted, Array]:
    """The trial with the first states of bad segments where they were, if that costs less."""
    fit = cost.fit
    stay = trial.mixed(at, bad)
    stay = fit.placed(stay.q_D, stay.v_D, stay.theta, stay.held, bad)
    same = fit.predict(stay, extrapolated=extrapolated, only=bad, kept=seen)
    if not same.arrived:
        return trial, seen, new
    better = cheaper(bad, new, cost.parts(stay, same))
    trial = trial.mixed(stay, better)
    seen = seen.mixed(same, better, fit.segments(trial.theta))
    return trial, seen, cost.parts(trial, seen)


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
