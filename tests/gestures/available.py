"""Bundled gestures that a puppet can do."""

from __future__ import annotations

import fantoccini as fan
from fantoccini.base.errors import FileError
from fantoccini.theatre import Gesture, load_gesture

_REFUSALS = ("; {0} has ", ", which no string of {0} moves")
"""Parts of the refusals of gestures that move a part which the puppet lacks."""


def available_gestures(puppet: fan.Marionette) -> dict[str, Gesture]:
    """Name -> gesture, without those for which the puppet lacks a part."""
    gestures = {}
    for name in fan.theatre.gesture_names():
        try:
            gestures[name] = load_gesture(puppet, name)
        except FileError as error:
            assert any(reason.format(puppet.name) in str(error) for reason in _REFUSALS), error
    return gestures
