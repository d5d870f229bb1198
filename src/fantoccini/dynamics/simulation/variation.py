"""Variational equations of an event-driven run.

Between events (q_D, v_D) and the columns Z of small changes are integrated together, with the
active set fixed:

    Zdot = [-[w]x, 1; dacc_D/dq_D, dacc_D/dv_D] Z + (acc_D's derivatives by inputs and parameters)

At a release Z is continuous; at a catch it jumps: :mod:`fantoccini.dynamics.simulation.saltation`.
Contact points keep their modes between events, too.

q_D are the dynamic and q_K the driven coordinates, v and acc their rates, and w the angular
velocity of a body. A row is a string or a joint limit; the held ones are the active set.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from fantoccini.base import Array, Indices, SimulationError, Status, Times, multiply
from fantoccini.dynamics.compiled import Evaluation, Screws
from fantoccini.dynamics.derivatives import (
    ContactRows,
    FrozenModes,
    HeldRows,
    KKTSystem,
    ModeSystem,
    PointMode,
    linearise,
    rotation_rate_blocks,
    row_derivatives_at,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.contact_pieces import state_and_input_changes
from fantoccini.dynamics.simulation.input_piece import InputPiece, InputVariation
from fantoccini.dynamics.simulation.saltation import rate_change
from fantoccini.motion import State

FIRST_STEP = 0.01
"""First step of a run [s]; each later piece begins with the last step of the previous one."""
MAX_ERROR = 1e-6
"""Largest difference of the integration from the run, relative to 1 + |state|."""
_MIN_STEPS_OF_LONG_PIECE = 5.0
"""Number of steps above which dependent columns of a piece are combined to save time."""
_ROUNDING = 1e-14
"""Largest part of a column that counts as rounding, relative to the largest column."""


class Variation:
    """Changes of the state along a run of one puppet.

    Args:
        marionette: the puppet.
        rtol, atol: tolerances of the integration.
    """

    def __init__(self, marionette: Marionette, rtol: float, atol: float):
        self.marionette = marionette
        self._rtol, self._atol, self._step = rtol, atol, FIRST_STEP
        self._table = marionette.coordinates

    def projected(
        self,
        x: State,
        rows: Indices,
        Z: Array,
        input_change: InputVariation,
        points: Sequence[PointMode] = (),
    ) -> Array:
        """Changes nearest to Z in the metric of M_DD that keep h = 0 and hdot = 0 of rows.

        They also keep the gaps and velocities of held points.
        """
        if points:
            return self._projected_with_points(x, rows, Z, input_change, points)
        n, results = len(x.v_D), row_derivatives_at(self.marionette, x)
        system = KKTSystem(Evaluation.at_state(self.marionette, x), rows)
        Z_q, Z_v = Z[:n], Z[n:]
        gap_change = (
            results["A_D"] @ Z_q
            + results["A_K"] @ input_change.q_K
            + results["h_p"] @ input_change.p
        )
        Z_q = Z_q + system.least_move(gap_change[rows])
        rate_change_ = rate_change(results, Z_q, input_change.q_K, input_change.v_K, input_change.p)
        rate_change_ = rate_change_ + results["A_D"] @ Z_v
        Z_v = Z_v + system.least_move(rate_change_[rows])
        return np.concatenate([Z_q, Z_v])

    def _projected_with_points(
        self,
        x: State,
        rows: Indices,
        Z: Array,
        input_change: InputVariation,
        points: Sequence[PointMode],
    ) -> Array:
        marionette, n = self.marionette, len(x.v_D)
        evaluation, results = Evaluation.at_state(marionette, x), row_derivatives_at(marionette, x)
        zeros = np.zeros((n, Z.shape[1]))
        held_points = FrozenModes(marionette, points).at(Screws(marionette, x))
        contact_rows = ContactRows(
            Screws(marionette, x, changes=state_and_input_changes(Z, input_change)),
            held_points,
            0.0,
        )
        normal_rows = np.cumsum([0, *(len(p.directions) for p in held_points)])[:-1]
        gap_change = (
            results["A_D"] @ Z[:n]
            + results["A_K"] @ input_change.q_K
            + results["h_p"] @ input_change.p
        )
        gaps = np.concatenate([gap_change[rows], contact_rows.gap_by()])
        system = ModeSystem(
            evaluation, rows, _frictionless(contact_rows, contact_rows.rows[normal_rows])
        )
        Z_q = Z[:n] + system.solve(zeros, gaps)[0]
        rate = rate_change(results, Z_q, input_change.q_K, input_change.v_K, input_change.p)
        rate = (rate + results["A_D"] @ Z[n:])[rows]
        Z = np.concatenate([Z_q, Z[n:]])
        contact_rows = ContactRows(
            Screws(marionette, x, changes=state_and_input_changes(Z, input_change)),
            held_points,
            0.0,
        )
        rates = np.concatenate([rate, contact_rows.velocity_by()])
        system = ModeSystem(evaluation, rows, _frictionless(contact_rows, contact_rows.rows))
        return np.concatenate([Z_q, Z[n:] + system.solve(zeros, rates)[0]])

    def integrated(
        self,
        x: State,
        rows: Indices,
        Z: Array,
        piece: InputPiece,
        times: Times,
        points: Sequence[PointMode] = (),
    ) -> tuple[Array, Array]:
        """State and changes at several times of a piece, with these rows and points held.

        Returns:
            States (len(times), n_qD + n_vD) and changes (len(times), 2 n_vD, m).

        Raises:
            SimulationError: steps became too small.
        """
        if points:
            return self._integrated_with_points(x, rows, Z, piece, times, points)
        marionette = self.marionette
        is_held = np.zeros(marionette.tree.n_rows, dtype=bool)
        is_held[rows] = True
        is_long = times[-1] - x.t > _MIN_STEPS_OF_LONG_PIECE * self._step
        basis, basis_shares = _independent_columns(Z, 2 * len(x.v_D)) if is_long else (Z, None)
        results = marionette.libraries.derivatives.flow(
            (x.t, x.q_D, x.v_D, basis),
            times,
            piece.inputs,
            piece.powers,
            is_held,
            marionette.p,
            rtol=self._rtol,
            atol=self._atol,
            step=self._step,
        )
        self._step = results.step
        if results.status is not Status.DONE:
            raise SimulationError(results.status, f"after t = {x.t:.6g} s")
        changes = (
            results.changes if basis_shares is None else _combined(results.changes, basis_shares)
        )
        return np.concatenate([results.q_D, results.v_D], axis=1), changes

    def _integrated_with_points(
        self,
        x: State,
        rows: Indices,
        Z: Array,
        piece: InputPiece,
        times: Array,
        points: Sequence[PointMode],
    ) -> tuple[Array, Array]:
        n_q, n, m = self._table.n_qD, self._table.n_vD, Z.shape[1]
        names = [self.marionette.tree.row_names[i] for i in rows]

        def rate(t: float, y: Array) -> Array:
            q_D, v_D, Z = y[:n_q], y[n_q : n_q + n], y[n_q + n :].reshape(2 * n, m)
            q_K, v_K, acc_K, u_D = piece.at(t)
            state = x.replace(t=t, q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K)
            lin = linearise(self.marionette, state, acc_K, u_D, names, points)
            input_change, acc = piece.variation(t), lin.acc
            Z_q = rotation_rate_blocks(self._table.quaternions_D, v_D) @ Z[:n] + Z[n:]
            Z_v = (
                acc.q_D @ Z[:n]
                + acc.v_D @ Z[n:]
                + acc.q_K @ input_change.q_K
                + acc.v_K @ input_change.v_K
                + acc.acc_K @ input_change.acc_K
                + acc.u_D @ input_change.u_D
                + acc.p @ input_change.p
            )
            rates = self._configuration_rate(q_D, v_D), lin.acc_D, Z_q.ravel(), Z_v.ravel()
            return np.concatenate(rates)

        start = np.concatenate([x.q_D, x.v_D, Z.ravel()])
        from scipy.integrate import solve_ivp  # slow to import

        results = solve_ivp(
            rate, (x.t, times[-1]), start, "DOP853", times, rtol=self._rtol, atol=self._atol
        )
        if not results.success:
            raise SimulationError(Status.STEP_TOO_SMALL, f"at t = {results.t[-1]:.6g} s")
        y = results.y.T
        return y[:, : n_q + n], y[:, n_q + n :].reshape(-1, 2 * n, m)

    def check(self, reached: Array, t: float, q_D: Array, v_D: Array) -> None:
        """Raises SimulationError unless the integration ended at the run's state at t [s]."""
        run_state = np.concatenate([q_D, v_D])
        error = np.max(np.abs(reached - run_state) / (1.0 + np.abs(run_state)))
        if not error < MAX_ERROR:
            raise SimulationError(
                Status.NOT_SETTLED,
                f"the run and its linearisation differ by {error:.2g} at t = {t:.6g} s",
            )

    def _configuration_rate(self, q_D: Array, v_D: Array) -> Array:
        rate = np.empty_like(q_D)
        for q, v in self._table.scalars_D:
            rate[q] = v_D[v]
        for q, v in self._table.quaternions_D:
            half_rotation_rate = np.concatenate([[0.0], 0.5 * v_D[v : v + 3]])
            rate[q : q + 4] = multiply(q_D[q : q + 4], half_rotation_rate)
        return rate


