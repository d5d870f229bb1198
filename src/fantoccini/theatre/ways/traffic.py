"""Others on the stage over time: when a place is free, and when a leg can be walked past them.

    free(p, t):  |p - o(t)| >= r + r_o   for every other, at samples at most 20 ms apart

Time is counted in steps from the beginning on. After the last motion all of them stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from fantoccini.base import Array, Indices, Mask, Times, frozen, polynomial
from fantoccini.theatre.gestures import Complex, stepping
from fantoccini.theatre.ways.regions import Disk

SAMPLE = 0.02
"""Longest time between two checks of a motion [s]."""
_MARGIN = 1e-3
"""Beside those who move, for what happens between two samples [m]."""
_MOVES = 1e-9
"""Others who stay within this stand [m]."""
_COARSE = 8
"""The first of every so many samples is checked before the others."""
NEVER = 1 << 40
"""A step that never comes."""


@dataclass(frozen=True, eq=False)
class Other:
    """Someone else on the stage: a disk that stands before its first time and after its last.

    Attributes:
        name: of whom.
        times: (T,) increasing [s].
        xy: (T, 2) places of the middle, in the scene's frame; straight between them [m].
        radius: [m].

    Raises:
        ValueError: the arrays do not fit each other.
    """

    name: str
    times: Times
    xy: Array
    radius: float

    def __post_init__(self) -> None:
        for name in ("times", "xy"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        n = len(self.times)
        if n == 0 or self.times.shape != (n,) or self.xy.shape != (n, 2):
            raise ValueError(
                f"times of {self.name} are {self.times.shape} and xy {self.xy.shape}; "
                f"they must be (T,) and (T, 2)"
            )

    def at(self, t: Times) -> Complex:
        """(...) places at times (...)."""
        x, y = (np.interp(t, self.times, self.xy[:, part]) for part in (0, 1))
        return np.asarray(x + 1j * y)

    def last_motion(self) -> float:
        """When it stands for good [s]."""
        moving = np.flatnonzero(np.any(np.abs(self.xy - self.xy[-1]) > _MOVES, axis=1))
        return float(self.times[moving[-1] + 1]) if len(moving) else -np.inf

    def at_rest(self) -> Disk:
        """Where it stands after its last motion."""
        return Disk(self.name, (float(self.xy[-1, 0]), float(self.xy[-1, 1])), self.radius)


@dataclass(frozen=True, eq=False)
class Traffic:
    """Those who move, on a clock of steps.

    Attributes:
        others: who move after the beginning.
        begin: [s].
        step_time: [s].
        radius: of the puppet [m].
        ends: the puppet's start and goal: there others may be as near as their radii allow.
    """

    others: Sequence[Other]
    begin: float
    step_time: float
    radius: float
    ends: tuple[complex, complex]

    @cached_property
    def parts(self) -> int:
        """Samples of a step."""
        return int(np.ceil(self.step_time / SAMPLE - 1e-9))

    @cached_property
    def still_from(self) -> int:
        """The first step from whose start on all stand."""
        last = max((other.last_motion() for other in self.others), default=self.begin)
        return max(0, int(np.ceil((last - self.begin) / self.step_time - 1e-9)))

    @cached_property
    def _places(self) -> Complex:
        """(others, n) places at the samples until all stand."""
        n = self.still_from * self.parts
        t = np.linspace(self.begin, self.begin + self.still_from * self.step_time, n + 1)
        return np.array([other.at(t) for other in self.others]).reshape(-1, n + 1)

    @cached_property
    def _least_squared(self) -> Array:
        """(others,) squares of the distances to keep [m^2]."""
        found = []
        for one, places in zip(self.others, self._places, strict=True):
            least = one.radius + self.radius
            near = min(abs(places[0] - self.ends[0]), abs(places[-1] - self.ends[1]))
            found.append(max(least, min(least + _MARGIN, near)) - 1e-9)
        return np.array(found) ** 2

    def stays(self, point: complex) -> Indices:
        """(still_from + 1,) first step at or after each one in which a place is not free."""
        free = self._free(self._places - point)
        until = np.full(self.still_from + 1, NEVER)
        if not free[-1]:
            until[-1] = self.still_from
        inner = free[:-1].reshape(-1, self.parts).all(axis=1) & free[self.parts :: self.parts]
        for k in range(self.still_from - 1, -1, -1):
            until[k] = until[k + 1] if inner[k] else k
        return until

    def departures(self, first: complex, last: complex, n: int, since: int, until: int) -> int:
        """The first step from one to another at which n steps between places meet nobody.

        Returns:
            It, or NEVER.
        """
        way = np.asarray(first + (last - first) * _phase(n, self.parts), dtype=complex)
        # Later than this all departures are alike: everybody stands.
        final = min(until, max(since, self.still_from))
        if since > final:
            return NEVER
        if self._meets_nobody(way, np.array([since]), 1)[0]:
            return since
        later = np.arange(since + 1, final + 1)
        for k in later[self._meets_nobody(way, later, _COARSE)]:
            if self._meets_nobody(way, k[None], 1)[0]:
                return int(k)
        return NEVER

    def _meets_nobody(self, way: Complex, since: Indices, every: int) -> Mask:
        """(n,) whether a way that begins at steps (n,) is free at every so many samples."""
        k = np.arange(0, len(way), every)
        index = np.minimum(since[:, None] * self.parts + k, self.still_from * self.parts)
        return np.asarray(self._free(self._places[:, index] - way[k]).all(axis=1))

    def _free(self, gaps: Complex) -> Mask:
        """(...) whether gaps (others, ...) are all large enough."""
        least = self._least_squared.reshape(-1, *(1,) * (gaps.ndim - 1))
        return np.all(gaps.real**2 + gaps.imag**2 >= least, axis=0)


@cache
def _phase(n: int, parts: int) -> Array:
    """(n parts + 1,) the part of a leg of n steps that is behind at its samples."""
    s = np.arange(parts) / parts
    ways = stepping.leg(n)
    return np.append(polynomial.evaluate(ways[:, None], s[None])[0].ravel(), 1.0)
