"""Accelerations and their derivatives at many states at once, each with its rows held.

    M acc_D + A_D^T tension = f,   A_D acc_D = -gamma      over the held rows
    M dacc_D + A_D^T dtension = -r_d,   A_D dacc_D = -hddot_d

as :func:`fantoccini.marionette.linearisation.linearise` has them for one state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.marionette.linearisation import turning

_DEPENDENT = 1e-14
"""Eigenvalue of A_D M^-1 A_D^T, relative to the largest, below which rows depend on one another."""


@dataclass(frozen=True, eq=False)
class FrozenModes:
    """The motion at m states while the rows held there stay.

    Attributes:
        acc_D: (m, n_vD) accelerations.
        A: (m, n_z, n_z) of zdot = A z + B dacc_K.
        B: (m, n_z, n_vK).
        pull: (m, n_rows, n_z + n_vK) derivatives of the tensions, 0 where rows are not held.
    """

    acc_D: Array
    A: Array
    B: Array
    pull: Array

    @classmethod
    def at(
        cls, marionette: Marionette, q_D: Array, v_D: Array, q_K: Array, v_K: Array,
        acc_K: Array, held: MaskRows,
    ) -> FrozenModes:  # fmt: skip
        """At states (m, ...), with the rows (m, n_rows) that are held."""
        model, table, tree = marionette.model, marionette.coordinates, marionette.tree
        library, m, n, k = model.library, len(q_D), table.n_vD, table.n_vK
        values: dict[str, Array | float] = {
            "q_D": q_D, "v_D": v_D, "q_K": q_K, "v_K": v_K, "acc_K": acc_K, "p": model.p,
        }  # fmt: skip
        on = library.evaluate("dynamics", **values, u_D=np.zeros(n))
        L = on.L[:, None]
        J = np.zeros((m, len(tree.limits), n))
        for i, limit in enumerate(tree.limits):
            place = tree.links[limit.link].v
            J[:, i, place] = on.J_limit[:, : place.stop - place.start, i]
        W = np.concatenate([on.W, library.evaluate("forth", L=L, x=J).y.swapaxes(1, 2)], axis=2)
        W = np.where(held[:, None], W, 0.0)
        gamma = np.concatenate([on.gamma, on.gamma_limit], axis=1)
        G = np.linalg.pinv(W.swapaxes(1, 2) @ W, rcond=_DEPENDENT, hermitian=True)
        rate = np.where(held, gamma, 0.0)[..., None]
        tension = G @ (W.swapaxes(1, 2) @ on.w0[..., None] + rate)
        acc_D = library.evaluate("back", L=on.L, x=on.w0 - (W @ tension)[..., 0]).y
        values |= {"acc_D": acc_D, "tension": tension[..., 0], "dt": 0.0}
        found: dict[str, Array] = {}
        for name in ("force_by_q", "force_by_v", "force_by_K", "rows_by"):
            found |= model.compiled.derivatives.at(name, values)
        force = [found[name] for name in ("r_q", "r_v", "r_qK", "r_vK", "M_DK")]
        rates = [found[name] for name in ("hddot_q", "hddot_v", "hddot_qK", "hddot_vK", "A_K")]
        rate = np.where(held[..., None], np.concatenate(rates, axis=2), 0.0)
        columns = np.concatenate(force, axis=2).swapaxes(1, 2)
        w = -library.evaluate("forth", L=L, x=columns).y.swapaxes(1, 2)
        pull = G @ (W.swapaxes(1, 2) @ w + rate)
        left = (w - W @ pull).swapaxes(1, 2)
        dacc = library.evaluate("back", L=L, x=left).y.swapaxes(1, 2)
        A, B = np.zeros((m, 2 * (n + k), 2 * (n + k))), np.zeros((m, 2 * (n + k), k))
        A[:, :n, :n] = _turning(table.quaternions_D, v_D)
        A[:, :n, n : 2 * n] = np.eye(n)
        A[:, n : 2 * n], B[:, n : 2 * n] = dacc[..., : 2 * (n + k)], dacc[..., 2 * (n + k) :]
        A[:, 2 * n : 2 * n + k, 2 * n : 2 * n + k] = _turning(table.quaternions_K, v_K)
        A[:, 2 * n : 2 * n + k, 2 * n + k :] = np.eye(k)
        B[:, 2 * n + k :] = np.eye(k)
        return cls(acc_D, A, B, pull)


def _turning(quaternions: tuple[tuple[int, int], ...], v: Array) -> Array:
    """(m, n_v, n_v) -[w]x of every rotation, at m velocities."""
    if not quaternions:
        return np.zeros((v.shape[1], v.shape[1]))
    return np.stack([turning(quaternions, one) for one in v])
