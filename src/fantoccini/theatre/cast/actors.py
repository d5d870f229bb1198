"""Players while their cues are placed, and corrections from earlier rounds of compiling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.cast.cues import lane_name
from fantoccini.theatre.cast.footing import Footing, Way
from fantoccini.theatre.cast.players import Player
from fantoccini.theatre.gestures import Gesture, Hands
from fantoccini.theatre.script import Spot

_TRACK_INTERVAL = 0.05
"""Time between samples of a walk, which is straight between them [s]."""


@dataclass(frozen=True, eq=False)
class Actor:
    """A player up to its last placed cue; the next cue replaces the value.

    Attributes:
        player: member of the cast.
        hands: motion of its hands: walks in the first lane, gestures in the others.
        ways: walks so far, in order.
        done: end of the last cue [s].
        away: whether it has left the stage.
    """

    player: Player
    hands: Hands
    ways: tuple[Way, ...] = ()
    done: float = 0.0
    away: bool = False

    def footing_at(self, t: float) -> Footing:
        """Footing at a time [s]."""
        way = next((way for way in reversed(self.ways) if way.begin <= t), None)
        if way is None:
            return self.player.start
        xy, heading = way.footing(np.array([t]))
        return Footing(float(xy[0, 0]), float(xy[0, 1]), float(heading[0]))

    @property
    def last(self) -> Footing:
        """Footing after all walks."""
        return self.footing_at(np.inf)

    def rested(self) -> Actor:
        """The actor with all its strings brought to rest."""
        return replace(self, hands=self.hands.rested())

    def motion(self, until: float) -> tuple[Gesture, dict[str, Gesture]]:
        """Motion of all its lanes until a time [s], and each lane's own."""
        labels = [lane_name(self.player.name, i) for i in range(len(self.hands.lanes))]
        return self.hands.motion(self.player.marionette.coordinates, labels, until)

    def track(self) -> tuple[Times, Array]:
        """(T,) times and (T, 2) places, straight between them."""
        t, xy = [0.0], [[self.player.start.x, self.player.start.y]]
        for way in self.ways:
            if not way.steps:
                continue
            own = np.append(np.arange(way.begin, way.end, _TRACK_INTERVAL), way.end)
            own = own[own > t[-1]]
            t += own.tolist()
            xy += way.footing(own)[0].tolist()
        return np.array(t), np.array(xy)


@dataclass(frozen=True)
class Corrections:
    """Corrections of cues that earlier rounds of compiling have found.

    Attributes:
        earlier: (cue, player) -> lead of its hands, because limbs lag [s].
        pauses: cue -> delay of its beginning, until swing has decayed [s].
        refused: cue -> reason why it cannot be done.
        smaller: cue -> factor of its size.
        handles: cue -> handle of the prop that is given or put down: distance from the elbow at
            which it hangs, and its height [m].
        calms: (cue, player) -> offsets of its hands that damp swing before it [m]; see
            ``fantoccini.theatre.plays.calming``.
        stands: cue -> footing of the prop that is picked up, or of the seat.
        approaches: cue -> index of the approach to a seat that is tried.
    """

    earlier: Mapping[tuple[Spot, str], float] = field(default_factory=dict)
    pauses: Mapping[Spot, float] = field(default_factory=dict)
    refused: Mapping[Spot, str] = field(default_factory=dict)
    smaller: Mapping[Spot, float] = field(default_factory=dict)
    handles: Mapping[Spot, tuple[float, float]] = field(default_factory=dict)
    calms: Mapping[tuple[Spot, str], tuple[float, ...]] = field(default_factory=dict)
    stands: Mapping[Spot, Footing] = field(default_factory=dict)
    approaches: Mapping[Spot, int] = field(default_factory=dict)

    def setting(self, kind: str, key: object, value: object | None) -> Corrections:
        """A copy with one entry of the attribute ``kind`` set; None removes the entry."""
        own = {**getattr(self, kind), key: value}
        return replace(self, **{kind: {spot: own[spot] for spot in own if own[spot] is not None}})
