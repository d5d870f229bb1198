"""The fit of a record: its predictions, their derivatives, and its cost."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.arrays import Array, Indices, MaskRows
from fantoccini.errors import StateError
from fantoccini.identification.blocks import Normal
from fantoccini.identification.channels import Channels
from fantoccini.identification.holding import Holding
from fantoccini.identification.point import Layout, Point, Predicted, Weights
from fantoccini.identification.rolling import Driven, Rolled, roll, sense
from fantoccini.marionette import Model
from fantoccini.marionette.configurations import difference, integrate
from fantoccini.motion import Input, State

MARGIN = 0.2513
"""Time simulated beyond both ends of the record, into which a delay may move samples [s]. No round
number, so that samples do not fall on nodes, where predictions have kinks."""
REACH = 0.25
"""How far a delay may go from where its search begins [s]."""
OUTLIER = 3.0
"""Residual, over its noise level, from which on it counts by its size instead of its square."""
FAR = 6.0
"""Scale of Cauchy's measure of samples, over their noise level."""
_UNUSUAL = 5.0
"""Standard deviations of a segment's mean square from which on it is not explained."""
_FORBIDDEN = 1e-8
"""Weight of moves that strings forbid, relative to that of the drift."""
FIRST_STATE = (0.5, 5.0)
"""Spread of the first state about its guess [rad or m, rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A record and a model of it.

    Attributes:
        model: the puppet; its p has the values of what is not looked for.
        inputs: the motion that was commanded, of all driven coordinates.
        channels: what was measured.
        t: (N,) times of the samples, by the record's clock [s].
        y: (N, n_c) samples; NaN where there is none.
        layout: of the unknowns.
        begin: first value of theta; what is not looked for keeps it.
        delay: of the record's clock where it is not looked for [s].
        prior: (P,) standard deviations of theta about ``begin`` that are known beforehand.
        segment: duration of a segment [s].
        dt: step of the time-stepper [s].
        threads: that share the work.
        ends: first and last time of the record by the inputs' clock, with the delay at first [s].
        drives: the driven coordinates by the length of steps, as commanded.
        moves_channels: whether an unknown parameter moves a channel of a configuration.
        trusted: (S,) bool, the segments whose samples count; all when not given.
    """

    model: Model
    inputs: Input
    channels: Channels
    t: Array
    y: Array
    layout: Layout
    begin: Array
    delay: float
    prior: Array
    segment: float
    dt: float
    threads: int
    ends: tuple[float, float]
    moves_channels: bool
    drives: dict[float, Driven] = field(default_factory=dict)
    trusted: MaskRows | None = None

    @property
    def steps(self) -> int:
        """Of a segment."""
        return max(1, round(self.segment / self.dt))

    @property
    def starts(self) -> Array:
        """(S,) first times of the segments, by the inputs' clock [s]."""
        span = self.segment
        begin = self.ends[0] - MARGIN
        n = int(np.ceil((self.ends[1] + MARGIN - begin) / span))
        return np.asarray(begin + span * np.arange(n))

    def _delay(self, theta: Array) -> float:
        return float(theta[-1]) if self.layout.delay else self.delay

    def p(self, theta: Array) -> Array:
        """(n_p,) parameters."""
        p = self.model.p.copy()
        p[list(self.layout.parameters)] = theta[: len(self.layout.parameters)]
        return p

    def offsets(self, theta: Array) -> Array:
        """(n_vK,) of the driven coordinates."""
        out, n = np.zeros(self.model.coordinates.n_vK), len(self.layout.parameters)
        out[list(self.layout.offsets)] = theta[n : self.layout.n_rolled]
        return out

    def places(self, theta: Array) -> Array:
        """(n_markers, 3) places of the markers on their bodies."""
        out = np.array([one.at for one in self.channels.markers], dtype=float).reshape(-1, 3)
        n = self.layout.n_rolled
        found = theta[n : n + 3 * len(self.layout.places)].reshape(-1, 3)
        out[list(self.layout.places)] = found
        return out

    def located(self, theta: Array, dt: float) -> tuple[Indices, Indices, Array]:
        """(N,) step and segment in which a sample lies, and the part of the step before it."""
        starts, n = self.starts, round(self.segment / dt)
        at = (self.t - self._delay(theta) - starts[0]) / dt
        at = np.clip(at, 0.0, len(starts) * n - 1e-9)
        whole = np.floor(at).astype(int)
        return whole % n, whole // n, at - whole

    def driven(self, theta: Array, dt: float) -> Driven:
        """The driven coordinates in steps of dt [s]."""
        if dt not in self.drives:
            n = round(self.segment / dt)
            self.drives[dt] = Driven.of(self.model, self.inputs, self.starts, n, dt)
        return self.drives[dt].moved(self.model, self.offsets(theta))

    def rolled(self, at: Point, driven: Driven) -> Rolled:
        """The rollouts of a point."""
        return roll(self.model, driven, at.q_D, at.v_D, self.p(at.theta), self.threads)

    def predict(self, at: Point, *, extrapolated: bool = False) -> Predicted:
        """What a point predicts.

        Args:
            at: the point.
            extrapolated: from steps of dt/2 and dt/4 to steps of no length (Richardson).
        """
        if not extrapolated:
            return self._predict(at, self.dt)
        coarse, fine = self._predict(at, 0.5 * self.dt), self._predict(at, 0.25 * self.dt)
        if not (coarse.arrived and fine.arrived):
            return fine
        y = 2.0 * fine.y - coarse.y
        y[:, self.channels.n_places :] = fine.y[:, self.channels.n_places :]
        q_D = integrate(self.model, fine.q_D, difference(self.model, coarse.q_D, fine.q_D))
        return Predicted(y, q_D, 2.0 * fine.v_D - coarse.v_D, True)

    def _predict(self, at: Point, dt: float) -> Predicted:
        driven = self.driven(at.theta, dt)
        rolled = self.rolled(at, driven)
        steps, segments, share = self.located(at.theta, dt)
        p, places = self.p(at.theta), self.places(at.theta)
        if not rolled.arrived:
            return Predicted(np.full(self.y.shape, np.nan), at.q_D, at.v_D, False)
        sides = [
            self.channels.look(
                rolled.q_D[steps + i, segments], driven.q_K[steps + i, segments], p, places
            )
            for i in (0, 1)
        ]
        y = (1.0 - share[:, None]) * sides[0] + share[:, None] * sides[1]
        pull = rolled.tension[steps, segments][:, self.channels.rows]
        return Predicted(
            np.concatenate([y, pull], axis=1), rolled.q_D[-1], rolled.v_D[-1], rolled.arrived
        )

    def jacobian(self, at: Point) -> tuple[Predicted, Array, Array]:
        """What a point predicts, and its derivatives by (dq_D, dv_D) of the segment and theta.

        Returns:
            The prediction in steps of dt, (N, n_c, 2 n_vD + P) those of the channels, and
            (S, 2 n_vD, 2 n_vD + P) those of the ends of segments.
        """
        lay, channels, dt = self.layout, self.channels, self.dt
        driven = self.driven(at.theta, dt)
        rolled = self.rolled(at, driven)
        steps, segments, share = self.located(at.theta, dt)
        p, places = self.p(at.theta), self.places(at.theta)
        begin = self.holding(at.theta).moves(
            at.q_D, at.v_D, at.held, list(lay.parameters), list(lay.offsets)
        )
        found = sense(
            self.model, driven, rolled, p, lay.parameters, lay.offsets, begin, (steps, segments),
            pull=bool(channels.rows), threads=self.threads,
        )  # fmt: skip
        m = 2 * self.model.coordinates.n_vD
        first = m + len(lay.parameters)
        n_rolled = m + lay.n_rolled
        J = np.zeros((len(self.t), len(channels), m + len(lay)))
        y = np.zeros((len(self.t), len(channels)))
        sides = []
        for i, Z, part in ((0, found.before, 1.0 - share), (1, found.after, share)):
            q_D, q_K = rolled.q_D[steps + i, segments], driven.q_K[steps + i, segments]
            look = channels.look_by(q_D, q_K, p, places, self.moves_channels)
            by = look.by_D @ Z
            by[..., first:n_rolled] += look.by_K[..., list(lay.offsets)]
            if look.by_p is not None:
                by[..., m:first] += look.by_p[..., list(lay.parameters)]
            by *= part[:, None, None]
            J[:, : channels.n_places, :n_rolled] += by
            for j, marker in enumerate(lay.places):
                own = slice(n_rolled + 3 * j, n_rolled + 3 * j + 3)
                J[:, 3 * marker : 3 * marker + 3, own] += (
                    part[:, None, None] * look.frames[:, marker]
                )
            y[:, : channels.n_places] += part[:, None] * look.value
            sides.append(look.value)
        if lay.delay:
            J[:, : channels.n_places, -1] = -(sides[1] - sides[0]) / dt
        if found.pull is not None:
            y[:, channels.n_places :] = rolled.tension[steps, segments][:, channels.rows]
            J[:, channels.n_places :, :n_rolled] = found.pull[:, channels.rows]
        ends = np.zeros((2, len(self.starts), m, m + len(lay)))
        ends[0, ..., :n_rolled], ends[1, ..., :n_rolled] = begin, found.end
        return Predicted(y, rolled.q_D[-1], rolled.v_D[-1], rolled.arrived), J, ends

    def residuals(
        self, at: Point, predicted: Predicted, weights: Weights
    ) -> tuple[Array, MaskRows]:
        """(N, n_c) prediction less sample over the noise, 0 where there is no sample; and which."""
        there = np.isfinite(self.y)
        if self.trusted is not None:
            there &= self.trusted[self.located(at.theta, self.dt)[1], None]
        r = np.where(there, predicted.y - np.nan_to_num(self.y), 0.0) / weights.noise
        return r, there

    def explained(self, at: Point, predicted: Predicted, weights: Weights) -> MaskRows:
        """(S,) bool, the segments that are explained about as well as most are.

        The others are caught in an order of events that the puppet's was not.
        """
        r, there = self.residuals(at, predicted, weights)
        _, segments, _ = self.located(at.theta, self.dt)
        S = len(at.q_D)
        n = np.maximum(np.bincount(segments, np.sum(there, axis=1), S), 1.0)
        mean = np.bincount(segments, np.sum(r**2, axis=1), S) / n
        usual = np.median(mean[n > 1.0]) if np.any(n > 1.0) else 1.0
        return np.asarray(mean <= usual * (1.0 + _UNUSUAL * np.sqrt(2.0 / n)))

    def gaps(self, at: Point, predicted: Predicted, weights: Weights) -> Array:
        """(S - 1, 2 n_vD) first states less the ends before them, over the drift."""
        dq = difference(self.model, predicted.q_D[:-1], at.q_D[1:]) / weights.drift[0]
        dv = (at.v_D[1:] - predicted.v_D[:-1]) / weights.drift[1]
        return np.concatenate([dq, dv], axis=1)

    def costs(self, at: Point, first: Point, predicted: Predicted, weights: Weights) -> Array:
        """(S + 1,) the cost of every segment, and of what is known of theta.

        Half the squares of its samples (Huber's beyond OUTLIER) and of the gap before it (Cauchy's,
        since a catch that comes a step too early or late makes a gap of any size).
        """
        S = len(at.q_D)
        if not predicted.arrived:
            return np.full(S + 1, np.inf)
        r, _ = self.residuals(at, predicted, weights)
        _, segments, _ = self.located(at.theta, self.dt)
        out = np.zeros(S + 1)
        out[:S] = np.bincount(segments, np.sum(self._measure(r, weights), axis=1), S)
        gaps = self.gaps(at, predicted, weights) / OUTLIER
        out[1:S] += 0.5 * OUTLIER**2 * np.sum(np.log1p(gaps**2), axis=1)
        out[0] += 0.5 * np.sum(self._known(at, first) ** 2)
        out[S] = 0.5 * np.sum(((at.theta - self.begin) / self.prior) ** 2)
        return out

    def _measure(self, r: Array, weights: Weights) -> Array:
        """What residuals cost."""
        return 0.5 * FAR**2 * np.log1p((r / FAR) ** 2) if weights.final else _huber(np.abs(r))

    def _known(self, at: Point, first: Point) -> Array:
        """(2 n_vD,) the first state less its guess, over its spread."""
        dq = difference(self.model, first.q_D[0], at.q_D[0]) / FIRST_STATE[0]
        return np.concatenate([dq, (at.v_D[0] - first.v_D[0]) / FIRST_STATE[1]])

    def normal(
        self, at: Point, first: Point, predicted: Predicted, J: Array, ends: Array, weights: Weights
    ) -> Normal:
        """The normal equations at a point."""
        S, m, P = len(at.q_D), ends.shape[2], len(self.layout)
        r, there = self.residuals(at, predicted, weights)
        less = 1.0 + (r / FAR) ** 2 if weights.final else np.maximum(1.0, np.abs(r) / OUTLIER)
        share = np.sqrt(np.where(there, 1.0, 0.0) / less)
        rows = J * (share / weights.noise)[..., None]
        left = r * share
        whole = np.zeros((S, m + P, m + P))
        slope = np.zeros((S, m + P))
        _, segments, _ = self.located(at.theta, self.dt)
        for s in range(S):
            own = segments == s
            mine = rows[own].reshape(-1, m + P)
            whole[s], slope[s] = mine.T @ mine, mine.T @ left[own].ravel()
        begin, end = ends
        n = m // 2
        scale = np.repeat([1.0 / weights.drift[0], 1.0 / weights.drift[1]], n)
        gaps = self.gaps(at, predicted, weights)
        loose = scale / np.sqrt(1.0 + (gaps / OUTLIER) ** 2)
        gaps = gaps * (loose / scale)
        before = -end[:-1] * loose[..., None]
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
        known = self._known(at, first)
        H[0] += guess[:, :m].T @ guess[:, :m]
        border[0] += guess[:, :m].T @ guess[:, m:]
        g[0] += guess[:, :m].T @ known
        # Moves that the strings forbid have no effect; something must keep them small.
        H += _FORBIDDEN * np.diag(scale**2)
        T = whole[:, m:, m:].sum(axis=0) + np.diag(1.0 / self.prior**2)
        T += guess[:, m:].T @ guess[:, m:]
        h = slope[:, m:].sum(axis=0) + (at.theta - self.begin) / self.prior**2
        h += guess[:, m:].T @ known
        chain = before[..., :m].swapaxes(1, 2) @ after
        return Normal(H, chain, border, T, g, h)

    def holding(self, theta: Array) -> Holding:
        """The strings and limits at the beginnings of the segments."""
        q_K, v_K, _ = self.inputs.evaluate(self.starts)
        for q, v in self.model.coordinates.scalars_K:
            q_K[:, q] += self.offsets(theta)[v]
        return Holding(self.model, q_K, v_K, self.p(theta))

    def placed(self, q_D: Array, v_D: Array, theta: Array, held: MaskRows) -> Point:
        """The point nearest to some states that strings and limits allow.

        Rows that hold there without a force are let go.
        """
        holding = self.holding(theta)
        q_D, v_D = holding.project(q_D, v_D, held)
        closed = holding.closed(q_D, v_D)
        first = roll(self.model, self.driven(theta, self.dt).first, q_D, v_D, self.p(theta))
        pulls = (first.tension[0] > 0.0) | self.model.two_sided
        return Point(q_D, v_D, theta, closed & pulls)

    def freed(self, at: Point, predicted: Predicted) -> Point:
        """The same point, where no row holds a first state that the segment before leaves slack."""
        if not predicted.arrived:
            return at
        q_D = np.concatenate([at.q_D[:1], predicted.q_D[:-1]])
        slack = self.holding(at.theta).slack(q_D, at.v_D)
        slack[0] = False
        return replace(at, held=at.held & ~slack)

    def moved(self, at: Point, by: Array, theta: Array) -> Point:
        """A point moved by tangent vectors (S, 2 n_vD) and by (P,)."""
        n = by.shape[1] // 2
        q_D = integrate(self.model, at.q_D, by[:, :n])
        to = at.theta + theta
        if self.layout.delay:
            to[-1] = np.clip(to[-1], self.begin[-1] - REACH, self.begin[-1] + REACH)
        return self.placed(q_D, at.v_D + by[:, n:], to, at.held)


def _huber(r: Array) -> Array:
    """Half the square up to OUTLIER, and straight on from there."""
    return np.where(r <= OUTLIER, 0.5 * r * r, OUTLIER * (r - 0.5 * OUTLIER))


def chained(fit: Fit, start: State) -> Point:
    """The point whose segments follow one another from a state, at the unknowns' first values."""
    theta = fit.begin
    driven = fit.driven(theta, fit.dt)
    q_D, v_D = [start.q_D], [start.v_D]
    for s in range(len(fit.starts) - 1):
        own = driven.some(slice(s, s + 1))
        rolled = roll(fit.model, own, q_D[-1][None], v_D[-1][None], fit.p(theta))
        if not rolled.arrived:
            raise StateError(
                f"with the first values of what is unknown, the puppet cannot follow the inputs: "
                f"it stops between {fit.starts[s]:.4g} s and {fit.starts[s] + fit.segment:.4g} s. "
                "Begin nearer to the truth"
            )
        q_D.append(rolled.q_D[-1, 0])
        v_D.append(rolled.v_D[-1, 0])
    q, v = np.array(q_D), np.array(v_D)
    return fit.placed(q, v, theta, fit.holding(theta).near(q, v))
