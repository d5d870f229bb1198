"""Places of props and sitters while cues are placed: a forearm, the stage, or a seat.

A footing is a place with a heading. A sitter is a player on a seat, and a cue is a line of the
play.
"""

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
        begin: time from which it hangs there [s].
        cue: cue that brought it there; None from the start on.
    """

    player: str
    side: str
    begin: float
    cue: Spot | None = None

    def meeting(self, bodies: ContactBodies, prop: str, until: float) -> Meeting:
        """Meeting of the player with these bodies and the prop until a time [s]."""
        pairs: frozenset[Pair] = standing_pairs(prop, FLOOR) | {
            hanging_pair(bodies, self.side, prop)
        }
        return Meeting(self.begin, until, (self.player,), (prop,), pairs, "hangs", self.cue)


@dataclass(frozen=True)
class Standing:
    """A prop that stands on the floor or an obstacle.

    Attributes:
        footing: its place, and the direction of its x axis.
        bottom_height: height of its bottom [m].
        on: name of the obstacle or the floor.
    """

    footing: Footing
    bottom_height: float
    on: str


@dataclass(frozen=True)
class Seated:
    """A player that sits.

    Attributes:
        seat: name of the seat.
        is_on_prop: whether the seat is a prop.
        approach_start: time from which it steps back to the seat [s].
        sit_time: time from which it sits [s].
        cue: cue by which it sat down.
        rise_gesture: gesture of standing up.
        stand_footing: footing from which it stepped back.
    """

    seat: str
    is_on_prop: bool
    approach_start: float
    sit_time: float
    cue: Spot
    rise_gesture: Gesture
    stand_footing: Footing

    def meeting(self, bodies: ContactBodies, rise_start: float, end: float) -> Meeting:
        """Meeting of the player with these bodies and the seat.

        Args:
            bodies: bodies of the player.
            rise_start: time at which it begins to stand up [s].
            end: end of the meeting [s].
        """
        pairs = sitting_pairs(bodies, self.seat)
        if self.is_on_prop:
            pairs |= standing_pairs(self.seat, FLOOR)
        props = (self.seat,) if self.is_on_prop else ()
        bearing_interval, who = (self.sit_time, rise_start), (bodies.player,)
        return Meeting(
            self.approach_start, end, who, props, pairs, "sits", self.cue, bearing_interval
        )
