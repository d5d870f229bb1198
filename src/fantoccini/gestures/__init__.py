"""Gestures: short, named motions of part of a puppet, relative to where it hangs."""

from fantoccini.gestures.compiling import load_score
from fantoccini.gestures.conducting import Conductor
from fantoccini.gestures.gait import Gait
from fantoccini.gestures.gesture import Gesture
from fantoccini.gestures.gesture_file import (
    gesture_names,
    gesture_of_take,
    gesture_schema,
    is_gesture,
    load_gesture,
)
from fantoccini.gestures.rehearsing import Rehearsal, rehearse
from fantoccini.gestures.score import Caption, Played, Score, Sound, Wait, is_score
from fantoccini.gestures.score_file import score_schema
from fantoccini.gestures.timekeeping import Late, lateness

__all__ = [
    "Caption",
    "Conductor",
    "Gait",
    "Gesture",
    "Late",
    "Played",
    "Rehearsal",
    "Score",
    "Sound",
    "Wait",
    "gesture_names",
    "gesture_of_take",
    "gesture_schema",
    "is_gesture",
    "is_score",
    "lateness",
    "load_gesture",
    "load_score",
    "rehearse",
    "score_schema",
]
