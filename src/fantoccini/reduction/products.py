"""The condition of Sec. VI: <Y_i, Y_j> in span{Y_k}, with and without taut strings.

With the kinetic energy's metric M over v = (v_D, v_K), a force on driven coordinate i accelerates
along Y_i = M^-1 e_i; with taut rows A = [A_D A_K] along X_i = P Y_i, P the M-orthogonal projection
on A v = 0. The symmetric product is <X, Y> = nabla_X Y + nabla_Y X, and with the constrained
connection P (nabla_X Y + nabla_Y X). With C(q, v) of Eq. 8 (dM/dt - 2 C skew) and multipliers mu,

    X_i = M^-1 (e_i + A^T mu_i),   A X_i = 0
    <X_i, X_j> = -P M^-1 (C(X_j)^T X_i + C(X_i)^T X_j - dA(X_j)^T mu_i - dA(X_i)^T mu_j)

which needs no difference quotient and, since C is Poincare's for joints that rotate, no coordinates
of rotations. Without strings it is the gradient of the (i, j) entry of the driven block of M^-1, so
that the condition says: that block, the inverse of M_KK - M_KD M_DD^-1 M_DK, does not change with
q_D. In words: zero momentum of the puppet stays zero, however the mechanism moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fantoccini.arrays import Array
from fantoccini.marionette import A_rate, Marionette, coriolis_full
from fantoccini.motion import State
from fantoccini.reduction.kinetic import blocks

_RANK_TOLERANCE = 1e-9
"""A singular value up to this, relative to the largest, counts as zero."""
MAX_OUTSIDE = 1e-9
"""A share outside of the span up to this counts as rounding."""


@dataclass(frozen=True, eq=False)
class Products:
    """The symmetric products of a mechanism's input fields at one configuration.

    Attributes:
        products: (n, n_vK, n_vK) <X_i, X_j> over (v_D, v_K).
        outside: (n_vK, n_vK) norm of the part of <X_i, X_j> outside of span{X_k}, in the metric of
            the kinetic energy, relative to the norms of the terms it is the sum of, 0 to 1.
    """

    products: Array
    outside: Array

    @property
    def max_outside(self) -> float:
        """The largest share outside of the span."""
        return float(np.max(self.outside, initial=0.0))


def symmetric_products(
    marionette: Marionette, x: State, inertia: Array, rows: NDArray[np.intp] | tuple[int, ...] = ()
) -> Products:
    """<X_i, X_j> for all pairs of driven coordinates, and their share outside of span{X_k}.

    Args:
        marionette: the puppet.
        x: the configuration; velocities do not matter.
        inertia: (n_vK,) reflected inertia of the drives, added to M_KK [kg or kg m^2]; one value
            for the three axes of a rotation.
        rows: taut strings; all strings are slack by default.
    """
    table, taut = marionette.coordinates, np.asarray(rows, dtype=int)
    n, k = table.n_vD + table.n_vK, table.n_vK
    M_DD, M_DK, M_KK = blocks(marionette, x)
    M = np.block([[M_DD, M_DK], [M_DK.T, M_KK + np.diag(inertia)]])
    A = np.hstack([marionette.A_D(x), marionette.A_K(x)])[taut]
    E = np.eye(n)[:, table.n_vD :]
    L = np.linalg.cholesky(M)
    free = np.linalg.solve(L, E)
    W = np.linalg.solve(L, A.T)
    mu = -np.linalg.pinv(W, rcond=_RANK_TOLERANCE) @ free
    fields = np.linalg.solve(L.T, free + W @ mu)
    C, Adot = np.zeros((k, n, n)), np.zeros((k, len(taut), n))
    for i in range(k):
        moving = x.replace(v_D=fields[: table.n_vD, i], v_K=fields[table.n_vD :, i])
        C[i] = coriolis_full(marionette.model, moving)
        if len(taut):
            Adot[i] = np.hstack(A_rate(marionette.model, moving))[taut]
    across, along = _basis(W), _basis(free + W @ mu)
    found, outside = np.zeros((n, k, k)), np.zeros((k, k))
    for i in range(k):
        for j in range(i + 1):
            terms = np.stack([
                -C[j].T @ fields[:, i], -C[i].T @ fields[:, j],
                Adot[j].T @ mu[:, i], Adot[i].T @ mu[:, j],
            ], axis=1)  # fmt: skip
            made = np.linalg.solve(L, terms)
            made = made - across @ (across.T @ made)
            whole = made.sum(axis=1)
            rest = whole - along @ (along.T @ whole)
            size = float(np.sum(np.linalg.norm(made, axis=0)))
            found[:, i, j] = found[:, j, i] = np.linalg.solve(L.T, whole)
            if size > 0.0:
                outside[i, j] = outside[j, i] = np.linalg.norm(rest) / size
    return Products(found, outside)


def _basis(columns: Array) -> Array:
    """(n, rank) orthonormal basis of the columns' span."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, s > _RANK_TOLERANCE * np.max(s, initial=0.0)] if len(s) else columns[:, :0]
