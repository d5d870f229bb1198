"""Gestures: short, named motions of part of a puppet, relative to where it hangs."""

from fantoccini.gestures.gesture import Gesture
from fantoccini.gestures.gesture_file import gesture_names, gesture_schema, load_gesture

__all__ = ["Gesture", "gesture_names", "gesture_schema", "load_gesture"]
