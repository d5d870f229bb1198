"""Touches: points of bodies that a motion should bring to places; their terms in stage programs.

A touch takes place at a moment t, an unknown that is eliminated. The augmented Lagrangian

    L = weight/2 |r|^2 - force . r,   f = weight r - force

of the distance r at the moment of nearest approach becomes, for a step that moves the point by a
and changes its velocity v by b,

    min over dt of f . (a + v dt) + weight/2 |a + v dt|^2 - force . (b dt + acc dt^2 / 2)
                   + rho dt^2 / 2
    = f . a - f . v w . (a, b) / s + 1/2 (a, b)^T K (a, b),   K = weight (1, 0) - w w^T / s
    w = (weight v, -force),   s = weight |v|^2 - force . acc + rho

Near the place, only the component of r normal to the point's path remains. K is replaced by its
positive semi-definite part. rho = weight (|r| / share of the window)^2 keeps dt small for a point
that is far or slow, so that the moment stays in its window. At an end of the window dt = 0, unless
L decreases towards its inside. Moments are searched for near those of the previous iterate, so that
they do not jump to another passage of a place.

Distances are those of the simulated run. For the derivatives, coordinates between nodes are cubic
in time, through the positions and velocities there. With z_i the state before a moment,

    r + J_0 z_i + J_1 z_{i+1} = r + J_1 e_i + (J_0 + J_1 A_i) z_i + J_1 B_i u_i

A node is a time at which the inputs may change. q_D are the dynamic and q_K the driven coordinates.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, Times, rotation, tangent
from fantoccini.control.optimal.dynamics import LinearEnds
from fantoccini.control.optimal.moments import OffsetFunction, Window, nearest_times
from fantoccini.control.tasks import ChosenParameters, ClosestApproach, Nodes, Task
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory

_DIFFERENCE_STEP = 1e-5
"""Step of central differences [m, rad and their rates]; relative for the length of an interval."""
_TIME_DIFFERENCE_STEP = 1e-3
"""Step of central differences in time, relative to an interval."""
_SAMPLES_PER_INTERVAL = 6
"""Number of samples in an interval with which the search for moments begins."""
_MAX_MOMENT_CHANGE = 0.25
"""Largest change of a moment in a step, relative to its window."""
_MAX_APPROACH = 0.25
"""Largest change of a moment towards another in a step, relative to the time between them."""
_EDGE_TOLERANCE = 1e-9
"""Largest distance of a moment from an edge of its window to count as lying there [s]."""

States = tuple[Array, Array, Array, Array]
"""States as q_D, v_D, q_K and v_K, (n, ...) each."""


@dataclass(frozen=True, eq=False)
class TouchTerm:
    """The term slope . d + 1/2 d^T curvature d, d the changes of a point and its scaled velocity.

    Attributes:
        derivatives: (6, 2 n_z + 1 + n_p) derivatives of d, with the columns of :class:`Moments`.
        curvature: (6, 6) matrix, positive semi-definite.
        slope: (6,) gradient.
        gap_derivatives: (3, 2 n_z + 1 + n_p) derivatives of the change of the distance in a step.
        moment_change: (3,) change of the distance by the change of the moment alone.
    """

    derivatives: Array
    curvature: Array
    slope: Array
    gap_derivatives: Array
    moment_change: Array


@dataclass(frozen=True, eq=False)
class Moments:
    """The moments of touches along a motion.

    Attributes:
        t: (T,) times [s].
        widths: (T,) lengths of their windows [s].
        intervals: (T,) indices of the intervals in which they lie.
        edge: (T,) -1 or 1 for a moment at the first or the last time of its window, NaN if these
            coincide.
        r: (T, 3) offsets of the points from the places [m].
        v: (T, 3) velocities of the points [m/s].
        acc: (T, 3) accelerations of the points [m/s^2].
        r_derivatives, v_derivatives: (T, 3, 2 n_z + 1 + n_p) derivatives of r and v by the states
            before and after the interval, the length of all intervals and the parameters.
    """

    t: Times
    widths: Times
    intervals: Indices
    edge: Array
    r: Array
    v: Array
    acc: Array
    r_derivatives: Array
    v_derivatives: Array

    def terms_of(self, weight: float, force: Array) -> list[TouchTerm]:
        """The terms of all touches.

        Args:
            weight: weight of half the squared distances.
            force: (T, 3) multipliers of the distances.
        """
        terms = []
        for j, (r, v) in enumerate(zip(self.r, self.v, strict=True)):
            f, scale = weight * r - force[j], _MAX_MOMENT_CHANGE * self.widths[j]
            curvature, direction, slope = np.zeros((6, 6)), np.zeros(6), np.append(f, np.zeros(3))
            moment_change = np.zeros(3)
            curvature[:3, :3] = weight * np.eye(3)
            if self.edge[j] == 0.0 or (f @ v) * self.edge[j] > 0.0:
                moment_curvature = weight * (v @ v + r @ r / scale**2) + max(
                    -force[j] @ self.acc[j], 0.0
                )
                if moment_curvature > 0.0:
                    w = np.append(weight * v, -force[j] / scale)  # w, for scaled velocities
                    direction = w / moment_curvature
                    curvature -= np.outer(w, direction)
                    slope -= direction * (f @ v)
                    moment_change = -v * (f @ v) / moment_curvature
            values, vectors = np.linalg.eigh(curvature)
            curvature = (vectors * np.maximum(values, 0.0)) @ vectors.T
            derivatives = np.concatenate([self.r_derivatives[j], scale * self.v_derivatives[j]])
            gap_derivatives = self.r_derivatives[j] - np.outer(v, direction @ derivatives)
            terms.append(TouchTerm(derivatives, curvature, slope, gap_derivatives, moment_change))
        return terms


class TouchTerms:
    """The touches of a task, and their terms in programs.

    Args:
        task: see :class:`Task`.
        free_parameters: the parameters chosen along with the motion.
    """

    def __init__(self, task: Task, free_parameters: ChosenParameters):
        marionette = task.marionette
        touches = task.all_touches
        self._touches, self._free_parameters = touches, free_parameters
        self._links = [marionette.link_index(touch.body) for touch in touches]
        self._places = np.array([touch.place for touch in touches], float).reshape(-1, 3)
        self._points = np.array([touch.at for touch in touches], float).reshape(-1, 3)
        self._cached: tuple[Nodes, Moments] | None = None

    def __len__(self) -> int:
        return len(self._touches)

    def gap(self, nodes: Nodes) -> Array:
        """(3 T,) vectors from the points to the places at the moments of nearest approach [m]."""
        return -np.ravel(self.moments(nodes).r) if len(self) else np.zeros(0)

    def gap_change(
        self, nodes: Nodes, z: Array, c: Array, weight: float, force: Array
    ) -> tuple[Array, Array]:
        """(3 T,) predicted changes of the gap in a step: in total, and by changes of moments alone.

        Args:
            nodes, weight, force: see :meth:`add`.
            z, c: (N + 1, n_z) and (1 + n_p,) changes of the states and the constants.
        """
        if not len(self):
            return np.zeros(0), np.zeros(0)
        moments = self.moments(nodes)
        changes = np.concatenate(
            [z[moments.intervals], z[moments.intervals + 1], np.tile(c, (len(self), 1))], axis=1
        )
        terms = moments.terms_of(weight, force.reshape(-1, 3))
        gap_changes = [term.gap_derivatives @ d for term, d in zip(terms, changes, strict=True)]
        return np.ravel(gap_changes), np.ravel([term.moment_change for term in terms])

    def with_moments(self, nodes: Nodes) -> Nodes:
        """The same nodes with their moments, so that the next search begins near these."""
        moments = self.moments(nodes)
        self._cached = replace(nodes, moments=moments.t), moments
        return self._cached[0]

    def add(
        self,
        nodes: Nodes,
        linear: LinearEnds,
        constant_indices: Indices,
        weight: float,
        force: Array,
        H: Array,
        g: Array,
        cross: Array,
        Q: Array,
        q: Array,
    ) -> None:
        """Adds the terms weight/2 r^T S r - force . r to a program.

        Args:
            nodes, linear: the motion, with some of its constants as further states.
            constant_indices: indices of these constants.
            weight: weight of half the squares.
            force: (3 T,) multipliers.
            H, g, cross, Q, q: see :meth:`Objective.program`.
        """
        if not len(self):
            return
        moments, k, n_z = self.moments(nodes), linear.B.shape[2], nodes.n_z
        for i, term in zip(
            moments.intervals, moments.terms_of(weight, force.reshape(-1, 3)), strict=True
        ):
            J_0 = np.pad(term.derivatives[:, :n_z], ((0, 0), (0, len(constant_indices))))
            J_1 = np.concatenate(
                [
                    term.derivatives[:, n_z : 2 * n_z],
                    term.derivatives[:, 2 * n_z + constant_indices],
                ],
                axis=1,
            )
            J_z, J_u = J_0 + J_1 @ linear.A[i], J_1 @ linear.B[i]
            curvature, slope = term.curvature, term.slope + term.curvature @ (J_1 @ linear.e[i])
            H[i, :k, :k] += J_u.T @ curvature @ J_u
            g[i, :k] += J_u.T @ slope
            cross[i, k:] += J_z.T @ curvature @ J_u
            matrix, vector = (Q, q) if i == 0 else (H[i - 1, k:, k:], g[i - 1, k:])
            matrix += J_z.T @ curvature @ J_z
            vector += J_z.T @ slope

    def closest_approaches(self, run: Trajectory, parameters: Array) -> tuple[ClosestApproach, ...]:
        """Times and distances at which a run comes closest to the places."""
        if not len(self):
            return ()
        offsets = self._offsets_in_run(run, parameters)
        step = (run.t[-1] - run.t[0]) / (_SAMPLES_PER_INTERVAL * len(run))
        times = nearest_times(offsets, self._windows(run.t[0], run.t[-1]), step)
        distances = [float(np.linalg.norm(offsets(k, times[k : k + 1]))) for k in range(len(self))]
        return tuple(map(ClosestApproach, self._touches, times.tolist(), distances))

    def _offsets_in_run(self, run: Trajectory, parameters: Array) -> OffsetFunction:
        """The offsets of touches along a run, as a function of time."""
        marionette, first, last = self._free_parameters.marionette(parameters), run.t[0], run.t[-1]

        def offsets(k: int, times: Times) -> Array:
            states = run.resample(np.clip(times, first, last))
            return self._offsets(k, marionette, states.q_D, states.q_K)

        return offsets

    def moments(self, nodes: Nodes) -> Moments:
        """The moments of nearest approach, with derivatives."""
        if self._cached is None or self._cached[0] is not nodes:
            self._cached = nodes, self._compute_moments(nodes)
        return self._cached[1]

    def _compute_moments(self, nodes: Nodes) -> Moments:
        h, N, n = nodes.interval, len(nodes), len(self)
        offsets = (
            self._offsets_between_nodes(nodes)
            if nodes.run is None
            else self._offsets_in_run(nodes.run, nodes.parameters)
        )
        end = nodes.start + N * h
        windows = self._windows(nodes.start, end)
        low, high = np.array([(window.low, window.high) for window in windows]).T
        lengths = np.maximum(high - low, h)
        times = nearest_times(
            offsets,
            self._narrow_windows(nodes, windows, _MAX_MOMENT_CHANGE * lengths),
            h / _SAMPLES_PER_INTERVAL,
        )
        edge = 1.0 * (times >= high - _EDGE_TOLERANCE) - 1.0 * (times <= low + _EDGE_TOLERANCE)
        edge[high - low <= 2.0 * _EDGE_TOLERANCE] = np.nan
        intervals = np.clip(((times - nodes.start) / h).astype(int), 0, N - 1)
        fractions = (times - nodes.start) / h - intervals
        r_derivatives, v_derivatives = np.zeros(
            (2, n, 3, 2 * nodes.n_z + 1 + len(self._free_parameters))
        )
        r, v, acc = np.zeros((3, n, 3))
        for k in range(n):
            # A moment at the end of the motion moves with it.
            at_end = times[k] >= end - _EDGE_TOLERANCE
            r[k] = offsets(k, times[k : k + 1])[0]
            derivatives = self._derivatives(
                k, nodes, int(intervals[k]), float(fractions[k]), at_end
            )
            v[k], acc[k], r_derivatives[k], v_derivatives[k] = derivatives
        return Moments(times, lengths, intervals, edge, r, v, acc, r_derivatives, v_derivatives)

    def _offsets_between_nodes(self, nodes: Nodes) -> OffsetFunction:
        """The offsets of touches along the curve between nodes, as a function of time."""
        marionette = self._free_parameters.marionette(nodes.parameters)
        states: States = (nodes.q_D, nodes.v_D, nodes.q_K, nodes.v_K)

        def offsets(k: int, times: Times) -> Array:
            fraction = (times - nodes.start) / nodes.interval
            index = np.clip(fraction.astype(int), 0, len(nodes) - 1)
            before, after = (tuple(array[index + shift] for array in states) for shift in (0, 1))
            q_D, q_K = _interpolated_configurations(
                nodes, before, after, nodes.interval, fraction - index
            )
            return self._offsets(k, marionette, q_D, q_K)

        return offsets

    def _windows(self, start: float, end: float) -> list[Window]:
        """The windows of the touches, within a motion."""
        return [
            Window(
                min(max(touch.between[0], start), end),
                max(min(touch.between[1], end), start),
                touch.in_turn,
            )
            for touch in self._touches
        ]

    def _narrow_windows(self, nodes: Nodes, windows: list[Window], widths: Times) -> list[Window]:
        """Windows narrowed to times near the moments of the last iterate, if there are any.

        Moments of touches that must follow one another, or of one point, cannot coincide.
        """
        moments = nodes.moments
        if moments is None:
            return windows
        low, high = moments - widths, moments + widths
        for j, k in itertools.combinations(range(len(moments)), 2):
            first, second = self._touches[j], self._touches[k]
            if (first.body, first.at) == (second.body, second.at) or (
                k == j + 1 and second.in_turn
            ):
                earlier, later = (j, k) if moments[j] <= moments[k] else (k, j)
                max_approach = _MAX_APPROACH * (moments[later] - moments[earlier])
                high[earlier] = min(high[earlier], moments[earlier] + max_approach)
                low[later] = max(low[later], moments[later] - max_approach)
        return [
            Window(
                min(max(lower, window.low), window.high),
                max(min(upper, window.high), window.low),
                False,
            )
            for window, lower, upper in zip(windows, low, high, strict=True)
        ]

    def _derivatives(
        self, k: int, nodes: Nodes, i: int, fraction: float, at_end: bool
    ) -> tuple[Array, Array, Array, Array]:
        """v, acc, and the derivatives of r and v, by central differences.

        Args:
            k: index of the touch.
            nodes: the motion.
            i, fraction: index of the interval, and share of it that lies before the moment.
            at_end: whether the moment is the end of the motion, which moves with the intervals.
        """
        h, n_z, n_c = nodes.interval, nodes.n_z, 1 + len(self._free_parameters)
        z = np.zeros((4 * n_z + 3, 2 * n_z))
        z[: 2 * n_z] = _DIFFERENCE_STEP * np.eye(2 * n_z)
        z[2 * n_z : 4 * n_z] = -_DIFFERENCE_STEP * np.eye(2 * n_z)
        lengths = np.full(len(z), h)
        lengths[-3:-1] *= [1.0 + _DIFFERENCE_STEP, 1.0 - _DIFFERENCE_STEP]
        fractions = np.full(len(z), fraction) if at_end else (i + fraction) * h / lengths - i
        before = _perturbed_states(nodes, i, z[:, :n_z])
        after = _perturbed_states(nodes, i + 1, z[:, n_z:])
        offsets, derivatives = np.zeros((3, len(z), 3)), np.zeros((3, 3, 2 * n_z + n_c))
        for j, shift in enumerate((-_TIME_DIFFERENCE_STEP, 0.0, _TIME_DIFFERENCE_STEP)):
            q_D, q_K = _interpolated_configurations(
                nodes, before, after, lengths, fractions + shift * h / lengths
            )
            offsets[j] = self._offsets(
                k, self._free_parameters.marionette(nodes.parameters), q_D, q_K
            )
            derivatives[j, :, : 2 * n_z] = (
                offsets[j, : 2 * n_z] - offsets[j, 2 * n_z : 4 * n_z]
            ).T / (2.0 * _DIFFERENCE_STEP)
            derivatives[j, :, 2 * n_z] = (offsets[j, -3] - offsets[j, -2]) / (
                2.0 * _DIFFERENCE_STEP * h
            )
            for m, (below, above) in enumerate(self._free_parameters.neighbours(nodes.parameters)):
                offsets_p = [
                    self._offsets(k, self._free_parameters.marionette(p), q_D[-1:], q_K[-1:])[0]
                    for p in (below, above)
                ]
                derivatives[j, :, 2 * n_z + 1 + m] = (offsets_p[1] - offsets_p[0]) / (
                    above[m] - below[m]
                )
        time_step = _TIME_DIFFERENCE_STEP * h
        v, acc = (
            (offsets[2, -1] - offsets[0, -1]) / (2.0 * time_step),
            offsets[2, -1] + offsets[0, -1] - 2.0 * offsets[1, -1],
        )
        return (
            v,
            acc / time_step**2,
            derivatives[1],
            (derivatives[2] - derivatives[0]) / (2.0 * time_step),
        )

    def _offsets(self, k: int, marionette: Marionette, q_D: Array, q_K: Array) -> Array:
        """(n, 3) offsets of the point from the place at given configurations."""
        pose = marionette.poses(q_D, q_K)[:, self._links[k]]
        return np.asarray(pose[:, :, :3] @ self._points[k] + pose[:, :, 3] - self._places[k])


def _perturbed_states(nodes: Nodes, i: int, z: Array) -> States:
    """The state of node i, changed by tangent vectors (n, n_z)."""
    dq_D, dv_D, dq_K, dv_K = np.split(z, nodes.splits, axis=1)
    t = nodes.table
    return (
        tangent.moved(t.scalars_D, t.quaternions_D, nodes.q_D[i], dq_D),
        nodes.v_D[i] + dv_D,
        tangent.moved(t.scalars_K, t.quaternions_K, nodes.q_K[i], dq_K),
        nodes.v_K[i] + dv_K,
    )


def _interpolated_configurations(
    nodes: Nodes, before: States, after: States, h: Array | float, fraction: Array
) -> tuple[Array, Array]:
    """Configurations (n, n_qD), (n, n_qK) between two states, cubic in time.

    The curve has the positions and velocities of the states, which are h [s] apart.
    """
    t = nodes.table
    s, h = fraction[:, None], np.broadcast_to(h, fraction.shape)[:, None]
    configurations = []
    for scalars, quaternions, q, v, p, w in (
        (t.scalars_D, t.quaternions_D, *before[:2], *after[:2]),
        (t.scalars_K, t.quaternions_K, *before[2:], *after[2:]),
    ):
        displacement, w = tangent.between(scalars, quaternions, q, p, v.shape[1]), w.copy()
        for _, v_index in quaternions:
            columns = slice(v_index, v_index + 3)
            rate = rotation.right_jacobian_inverse(displacement[:, columns]) @ w[:, columns, None]
            w[:, columns] = rate[..., 0]
        change = (3.0 - 2.0 * s) * s**2 * displacement + h * s * (
            (1.0 - s) ** 2 * v - s * (1.0 - s) * w
        )
        configurations.append(tangent.moved(scalars, quaternions, q, change))
    return configurations[0], configurations[1]
