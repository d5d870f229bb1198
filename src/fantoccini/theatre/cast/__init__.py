"""The cast of a play: its file, its players and companies, props and cues."""

from fantoccini.theatre.cast import prop_gestures
from fantoccini.theatre.cast.actors import Actor, CannotBe, Wishes
from fantoccini.theatre.cast.casting import Cast, Player, read_cast
from fantoccini.theatre.cast.clips import Clip, is_clip, read_clip
from fantoccini.theatre.cast.companies import (
    Company,
    Meeting,
    Span,
    Staged,
    of_stage,
    settled,
    spans,
    staged,
)
from fantoccini.theatre.cast.contacts import (
    FEET,
    SEATED,
    Pair,
    asked_pairs,
    hanging,
    sitting,
    standing,
)
from fantoccini.theatre.cast.cues import Part, Placed, Turn, lane_name, play_timeline, said_in_act
from fantoccini.theatre.cast.extents import extent
from fantoccini.theatre.cast.footing import Footing, Hindrance, NoWay, Way
from fantoccini.theatre.cast.kept import Kept, OutOfTime, digest
from fantoccini.theatre.cast.prop_gestures import (
    BODY,
    CARRIED,
    SIDES,
    Waypoints,
    aside_by,
    backwards,
    gesture_of,
    of_member,
    sign_of,
    summed,
)
from fantoccini.theatre.cast.props import PlayProp, PropState, top_of
from fantoccini.theatre.cast.starts import Places
from fantoccini.theatre.cast.stops import ERRORS, CannotBegin, Stop

__all__ = [
    "BODY",
    "CARRIED",
    "ERRORS",
    "FEET",
    "SEATED",
    "SIDES",
    "Actor",
    "CannotBe",
    "CannotBegin",
    "Cast",
    "Clip",
    "Company",
    "Footing",
    "Hindrance",
    "Kept",
    "Meeting",
    "NoWay",
    "OutOfTime",
    "Pair",
    "Part",
    "Placed",
    "Places",
    "PlayProp",
    "Player",
    "PropState",
    "Span",
    "Staged",
    "Stop",
    "Turn",
    "Way",
    "Waypoints",
    "Wishes",
    "aside_by",
    "asked_pairs",
    "backwards",
    "digest",
    "extent",
    "gesture_of",
    "hanging",
    "is_clip",
    "lane_name",
    "of_member",
    "of_stage",
    "play_timeline",
    "prop_gestures",
    "read_cast",
    "read_clip",
    "said_in_act",
    "settled",
    "sign_of",
    "sitting",
    "spans",
    "staged",
    "standing",
    "summed",
    "top_of",
]
