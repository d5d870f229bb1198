"""Derivatives of many steps of the variational integrator, by the implicit function theorem.

With Lambda over the rows at their bound after the step, and mu over those that are held at its
end (``cpp/fantoccini/variational/step.hpp``, ``variational/node.hpp``):

    M v + M_DK v_K - A_D(q)^T Lambda = p_k(xi),          h(q_k+1, q_K) = 0
    M v + M_DK v_K + A_D^T mu = p_k+1(xi)  at the end,   hdot = 0

The first line gives xi and Lambda, the second the velocity at the end and mu. A step that was
divided into parts solves neither, and is not settled.

xi is the move of q_D in a step, p_k and p_k+1 are the momenta at its start and end. q_D are dynamic
and q_K driven coordinates; a row is a string or a joint limit, and A_D its derivatives by q_D.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from fantoccini.base import N_COEF, Array, Indices, MaskRows, StateError, Status, rotation
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.kernel.runtime import Batch

MAX_CLOSED_GAP = 1e-9
"""Largest -h of a row that is at its bound after a step [m or rad]."""
IMPULSE_ROUNDING = 1e-9
"""Impulse that counts as zero, relative to the weight times the step."""
MAX_RESIDUAL = 1e-8
"""Residual of momenta, relative to the largest, above which a step was divided into parts."""
DEPENDENT_ROWS = 1e-9
"""Singular value, relative to the largest, below which rows depend on one another."""


@dataclass(frozen=True, eq=False)
class VariationalPartials:
    """Derivatives of n steps, with columns for q_D, v_D, q_K, v_K, acc_K, u_D and p.

    Attributes:
        end: q_D, v_D, q_K and v_K after the steps, (n, ...) each.
        tension: (n, n_rows) impulses over dt [N or N m].
        motion: (n, 2 n_vD, m) derivatives of (dq_D, v_D) after the steps.
        pull: (n, n_rows, m) derivatives of the tensions.
        held: (n, n_rows) rows with an impulse in the step or at its end.
        solved: (n,) whether the steps were not divided.
    """

    end: dict[str, Array]
    tension: Array
    motion: Array
    pull: Array
    held: MaskRows
    solved: MaskRows


def variational_partials(
    marionette: CompiledPuppet,
    x: Mapping[str, Array],
    acc_K: Array,
    u_D: Array | None,
    p: Array,
    dt: float,
    threads: int,
) -> VariationalPartials:
    """n steps and their derivatives.

    Args:
        marionette: the puppet.
        x: q_D, v_D, q_K and v_K before the steps, (n, ...) each.
        acc_K: (1 or n, n_vK) driven accelerations.
        u_D: (1 or n, n_vD) user forces; None for none.
        p: (1 or n, n_p) parameters.
        dt: length of the steps [s].
        threads: number of threads that share the steps.

    Raises:
        StateError: a driven joint turns, which is not supported.
    """
    t = marionette.coordinates
    if t.quaternions_K:
        raise StateError("variational steps with driven rotations are not differentiated")
    n, n_v, n_k = len(x["q_D"]), t.n_vD, t.n_vK
    acc = np.broadcast_to(acc_K, (n, n_k))
    force = np.zeros((n, n_v)) if u_D is None else np.broadcast_to(u_D, (n, n_v))
    values = np.broadcast_to(p, (n, p.shape[1]))
    batch = _time_steps(marionette, x, acc, force, values, dt, threads)
    end = {
        "q_D": batch.end_q_D,
        "v_D": batch.end_v_D,
        "q_K": x["q_K"].copy(),
        "v_K": x["v_K"] + dt * acc,
    }
    rate = x["v_K"] + 0.5 * dt * acc
    mid_q_K = x["q_K"].copy()
    for q, v in t.scalars_K:
        mid_q_K[:, q] += 0.5 * dt * rate[:, v]
        end["q_K"][:, q] += dt * rate[:, v]
    library, n_rows = marionette.libraries.variational_derivatives, marionette.tree.n_rows
    midpoint = library.evaluate(
        "midpoint_by",
        q_D=x["q_D"],
        xi=_steps(marionette, x["q_D"], end["q_D"]),
        q_mid=mid_q_K,
        v_mid=rate,
        acc_mid=acc,
        u_D=force,
        dt=dt,
        p=values,
    )
    start_rates = library.evaluate("row_rates_by", p=values, **x)
    end_rates = library.evaluate("row_rates_by", p=values, **end)
    h = marionette.library.evaluate("rows", q_D=end["q_D"], q_K=end["q_K"], p=values).h
    closed = marionette.two_sided | (h > -MAX_CLOSED_GAP)
    rows_near = np.flatnonzero(np.any(closed, axis=0))  # rows closed after any of the steps
    start_rates, end_rates = (
        _rows_of(row_rates, rows_near) for row_rates in (start_rates, end_rates)
    )
    closed, wires = closed[:, rows_near], marionette.two_sided[rows_near]
    zero_impulse = IMPULSE_ROUNDING * dt * marionette.reference_force
    start_momenta, end_momenta = (
        library.evaluate("momenta", p=values, **at).p_D for at in (x, end)
    )
    size = np.max(np.abs(start_momenta), axis=1, initial=0.0)
    Lambda, residual = _impulses(start_rates.A_D, closed, start_momenta - midpoint.before)
    mu, end_residual = _impulses(end_rates.A_D, closed, midpoint.after - end_momenta)
    solved = np.maximum(residual, end_residual) <= MAX_RESIDUAL * size + zero_impulse
    has_impulse = closed & (wires | (np.abs(Lambda) > zero_impulse))
    has_end_impulse = closed & (wires | (np.abs(mu) > zero_impulse))

    def spread(values: Array) -> Array:
        all_rows = np.zeros((n, n_rows, *values.shape[2:]), dtype=values.dtype)
        all_rows[:, rows_near] = values
        return all_rows

    before = library.evaluate("momenta_by", p=values, tension=spread(-Lambda), **x)
    after = library.evaluate("momenta_by", p=values, tension=spread(mu), **end)

    columns = _Columns(n_v, n_k, values.shape[1], dt)
    start_by = columns.of_inputs(before.e_qK, before.M_DK, None, before.e_p)
    start_by[..., :n_v] = before.e_q - midpoint.before_q
    start_by[..., n_v : 2 * n_v] = before.M
    start_by -= columns.of_middle(midpoint, "before")
    gap_by = columns.of_end(end_rates.A_K, None, end_rates.h_p)
    gap_by[..., :n_v] = end_rates.A_D @ midpoint.next_q
    xi_by, Lambda_by = _solve_held(
        midpoint.before_xi,
        start_rates.A_D,
        end_rates.A_D @ midpoint.next_xi,
        has_impulse,
        start_by,
        -gap_by,
    )
    dq = midpoint.next_xi @ xi_by
    dq[..., :n_v] += midpoint.next_q
    momenta_by = columns.of_middle(midpoint, "after") + midpoint.after_xi @ xi_by
    momenta_by[..., :n_v] += midpoint.after_q
    momenta_by -= after.e_q @ dq + columns.of_end(after.e_qK, after.M_DK, after.e_p)
    hdot_by = end_rates.hdot_q @ dq + columns.of_end(
        end_rates.hdot_qK, end_rates.A_K, end_rates.hdot_p
    )
    dv, mu_by = _solve_held(
        after.M, end_rates.A_D, end_rates.A_D, has_end_impulse, momenta_by, -hdot_by
    )
    return VariationalPartials(
        end=end,
        tension=spread(Lambda * has_impulse + mu * has_end_impulse) / dt,
        motion=np.concatenate([dq, dv], axis=1),
        pull=spread(Lambda_by + mu_by) / dt,
        held=spread(has_impulse | has_end_impulse).astype(np.bool_),
        solved=solved & (batch.status == Status.DONE),
    )


def _time_steps(
    marionette: CompiledPuppet,
    x: Mapping[str, Array],
    acc_K: Array,
    u_D: Array,
    p: Array,
    dt: float,
    threads: int,
) -> Batch:
    """Batch of the steps, after its run."""
    n, t, table = len(acc_K), marionette.coordinates, marionette.tree
    coef, force = np.zeros((n, 1, t.n_vK, N_COEF)), np.zeros((n, 1, t.n_vD, N_COEF))
    for q, v in t.scalars_K:
        coef[:, 0, v, 0] = x["q_K"][:, q]
    coef[:, 0, :, 1], coef[:, 0, :, 2], force[:, 0, :, 0] = x["v_K"], 0.5 * acc_K, u_D
    lane_batch = Batch(
        library=marionette.libraries.variational_lanes,
        n=n,
        t=0.0,
        t_end=dt,
        q_D=x["q_D"],
        v_D=x["v_D"],
        slip=np.zeros((1, len(table.strings))),
        breaks=np.array([[0.0, dt]]),
        coef=coef,
        base=x["q_K"][:, None],
        force=force,
        p=p,
        winches=marionette.winches,
        options=marionette.run_options(dt=dt),
        times=np.zeros(2),
        parts={},
    )
    lane_batch.run(threads)
    return lane_batch


@dataclass(frozen=True)
class _Columns:
    """Columns for q_D, v_D, q_K, v_K, acc_K, u_D and p."""

    n_v: int
    n_k: int
    n_p: int
    dt: float

    def _blank(self, like: Array) -> tuple[Array, list[slice]]:
        widths = [self.n_v, self.n_v, self.n_k, self.n_k, self.n_k, self.n_v, self.n_p]
        ends = np.cumsum([0, *widths]).tolist()
        out = np.zeros((*like.shape[:-1], ends[-1]))
        return out, [slice(a, b) for a, b in pairwise(ends)]

    def of_inputs(
        self, by_q: Array, by_v: Array | None, by_acc: Array | None, by_p: Array
    ) -> Array:
        """Derivatives of a quantity that depends on q_K, v_K, acc_K at the start, and on p."""
        out, (_, _, q, v, acc, _, p) = self._blank(by_q)
        out[..., q], out[..., p] = by_q, by_p
        if by_v is not None:
            out[..., v] = by_v
        if by_acc is not None:
            out[..., acc] = by_acc
        return out

    def of_end(self, by_q: Array, by_v: Array | None, by_p: Array) -> Array:
        """Derivatives of a quantity that depends on q_K and v_K after the step, and on p."""
        dt, by_v_or_zero = self.dt, 0.0 if by_v is None else by_v
        return self.of_inputs(
            by_q, dt * by_q + by_v_or_zero, 0.5 * dt * dt * by_q + dt * by_v_or_zero, by_p
        )

    def of_middle(self, midpoint: object, end: str) -> Array:
        """Derivatives of the midpoint's momenta by inputs, forces and parameters."""
        dt = self.dt
        by_q, by_v, by_acc, by_u, by_p = (
            getattr(midpoint, f"{end}_{name}") for name in ("qm", "vm", "am", "u", "p")
        )
        out = self.of_inputs(
            by_q, 0.5 * dt * by_q + by_v, 0.25 * dt * dt * by_q + 0.5 * dt * by_v + by_acc, by_p
        )
        first = 2 * self.n_v + 3 * self.n_k
        out[..., first : first + self.n_v] = by_u
        return out


