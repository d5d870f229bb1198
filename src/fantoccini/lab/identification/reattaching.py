"""Segments that were caught in another order of events than the puppet's, looked for anew.

Such a segment begins far from where the one before ends, and no small move brings it back: the gap
counts ever less the larger it is. It begins anew where the one before ends, and it and its
neighbours are fitted while the drift is narrowed step by step.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.base import MaskRows
from fantoccini.lab.identification.blocks import LARGEST_MOVE
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.point import Jacobians, Point, Predicted
from fantoccini.lab.identification.rolling import roll
from fantoccini.lab.identification.windows import cheaper, spread

_REACH = 3
"""Segments on both sides that are fitted, too."""
_DRIFTS = (15.0, 4.0, 1.0)
"""Factors of the drift, one after the other."""
_MOVES = 3
"""With each of them."""
_FIRST_DAMPING, _LEAST_DAMPING, _FROZEN = 1e-3, 1e-4, 1e12


def untangled(cost: Cost, at: Point) -> Point:
    """The point with tangled segments replaced where that costs less; the unknowns stay."""
    fit = cost.fit
    first = fit.predict(at, extrapolated=True)
    if not first.arrived:
        return at
    far = cost.tangled(at, first)
    loose = spread(far, _REACH, _REACH - 1)
    if not np.any(loose):
        return at
    to = _chained(fit, at, first, far)
    seen = fit.predict(to, extrapolated=True, only=loose, kept=first)
    if not seen.arrived:
        return at
    cost = replace(cost, weights=replace(cost.weights, joined=True))
    drift = cost.weights.drift
    jacobians = _jacobians(fit, to, loose)
    for factor in _DRIFTS:
        wider = replace(cost.weights, drift=(factor * drift[0], factor * drift[1]))
        to, seen = _fitted(replace(cost, weights=wider), to, seen, jacobians, loose)
    return at.mixed(to, cheaper(loose, cost.parts(at, first), cost.parts(to, seen)))


def _jacobians(fit: Fit, at: Point, loose: MaskRows) -> Jacobians:
    """Those of loose segments; the others do not move, theirs are 0."""
    m, P = 2 * fit.marionette.coordinates.n_vD, len(fit.layout)
    none = [np.zeros((*lead, m + P)) for lead in (fit.y.shape, (len(loose), m), (len(loose), m))]
    return fit.jacobians(at, only=loose, kept=Jacobians(*none))


def _fitted(
    cost: Cost, at: Point, predicted: Predicted, jacobians: Jacobians, loose: MaskRows
) -> tuple[Point, Predicted]:
    """Moves the loose states, every window for itself; the jacobians are written over."""
    fit, P = cost.fit, len(cost.fit.layout)
    damping = np.where(loose, _FIRST_DAMPING, _FROZEN)
    parts = cost.parts(at, predicted)
    largest = np.repeat(LARGEST_MOVE, at.v_D.shape[1])
    for _ in range(_MOVES):
        normal = cost.normal(at, predicted, jacobians, loose).of_states()
        by = np.where(loose[:, None], normal.step(damping, 1.0)[0], 0.0)
        by /= np.maximum(1.0, np.max(np.abs(by) / largest, axis=1))[:, None]
        to = fit.moved(at, by, np.zeros(P), loose)
        seen = fit.predict(to, extrapolated=True, only=loose, kept=predicted)
        better = cheaper(loose, parts, cost.parts(to, seen))
        damping = np.where(better, np.maximum(damping / 4.0, _LEAST_DAMPING), 16.0 * damping)
        damping[~loose] = _FROZEN
        if np.any(better):
            at = at.mixed(to, better)
            predicted = predicted.mixed(seen, better, fit.segments(at.theta))
            parts = cost.parts(at, predicted)
            fit.jacobians(at, only=better, kept=jacobians)
    return at, predicted


def _chained(fit: Fit, at: Point, predicted: Predicted, far: MaskRows) -> Point:
    """Far segments begin where those before them end, one after the other."""
    q_D, v_D, held = at.q_D.copy(), at.v_D.copy(), at.held.copy()
    driven, p = fit.driven(at.theta, 0.5 * fit.dt), fit.p(at.theta)
    for s in np.flatnonzero(far):
        if far[s - 1]:
            before = roll(
                fit.marionette, driven.some(slice(s - 1, s)), q_D[s - 1, None], v_D[s - 1, None], p
            )
            if not before.arrived:
                continue
            q_D[s], v_D[s] = before.q_D[-1, 0], before.v_D[-1, 0]
        else:
            q_D[s], v_D[s] = predicted.q_D[s - 1], predicted.v_D[s - 1]
    held[far] = fit.holding(at.theta, np.flatnonzero(far)).near(q_D[far], v_D[far])
    return fit.placed(q_D, v_D, at.theta, held, far)
