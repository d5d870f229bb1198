"""A planner of moves like GRBL's: straight moves, trapezoids of speed, looked ahead.

    entry^2 <= next entry^2 + 2 a d,   junction^2 = a deviation s / (1 - s),   s = sin(angle / 2)

Written from GRBL's published description; it shares no code with it. A move goes to the motors when
as many moves as the planner holds follow it, or when all are let go.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from fantoccini.arrays import Array, Indices, Times

LEAST_RATE = 1.0 / 60.0
"""Slowest move [units/s]."""
_STRAIGHT = 0.999999
"""Cosine of an angle beyond which a path goes straight on, or back."""


@dataclass(frozen=True, eq=False)
class GrblSettings:
    """What a controller is told of its machine; n axes. Units are mm, or degrees of a turn.

    Attributes:
        letters: of the axes, in order.
        steps: (n,) steps per unit.
        rate: (n,) largest speeds [units/s].
        acceleration: (n,) largest accelerations [units/s^2].
        junction: deviation at junctions [mm].
        reversed: which motors turn backwards.
        planner: moves that it looks ahead.
        buffer: characters that its serial buffer holds.
    """

    letters: str
    steps: Array
    rate: Array
    acceleration: Array
    junction: float
    reversed: tuple[bool, ...]
    planner: int = 16
    buffer: int = 128

    def lines(self) -> list[str]:
        """As GRBL's own settings, ``$100=...``."""
        mask = sum(1 << k for k, back in enumerate(self.reversed) if back)
        found = [f"$3={mask}", f"$11={self.junction:.3f}"]
        for k in range(len(self.letters)):
            found += [
                f"${100 + k}={self.steps[k]:.3f}",
                f"${110 + k}={60.0 * self.rate[k]:.3f}",
                f"${120 + k}={self.acceleration[k]:.3f}",
            ]
        return found


@dataclass(eq=False)
class Block:
    """A straight move.

    Attributes:
        begin, delta: (n,) steps where it begins, and that it makes.
        length: of its path [units].
        rate: at which it is to go [units/s].
        acceleration: along the path [units/s^2].
        junction: largest speed at its beginning [units/s].
        entry: speed at its beginning [units/s].
        t, leave: when it begins [s] and its speed at the end, once it is done.
    """

    begin: Indices
    delta: Indices
    length: float
    rate: float
    acceleration: float
    junction: float
    entry: float = 0.0
    t: float = 0.0
    leave: float = 0.0

    def phases(self) -> tuple[float, float, float, float]:
        """Top speed, and times of speeding up, going evenly and slowing down [s]."""
        a, d, v0, v1 = self.acceleration, self.length, self.entry, self.leave
        top = min(self.rate, math.sqrt(max(a * d + (v0 * v0 + v1 * v1) / 2.0, 0.0)))
        top = max(top, v0, v1)
        up, down = (top - v0) / a, (top - v1) / a
        even = (d - (top + v0) / 2.0 * up - (top + v1) / 2.0 * down) / top
        return top, up, max(even, 0.0), down

    @property
    def duration(self) -> float:
        """Of the move [s]."""
        return sum(self.phases()[1:])

    def done(self, t: Times) -> Array:
        """(T,) which part of the path is behind at times since its beginning."""
        top, up, even, down = self.phases()
        a = self.acceleration
        first = np.clip(t, 0.0, up)
        second = np.clip(t - up, 0.0, even)
        third = np.clip(t - up - even, 0.0, down)
        s = self.entry * first + a * first**2 / 2.0 + top * second
        return np.minimum((s + top * third - a * third**2 / 2.0) / self.length, 1.0)


