"""Plays: cues of players on a stage, compiled and verified.

A cue is a line of a play: a verb with its player and time. In each round of compiling, cues are
placed in time and on the stage, and simulated; a rule then corrects faults of the run. A company is
a group of players and props that may touch one another and are simulated together. A footing is a
place on the stage with a heading. A leash is a slack string between two players.
"""

from fantoccini.theatre.plays.compiling import load_play
from fantoccini.theatre.plays.owner_clearances import OwnerClearance, clearances
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.reading import check_play, play_names, play_path
from fantoccini.theatre.plays.shots import Shot
from fantoccini.theatre.plays.stage_plan import StagePlan, make_stage_plan
from fantoccini.theatre.plays.stage_run import combine_runs
from fantoccini.theatre.plays.touching import Touch
from fantoccini.theatre.plays.verifying import CueTime, Verification, verify_play

__all__ = [
    "CueOfPlay",
    "CueTime",
    "OwnerClearance",
    "Play",
    "Shot",
    "StagePlan",
    "Touch",
    "Verification",
    "check_play",
    "clearances",
    "combine_runs",
    "load_play",
    "make_stage_plan",
    "play_names",
    "play_path",
    "verify_play",
]
