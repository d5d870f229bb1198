"""Pairs that may touch in a play: forearms and their props, seats and sitters, feet and floor.

A pair is the names of two bodies, or of a body and an obstacle. All other pairs must stay apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from fantoccini.base import StateError
from fantoccini.model import BodyMap, Limb
from fantoccini.model.puppet import FLOOR, Contact, ContactPair
from fantoccini.theatre.script import VERBS, PlayCue, PlayFile

Pair = frozenset[str]
"""Names of two parts of the stage: ``pierrot.forearm_right``, a prop, an obstacle or the floor."""

OTHER_SIDE = {"left": "right", "right": "left"}
"""Side of a puppet -> the other side."""
FRICTION = 0.6
"""Coefficient of friction of all contacts."""


def forearm_of(arm: Limb) -> str:
    """Body of an arm on which props hang: its last one, or the one before a hand with a joint."""
    return arm.bodies[-1] if len(arm.bodies) <= 2 else arm.bodies[-2]


@dataclass(frozen=True)
class ContactBodies:
    """Names on the stage of a player's bodies that touch props and seats.

    Attributes:
        player: name of the player.
        forearms: side -> body on which a prop hangs.
        seated: bodies that touch a seat: thighs, trunk and head.
        feet: bodies that touch the floor while walking, and the floor and the seat while sitting.
    """

    player: str
    forearms: Mapping[str, str] = field(default_factory=dict)
    seated: tuple[str, ...] = ()
    feet: tuple[str, ...] = ()

    @classmethod
    def of(cls, player: str, body_map: BodyMap) -> ContactBodies:
        """Bodies of a player whose puppet has this body map."""
        arms = {limb.side: forearm_of(limb) for limb in body_map.limbs if limb.kind == "arm"}
        legs = [limb.bodies for limb in body_map.limbs if limb.kind == "leg"]
        head = () if body_map.head is None else (body_map.head.body,)
        seated = (*(body for bodies in legs for body in bodies[:-1]), *body_map.trunk, *head)
        feet = tuple(bodies[-1] for bodies in legs)
        return cls(
            player,
            {side: f"{player}.{body}" for side, body in arms.items()},
            tuple(f"{player}.{body}" for body in dict.fromkeys(seated)),
            tuple(f"{player}.{body}" for body in feet),
        )


def hanging_pair(bodies: ContactBodies, side: str, prop: str) -> Pair:
    """Pair of a prop and the forearm on which it hangs.

    Raises:
        StateError: the player has no arm on this side.
    """
    if side not in bodies.forearms:
        raise StateError(f"{bodies.player} has no arm_{side}")
    return frozenset((bodies.forearms[side], prop))


def standing_pairs(prop: str, on: str) -> frozenset[Pair]:
    """Pairs of a prop that stands on an obstacle or the floor, or may fall to the floor."""
    return frozenset(frozenset((prop, surface)) for surface in (on, FLOOR))


def walking_pairs(bodies: ContactBodies) -> frozenset[Pair]:
    """Pairs of a player that walks on the floor: its feet with the floor."""
    return frozenset(frozenset((foot, FLOOR)) for foot in bodies.feet)


def sitting_pairs(bodies: ContactBodies, seat: str) -> frozenset[Pair]:
    """Pairs of a player that sits: its bodies with the seat, its feet with the floor."""
    on_seat = {frozenset((body, seat)) for body in (*bodies.seated, *bodies.feet)}
    return frozenset(on_seat) | walking_pairs(bodies)


def allowed_pairs(file: PlayFile, cast: Mapping[str, ContactBodies]) -> frozenset[Pair]:
    """Pairs that may touch at some time of a play.

    Args:
        file: the play.
        cast: player -> its bodies.
    """
    pairs = set[Pair]()
    for prop, prop_file in file.props.items():
        pairs |= standing_pairs(prop, prop_file.on or FLOOR)
        if prop_file.held_by is not None:
            pairs.add(hanging_pair(cast[prop_file.held_by], prop_file.side, prop))
    for who, bodies in cast.items():
        if file.cast[who].walks == "on the floor":
            pairs |= walking_pairs(bodies)
    for act in file.acts:
        for cue in act.cues:
            pairs |= cue_pairs(cue, cast)
    return frozenset(pairs)


def cue_pairs(cue: PlayCue, cast: Mapping[str, ContactBodies]) -> frozenset[Pair]:
    """Pairs that may touch in a cue.

    Args:
        cue: the cue.
        cast: player -> its bodies.
    """
    pairs = set[Pair]()
    names = {kind: getattr(cue, key) for key, kind in VERBS[cue.verb].name_kinds.items()}
    players = [cast[who] for who in (cue.who[0], names.get("player", "")) if who in cast]
    if "seat" in names:
        pairs = pairs.union(*(sitting_pairs(bodies, names["seat"]) for bodies in players[:1]))
    if "prop" in names:
        prop = names["prop"]
        pairs |= {
            hanging_pair(bodies, side, prop) for bodies in players for side in bodies.forearms
        }
        pairs |= standing_pairs(prop, names.get("table", FLOOR))
    return frozenset(pairs)


def contact_rules(pairs: Iterable[Pair], scene_name: Callable[[str], str] = str) -> Contact:
    """Contact rules under which these pairs touch, and no others.

    Args:
        pairs: pairs that may touch.
        scene_name: returns the name of a part in the scene.
    """
    return Contact(
        friction=FRICTION,
        meets=(),
        pairs=tuple(
            ContactPair(between=(scene_name(a), scene_name(b)), friction=FRICTION)
            for a, b in sorted(map(sorted, pairs))
        ),
    )
