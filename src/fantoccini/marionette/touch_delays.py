"""Groups of bodies that spring back within a fixed step, and when they are struck.

A group moves on as it did until the first of its points that spring back touches, and with the
velocities after the step for the rest of it (``cpp/fantoccini/contact_rebounds.hpp``):

    q+ = q moved by dt w,   w = v+ + s (v - v+),   s = gap / (-u_n dt)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from fantoccini.arrays import Array, Indices
from fantoccini.marionette.contact_rows import ContactRows, HeldPoint
from fantoccini.marionette.screws import Screws, relations
from fantoccini.tree import WORLD, Tree

TIED = 1e-9
"""Difference between shares of a step that is rounding."""


@dataclass(frozen=True, eq=False)
class TouchDelays:
    """Which velocities wait for which point.

    Attributes:
        share: (n_vD,) part of the step for which they do.
        first: (n_vD,) index of the point, or -1.
        tied: indices of points that touch at the same time as the first of their group.
        later: indices of points that spring back after it.
    """

    share: Array
    first: Indices
    tied: tuple[int, ...] = ()
    later: tuple[int, ...] = ()

    def of_links(self, moves: Array, links: tuple[int, int]) -> float:
        """The share of what moves one of two links."""
        moved = _moved(moves, links)[: len(self.share)]
        found = self.share[(moved > 0.0) & (self.share != 0.0)]
        return float(found[0]) if len(found) else 0.0

    def mean_velocity(self, v: Array, v_next: Array) -> Array:
        """(n_vD,) w."""
        return v_next + self.share * (v - v_next)

    def mean_velocity_by(
        self, before: Screws, points: Sequence[HeldPoint], change: Array, dt: float
    ) -> Array:
        """(n_vD, m) part of the changes of w that is by those of s.

        Args:
            before: links at the start of the step.
            points: those that push.
            change: (n_vD,) v - v+.
            dt: the step [s].
        """
        rows = ContactRows(before, points, 0.0)
        u_n, gap_by = rows.normal_speed(), -rows.gap_by()
        out = np.zeros((len(change), gap_by.shape[1]))
        for k in np.flatnonzero((self.share > 0.0) & (self.share < 1.0)):
            i, s = self.first[k], self.share[k]
            by = -(gap_by[i] / dt + s * rows.normal_speed_by()[i]) / u_n[i]
            out[k] = change[k] * by
        return out


def touch_delays(
    tree: Tree, links: Sequence[tuple[int, int]], shares: Sequence[float | None]
) -> TouchDelays:
    """Delays by points that push, of given links and shares s; None where nothing springs back."""
    moves, n = relations(tree)[0], tree.coordinates.n_vD
    share, first = np.zeros(n), np.full(n, -1)
    if all(s is None for s in shares):
        return TouchDelays(share, first)
    sets = [moves[:, :n], [_of_string(tree, moves, i)[:n] for i in range(len(tree.strings))]]
    sets.append([_moved(moves, one)[:n] for one in links])
    joined = np.concatenate([np.reshape(one, (-1, n)) for one in sets])
    group = connected_components((joined.T @ joined) > 0.0, directed=False)[1]
    tied: list[int] = []
    later: list[int] = []
    for g in range(group.max(initial=-1) + 1):
        mine = [
            i for i, one in enumerate(links)
            if shares[i] is not None and np.any(group[_moved(moves, one)[:n] > 0.0] == g)
        ]  # fmt: skip
        times = {i: float(s) for i in mine if (s := shares[i]) is not None}
        if not times:
            continue
        i = min(times, key=times.__getitem__)
        later += [j for j in times if times[j] - times[i] >= TIED]
        share[group == g], first[group == g] = times[i], i
        tied += [j for j in times if j != i and times[j] - times[i] < TIED]
    return TouchDelays(share, first, tuple(tied), tuple(later))


def _moved(moves: Array, links: tuple[int, int]) -> Array:
    """(n,) 1 for the velocities that move one of two links."""
    ours = [moves[link] for link in links if link != WORLD]
    return np.max(ours, axis=0) if ours else np.zeros(moves.shape[1])


def _of_string(tree: Tree, moves: Array, i: int) -> Array:
    """(n,) 1 for the velocities that move points of a string, or wind it."""
    string = tree.strings[i]
    out = np.max(
        [moves[p.link] for p in string.points if p.link != WORLD] or [0.0 * moves[0]], axis=0
    )
    if string.wound_length:
        out = out.copy()
        out[string.wound_length[1]] = 1.0
    return np.asarray(out)
