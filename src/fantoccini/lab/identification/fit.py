"""The fit of a record: its predictions and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import difference, integrate
from fantoccini.lab.identification.channels import Channels
from fantoccini.lab.identification.holding import Holding
from fantoccini.lab.identification.point import Jacobians, Layout, Point, Predicted
from fantoccini.lab.identification.rolling import Driven, Rolled, roll, sense
from fantoccini.motion import Input, State

MARGIN = 0.2513
"""Time simulated beyond both ends of the record, into which a delay may move samples [s]. No round
number, so that samples do not fall on nodes, where predictions have kinks."""
REACH = 0.25
"""How far a delay may go from where its search begins [s]."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A record and a model of it.

    Attributes:
        marionette: the puppet; its p has the values of what is not looked for.
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
    """

    marionette: Marionette
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

    def delay_of(self, theta: Array) -> float:
        """Delay of the record [s]."""
        return float(theta[-1]) if self.layout.delay else self.delay

    def p(self, theta: Array) -> Array:
        """(n_p,) parameters."""
        p = self.marionette.p.copy()
        p[list(self.layout.parameters)] = theta[: len(self.layout.parameters)]
        return p

    def offsets(self, theta: Array) -> Array:
        """(n_vK,) of the driven coordinates."""
        out, n = np.zeros(self.marionette.coordinates.n_vK), len(self.layout.parameters)
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
        at = (self.t - self.delay_of(theta) - starts[0]) / dt
        at = np.clip(at, 0.0, len(starts) * n - 1e-9)
        whole = np.floor(at).astype(int)
        return whole % n, whole // n, at - whole

    def driven(self, theta: Array, dt: float) -> Driven:
        """The driven coordinates in steps of dt [s]."""
        if dt not in self.drives:
            n = round(self.segment / dt)
            self.drives[dt] = Driven.of(self.marionette, self.inputs, self.starts, n, dt)
        return self.drives[dt].moved(self.marionette, self.offsets(theta))

    def segments(self, theta: Array) -> Indices:
        """(N,) segment in which a sample lies."""
        return self.located(theta, self.dt)[1]

    def predict(
        self,
        at: Point,
        *,
        extrapolated: bool = False,
        only: MaskRows | None = None,
        kept: Predicted | None = None,
    ) -> Predicted:
        """What a point predicts.

        Args:
            at: the point.
            extrapolated: from steps of dt/2 and dt/4 to steps of no length (Richardson).
            only: (S,) bool, segments that are simulated; all when not given.
            kept: what the others predict.
        """
        if not extrapolated:
            return self._predict(at, self.dt, only, kept)
        coarse, fine = (self._predict(at, part * self.dt, only, kept) for part in (0.5, 0.25))
        if not (coarse.arrived and fine.arrived):
            return replace(fine, arrived=False)
        own = slice(None) if only is None else only
        mine = own if only is None else only[self.segments(at.theta)]
        y, q_D, v_D = fine.y.copy(), fine.q_D.copy(), fine.v_D.copy()
        n = self.channels.n_places
        y[mine, :n] = 2.0 * fine.y[mine, :n] - coarse.y[mine, :n]
        move = difference(self.marionette, coarse.q_D[own], fine.q_D[own])
        q_D[own] = integrate(self.marionette, fine.q_D[own], move)
        v_D[own] = 2.0 * fine.v_D[own] - coarse.v_D[own]
        return Predicted(y, q_D, v_D, True)

    def _predict(
        self, at: Point, dt: float, only: MaskRows | None, kept: Predicted | None
    ) -> Predicted:
        chosen = _chosen(len(at.q_D), only)
        driven, rolled = self._rolled(at, dt, chosen)
        if not rolled.arrived:
            return Predicted(np.full(self.y.shape, np.nan), at.q_D, at.v_D, False)
        steps, own, share, mine = self._within(at.theta, dt, chosen)
        p, places = self.p(at.theta), self.places(at.theta)
        q_D, q_K, _, _ = self._between(driven, rolled, steps, own, share)
        y = self.channels.look(q_D, q_K, p, places)
        pull = rolled.tension[steps, own][:, self.channels.rows]
        y = np.concatenate([y, pull], axis=1)
        if kept is None:
            return Predicted(y, rolled.q_D[-1], rolled.v_D[-1], True)
        out = Predicted(kept.y.copy(), kept.q_D.copy(), kept.v_D.copy(), True)
        out.y[mine], out.q_D[chosen], out.v_D[chosen] = y, rolled.q_D[-1], rolled.v_D[-1]
        return out

    def _between(
        self, driven: Driven, rolled: Rolled, steps: Indices, segments: Indices, share: Array
    ) -> tuple[Array, Array, Array, Array]:
        """(N, ...) q_D and q_K of samples, and the moves over their steps."""
        q_D, q_K = rolled.q_D[steps, segments], driven.q_K[steps, segments]
        move_D = difference(self.marionette, q_D, rolled.q_D[steps + 1, segments])
        move_K = difference(self.marionette, q_K, driven.q_K[steps + 1, segments], driven=True)
        at_D = integrate(self.marionette, q_D, share[:, None] * move_D)
        at_K = integrate(self.marionette, q_K, share[:, None] * move_K, driven=True)
        return at_D, at_K, move_D, move_K

    def _rolled(self, at: Point, dt: float, chosen: Indices) -> tuple[Driven, Rolled]:
        """The rollouts of chosen segments."""
        driven = self.driven(at.theta, dt)
        if len(chosen) < len(at.q_D):
            driven = driven.some(chosen)
        q_D, v_D = at.q_D[chosen], at.v_D[chosen]
        return driven, roll(self.marionette, driven, q_D, v_D, self.p(at.theta), self.threads)

    def _within(
        self, theta: Array, dt: float, chosen: Indices
    ) -> tuple[Indices, Indices, Array, Indices]:
        """Samples in chosen segments.

        Returns:
            Their steps, their segments' places in ``chosen``, parts of the steps, and which.
        """
        steps, segments, share = self.located(theta, dt)
        place = np.full(len(self.starts), -1)
        place[chosen] = np.arange(len(chosen))
        mine = np.flatnonzero(place[segments] >= 0)
        return steps[mine], place[segments[mine]], share[mine], mine

    def jacobians(
        self, at: Point, *, only: MaskRows | None = None, kept: Jacobians | None = None
    ) -> Jacobians:
        """Derivatives of what a point predicts, in steps of dt, or of dt/4 where those fail.

        Args:
            at: the point.
            only: (S,) bool, segments whose derivatives are found; all when not given.
            kept: those of the others; written over.

        Raises:
            StateError: a segment cannot be simulated.
        """
        lay, channels, marionette, dt = self.layout, self.channels, self.marionette, self.dt
        chosen = _chosen(len(at.q_D), only)
        driven, rolled = self._rolled(at, dt, chosen)
        if not rolled.arrived:
            dt *= 0.25
            driven, rolled = self._rolled(at, dt, chosen)
        if not rolled.arrived:
            raise StateError(
                f"a segment of the record cannot be simulated in steps of {dt:g} s; "
                "take a smaller dt"
            )
        steps, own, share, mine = self._within(at.theta, dt, chosen)
        p = self.p(at.theta)
        begin = self.holding(at.theta, chosen).moves(
            at.q_D[chosen], at.v_D[chosen], at.held[chosen], list(lay.parameters), list(lay.offsets)
        )
        found = sense(
            marionette,
            driven,
            rolled,
            p,
            lay.parameters,
            lay.offsets,
            begin,
            (steps, own, share),
            pull=bool(channels.rows),
            threads=self.threads,
        )
        m, n_places = 2 * marionette.coordinates.n_vD, channels.n_places
        first, n_rolled = m + len(lay.parameters), m + lay.n_rolled
        q_D, q_K, move_D, move_K = self._between(driven, rolled, steps, own, share)
        look = channels.look_by(q_D, q_K, p, self.places(at.theta), self.moves_channels)
        J = np.zeros((len(mine), len(channels), m + len(lay)))
        np.matmul(look.by_D, found.between, out=J[:, :n_places, :n_rolled])
        J[:, :n_places, first:n_rolled] += look.by_K[..., list(lay.offsets)]
        if look.by_p is not None:
            J[:, :n_places, m:first] += look.by_p[..., list(lay.parameters)]
        for j, marker in enumerate(lay.places):
            places = slice(n_rolled + 3 * j, n_rolled + 3 * j + 3)
            J[:, 3 * marker : 3 * marker + 3, places] = look.frames[:, marker]
        if lay.delay:
            rate = look.by_D @ move_D[..., None] + look.by_K @ move_K[..., None]
            J[:, :n_places, -1] = -rate[..., 0] / dt
        if found.pull is not None:
            J[:, n_places:, :n_rolled] = found.pull[:, channels.rows]
        ends = np.zeros((2, len(chosen), m, m + len(lay)))
        ends[0, ..., :n_rolled], ends[1, ..., :n_rolled] = begin, found.end
        if kept is None:
            return Jacobians(J, *ends)
        kept.samples[mine], kept.begin[chosen], kept.end[chosen] = J, *ends
        return kept

    def holding(self, theta: Array, chosen: Indices | None = None) -> Holding:
        """The strings and limits at the beginnings of the segments, or of chosen ones."""
        starts = self.starts if chosen is None else self.starts[chosen]
        q_K, v_K, _ = self.inputs.evaluate(starts)
        for q, v in self.marionette.coordinates.scalars_K:
            q_K[:, q] += self.offsets(theta)[v]
        return Holding(self.marionette, q_K, v_K, self.p(theta))

    def placed(
        self, q_D: Array, v_D: Array, theta: Array, held: MaskRows, only: MaskRows | None = None
    ) -> Point:
        """The point nearest to some states that strings and limits allow.

        Rows that hold there without a force are let go. With ``only`` (S,), the others stay.
        """
        chosen = _chosen(len(q_D), only)
        holding = self.holding(theta, chosen)
        q, v = holding.project(q_D[chosen], v_D[chosen], held[chosen])
        closed = holding.closed(q, v)
        step = self.driven(theta, self.dt).first.some(chosen)
        first = roll(self.marionette, step, q, v, self.p(theta))
        pulls = (first.tension[0] > 0.0) | self.marionette.two_sided
        q_D, v_D, held = q_D.copy(), v_D.copy(), held.copy()
        q_D[chosen], v_D[chosen], held[chosen] = q, v, closed & pulls
        return Point(q_D, v_D, theta, held)

    def freed(self, at: Point, predicted: Predicted) -> Point:
        """The same point, where no row holds a first state that the segment before leaves slack."""
        if not predicted.arrived:
            return at
        q_D = np.concatenate([at.q_D[:1], predicted.q_D[:-1]])
        slack = self.holding(at.theta).slack(q_D, at.v_D)
        slack[0] = False
        return replace(at, held=at.held & ~slack)

    def moved(self, at: Point, by: Array, theta: Array, only: MaskRows | None = None) -> Point:
        """A point moved by tangent vectors (S, 2 n_vD) and by (P,); states of ``only`` some."""
        n = by.shape[1] // 2
        q_D = integrate(self.marionette, at.q_D, by[:, :n])
        to = at.theta + theta
        if self.layout.delay:
            to[-1] = np.clip(to[-1], self.begin[-1] - REACH, self.begin[-1] + REACH)
        return self.placed(q_D, at.v_D + by[:, n:], to, at.held, only)


def _chosen(S: int, only: MaskRows | None) -> Indices:
    return np.arange(S) if only is None else np.flatnonzero(only)


def chained(fit: Fit, start: State) -> Point:
    """The point whose segments follow one another from a state, at the unknowns' first values."""
    theta = fit.begin
    driven = fit.driven(theta, fit.dt)
    q_D, v_D = [start.q_D], [start.v_D]
    for s in range(len(fit.starts) - 1):
        own = driven.some(slice(s, s + 1))
        rolled = roll(fit.marionette, own, q_D[-1][None], v_D[-1][None], fit.p(theta))
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
