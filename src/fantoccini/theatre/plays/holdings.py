"""Where props are while cues are placed: on a forearm, under who sits, or standing somewhere."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import Footing, Meeting, Pair, hanging, sitting, standing
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.script import Spot


@dataclass(frozen=True)
class Hangs:
    """A prop on a forearm.

    Attributes:
        player, side: whose.
        since: [s].
        cue: by which it came there; None from the start on.
    """

    player: str
    side: str
    since: float
    cue: Spot | None = None

    def meeting(self, prop: str, until: float) -> Meeting:
        """The player and the prop until a time [s]."""
        pairs: frozenset[Pair] = standing(prop, FLOOR) | {hanging(self.player, self.side, prop)}
        return Meeting(self.since, until, (self.player,), (prop,), pairs, "hangs", self.cue)


@dataclass(frozen=True)
class Stands:
    """A prop that stands somewhere.

    Attributes:
        place: where, and the direction of its x.
        height: of its bottom [m].
        on: the obstacle or the floor.
    """

    place: Footing
    height: float
    on: str


@dataclass(frozen=True)
class Seated:
    """A player that sits.

    Attributes:
        seat: on what.
        on_prop: whether that is a prop.
        since: when it began to step back to it [s].
        down: when it sat [s].
        cue: by which it sat down.
        up: how it stands up.
        ahead: where it stepped back from.
    """

    seat: str
    on_prop: bool
    since: float
    down: float
    cue: Spot
    up: Gesture
    ahead: Footing

    def meeting(self, who: str, up: float, until: float) -> Meeting:
        """The player and the seat, until it begins to stand up, and until it is away [s]."""
        pairs = sitting(who, self.seat)
        if self.on_prop:
            pairs |= standing(self.seat, FLOOR)
        props = (self.seat,) if self.on_prop else ()
        return Meeting(self.since, until, (who,), props, pairs, "sits", self.cue, (self.down, up))
