"""Plays: who does what, where and when on a stage, compiled and verified."""

from fantoccini.plays.compiling import load_play
from fantoccini.plays.from_above import Overhead, overhead
from fantoccini.plays.least import Least, clearances
from fantoccini.plays.play import CueOfPlay, Play
from fantoccini.plays.play_file import is_play, play_schema
from fantoccini.plays.reading import check_play, play_names
from fantoccini.plays.touching import Touch
from fantoccini.plays.verifying import CueTime, Verification, verify_play

__all__ = [
    "CueOfPlay",
    "CueTime",
    "Least",
    "Overhead",
    "Play",
    "Touch",
    "Verification",
    "check_play",
    "clearances",
    "is_play",
    "load_play",
    "overhead",
    "play_names",
    "play_schema",
    "verify_play",
]
