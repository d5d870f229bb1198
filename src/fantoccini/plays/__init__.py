"""Plays: who does what, where and when on a stage, compiled and verified."""

from fantoccini.plays.compiling import load_play
from fantoccini.plays.play import CueOfPlay, Play
from fantoccini.plays.play_file import is_play, play_schema
from fantoccini.plays.touching import Touch
from fantoccini.plays.verifying import CueTime, Verification, verify_play

__all__ = [
    "CueOfPlay",
    "CueTime",
    "Play",
    "Touch",
    "Verification",
    "is_play",
    "load_play",
    "play_schema",
    "verify_play",
]
