"""Pairs that may touch in a play: forearms and props that hang on them, seats and sitters."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fantoccini.model.puppet import FLOOR, Contact, ContactPair
from fantoccini.theatre.script import VERBS, PlayCue, PlayFile

Pair = frozenset[str]
"""Names of two parts of the stage: ``pierrot.forearm_right``, a prop, an obstacle or the floor."""

OTHER_SIDE = {"left": "right", "right": "left"}
"""Side of a puppet -> the other side."""
FRICTION = 0.6
"""Coefficient of friction of all contacts."""
BODY = ("head", "shoulder_left", "shoulder_right")
"""Strings of the bundled marionette that carry head and trunk."""
SEATED = ("thigh_left", "thigh_right", "torso", "skull")
"""Bodies that touch the seat of somebody who sits."""
FEET = ("shin_left", "shin_right")
"""Bodies that touch the floor and the seat's legs while sitting."""


def hanging(player: str, side: str, prop: str) -> Pair:
    """Pair of a prop and the forearm on which it hangs."""
    return frozenset((f"{player}.forearm_{side}", prop))


def standing(prop: str, on: str) -> frozenset[Pair]:
    """Pairs of a prop that stands on an obstacle or the floor, or may fall to the floor."""
    return frozenset(frozenset((prop, surface)) for surface in (on, FLOOR))


def sitting(player: str, seat: str) -> frozenset[Pair]:
    """Pairs of a player that sits: its bodies with the seat, its feet with the floor."""
    on_seat = {frozenset((f"{player}.{body}", seat)) for body in (*SEATED, *FEET)}
    return frozenset(on_seat | {frozenset((f"{player}.{foot}", FLOOR)) for foot in FEET})


def asked_pairs(file: PlayFile) -> frozenset[Pair]:
    """All pairs that may touch at some time of a play."""
    pairs = set[Pair]()
    for prop, prop_file in file.props.items():
        pairs |= standing(prop, prop_file.on or FLOOR)
        if prop_file.held_by is not None:
            pairs.add(hanging(prop_file.held_by, prop_file.side, prop))
    for act in file.acts:
        for cue in act.cues:
            pairs |= cue_pairs(cue)
    return frozenset(pairs)


def cue_pairs(cue: PlayCue) -> frozenset[Pair]:
    """All pairs that may touch in a cue."""
    pairs = set[Pair]()
    named = {kind: getattr(cue, key) for key, kind in VERBS[cue.verb].names.items()}
    if "seat" in named:
        pairs |= sitting(cue.who[0], named["seat"])
    if "prop" in named:
        players = [cue.who[0], *([named["player"]] if "player" in named else [])]
        pairs |= {hanging(who, side, named["prop"]) for who in players for side in OTHER_SIDE}
        pairs |= standing(named["prop"], named.get("table", FLOOR))
    return frozenset(pairs)


def rules_of(pairs: Iterable[Pair], named: Callable[[str], str] = str) -> Contact:
    """Contact rules under which these pairs touch, and no others.

    Args:
        pairs: pairs that may touch.
        named: returns the name of a part in the scene.
    """
    return Contact(
        friction=FRICTION,
        meets=(),
        pairs=tuple(
            ContactPair(between=(named(a), named(b)), friction=FRICTION)
            for a, b in sorted(map(sorted, pairs))
        ),
    )
