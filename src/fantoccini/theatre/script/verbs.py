"""Verbs of scores and plays: the kinds of names in their keys, and the marks of their gestures.

A cue is a line of a score or play: a verb with its player and time. A mark is a named time of its
gesture, such as that at which a prop changes hands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from fantoccini.theatre.script import cues
from fantoccini.theatre.script.cues import CueFile

MeetingKind = Literal["hangs", "given", "put", "picked", "sits", "walks"]
"""Kind of meeting: a prop hangs on a forearm, is given, put down or picked up, or someone sits, or
walks on the floor."""


@dataclass(frozen=True)
class Verb:
    """Properties of a verb.

    Attributes:
        cue: class of its cues.
        default_name: name by which times refer to its cues; "" if it is that of the gesture.
        motion_scope: scope of the motion: ``strings``, the ``player``, or a ``thing`` as well.
        name_kinds: key -> kind of the name in it: ``place``, ``direction``, ``player``, ``prop``,
            ``seat`` or ``table``.
        marks: marks of its gesture.
        meeting: kind of the meeting in which players and props touch, which is then verified.
        measured_property: property of a prop that is measured in the previous run: the ``place``
            where it stands, or its ``handle`` on a forearm.
    """

    cue: type[CueFile]
    motion_scope: Literal["strings", "player", "thing"]
    default_name: str = ""
    name_kinds: Mapping[str, str] = field(default_factory=dict)
    marks: tuple[str, ...] = ()
    meeting: MeetingKind | None = None
    measured_property: Literal["", "place", "handle"] = ""


ARRIVAL_MARK = "arrives"
"""Mark at the end of a walk."""

_WALK_NAME_KINDS = {"past": "place", "facing": "direction"}

VERBS: dict[str, Verb] = {
    verb.cue.verb: verb
    for verb in (
        Verb(cues.GestureCue, "strings"),
        Verb(cues.PhraseCue, "strings"),
        Verb(cues.HoldCue, "strings"),
        Verb(cues.DoesCue, "strings"),
        Verb(
            cues.WalksToCue,
            "player",
            "walk",
            {"walks_to": "place", **_WALK_NAME_KINDS},
            (ARRIVAL_MARK,),
        ),
        Verb(
            cues.EntersToCue,
            "player",
            "enter",
            {"enters_to": "place", **_WALK_NAME_KINDS},
            (ARRIVAL_MARK,),
        ),
        Verb(
            cues.ExitsToCue,
            "player",
            "exit",
            {"exits_to": "place", **_WALK_NAME_KINDS},
            (ARRIVAL_MARK,),
        ),
        Verb(cues.TurnsToCue, "player", "turn", {"turns_to": "direction"}, (ARRIVAL_MARK,)),
        Verb(cues.LooksAtCue, "strings", "look", {"looks_at": "place"}, ("there",)),
        Verb(cues.PointsAtCue, "strings", "point", {"points_at": "place"}, ("points",)),
        Verb(
            cues.GivesCue,
            "thing",
            "give",
            {"gives": "prop", "to": "player"},
            ("offered", "under", "taken", "released"),
            "given",
            "handle",
        ),
        Verb(cues.SitsOnCue, "thing", "sit", {"sits_on": "seat"}, ("down",), "sits", "place"),
        Verb(cues.StandsUpFromCue, "thing", "stand_up", {"stands_up_from": "seat"}, ("up",)),
        Verb(
            cues.PutsDownCue,
            "thing",
            "put_down",
            {"puts_down": "prop", "onto": "table"},
            ("down", "free"),
            "put",
            "handle",
        ),
        Verb(
            cues.PicksUpCue,
            "thing",
            "pick_up",
            {"picks_up": "prop"},
            ("under", "up"),
            "picked",
            "place",
        ),
    )
}
"""Key of a verb -> the verb."""


def is_walk(entry: CueFile) -> bool:
    """Whether a cue moves the players over the stage."""
    return VERBS[entry.verb].motion_scope == "player"
