"""The verbs of scores and plays: what each needs, and the marks of what is made for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from fantoccini.theatre.script import cues
from fantoccini.theatre.script.cues import CueFile

MeetingKind = Literal["hangs", "given", "put", "picked", "sits"]
"""Kind of meeting: a prop hangs on a forearm, is given, put down or picked up, or someone sits."""


@dataclass(frozen=True)
class Verb:
    """A verb.

    Attributes:
        cue: its cues.
        called: name by which times refer to its cues; "" where that is the gesture's.
        moves: ``strings``, the ``player``, or a ``thing`` as well.
        names: key -> kind of what is named there: ``place``, ``direction``, ``player``, ``prop``,
            ``seat`` or ``table``.
        marks: of the gesture that is made for it.
        meets: the kind of meeting in which players and props touch, by which it is verified.
        located: what of a prop is measured in the run before: the ``place`` where it stands, or the
            ``handle`` on a forearm.
    """

    cue: type[CueFile]
    moves: Literal["strings", "player", "thing"]
    called: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    marks: tuple[str, ...] = ()
    meets: MeetingKind | None = None
    located: Literal["", "place", "handle"] = ""


ARRIVES = "arrives"
"""Mark of a walk: its end."""

_WALK = {"past": "place", "facing": "direction"}

VERBS: dict[str, Verb] = {
    verb.cue.verb: verb
    for verb in (
        Verb(cues.GestureCue, "strings"),
        Verb(cues.PhraseCue, "strings"),
        Verb(cues.HoldCue, "strings"),
        Verb(cues.DoesCue, "strings"),
        Verb(cues.WalksToCue, "player", "walk", {"walks_to": "place", **_WALK}, (ARRIVES,)),
        Verb(cues.EntersToCue, "player", "enter", {"enters_to": "place", **_WALK}, (ARRIVES,)),
        Verb(cues.ExitsToCue, "player", "exit", {"exits_to": "place", **_WALK}, (ARRIVES,)),
        Verb(cues.TurnsToCue, "player", "turn", {"turns_to": "direction"}, (ARRIVES,)),
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


def walks(given: CueFile) -> bool:
    """True if a cue carries the players."""
    return VERBS[given.verb].moves == "player"
