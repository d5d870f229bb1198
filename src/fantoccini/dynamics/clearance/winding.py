"""Crossings of strings through one another, and their windings round each other.

The pieces a0 to a1 and b0 to b1 of two strings meet where the volume that their ends span is zero,

    f(s) = (a1 - a0) x (b1 - b0) . (b0 - a0) = 0

and their nearest points coincide. Ends move uniformly from one sample to the next, 0 <= s <= 1, so
that f is a cubic. Where it changes sign and the pieces meet, one string has passed through the
other: this test is exact, however long the step.
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
        what, other: names of the strings.
        t: time [s], for ends that move uniformly between the samples.
        place: (3,) place of the crossing [m].
        turn: 1 where the upper part of ``other`` goes on round ``what`` to the left, seen from
            above, -1 to the right, 0 where both move in one plane. The crossing adds it to the
            difference between ``turns`` and ``seen`` of their :class:`Winding`.
    """

    what: str
    other: str
    t: float
    place: tuple[float, float, float]
    turn: int

    def __str__(self) -> str:
        at = ", ".join(f"{x:.3g}" for x in self.place)
        return f"string {self.what} crosses {self.other} at t = {self.t:.4g} s, ({at})"


@dataclass(frozen=True, eq=False)
class Winding:
    """Turns of two strings round each other.

        w(t) = angle at the highest common height - angle at the lowest, over 2 pi

    with the angle of the horizontal vector from one string to the other followed in time. w begins
    as the angle that the strings sweep from bottom to top, less than half a turn, and equals it at
    all times without crossings. Each crossing adds a turn, in its sense, to the difference.

    Attributes:
        what, other: names of the strings.
        turns: (T,) w; positive to the left, seen from above.
        seen: (T,) angle that the strings sweep from bottom to top [turns].
    """

    what: str
    other: str
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
        pairs.of_strings,
        lambda pair, _k: np.full(len(pair), _TOLERANCES.meeting_distance),
    )
    moving = k + 1 < len(t)
    pair, k = pair[moving], k[moving]
    i, j = pairs.of_strings.i[pair], pairs.of_strings.j[pair]
    ends = np.array([end[core, k] for core in (i, j) for end in (cores.a, cores.b)])
    after = np.array([end[core, k + 1] for core in (i, j) for end in (cores.a, cores.b)])
    step = _Step(ends, after)
    results = []
    for which, s, turn in (step.passages(), step.meetings_in_plane()):
        place = step.part(which).places(s)
        when = t[k[which]] + s * (t[k[which] + 1] - t[k[which]])
        for n, m in enumerate(which):
            what, other = pairs.names[pairs.of_strings.group[pair[m]]]
            x, y, z = place[n].tolist()
            results.append(Crossing(what, other, float(when[n]), (x, y, z), int(turn[n])))
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
        return _volume(*self.at(s))

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
                _product(u, v, w),
                _product(du, v, w) + _product(u, dv, w) + _product(u, v, dw),
                _product(u, dv, dw) + _product(du, v, dw) + _product(du, dv, w),
                _product(du, dv, dw),
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
        inner = np.sort(np.where((extremes > 0.0) & (extremes < 1.0), extremes, 1.0), axis=0)
        marks = np.concatenate([np.zeros((1, len(c1))), inner, np.ones((1, len(c1)))])
        above = np.array([self.volume(s) >= 0.0 for s in marks])
        above[:, self.in_plane()] = True
        piece, which = np.nonzero(above[1:] != above[:-1])
        part = self.part(which)
        low, high, side = marks[piece, which], marks[piece + 1, which], above[piece, which]
        for _ in range(_TOLERANCES.n_bisections):
            middle = 0.5 * (low + high)
            same = (part.volume(middle) >= 0.0) == side
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        meet = part.distance(high) <= _TOLERANCES.meeting_distance
        a0, a1, b0, b1 = part.at(high)
        upward = np.sign((a1 - a0)[:, 2] * (b1 - b0)[:, 2])
        turn = np.where(side, -1, 1) * upward.astype(int)
        return which[meet], high[meet], turn[meet]

    def meetings_in_plane(self) -> tuple[Indices, Array, Indices]:
        """Pieces (m,) that stay in one plane and meet there, times s (m,), and senses 0."""
        which = np.flatnonzero(self.in_plane())
        part, s = self.part(which), np.zeros(len(which))
        moved = np.linalg.norm(part.after - part.before, axis=2)
        nearing = np.maximum(moved[0], moved[1]) + np.maximum(moved[2], moved[3])
        distance = part.distance(s)
        away = distance > _TOLERANCES.meeting_distance
        # They cannot meet before they have moved by the remaining distance.
        for _ in range(_TOLERANCES.max_advances):
            s = np.minimum(s + distance / np.maximum(nearing, np.finfo(float).tiny), 1.0)
            distance = np.where(distance > _TOLERANCES.meeting_distance, part.distance(s), distance)
        meet = away & (distance <= _TOLERANCES.meeting_distance)
        return which[meet], s[meet], np.zeros(int(meet.sum()), dtype=int)


def windings(cores: Cores, pairs: StringPairs) -> tuple[Winding, ...]:
    """Windings of pairs of strings, the most wound at the end first.

    Args:
        cores: cores along a motion; strings count as their chords.
        pairs: pairs of strings.
    """
    results = []
    single = np.bincount(pairs.of_strings.group) == 1
    lines = [_Line.of(a, b) for a, b in zip(cores.a, cores.b, strict=True)]
    for n in np.flatnonzero(single[pairs.of_strings.group]):
        line, other = lines[pairs.of_strings.i[n]], lines[pairs.of_strings.j[n]]
        top, bottom = np.minimum(line.top, other.top), np.maximum(line.bottom, other.bottom)
        if np.any(top <= bottom):
            continue
        upper, lower = (other.at(z) - line.at(z) for z in (top, bottom))
        seen = _angle(lower, upper)
        steps = _angle(upper[:-1], upper[1:]) - _angle(lower[:-1], lower[1:])
        turns = seen[0] + np.concatenate([[0.0], np.cumsum(steps)])
        what, another = pairs.names[pairs.of_strings.group[n]]
        results.append(Winding(what, another, turns, seen))
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
    def of(cls, a: Vec3, b: Vec3) -> _Line:
        x, y = (end[:, 0] + 1j * end[:, 1] for end in (a, b))
        up = b[:, 2] >= a[:, 2]
        rise = b[:, 2] - a[:, 2]
        slope = np.asarray((y - x) / np.where(rise == 0.0, np.inf, rise), dtype=np.complex128)
        low = np.where(up, x, y)
        return cls(np.maximum(a[:, 2], b[:, 2]), np.minimum(a[:, 2], b[:, 2]), low, slope)

    def at(self, z: Array) -> NDArray[np.complex128]:
        return self.low + (z - self.bottom) * self.slope


def _volume(a0: Vec3, a1: Vec3, b0: Vec3, b1: Vec3) -> Array:
    return _product(a1 - a0, b1 - b0, b0 - a0)


def _product(u: Vec3, v: Vec3, w: Vec3) -> Array:
    """Triple products u x v . w (n,)."""
    return dot(np.cross(u, v), w)


def _angle(x: NDArray[np.complex128], y: NDArray[np.complex128]) -> Array:
    """Angles from x (n,) to y, at most half a turn [turns]."""
    return np.angle(y * x.conj()) / (2.0 * np.pi)