def _independent_columns(Z: Array, n_state: int) -> tuple[Array, Array | None]:
    """Basis of the first ``n_state`` columns of Z, followed by the other columns; and shares of it.

    Taut strings leave changes of the state fewer dimensions than coordinates. Columns that depend
    on the state alone are integrated as combinations of the basis, the first r columns returned::

        Z[:, :own] = basis[:, :r] @ shares

    The shares are None if all columns are independent.
    """
    Q, R, order = linalg.qr(Z[:, :n_state], mode="economic", pivoting=True, check_finite=False)
    sizes = np.abs(np.diag(R))
    rank = int(np.count_nonzero(sizes > _ROUNDING * sizes[0]))
    if rank == n_state or not np.all(np.isfinite(sizes)):
        return Z, None
    shares = np.empty((rank, n_state))
    shares[:, order] = R[:rank]
    return np.concatenate([Q[:, :rank], Z[:, n_state:]], axis=1), shares


def _combined(changes: Array, shares: Array) -> Array:
    """Columns from the integrated basis and their shares."""
    rank = len(shares)
    return np.concatenate([changes[:, :, :rank] @ shares, changes[:, :, rank:]], axis=2)


def _frictionless(touching: ContactRows, rows: Array) -> HeldRows:
    """Rows that are held by forces along themselves, without friction."""
    return HeldRows(touching.names, rows, rows, rows[:0])
