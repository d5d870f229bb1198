"""The cast of a play: its file, its players and companies, props and cues."""

from fantoccini.theatre.cast import prop_gestures
from fantoccini.theatre.cast.actors import Actor, Corrections
from fantoccini.theatre.cast.casting import Cast, read_cast
from fantoccini.theatre.cast.clips import CLIP_ENDING, Clip, is_clip, read_clip
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
    OTHER_SIDE,
    ContactBodies,
    Pair,
    asked_pairs,
    hanging,
    sitting,
    standing,
)
from fantoccini.theatre.cast.cues import act_time_in_words, lane_name, play_timeline
from fantoccini.theatre.cast.extents import extent
from fantoccini.theatre.cast.footing import Footing, Hindrance, NoWay, Way
from fantoccini.theatre.cast.physique import Physique
from fantoccini.theatre.cast.players import Player
from fantoccini.theatre.cast.prop_gestures import (
    Waypoints,
    aside_by,
    backwards,
    carried,
    gesture_of,
    of_member,
    sign_of,
    summed,
)
from fantoccini.theatre.cast.props import PlayProp, PropState, top_of
from fantoccini.theatre.cast.result_cache import (
    NUMBERS,
    OutOfTime,
    ResultCache,
    digest,
    gesture_form,
    run_form,
)
from fantoccini.theatre.cast.starts import Places
from fantoccini.theatre.cast.stops import ERRORS, CannotBegin, Stop

__all__ = [
    "CLIP_ENDING",
    "ERRORS",
    "NUMBERS",
    "OTHER_SIDE",
    "Actor",
    "CannotBegin",
    "Cast",
    "Clip",
    "Company",
    "ContactBodies",
    "Corrections",
    "Footing",
    "Hindrance",
    "Meeting",
    "NoWay",
    "OutOfTime",
    "Pair",
    "Physique",
    "Places",
    "PlayProp",
    "Player",
    "PropState",
    "ResultCache",
    "Span",
    "Staged",
    "Stop",
    "Way",
    "Waypoints",
    "act_time_in_words",
    "aside_by",
    "asked_pairs",
    "backwards",
    "carried",
    "digest",
    "extent",
    "gesture_form",
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
    "run_form",
    "settled",
    "sign_of",
    "sitting",
    "spans",
    "staged",
    "standing",
    "summed",
    "top_of",
]
