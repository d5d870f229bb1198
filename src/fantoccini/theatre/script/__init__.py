"""Language of the stage: files of scores and plays, their cues, verbs and times.

A cue is a line of a score or play: a verb with its player and time. A lane is a list of cues of a
score in order. A mark is a named time of a gesture or score, or a named place on a stage.
"""

from fantoccini.theatre.script.cues import (
    CueFile,
    DoesCue,
    EntersToCue,
    ExitsToCue,
    GestureCue,
    GivesCue,
    HoldCue,
    LooksAtCue,
    PhraseCue,
    PicksUpCue,
    PlayCue,
    PlayedCue,
    PointsAtCue,
    PropCue,
    PutsDownCue,
    ScoreCue,
    SitsOnCue,
    StandsUpFromCue,
    StyledCue,
    TurnsToCue,
    WalkCue,
    file_key,
)
from fantoccini.theatre.script.log import LATENESS_TOLERANCE, ScriptLog
from fantoccini.theatre.script.play_file import PlayerFile, PlayFile, PropFile, StageFile
from fantoccini.theatre.script.reading import (
    is_play,
    is_score,
    play_schema,
    read_script,
    score_schema,
)
from fantoccini.theatre.script.score_file import ScoreFile, SoundFile
from fantoccini.theatre.script.timeline import Cue, Moments, Timeline, make_timeline
from fantoccini.theatre.script.times import ResolvedTime, TimeReference
from fantoccini.theatre.script.values import DIRECTIONS, END, START, STYLE_WORDS, Spot, Time
from fantoccini.theatre.script.verbs import ARRIVAL_MARK, VERBS, MeetingKind, is_walk

__all__ = [
    "ARRIVAL_MARK",
    "DIRECTIONS",
    "END",
    "LATENESS_TOLERANCE",
    "START",
    "STYLE_WORDS",
    "VERBS",
    "Cue",
    "CueFile",
    "DoesCue",
    "EntersToCue",
    "ExitsToCue",
    "GestureCue",
    "GivesCue",
    "HoldCue",
    "LooksAtCue",
    "MeetingKind",
    "Moments",
    "PhraseCue",
    "PicksUpCue",
    "PlayCue",
    "PlayFile",
    "PlayedCue",
    "PlayerFile",
    "PointsAtCue",
    "PropCue",
    "PropFile",
    "PutsDownCue",
    "ResolvedTime",
    "ScoreCue",
    "ScoreFile",
    "ScriptLog",
    "SitsOnCue",
    "SoundFile",
    "Spot",
    "StageFile",
    "StandsUpFromCue",
    "StyledCue",
    "Time",
    "TimeReference",
    "Timeline",
    "TurnsToCue",
    "WalkCue",
    "file_key",
    "is_play",
    "is_score",
    "is_walk",
    "make_timeline",
    "play_schema",
    "read_script",
    "score_schema",
]
