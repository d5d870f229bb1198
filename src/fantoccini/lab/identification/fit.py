"""The fit of a record: its predictions and their derivatives.

A record is measurements of a puppet in motion, cut into segments that are simulated from their own
first states. q_D and v_D are dynamic coordinates and velocities, q_K and v_K driven ones; theta are
the unknown numbers. A row is a string or a joint limit with its gap h <= 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import difference, integrate
from fantoccini.lab.identification.channels import Channels
from fantoccini.lab.identification.rollouts import DrivenSteps, Rollouts, differentiate, roll_out
from fantoccini.lab.identification.row_projection import RowProjection
from fantoccini.lab.identification.search_point import Jacobians, Layout, Point, Prediction
from fantoccini.motion import Input, State

MARGIN = 0.2513
"""Time simulated beyond both ends of the record, where a delay may move samples [s]. It is not a
round number, so that samples do not fall on nodes, where predictions have kinks."""
DELAY_RANGE = 0.25
"""Largest change of an unknown delay from its initial value [s]."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A record and a model of it.

    Attributes:
        marionette: the puppet; its p has the values of known parameters.
        inputs: the commanded motion of all driven coordinates.
        channels: the measured channels.
        t: (N,) times of the samples, by the record's clock [s].
        y: (N, n_c) samples; NaN in gaps.
        layout: order of the unknowns.
        theta_0: (P,) initial value of theta.
        delay: delay of the record's clock, if it is known [s].
        prior_std: (P,) standard deviations of theta about ``theta_0`` that are known beforehand.
        segment: duration of a segment [s].
        dt: step of the time-stepper [s].
        threads: number of threads.
        record_span: first and last time by the inputs' clock, with the initial delay [s].
        channels_depend: whether a channel depends on an unknown parameter at a
            fixed configuration.
        driven_steps: cache: step length -> commanded motion of the driven coordinates.
    """

    marionette: Marionette
    inputs: Input
    channels: Channels
    t: Array
    y: Array
    layout: Layout
    theta_0: Array
    delay: float
    prior_std: Array
    segment: float
    dt: float
    threads: int
    record_span: tuple[float, float]
    channels_depend: bool
    driven_steps: dict[float, DrivenSteps] = field(default_factory=dict)

    @property
    def n_steps(self) -> int:
        """Number of steps in a segment."""
        return max(1, round(self.segment / self.dt))

    @property
    def starts(self) -> Array:
        """(S,) start times of the segments, by the inputs' clock [s]."""
        span = self.segment
        begin = self.record_span[0] - MARGIN
        n = int(np.ceil((self.record_span[1] + MARGIN - begin) / span))
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
        """(n_vK,) offsets of the driven coordinates."""
        offsets, n = np.zeros(self.marionette.coordinates.n_vK), len(self.layout.parameters)
        offsets[list(self.layout.offsets)] = theta[n : self.layout.n_motion]
        return offsets

    def marker_positions(self, theta: Array) -> Array:
        """(n_markers, 3) positions of the markers in their bodies' frames."""
        positions = np.array([marker.at for marker in self.channels.markers], dtype=float).reshape(
            -1, 3
        )
        n = self.layout.n_motion
        estimated = theta[n : n + 3 * len(self.layout.marker_indices)].reshape(-1, 3)
        positions[list(self.layout.marker_indices)] = estimated
        return positions

    def sample_positions(self, theta: Array, dt: float) -> tuple[Indices, Indices, Array]:
        """(N,) step and segment of every sample, and its position within the step, 0 to 1."""
        starts, n = self.starts, round(self.segment / dt)
        position = (self.t - self.delay_of(theta) - starts[0]) / dt
        position = np.clip(position, 0.0, len(starts) * n - 1e-9)
        step = np.floor(position).astype(int)
        return step % n, step // n, position - step

    def driven(self, theta: Array, dt: float) -> DrivenSteps:
        """Motion of the driven coordinates in steps of dt [s]."""
        if dt not in self.driven_steps:
            n = round(self.segment / dt)
            self.driven_steps[dt] = DrivenSteps.from_inputs(
                self.marionette, self.inputs, self.starts, n, dt
            )
        return self.driven_steps[dt].with_offsets(self.marionette, self.offsets(theta))

    def segments(self, theta: Array) -> Indices:
        """(N,) segment of every sample."""
        return self.sample_positions(theta, self.dt)[1]

    def predict(
        self,
        point: Point,
        *,
        extrapolated: bool = False,
        selected: MaskRows | None = None,
        unselected: Prediction | None = None,
    ) -> Prediction:
        """Predictions of a point.

        Args:
            point: the point.
            extrapolated: extrapolate from steps of dt/2 and dt/4 to a step length of 0
                (Richardson).
            selected: (S,) bool, segments that are simulated; all by default.
            unselected: predictions of the other segments.
        """
        if not extrapolated:
            return self._predict(point, self.dt, selected, unselected)
        coarse, fine = (
            self._predict(point, factor * self.dt, selected, unselected) for factor in (0.5, 0.25)
        )
        if not (coarse.arrived and fine.arrived):
            return replace(fine, arrived=False)
        segments = slice(None) if selected is None else selected
        samples = segments if selected is None else selected[self.segments(point.theta)]
        y, q_D, v_D = fine.y.copy(), fine.q_D.copy(), fine.v_D.copy()
        n = self.channels.n_kinematic
        y[samples, :n] = 2.0 * fine.y[samples, :n] - coarse.y[samples, :n]
        change = difference(self.marionette, coarse.q_D[segments], fine.q_D[segments])
        q_D[segments] = integrate(self.marionette, fine.q_D[segments], change)
        v_D[segments] = 2.0 * fine.v_D[segments] - coarse.v_D[segments]
        return Prediction(y, q_D, v_D, True)

    def _predict(
        self, point: Point, dt: float, selected: MaskRows | None, unselected: Prediction | None
    ) -> Prediction:
        indices = _segment_indices(len(point.q_D), selected)
        driven_steps, rollouts = self._rollouts(point, dt, indices)
        if not rollouts.arrived:
            return Prediction(np.full(self.y.shape, np.nan), point.q_D, point.v_D, False)
        steps, segments, fraction, samples = self._samples_in(point.theta, dt, indices)
        p, positions = self.p(point.theta), self.marker_positions(point.theta)
        q_D, q_K, _, _ = self._at_samples(driven_steps, rollouts, steps, segments, fraction)
        y = self.channels.evaluate(q_D, q_K, p, positions)
        tension = rollouts.tension[steps, segments][:, self.channels.rows]
        y = np.concatenate([y, tension], axis=1)
        if unselected is None:
            return Prediction(y, rollouts.q_D[-1], rollouts.v_D[-1], True)
        prediction = Prediction(
            unselected.y.copy(), unselected.q_D.copy(), unselected.v_D.copy(), True
        )
        prediction.y[samples] = y
        prediction.q_D[indices], prediction.v_D[indices] = rollouts.q_D[-1], rollouts.v_D[-1]
        return prediction

    def _at_samples(
        self,
        driven_steps: DrivenSteps,
        rollouts: Rollouts,
        steps: Indices,
        segments: Indices,
        fraction: Array,
    ) -> tuple[Array, Array, Array, Array]:
        """(N, ...) q_D and q_K at the samples, and the changes over their steps."""
        q_D, q_K = rollouts.q_D[steps, segments], driven_steps.q_K[steps, segments]
        move_D = difference(self.marionette, q_D, rollouts.q_D[steps + 1, segments])
        move_K = difference(
            self.marionette, q_K, driven_steps.q_K[steps + 1, segments], driven=True
        )
        at_D = integrate(self.marionette, q_D, fraction[:, None] * move_D)
        at_K = integrate(self.marionette, q_K, fraction[:, None] * move_K, driven=True)
        return at_D, at_K, move_D, move_K

    def _rollouts(self, point: Point, dt: float, indices: Indices) -> tuple[DrivenSteps, Rollouts]:
        """The rollouts of chosen segments."""
        driven_steps = self.driven(point.theta, dt)
        if len(indices) < len(point.q_D):
            driven_steps = driven_steps.subset(indices)
        q_D, v_D = point.q_D[indices], point.v_D[indices]
        return driven_steps, roll_out(
            self.marionette, driven_steps, q_D, v_D, self.p(point.theta), self.threads
        )

    def _samples_in(
        self, theta: Array, dt: float, indices: Indices
    ) -> tuple[Indices, Indices, Array, Indices]:
        """Samples in chosen segments.

        Returns:
            Step, index of the segment in ``indices``, position within the step, index of the
            sample.
        """
        steps, segments, fraction = self.sample_positions(theta, dt)
        index = np.full(len(self.starts), -1)
        index[indices] = np.arange(len(indices))
        samples = np.flatnonzero(index[segments] >= 0)
        return steps[samples], index[segments[samples]], fraction[samples], samples

    def jacobians(
        self, point: Point, *, selected: MaskRows | None = None, unselected: Jacobians | None = None
    ) -> Jacobians:
        """Derivatives of a point's predictions, in steps of dt, or of dt/4 if those fail.

        Args:
            point: the point.
            selected: (S,) bool, segments whose derivatives are computed; all by default.
            unselected: derivatives of the other segments; the new ones are written into it.

        Raises:
            StateError: a segment cannot be simulated.
        """
        layout, channels, marionette, dt = self.layout, self.channels, self.marionette, self.dt
        indices = _segment_indices(len(point.q_D), selected)
        driven_steps, rollouts = self._rollouts(point, dt, indices)
        if not rollouts.arrived:
            dt *= 0.25
            driven_steps, rollouts = self._rollouts(point, dt, indices)
        if not rollouts.arrived:
            raise StateError(
                f"a segment of the record cannot be simulated in steps of {dt:g} s; "
                "use a smaller dt"
            )
        steps, segments, fraction, samples = self._samples_in(point.theta, dt, indices)
        p = self.p(point.theta)
        start_derivatives = self.row_projection(point.theta, indices).state_derivatives(
            point.q_D[indices],
            point.v_D[indices],
            point.active_rows[indices],
            list(layout.parameters),
            list(layout.offsets),
        )
        derivatives = differentiate(
            marionette,
            driven_steps,
            rollouts,
            p,
            layout.parameters,
            layout.offsets,
            start_derivatives,
            (steps, segments, fraction),
            pull=bool(channels.rows),
            threads=self.threads,
        )
        m, n_kinematic = 2 * marionette.coordinates.n_vD, channels.n_kinematic
        first_offset, n_motion = m + len(layout.parameters), m + layout.n_motion
        q_D, q_K, move_D, move_K = self._at_samples(
            driven_steps, rollouts, steps, segments, fraction
        )
        values = channels.derivatives(
            q_D, q_K, p, self.marker_positions(point.theta), self.channels_depend
        )
        J = np.zeros((len(samples), len(channels), m + len(layout)))
        np.matmul(values.J_D, derivatives.at_samples, out=J[:, :n_kinematic, :n_motion])
        J[:, :n_kinematic, first_offset:n_motion] += values.J_K[..., list(layout.offsets)]
        if values.J_p is not None:
            J[:, :n_kinematic, m:first_offset] += values.J_p[..., list(layout.parameters)]
        for j, marker in enumerate(layout.marker_indices):
            columns = slice(n_motion + 3 * j, n_motion + 3 * j + 3)
            J[:, 3 * marker : 3 * marker + 3, columns] = values.frames[:, marker]
        if layout.delay:
            rate = values.J_D @ move_D[..., None] + values.J_K @ move_K[..., None]
            J[:, :n_kinematic, -1] = -rate[..., 0] / dt
        if derivatives.tension is not None:
            J[:, n_kinematic:, :n_motion] = derivatives.tension[:, channels.rows]
        ends = np.zeros((2, len(indices), m, m + len(layout)))
        ends[0, ..., :n_motion], ends[1, ..., :n_motion] = start_derivatives, derivatives.end
        if unselected is None:
            return Jacobians(J, *ends)
        unselected.samples[samples], unselected.begin[indices], unselected.end[indices] = J, *ends
        return unselected

    def row_projection(self, theta: Array, indices: Indices | None = None) -> RowProjection:
        """The projection onto strings and limits at the start of all or of chosen segments."""
        starts = self.starts if indices is None else self.starts[indices]
        q_K, v_K, _ = self.inputs.evaluate(starts)
        for q, v in self.marionette.coordinates.scalars_K:
            q_K[:, q] += self.offsets(theta)[v]
        return RowProjection(self.marionette, q_K, v_K, self.p(theta))

    def projected_point(
        self,
        q_D: Array,
        v_D: Array,
        theta: Array,
        active_rows: MaskRows,
        selected: MaskRows | None = None,
    ) -> Point:
        """The point with states projected onto the rows of strings and limits.

        Active rows without a force are released. With ``selected`` (S,), other segments are
        unchanged.
        """
        indices = _segment_indices(len(q_D), selected)
        projection = self.row_projection(theta, indices)
        q, v = projection.project(q_D[indices], v_D[indices], active_rows[indices])
        is_closed = projection.closed_rows(q, v)
        first_step = self.driven(theta, self.dt).first_step.subset(indices)
        first_rollout = roll_out(self.marionette, first_step, q, v, self.p(theta))
        has_force = (first_rollout.tension[0] > 0.0) | self.marionette.two_sided
        q_D, v_D, active_rows = q_D.copy(), v_D.copy(), active_rows.copy()
        q_D[indices], v_D[indices], active_rows[indices] = q, v, is_closed & has_force
        return Point(q_D, v_D, theta, active_rows)

    def released_point(self, point: Point, prediction: Prediction) -> Point:
        """The same point, with rows released that are slack at the end of the previous segment."""
        if not prediction.arrived:
            return point
        q_D = np.concatenate([point.q_D[:1], prediction.q_D[:-1]])
        slack = self.row_projection(point.theta).slack_rows(q_D, point.v_D)
        slack[0] = False
        return replace(point, active_rows=point.active_rows & ~slack)

    def moved_point(
        self, point: Point, move: Array, theta_move: Array, selected: MaskRows | None = None
    ) -> Point:
        """A point moved by vectors (S, 2 n_vD), in ``selected``, and by ``theta_move`` (P,)."""
        n = move.shape[1] // 2
        q_D = integrate(self.marionette, point.q_D, move[:, :n])
        moved_theta = point.theta + theta_move
        if self.layout.delay:
            low, high = self.theta_0[-1] - DELAY_RANGE, self.theta_0[-1] + DELAY_RANGE
            moved_theta[-1] = np.clip(moved_theta[-1], low, high)
        return self.projected_point(
            q_D, point.v_D + move[:, n:], moved_theta, point.active_rows, selected
        )


def _segment_indices(S: int, selected: MaskRows | None) -> Indices:
    return np.arange(S) if selected is None else np.flatnonzero(selected)


def continuous_point(fit: Fit, start: State) -> Point:
    """Point without jumps between segments: one simulation from a state with ``fit.theta_0``."""
    theta = fit.theta_0
    driven_steps = fit.driven(theta, fit.dt)
    q_D, v_D = [start.q_D], [start.v_D]
    for s in range(len(fit.starts) - 1):
        segment = driven_steps.subset(slice(s, s + 1))
        rollouts = roll_out(fit.marionette, segment, q_D[-1][None], v_D[-1][None], fit.p(theta))
        if not rollouts.arrived:
            raise StateError(
                f"with the initial values of the unknowns, the puppet cannot follow the inputs: "
                f"it stops between {fit.starts[s]:.4g} s and {fit.starts[s] + fit.segment:.4g} s. "
                "Give better initial values"
            )
        q_D.append(rollouts.q_D[-1, 0])
        v_D.append(rollouts.v_D[-1, 0])
    q, v = np.array(q_D), np.array(v_D)
    return fit.projected_point(q, v, theta, fit.row_projection(theta).nearly_closed_rows(q, v))
