"""What the mixed model needs of taut strings: can the drives give any acceleration acc_K?

Eliminating acc_D and the multipliers, forces u_K on the driven coordinates give

    acc_K = G u_K + ...,   G = the driven block of M^-1 - M^-1 A^T (A M^-1 A^T)^-1 A M^-1

G is positive definite if and only if no y has A_D^T y = 0 and A_K^T y != 0; none has where A_D has
full row rank. Such a y is a set of tensions that the puppet does not feel and the drives do: its
strings tie drives to one another. Where y may be chosen with y >= 0, the drives can pull against
one another, and some of their motions have no tension that allows them; where its signs differ, one
of the strings goes slack instead, and the mode changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.reduction.kinetic import blocks

_TIED = 1e-9
"""Singular value of the scaled A_D that counts as none."""


@dataclass(frozen=True)
class Tracking:
    """The drives' accelerations with some strings taut.

    Attributes:
        strings: names of the taut strings.
        spread: smallest singular value of F^-T A_D^T with columns of length 1: 1 where the strings
            accelerate the puppet at right angles to one another, 0 where they depend on each other.
        least: smallest eigenvalue of D G D, D^2 the diagonal of M_KK with the drives' inertia: the
            part of its acceleration that a drive keeps.
        tied: strings that tie drives to one another; empty where G is regular.
        pulls_apart: the drives can pull the tied strings against one another.
    """

    strings: tuple[str, ...]
    spread: float
    least: float
    tied: tuple[str, ...]
    pulls_apart: bool


def tracking(marionette: Marionette, x: State, inertia: Array, rows: Array) -> Tracking:
    """The map from drive forces to drive accelerations with some strings taut.

    Args:
        marionette: the puppet.
        x: a configuration in which the rows are at their length.
        inertia: (n_vK,) reflected inertia of the drives, added to M_KK [kg or kg m^2].
        rows: taut strings.
    """
    n = marionette.coordinates.n_vD
    M_DD, M_DK, M_KK = blocks(marionette, x)
    M = np.block([[M_DD, M_DK], [M_DK.T, M_KK + np.diag(inertia)]])
    A_D, A_K = marionette.A_D(x)[rows], marionette.A_K(x)[rows]
    W = np.linalg.solve(np.linalg.cholesky(M_DD), A_D.T)
    W = W / np.maximum(np.linalg.norm(W, axis=0), 1e-300)
    # M^-1 - M^-1 A^T (A M^-1 A^T)^-1 A M^-1 over the null space of A.
    _, s, V = np.linalg.svd(np.hstack([A_D, A_K]))
    N = V[int(np.sum(s > _TIED * np.max(s, initial=0.0))) :].T
    G = (N @ np.linalg.solve(N.T @ M @ N, N.T))[n:, n:]
    D = np.sqrt(np.diag(M)[n:])
    tied, apart = _ties(A_D, A_K)
    names = [marionette.tree.strings[i].name for i in rows]
    return Tracking(
        tuple(names),
        float(np.linalg.svd(W, compute_uv=False)[-1]) if W.shape[0] >= W.shape[1] else 0.0,
        float(np.linalg.eigvalsh(D[:, None] * G * D)[0]) if len(D) else 1.0,
        tuple(n for n, part in zip(names, tied, strict=True) if part),
        apart,
    )


def _ties(A_D: Array, A_K: Array) -> tuple[Array, bool]:
    """(n,) bool: rows in some y with A_D^T y = 0 and A_K^T y != 0; whether a y >= 0 is among them.

    Rows count with the size of their [A_D A_K].
    """
    size = np.maximum(np.linalg.norm(np.hstack([A_D, A_K]), axis=1), 1e-300)[:, None]
    A_D, A_K = A_D / size, A_K / size
    U, s, _ = np.linalg.svd(A_D)
    rank = int(np.sum(s > _TIED * np.max(s, initial=0.0)))
    null = U[:, rank:]
    felt = null @ np.linalg.svd(A_K.T @ null)[2].T if null.shape[1] else null
    felt = felt[:, np.linalg.norm(A_K.T @ felt, axis=0) > _TIED]
    tied = np.linalg.norm(felt, axis=1) > 1e-6
    if not np.any(tied):
        return tied, False
    # y >= 0 with A_D^T y = 0 that the drives feel: least squares over y >= 0 with a sum of 1.
    B = np.vstack([A_D[tied].T, np.ones(int(tied.sum()))])
    y, left = nnls(B, np.append(np.zeros(A_D.shape[1]), 1.0))
    return tied, bool(left < 1e-9 and np.linalg.norm(A_K[tied].T @ y) > _TIED)
