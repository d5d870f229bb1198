"""Straight moves that take their time exactly on a controller with ramps of speed.

Between set points a controller goes straight at an even speed v, and ramps at acceleration a from
one speed to the next. A move of length d that begins at v0 and ends at v1 takes T if

    d = v T - (v - v0)^2 / 2a - (v - v1)^2 / 2a,   v0 = min(v before, v, junction), v1 alike

The speeds of all moves follow together, by iteration; it converges while the motion's own
acceleration is below half of the controller's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fantoccini.base import Array, Indices, Mask, StandError, Times

LONG_HOLD = 0.5
"""Holds from here on are dwells [s]; in shorter ones a motor creeps by a step."""
DWELL = 0.05
"""Dwells of GRBL are multiples of this [s]."""
_CREEP = 0.02
"""Slowest move [units/s]; GRBL goes at 1 a minute at least."""
_SWEEPS = 400
_CONVERGED = 1e-9


@dataclass(frozen=True, eq=False)
class Limits:
    """What the controller's planner keeps; n axes.

    Attributes:
        steps: (n,) per unit.
        rate, acceleration: (n,) largest [units/s, units/s^2].
        junction: deviation at junctions [units].
        planner: moves that it looks ahead.
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
        begin: (m,) when each begins [s].
        seconds: (m,) how long it takes.
        target: (m, n) steps where it ends.
        length: (m,) of its path [units]; 0 of a dwell.
        speed: (m,) that it is to have [units/s]; 0 of a dwell.
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
        """(m,) whether it is a dwell."""
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
    for first, last in _runs(length):
        own = slice(first, last)
        speed[own] = _speeds(begin[own], end[own] - begin[own], delta[own], length[own], limits)
    return TimedMoves(begin, end - begin, target, length, speed)


def _moves(t: Times, counts: Indices, limits: Limits) -> tuple[Array, Array, Indices]:
    """Begin, end and target of every move: holds become dwells and creeping steps."""
    begin: list[float] = []
    end: list[float] = []
    target: list[Indices] = []

    def add(first: float, last: float, where: Indices) -> None:
        begin.append(first)
        end.append(last)
        target.append(where)

    held = t[0]  # since when nothing moves
    for i in range(len(t) - 1):
        delta = counts[i + 1] - counts[i]
        if not np.any(delta):
            continue
        if t[i] - held >= LONG_HOLD:
            dwell = np.floor((t[i] - held) / DWELL - 1.0) * DWELL
            add(held, held + dwell, counts[i])
            held += dwell
        if t[i] > held and np.max(np.abs(delta)) > 1:
            k = int(np.argmax(np.abs(delta)))
            creep = np.zeros_like(delta)
            least = np.ceil((t[i] - held) * _CREEP * limits.steps[k])
            creep[k] = np.sign(delta[k]) * min(max(1, least), abs(delta[k]) - 1)
            add(held, t[i], counts[i] + creep)
            held = t[i]
        add(held, t[i + 1], counts[i + 1])
        held = t[i + 1]
    if t[-1] > held:
        add(held, t[-1], counts[-1])
    return np.array(begin), np.array(end), np.array(target).reshape(-1, counts.shape[1])


def _runs(length: Array) -> list[tuple[int, int]]:
    """First and last place of moves without a dwell between them."""
    edges = [-1, *np.flatnonzero(length == 0.0).tolist(), len(length)]
    return [(a + 1, b) for a, b in pairwise(edges) if b > a + 1]


def _speeds(begin: Array, T: Array, delta: Array, length: Array, limits: Limits) -> Array:
    """(m,) speeds of moves from rest to rest."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.abs(delta) / length[:, None]
        a = np.min(limits.acceleration / share, axis=1)
        most = np.min(limits.rate / share, axis=1)
        junction = _junctions(delta / length[:, None], limits)
    v = length / T
    changed = np.inf
    for _ in range(_SWEEPS):
        before = np.minimum(np.append(0.0, v[:-1]), np.append(0.0, junction))
        after = np.minimum(np.append(v[1:], 0.0), np.append(junction, 0.0))
        new = _speed(T, length, a, before, after)
        changed = float(np.max(np.abs(new - v) / new))
        v = new
        if changed < _CONVERGED:
            break
    low = np.minimum(before, v), np.minimum(after, v)
    ramps = ((v - low[0]) + (v - low[1])) / a
    wrong = (ramps > T * (1.0 + 1e-6)) | (v > most * (1.0 + 1e-9)) | ~np.isfinite(v)
    if changed >= _CONVERGED or np.any(wrong):
        i = int(np.argmax(wrong)) if np.any(wrong) else int(np.argmax(np.abs(new - v)))
        raise StandError(
            f"the controller cannot keep the time of the move at t = {begin[i]:.3f} s: its ramps "
            f"are too slow for {length[i] / T[i]:.4g} mm/s there; needed: a gentler motion, or "
            "more acceleration of the axes"
        )
    _look_ahead(begin, T, length, a, low[0], limits)
    return v


def _speed(T: Array, d: Array, a: Array, before: Array, after: Array) -> Array:
    """(m,) speeds with which moves take their times, by Newton's method from below."""
    v = d / T
    for _ in range(60):
        up, down = np.maximum(v - before, 0.0), np.maximum(v - after, 0.0)
        slope = np.maximum(T - (up + down) / a, 1e-3 * T)
        step = (d - v * T + (up**2 + down**2) / (2.0 * a)) / slope
        v = np.maximum(v + step, 1e-12)
        if np.max(np.abs(step) / v) < 1e-13:
            break
    return v


def _junctions(direction: Array, limits: Limits) -> Array:
    """(m - 1,) speeds at which the path may turn from one move to the next."""
    cosine = np.clip(np.sum(direction[:-1] * direction[1:], axis=1), -1.0, 1.0)
    turn = np.diff(direction, axis=0)
    size = np.linalg.norm(turn, axis=1)
    a = np.min(limits.acceleration * size[:, None] / np.abs(turn), axis=1, initial=np.inf)
    half = np.sqrt((1.0 + cosine) / 2.0)  # sine of half the angle between them
    speed = np.sqrt(a * limits.junction * half / (1.0 - half))
    return np.where(cosine > 0.999999, np.inf, np.where(cosine < -0.999999, 0.0, speed))


def _look_ahead(
    begin: Array, T: Array, length: Array, a: Array, entry: Array, limits: Limits
) -> None:
    """Raises a StandError where the machine could not stop within the moves that are known."""
    known = limits.planner - 1
    energy = np.append(0.0, np.cumsum(2.0 * a * length))
    for i in range(len(length) - known):
        if entry[i] ** 2 > energy[i + known] - energy[i]:
            seconds = float(np.sum(T[i : i + known]))
            raise StandError(
                f"the controller looks {known} moves ahead, {seconds:.3f} s at t = {begin[i]:.3f} "
                f"s, and could not stop in them from {entry[i]:.4g} mm/s; needed: fewer set points "
                "per second (--rate)"
            )
