"""StringDistances: distances of strings from one another and from bodies, along a motion.

q_D and q_K are the dynamic and driven coordinates along the motion. A core is the segment, box or
ellipsoid that stands for a piece of a string or for a solid.
"""

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
        first: name of the string.
        second: name of the other string, or of the body.
        distance: distance of their surfaces [m]; negative for overlaps of any depth.
        t: time [s].
        place: (3,) nearest point of the string's axis [m].
    """

    first: str
    second: str
    distance: float
    t: float
    place: tuple[float, float, float]

    def __str__(self) -> str:
        coordinates = ", ".join(f"{x:.3g}" for x in self.place)
        distance = f"{abs(self.distance):.3g} m {'from' if self.distance > 0.0 else 'inside'}"
        pair = f"string {self.first} is {distance} {self.second}"
        return f"{pair} at t = {self.t:.4g} s, ({coordinates})"


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


class StringDistances:
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
        return Cores.along_motion(self.marionette, self._bodies, self._links, q_D, q_K)


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
        cores_at: function from configurations q_D, q_K to their cores.
    """

    t: Times
    cores: Cores
    pairs: StringPairs
    path: Path
    cores_at: Callable[[Array, Array], Cores]

    def nearest(self, max_distance: float = 0.05) -> Approaches:
        """Least distances of all pairs that come nearer than ``max_distance``, in increasing order.

        Distances are accurate to 0.1 mm and 2 %. Depths of overlaps are not measured.

        Raises:
            ValueError: ``max_distance`` is not a finite number greater than 0.
        """
        check_positive(max_distance=max_distance)
        pairs = self.pairs.all_pairs
        best = np.full(len(self.pairs.names), float(max_distance))
        pair_of_group, sample_of_group, delay_of_group = (
            *np.full((2, len(best)), -1),
            np.zeros(len(best)),
        )

        def limit(pair: Indices, _k: Indices, s: Array) -> Array:
            best_distance = best[pairs.group[pair]]
            refined_limit = np.where(
                best_distance > 0.0,
                best_distance - np.maximum(_MAX_MOVE, _MAX_MOVE_RATIO * best_distance),
                -np.inf,
            )
            return (
                np.where(s >= 0.0, refined_limit, best_distance - _DISTANCE_TOLERANCE)
                + pairs.radii_sum[pair]
            )

        def record(pair: Indices, k: Indices, s: Array, distance: Array) -> None:
            distance, group = distance - pairs.radii_sum[pair], pairs.group[pair]
            improved = _least_per_group(group, distance)
            improved = improved[distance[improved] < best[group[improved]]]
            best[group[improved]] = distance[improved]
            pair_of_group[group[improved]], sample_of_group[group[improved]] = (
                pair[improved],
                k[improved],
            )
            delay_of_group[group[improved]] = s[improved]

        self._search(limit, record)
        near_groups = np.flatnonzero(pair_of_group >= 0)
        return self._approaches(
            pair_of_group[near_groups],
            sample_of_group[near_groups],
            delay_of_group[near_groups],
            best[near_groups],
        )

    def nearer_than(self, margin: float) -> Approaches:
        """First approaches of all pairs that come nearer than a margin, the earliest first.

        Raises:
            ValueError: the margin is not a finite number greater than 0.
        """
        check_positive(margin=margin)
        pairs, n_samples = self.pairs.all_pairs, len(self.t)
        pair_of_group, sample_of_group = np.full((2, len(self.pairs.names)), n_samples)
        delay_of_group = np.zeros(len(pair_of_group))

        def is_before(group: Indices, k: Indices, s: Array) -> MaskRows:
            return (k < sample_of_group[group]) | (
                (k == sample_of_group[group]) & (s < delay_of_group[group])
            )

        def limit(pair: Indices, k: Indices, s: Array) -> Array:
            is_early = is_before(pairs.group[pair], k, s)
            return np.where(is_early, margin + pairs.radii_sum[pair], -np.inf)

        def record(pair: Indices, k: Indices, s: Array, distance: Array) -> None:
            near = np.flatnonzero(distance - pairs.radii_sum[pair] < margin)
            pair, k, s, group = (pair[near], k[near], s[near], pairs.group[pair[near]])
            earliest = _least_per_group(group, self.t[k] + s)
            earliest = earliest[is_before(group[earliest], k[earliest], s[earliest])]
            pair_of_group[group[earliest]], sample_of_group[group[earliest]] = (
                pair[earliest],
                k[earliest],
            )
            delay_of_group[group[earliest]] = s[earliest]

        self._search(limit, record)
        near_groups = np.flatnonzero(sample_of_group < n_samples)
        rank = self.t[sample_of_group[near_groups]] + delay_of_group[near_groups]
        return self._approaches(
            pair_of_group[near_groups],
            sample_of_group[near_groups],
            delay_of_group[near_groups],
            rank,
        )

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
        pairs, zeros = self.pairs.all_pairs, np.zeros(len(self.pairs.all_pairs))
        pair, k = search(
            self.cores,
            pairs,
            lambda pair, k: limit(pair, k, np.full(len(k), _AT_SAMPLE)),
            lambda pair, k, distance: record(pair, k, np.zeros(len(k)), distance),
        )
        has_next = k + 1 < len(self.t)
        pair, k = pair[has_next], k[has_next]
        start: Array = np.zeros(len(k))
        end: Array = self.path.h[k]
        while len(pair):
            middle = 0.5 * (start + end)
            steps, step_of_pair = np.unique(np.array([k, start, end]), axis=1, return_inverse=True)
            step_of_pair = step_of_pair.reshape(-1)
            piece = np.repeat(steps[0].astype(int), 3)
            times_in_step = np.array([steps[1], 0.5 * (steps[1] + steps[2]), steps[2]]).T.ravel()
            cores = self.cores_at(*self.path.at(piece, times_in_step))
            i, j, middle_index = pairs.i[pair], pairs.j[pair], 3 * step_of_pair + 1
            distance, _ = cores.exact(i, j, middle_index)
            record(pair, k, middle, distance)
            travel = zeros[pair]
            for core in (i, j):
                at_middle = cores.travelled[core, middle_index]
                travel_before = at_middle - cores.travelled[core, middle_index - 1]
                travel = travel + np.maximum(
                    travel_before, cores.travelled[core, middle_index + 1] - at_middle
                )
            gap = np.maximum(distance - pairs.radii_sum[pair], 0.0)
            is_long = (travel > np.maximum(_MAX_MOVE, _MAX_MOVE_RATIO * gap)) & (
                end - start > _MIN_STEP_RATIO * self.path.h[k]
            )
            to_refine = np.flatnonzero(is_long & (distance - travel < limit(pair, k, start)))
            pair, k = np.tile(pair[to_refine], 2), np.tile(k[to_refine], 2)
            start, middle, end = (x[to_refine] for x in (start, middle, end))
            start, end = np.concatenate([start, middle]), np.concatenate([middle, end])

    def _approaches(self, pair: Indices, k: Indices, s: Array, rank: Array) -> Approaches:
        """Approaches of pairs (m,) at s (m,) after samples k (m,), by kind and in order of rank."""
        pairs, t = self.pairs.all_pairs, self.t[k] + s
        if len(self.path.h) and len(k):
            piece = np.minimum(k, len(self.path.h) - 1)
            s = np.where(k > piece, self.path.h[piece], s)
            cores, k = self.cores_at(*self.path.at(piece, s)), np.arange(len(k))
        else:
            cores = self.cores
        distance, place = cores.exact(pairs.i[pair], pairs.j[pair], k)
        distance = distance - pairs.radii_sum[pair]
        approaches: dict[Kind, list[Approach]] = {kind: [] for kind in Kind}
        for n in np.argsort(rank, kind="stable"):
            group = pairs.group[pair[n]]
            x, y, z = place[n].tolist()
            first, second = self.pairs.names[group]
            approach = Approach(first, second, float(distance[n]), float(t[n]), (x, y, z))
            approaches[self.pairs.kinds[group]].append(approach)
        return Approaches(*(tuple(approach) for approach in approaches.values()))


DistanceLimit = Callable[[Indices, Indices, Array], Array]
"""Callback: pairs (m,), samples, times after them -> limits of the distance without radii [m]."""

PairCallback = Callable[[Indices, Indices, Array, Array], None]
"""Callback: pairs (m,), samples, times after them, and distances without radii [m]."""


def _least_per_group(group: Indices, rank: Array | Indices) -> Indices:
    """Indices of the least rank (m,) in every group (m,)."""
    order = np.lexsort((rank, group))
    return order[np.flatnonzero(np.diff(group[order], prepend=-1))]
