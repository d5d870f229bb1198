"""Other players on the stage over time: free places, and free departures of legs.

    free(p, t):  |p - o(t)| >= r + r_o   for every other, at samples at most 20 ms apart

Time is counted in steps from the beginning. After the last motion all players stand.

p is a place of the puppet and o(t) that of another player, r and r_o are their radii. A leg is a
straight part of a path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from fantoccini.base import Array, Indices, Mask, Times, frozen, polynomial
from fantoccini.theatre.gestures import Complex, stepping
from fantoccini.theatre.pathfinding.regions import Disk

MAX_SAMPLE_INTERVAL = 0.02
"""Longest time between two checks of a motion [s]."""
_SAMPLING_MARGIN = 1e-3
"""Extra distance from moving players, for the time between two samples [m]."""
_STANDING_TOLERANCE = 1e-9
"""Displacement up to which a player counts as standing [m]."""
_COARSE_STRIDE = 8
"""Stride of the samples that are checked before all others."""
NEVER = 1 << 40
"""Step index that means no step."""


@dataclass(frozen=True, eq=False)
class OtherPlayer:
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
        x, y = (np.interp(t, self.times, self.xy[:, axis]) for axis in (0, 1))
        return np.asarray(x + 1j * y)

    def last_motion(self) -> float:
        """End of its last motion [s]; minus infinity if it always stands."""
        moving = np.flatnonzero(np.any(np.abs(self.xy - self.xy[-1]) > _STANDING_TOLERANCE, axis=1))
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
        pauses: steps before and after each leg in which the puppet stands.
    """

    others: Sequence[OtherPlayer]
    begin: float
    step_time: float
    radius: float
    ends: tuple[complex, complex]
    pauses: tuple[int, int]

    @cached_property
    def samples_per_step(self) -> int:
        """Number of samples of a step."""
        return int(np.ceil(self.step_time / MAX_SAMPLE_INTERVAL - 1e-9))

    @cached_property
    def all_standing_step(self) -> int:
        """First step at whose start all players stand, and do not move afterwards."""
        last_motion = max((other.last_motion() for other in self.others), default=self.begin)
        return max(0, int(np.ceil((last_motion - self.begin) / self.step_time - 1e-9)))

    @cached_property
    def _places(self) -> Complex:
        """(others, n) places at the samples until all players stand."""
        n = self.all_standing_step * self.samples_per_step
        t = np.linspace(self.begin, self.begin + self.all_standing_step * self.step_time, n + 1)
        return np.array([other.at(t) for other in self.others]).reshape(-1, n + 1)

    @cached_property
    def _min_squared_distances(self) -> Array:
        """(others,) squares of the least distances [m^2]."""
        distances = []
        for other, places in zip(self.others, self._places, strict=True):
            distance = other.radius + self.radius
            end_distance = min(abs(places[0] - self.ends[0]), abs(places[-1] - self.ends[1]))
            distances.append(max(distance, min(distance + _SAMPLING_MARGIN, end_distance)) - 1e-9)
        return np.array(distances) ** 2

    def occupied_steps(self, point: complex) -> Indices:
        """(all_standing_step + 1,) first step at or after each one in which a place is not free."""
        is_free = self._are_free(self._places - point)
        steps = np.full(self.all_standing_step + 1, NEVER)
        if not is_free[-1]:
            steps[-1] = self.all_standing_step
        is_step_free = (
            is_free[:-1].reshape(-1, self.samples_per_step).all(axis=1)
            & is_free[self.samples_per_step :: self.samples_per_step]
        )
        for k in range(self.all_standing_step - 1, -1, -1):
            steps[k] = steps[k + 1] if is_step_free[k] else k
        return steps

    def departures(self, first: complex, last: complex, n: int, earliest: int, latest: int) -> int:
        """First step at which a leg can begin and meets nobody; NEVER if there is none.

        Args:
            first, last: places at its ends.
            n: number of its steps, with its pauses.
            earliest, latest: range of the step.
        """
        path = np.asarray(
            first + (last - first) * _leg_progress(n, self.samples_per_step, self.pauses),
            dtype=complex,
        )
        # All later departures are equal, since everybody stands.
        last_tried = min(latest, max(earliest, self.all_standing_step))
        if earliest > last_tried:
            return NEVER
        if self._meets_nobody(path, np.array([earliest]), 1)[0]:
            return earliest
        later_steps = np.arange(earliest + 1, last_tried + 1)
        for step in later_steps[self._meets_nobody(path, later_steps, _COARSE_STRIDE)]:
            if self._meets_nobody(path, step[None], 1)[0]:
                return int(step)
        return NEVER

    def _meets_nobody(self, path: Complex, start_steps: Indices, stride: int) -> Mask:
        """(n,) bool, whether a path that begins at steps (n,) is free, checked with a stride."""
        samples = np.arange(0, len(path), stride)
        index = np.minimum(
            start_steps[:, None] * self.samples_per_step + samples,
            self.all_standing_step * self.samples_per_step,
        )
        return np.asarray(self._are_free(self._places[:, index] - path[samples]).all(axis=1))

    def _are_free(self, gaps: Complex) -> Mask:
        """(...) whether gaps (others, ...) are all large enough."""
        min_squared = self._min_squared_distances.reshape(-1, *(1,) * (gaps.ndim - 1))
        return np.all(gaps.real**2 + gaps.imag**2 >= min_squared, axis=0)


@cache
def _leg_progress(n: int, samples_per_step: int, pauses: tuple[int, int]) -> Array:
    """(n samples_per_step + 1,) share of a leg of n steps that is completed at its samples."""
    before, after = pauses
    shares = np.arange(samples_per_step) / samples_per_step
    coef = stepping.leg_progress(n - before - after)
    moving = polynomial.evaluate(coef[:, None], shares[None])[0].ravel()
    return np.pad(
        moving,
        (before * samples_per_step, after * samples_per_step + 1),
        constant_values=(0.0, 1.0),
    )