def _rows_of(row_rates: SimpleNamespace, rows: Indices) -> SimpleNamespace:
    """Selected rows of the results of ``row_rates_by``."""
    return SimpleNamespace(**{name: a[:, rows] for name, a in vars(row_rates).items()})


def _steps(marionette: CompiledPuppet, q: Array, end: Array) -> Array:
    """Vectors xi (n, n_vD) between configurations (n, n_qD): rotations by 4 atan |xi/4|."""
    t = marionette.coordinates
    steps = np.zeros((len(q), t.n_vD))
    for i, v in t.scalars_D:
        steps[:, v] = end[:, i] - q[:, i]
    for i, v in t.quaternions_D:
        rotation_vector = rotation.between(q[:, i : i + 4], end[:, i : i + 4])
        angle = np.linalg.norm(rotation_vector, axis=-1, keepdims=True)
        is_small = angle < 1e-6
        scale = np.where(is_small, 1.0, 4.0 * np.tan(0.25 * angle) / np.where(is_small, 1.0, angle))
        steps[:, v : v + 3] = scale * rotation_vector
    return steps


def _impulses(A_D: Array, active: MaskRows, momenta: Array) -> tuple[Array, Array]:
    """Impulses y (n, n_rows) with A_D^T y = momenta over some rows, and largest residuals (n,)."""
    A = np.swapaxes(A_D * active[..., None], 1, 2)
    y = (np.linalg.pinv(A, rcond=DEPENDENT_ROWS) @ momenta[..., None])[..., 0] * active
    remaining = momenta - (A @ y[..., None])[..., 0]
    return y, np.max(np.abs(remaining), axis=1, initial=0.0)


