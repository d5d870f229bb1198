"""Cues of scores and plays: action, players and time. The verb determines the other keys.

A cue has exactly one verb as a key: ``gesture: bow`` in a score, ``walks to: centre`` in a play.

A lane is a list of cues of a score in order. A mark is a named time of a gesture or score, or a
named place on the stage.
"""

from __future__ import annotations

from math import inf
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fantoccini.base.documents import Angle, Length, Model, Name, NotNegative, validation_error
from fantoccini.theatre.script.values import (
    END,
    START,
    Count,
    Facing,
    Factor,
    Mark,
    NameList,
    Spot,
    StagePlace,
    StyleWords,
    Target,
    Time,
    TimeList,
)


class CueFile(Model):
    """A cue of a score or a play.

    Attributes:
        verb: key that names the action; "" in cues without a verb.
        keys_rule: sentence about the cues that have the keys that the class declares.
        other_keys_rule: sentence about all keys of the class, instead of ``keys_rule``.
        timing_keys: keys that exclude `on`.
    """

    verb: ClassVar[str] = ""
    keys_rule: ClassVar[str] = ""
    other_keys_rule: ClassVar[str] = ""
    timing_keys: ClassVar[tuple[str, ...]] = ()

    name: Name | None = None
    """Name to which times may refer; by default that of the gesture, or the verb."""

    @property
    def verb_value(self) -> Any:
        """Value of the verb's key."""
        return getattr(self, self.verb)

    @property
    def delay(self) -> float:
        """Delay of its beginning after the time that it refers to [beats]."""
        return 0.0

    @property
    def waits_for_go(self) -> bool:
        """True if a live show waits for GO before it."""
        return False

    @property
    def mark(self) -> str:
        """Mark in `on`; "" if there is none."""
        return next(iter(getattr(self, "on", None) or ()), "")

    @property
    def start_times(self) -> list[tuple[Spot, Time]]:
        """Times at which it begins, or its mark occurs, each with its keys."""
        on = getattr(self, "on", None) or {}
        return [(("on", mark), time) for mark, time in on.items()]


class MarkedCue(CueFile):
    """A cue that may be timed by a mark."""

    keys_rule: ClassVar[str] = "needed: `when`"

    on: dict[Mark, Time] | None = None
    """Mark -> its time: a mark of the gesture, or `arrives` of a walk."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses contradictory keys."""
        if self.on is None:
            return
        if self.model_fields_set & {*self.timing_keys}:
            first, *others = self.timing_keys
            keys = f"`on` and `{first}` or `{others[0]}`" if others else f"`{first}` and `on`"
            raise validation_error(f"found both {keys}; needed: one of them")
        if len(self.on) != 1:
            raise validation_error(f"found {len(self.on)} marks in `on`; needed: one")


class StyledCue(MarkedCue):
    """A cue with variations of its gesture."""

    keys_rule: ClassVar[str] = "only `does` has `{key}`"

    larger: Factor = 1.0
    """Factor of the gesture's size."""
    faster: Factor = 1.0
    """Factor of the gesture's speed."""
    mirrored: bool = False
    """Whether left and right are exchanged."""
    repeat: Count = 1
    """Number of times that the gesture is done, without a pause."""
    lasts: Factor | None = None
    """Duration of each repetition [beats]; by default that of the gesture's file."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses contradictory keys."""
        super().model_post_init(context)
        if self.lasts is not None and self.faster != 1.0:
            raise validation_error("found both `lasts` and `faster`; needed: one of them")


# -- scores ----------------------------------------------------------------------------------


class ScoreCue(CueFile):
    """A cue in a lane of a score. Without `at` and `on` it begins when the previous one ends."""

    timing_keys: ClassVar[tuple[str, ...]] = ("at",)

    at: Time | None = None
    """Time at which the cue begins."""

    @property
    def start_times(self) -> list[tuple[Spot, Time]]:
        """Times at which it begins, or its mark occurs, each with its keys."""
        return super().start_times if self.at is None else [(("at",), self.at)]


class HoldCue(ScoreCue):
    """A rest, in which the lane does not move."""

    verb: ClassVar[str] = "hold"
    other_keys_rule: ClassVar[str] = "a hold has only `at` and `name`"

    hold: Factor
    """Duration of the rest."""


