"""Crossings of strings through one another, and their windings round each other.

The pieces a0 to a1 and b0 to b1 of two strings meet where the volume that their ends span is zero,

    f(s) = (a1 - a0) x (b1 - b0) . (b0 - a0) = 0

and their nearest points coincide. Ends move uniformly from one sample to the next, 0 <= s <= 1, so
that f is a cubic. Where it changes sign and the pieces meet, one string has passed through the
other: this test is exact, however long the step.

A piece of a string is straight, and a step the time between two samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, Indices, Times, Vec3
from fantoccini.dynamics.clearance.blocks import search
from fantoccini.dynamics.clearance.cores import Cores
from fantoccini.dynamics.clearance.segments import dot, segment_distance
from fantoccini.dynamics.clearance.string_pairs import StringPairs


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances of crossings."""

    meeting_distance: float = 1e-8
    """Largest distance of pieces that meet [m]: above rounding errors, far below a thread."""
    coplanar_volume: float = 1e-13
    """Largest volume of pieces in one plane, relative to the product of its spanning lengths."""
    n_bisections: int = 52
    """Number of halvings of a step: enough for every bit of a number between 0 and 1."""
    max_advances: int = 200
    """Maximum number of steps towards a meeting in a plane."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True)
class Crossing:
    """A string that passes through another.

    Attributes:
        first, second: names of the strings.
        t: time [s], for ends that move uniformly between the samples.
        place: (3,) place of the crossing [m].
        turn: 1 where the upper part of ``second`` goes on round ``first`` to the left, seen from
            above, -1 to the right, 0 where both move in one plane. The crossing adds it to the
            difference between ``turns`` and ``seen`` of their :class:`Winding`.
    """

    first: str
    second: str
    t: float
    place: tuple[float, float, float]
    turn: int

    def __str__(self) -> str:
        coordinates = ", ".join(f"{x:.3g}" for x in self.place)
        return f"string {self.first} crosses {self.second} at t = {self.t:.4g} s, ({coordinates})"


@dataclass(frozen=True, eq=False)
class Winding:
    """Turns of two strings round each other.

        w(t) = angle at the highest common height - angle at the lowest, over 2 pi

    with the angle of the horizontal vector from one string to the other followed in time. w begins
    as the angle that the strings sweep from bottom to top, less than half a turn, and equals it at
    all times without crossings. Each crossing adds a turn, in its sense, to the difference.

    Attributes:
        first, second: names of the strings.
        turns: (T,) w; positive to the left, seen from above.
        seen: (T,) angle that the strings sweep from bottom to top [turns].
    """

    first: str
    second: str
    turns: Array
    seen: Array


def crossings(cores: Cores, t: Times, pairs: StringPairs) -> tuple[Crossing, ...]:
    """Passages of strings through one another, the earliest first.

    Args:
        cores: cores along a motion; strings count as their chords.
        t: (T,) times [s].
        pairs: pairs of strings.
    """
    pair, k = search(
        cores.chords(),
        pairs.string_string_pairs,
        lambda pair, _k: np.full(len(pair), _TOLERANCES.meeting_distance),
    )
    has_next = k + 1 < len(t)
    pair, k = pair[has_next], k[has_next]
    i, j = pairs.string_string_pairs.i[pair], pairs.string_string_pairs.j[pair]
    ends_before = np.array([end[core, k] for core in (i, j) for end in (cores.a, cores.b)])
    ends_after = np.array([end[core, k + 1] for core in (i, j) for end in (cores.a, cores.b)])
    steps = _Step(ends_before, ends_after)
    results = []
    for selected, s, turn in (steps.passages(), steps.meetings_in_plane()):
        places = steps.part(selected).places(s)
        times = t[k[selected]] + s * (t[k[selected] + 1] - t[k[selected]])
        for n, m in enumerate(selected):
            first, second = pairs.names[pairs.string_string_pairs.group[pair[m]]]
            x, y, z = places[n].tolist()
            results.append(Crossing(first, second, float(times[n]), (x, y, z), int(turn[n])))
    return tuple(sorted(results, key=lambda crossing: crossing.t))


@dataclass(frozen=True, eq=False)
class _Step:
    """n pairs of pieces in a step: ends a0, a1, b0, b1 before and after, (4, n, 3) [m]."""

    before: Vec3
    after: Vec3

    def part(self, which: Indices) -> _Step:
        return _Step(self.before[:, which], self.after[:, which])

    def at(self, s: Array) -> Vec3:
        """Ends (4, n, 3) at s (n,), equal to those of the samples at s = 0 and 1 [m]."""
        return (1.0 - s)[:, None] * self.before + s[:, None] * self.after

    def volume(self, s: Array) -> Array:
        """Spanned volume f (n,) [m^3]."""
        return _spanned_volume(*self.at(s))

    def distance(self, s: Array) -> Array:
        """Distances (n,) of the pieces [m]."""
        return segment_distance(*self.at(s))[0]

    def places(self, s: Array) -> Vec3:
        """Points (n, 3) of the first piece nearest to the other [m]."""
        a, b, c, d = self.at(s)
        return a + segment_distance(a, b, c, d)[1][:, None] * (b - a)

    def coefficients(self) -> Array:
        """Coefficients (4, n) of f, the constant first [m^3]."""
        a, b, c, d = self.before
        u, v, w = x = np.array([b - a, d - c, c - a])
        a, b, c, d = self.after
        du, dv, dw = np.array([b - a, d - c, c - a]) - x
        return np.array(
            [
                _triple_product(u, v, w),
                _triple_product(du, v, w) + _triple_product(u, dv, w) + _triple_product(u, v, dw),
                _triple_product(u, dv, dw)
                + _triple_product(du, v, dw)
                + _triple_product(du, dv, w),
                _triple_product(du, dv, dw),
            ]
        )

    def in_plane(self) -> np.ndarray:
        """Whether the pieces stay in one plane, so that f does not detect crossings: (n,) bool."""
        size = np.ones(self.before.shape[1])
        for i, j in ((0, 1), (2, 3), (0, 2)):
            spans = (np.linalg.norm(x[j] - x[i], axis=1) for x in (self.before, self.after))
            size *= np.maximum(*spans)
        return (
            np.abs(self.coefficients()).max(axis=0, initial=0.0)
            <= _TOLERANCES.coplanar_volume * size
        )

    def passages(self) -> tuple[Indices, Array, Indices]:
        """Pieces (m,) that pass through one another, their times s (m,), and senses (m,)."""
        _, c1, c2, c3 = self.coefficients()
        # Between its extremes f is monotone: a change of sign there is one root.
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(c2 * c2 - 3.0 * c1 * c3)
            q = -c2 - np.where(c2 < 0.0, -1.0, 1.0) * root
            extremes = np.array([q / (3.0 * c3), c1 / q])
        extremes_inside = np.sort(
            np.where((extremes > 0.0) & (extremes < 1.0), extremes, 1.0), axis=0
        )
        bounds = np.concatenate([np.zeros((1, len(c1))), extremes_inside, np.ones((1, len(c1)))])
        is_positive = np.array([self.volume(s) >= 0.0 for s in bounds])
        is_positive[:, self.in_plane()] = True
        interval, pair = np.nonzero(is_positive[1:] != is_positive[:-1])
        part = self.part(pair)
        low, high, was_positive = (
            bounds[interval, pair],
            bounds[interval + 1, pair],
            is_positive[interval, pair],
        )
        for _ in range(_TOLERANCES.n_bisections):
            middle = 0.5 * (low + high)
            is_same_side = (part.volume(middle) >= 0.0) == was_positive
            low, high = np.where(is_same_side, middle, low), np.where(is_same_side, high, middle)
        meets = part.distance(high) <= _TOLERANCES.meeting_distance
        a0, a1, b0, b1 = part.at(high)
        vertical_sign = np.sign((a1 - a0)[:, 2] * (b1 - b0)[:, 2])
        sense = np.where(was_positive, -1, 1) * vertical_sign.astype(int)
        return pair[meets], high[meets], sense[meets]

    def meetings_in_plane(self) -> tuple[Indices, Array, Indices]:
        """Pieces (m,) that stay in one plane and meet there, times s (m,), and senses 0."""
        coplanar = np.flatnonzero(self.in_plane())
        part, s = self.part(coplanar), np.zeros(len(coplanar))
        travel = np.linalg.norm(part.after - part.before, axis=2)
        approach = np.maximum(travel[0], travel[1]) + np.maximum(travel[2], travel[3])
        distance = part.distance(s)
        was_apart = distance > _TOLERANCES.meeting_distance
        # They cannot meet before they have moved by the remaining distance.
        for _ in range(_TOLERANCES.max_advances):
            s = np.minimum(s + distance / np.maximum(approach, np.finfo(float).tiny), 1.0)
            distance = np.where(distance > _TOLERANCES.meeting_distance, part.distance(s), distance)
        meets = was_apart & (distance <= _TOLERANCES.meeting_distance)
        return coplanar[meets], s[meets], np.zeros(int(meets.sum()), dtype=int)


def windings(cores: Cores, pairs: StringPairs) -> tuple[Winding, ...]:
    """Windings of pairs of strings, the most wound at the end first.

    Args:
        cores: cores along a motion; strings count as their chords.
        pairs: pairs of strings.
    """
    results = []
    has_single_pieces = np.bincount(pairs.string_string_pairs.group) == 1
    straight_strings = [_Line.through(a, b) for a, b in zip(cores.a, cores.b, strict=True)]
    for n in np.flatnonzero(has_single_pieces[pairs.string_string_pairs.group]):
        line, other_line = (
            straight_strings[pairs.string_string_pairs.i[n]],
            straight_strings[pairs.string_string_pairs.j[n]],
        )
        top, bottom = (
            np.minimum(line.top, other_line.top),
            np.maximum(line.bottom, other_line.bottom),
        )
        if np.any(top <= bottom):
            continue
        upper_offset, lower_offset = (other_line.at(z) - line.at(z) for z in (top, bottom))
        seen_turns = _turns_between(lower_offset, upper_offset)
        steps = _turns_between(upper_offset[:-1], upper_offset[1:]) - _turns_between(
            lower_offset[:-1], lower_offset[1:]
        )
        turns = seen_turns[0] + np.concatenate([[0.0], np.cumsum(steps)])
        first, second = pairs.names[pairs.string_string_pairs.group[n]]
        results.append(Winding(first, second, turns, seen_turns))
    return tuple(sorted(results, key=lambda winding: -abs(winding.turns[-1])))


@dataclass(frozen=True, eq=False)
class _Line:
    """A straight string: its horizontal place x + y i as a function of the height z.

    Attributes:
        top, bottom: (T,) heights of its ends [m].
        low: (T,) complex place of the lower end [m].
        slope: (T,) complex change of the place per height; 0 of a level string.
    """

    top: Array
    bottom: Array
    low: NDArray[np.complex128]
    slope: NDArray[np.complex128]

    @classmethod
    def through(cls, a: Vec3, b: Vec3) -> _Line:
        x, y = (end[:, 0] + 1j * end[:, 1] for end in (a, b))
        is_upward = b[:, 2] >= a[:, 2]
        rise = b[:, 2] - a[:, 2]
        slope = np.asarray((y - x) / np.where(rise == 0.0, np.inf, rise), dtype=np.complex128)
        lower_end = np.where(is_upward, x, y)
        return cls(np.maximum(a[:, 2], b[:, 2]), np.minimum(a[:, 2], b[:, 2]), lower_end, slope)

    def at(self, z: Array) -> NDArray[np.complex128]:
        return self.low + (z - self.bottom) * self.slope


def _spanned_volume(a0: Vec3, a1: Vec3, b0: Vec3, b1: Vec3) -> Array:
    return _triple_product(a1 - a0, b1 - b0, b0 - a0)


def _triple_product(u: Vec3, v: Vec3, w: Vec3) -> Array:
    """Triple products u x v . w (n,)."""
    return dot(np.cross(u, v), w)


def _turns_between(x: NDArray[np.complex128], y: NDArray[np.complex128]) -> Array:
    """Angles from x (n,) to y, at most half a turn [turns]."""
    return np.angle(y * x.conj()) / (2.0 * np.pi)
