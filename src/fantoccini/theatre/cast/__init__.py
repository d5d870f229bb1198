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
    in_scene,
    spans,
    staged,
    with_settled_props,
)
from fantoccini.theatre.cast.contacts import (
    OTHER_SIDE,
    ContactBodies,
    Pair,
    allowed_pairs,
    hanging_pair,
    sitting_pairs,
    standing_pairs,
)
from fantoccini.theatre.cast.cues import act_time_in_words, lane_name, play_timeline, when_of_shot
from fantoccini.theatre.cast.extents import extent
from fantoccini.theatre.cast.footing import Footing, Hindrance, NoWay, Way
from fantoccini.theatre.cast.leashes import needed_lengths, rounded_up
from fantoccini.theatre.cast.physique import Physique
from fantoccini.theatre.cast.players import Player
from fantoccini.theatre.cast.prop_gestures import (
    Waypoints,
    carry_offsets,
    member_gesture,
    member_name,
    shifted,
    sign_of,
    sum_of_waypoints,
    time_reversed,
)
from fantoccini.theatre.cast.props import PlayProp, PropState, obstacle_top
from fantoccini.theatre.cast.result_cache import (
    NUMBERS,
    OutOfTime,
    ResultCache,
    digest,
    gesture_format,
    run_format,
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
    "allowed_pairs",
    "carry_offsets",
    "digest",
    "extent",
    "gesture_format",
    "hanging_pair",
    "in_scene",
    "is_clip",
    "lane_name",
    "member_gesture",
    "member_name",
    "needed_lengths",
    "obstacle_top",
    "play_timeline",
    "prop_gestures",
    "read_cast",
    "read_clip",
    "rounded_up",
    "run_format",
    "shifted",
    "sign_of",
    "sitting_pairs",
    "spans",
    "staged",
    "standing_pairs",
    "sum_of_waypoints",
    "time_reversed",
    "when_of_shot",
    "with_settled_props",
]