def _solve_held(
    M: Array, forces: Array, rows: Array, active: MaskRows, right_side: Array, rates: Array
) -> tuple[Array, Array]:
    """Solution x, y of M x + forces^T y = right, rows x = rates over some rows; other y are 0."""
    k, n_v = active.shape[1], M.shape[1]
    mask = active[..., None].astype(float)
    K = np.zeros((len(M), n_v + k, n_v + k))
    K[:, :n_v, :n_v] = M
    K[:, :n_v, n_v:] = np.swapaxes(forces * mask, 1, 2)
    K[:, n_v:, :n_v] = rows * mask
    K[:, n_v:, n_v:] = (1.0 - mask) * np.eye(k)
    right_sides = np.concatenate([right_side, rates * mask], axis=1)
    is_dependent = np.linalg.matrix_rank(forces * mask, rtol=DEPENDENT_ROWS) < np.sum(
        active, axis=1
    )
    out = np.empty_like(right_sides)
    out[~is_dependent] = np.linalg.solve(K[~is_dependent], right_sides[~is_dependent])
    for i in np.flatnonzero(is_dependent):
        out[i] = np.linalg.lstsq(K[i], right_sides[i], rcond=DEPENDENT_ROWS)[0]
    return out[:, :n_v], out[:, n_v:]
