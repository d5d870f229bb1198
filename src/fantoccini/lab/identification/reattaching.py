"""Reattachment of detached segments, whose simulation has another order of events than the record.

Such a segment begins far from the end of the previous one. No small move brings it back, because
Cauchy's loss hardly grows with a large jump. It is started again at the end of the previous
segment, and fitted together with its neighbours while the drift is reduced in steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.base import MaskRows
from fantoccini.lab.identification.blocks import MAX_MOVE
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.rollouts import roll_out
from fantoccini.lab.identification.search_point import Jacobians, Point, Predicted
from fantoccini.lab.identification.windows import cheaper, spread

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
    first = fit.predict(point, extrapolated=True)
    if not first.arrived:
        return point
    detached = cost.detached(point, first)
    free = spread(detached, N_NEIGHBOURS, N_NEIGHBOURS - 1)
    if not np.any(free):
        return point
    trial = _chain_detached(fit, point, first, detached)
    trial_predicted = fit.predict(trial, extrapolated=True, only=free, others=first)
    if not trial_predicted.arrived:
        return point
    cost = replace(cost, weights=replace(cost.weights, joined=True))
    drift = cost.weights.drift
    jacobians = _jacobians(fit, trial, free)
    for factor in DRIFT_FACTORS:
        wider = replace(cost.weights, drift=(factor * drift[0], factor * drift[1]))
        trial, trial_predicted = _fit_free(
            replace(cost, weights=wider), trial, trial_predicted, jacobians, free
        )
    return point.with_segments(
        trial, cheaper(free, cost.parts(point, first), cost.parts(trial, trial_predicted))
    )


def _jacobians(fit: Fit, point: Point, free: MaskRows) -> Jacobians:
    """Derivatives of free segments; 0 for the others, which do not move."""
    m, P = 2 * fit.marionette.coordinates.n_vD, len(fit.layout)
    zeros = [np.zeros((*lead, m + P)) for lead in (fit.y.shape, (len(free), m), (len(free), m))]
    return fit.jacobians(point, only=free, others=Jacobians(*zeros))


def _fit_free(
    cost: Cost, point: Point, predicted: Predicted, jacobians: Jacobians, free: MaskRows
) -> tuple[Point, Predicted]:
    """Moves the free states, each window independently; updates the derivatives in place."""
    fit, P = cost.fit, len(cost.fit.layout)
    damping = np.where(free, FIRST_DAMPING, FREEZING_DAMPING)
    parts = cost.parts(point, predicted)
    max_move = np.repeat(MAX_MOVE, point.v_D.shape[1])
    for _ in range(MOVES_PER_DRIFT):
        normal = cost.normal(point, predicted, jacobians, free).of_states()
        move = np.where(free[:, None], normal.step(damping, 1.0)[0], 0.0)
        move /= np.maximum(1.0, np.max(np.abs(move) / max_move, axis=1))[:, None]
        trial = fit.moved(point, move, np.zeros(P), free)
        trial_predicted = fit.predict(trial, extrapolated=True, only=free, others=predicted)
        better = cheaper(free, parts, cost.parts(trial, trial_predicted))
        damping = np.where(better, np.maximum(damping / 4.0, MIN_DAMPING), 16.0 * damping)
        damping[~free] = FREEZING_DAMPING
        if np.any(better):
            point = point.with_segments(trial, better)
            predicted = predicted.with_segments(trial_predicted, better, fit.segments(point.theta))
            parts = cost.parts(point, predicted)
            fit.jacobians(point, only=better, others=jacobians)
    return point, predicted


def _chain_detached(fit: Fit, point: Point, predicted: Predicted, detached: MaskRows) -> Point:
    """Point whose detached segments begin where the previous ones end."""
    q_D, v_D, held = point.q_D.copy(), point.v_D.copy(), point.held.copy()
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
            q_D[s], v_D[s] = predicted.q_D[s - 1], predicted.v_D[s - 1]
    held[detached] = fit.row_projection(point.theta, np.flatnonzero(detached)).nearly_closed(
        q_D[detached], v_D[detached]
    )
    return fit.projected(q_D, v_D, point.theta, held, detached)
