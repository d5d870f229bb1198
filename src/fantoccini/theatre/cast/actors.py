"""Players while their cues are placed, and what rounds of compiling have found out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, MaskRows, Times
from fantoccini.theatre.cast.casting import Player
from fantoccini.theatre.cast.cues import lane_name
from fantoccini.theatre.cast.footing import Footing, Way
from fantoccini.theatre.gestures import Gesture, Line
from fantoccini.theatre.script import Spot

_SAME_TIME = 1e-9
"""Difference of times that counts as none [s]."""
_TRACK = 0.05
"""Between samples of a walk, which is straight between them [s]."""


class CannotBe(Exception):
    """A cue cannot be done; the text says why, and what can."""


@dataclass
class Actor:
    """A player while its cues are placed.

    Attributes:
        player: who.
        lanes: motions that add up: the walks, and gestures beside one another.
        ways: the walks so far, in order.
        played: the gestures so far: lane, start and end [s], and what they move.
        done: end of the last cue [s].
        away: whether it has gone off.
    """

    player: Player
    lanes: list[Line]
    ways: list[Way] = field(default_factory=list)
    played: list[tuple[int, float, float, MaskRows]] = field(default_factory=list)
    done: float = 0.0
    away: bool = False

    def stands(self, t: float) -> Footing:
        """Where it stands at a time [s]."""
        way = next((one for one in reversed(self.ways) if one.begin <= t), None)
        if way is None:
            return self.player.start
        xy, heading = way.footing(np.array([t]))
        return Footing(float(xy[0, 0]), float(xy[0, 1]), float(heading[0]))

    def kept(self) -> Actor:
        """The actor as it is now: what is added to this one does not change it."""
        lanes = [line.kept() for line in self.lanes]
        return replace(self, lanes=lanes, ways=list(self.ways), played=list(self.played))

    def lane(self, gesture: Gesture, begin: float) -> tuple[int, float]:
        """The lane of a gesture, and when it can begin there [s].

        It is the first lane that is free then, or a new one. Where other gestures move the same
        strings then, it begins after them, in the lane of the last.
        """
        busy = [
            (until, lane)
            for lane, _, until, named in self.played
            if until > begin + _SAME_TIME and np.any(named & gesture.named)
        ]
        if busy:
            until, lane = max(busy)
            return lane, max(until, begin)
        for i, line in enumerate(self.lanes[1:], 1):
            if line.end + line.lead_time(gesture.motion) <= begin + _SAME_TIME:
                return i, begin
        if len(self.lanes) > 1 and all(until <= begin for _, _, until, _ in self.played):
            return 1, begin
        self.lanes.append(Line(self.lanes[0].most))
        return len(self.lanes) - 1, begin

    def add(self, lane: int, gesture: Gesture, begin: float) -> float:
        """Adds a gesture that is to begin at a time; when it does [s]."""
        line = self.lanes[lane]
        line.wait(gesture.motion, begin)
        return line.add(gesture.motion)

    def rests(self) -> float:
        """Brings all its strings to rest; when they are [s]."""
        for line in self.lanes:
            line.rest()
        return max(line.end for line in self.lanes)

    def motion(self, until: float) -> tuple[Gesture, dict[str, Gesture]]:
        """All that it does until a time [s], and its lanes."""
        lanes = {}
        for i, line in enumerate(self.lanes):
            line.hold(until)
            label = lane_name(self.player.name, i)
            lanes[label] = Gesture(self.player.alone.coordinates, *line.motion, label)
        whole, *others = lanes.values()
        for other in others:
            whole += other
        return whole, lanes

    @property
    def last(self) -> Footing:
        """Where it stands after all walks."""
        return self.stands(np.inf)

    def track(self) -> tuple[Times, Array]:
        """(T,) times and (T, 2) places, straight between them."""
        t, xy = [0.0], [[self.player.start.x, self.player.start.y]]
        for way in self.ways:
            if not way.steps:
                continue
            own = np.append(np.arange(way.begin, way.end, _TRACK), way.end)
            own = own[own > t[-1]]
            t += own.tolist()
            xy += way.footing(own)[0].tolist()
        return np.array(t), np.array(xy)


@dataclass(frozen=True)
class Wishes:
    """Results of earlier rounds of compiling about cues.

    Attributes:
        earlier: (cue, player) -> by how much its hands begin earlier, as limbs lag [s].
        pauses: cue -> by how much later it begins, for swing [s].
        refused: cue -> why it cannot be done.
        smaller: cue -> factor of its size.
        hangs: cue -> how far from the elbow the handle hangs that is given or put down, and its
            height [m].
        calms: (cue, player) -> by how much its hands take out swing before it: see
            ``calming``.
        stands: cue -> where the prop stands that is picked up, or the seat.
        approaches: cue -> which way to come up to a seat is tried.
    """

    earlier: Mapping[tuple[Spot, str], float] = field(default_factory=dict)
    pauses: Mapping[Spot, float] = field(default_factory=dict)
    refused: Mapping[Spot, str] = field(default_factory=dict)
    smaller: Mapping[Spot, float] = field(default_factory=dict)
    hangs: Mapping[Spot, tuple[float, float]] = field(default_factory=dict)
    calms: Mapping[tuple[Spot, str], tuple[float, ...]] = field(default_factory=dict)
    stands: Mapping[Spot, Footing] = field(default_factory=dict)
    approaches: Mapping[Spot, int] = field(default_factory=dict)

    def setting(self, kind: str, key: object, value: object | None) -> Wishes:
        """The same with a value of a kind, the name of an attribute; None removes it."""
        own = {**getattr(self, kind), key: value}
        return replace(self, **{kind: {one: own[one] for one in own if own[one] is not None}})
