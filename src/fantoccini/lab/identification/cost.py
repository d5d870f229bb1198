"""What the predictions of a point cost, and the normal equations of the least of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, MaskRows
from fantoccini.dynamics.compiled import difference
from fantoccini.lab.identification.blocks import Normal
from fantoccini.lab.identification.fit import Fit
from fantoccini.lab.identification.point import Jacobians, Point, Predicted, Weights

OUTLIER = 3.0
"""Residual, over its noise level, from which on it counts by its size instead of its square."""
FAR = 6.0
"""Scale of Cauchy's measure of samples, over their noise level."""
_UNUSUAL = 5.0
"""Standard deviations of a segment's mean square from which on it is not explained."""
_TANGLED = 8.0
"""Gap from which on segments are not joined: over the drift, and over that of most."""
_FORBIDDEN = 1e-8
"""Weight of moves that strings forbid, relative to that of the drift."""
_TOLD = 0.1
"""Part of a change that derivatives may miss before they are found anew."""
_STILL = 1e-2
"""Sum of squares, over noise and drift, of changes that are missed at any rate."""
FIRST_STATE = (0.5, 5.0)
"""Spread of the first state about its guess [rad or m, rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class Cost:
    """What residuals, gaps and what is known cost together.

    Attributes:
        fit: the record and its model.
        first: the guess of the first state.
        weights: of residuals and gaps.
        trusted: (S,) bool, the segments that count, with the gaps behind them; all when not given.
    """

    fit: Fit
    first: Point
    weights: Weights
    trusted: MaskRows | None = None

    def residuals(self, at: Point, predicted: Predicted) -> tuple[Array, MaskRows]:
        """(N, n_c) prediction less sample over the noise, 0 where there is no sample; and which."""
        there = np.isfinite(self.fit.y)
        if self.trusted is not None:
            there &= self.trusted[self.fit.segments(at.theta), None]
        r = np.where(there, predicted.y - np.nan_to_num(self.fit.y), 0.0) / self.weights.noise
        return r, there

    def explained(self, at: Point, predicted: Predicted) -> MaskRows:
        """(S,) bool, the segments that are explained, and joined to the next, as well as most are.

        The others are caught in an order of events that the puppet's was not. A few outliers do
        not make a segment one of them.
        """
        r, there = self.residuals(at, predicted)
        segments, S = self.fit.segments(at.theta), len(at.q_D)
        n = np.maximum(np.bincount(segments, np.sum(there, axis=1), S), 1.0)
        mean = np.bincount(segments, np.sum(np.minimum(np.abs(r), OUTLIER) ** 2, axis=1), S) / n
        usual = np.median(mean[n > 1.0]) if np.any(n > 1.0) else 1.0
        tangled = self.tangled(at, predicted)
        odd = tangled | np.append(tangled[1:], False)
        return np.asarray((mean <= usual * (1.0 + _UNUSUAL * np.sqrt(2.0 / n))) & ~odd)

    def tangled(self, at: Point, predicted: Predicted) -> MaskRows:
        """(S,) bool, the segments that begin far from where the one before ends."""
        gaps = np.max(np.abs(self.gaps(at, predicted)), axis=1, initial=0.0)
        usual = np.median(gaps) if len(gaps) else 0.0
        return np.append(False, gaps > _TANGLED * max(1.0, usual))

    def gaps(self, at: Point, predicted: Predicted) -> Array:
        """(S - 1, 2 n_vD) first states less the ends before them, over the drift."""
        drift = self.weights.drift
        dq = difference(self.fit.marionette, predicted.q_D[:-1], at.q_D[1:]) / drift[0]
        dv = (at.v_D[1:] - predicted.v_D[:-1]) / drift[1]
        gaps = np.concatenate([dq, dv], axis=1)
        return gaps if self.trusted is None else gaps * self.trusted[:-1, None]

    def parts(self, at: Point, predicted: Predicted) -> Array:
        """(S + 1,) the cost of every segment, and of what is known of theta.

        Of its samples, by Huber's measure, or by Cauchy's in the end; and of the gap before it, by
        Cauchy's, since a catch that comes a step too early or late makes a gap of any size, or by
        Huber's while segments are to be joined.
        """
        S, fit = len(at.q_D), self.fit
        if not predicted.arrived:
            return np.full(S + 1, np.inf)
        r, _ = self.residuals(at, predicted)
        out = np.zeros(S + 1)
        out[:S] = np.bincount(fit.segments(at.theta), np.sum(self._measure(r), axis=1), S)
        gaps = self.gaps(at, predicted)
        out[1:S] += np.sum(_huber(gaps) if self.weights.joined else _cauchy(gaps, OUTLIER), axis=1)
        out[0] += 0.5 * np.sum(self._known(at) ** 2)
        out[S] = 0.5 * np.sum(((at.theta - fit.begin) / fit.prior) ** 2)
        return out

    def _measure(self, r: Array) -> Array:
        """What residuals cost."""
        return _cauchy(r, FAR) if self.weights.final else _huber(r)

    def _known(self, at: Point) -> Array:
        """(2 n_vD,) the first state less its guess, over its spread."""
        dq = difference(self.fit.marionette, self.first.q_D[0], at.q_D[0]) / FIRST_STATE[0]
        return np.concatenate([dq, (at.v_D[0] - self.first.v_D[0]) / FIRST_STATE[1]])

    def stale(
        self, at: Point, to: Point, predicted: Predicted, seen: Predicted, jacobians: Jacobians
    ) -> MaskRows:
        """(S,) bool, segments whose derivatives told a move badly; samples that stay in them."""
        fit, S = self.fit, len(at.q_D)
        segments = fit.segments(at.theta)
        there = np.isfinite(fit.y) & (fit.segments(to.theta) == segments)[:, None]
        theta = np.broadcast_to(to.theta - at.theta, (S, len(at.theta)))
        dq = difference(fit.marionette, at.q_D, to.q_D)
        move = np.concatenate([dq, to.v_D - at.v_D, theta], axis=1)
        came = np.where(there, seen.y - predicted.y, 0.0) / self.weights.noise
        told = (jacobians.samples @ move[segments, :, None])[..., 0] / self.weights.noise
        told = np.where(there, told, 0.0)
        drift = np.repeat(self.weights.drift, dq.shape[1])
        ends = difference(fit.marionette, predicted.q_D, seen.q_D), seen.v_D - predicted.v_D
        end = np.concatenate(ends, axis=1) / drift
        wrong = np.bincount(segments, np.sum((came - told) ** 2, axis=1), S)
        size = np.bincount(segments, np.sum(came**2, axis=1), S)
        wrong += np.sum((end - (jacobians.end @ move[..., None])[..., 0] / drift) ** 2, axis=1)
        size += np.sum(end**2, axis=1)
        return np.asarray(wrong > np.maximum(_TOLD**2 * size, _STILL))

    def other(self, at: Point, to: Point) -> MaskRows:
        """(S,) bool, segments that other samples lie in, or other rows hold the first states of."""
        found = np.any(at.held != to.held, axis=1)
        before, after = self.fit.segments(at.theta), self.fit.segments(to.theta)
        crossed = before != after
        found[before[crossed]] = found[after[crossed]] = True
        return np.asarray(found)

    def normal(
        self, at: Point, predicted: Predicted, jacobians: Jacobians, only: MaskRows | None = None
    ) -> Normal:
        """The normal equations at a point; samples of ``only`` some segments (S,) count."""
        fit, weights = self.fit, self.weights
        S, m, P = len(at.q_D), jacobians.end.shape[1], len(fit.layout)
        r, there = self.residuals(at, predicted)
        less = 1.0 + (r / FAR) ** 2 if weights.final else np.maximum(1.0, np.abs(r) / OUTLIER)
        share = np.sqrt(np.where(there, 1.0, 0.0) / less)
        left, share = r * share, share / weights.noise
        whole = np.zeros((S, m + P, m + P))
        slope = np.zeros((S, m + P))
        order = np.argsort(fit.segments(at.theta), kind="stable")
        ends = np.searchsorted(fit.segments(at.theta)[order], np.arange(S + 1))
        for s in range(S) if only is None else np.flatnonzero(only):
            own = order[ends[s] : ends[s + 1]]
            mine = (jacobians.samples[own] * share[own, :, None]).reshape(-1, m + P)
            whole[s], slope[s] = mine.T @ mine, mine.T @ left[own].ravel()
        begin, n = jacobians.begin, m // 2
        scale = np.repeat([1.0 / weights.drift[0], 1.0 / weights.drift[1]], n)
        gaps = self.gaps(at, predicted)
        far = np.abs(gaps) / OUTLIER
        loose = scale / np.sqrt(np.maximum(1.0, far) if weights.joined else 1.0 + far**2)
        if self.trusted is not None:
            loose *= self.trusted[:-1, None]
        gaps = gaps * (loose / scale)
        before = -jacobians.end[:-1] * loose[..., None]
        before[..., m:] += begin[1:, :, m:] * loose[..., None]
        after = begin[1:, :, :m] * loose[..., None]
        whole[:-1] += before.swapaxes(1, 2) @ before
        slope[:-1] += np.einsum("smk,sm->sk", before, gaps)
        H, g = whole[:, :m, :m].copy(), slope[:, :m].copy()
        border = whole[:, :m, m:].copy()
        H[1:] += after.swapaxes(1, 2) @ after
        g[1:] += np.einsum("smk,sm->sk", after, gaps)
        border[1:] += after.swapaxes(1, 2) @ before[..., m:]
        guess = begin[0] / np.repeat(FIRST_STATE, n)[:, None]
        known = self._known(at)
        H[0] += guess[:, :m].T @ guess[:, :m]
        border[0] += guess[:, :m].T @ guess[:, m:]
        g[0] += guess[:, :m].T @ known
        # Moves that the strings forbid have no effect; something must keep them small.
        H += _FORBIDDEN * np.diag(scale**2)
        T = whole[:, m:, m:].sum(axis=0) + np.diag(1.0 / fit.prior**2)
        T += guess[:, m:].T @ guess[:, m:]
        h = slope[:, m:].sum(axis=0) + (at.theta - fit.begin) / fit.prior**2
        h += guess[:, m:].T @ known
        chain = before[..., :m].swapaxes(1, 2) @ after
        return Normal(H, chain, border, T, g, h)


def _huber(r: Array) -> Array:
    """Half the square up to OUTLIER, and straight on from there."""
    size = np.abs(r)
    return np.where(size <= OUTLIER, 0.5 * r * r, OUTLIER * (size - 0.5 * OUTLIER))


def _cauchy(r: Array, scale: float) -> Array:
    """Half the square of what is small, and ever less of what is large."""
    return np.asarray(0.5 * scale**2 * np.log1p((r / scale) ** 2))
