"""Other players on the stage over time: free places, and free departures of legs.

    free(p, t):  |p - o(t)| >= r + r_o   for every other, at samples at most 20 ms apart

Time is counted in steps from the beginning. After the last motion all players stand.
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
"""Extra distance from moving players, for the time between two samples [m]."""
_MIN_MOTION = 1e-9
"""Displacement up to which a player counts as standing [m]."""
_COARSE_STRIDE = 8
"""Stride of the samples that are checked before all others."""
NEVER = 1 << 40
"""Step index that means no step."""


@dataclass(frozen=True, eq=False)
class Other:
    """Other player on the stage: a disk that stands before its first time and after its last.

    Attributes:
        name: name of the player.
        times: (T,) increasing times [s].
        xy: (T, 2) places of the middle in the scene's frame, interpolated linearly [m].
        radius: radius of the player [m].

    Raises:
        ValueError: the shapes of the arrays do not match.
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
        """End of its last motion [s]; minus infinity if it always stands."""
        moving = np.flatnonzero(np.any(np.abs(self.xy - self.xy[-1]) > _MIN_MOTION, axis=1))
        return float(self.times[moving[-1] + 1]) if len(moving) else -np.inf

    def at_rest(self) -> Disk:
        """Disk at its place after its last motion."""
        return Disk(self.name, (float(self.xy[-1, 0]), float(self.xy[-1, 1])), self.radius)


@dataclass(frozen=True, eq=False)
class Traffic:
    """Moving players, in steps of the walking puppet.

    Attributes:
        others: players that move after the beginning.
        begin: time of step 0 [s].
        step_time: duration of a step [s].
        radius: radius of the puppet [m].
        ends: start and goal of the puppet, where others may be as near as their radii allow.
    """

    others: Sequence[Other]
    begin: float
    step_time: float
    radius: float
    ends: tuple[complex, complex]

    @cached_property
    def samples_per_step(self) -> int:
        """Number of samples of a step."""
        return int(np.ceil(self.step_time / SAMPLE - 1e-9))

    @cached_property
    def first_still_step(self) -> int:
        """First step at whose start all players stand, and do not move afterwards."""
        last = max((other.last_motion() for other in self.others), default=self.begin)
        return max(0, int(np.ceil((last - self.begin) / self.step_time - 1e-9)))

    @cached_property
    def _places(self) -> Complex:
        """(others, n) places at the samples until all players stand."""
        n = self.first_still_step * self.samples_per_step
        t = np.linspace(self.begin, self.begin + self.first_still_step * self.step_time, n + 1)
        return np.array([other.at(t) for other in self.others]).reshape(-1, n + 1)

    @cached_property
    def _min_squared_distances(self) -> Array:
        """(others,) squares of the least distances [m^2]."""
        distances = []
        for other, places in zip(self.others, self._places, strict=True):
            distance = other.radius + self.radius
            near = min(abs(places[0] - self.ends[0]), abs(places[-1] - self.ends[1]))
            distances.append(max(distance, min(distance + _MARGIN, near)) - 1e-9)
        return np.array(distances) ** 2

    def stays(self, point: complex) -> Indices:
        """(first_still_step + 1,) first step at or after each one in which a place is not free."""
        free = self._free(self._places - point)
        until = np.full(self.first_still_step + 1, NEVER)
        if not free[-1]:
            until[-1] = self.first_still_step
        inner = (
            free[:-1].reshape(-1, self.samples_per_step).all(axis=1)
            & free[self.samples_per_step :: self.samples_per_step]
        )
        for k in range(self.first_still_step - 1, -1, -1):
            until[k] = until[k + 1] if inner[k] else k
        return until

    def departures(self, first: complex, last: complex, n: int, since: int, until: int) -> int:
        """First step at which a leg can begin and meets nobody; NEVER if there is none.

        Args:
            first, last: places at its ends.
            n: number of its steps.
            since, until: range of the step.
        """
        way = np.asarray(first + (last - first) * _phase(n, self.samples_per_step), dtype=complex)
        # All later departures are equal, since everybody stands.
        final = min(until, max(since, self.first_still_step))
        if since > final:
            return NEVER
        if self._meets_nobody(way, np.array([since]), 1)[0]:
            return since
        later = np.arange(since + 1, final + 1)
        for k in later[self._meets_nobody(way, later, _COARSE_STRIDE)]:
            if self._meets_nobody(way, k[None], 1)[0]:
                return int(k)
        return NEVER

    def _meets_nobody(self, way: Complex, since: Indices, stride: int) -> Mask:
        """(n,) bool, whether a way that begins at steps (n,) is free, checked with a stride."""
        k = np.arange(0, len(way), stride)
        index = np.minimum(
            since[:, None] * self.samples_per_step + k,
            self.first_still_step * self.samples_per_step,
        )
        return np.asarray(self._free(self._places[:, index] - way[k]).all(axis=1))

    def _free(self, gaps: Complex) -> Mask:
        """(...) whether gaps (others, ...) are all large enough."""
        min_squared = self._min_squared_distances.reshape(-1, *(1,) * (gaps.ndim - 1))
        return np.all(gaps.real**2 + gaps.imag**2 >= min_squared, axis=0)


@cache
def _phase(n: int, samples_per_step: int) -> Array:
    """(n parts + 1,) share of a leg of n steps that is completed at its samples."""
    s = np.arange(samples_per_step) / samples_per_step
    coef = stepping.leg_progress(n)
    return np.append(polynomial.evaluate(coef[:, None], s[None])[0].ravel(), 1.0)
