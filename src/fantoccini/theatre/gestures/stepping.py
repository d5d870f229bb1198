"""Steps over a floor, and their path: arcs, each walked from rest to rest.

    z(t) = z_0 + L s exp(i (theta_0 + phi / 2)) sinc(phi / 2),   phi = A s,   theta = theta_0 + phi

z = x + i y is the middle between the shoulders' ends, theta its heading. Equal steps in a row are
a leg, from (z_0, theta_0) on: L and A are the sums of its steps' lengths and turns. s(t) goes from
0 to 1, at constant speed except in its first and last step. Every leg begins and ends at rest, so
that no turn extends into the way before it: the path is a sequence of arcs.

L is the length of the leg, A the angle by which it turns, and phi the angle turned so far.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from fantoccini.base import Array, Times, check_positive, polynomial
from fantoccini.theatre.gestures.ends import Complex, ComplexCurve, Curve

STEP_TIME = 0.6
"""Default duration of a step [s]."""
MAX_STEP_LENGTH, MAX_STEP_TURN = 1.0, 0.5 * np.pi
"""Bounds of a step: length [m] and turn [rad]."""
_BOUND_TOLERANCE = 1e-9
"""Tolerance of the bounds of steps, for rounded shares of a whole [m, rad]."""
_SINGLE_STEP_PROGRESS = polynomial.MINIMUM_JERK
_CONSTANT_SPEED_PROGRESS = np.array([0, 1.0, 0, 0, 0, 0])
_ACCELERATING_PROGRESS = np.array([0, 0, 0, 1.0, -0.5, 0])
"""Progress over the time of a step: from rest to rest, at constant speed, from rest to speed."""


@dataclass(frozen=True)
class Step:
    """A step.

    Attributes:
        length: length forward; below 0 backward, 0 on the spot [m].
        turn: turn to the left [rad].

    Raises:
        ValueError: it is longer than 1 m, turns by more than 90 degrees, or is not a number.
    """

    length: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        bounds = {"length": (MAX_STEP_LENGTH, "m"), "turn": (MAX_STEP_TURN, "rad")}
        for name, (bound, unit) in bounds.items():
            value = getattr(self, name)
            if not abs(value) <= bound + _BOUND_TOLERANCE:
                raise ValueError(f"{name} of a step is {value!r}; at most {bound:.4g} {unit}")

    @property
    def stands(self) -> bool:
        """Whether nothing moves in this step."""
        return self.length == 0.0 and self.turn == 0.0


class StepPath:
    """Path and heading of steps over time, from (0, 0) and heading 0.

    Attributes:
        n: number of steps.
        duration: duration of all steps [s].

    Args:
        given: the steps in order; without steps the path is a point.
        step_time: duration of a step [s].
    """

    def __init__(self, steps: Sequence[Step], step_time: float = STEP_TIME):
        check_positive(step_time=step_time)
        self.n, self._time = len(steps), step_time
        self.duration = len(steps) * step_time
        place, heading = 0j, 0.0
        segments: list[tuple[complex, float, float, float]] = []
        progress: list[Array] = [np.zeros((0, polynomial.N_COEF))]
        for step, equal_steps in groupby(steps):
            n = len(list(equal_steps))
            length, turn = n * step.length, n * step.turn
            segments += [(place, heading, length, turn)] * n
            progress.append(leg_progress(n))
            place = place + complex(_arc(length, turn, np.array(1.0))) * np.exp(1j * heading)
            heading += turn
        # One more row holds the end, for times after it.
        columns = zip(*segments, (place, heading, 0.0, 0.0), strict=True)
        self._place, self._heading, self._length, self._turn = (np.array(x) for x in columns)
        self._progress = np.concatenate([*progress, np.zeros((1, polynomial.N_COEF))])

    def at(self, t: Times) -> tuple[ComplexCurve, Curve]:
        """z and theta, with their derivatives, at times (T,) from the first step's start.

        Before the start and after the end they are those at the start and the end.
        """
        step_clock = np.clip(np.asarray(t, dtype=float) / self._time, 0.0, self.n)
        k = step_clock.astype(int)
        s, rate, change = polynomial.evaluate(self._progress[k], step_clock - k)
        rate, change = rate / self._time, change / self._time**2
        length, turn = self._length[k], self._turn[k]
        start_direction = np.exp(1j * self._heading[k])
        forward = start_direction * np.exp(1j * turn * s)
        path = (
            self._place[k] + start_direction * _arc(length, turn, s),
            length * rate * forward,
            length * (change + 1j * turn * rate**2) * forward,
        )
        return path, (self._heading[k] + turn * s, turn * rate, turn * change)


def footing_after(steps: Sequence[Step]) -> tuple[float, float, float]:
    """Position and heading after steps: x, y and the turn, relative to those before [m, rad]."""
    path = StepPath(steps)
    positions, heading = path.at(np.array([path.duration]))
    return float(positions[0][0].real), float(positions[0][0].imag), float(heading[0][0])


def leg_progress(n: int) -> Array:
    """(n, 6) s over each of n equal steps: ascending powers of the time in the step, in steps."""
    if n == 1:
        return _SINGLE_STEP_PROGRESS[None].copy()
    progress = np.tile(_CONSTANT_SPEED_PROGRESS, (n, 1))
    progress[0], progress[-1] = (
        _ACCELERATING_PROGRESS,
        _CONSTANT_SPEED_PROGRESS - _ACCELERATING_PROGRESS,
    )
    progress[1:, 0] = np.arange(1, n) - 0.5
    return progress / (n - 1)


def _arc(length: Array | float, turn: Array | float, s: Array) -> Complex:
    """Chord of the first part s of an arc; sinc has no pole for a straight arc."""
    half_turn = 0.5 * np.asarray(turn) * s
    return np.asarray(length) * s * np.exp(1j * half_turn) * np.sinc(half_turn / np.pi)