class PlayedCue(ScoreCue, StyledCue):
    """A cue of a score with a gesture or a phrase."""

    heading: Angle | None = None
    """Turn of the gesture about the vertical [rad], for a puppet that has turned in a walk."""


class PhraseCue(PlayedCue):
    """A phrase, played like a gesture."""

    verb: ClassVar[str] = "phrase"

    phrase: Name
    """Name of a phrase of this file."""


class GestureCue(PlayedCue):
    """A cue of a score with a gesture."""

    verb: ClassVar[str] = "gesture"
    keys_rule: ClassVar[str] = "only a gesture has `{key}`"

    gesture: str
    """A gesture file or a take (.npz) in this file's folder, or the name of a bundled gesture."""
    of: Name | None = None
    """The puppet of the scene that performs it."""
    steps: Count | None = None
    """Number of steps of `walk`."""
    step: Length | None = None
    """Length of a step of `walk` [m]."""
    turn: Angle | None = None
    """Total angle by which `walk` turns to the left [rad]."""
    to: Target | None = None
    """Target of `point` and `look`: a place [m], or the place of a body at the start."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses contradictory keys."""
        if self.turn:
            # A scaled turn is not a rigid motion; each repetition starts from another heading.
            for key in self.model_fields_set & {"larger", "repeat"}:
                raise validation_error(
                    f"found both `turn` and `{key}`; needed: other `steps` or cues"
                )
        super().model_post_init(context)


# -- plays -----------------------------------------------------------------------------------


class PlayCue(CueFile):
    """A cue of players. Without a time it follows the previous cue of the same player."""

    timing_keys: ClassVar[tuple[str, ...]] = ("when", "after")

    who: NameList
    """A player, several, or `all`."""
    when: TimeList | None = None
    """Time at which it begins: a beat of the act, a named time of the play, a moment of a cue
    (`bow.low`), `NAME arrives` or `NAME is done`, with an offset in beats; of several the last."""
    after: NotNegative = 0.0
    """Delay after `when` [beats]."""
    may_wait: NotNegative | None = Field(None, alias="may wait")
    """Longest further delay, until swing has decayed or a way is free [beats]."""
    optional: bool = False
    """Whether it is left out if it cannot be done."""
    go: bool = False
    """Whether a live show waits for GO before it, once all players stand still."""
    says: Annotated[str, Field(min_length=1)] | None = None
    """Caption shown during the cue."""

    @property
    def start_times(self) -> list[tuple[Spot, Time]]:
        """Times at which it begins, or its mark occurs, each with its keys."""
        if self.mark:
            return super().start_times
        when = self.when or ()
        return [(("when", i) if len(when) > 1 else ("when",), time) for i, time in enumerate(when)]

    @property
    def delay(self) -> float:
        """Delay of its beginning after the time that it refers to [beats]."""
        return self.after

    @property
    def waits_for_go(self) -> bool:
        """True if a live show waits for GO before it."""
        return self.go

    @property
    def is_free(self) -> bool:
        """True if the play gives it no time."""
        return self.when is None and not self.mark and not self.go

    @property
    def patience(self) -> float:
        """Longest delay of its beginning [beats]; infinite if the play gives it no time."""
        return inf if self.may_wait is None and self.is_free else self.may_wait or 0.0


class TimedCue(PlayCue, MarkedCue):
    """A cue of a play that may be timed by a mark."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses contradictory keys."""
        super().model_post_init(context)
        if self.mark in (START, END):
            raise validation_error(f"found `on: {{{self.mark}: ...}}`; needed: a mark, or `when`")


class DoesCue(TimedCue, StyledCue):
    """A cue in which players perform a gesture."""

    verb: ClassVar[str] = "does"
    keys_rule: ClassVar[str] = "only `does` has `{key}`"

    does: str
    """A gesture: a file, a take (.npz) or a clip of motion capture (.bvh) beside this one, or a
    bundled gesture or clip."""
    how: StyleWords = ()
    """Words that vary the gesture."""


