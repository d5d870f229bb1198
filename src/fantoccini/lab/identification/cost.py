"""Cost of a point's predictions, and the normal equations that minimise it.

A segment is a piece of the record that is simulated from its own first state; a jump is the
difference between this state and the end of the previous segment. q_D and v_D are dynamic
coordinates and velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, MaskRows
from fantoccini.dynamics.compiled import difference
from fantoccini.lab.identification.blocks import NormalEquations
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.search_point import Jacobians, Point, Prediction, Weights

HUBER_THRESHOLD = 3.0
"""Residual, divided by its noise level, above which the cost grows linearly (Huber)."""
CAUCHY_SCALE = 6.0
"""Scale of Cauchy's loss of residuals, in units of their noise level."""
MAX_EXCESS = 5.0
"""Excess of a segment's mean square above the median at which it is not explained [deviations]."""
MAX_JUMP_RATIO = 8.0
"""Jump above which a segment is detached, divided by the drift and by the median jump."""
FORBIDDEN_MOVE_WEIGHT = 1e-8
"""Weight of moves that taut strings prevent, relative to that of the drift."""
MAX_LINEAR_ERROR = 0.1
"""Relative error of a linear prediction above which derivatives are computed again."""
MIN_CHANGE = 1e-2
"""Change below which a linear prediction is not checked: sum of squares, relative to the noise
and the drift."""
FIRST_STATE_DEVIATION = (0.5, 5.0)
"""Standard deviations of the first state about its guess [rad or m, rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class Cost:
    """Cost of residuals, of jumps between segments and of deviations from prior knowledge.

    Attributes:
        fit: the record and its model.
        first_guess: a point with the guess of the first state.
        weights: weights of residuals and jumps.
        trusted: (S,) bool, the segments that count, with the jumps after them; all by default.
    """

    fit: Fit
    first_guess: Point
    weights: Weights
    trusted: MaskRows | None = None

    def residuals(self, point: Point, prediction: Prediction) -> tuple[Array, MaskRows]:
        """(N, n_c) (prediction - sample) / noise, 0 in gaps; and the mask of samples."""
        is_present = np.isfinite(self.fit.y)
        if self.trusted is not None:
            is_present &= self.trusted[self.fit.segments(point.theta), None]
        r = np.where(is_present, prediction.y - np.nan_to_num(self.fit.y), 0.0) / self.weights.noise
        return r, is_present

    def explained_segments(self, point: Point, prediction: Prediction) -> MaskRows:
        """(S,) bool, the segments that fit about as well as the median, without large jumps.

        In the others the simulation has another order of events than the puppet had. A few
        outliers do not make a segment one of them.
        """
        r, is_present = self.residuals(point, prediction)
        segments, S = self.fit.segments(point.theta), len(point.q_D)
        n = np.maximum(np.bincount(segments, np.sum(is_present, axis=1), S), 1.0)
        mean = (
            np.bincount(segments, np.sum(np.minimum(np.abs(r), HUBER_THRESHOLD) ** 2, axis=1), S)
            / n
        )
        median = np.median(mean[n > 1.0]) if np.any(n > 1.0) else 1.0
        detached = self.detached_segments(point, prediction)
        beside_jump = detached | np.append(detached[1:], False)
        return np.asarray((mean <= median * (1.0 + MAX_EXCESS * np.sqrt(2.0 / n))) & ~beside_jump)

    def detached_segments(self, point: Point, prediction: Prediction) -> MaskRows:
        """(S,) bool, the detached segments: they begin far from the end of the previous one."""
        jumps = np.max(np.abs(self.jumps(point, prediction)), axis=1, initial=0.0)
        median = np.median(jumps) if len(jumps) else 0.0
        return np.append(False, jumps > MAX_JUMP_RATIO * max(1.0, median))

    def jumps(self, point: Point, prediction: Prediction) -> Array:
        """(S - 1, 2 n_vD) (first state - end of the previous segment) / drift."""
        drift = self.weights.drift
        dq = difference(self.fit.marionette, prediction.q_D[:-1], point.q_D[1:]) / drift[0]
        dv = (point.v_D[1:] - prediction.v_D[:-1]) / drift[1]
        jumps = np.concatenate([dq, dv], axis=1)
        return jumps if self.trusted is None else jumps * self.trusted[:-1, None]

    def segment_costs(self, point: Point, prediction: Prediction) -> Array:
        """(S + 1,) the cost of every segment, and of theta's deviation from prior knowledge.

        Samples have Huber's loss, and Cauchy's in the final stage. The jump before a segment has
        Cauchy's, since a catch one step early or late makes a jump of any size; while segments are
        reattached it has Huber's.
        """
        S, fit = len(point.q_D), self.fit
        if not prediction.arrived:
            return np.full(S + 1, np.inf)
        r, _ = self.residuals(point, prediction)
        costs = np.zeros(S + 1)
        costs[:S] = np.bincount(fit.segments(point.theta), np.sum(self._loss(r), axis=1), S)
        jumps = self.jumps(point, prediction)
        costs[1:S] += np.sum(
            _huber(jumps) if self.weights.joined else _cauchy(jumps, HUBER_THRESHOLD), axis=1
        )
        costs[0] += 0.5 * np.sum(self._first_state_residual(point) ** 2)
        costs[S] = 0.5 * np.sum(((point.theta - fit.theta_0) / fit.prior_std) ** 2)
        return costs

    def _loss(self, r: Array) -> Array:
        """The loss of residuals."""
        return _cauchy(r, CAUCHY_SCALE) if self.weights.final else _huber(r)

    def _first_state_residual(self, point: Point) -> Array:
        """(2 n_vD,) (first state - its guess) / its standard deviation."""
        dq = (
            difference(self.fit.marionette, self.first_guess.q_D[0], point.q_D[0])
            / FIRST_STATE_DEVIATION[0]
        )
        return np.concatenate(
            [dq, (point.v_D[0] - self.first_guess.v_D[0]) / FIRST_STATE_DEVIATION[1]]
        )

    def badly_predicted(
        self,
        point: Point,
        new_point: Point,
        prediction: Prediction,
        new_prediction: Prediction,
        jacobians: Jacobians,
    ) -> MaskRows:
        """(S,) bool, segments whose derivatives predicted a move badly."""
        fit, S = self.fit, len(point.q_D)
        segments = fit.segments(point.theta)
        is_present = np.isfinite(fit.y) & (fit.segments(new_point.theta) == segments)[:, None]
        theta = np.broadcast_to(new_point.theta - point.theta, (S, len(point.theta)))
        dq = difference(fit.marionette, point.q_D, new_point.q_D)
        move = np.concatenate([dq, new_point.v_D - point.v_D, theta], axis=1)
        change = np.where(is_present, new_prediction.y - prediction.y, 0.0) / self.weights.noise
        linear_change = (jacobians.samples @ move[segments, :, None])[..., 0] / self.weights.noise
        linear_change = np.where(is_present, linear_change, 0.0)
        drift = np.repeat(self.weights.drift, dq.shape[1])
        ends = (
            difference(fit.marionette, prediction.q_D, new_prediction.q_D),
            new_prediction.v_D - prediction.v_D,
        )
        end = np.concatenate(ends, axis=1) / drift
        error = np.bincount(segments, np.sum((change - linear_change) ** 2, axis=1), S)
        total = np.bincount(segments, np.sum(change**2, axis=1), S)
        error += np.sum((end - (jacobians.end @ move[..., None])[..., 0] / drift) ** 2, axis=1)
        total += np.sum(end**2, axis=1)
        return np.asarray(error > np.maximum(MAX_LINEAR_ERROR**2 * total, MIN_CHANGE))

    def changed_segments(self, point: Point, new_point: Point) -> MaskRows:
        """(S,) bool, segments whose samples, or active rows of the first state, have changed."""
        changed = np.any(point.active_rows != new_point.active_rows, axis=1)
        before, after = self.fit.segments(point.theta), self.fit.segments(new_point.theta)
        has_moved = before != after
        changed[before[has_moved]] = changed[after[has_moved]] = True
        return np.asarray(changed)

    def normal_equations(
        self,
        point: Point,
        prediction: Prediction,
        jacobians: Jacobians,
        selected: MaskRows | None = None,
    ) -> NormalEquations:
        """The normal equations at a point, for all samples or for ``selected`` segments (S,)."""
        fit, weights = self.fit, self.weights
        S, m, P = len(point.q_D), jacobians.end.shape[1], len(fit.layout)
        r, is_present = self.residuals(point, prediction)
        divisor = (
            1.0 + (r / CAUCHY_SCALE) ** 2
            if weights.final
            else np.maximum(1.0, np.abs(r) / HUBER_THRESHOLD)
        )
        weight = np.sqrt(np.where(is_present, 1.0, 0.0) / divisor)
        residual, weight = r * weight, weight / weights.noise
        matrices = np.zeros((S, m + P, m + P))
        gradients = np.zeros((S, m + P))
        order = np.argsort(fit.segments(point.theta), kind="stable")
        ends = np.searchsorted(fit.segments(point.theta)[order], np.arange(S + 1))
        for s in range(S) if selected is None else np.flatnonzero(selected):
            samples = order[ends[s] : ends[s + 1]]
            J = (jacobians.samples[samples] * weight[samples, :, None]).reshape(-1, m + P)
            matrices[s], gradients[s] = J.T @ J, J.T @ residual[samples].ravel()
        begin, n = jacobians.begin, m // 2
        scale = np.repeat([1.0 / weights.drift[0], 1.0 / weights.drift[1]], n)
        jumps = self.jumps(point, prediction)
        jump_ratio = np.abs(jumps) / HUBER_THRESHOLD
        jump_weight = scale / np.sqrt(
            np.maximum(1.0, jump_ratio) if weights.joined else 1.0 + jump_ratio**2
        )
        if self.trusted is not None:
            jump_weight *= self.trusted[:-1, None]
        jumps = jumps * (jump_weight / scale)
        J_before = -jacobians.end[:-1] * jump_weight[..., None]
        J_before[..., m:] += begin[1:, :, m:] * jump_weight[..., None]
        J_after = begin[1:, :, :m] * jump_weight[..., None]
        matrices[:-1] += J_before.swapaxes(1, 2) @ J_before
        gradients[:-1] += np.einsum("smk,sm->sk", J_before, jumps)
        H, g = matrices[:, :m, :m].copy(), gradients[:, :m].copy()
        border = matrices[:, :m, m:].copy()
        H[1:] += J_after.swapaxes(1, 2) @ J_after
        g[1:] += np.einsum("smk,sm->sk", J_after, jumps)
        border[1:] += J_after.swapaxes(1, 2) @ J_before[..., m:]
        first_state_jacobian = begin[0] / np.repeat(FIRST_STATE_DEVIATION, n)[:, None]
        first_residual = self._first_state_residual(point)
        H[0] += first_state_jacobian[:, :m].T @ first_state_jacobian[:, :m]
        border[0] += first_state_jacobian[:, :m].T @ first_state_jacobian[:, m:]
        g[0] += first_state_jacobian[:, :m].T @ first_residual
        # Moves that taut strings prevent have no effect; a small weight keeps them bounded.
        H += FORBIDDEN_MOVE_WEIGHT * np.diag(scale**2)
        T = matrices[:, m:, m:].sum(axis=0) + np.diag(1.0 / fit.prior_std**2)
        T += first_state_jacobian[:, m:].T @ first_state_jacobian[:, m:]
        h = gradients[:, m:].sum(axis=0) + (point.theta - fit.theta_0) / fit.prior_std**2
        h += first_state_jacobian[:, m:].T @ first_residual
        coupling = J_before[..., :m].swapaxes(1, 2) @ J_after
        return NormalEquations(H, coupling, border, T, g, h)


def _huber(r: Array) -> Array:
    """Huber's loss: half the square up to OUTLIER, linear beyond."""
    size = np.abs(r)
    return np.where(
        size <= HUBER_THRESHOLD, 0.5 * r * r, HUBER_THRESHOLD * (size - 0.5 * HUBER_THRESHOLD)
    )


def _cauchy(r: Array, scale: float) -> Array:
    """Cauchy's loss: half the square of small residuals, logarithmic in large ones."""
    return np.asarray(0.5 * scale**2 * np.log1p((r / scale) ** 2))
