"""Straight moves that take exactly their given times on a controller with speed ramps.

Between set points a controller moves straight at a constant speed v, and ramps with acceleration a
from one speed to the next. A move of length d that begins at v0 and ends at v1 takes the time T if

    d = v T - (v - v0)^2 / 2a - (v - v1)^2 / 2a,   v0 = min(v before, v, junction), v1 likewise

The speeds of all moves are computed together by an iteration. It converges if the acceleration of
the motion is less than half of the controller's.

A set point is the position of every axis, a motor of the stand, at one time. A junction is the
corner between two moves, and a dwell a pause.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fantoccini.base import Array, Indices, Mask, StandError, Times

MIN_HOLD = 0.5
"""Shortest hold that becomes a dwell [s]; in shorter ones a motor creeps by a step."""
DWELL = 0.05
"""Time unit of GRBL's dwells [s]."""
MIN_SPEED = 0.02
"""Speed of creeping moves [units/s]; GRBL's minimum is 1 unit per minute."""
MAX_ITERATIONS = 400
"""Largest number of iterations for the speeds."""
SPEED_TOLERANCE = 1e-9
"""Relative change of the speeds at which the iteration ends."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of the controller's planner; n axes.

    Attributes:
        steps: (n,) steps per unit.
        rate, acceleration: (n,) largest values [units/s, units/s^2].
        junction: deviation at junctions [units].
        planner: number of moves that it looks ahead.
    """

    steps: Array
    rate: Array
    acceleration: Array
    junction: float
    planner: int


@dataclass(frozen=True, eq=False)
class TimedMoves:
    """m moves and dwells, one after the other.

    Attributes:
        begin: (m,) start times [s].
        seconds: (m,) durations [s].
        target: (m, n) end positions [steps].
        length: (m,) path lengths [units]; 0 for a dwell.
        speed: (m,) programmed speeds [units/s]; 0 for a dwell.
    """

    begin: Array
    seconds: Array
    target: Indices
    length: Array
    speed: Array

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def dwells(self) -> Mask:
        """(m,) mask of the dwells."""
        return self.length == 0.0


def timed_moves(t: Times, counts: Indices, limits: Limits) -> TimedMoves:
    """Moves through set points (T, n) [steps] at times t.

    Raises:
        StandError: the controller cannot keep the times.
    """
    begin, end, target = _moves(t, counts, limits)
    delta = np.diff(np.vstack([counts[:1], target]), axis=0) / limits.steps
    length = np.linalg.norm(delta, axis=1)
    speed = np.zeros(len(begin))
    for first, last in _moves_without_dwell(length):
        moves = slice(first, last)
        speed[moves] = _solve_speeds(
            begin[moves], end[moves] - begin[moves], delta[moves], length[moves], limits
        )
    return TimedMoves(begin, end - begin, target, length, speed)


def _moves(t: Times, counts: Indices, limits: Limits) -> tuple[Array, Array, Indices]:
    """Start, end and target of every move; long holds become dwells, short ones creeping steps."""
    begin: list[float] = []
    end: list[float] = []
    target: list[Indices] = []

    def add_move(first: float, last: float, position: Indices) -> None:
        begin.append(first)
        end.append(last)
        target.append(position)

    last_end = t[0]  # end of the last move
    for i in range(len(t) - 1):
        step_counts = counts[i + 1] - counts[i]
        if not np.any(step_counts):
            continue
        if t[i] - last_end >= MIN_HOLD:
            dwell = np.floor((t[i] - last_end) / DWELL - 1.0) * DWELL
            add_move(last_end, last_end + dwell, counts[i])
            last_end += dwell
        if t[i] > last_end and np.max(np.abs(step_counts)) > 1:
            k = int(np.argmax(np.abs(step_counts)))
            creep_steps = np.zeros_like(step_counts)
            steps = np.ceil((t[i] - last_end) * MIN_SPEED * limits.steps[k])
            creep_steps[k] = np.sign(step_counts[k]) * min(max(1, steps), abs(step_counts[k]) - 1)
            add_move(last_end, t[i], counts[i] + creep_steps)
            last_end = t[i]
        add_move(last_end, t[i + 1], counts[i + 1])
        last_end = t[i + 1]
    if t[-1] > last_end:
        add_move(last_end, t[-1], counts[-1])
    return np.array(begin), np.array(end), np.array(target).reshape(-1, counts.shape[1])


