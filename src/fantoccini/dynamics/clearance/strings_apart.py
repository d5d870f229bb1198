"""StringsApart: distances of strings from one another and from bodies, along a motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import (
    Array,
    Indices,
    MaskRows,
    StateError,
    Times,
    check_not_negative,
    check_positive,
)
from fantoccini.dynamics.clearance import solids
from fantoccini.dynamics.clearance.blocks import search
from fantoccini.dynamics.clearance.cores import Cores
from fantoccini.dynamics.clearance.meshes import Meshes
from fantoccini.dynamics.clearance.path import Path
from fantoccini.dynamics.clearance.string_pairs import Kind, StringPairs, string_pairs
from fantoccini.dynamics.clearance.winding import Crossing, Winding, crossings, windings
from fantoccini.dynamics.marionette import Marionette

_DISTANCE_TOLERANCE = 1e-5
"""Smallest improvement of a least distance for which a nearer sample is searched [m]."""
_MAX_MOVE, _MAX_MOVE_RATIO = 1e-4, 0.02
"""Largest move that is not refined further [m], and its ratio to the distance."""
_AT_SAMPLE = -1.0
"""Placeholder for the time after a sample, meaning the sample itself [s]."""
_MIN_STEP_RATIO = 1e-4
"""Smallest part of a step: at discontinuities, such as a string's fold, halving would not end."""


@dataclass(frozen=True)
class Approach:
    """A string near another string or a body.

    Attributes:
        what: name of the string.
        other: name of the other string, or of the body.
        distance: distance of their surfaces [m]; negative for overlaps of any depth.
        t: time [s].
        place: (3,) nearest point of the string's axis [m].
    """

    what: str
    other: str
    distance: float
    t: float
    place: tuple[float, float, float]

    def __str__(self) -> str:
        at = ", ".join(f"{x:.3g}" for x in self.place)
        gap = f"{abs(self.distance):.3g} m {'from' if self.distance > 0.0 else 'inside'}"
        return f"string {self.what} is {gap} {self.other} at t = {self.t:.4g} s, ({at})"


@dataclass(frozen=True)
class Approaches:
    """Approaches, at most one for every pair of names.

    Attributes:
        strings: approaches of two strings.
        bodies: approaches of a string and a body of another puppet, or a prop.
        own: approaches of a string and a body of the same puppet.
    """

    strings: tuple[Approach, ...]
    bodies: tuple[Approach, ...]
    own: tuple[Approach, ...]


class StringsApart:
    """Distances of a puppet's or scene's strings from one another and from bodies, and crossings.

        d = min |x - y| - radii,   x on a string, y on another string or on the core of a body

    A taut string is straight from point to point, a slack one hangs as a catenary. Twelve chords
    replace its curve; none is farther from it than a twelfth of the horizontal distance of its
    ends. Up to a sag of 0.01 mm it is straight. The slip of winches is ignored.

    Strings through the same point are not measured against each other, nor strings against the
    bodies to which they are tied. Distances from capsules, spheres and boxes are exact. Those from
    ellipsoids are lower bounds that are exact where they touch; meshes count as the box around
    them. For obstacles see :class:`Clearance`. Chains of masses that represent elastic
    strings are not measured.

    Args:
        marionette: a puppet or a scene.
        radius: half the thickness of strings [m].
        own: whether to measure distances within one puppet as well, which is slow, because its
            parts are near each other. Crossings within a puppet are always detected.

    Raises:
        ValueError: ``radius`` is not a finite number of at least 0.
    """

    def __init__(self, marionette: Marionette, *, radius: float = 0.0, own: bool = True):
        check_not_negative(radius=radius)
        self.marionette = marionette
        self._bodies, self._links = solids.moving(marionette.tree, Meshes())
        self._pairs = string_pairs(marionette, self._links, self._bodies["radius"], radius, own=own)

    def motion(self, q_D: Array, q_K: Array, t: Times) -> StringMotion:
        """The strings and bodies along a motion, ready for measurements.

        Args:
            q_D, q_K: (T, n_qD) dynamic and (T, n_qK) driven (kinematic) configurations.
            t: (T,) times, not decreasing [s].

        Raises:
            StateError: the arrays have other shapes, no samples, or numbers that are not finite;
                or times decrease.
        """
        q_D, q_K, t = (np.asarray(x, dtype=float) for x in (q_D, q_K, t))
        table = self.marionette.coordinates
        shapes = (len(t), table.n_qD), (len(t), table.n_qK)
        if (q_D.shape, q_K.shape) != shapes or t.ndim != 1 or not len(t):
            raise StateError(
                f"q_D, q_K and t have the shapes {q_D.shape}, {q_K.shape} and {t.shape}; they must "
                f"be (T, {table.n_qD}), (T, {table.n_qK}) and (T,), with T of at least 1"
            )
        if not all(np.isfinite(x).all() for x in (q_D, q_K, t)) or np.any(np.diff(t) < 0.0):
            raise StateError("q_D, q_K and t must be finite, and t must not decrease")
        path = Path(self.marionette, t, q_D, q_K)
        return StringMotion(t, self._cores(q_D, q_K), self._pairs, path, self._cores)

    def _cores(self, q_D: Array, q_K: Array) -> Cores:
        return Cores.of(self.marionette, self._bodies, self._links, q_D, q_K)


