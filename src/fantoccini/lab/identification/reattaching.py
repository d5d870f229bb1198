"""Reattachment of detached segments, whose simulation has another order of events than the record.

Such a segment begins far from the end of the previous one. No small move brings it back, because
Cauchy's loss hardly grows with a large jump. It is started again at the end of the previous
segment, and fitted together with its neighbours while the drift is reduced in steps.

A segment is a piece of the record that is simulated from its own first state (q_D, v_D); the jump
is the difference between this state and the end of the previous segment, and the drift its allowed
standard deviation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.base import MaskRows
from fantoccini.lab.identification.blocks import MAX_MOVE
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.rollouts import roll_out
from fantoccini.lab.identification.search_point import Jacobians, Point, Prediction
from fantoccini.lab.identification.windows import cheaper_windows, with_neighbours

N_NEIGHBOURS = 3
"""Number of neighbours on each side that are fitted with a detached segment."""
DRIFT_FACTORS = (15.0, 4.0, 1.0)
"""Factors on the drift, in the order of use."""
MOVES_PER_DRIFT = 3
"""Number of moves for each factor on the drift."""
FIRST_DAMPING, MIN_DAMPING = 1e-3, 1e-4
"""First and smallest damping of a window."""
FREEZING_DAMPING = 1e12
"""Damping of segments that are not to move."""


def reattach(cost: Cost, point: Point) -> Point:
    """Point in which detached segments are replaced where that reduces the cost; theta is fixed."""
    fit = cost.fit
    first_prediction = fit.predict(point, extrapolated=True)
    if not first_prediction.arrived:
        return point
    detached = cost.detached_segments(point, first_prediction)
    is_free = with_neighbours(detached, N_NEIGHBOURS, N_NEIGHBOURS - 1)
    if not np.any(is_free):
        return point
    trial = _chain_detached(fit, point, first_prediction, detached)
    trial_prediction = fit.predict(
        trial, extrapolated=True, selected=is_free, unselected=first_prediction
    )
    if not trial_prediction.arrived:
        return point
    cost = replace(cost, weights=replace(cost.weights, joined=True))
    drift = cost.weights.drift
    jacobians = _jacobians(fit, trial, is_free)
    for factor in DRIFT_FACTORS:
        wider = replace(cost.weights, drift=(factor * drift[0], factor * drift[1]))
        trial, trial_prediction = _fit_free_segments(
            replace(cost, weights=wider), trial, trial_prediction, jacobians, is_free
        )
    return point.with_segments(
        trial,
        cheaper_windows(
            is_free,
            cost.segment_costs(point, first_prediction),
            cost.segment_costs(trial, trial_prediction),
        ),
    )


def _jacobians(fit: Fit, point: Point, is_free: MaskRows) -> Jacobians:
    """Derivatives of free segments; 0 for the others, which do not move."""
    m, P = 2 * fit.marionette.coordinates.n_vD, len(fit.layout)
    zeros = [
        np.zeros((*shape, m + P)) for shape in (fit.y.shape, (len(is_free), m), (len(is_free), m))
    ]
    return fit.jacobians(point, selected=is_free, unselected=Jacobians(*zeros))


def _fit_free_segments(
    cost: Cost, point: Point, prediction: Prediction, jacobians: Jacobians, is_free: MaskRows
) -> tuple[Point, Prediction]:
    """Moves the free states, each window independently; updates the derivatives in place."""
    fit, P = cost.fit, len(cost.fit.layout)
    damping = np.where(is_free, FIRST_DAMPING, FREEZING_DAMPING)
    costs = cost.segment_costs(point, prediction)
    max_move = np.repeat(MAX_MOVE, point.v_D.shape[1])
    for _ in range(MOVES_PER_DRIFT):
        equations = cost.normal_equations(
            point, prediction, jacobians, is_free
        ).without_parameters()
        move = np.where(is_free[:, None], equations.step(damping, 1.0)[0], 0.0)
        move /= np.maximum(1.0, np.max(np.abs(move) / max_move, axis=1))[:, None]
        trial = fit.moved_point(point, move, np.zeros(P), is_free)
        trial_prediction = fit.predict(
            trial, extrapolated=True, selected=is_free, unselected=prediction
        )
        is_better = cheaper_windows(is_free, costs, cost.segment_costs(trial, trial_prediction))
        damping = np.where(is_better, np.maximum(damping / 4.0, MIN_DAMPING), 16.0 * damping)
        damping[~is_free] = FREEZING_DAMPING
        if np.any(is_better):
            point = point.with_segments(trial, is_better)
            prediction = prediction.with_segments(
                trial_prediction, is_better, fit.segments(point.theta)
            )
            costs = cost.segment_costs(point, prediction)
            fit.jacobians(point, selected=is_better, unselected=jacobians)
    return point, prediction


def _chain_detached(fit: Fit, point: Point, prediction: Prediction, detached: MaskRows) -> Point:
    """Point whose detached segments begin where the previous ones end."""
    q_D, v_D, active_rows = point.q_D.copy(), point.v_D.copy(), point.active_rows.copy()
    driven, p = fit.driven(point.theta, 0.5 * fit.dt), fit.p(point.theta)
    for s in np.flatnonzero(detached):
        if detached[s - 1]:
            previous = roll_out(
                fit.marionette,
                driven.subset(slice(s - 1, s)),
                q_D[s - 1, None],
                v_D[s - 1, None],
                p,
            )
            if not previous.arrived:
                continue
            q_D[s], v_D[s] = previous.q_D[-1, 0], previous.v_D[-1, 0]
        else:
            q_D[s], v_D[s] = prediction.q_D[s - 1], prediction.v_D[s - 1]
    active_rows[detached] = fit.row_projection(
        point.theta, np.flatnonzero(detached)
    ).nearly_closed_rows(q_D[detached], v_D[detached])
    return fit.projected_point(q_D, v_D, point.theta, active_rows, detached)
