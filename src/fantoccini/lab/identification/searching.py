"""Levenberg and Marquardt's search for the point that explains a record best.

A point consists of the unknown numbers theta and the first states of all segments, the pieces of
the record that are simulated separately; a jump is the difference of two segments where they meet.
In names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, MaskRows, OnProgress, Progress, StateError
from fantoccini.lab.identification.blocks import MAX_MOVE, NormalEquations
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.search_point import Jacobians, Point, Prediction
from fantoccini.lab.identification.windows import cheaper_windows, with_neighbours

FIRST_DAMPING, MIN_DAMPING, MAX_DAMPING = 1e-3, 1e-4, 1e8
"""First, smallest and largest damping."""
MIN_DECREASE = 0.01
"""Fall of the cost below which a search ends; a move by one standard deviation costs 0.5."""
STEEP_DECREASE = 0.1
"""Relative fall of the cost in a move above which the search continues beyond its largest number
of moves."""
MAX_THETA_CHANGE = 0.1
"""Relative change of a positive number after which all derivatives are computed again."""
MAX_COST_CHANGE = 3.0
"""Largest sum of the segments' cost changes at which a search may end, relative to its fall."""
MAX_FACTOR = 4.0
"""Largest factor by which a positive number may grow or shrink in one move."""


@dataclass(frozen=True, eq=False)
class SavedJacobians:
    """Derivatives that are reused from one move to the next.

    Attributes:
        jacobians: jacobians of all segments; updated in place.
        theta: (P,) unknowns at which all were computed.
        stale: (S,) bool, segments whose derivatives must be computed again.
    """

    jacobians: Jacobians
    theta: Array
    stale: MaskRows

    @classmethod
    def at(cls, fit: Fit, point: Point) -> SavedJacobians:
        """All derivatives at a point."""
        return cls(fit.jacobians(point), point.theta, np.zeros(len(point.q_D), dtype=bool))

    def renew(self, fit: Fit, point: Point, positive: MaskRows) -> SavedJacobians:
        """Computes stale segments again, and all of them if a positive number changed much."""
        if np.any(
            np.abs(point.theta - self.theta)[positive] > MAX_THETA_CHANGE * self.theta[positive]
        ):
            return SavedJacobians.at(fit, point)
        if np.any(self.stale):
            fit.jacobians(point, selected=self.stale, unselected=self.jacobians)
        return replace(self, stale=np.zeros(len(self.stale), dtype=bool))


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of a search.

    Attributes:
        point: the best point.
        prediction: its predictions.
        cost: its cost.
        iterations: number of iterations.
        settled: whether the last iteration hardly changed the costs.
        poorly_predicted: (S,) bool, segments whose derivatives predicted neither of the last two
            moves well.
        saved_jacobians: the Jacobians of all segments, which a later search can reuse.
    """

    point: Point
    prediction: Prediction
    cost: float
    iterations: int
    settled: bool
    poorly_predicted: MaskRows
    saved_jacobians: SavedJacobians


def search(
    cost: Cost,
    point: Point,
    positive: MaskRows,
    saved_jacobians: SavedJacobians | None = None,
    *,
    max_iterations: int,
    tolerance: float,
    extrapolated: bool = False,
    states_only: bool = False,
    progress: OnProgress | None = None,
) -> SearchResult:
    """Moves a point until the cost no longer falls.

    Args:
        cost: the cost.
        point: the initial point.
        positive: (P,) bool, unknowns that stay above zero.
        saved_jacobians: Jacobians from an earlier search.
        max_iterations: maximum number of iterations; more, with at most four times as many trials,
            while the cost falls steeply.
        tolerance: relative fall of the cost that ends the search.
        extrapolated: whether residuals are extrapolated to a time step of 0; derivatives are not.
        states_only: whether the unknowns stay fixed.
        progress: called with the cost, as ``best``, after every iteration.
    """
    damping, n_iterations, settled = np.full(len(point.q_D), FIRST_DAMPING), 0, False
    shared_damping = FIRST_DAMPING
    fit = cost.fit
    prediction = fit.predict(point, extrapolated=extrapolated)
    if not prediction.arrived:
        raise StateError(
            "the puppet cannot be simulated with the numbers that the search has reached; give "
            "better initial values, or use a smaller dt"
        )
    released = fit.released_point(point, prediction)
    if saved_jacobians is None:
        saved_jacobians = SavedJacobians.at(fit, released)
    saved_jacobians = replace(
        saved_jacobians, stale=saved_jacobians.stale | cost.changed_segments(point, released)
    )
    point = released
    normal: NormalEquations | None = None
    costs = cost.segment_costs(point, prediction)
    n_tries = n_failed = 0
    poorly_predicted = stale = np.zeros(len(point.q_D), dtype=bool)
    falls_steeply = False
    while (
        (n_iterations < max_iterations or falls_steeply)
        and not settled
        and n_tries < 4 * max_iterations
    ):
        n_tries += 1
        if normal is None:
            saved_jacobians = saved_jacobians.renew(fit, point, positive)
            normal = cost.normal_equations(point, prediction, saved_jacobians.jacobians)
        if states_only:
            move = _step(normal.without_parameters(), damping, shared_damping)[0]
            theta_move = 0.0 * point.theta
        else:
            move, theta_move = _step(normal, damping, shared_damping)
        trial = fit.moved_point(
            point, move, _bounded(point.theta, theta_move, positive) - point.theta
        )
        trial_prediction = fit.predict(trial, extrapolated=extrapolated)
        trial_costs = cost.segment_costs(trial, trial_prediction)
        is_worse = _worsened_segments(costs, trial_costs)
        if np.any(is_worse) and trial_prediction.arrived:
            trial, trial_prediction, trial_costs = _restore_worsened(
                cost, point, trial, trial_prediction, trial_costs, is_worse, extrapolated
            )
        if not np.sum(trial_costs) < np.sum(costs):
            damping = np.where(is_worse, np.minimum(16.0 * damping, MAX_DAMPING), damping)
            n_failed += 1
            if n_failed > 2 or not np.any(is_worse):
                shared_damping *= 8.0
            settled = shared_damping > MAX_DAMPING
            continue
        damping = np.where(is_worse, 4.0 * damping, np.maximum(damping / 4.0, MIN_DAMPING))
        n_failed = 0
        # The costs of segments may change while their sum does not: the search then continues.
        change = np.abs(costs - trial_costs)
        min_decrease = max(tolerance * float(np.sum(costs)), MIN_DECREASE)
        decrease = float(np.sum(costs - trial_costs))
        settled = decrease <= min_decrease and bool(
            np.sum(change) <= MAX_COST_CHANGE * min_decrease
        )
        falls_steeply = decrease > STEEP_DECREASE * float(np.sum(costs))
        shared_damping, n_iterations = max(MIN_DAMPING, shared_damping / 8.0), n_iterations + 1
        previously_stale = stale
        stale = cost.badly_predicted(
            point, trial, prediction, trial_prediction, saved_jacobians.jacobians
        )
        released = fit.released_point(trial, trial_prediction)
        poorly_predicted = previously_stale & stale
        saved_jacobians = replace(
            saved_jacobians, stale=stale | cost.changed_segments(point, released)
        )
        point, costs, prediction, normal = released, trial_costs, trial_prediction, None
        if progress is not None:
            progress(Progress(best=float(np.sum(costs))))
    return SearchResult(
        point,
        prediction,
        float(np.sum(costs)),
        n_iterations,
        settled,
        poorly_predicted,
        saved_jacobians,
    )


def _worsened_segments(costs: Array, new: Array) -> MaskRows:
    """(S,) bool, segments that cost more, and their neighbours, which share their jumps."""
    return with_neighbours((new - costs)[:-1] > 0.02 * costs[:-1] + 1.0, 1, 1)


def _restore_worsened(
    cost: Cost,
    point: Point,
    trial: Point,
    prediction: Prediction,
    costs: Array,
    is_worse: MaskRows,
    extrapolated: bool,
) -> tuple[Point, Prediction, Array]:
    """The trial with the old first states of worsened segments, where that costs less."""
    fit = cost.fit
    restored = trial.with_segments(point, is_worse)
    restored = fit.projected_point(
        restored.q_D, restored.v_D, restored.theta, restored.active_rows, is_worse
    )
    restored_prediction = fit.predict(
        restored, extrapolated=extrapolated, selected=is_worse, unselected=prediction
    )
    if not restored_prediction.arrived:
        return trial, prediction, costs
    is_cheaper = cheaper_windows(is_worse, costs, cost.segment_costs(restored, restored_prediction))
    trial = trial.with_segments(restored, is_cheaper)
    prediction = prediction.with_segments(
        restored_prediction, is_cheaper, fit.segments(trial.theta)
    )
    return trial, prediction, cost.segment_costs(trial, prediction)


def _step(normal: NormalEquations, damping: Array, shared_damping: float) -> tuple[Array, Array]:
    """A move within the bounds of ``MAX_MOVE``; raises the damping of states that exceed them."""
    while True:
        move, theta = normal.step(damping, shared_damping)
        n = move.shape[1] // 2
        excess = np.maximum(
            np.max(np.abs(move[:, :n]), axis=1) / MAX_MOVE[0],
            np.max(np.abs(move[:, n:]), axis=1) / MAX_MOVE[1],
        )
        if not np.any(excess > 1.0) or np.min(damping[excess > 1.0]) >= MAX_DAMPING:
            return move, theta
        damping[excess > 1.0] *= np.maximum(4.0, excess[excess > 1.0] ** 2)


def _bounded(theta: Array, move: Array, positive: MaskRows) -> Array:
    """theta moved; positive numbers change by a bounded factor."""
    moved = theta + move
    low, high = theta / MAX_FACTOR, theta * MAX_FACTOR
    return np.where(positive, np.clip(moved, low, high), moved)
