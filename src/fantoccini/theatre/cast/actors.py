"""Players while their cues are placed, and corrections from earlier rounds of compiling.

An actor is a player while the play is compiled: in a round, all cues are placed in time and
simulated, and the faults of the run become corrections for the next round. A footing is a place and
a heading. A lane is a list of gestures in order. A spot is the list of keys that leads to an entry
of the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.cast.cues import lane_name
from fantoccini.theatre.cast.footing import Footing, Walk
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
        walks: walks so far, in order.
        busy_until: end of the last cue [s].
        is_off_stage: whether it has left the stage.
    """

    player: Player
    hands: Hands
    walks: tuple[Walk, ...] = ()
    busy_until: float = 0.0
    is_off_stage: bool = False

    def footing_at(self, t: float) -> Footing:
        """Footing at a time [s]."""
        walk = next((walk for walk in reversed(self.walks) if walk.begin <= t), None)
        if walk is None:
            return self.player.start
        xy, heading = walk.footing(np.array([t]))
        return Footing(float(xy[0, 0]), float(xy[0, 1]), float(heading[0]))

    @property
    def last_footing(self) -> Footing:
        """Footing after all walks."""
        return self.footing_at(np.inf)

    def rested(self) -> Actor:
        """The actor with all its strings stopped smoothly."""
        return replace(self, hands=self.hands.rested())

    def motion(self, until: float) -> tuple[Gesture, dict[str, Gesture]]:
        """Motion of all its lanes until a time [s], and each lane's own."""
        labels = [lane_name(self.player.name, i) for i in range(len(self.hands.lanes))]
        return self.hands.motion(self.player.marionette.coordinates, labels, until)

    def track(self) -> tuple[Times, Array]:
        """(T,) times and (T, 2) places, straight between them."""
        t, xy = [0.0], [[self.player.start.x, self.player.start.y]]
        for walk in self.walks:
            if not walk.steps:
                continue
            times = np.append(np.arange(walk.begin, walk.end, _TRACK_INTERVAL), walk.end)
            times = times[times > t[-1]]
            t += times.tolist()
            xy += walk.footing(times)[0].tolist()
        return np.array(t), np.array(xy)


@dataclass(frozen=True)
class Corrections:
    """Corrections of cues that earlier rounds of compiling have found.

    Attributes:
        leads: (cue, player) -> lead of its hands, because limbs lag [s].
        pauses: cue -> delay of its beginning, until swing has decayed [s].
        refusals: cue -> reason why it cannot be done.
        size_factors: cue -> factor of its size.
        handle_positions: cue -> handle of the prop that is given or put down: distance from the
            elbow at which it hangs, and its height [m].
        damping_offsets: (cue, player) -> offsets of its hands that damp swing before it [m]; see
            ``fantoccini.theatre.plays.calming``.
        prop_footings: cue -> footing of the prop that is picked up, or of the seat.
        approach_indices: cue -> index of the approach to a seat that is tried.
    """

    leads: Mapping[tuple[Spot, str], float] = field(default_factory=dict)
    pauses: Mapping[Spot, float] = field(default_factory=dict)
    refusals: Mapping[Spot, str] = field(default_factory=dict)
    size_factors: Mapping[Spot, float] = field(default_factory=dict)
    handle_positions: Mapping[Spot, tuple[float, float]] = field(default_factory=dict)
    damping_offsets: Mapping[tuple[Spot, str], tuple[float, ...]] = field(default_factory=dict)
    prop_footings: Mapping[Spot, Footing] = field(default_factory=dict)
    approach_indices: Mapping[Spot, int] = field(default_factory=dict)

    def with_entry(self, attribute: str, key: object, value: object | None) -> Corrections:
        """A copy with one entry of an attribute set; None removes the entry."""
        entries = {**getattr(self, attribute), key: value}
        return replace(
            self,
            **{attribute: {spot: entries[spot] for spot in entries if entries[spot] is not None}},
        )
