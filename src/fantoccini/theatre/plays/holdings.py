"""Places of props and sitters while cues are placed: a forearm, the stage, or a seat."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import (
    ContactBodies,
    Footing,
    Meeting,
    Pair,
    hanging_pair,
    sitting_pairs,
    standing_pairs,
)
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.script import Spot


@dataclass(frozen=True)
class Hanging:
    """A prop that hangs on a forearm.

    Attributes:
        player, side: player and side of the forearm.
        since: time from which it hangs there [s].
        cue: cue that brought it there; None from the start on.
    """

    player: str
    side: str
    since: float
    cue: Spot | None = None

    def meeting(self, bodies: ContactBodies, prop: str, until: float) -> Meeting:
        """Meeting of the player with these bodies and the prop until a time [s]."""
        pairs: frozenset[Pair] = standing_pairs(prop, FLOOR) | {
            hanging_pair(bodies, self.side, prop)
        }
        return Meeting(self.since, until, (self.player,), (prop,), pairs, "hangs", self.cue)


@dataclass(frozen=True)
class Standing:
    """A prop that stands on the floor or an obstacle.

    Attributes:
        place: its place, and the direction of its x axis.
        height: height of its bottom [m].
        on: name of the obstacle or the floor.
    """

    place: Footing
    height: float
    on: str


@dataclass(frozen=True)
class Seated:
    """A player that sits.

    Attributes:
        seat: name of the seat.
        on_prop: whether the seat is a prop.
        since: time from which it steps back to the seat [s].
        down: time from which it sits [s].
        cue: cue by which it sat down.
        up: gesture of standing up.
        ahead: footing from which it stepped back.
    """

    seat: str
    on_prop: bool
    since: float
    down: float
    cue: Spot
    up: Gesture
    ahead: Footing

    def meeting(self, bodies: ContactBodies, up: float, until: float) -> Meeting:
        """Meeting of the player with these bodies and the seat.

        Args:
            bodies: bodies of the player.
            up: time at which it begins to stand up [s].
            until: end of the meeting [s].
        """
        pairs = sitting_pairs(bodies, self.seat)
        if self.on_prop:
            pairs |= standing_pairs(self.seat, FLOOR)
        props = (self.seat,) if self.on_prop else ()
        bears, who = (self.down, up), (bodies.player,)
        return Meeting(self.since, until, who, props, pairs, "sits", self.cue, bears)
