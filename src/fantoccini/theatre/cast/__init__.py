"""The cast of a play: its file, its players and companies, props and cues.

A player is a puppet of the play, a prop a body that players handle, and a cue a line of the play: a
verb with its player and time. A company is a group of players and props that may touch one another
and are simulated together. A footing is the place of a puppet or prop on the stage and its heading,
the angle of its forward direction. The physique of a puppet is the set of sizes and strings that
gestures with props need.
"""

from fantoccini.theatre.cast import prop_gestures
from fantoccini.theatre.cast.actors import Actor, Corrections
from fantoccini.theatre.cast.casting import Cast, read_cast
from fantoccini.theatre.cast.clips import CLIP_SUFFIX, Clip, is_clip, read_clip
from fantoccini.theatre.cast.companies import (
    Company,
    CompanyScene,
    Meeting,
    Span,
    company_scene,
    company_spans,
    gesture_in_scene,
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
    walking_pairs,
)
from fantoccini.theatre.cast.cues import act_time_in_words, lane_name, play_timeline, shot_time_keys
from fantoccini.theatre.cast.extents import bounding_box
from fantoccini.theatre.cast.footing import Footing, Hindrance, NoPath, Walk
from fantoccini.theatre.cast.leashes import needed_lengths, rounded_up_to_cm
from fantoccini.theatre.cast.physique import Physique
from fantoccini.theatre.cast.players import Player
from fantoccini.theatre.cast.prop_gestures import (
    Waypoints,
    add_waypoints,
    carry_offsets,
    member_gesture,
    member_name,
    reverse_waypoints,
    shifted,
    side_sign,
)
from fantoccini.theatre.cast.props import PlayProp, PropState, obstacle_top, prop_names
from fantoccini.theatre.cast.result_cache import (
    NUMBERS_FORMAT,
    OutOfTime,
    ResultCache,
    digest,
    gesture_format,
    run_format,
)
from fantoccini.theatre.cast.starts import Places
from fantoccini.theatre.cast.stops import SIMULATION_ERRORS, CannotBegin, Stop

__all__ = [
    "CLIP_SUFFIX",
    "NUMBERS_FORMAT",
    "OTHER_SIDE",
    "SIMULATION_ERRORS",
    "Actor",
    "CannotBegin",
    "Cast",
    "Clip",
    "Company",
    "CompanyScene",
    "ContactBodies",
    "Corrections",
    "Footing",
    "Hindrance",
    "Meeting",
    "NoPath",
    "OutOfTime",
    "Pair",
    "Physique",
    "Places",
    "PlayProp",
    "Player",
    "PropState",
    "ResultCache",
    "Span",
    "Stop",
    "Walk",
    "Waypoints",
    "act_time_in_words",
    "add_waypoints",
    "allowed_pairs",
    "bounding_box",
    "carry_offsets",
    "company_scene",
    "company_spans",
    "digest",
    "gesture_format",
    "gesture_in_scene",
    "hanging_pair",
    "is_clip",
    "lane_name",
    "member_gesture",
    "member_name",
    "needed_lengths",
    "obstacle_top",
    "play_timeline",
    "prop_gestures",
    "prop_names",
    "read_cast",
    "read_clip",
    "reverse_waypoints",
    "rounded_up_to_cm",
    "run_format",
    "shifted",
    "shot_time_keys",
    "side_sign",
    "sitting_pairs",
    "standing_pairs",
    "walking_pairs",
    "with_settled_props",
]