def _moves_without_dwell(length: Array) -> list[tuple[int, int]]:
    """Index ranges (first, end) of consecutive moves without a dwell between them."""
    edges = [-1, *np.flatnonzero(length == 0.0).tolist(), len(length)]
    return [(a + 1, b) for a, b in pairwise(edges) if b > a + 1]


def _solve_speeds(begin: Array, T: Array, delta: Array, length: Array, limits: Limits) -> Array:
    """(m,) speeds of consecutive moves; the first begins and the last ends at rest."""
    with np.errstate(divide="ignore", invalid="ignore"):
        components = np.abs(delta) / length[:, None]
        a = np.min(limits.acceleration / components, axis=1)
        max_speed = np.min(limits.rate / components, axis=1)
        junction = _junction_speeds(delta / length[:, None], limits)
    v = length / T
    change = np.inf
    for _ in range(MAX_ITERATIONS):
        entry_limits = np.minimum(np.append(0.0, v[:-1]), np.append(0.0, junction))
        exit_limits = np.minimum(np.append(v[1:], 0.0), np.append(junction, 0.0))
        new_v = _speeds_between(T, length, a, entry_limits, exit_limits)
        change = float(np.max(np.abs(new_v - v) / new_v))
        v = new_v
        if change < SPEED_TOLERANCE:
            break
    slowest = np.minimum(entry_limits, v), np.minimum(exit_limits, v)
    ramps = ((v - slowest[0]) + (v - slowest[1])) / a
    unreachable = (ramps > T * (1.0 + 1e-6)) | (v > max_speed * (1.0 + 1e-9)) | ~np.isfinite(v)
    if change >= SPEED_TOLERANCE or np.any(unreachable):
        i = (
            int(np.argmax(unreachable))
            if np.any(unreachable)
            else int(np.argmax(np.abs(new_v - v)))
        )
        raise StandError(
            f"the controller cannot keep the time of the move at t = {begin[i]:.3f} s: its ramps "
            f"are too slow for {length[i] / T[i]:.4g} mm/s there; needed: a gentler motion, or "
            "axes with more acceleration"
        )
    _check_look_ahead(begin, T, length, a, slowest[0], limits)
    return v


def _speeds_between(T: Array, d: Array, a: Array, entry_limits: Array, exit_limits: Array) -> Array:
    """(m,) speeds with which moves take their times between given speeds, by Newton's method."""
    v = d / T
    for _ in range(60):
        rise, fall = np.maximum(v - entry_limits, 0.0), np.maximum(v - exit_limits, 0.0)
        slope = np.maximum(T - (rise + fall) / a, 1e-3 * T)
        step = (d - v * T + (rise**2 + fall**2) / (2.0 * a)) / slope
        v = np.maximum(v + step, 1e-12)
        if np.max(np.abs(step) / v) < 1e-13:
            break
    return v


def _junction_speeds(direction: Array, limits: Limits) -> Array:
    """(m - 1,) largest speeds at the junctions of the moves."""
    cosine = np.clip(np.sum(direction[:-1] * direction[1:], axis=1), -1.0, 1.0)
    direction_change = np.diff(direction, axis=0)
    length = np.linalg.norm(direction_change, axis=1)
    a = np.min(
        limits.acceleration * length[:, None] / np.abs(direction_change), axis=1, initial=np.inf
    )
    sine = np.sqrt((1.0 + cosine) / 2.0)  # sine of half the angle between them
    speed = np.sqrt(a * limits.junction * sine / (1.0 - sine))
    return np.where(cosine > 0.999999, np.inf, np.where(cosine < -0.999999, 0.0, speed))


def _check_look_ahead(
    begin: Array, T: Array, length: Array, a: Array, entry_speeds: Array, limits: Limits
) -> None:
    """Raises a StandError if the machine could not stop within the moves that it looks ahead."""
    moves_ahead = limits.planner - 1
    energy = np.append(0.0, np.cumsum(2.0 * a * length))
    for i in range(len(length) - moves_ahead):
        if entry_speeds[i] ** 2 > energy[i + moves_ahead] - energy[i]:
            seconds = float(np.sum(T[i : i + moves_ahead]))
            raise StandError(
                f"the controller looks {moves_ahead} moves ahead, {seconds:.3f} s at t = "
                f"{begin[i]:.3f} s, and could not stop within them from {entry_speeds[i]:.4g} "
                "mm/s; needed: fewer set points per second (--rate)"
            )
