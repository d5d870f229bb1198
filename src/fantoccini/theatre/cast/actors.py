"""Players while their cues are placed, and what rounds of compiling have found out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.cast.casting import Player
from fantoccini.theatre.cast.cues import lane_name
from fantoccini.theatre.cast.footing import Footing, Way
from fantoccini.theatre.gestures import Gesture, Hands
from fantoccini.theatre.script import Spot

_TRACK = 0.05
"""Time between samples of a walk, which is straight between them [s]."""


@dataclass(frozen=True, eq=False)
class Actor:
    """A player as far as its cues are placed: a value, which its next cue replaces.

    Attributes:
        player: of the cast.
        hands: its walks in the first lane, and gestures beside one another.
        ways: the walks so far, in order.
        done: end of the last cue [s].
        away: whether it has gone off.
    """

    player: Player
    hands: Hands
    ways: tuple[Way, ...] = ()
    done: float = 0.0
    away: bool = False

    def stands(self, t: float) -> Footing:
        """Its footing at a time [s]."""
        way = next((one for one in reversed(self.ways) if one.begin <= t), None)
        if way is None:
            return self.player.start
        xy, heading = way.footing(np.array([t]))
        return Footing(float(xy[0, 0]), float(xy[0, 1]), float(heading[0]))

    @property
    def last(self) -> Footing:
        """Its footing after all walks."""
        return self.stands(np.inf)

    def rested(self) -> Actor:
        """The actor with all its strings brought to rest."""
        return replace(self, hands=self.hands.rested())

    def motion(self, until: float) -> tuple[Gesture, dict[str, Gesture]]:
        """All that it does until a time [s], and its lanes."""
        labels = [lane_name(self.player.name, i) for i in range(len(self.hands.lanes))]
        return self.hands.motion(self.player.alone.coordinates, labels, until)

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
class Corrections:
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

    def setting(self, kind: str, key: object, value: object | None) -> Corrections:
        """The same with a value of a kind, the name of an attribute; None removes it."""
        own = {**getattr(self, kind), key: value}
        return replace(self, **{kind: {one: own[one] for one in own if own[one] is not None}})