class WalkCue(TimedCue):
    """A cue in which players walk to a mark or a place."""

    keys_rule: ClassVar[str] = "only walks have it"

    past: tuple[StagePlace, ...] = ()
    """Marks or places that a walk passes in order, before its goal."""
    near: Length = 0.0
    """Distance from its goal at which a walk may end [m]."""
    facing: Facing | None = None
    """Direction of the player after a walk; that of the mark by default."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses contradictory keys."""
        super().model_post_init(context)
        if any(
            not isinstance(place, str) and len(place) != 2
            for place in (self.verb_value, *self.past)
        ):
            raise validation_error(
                f"found a place of three numbers in `{file_key(self.verb)}`; needed: [x, y]"
            )


class WalksToCue(WalkCue):
    """A cue in which players walk on the stage."""

    verb: ClassVar[str] = "walks_to"

    walks_to: StagePlace = Field(alias="walks to")
    """A mark or a place."""


class EntersToCue(WalkCue):
    """A cue in which players who are off the stage walk onto it."""

    verb: ClassVar[str] = "enters_to"

    enters_to: StagePlace = Field(alias="enters to")
    """A mark or a place."""


class ExitsToCue(WalkCue):
    """A cue in which players walk off the stage; their next cue can only be an entrance."""

    verb: ClassVar[str] = "exits_to"

    exits_to: StagePlace = Field(alias="exits to")
    """A mark or a place."""


class TurnsToCue(TimedCue):
    """A cue in which players turn on the spot."""

    verb: ClassVar[str] = "turns_to"

    turns_to: Facing = Field(alias="turns to")
    """A direction, a mark, a player or an obstacle."""


class LooksAtCue(TimedCue):
    """A cue in which players look at something."""

    verb: ClassVar[str] = "looks_at"

    looks_at: StagePlace = Field(alias="looks at")
    """A player, a mark, an obstacle or a place [x, y, z]."""


class PointsAtCue(TimedCue):
    """A cue in which players point at something."""

    verb: ClassVar[str] = "points_at"

    points_at: StagePlace = Field(alias="points at")
    """A player, a mark, an obstacle or a place [x, y, z]."""


class PropCue(PlayCue):
    """A cue in which one player handles a prop or a seat."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses several players."""
        if len(self.who) != 1 or self.who == ("all",):
            named = "`all`" if self.who == ("all",) else f"{len(self.who)} players"
            raise validation_error(
                f"found {named}; needed: one player, who `{file_key(self.verb)}`"
            )


class GivesCue(PropCue):
    """A cue in which a prop changes hands."""

    verb: ClassVar[str] = "gives"
    keys_rule: ClassVar[str] = "`gives` has `to`, and only it"

    gives: Name
    """A prop that hangs on its arm; the player `to` steps up and takes it."""
    to: Name
    """Player that takes the prop."""


class SitsOnCue(PropCue):
    """A cue in which a player sits down."""

    verb: ClassVar[str] = "sits_on"

    sits_on: Name = Field(alias="sits on")
    """A prop or an obstacle with a seat."""


class StandsUpFromCue(PropCue):
    """A cue in which a player stands up."""

    verb: ClassVar[str] = "stands_up_from"

    stands_up_from: Name = Field(alias="stands up from")
    """The seat."""


class PutsDownCue(PropCue):
    """A cue in which a prop is put on an obstacle."""

    verb: ClassVar[str] = "puts_down"
    keys_rule: ClassVar[str] = "`puts down` has `onto`, and only it"

    puts_down: Name = Field(alias="puts down")
    """A prop that hangs on its arm and is put on `onto`."""
    onto: Name
    """Obstacle on which the prop is put."""


class PicksUpCue(PropCue):
    """A cue in which a prop is taken from the place where it stands."""

    verb: ClassVar[str] = "picks_up"

    picks_up: Name = Field(alias="picks up")
    """A prop that stands on the stage."""


class VerblessScoreCue(ScoreCue):
    """A score's cue without a verb: only its unknown keys are read, and reported as mistakes."""


class VerblessPlayCue(PlayCue):
    """A play's cue without a verb."""

    who: NameList = ("all",)


def file_key(key: str) -> str:
    """A key as it is written: ``walks_to`` is ``walks to``."""
    return key.replace("_", " ")
