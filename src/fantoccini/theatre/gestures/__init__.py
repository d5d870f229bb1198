"""Gestures: short, named motions of part of a puppet, relative to where it hangs.

q_K(t) = q_K0 + d(t): a gesture is the offset d of driven coordinates q_K (ends and lengths of
strings, driven joints) from their values q_K0 at rest. It is a piecewise polynomial with the
coefficients `coef` between the times `breaks`, for each of the n_vK driven velocities. A mark is a
named time of a gesture. A cue is a line of a score or play: a verb with its player and time. A lane
is a list of cues in order; the offsets of all lanes add up. A puppet of a scene is a member.
"""

from fantoccini.theatre.gestures import piecewise, stepping
from fantoccini.theatre.gestures.aiming import check_parts
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.compiling import load_score
from fantoccini.theatre.gestures.conducting import Conductor
from fantoccini.theatre.gestures.ends import Complex, ComplexCurve, Curve, Ends, scale_curve
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.gesture_file import (
    bundled_gesture_path,
    gesture_from_take,
    gesture_names,
    gesture_schema,
    is_gesture,
    load_gesture,
)
from fantoccini.theatre.gestures.joining import Motion, MotionSequence
from fantoccini.theatre.gestures.leg_order import (
    Pattern,
    foot_links,
    gait_phases,
    leg_length,
    leg_strings,
    legs,
)
from fantoccini.theatre.gestures.moves import names_and_units, xy_indices
from fantoccini.theatre.gestures.parameters import COMPUTED_GESTURES
from fantoccini.theatre.gestures.performing import (
    CueError,
    CuePart,
    Hands,
    LatenessPolicy,
    PendingCue,
    PerformedScript,
    Performer,
    PlacedCue,
)
from fantoccini.theatre.gestures.rehearsing import Rehearsal, rehearse
from fantoccini.theatre.gestures.score import Caption, PlayedGesture, Score, Sound, Wait
from fantoccini.theatre.gestures.score_gestures import find_gesture_file
from fantoccini.theatre.gestures.sounding import read_sounds
from fantoccini.theatre.gestures.stepping import STEP_TIME, Step, StepPath
from fantoccini.theatre.gestures.styling import Style
from fantoccini.theatre.gestures.timekeeping import LimbLateness, measure_lateness
from fantoccini.theatre.gestures.transitions import (
    MAX_ACCELERATION,
    MAX_SPEED,
    OFFSET_TOLERANCE,
    TURN_RADIUS,
    motion_bounds,
    transition,
)
from fantoccini.theatre.gestures.walking import SWAY, leg_ratio, step_gesture

__all__ = [
    "COMPUTED_GESTURES",
    "MAX_ACCELERATION",
    "MAX_SPEED",
    "OFFSET_TOLERANCE",
    "STEP_TIME",
    "SWAY",
    "TURN_RADIUS",
    "BodyParts",
    "Caption",
    "Complex",
    "ComplexCurve",
    "Conductor",
    "CueError",
    "CuePart",
    "Curve",
    "Ends",
    "Gesture",
    "Hands",
    "LatenessPolicy",
    "LimbLateness",
    "Motion",
    "MotionSequence",
    "Pattern",
    "PendingCue",
    "PerformedScript",
    "Performer",
    "PlacedCue",
    "PlayedGesture",
    "Rehearsal",
    "Score",
    "Sound",
    "Step",
    "StepPath",
    "Style",
    "Wait",
    "bundled_gesture_path",
    "check_parts",
    "find_gesture_file",
    "foot_links",
    "gait_phases",
    "gesture_from_take",
    "gesture_names",
    "gesture_schema",
    "is_gesture",
    "leg_length",
    "leg_ratio",
    "leg_strings",
    "legs",
    "load_gesture",
    "load_score",
    "measure_lateness",
    "motion_bounds",
    "names_and_units",
    "piecewise",
    "read_sounds",
    "rehearse",
    "scale_curve",
    "step_gesture",
    "stepping",
    "transition",
    "xy_indices",
]
