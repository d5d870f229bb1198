"""Schema of the cues of play files: who does what, where and when."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema

from fantoccini.base import nearest
from fantoccini.base.documents import (
    SIZED,
    Model,
    Name,
    NotNegative,
    Real,
    mistake,
    read_angle,
    shown,
)
from fantoccini.theatre.gestures import END, START, Factor, Length, Mark, Time

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

WITH_PROPS = ("gives", "sits_on", "stands_up_from", "puts_down", "picks_up")
"""What a cue may be that is done with a prop."""

VERBS = (
    "does",
    "walks_to",
    "enters_to",
    "exits_to",
    "turns_to",
    "looks_at",
    "points_at",
    *WITH_PROPS,
)
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


Where = Annotated[str | tuple[Real, Real] | tuple[Real, Real, Real], BeforeValidator(_where), SIZED]
"""A mark, a player or an obstacle, or a place: x towards the audience, y to its right [m]."""
Facing = Annotated[
    float | str,
    BeforeValidator(_facing),
    SIZED,
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]}),
]
"""An angle from the audience to the left, or `audience`, `left`, `right`, `back`, or a name."""
Names = Annotated[
    tuple[Name, ...],
    BeforeValidator(_listed, json_schema_input_type=str | tuple[str, ...]),
    Field(min_length=1),
]
Word = Annotated[str, AfterValidator(_word), WithJsonSchema({"type": "string", "enum": list(HOW)})]
How = Annotated[
    tuple[Word, ...], BeforeValidator(_listed, json_schema_input_type=str | tuple[str, ...])
]
When = Annotated[
    tuple[Time, ...], BeforeValidator(_times, json_schema_input_type=Time | tuple[Time, ...])
]


class CueFile(Model):
    """Who does what, where and when. Without a time it follows what the same player does before."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": [v.replace("_", " ")]} for v in VERBS]}
    )

    who: Names
    """A player, several, or `all`."""
    does: str | None = None
    """A gesture: a file, a take (.npz) or a clip of motion capture (.bvh) beside this one, or a
    bundled gesture or clip."""
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
    gives: Name | None = None
    """A prop that hangs on its arm, `to` another, who comes up to take it."""
    to: Name | None = None
    """The player who takes what is given."""
    sits_on: Name | None = Field(None, alias="sits on")
    """A prop or an obstacle with a seat."""
    stands_up_from: Name | None = Field(None, alias="stands up from")
    """What it sits on."""
    puts_down: Name | None = Field(None, alias="puts down")
    """A prop that hangs on its arm, `onto` something."""
    onto: Name | None = None
    """The obstacle on which a prop is put."""
    picks_up: Name | None = Field(None, alias="picks up")
    """A prop that stands somewhere."""

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
        self._check_props(verb)
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

    def _check_props(self, verb: str) -> None:
        for key, needs in (("to", "gives"), ("onto", "puts_down")):
            if (verb == needs) != (getattr(self, key) is not None):
                found = f"`{said(verb)}` with `{key}`" if verb != needs else f"no `{key}`"
                raise mistake(f"found {found}; `{said(needs)}` has `{key}`, and only it")
        if verb not in WITH_PROPS:
            return
        if len(self.who) != 1 or self.who == ("all",):
            found = "`all`" if self.who == ("all",) else f"{len(self.who)} players"
            raise mistake(f"found {found}; needed: one player, who `{said(verb)}`")
        if self.on is not None:
            raise mistake(f"found `{said(verb)}` with `on`; needed: `when`")


def said(key: str) -> str:
    """A key as it is written: ``walks_to`` is ``walks to``."""
    return key.replace("_", " ")
