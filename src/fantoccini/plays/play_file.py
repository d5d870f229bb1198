"""Schema of play files: who does what, where and when, on a stage with marks."""

from __future__ import annotations

import os
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema

from fantoccini.errors import nearest
from fantoccini.gestures.score_file import Factor, Length, Mark, SoundsFile, Time
from fantoccini.gestures.timing import END, START
from fantoccini.puppet.files import described_schema
from fantoccini.puppet.located import has_key, shown
from fantoccini.puppet.schema import PoseValue
from fantoccini.puppet.shapes import AnyObstacle
from fantoccini.puppet.sized import SIZED, Size
from fantoccini.puppet.values import (
    Model,
    Name,
    NotNegative,
    Real,
    entries,
    mistake,
    read_angle,
)

DIRECTIONS = {"audience": 0.0, "left": 90.0, "back": 180.0, "right": -90.0}
"""Direction on the stage -> angle from the audience, which is along x [deg]."""

HOW: dict[str, dict[str, Any]] = {
    "timidly": {"larger": 0.6, "faster": 0.8},
    "boldly": {"larger": 1.25},
    "slowly": {"faster": 0.7},
    "quickly": {"faster": 1.3},
    "smaller": {"larger": 0.7},
    "larger": {"larger": 1.3},
    "mirrored": {"mirrored": True},
    "twice": {"repeat": 2},
    "thrice": {"repeat": 3},
}
"""Word -> what it does to a gesture; factors multiply."""

VERBS = ("does", "walks_to", "enters_to", "exits_to", "turns_to", "looks_at", "points_at")
"""What a cue may be."""

OF_GESTURES = ("how", "larger", "faster", "mirrored", "repeat", "lasts")
"""Keys that only `does` has."""


def _listed(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _times(value: Any) -> Any:
    return tuple(value) if isinstance(value, list | tuple) else (value,)


def _facing(value: Any) -> Any:
    if isinstance(value, str) and not value.lstrip()[:1].isdigit() and value[:1] not in "+-.":
        return value
    return read_angle(value)


def _where(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise mistake(f"found {shown(value)}; needed: a mark, a player, or a place [x, y] in m")
    return tuple(value)


def _word(value: str) -> str:
    if value not in HOW:
        raise mistake(f"found {shown(value)}; allowed: {', '.join(HOW)}{nearest(value, HOW)}")
    return value


Where = Annotated[
    str | tuple[Real, Real] | tuple[Real, Real, Real], BeforeValidator(_where), SIZED
]
"""A mark, a player or an obstacle, or a place: x towards the audience, y to its right [m]."""
Facing = Annotated[
    float | str,
    BeforeValidator(_facing),
    SIZED,
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]}),
]
"""An angle from the audience to the left, or `audience`, `left`, `right`, `back`, or a name."""
Names = Annotated[
    tuple[Name, ...], BeforeValidator(_listed, json_schema_input_type=str | tuple[str, ...]),
    Field(min_length=1),
]  # fmt: skip
Word = Annotated[
    str, AfterValidator(_word), WithJsonSchema({"type": "string", "enum": list(HOW)})
]
How = Annotated[
    tuple[Word, ...], BeforeValidator(_listed, json_schema_input_type=str | tuple[str, ...])
]
When = Annotated[
    tuple[Time, ...], BeforeValidator(_times, json_schema_input_type=Time | tuple[Time, ...])
]


class MarkFile(Model):
    """A place on the stage."""

    at: tuple[Real, Real]
    """x towards the audience, y to its right as it looks, which is stage left [m]."""
    facing: Facing = 0.0
    """Where one looks who stands there; towards the audience by default."""