@dataclass(frozen=True, eq=False)
class StringMotion:
    """Strings and bodies along a motion.

    Between samples, coordinates are interpolated linearly. Where a pair may come nearer than the
    limit, steps are halved until they move it by less than 0.1 mm, or 2 % of its distance.

    Attributes:
        t: (T,) times [s].
        cores: cores of strings and bodies at the samples.
        pairs: pairs to measure.
        path: configurations at the samples and between them.
        placed: function from configurations q_D, q_K to their cores.
    """

    t: Times
    cores: Cores
    pairs: StringPairs
    path: Path
    placed: Callable[[Array, Array], Cores]

    def nearest(self, within: float = 0.05) -> Approaches:
        """Least distances of all pairs that come nearer than ``within``, in increasing order.

        Distances are accurate to 0.1 mm and 2 %. Depths of overlaps are not measured.

        Raises:
            ValueError: ``within`` is not a finite number greater than 0.
        """
        check_positive(within=within)
        pairs = self.pairs.every
        best = np.full(len(self.pairs.names), float(within))
        which, when, later = *np.full((2, len(best)), -1), np.zeros(len(best))

        def limit(pair: Indices, _k: Indices, s: Array) -> Array:
            best_distance = best[pairs.group[pair]]
            between = np.where(
                best_distance > 0.0,
                best_distance - np.maximum(_MAX_MOVE, _MAX_MOVE_RATIO * best_distance),
                -np.inf,
            )
            return (
                np.where(s >= 0.0, between, best_distance - _DISTANCE_TOLERANCE)
                + pairs.swollen[pair]
            )

        def record(pair: Indices, k: Indices, s: Array, distance: Array) -> None:
            distance, group = distance - pairs.swollen[pair], pairs.group[pair]
            first = _firsts(group, distance)
            first = first[distance[first] < best[group[first]]]
            best[group[first]] = distance[first]
            which[group[first]], when[group[first]] = pair[first], k[first]
            later[group[first]] = s[first]

        self._search(limit, record)
        near = np.flatnonzero(which >= 0)
        return self._approaches(which[near], when[near], later[near], best[near])

    def nearer_than(self, margin: float) -> Approaches:
        """First approaches of all pairs that come nearer than a margin, the earliest first.

        Raises:
            ValueError: the margin is not a finite number greater than 0.
        """
        check_positive(margin=margin)
        pairs, never = self.pairs.every, len(self.t)
        which, when = np.full((2, len(self.pairs.names)), never)
        later = np.zeros(len(which))

        def before(group: Indices, k: Indices, s: Array) -> MaskRows:
            return (k < when[group]) | ((k == when[group]) & (s < later[group]))

        def limit(pair: Indices, k: Indices, s: Array) -> Array:
            early = before(pairs.group[pair], k, s)
            return np.where(early, margin + pairs.swollen[pair], -np.inf)

        def record(pair: Indices, k: Indices, s: Array, distance: Array) -> None:
            near = np.flatnonzero(distance - pairs.swollen[pair] < margin)
            pair, k, s, group = pair[near], k[near], s[near], pairs.group[pair[near]]
            first = _firsts(group, self.t[k] + s)
            first = first[before(group[first], k[first], s[first])]
            which[group[first]], when[group[first]] = pair[first], k[first]
            later[group[first]] = s[first]

        self._search(limit, record)
        near = np.flatnonzero(when < never)
        rank = self.t[when[near]] + later[near]
        return self._approaches(which[near], when[near], later[near], rank)

    def crossings(self) -> tuple[Crossing, ...]:
        """Every passage of a string through another, the earliest first.

        The motion is free of crossings if the result is empty. Slack strings count as their chords:
        windings around a loop of a slack string are not detected.
        """
        return crossings(self.cores, self.t, self.pairs)

    def windings(self) -> tuple[Winding, ...]:
        """Windings of strings round each other, in decreasing order of turns at the end.

        Only pairs with common heights at all times and straight from end to end are included.
        """
        return windings(self.cores, self.pairs)

    def _search(self, limit: DistanceLimit, record: PairCallback) -> None:
        """Measures samples, and refines between them where pairs may be nearer than a limit."""
        pairs, zeros = self.pairs.every, np.zeros(len(self.pairs.every))
        pair, k = search(
            self.cores,
            pairs,
            lambda pair, k: limit(pair, k, np.full(len(k), _AT_SAMPLE)),
            lambda pair, k, distance: record(pair, k, np.zeros(len(k)), distance),
        )
        within = k + 1 < len(self.t)
        pair, k = pair[within], k[within]
        start: Array = np.zeros(len(k))
        end: Array = self.path.h[k]
        while len(pair):
            middle = 0.5 * (start + end)
            step, own = np.unique(np.array([k, start, end]), axis=1, return_inverse=True)
            own = own.reshape(-1)
            piece = np.repeat(step[0].astype(int), 3)
            marks = np.array([step[1], 0.5 * (step[1] + step[2]), step[2]]).T.ravel()
            cores = self.placed(*self.path.at(piece, marks))
            i, j, at = pairs.i[pair], pairs.j[pair], 3 * own + 1
            distance, _ = cores.exact(i, j, at)
            record(pair, k, middle, distance)
            moved = zeros[pair]
            for core in (i, j):
                there = cores.travelled[core, at]
                before = there - cores.travelled[core, at - 1]
                moved = moved + np.maximum(before, cores.travelled[core, at + 1] - there)
            gap = np.maximum(distance - pairs.swollen[pair], 0.0)
            long = (moved > np.maximum(_MAX_MOVE, _MAX_MOVE_RATIO * gap)) & (
                end - start > _MIN_STEP_RATIO * self.path.h[k]
            )
            open_ = np.flatnonzero(long & (distance - moved < limit(pair, k, start)))
            pair, k = np.tile(pair[open_], 2), np.tile(k[open_], 2)
            start, middle, end = (x[open_] for x in (start, middle, end))
            start, end = np.concatenate([start, middle]), np.concatenate([middle, end])

    def _approaches(self, pair: Indices, k: Indices, s: Array, rank: Array) -> Approaches:
        """Approaches of pairs (m,) at s (m,) after samples k (m,), by kind and in order of rank."""
        pairs, t = self.pairs.every, self.t[k] + s
        if len(self.path.h) and len(k):
            piece = np.minimum(k, len(self.path.h) - 1)
            s = np.where(k > piece, self.path.h[piece], s)
            cores, k = self.placed(*self.path.at(piece, s)), np.arange(len(k))
        else:
            cores = self.cores
        distance, place = cores.exact(pairs.i[pair], pairs.j[pair], k)
        distance = distance - pairs.swollen[pair]
        approaches: dict[Kind, list[Approach]] = {kind: [] for kind in Kind}
        for n in np.argsort(rank, kind="stable"):
            group = pairs.group[pair[n]]
            x, y, z = place[n].tolist()
            what, other = self.pairs.names[group]
            entry = Approach(what, other, float(distance[n]), float(t[n]), (x, y, z))
            approaches[self.pairs.kinds[group]].append(entry)
        return Approaches(*(tuple(entry) for entry in approaches.values()))


DistanceLimit = Callable[[Indices, Indices, Array], Array]
"""Callback: pairs (m,), samples, times after them -> limits of the distance without radii [m]."""

PairCallback = Callable[[Indices, Indices, Array, Array], None]
"""Callback: pairs (m,), samples, times after them, and distances without radii [m]."""


def _firsts(group: Indices, rank: Array | Indices) -> Indices:
    """Indices of the least rank (m,) in every group (m,)."""
    order = np.lexsort((rank, group))
    return order[np.flatnonzero(np.diff(group[order], prepend=-1))]