@dataclass(eq=False)
class Planner:
    """Moves that wait, and moves that were made.

    Attributes:
        settings: of the machine.
        waiting: moves that may still change.
        made: moves that were made, in order.
        time: when the last of them ended [s].
        steps: (n,) where the last planned move ends.
    """

    settings: GrblSettings
    waiting: deque[Block] = field(default_factory=deque)
    made: list[Block] = field(default_factory=list)
    time: float = 0.0
    steps: Indices = field(init=False)
    _direction: Array | None = None
    _rate: float = 0.0

    def __post_init__(self) -> None:
        self.steps = np.zeros(len(self.settings.letters), dtype=np.int64)

    def add(self, target: Indices, rate: float, minutes: bool) -> None:
        """A move to steps (n,).

        Args:
            target: where to.
            rate: speed [units/s], or moves per second.
            minutes: whether it is the latter.
        """
        own = self.settings
        delta = target - self.steps
        if not np.any(delta):
            return  # too short for a step: no move at all
        along = delta / own.steps
        length = float(np.linalg.norm(along))
        direction = along / length
        used = direction != 0.0
        share = np.abs(direction[used])
        wanted = rate * length if minutes else rate
        block = Block(
            self.steps.copy(), delta, length,
            max(min(wanted, float(np.min(own.rate[used] / share))), LEAST_RATE),
            float(np.min(own.acceleration[used] / share)),
            self._junction(direction),
        )  # fmt: skip
        block.junction = min(block.junction, self._rate, block.rate)
        self.steps = target
        self._direction, self._rate = direction, block.rate
        self.waiting.append(block)
        self._plan()
        while len(self.waiting) >= own.planner:
            self._make()

    def finish(self) -> None:
        """Makes all moves that wait; the machine stands."""
        while self.waiting:
            self._make()
        self._direction, self._rate = None, 0.0

    def clear(self) -> None:
        """Drops all moves that wait; the machine stands where the last one ended."""
        if self.waiting:
            self.steps = self.waiting[0].begin
        self.waiting.clear()
        self._direction, self._rate = None, 0.0

    def wait(self, seconds: float) -> None:
        """Makes all moves, then stands."""
        self.finish()
        self.time += seconds

    def steps_at(self, times: Times) -> Indices:
        """(T, n) steps counted by the motors at times [s]."""
        out = np.zeros((len(times), len(self.settings.letters)), dtype=np.int64)
        begins = np.array([block.t for block in self.made])
        at = np.searchsorted(begins, times, side="right") - 1
        for k in np.unique(at[at >= 0]):
            block, chosen = self.made[k], at == k
            events = int(np.max(np.abs(block.delta)))
            beats = np.floor(block.done(times[chosen] - block.t) * events + 1e-6)
            share = np.abs(block.delta) / events
            made = np.floor(beats[:, None] * share + 0.5).astype(np.int64)
            out[chosen] = block.begin + np.sign(block.delta) * made
        return out

    def _junction(self, direction: Array) -> float:
        """Speed with which a path may turn [units/s]."""
        if self._direction is None:
            return 0.0
        cosine = -float(np.dot(self._direction, direction))
        if cosine > _STRAIGHT:
            return 0.0
        if cosine < -_STRAIGHT:
            return math.inf
        turn = direction - self._direction
        share = np.abs(turn / np.linalg.norm(turn))
        used = share > 0.0
        a = float(np.min(self.settings.acceleration[used] / share[used]))
        s = math.sqrt((1.0 - cosine) / 2.0)
        return math.sqrt(a * self.settings.junction * s / (1.0 - s))

    def _plan(self) -> None:
        """Entry speeds of what waits; the first one's is what the move before it left."""
        blocks, after = self.waiting, 0.0
        for k in range(len(blocks) - 1, 0, -1):
            block = blocks[k]
            reach = math.sqrt(after * after + 2.0 * block.acceleration * block.length)
            block.entry = after = min(block.junction, reach)
        for k in range(1, len(blocks)):
            before = blocks[k - 1]
            reach = math.sqrt(before.entry**2 + 2.0 * before.acceleration * before.length)
            blocks[k].entry = min(blocks[k].entry, reach)

    def _make(self) -> None:
        block = self.waiting.popleft()
        block.t, block.leave = self.time, self.waiting[0].entry if self.waiting else 0.0
        self.time += block.duration
        self.made.append(block)
