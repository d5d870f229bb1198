"""The mixed model's condition on taut strings: the drives can give any acceleration acc_K.

Eliminating acc_D and the multipliers, forces u_K on the driven coordinates give

    acc_K = G u_K + ...,   G = the driven block of M^-1 - M^-1 A^T (A M^-1 A^T)^-1 A M^-1

G is positive definite if and only if no y has A_D^T y = 0 and A_K^T y != 0; there is none if A_D
has full row rank. Such a y is a set of tensions that load the drives but not the puppet: its
strings tie drives to one another. If there is one with y >= 0, the drives can pull against one
another, and some of their motions are impossible; if its signs differ, one of the strings goes
slack instead, and the active set changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.reduction.kinetic import blocks


@dataclass(frozen=True)
class _Tolerances:
    """What counts as zero; rows of A are scaled to length 1.

    Attributes:
        rank: a singular value, relative to the largest, and a drive's load.
        tied: a string's part in the null space of A_D^T.
        residual: of the non-negative least squares.
        norm: keeps a division by a zero row finite.
    """

    rank: float = 1e-9
    tied: float = 1e-6
    residual: float = 1e-9
    norm: float = 1e-300


_ZERO = _Tolerances()


@dataclass(frozen=True)
class Tracking:
    """The drives' accelerations with some strings taut.

    Attributes:
        min_singular_value: of F^-T A_D^T with columns of length 1: 1 if the strings accelerate the
            puppet at right angles to one another, 0 if they are linearly dependent.
        min_acceleration: smallest eigenvalue of D G D, D^2 the diagonal of M_KK with the drives'
            inertia: the share of its acceleration that a drive keeps.
        tied: strings that tie drives to one another; empty if G is regular.
        pulls_apart: the drives can pull the tied strings against one another.
    """

    min_singular_value: float
    min_acceleration: float
    tied: tuple[str, ...]
    pulls_apart: bool


def tracking(marionette: Marionette, x: State, inertia: Array, rows: NDArray[np.intp]) -> Tracking:
    """The map G from drive forces to drive accelerations, with some strings taut.

    Args:
        marionette: the puppet.
        x: a configuration in which these strings are at their length.
        inertia: (n_vK,) reflected inertia of the drives, added to M_KK [kg or kg m^2].
        rows: taut strings.
    """
    n = marionette.coordinates.n_vD
    M_DD, M_DK, M_KK = blocks(marionette, x)
    M = np.block([[M_DD, M_DK], [M_DK.T, M_KK + np.diag(inertia)]])
    A_D, A_K = marionette.A_D(x)[rows], marionette.A_K(x)[rows]
    W = np.linalg.solve(np.linalg.cholesky(M_DD), A_D.T)
    W = W / np.maximum(np.linalg.norm(W, axis=0), _ZERO.norm)
    # M^-1 - M^-1 A^T (A M^-1 A^T)^-1 A M^-1 over the null space of A.
    _, s, V = np.linalg.svd(np.hstack([A_D, A_K]))
    N = V[int(np.sum(s > _ZERO.rank * np.max(s, initial=0.0))) :].T
    G = (N @ np.linalg.solve(N.T @ M @ N, N.T))[n:, n:]
    D = np.sqrt(np.diag(M)[n:])
    tied, pulls_apart = _ties(A_D, A_K)
    names = [marionette.tree.strings[i].name for i in rows]
    return Tracking(
        float(np.linalg.svd(W, compute_uv=False)[-1]) if W.shape[0] >= W.shape[1] else 0.0,
        float(np.linalg.eigvalsh(D[:, None] * G * D)[0]) if len(D) else 1.0,
        tuple(n for n, part in zip(names, tied, strict=True) if part),
        pulls_apart,
    )


def _ties(A_D: Array, A_K: Array) -> tuple[NDArray[np.bool_], bool]:
    """(n,) mask of rows in a y with A_D^T y = 0, A_K^T y != 0; whether some such y is >= 0."""
    size = np.maximum(np.linalg.norm(np.hstack([A_D, A_K]), axis=1), _ZERO.norm)[:, None]
    A_D, A_K = A_D / size, A_K / size
    U, s, _ = np.linalg.svd(A_D)
    rank = int(np.sum(s > _ZERO.rank * np.max(s, initial=0.0)))
    null = U[:, rank:]
    loads = null @ np.linalg.svd(A_K.T @ null)[2].T if null.shape[1] else null
    loads = loads[:, np.linalg.norm(A_K.T @ loads, axis=0) > _ZERO.rank]
    tied = np.linalg.norm(loads, axis=1) > _ZERO.tied
    if not np.any(tied):
        return tied, False
    # y >= 0 with A_D^T y = 0 and a sum of 1, by least squares.
    B = np.vstack([A_D[tied].T, np.ones(int(tied.sum()))])
    y, residual = nnls(B, np.append(np.zeros(A_D.shape[1]), 1.0))
    return tied, bool(residual < _ZERO.residual and np.linalg.norm(A_K[tied].T @ y) > _ZERO.rank)
