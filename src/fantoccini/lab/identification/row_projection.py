"""First states of segments, kept on the strings and limits that hold them.

A state off a taut string would begin with a jerk. So a move of a first state is followed by the
smallest one, of configuration and then of velocity, after which

    h = 0,  hdot = 0   on rows that hold,        h <= 0,  hdot <= 0   on the others
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import integrate

_CLOSED = 1e-8
"""Gap, in the row's unit, up to which a row is closed."""
_STILL = 1e-7
"""Speed of a gap up to which a closed row stays closed, in the row's unit per second."""
_NEAR = 2e-5
"""Gap up to which a row of a time step counts as closed: what the steps leave."""
_ROUNDS = 8
_ROUNDING = 1e-10
"""Part of the rows' own sizes by which redundant rows are told apart."""


class Rows(NamedTuple):
    """Gaps of S states, their rates and derivatives; (S, n_rows, ...)."""

    h: Array
    hdot: Array
    by: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Holding:
    """S states with the driven coordinates at their times.

    Attributes:
        marionette: the puppet.
        q_K, v_K: (S, ...).
        p: (n_p,).
    """

    marionette: Marionette
    q_K: Array
    v_K: Array
    p: Array

    def rows(self, q_D: Array, v_D: Array) -> Rows:
        """The rows of states (S, ...)."""
        marionette, p = self.marionette, np.broadcast_to(self.p, (len(q_D), len(self.p)))
        values = {"q_D": q_D, "v_D": v_D, "q_K": self.q_K, "v_K": self.v_K, "p": p}
        values |= {"acc_D": np.zeros_like(v_D), "acc_K": np.zeros_like(self.v_K)}
        by = marionette.libraries.derivatives.at("rows_by", values)
        h = next(iter(marionette.library.at("rows", values).values()))
        rate = (by["A_D"] @ v_D[..., None] + by["A_K"] @ self.v_K[..., None])[..., 0]
        return Rows(h, rate, by)

    def closed(self, q_D: Array, v_D: Array) -> MaskRows:
        """(S, n_rows) bool, the rows that are closed and do not open."""
        found = self.rows(q_D, v_D)
        closed = (found.h >= -_CLOSED) & (found.hdot >= -_STILL)
        return np.asarray(closed | self.marionette.two_sided)

    def near(self, q_D: Array, v_D: Array) -> MaskRows:
        """(S, n_rows) bool, the rows that are all but closed."""
        return np.asarray((self.rows(q_D, v_D).h >= -_NEAR) | self.marionette.two_sided)

    def slack(self, q_D: Array, v_D: Array) -> MaskRows:
        """(S, n_rows) bool, the rows that are open."""
        return np.asarray((self.rows(q_D, v_D).h < -_NEAR) & ~self.marionette.two_sided)

    def some(self, chosen: MaskRows | Indices) -> Holding:
        """Some of the states."""
        return Holding(self.marionette, self.q_K[chosen], self.v_K[chosen], self.p)

    def project(self, q_D: Array, v_D: Array, held: MaskRows) -> tuple[Array, Array]:
        """The states moved onto the rows that hold them, and off those that they violate."""
        q_D, v_D = q_D.copy(), v_D.copy()
        left = np.arange(len(q_D))
        for _ in range(_ROUNDS):
            found = self.some(left).rows(q_D[left], v_D[left])
            active = held[left] | (found.h > 0.0)
            off = np.where(active, found.h, 0.0)
            by = _nearest(found.by["A_D"], off, active)
            q_D[left] = integrate(self.marionette, q_D[left], -by)
            left = left[np.max(np.abs(off), axis=1, initial=0.0) >= 0.01 * _CLOSED]
            if len(left) == 0:
                break
        found = self.rows(q_D, v_D)
        left = np.arange(len(q_D))
        for _ in range(_ROUNDS):
            A_D, A_K = found.by["A_D"][left], found.by["A_K"][left]
            rate = (A_D @ v_D[left, :, None] + A_K @ self.v_K[left, :, None])[..., 0]
            active = held[left] | ((found.h[left] >= -_CLOSED) & (rate > 0.0))
            off = np.where(active, rate, 0.0)
            v_D[left] -= _nearest(A_D, off, active)
            left = left[np.max(np.abs(off), axis=1, initial=0.0) >= 0.01 * _STILL]
            if len(left) == 0:
                break
        return q_D, v_D

    def moves(
        self, q_D: Array, v_D: Array, held: MaskRows, of_p: list[int], of_K: list[int]
    ) -> Array:
        """(S, 2 n_vD, 2 n_vD + P) how projected states move, by their own moves and by unknowns."""
        by = self.rows(q_D, v_D).by
        n = v_D.shape[1]
        width = 2 * n + len(of_p) + len(of_K)
        Z = np.zeros((len(q_D), 2 * n, width))
        Z[:] = np.eye(2 * n, width)
        own = np.concatenate([by["h_p"][..., of_p], by["A_K"][..., of_K]], axis=-1)
        gap = by["A_D"] @ Z[:, :n]
        gap[..., 2 * n :] += own
        Z[:, :n] -= _nearest(by["A_D"], gap, held)
        rate = by["hdot_q"] @ Z[:, :n] + by["A_D"] @ Z[:, n:]
        rate[..., 2 * n :] += np.concatenate(
            [by["hdot_p"][..., of_p], by["hdot_qK"][..., of_K]], axis=-1
        )
        Z[:, n:] -= _nearest(by["A_D"], rate, held)
        return Z


def _nearest(A: Array, off: Array, active: MaskRows) -> Array:
    """The smallest dx (S, n[, m]) with A dx = off on the active rows of every state."""
    flat = off.ndim == 2
    off = off[..., None] if flat else off
    own = np.where(active[..., None], A, 0.0)
    G = own @ own.swapaxes(-1, -2)
    size = np.trace(G, axis1=1, axis2=2)[:, None] + 1.0
    G += np.where(active, _ROUNDING * size, 1.0)[..., None] * np.eye(G.shape[1])
    found = own.swapaxes(-1, -2) @ np.linalg.solve(G, np.where(active[..., None], off, 0.0))
    return np.asarray(found[..., 0] if flat else found)
