"""Pairs that may touch in a play: forearms and props that hang on them, seats and sitters."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fantoccini.model.puppet import FLOOR, Contact, ContactPair
from fantoccini.theatre.script import VERBS, PlayFile

Pair = frozenset[str]
"""Names of two parts of the stage: ``pierrot.forearm_right``, props, obstacles or the floor."""

OTHER_SIDE = {"left": "right", "right": "left"}
"""Side of a puppet, as of a forearm -> the other side."""
FRICTION = 0.6
"""Coefficient of friction of all that touches."""
SEATED = ("thigh_left", "thigh_right", "torso", "skull")
"""Bodies that touch what one sits on."""
FEET = ("shin_left", "shin_right")
"""Bodies that touch the floor and the seat's legs then."""


def hanging(player: str, side: str, prop: str) -> Pair:
    """A prop that hangs on a forearm."""
    return frozenset((f"{player}.forearm_{side}", prop))


def standing(prop: str, on: str) -> frozenset[Pair]:
    """A prop that stands on an obstacle or the floor, or may fall there."""
    return frozenset(frozenset((prop, one)) for one in (on, FLOOR))


def sitting(player: str, seat: str) -> frozenset[Pair]:
    """A player that sits."""
    on_seat = {frozenset((f"{player}.{body}", seat)) for body in (*SEATED, *FEET)}
    return frozenset(on_seat | {frozenset((f"{player}.{foot}", FLOOR)) for foot in FEET})


def asked_pairs(file: PlayFile) -> frozenset[Pair]:
    """All that may touch at some time of a play."""
    pairs = set[Pair]()
    for prop, given in file.props.items():
        pairs |= standing(prop, given.on or FLOOR)
        if given.held_by is not None:
            pairs.add(hanging(given.held_by, given.side, prop))
    for act in file.acts:
        for cue in act.cues:
            named = {kind: getattr(cue, key) for key, kind in VERBS[cue.verb].names.items()}
            if "seat" in named:
                pairs |= sitting(cue.who[0], named["seat"])
            if "prop" in named:
                players = [cue.who[0], *([named["player"]] if "player" in named else [])]
                pairs |= {
                    hanging(who, side, named["prop"]) for who in players for side in OTHER_SIDE
                }
                pairs |= standing(named["prop"], named.get("table", FLOOR))
    return frozenset(pairs)


def rules_of(pairs: Iterable[Pair], named: Callable[[str], str] = str) -> Contact:
    """Rules by which these pairs touch, and no others.

    Args:
        pairs: what may touch.
        named: the name of a part in the scene.
    """
    return Contact(
        friction=FRICTION,
        meets=(),
        pairs=tuple(
            ContactPair(between=(named(a), named(b)), friction=FRICTION)
            for a, b in sorted(map(sorted, pairs))
        ),
    )
