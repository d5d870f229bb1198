"""Plays: cues of players on a stage, compiled and verified."""

from fantoccini.theatre.plays.compiling import load_play
from fantoccini.theatre.plays.from_above import Overhead, overhead
from fantoccini.theatre.plays.owner_clearances import OwnerClearance, clearances
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.reading import check_play, play_names
from fantoccini.theatre.plays.shots import Shot
from fantoccini.theatre.plays.stage_run import together
from fantoccini.theatre.plays.touching import Touch
from fantoccini.theatre.plays.verifying import CueTime, Verification, verify_play

__all__ = [
    "CueOfPlay",
    "CueTime",
    "Overhead",
    "OwnerClearance",
    "Play",
    "Shot",
    "Touch",
    "Verification",
    "check_play",
    "clearances",
    "load_play",
    "overhead",
    "play_names",
    "together",
    "verify_play",
]
