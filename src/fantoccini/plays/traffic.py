"""Others on the stage over time: when a place is free, and when a leg can be walked past them.

    free(p, t):  |p - o(t)| >= r + r_o   for every other, at samples at most 20 ms apart

Time is counted in steps from the beginning on. After the last motion all of them stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.arrays import Array, Times, frozen
from fantoccini.gestures import stepping
from fantoccini.gestures.ends import Complex
from fantoccini.motion import polynomial
from fantoccini.plays.regions import Disk

SAMPLE = 0.02
"""Longest time between two checks of a motion [s]."""
_MARGIN = 1e-3
"""Beside those who move, for what happens between two samples [m]."""
_MOVES = 1e-9
"""Others who stay within this stand [m]."""
_AT_ONCE = 16
"""Departures that are checked at once."""
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
        return x + 1j * y

    def last_motion(self) -> float:
        """When it stands for good [s]."""
        moving = np.flatnonzero(np.any(np.abs(self.xy - self.xy[-1]) > _MOVES, axis=1))
        return float(self.times[moving[-1] + 1]) if len(moving) else -np.inf

    def as_disk(self, since: float) -> Disk | None:
        """The disk where it stands from a time on [s]; None when it moves after that."""
        if self.last_motion() > since:
            return None
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
        last = max((one.last_motion() for one in self.others), default=self.begin)
        return max(0, int(np.ceil((last - self.begin) / self.step_time - 1e-9)))

    @cached_property
    def _places(self) -> list[Complex]:
        """Of every other, at the samples until all stand."""
        k = np.arange(self.still_from * self.parts + 1)
        t = self.begin + k * (self.step_time / self.parts)
        return [one.at(t) for one in self.others]

    @cached_property
    def _least(self) -> list[float]:
        """Distance to keep from every other [m]."""
        found = []
        for one, places in zip(self.others, self._places, strict=True):
            least = one.radius + self.radius
            near = min(abs(places[0] - self.ends[0]), abs(places[-1] - self.ends[1]))
            found.append(max(least, min(least + _MARGIN, near)) - 1e-9)
        return found

    def stays(self, point: complex) -> Array:
        """(still_from + 1,) first step at or after each one in which a place is not free."""
        free = np.ones(self.still_from * self.parts + 1, dtype=bool)
        for places, least in zip(self._places, self._least, strict=True):
            free &= np.abs(places - point) >= least
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
        profile = _phase(n, self.parts)
        way = first + (last - first) * profile
        steps = np.arange(len(way))
        # Later than this all departures are alike: everybody stands.
        final = min(until, max(since, self.still_from))
        at_once = 1
        while since <= final:
            k = np.arange(since, min(since + at_once, final + 1))
            free = np.ones(len(k), dtype=bool)
            index = np.minimum(k[:, None] * self.parts + steps, self.still_from * self.parts)
            for places, least in zip(self._places, self._least, strict=True):
                free &= np.all(np.abs(places[index] - way) >= least, axis=1)
            if np.any(free):
                return int(k[np.argmax(free)])
            since, at_once = since + at_once, _AT_ONCE
        return NEVER


def _phase(n: int, parts: int) -> Array:
    """(n parts + 1,) the part of a leg of n steps that is behind at its samples."""
    s = np.arange(parts) / parts
    ways = stepping.leg(n)
    return np.append(polynomial.evaluate(ways[:, None], s[None])[0].ravel(), 1.0)