class SpaceFile(Model):
    """The rectangle of the hands."""

    x: tuple[Real, Real]
    """[m]"""
    y: tuple[Real, Real]
    """[m]"""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses what has no inside."""
        for key, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise mistake(f"found {key}: [{low:g}, {high:g}]; needed: the lower one first")


class StageFile(Model):
    """The stage: its marks, what stands on it, and what hands can do above it."""

    marks: dict[Name, MarkFile] = Field(default_factory=dict)
    """Name -> place."""
    space: SpaceFile | None = None
    """Where the upper ends of the strings can be; anywhere by default."""
    speed: Size = 1.5
    """Largest speed of driven coordinates [m/s or rad/s]."""
    acceleration: Size = 12.0
    """Largest acceleration of them [m/s^2 or rad/s^2]."""
    clear: Size = 0.005
    """Distance that players, obstacles and strings keep [m]."""
    floor: Real = 0.0
    """Height of the floor [m]."""
    obstacles: tuple[AnyObstacle, ...] = ()
    """Shapes that stand on the stage, as in scene files."""


class PlayerFile(Model):
    """A puppet of the cast."""

    puppet: str = "marionette"
    """Its file beside this one, or the name of a bundled one."""
    at: str | tuple[Real, Real]
    """The mark or place where it hangs at the start."""
    facing: Facing | None = None
    """Where it looks at the start; as the mark says by default."""
    lift: Length = 0.025
    """By how much all its strings are wound in, to hang clear of the floor [m]."""
    pose: dict[str, PoseValue] = Field(default_factory=dict)
    """Start values that replace those of its file."""


class CueFile(Model):
    """Who does what, where and when. Without a time it follows what the same player does before."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": [v.replace("_", " ")]} for v in VERBS]}
    )

    who: Names
    """A player, several, or `all`."""
    does: str | None = None
    """A gesture: a file or a take (.npz) beside this one, or a bundled one."""
    walks_to: Where | None = Field(None, alias="walks to")
    """A mark or a place."""
    enters_to: Where | None = Field(None, alias="enters to")
    """Likewise, of one who has done nothing yet."""
    exits_to: Where | None = Field(None, alias="exits to")
    """Likewise, of one who does nothing any more."""
    past: tuple[Where, ...] = ()
    """Marks or places that a walk leads by, in order, before its own."""
    turns_to: Facing | None = Field(None, alias="turns to")
    """A direction, a mark, a player or an obstacle."""
    looks_at: Where | None = Field(None, alias="looks at")
    """A player, a mark, an obstacle or a place [x, y, z]."""
    points_at: Where | None = Field(None, alias="points at")
    """Likewise."""

    when: When | None = None
    """When it begins: a beat of the act, a time of the play by name, a moment of a cue (`bow.low`),
    `NAME arrives` or `NAME is done`, with an offset in beats; of several the last."""
    after: NotNegative = 0.0
    """Beats to wait from then on."""
    on: dict[Mark, Time] | None = None
    """A mark of the gesture -> when it is seen; of a walk: `arrives`."""
    facing: Facing | None = None
    """Where it looks after a walk; as the mark says by default."""
    how: How = ()
    """Words that change a gesture."""
    larger: Factor = 1.0
    """Factor of its size."""
    faster: Factor = 1.0
    """Factor of its speed."""
    mirrored: bool = False
    """Whether left and right change places."""
    repeat: Annotated[int, Field(ge=1, le=1000)] = 1
    """How often, in a row."""
    lasts: Factor | None = None
    """Its duration, each time [beats]."""
    may_wait: NotNegative | None = Field(None, alias="may wait")
    """By how much later it may begin, so that swing has settled or a way is free [beats]."""
    near: Length = 0.0
    """How far from its place a walk may end [m]."""
    optional: bool = False
    """Whether it is left out where it cannot be done."""
    go: bool = False
    """Whether a live show waits for GO before it, once all stand still."""
    says: Annotated[str, Field(min_length=1)] | None = None
    """A caption for as long as it lasts."""
    name: Name | None = None
    """By which times refer to it; what it does by default."""

    @property
    def verb(self) -> str:
        """What kind of cue it is."""
        return next(verb for verb in VERBS if getattr(self, verb) is not None)

    def model_post_init(self, context: Any, /) -> None:
        """Refuses what contradicts itself."""
        found = [verb for verb in VERBS if getattr(self, verb) is not None]
        if len(found) != 1:
            both = "both " + " and ".join(f"`{said(v)}`" for v in found) if found else "no verb"
            allowed = ", ".join(f"`{said(verb)}`" for verb in VERBS)
            raise mistake(f"found {both}; needed: one of {allowed}")
        (verb,) = found
        keys = self.model_fields_set
        if verb != "does" and (more := keys & set(OF_GESTURES)):
            text = f"found `{said(verb)}` with `{min(more)}`"
            raise mistake(f"{text}; only `does` has `{min(more)}`")
        if "on" in keys and keys & {"when", "after"}:
            raise mistake("found both `on` and `when` or `after`; needed: one of them")
        if self.on is not None and len(self.on) != 1:
            raise mistake(f"found {len(self.on)} marks in `on`; needed: one")
        if self.lasts is not None and self.faster != 1.0:
            raise mistake("found both `lasts` and `faster`; needed: one of them")
        walks = verb in ("walks_to", "enters_to", "exits_to")
        if not walks and (more := keys & {"near", "past", "facing"}):
            raise mistake(f"found `{said(verb)}` with `{min(more)}`; only walks have it")
        places = [getattr(self, verb), *self.past] if walks else []
        if any(not isinstance(place, str) and len(place) != 2 for place in places):
            raise mistake(f"found a place of three numbers in `{said(verb)}`; needed: [x, y]")
        if self.on is not None:
            (mark,) = self.on
            if mark in (START, END):
                raise mistake(f"found `on: {{{mark}: ...}}`; needed: a mark, or `when`")


def said(key: str) -> str:
    """A key as it is written: ``walks_to`` is ``walks to``."""
    return key.replace("_", " ")


class ActFile(Model):
    """An act: it begins when all that came before has ended."""

    act: str
    """Its name."""
    after: NotNegative = 0.0
    """Beats of pause before it."""
    cues: Annotated[tuple[CueFile, ...], entries(1)]
    """In the order in which they are told; each player does its own one after the other."""


class PlayFile(Model):
    """A play."""

    play: Name
    """The play's name."""
    about: str = ""
    """What is seen."""
    tempo: Factor = 60.0
    """Beats in a minute; a step of a walk takes one, or a part of one or several, near 0.6 s."""
    cast: Annotated[dict[Name, PlayerFile], Field(min_length=1)]
    """Name -> puppet, and where it is at the start."""
    stage: StageFile = Field(default_factory=StageFile)
    """The stage."""
    times: dict[Name, NotNegative] = Field(default_factory=dict)
    """Name -> beat from the play's beginning, as of a drum in the music."""
    acts: Annotated[tuple[ActFile, ...], entries(1)]
    """One after the other."""
    sound: SoundsFile = ()
    """A sound file, or several with the times at which they begin."""


def is_play(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a play: YAML with the key `play`."""
    return has_key(path, "play")


def play_schema() -> dict[str, Any]:
    """JSON Schema of a play file, for editors."""
    return described_schema(PlayFile, "fantoccini play")
