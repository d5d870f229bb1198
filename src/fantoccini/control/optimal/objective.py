"""Cost of a motion at its nodes, its gap (the error at its end), and the program of a step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, UnknownNameError
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram, StageSolution
from fantoccini.control.optimal.rows import Rows
from fantoccini.control.optimal.touch_terms import TouchTerms
from fantoccini.control.tasks import (
    ChosenParameters,
    NodeKinematics,
    Nodes,
    Residual,
    ScalarResidual,
    Task,
    Track,
    active_fraction,
    track_path,
    track_residual,
)
from fantoccini.dynamics.marionette import Marionette

_FIRST_END_WEIGHT = 100.0
"""First weight of half the squared gap, besides its multipliers; in units of the cost."""
_WEIGHT_FACTOR = 4.0
_MAX_END_WEIGHT = 1e6
_FIRST_PRICE = 0.3
"""First price of a unit of violation of a row, in units of the cost."""
_MIN_COST_UNIT = 1e-12
"""Smallest unit of a cost."""
_GRADIENT_ROUNDING = 1e-9
"""Rounding error of a gradient, relative to the curvature."""
_MAX_GAP_TO_SHORTEN = 1e-2
"""Largest gap with which a step may shorten the motion [m, rad and their rates]."""
_MAX_DURATION_CHANGE = 0.1
"""Largest change of the duration in a step, relative to the duration."""


@dataclass(frozen=True, eq=False)
class MotionBounds:
    """Bounds of a task as numbers; infinite if there is none.

    Attributes:
        inputs: indices of the driven velocities that move.
        acceleration, jump, speed: (n_vK,) largest magnitudes; jumps are changes of accelerations
            between intervals.
        low, high: (n_vK,) bounds of the driven coordinates.
        joint_indices, joint_low, joint_high: dynamic coordinates with bounds, as indices in z.
    """

    inputs: Indices
    acceleration: Array
    jump: Array
    speed: Array
    low: Array
    high: Array
    joint_indices: Indices
    joint_low: Array
    joint_high: Array


class Objective:
    """The cost and the bounds of a task.

    Programs exclude held inputs and their coordinates.

    Attributes:
        task: see :class:`Task`.
        rows: bounds that may be violated at a price.
        touches: places that points must pass at moments that the search finds.
        price: price of a unit of violation of a row; the search raises it if rows are violated.
        unit: unit of the cost: the largest gradient of the first motion, or its largest curvature.
        end_indices: entries of z that the end requires, as indices of programs.

    Args:
        task: see above.
    """

    def __init__(self, task: Task):
        self.task, marionette, self.unit, self.price = task, task.marionette, 0.0, 0.0
        n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
        self._n_z, self._k = 2 * (n + k), k
        self._tracks = [track for track in task.tracks if track.kind != "tension"]
        self._tension_tracks = [track for track in task.tracks if track.kind == "tension"]
        self._acc = task.bounds.magnitudes(marionette, "acceleration")
        jerk = task.bounds.magnitudes(marionette, "jerk")
        self._jerk = np.where(jerk > 0.0, jerk, np.inf)  # held inputs have no acceleration either
        self._u = np.flatnonzero(self._acc > 0.0)
        self._z = np.concatenate([np.arange(2 * n), 2 * n + self._u, 2 * n + k + self._u])
        lower, upper = task.bounds.intervals(marionette)
        is_driven = np.arange(self._n_z) >= 2 * n  # bounds of the others are rows
        self._low = np.where(is_driven, lower, -np.inf)
        self._high = np.where(is_driven, upper, np.inf)
        self._end, self._end_weight = task.required_end, _FIRST_END_WEIGHT
        required = np.zeros(self._n_z, bool) if self._end is None else self._end.required
        self._required, self.end_indices = required, np.flatnonzero(required[self._z])
        self._cached_residuals: tuple[tuple[float, float, int], list[Residual]] = (
            (0.0, 0.0, 0),
            [],
        )
        self._free_parameters = ChosenParameters(marionette, task.x0, task.parameters)
        self.touches = TouchTerms(task, self._free_parameters)
        self._constant_indices = np.arange(0 if task.is_free else 1, 1 + len(self._free_parameters))
        """Indices into the constants of a motion: length of intervals, parameters."""
        self.rows = Rows(task, self._free_parameters, self._constant_indices)

    def cost(self, nodes: Nodes, ends: Ends) -> float:
        """The cost J."""
        total = sum(self._cost_parts(nodes, ends))
        return total + self.task.time_weight * nodes.interval * len(nodes) * self.task.is_free

    @property
    def program_indices(self) -> tuple[Indices, Indices]:
        """Indices of the accelerations and the entries of z that are variables of programs."""
        return self._u, self._z

    @property
    def tracks_tension(self) -> bool:
        """Whether tensions are tracked."""
        return bool(self._tension_tracks)

    @property
    def end_weight(self) -> float:
        """Weight of half the squared gap; 0 if the task has neither an end nor touches."""
        has_gap = self._end is not None or len(self.touches) > 0
        return self._end_weight * self.unit if has_gap else 0.0

    def raise_end_weight(self) -> None:
        """Raises the weight of the gap, which steps close too slowly."""
        self._end_weight = min(_WEIGHT_FACTOR * self._end_weight, _MAX_END_WEIGHT)

    def set_unit(self, nodes: Nodes, linear: LinearEnds) -> None:
        """Sets the unit of the cost, from the first motion."""
        program = self.program(nodes, linear, 0.0, 0.0)
        u = np.arange(len(self._u))
        min_unit = self.task.time_weight * len(nodes) * self.task.is_free
        self._set_unit(program.g, program.H[:, u, u], min_unit)

    def set_unit_from_gradient(self, g: Array, diagonal: Array) -> None:
        """Sets the unit from a gradient and a Hessian's diagonal, (N, n_vK + n_z) each."""
        indices = np.concatenate([self._u, self._k + self._z])
        self._set_unit(g[:, indices], diagonal[:, self._u], 0.0)

    def _set_unit(self, g: Array, curvature: Array, min_unit: float) -> None:
        unit = max(float(np.max(np.abs(g), initial=0.0)), min_unit)
        max_curvature = float(np.max(curvature, initial=_MIN_COST_UNIT))
        self.unit = unit if unit > _GRADIENT_ROUNDING * max_curvature else max_curvature
        self.price = _FIRST_PRICE * self.unit

    def end_gap(self, nodes: Nodes) -> Array:
        """(n_z,) the change from the last node to the required end."""
        return np.zeros(nodes.n_z) if self._end is None else self._end.gap(nodes)

    def gap(self, nodes: Nodes) -> Array:
        """(n_z + 3 T,) the gap at the end, and the offsets of touching points from their places."""
        return np.concatenate([self.end_gap(nodes), self.touches.gap(nodes)])

    def gap_change(
        self, nodes: Nodes, z: Array, c: Array, force: Array | float
    ) -> tuple[Array, Array]:
        """(n_z + 3 T,) change of the gap in a step, and the multipliers after it.

        Args:
            nodes, force: see :meth:`program`.
            z, c: (N + 1, n_z) and (1 + n_p,) changes of the states and the constants.
        """
        at_end = np.where(self._required, z[-1], 0.0)
        weight, forces = self.end_weight, np.concatenate(self._forces(force))
        gap_change, moment_change = self.touches.gap_change(
            nodes, z, c, weight, forces[self._n_z :]
        )
        gap_change = np.concatenate([at_end, gap_change])
        remaining = self.gap(nodes) - gap_change
        remaining[self._n_z :] -= moment_change
        return gap_change, forces + weight * remaining

    def _forces(self, force: Array | float) -> tuple[Array, Array]:
        """(n_z,) and (3 T,) multipliers of the end and of touches."""
        forces = np.broadcast_to(force, (self._n_z + 3 * len(self.touches),))
        return forces[: self._n_z], forces[self._n_z :]

    def program(
        self, nodes: Nodes, linear: LinearEnds, damping: float, force: Array | float
    ) -> StageProgram:
        """The program of a step.

        Args:
            nodes, linear: the motion.
            damping: damping of the Hessian.
            force: (n_z + 3 T,) multipliers of the gap.
        """
        if len(self._constant_indices):
            linear = linear.with_constants(self._constant_indices)
        N, n_z, k = linear.B.shape
        H, g, cross = (
            np.zeros((N, k + n_z, k + n_z)),
            np.zeros((N, k + n_z)),
            np.zeros((N, k + n_z, k)),
        )
        # Q and q belong to the first node, which moves only with the parameters.
        Q, q = np.zeros((n_z, n_z)), np.zeros(n_z)
        self._add_residuals(nodes, H, g, Q, q)
        self._add_smoothness(nodes, H, g, cross)
        self._add_tension_terms(nodes, linear, H, g, cross, Q, q)
        ends = np.flatnonzero(self._required)
        H[-1, k + ends, k + ends] += self.end_weight
        g[-1, k + ends] -= (self.end_weight * self.end_gap(nodes) + self._forces(force)[0])[ends]
        self.touches.add(
            nodes,
            linear,
            self._constant_indices,
            self.end_weight,
            self._forces(force)[1],
            H,
            g,
            cross,
            Q,
            q,
        )
        diagonal = np.arange(k + n_z)
        H[:, diagonal, diagonal] += damping
        numbers = nodes.scalars[1:]
        low_c, high_c = self._bounds_of_constants(nodes)
        low = np.concatenate([-self._acc - nodes.acc_K, self._low - numbers, low_c], axis=1)
        high = np.concatenate([self._acc - nodes.acc_K, self._high - numbers, high_c], axis=1)
        # After the last interval the inputs rest or keep their speed, without acceleration.
        max_jump = self._jerk * nodes.interval
        low[-1, :k] = np.maximum(low[-1, :k], -max_jump - nodes.acc_K[-1])
        high[-1, :k] = np.minimum(high[-1, :k], max_jump - nodes.acc_K[-1])
        low, high = np.maximum(low, -UNBOUNDED), np.minimum(high, UNBOUNDED)
        value, row_low, row_high = self.rows.values(nodes, linear)
        u = self._u
        z = np.concatenate([self._z, self._n_z + np.arange(len(self._constant_indices))])
        selected = np.concatenate([u, k + z])
        row_columns = np.concatenate([selected, k + n_z + selected])
        program = StageProgram(
            _selected(H, selected, selected),
            _selected(g, selected),
            _selected(cross, selected, u),
            _selected(linear.A, z, z),
            _selected(linear.B, z, u),
            _selected(linear.e, z),
            _selected(low, selected),
            _selected(high, selected),
            _selected(self.rows.derivatives(nodes, linear), slice(None), row_columns),
            row_low - value,
            row_high - value,
            np.full(value.shape, self.price),
        )
        if not len(self._constant_indices):
            return program
        if self.task.is_free:
            _, growing, shrinking = self._cost_parts(nodes, linear)
            slope = self.task.time_weight * len(nodes) + (growing - shrinking) / nodes.interval
            q[self._n_z] += slope
        start = np.concatenate(
            [linear.dstart_c[:, self._constant_indices], np.eye(len(self._constant_indices))]
        )
        return program.with_constants(
            start[z], _selected(Q[None], z, z)[0], q[z], low_c[0], high_c[0], damping
        )

    def _bounds_of_constants(self, nodes: Nodes) -> tuple[Array, Array]:
        """(N, n_c) the allowed changes of the constants."""
        shortest, longest = self.interval_changes(nodes) if self.task.is_free else (0.0, 0.0)
        indices = self._constant_indices
        low = np.append(shortest, self._free_parameters.low - nodes.parameters)[indices]
        high = np.append(longest, self._free_parameters.high - nodes.parameters)[indices]
        shape = (len(nodes), len(indices))
        return np.broadcast_to(low, shape), np.broadcast_to(high, shape)

    def limits(self, interval: float) -> MotionBounds:
        """The bounds of accelerations, driven coordinates and joints, for a length of intervals."""
        n = self._n_z // 2 - self._k
        driven = slice(2 * n, 2 * n + self._k)
        rows = self.rows
        return MotionBounds(
            self._u,
            self._acc,
            interval * self._jerk,
            self._high[driven.stop :],
            self._low[driven],
            self._high[driven],
            rows.joint_indices,
            rows.joint_low,
            rows.joint_high,
        )

    def gauss_newton_terms(self, nodes: Nodes) -> tuple[Array, Array, Array]:
        """Gauss-Newton's J^T J + diagonal of the cost without tensions, and its gradient.

        Returns:
            (N, m, n_z) J, by the states after the intervals; (N, n_vK + n_z) the diagonal and the
            gradient, by the accelerations and these states.
        """
        evaluation, k, N, weighted_jacobians = self._evaluation(nodes), self._k, len(nodes), []
        diagonal, g = np.zeros((2, N, k + self._n_z))
        for residual in self._residuals(nodes):
            r, w = residual.value(evaluation)[1:], residual.weights[1:, None]
            if isinstance(residual, ScalarResidual):
                columns = k + np.array(residual.columns)
                diagonal[:, columns] += w
                g[:, columns] += w * r
                continue
            weighted_jacobians.append(np.sqrt(w)[..., None] * residual.derivatives(evaluation)[1:])
            g[:, k:] += ((np.sqrt(w) * r)[:, None] @ weighted_jacobians[-1])[:, 0]
        h, smooth = nodes.interval, self.task.smooth
        jumps = np.diff(nodes.acc_K, axis=0, prepend=0.0, append=0.0)
        diagonal[:, :k] += h * smooth.acceleration + 2.0 * smooth.jerk / h
        g[:, :k] += h * smooth.acceleration * nodes.acc_K
        g[:, :k] += smooth.jerk / h * (jumps[:-1] - jumps[1:])
        J = (
            np.concatenate(weighted_jacobians, axis=1)
            if weighted_jacobians
            else np.zeros((N, 0, self._n_z))
        )
        return J, diagonal, g

    def tension_residuals(self, nodes: Nodes, tension: Array) -> Iterator[tuple[int, Array, Array]]:
        """Row, weights (N,) and residuals (N,) of every tracked tension."""
        for track in self._tension_tracks:
            row, weights, target = _pull(self.task.marionette, track, nodes)
            yield row, weights, tension[:, row] - target

    def interval_changes(self, nodes: Nodes) -> tuple[float, float]:
        """Smallest and largest change of the intervals' length in a step [s].

        Intervals get shorter only once the end is near its goal.
        """
        h, N = nodes.interval, len(nodes)
        shortest, longest = self.task.durations
        is_near = np.max(np.abs(self.gap(nodes)), initial=0.0) <= _MAX_GAP_TO_SHORTEN
        shortest_change = max(shortest / N - h, -_MAX_DURATION_CHANGE * h) if is_near else 0.0
        return shortest_change, max(min(longest / N - h, _MAX_DURATION_CHANGE * h), 0.0)

    def expanded(self, solution: StageSolution) -> tuple[Array, Array, Array]:
        """(N + 1, n_z), (N, n_vK) and (1 + n_p,) changes of states, inputs and constants."""
        N, n_u, n_z = len(solution.u), len(self._u), len(self._z)
        z, u = np.zeros((N + 1, self._n_z)), np.zeros((N, self._k))
        c = np.zeros(1 + len(self._free_parameters))
        z[:, self._z], u[:, self._u] = solution.z[:, :n_z], solution.u[:, :n_u]
        c[self._constant_indices] = solution.u[0, n_u:]
        return z, u, c

    def expanded_gains(self, K: Array) -> Array:
        """(N, n_vK, n_z) gains of all inputs and states."""
        gains = np.zeros((len(K), self._k, self._n_z))
        gains[np.ix_(np.arange(len(K)), self._u, self._z)] = K[:, : len(self._u), : len(self._z)]
        return gains

    def _cost_parts(self, nodes: Nodes, ends: Ends) -> tuple[float, float, float]:
        """The parts of J that are constant, grow and shrink when intervals get longer."""
        evaluation, constant, growing = self._evaluation(nodes), 0.0, 0.0
        for track, residual in zip(self._tracks, self._residuals(nodes), strict=True):
            squares = 0.5 * np.sum(np.square(residual.value(evaluation)), axis=1)
            end_cost = track.end_weight * float(squares[-1])
            constant, growing = (
                constant + end_cost,
                growing + float(residual.weights @ squares) - end_cost,
            )
        for _, weights, r in self.tension_residuals(nodes, ends.tension):
            growing += 0.5 * float(weights @ np.square(r))
        h, smooth = nodes.interval, self.task.smooth
        growing += 0.5 * h * smooth.acceleration * float(np.sum(np.square(nodes.acc_K)))
        jumps = np.diff(nodes.acc_K, axis=0, prepend=0.0, append=0.0)
        return constant, growing, 0.5 * smooth.jerk / h * float(np.sum(np.square(jumps)))

    def _residuals(self, nodes: Nodes) -> list[Residual]:
        """Residuals of the tracks; paths are evaluated once for nodes at the same times."""
        times = (nodes.start, nodes.interval, len(nodes))
        if self._cached_residuals[0] != times:
            residuals = [
                track_residual(self.task.marionette, track, nodes) for track in self._tracks
            ]
            self._cached_residuals = times, residuals
        return self._cached_residuals[1]

    def _evaluation(self, nodes: Nodes) -> NodeKinematics:
        return NodeKinematics(self._free_parameters.marionette(nodes.parameters), nodes)

    def _add_residuals(self, nodes: Nodes, H: Array, g: Array, Q: Array, q: Array) -> None:
        """Adds Gauss-Newton's terms of the tracks at the nodes."""
        evaluation, k, weighted_jacobians = self._evaluation(nodes), self._k, []
        for residual in self._residuals(nodes):
            r, w = residual.value(evaluation), residual.weights[:, None]
            if isinstance(residual, ScalarResidual):
                columns = np.array(residual.columns)
                H[:, k + columns, k + columns] += w[1:]
                g[:, k + columns] += (w * r)[1:]
                Q[columns, columns], q[columns] = (
                    Q[columns, columns] + w[0],
                    q[columns] + w[0] * r[0],
                )
                continue
            J = residual.derivatives(evaluation)
            if len(self._constant_indices):
                J = np.concatenate([J, self._constant_derivatives(residual, nodes)], axis=2)
            g[:, k:] += ((w * r)[1:, None] @ J[1:])[:, 0]
            q += w[0] * r[0] @ J[0]
            weighted_jacobians.append(np.sqrt(w)[..., None] * J)
        if weighted_jacobians:
            J = np.concatenate(weighted_jacobians, axis=1)
            H[:, k:, k:] += J[1:].swapaxes(1, 2) @ J[1:]
            Q += J[0].T @ J[0]

    def _constant_derivatives(self, residual: Residual, nodes: Nodes) -> Array:
        """(N + 1, m, n_c) derivatives of a residual by the constants, by differences."""
        value = residual.value(self._evaluation(nodes))
        derivatives = np.zeros((*value.shape, 1 + len(self._free_parameters)))
        for i, (below, above) in enumerate(self._free_parameters.neighbours(nodes.parameters)):
            residuals = [
                residual.value(self._evaluation(replace(nodes, parameters=p)))
                for p in (below, above)
            ]
            derivatives[..., 1 + i] = (residuals[1] - residuals[0]) / (above[i] - below[i])
        return derivatives[..., self._constant_indices]

    def _add_smoothness(self, nodes: Nodes, H: Array, g: Array, cross: Array) -> None:
        """Adds the terms of accelerations and of their jumps between intervals."""
        u, h, smooth = np.arange(self._k), nodes.interval, self.task.smooth
        jumps = np.diff(nodes.acc_K, axis=0, prepend=0.0, append=0.0)
        H[:, u, u] += h * smooth.acceleration + 2.0 * smooth.jerk / h
        g[:, u] += h * smooth.acceleration * nodes.acc_K
        g[:, u] += smooth.jerk / h * (jumps[:-1] - jumps[1:])
        cross[:, u, u] -= smooth.jerk / h

    def _add_tension_terms(
        self, nodes: Nodes, linear: LinearEnds, H: Array, g: Array, cross: Array, Q: Array, q: Array
    ) -> None:
        """Adds the terms of tracked tensions, which depend on state and inputs after a node."""
        k, n_z = self._k, linear.B.shape[1]
        for row, weights, r in self.tension_residuals(nodes, linear.tension):
            derivatives = linear.dtension[:, row]
            J_z, J_u = derivatives[:, :n_z], derivatives[:, n_z:]
            w = weights[:, None, None]
            H[:, :k, :k] += w * J_u[:, :, None] * J_u[:, None]
            g[:, :k] += (weights * r)[:, None] * J_u
            cross[:, k:] += w * J_z[:, :, None] * J_u[:, None]
            H[:-1, k:, k:] += w[1:] * J_z[1:, :, None] * J_z[1:, None]
            g[:-1, k:] += (weights * r)[1:, None] * J_z[1:]
            Q += w[0] * np.outer(J_z[0], J_z[0])
            q += weights[0] * r[0] * J_z[0]


def _selected(array: Array, *indices: Indices | slice) -> Array:
    """The selected indices of all axes but the first; the array itself if these are all."""
    takes_all = [
        isinstance(index, slice) or len(index) == n
        for index, n in zip(indices, array.shape[1:], strict=True)
    ]
    if all(takes_all):
        return array
    rows, *second = indices
    selected = array[:, rows]
    return selected[:, :, second[0]] if second else selected


def _pull(marionette: Marionette, track: Track, nodes: Nodes) -> tuple[int, Array, Array]:
    """The row of a string, and weights (N,) and path (N,) of its tension in the intervals."""
    names = [s.name for s in marionette.tree.strings]
    if track.name not in names:
        raise UnknownNameError("string", track.name, names)
    target = track_path(marionette, track, nodes.t[:-1])[:, 0]
    fraction = active_fraction(track, nodes.t[:-1])
    return names.index(track.name), track.weight * nodes.interval * fraction, target
