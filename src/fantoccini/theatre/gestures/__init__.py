"""Gestures: short, named motions of part of a puppet, relative to where it hangs."""

from fantoccini.theatre.gestures import piecewise, stepping
from fantoccini.theatre.gestures.aiming import check_parts
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.compiling import load_score
from fantoccini.theatre.gestures.conducting import Conductor
from fantoccini.theatre.gestures.ends import Complex, ComplexCurve, Curve, Ends, times
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.gesture_file import (
    bundled,
    gesture_names,
    gesture_of_take,
    gesture_schema,
    is_gesture,
    load_gesture,
)
from fantoccini.theatre.gestures.joining import Line, Motion
from fantoccini.theatre.gestures.leg_order import (
    Pattern,
    feet,
    leg_length,
    leg_strings,
    legs,
    phases,
)
from fantoccini.theatre.gestures.moves import names_and_units, xy_indices
from fantoccini.theatre.gestures.parameters import COMPUTED_GESTURES
from fantoccini.theatre.gestures.performing import (
    CannotBe,
    Hands,
    Part,
    Performed,
    Performer,
    Placed,
    Policy,
    Turn,
)
from fantoccini.theatre.gestures.piecewise import at
from fantoccini.theatre.gestures.rehearsing import Rehearsal, rehearse
from fantoccini.theatre.gestures.score import Caption, Played, Score, Sound, Wait
from fantoccini.theatre.gestures.score_gestures import gesture_beside
from fantoccini.theatre.gestures.sounding import read_sounds
from fantoccini.theatre.gestures.stepping import STEP_TIME, Step, Track
from fantoccini.theatre.gestures.styling import Style
from fantoccini.theatre.gestures.timekeeping import Late, lateness
from fantoccini.theatre.gestures.transitions import (
    ACCELERATION,
    ARM,
    SAME,
    SPEED,
    limits,
    transition,
)
from fantoccini.theatre.gestures.walking import SWAY, leg_ratio, steps

__all__ = [
    "ACCELERATION",
    "ARM",
    "COMPUTED_GESTURES",
    "SAME",
    "SPEED",
    "STEP_TIME",
    "SWAY",
    "BodyParts",
    "CannotBe",
    "Caption",
    "Complex",
    "ComplexCurve",
    "Conductor",
    "Curve",
    "Ends",
    "Gesture",
    "Hands",
    "Late",
    "Line",
    "Motion",
    "Part",
    "Pattern",
    "Performed",
    "Performer",
    "Placed",
    "Played",
    "Policy",
    "Rehearsal",
    "Score",
    "Sound",
    "Step",
    "Style",
    "Track",
    "Turn",
    "Wait",
    "at",
    "bundled",
    "check_parts",
    "feet",
    "gesture_beside",
    "gesture_names",
    "gesture_of_take",
    "gesture_schema",
    "is_gesture",
    "lateness",
    "leg_length",
    "leg_ratio",
    "leg_strings",
    "legs",
    "limits",
    "load_gesture",
    "load_score",
    "names_and_units",
    "phases",
    "piecewise",
    "read_sounds",
    "rehearse",
    "stepping",
    "steps",
    "times",
    "transition",
    "xy_indices",
]
