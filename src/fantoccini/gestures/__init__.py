"""Gestures: short, named motions of part of a puppet, relative to where it hangs."""

from fantoccini.gestures.beats import on_beat
from fantoccini.gestures.compiling import load_score
from fantoccini.gestures.conducting import Conductor
from fantoccini.gestures.gesture import Gesture
from fantoccini.gestures.gesture_file import (
    gesture_names,
    gesture_of_take,
    gesture_schema,
    is_gesture,
    load_gesture,
)
from fantoccini.gestures.score import Caption, Played, Score, Sound, Wait, is_score
from fantoccini.gestures.score_file import score_schema

__all__ = [
    "Caption",
    "Conductor",
    "Gesture",
    "Played",
    "Score",
    "Sound",
    "Wait",
    "gesture_names",
    "gesture_of_take",
    "gesture_schema",
    "is_gesture",
    "is_score",
    "load_gesture",
    "load_score",
    "on_beat",
    "score_schema",
]
