"""Schema of play files: the cast, its props, the stage with its marks, and acts of cues."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fantoccini.base.documents import (
    Document,
    Kind,
    Length,
    Model,
    Name,
    NotNegative,
    Real,
    Size,
    entries,
    mistake,
)
from fantoccini.model.puppet import WORDS, AnyObstacle, AnyShape, Mass, PoseValue
from fantoccini.theatre.script.score_file import SoundsFile
from fantoccini.theatre.script.unions import AnyPlayCue
from fantoccini.theatre.script.values import Facing, Factor, Where


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
    """Length by which all its strings are wound in, to hang clear of the floor [m]."""
    pose: dict[str, PoseValue] = Field(default_factory=dict)
    """Start values that replace those of its file."""


class PropFile(Model):
    """A prop: what it is, and who has it or where it stands at the start."""

    like: Name | None = None
    """A bundled prop; by default the one of its name."""
    shapes: tuple[AnyShape, ...] = ()
    """Its solids, as in scene files, instead of those of a bundled one; its bottom is at z = 0."""
    mass: Mass | None = None
    """[kg], instead of the shapes' sum."""
    handle: Size | None = None
    """Height of the bar by which it hangs on a forearm [m]."""
    seat: Size | None = None
    """Height of the seat on which one sits down who looks along its x [m]."""
    held_by: Name | None = Field(None, alias="held by")
    """The player on whose forearm it hangs at the start."""
    side: Literal["left", "right"] = "right"
    """Side of that forearm."""
    at: Where | None = None
    """The mark or place where it stands at the start."""
    on: Name | None = None
    """The obstacle on which it stands; the floor by default."""
    facing: Facing = 0.0
    """Direction of its x."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses what contradicts itself."""
        if (self.held_by is None) == (self.at is None and self.on is None):
            found = "nothing" if self.held_by is None else "both"
            raise mistake(f"found {found} of `held by` and a place; needed: one of them")
        if self.held_by is None and "side" in self.model_fields_set:
            raise mistake("found `side` without `held by`; only what is held has it")
        if self.held_by is not None and "facing" in self.model_fields_set:
            raise mistake("found both `held by` and `facing`; needed: one of them")
        if self.shapes and self.like is not None:
            raise mistake("found both `like` and `shapes`; needed: one of them")
        if self.at is not None and not isinstance(self.at, str) and len(self.at) != 2:
            raise mistake("found a place of three numbers in `at`; needed: [x, y]")


class ActFile(Model):
    """An act: it begins when all that came before has ended."""

    act: str
    """Its name."""
    after: NotNegative = 0.0
    """Beats of pause before it."""
    cues: Annotated[tuple[AnyPlayCue, ...], entries(1)]
    """In the order in which they are told; each player does its own one after the other."""


class PlayFile(Document):
    """A play."""

    kind: ClassVar = Kind("play", "a play has the keys `play`, `cast` and `acts`", words=WORDS)

    play: Name
    """The play's name."""
    about: str = ""
    """Description of the play."""
    tempo: Factor = 60.0
    """Beats in a minute; a step of a walk takes one, or a part of one or several, near 0.6 s."""
    cast: Annotated[dict[Name, PlayerFile], Field(min_length=1)]
    """Name -> puppet, and where it is at the start."""
    props: dict[Name, PropFile] = Field(default_factory=dict)
    """Name -> prop, and who has it at the start."""
    stage: StageFile = Field(default_factory=StageFile)
    """The stage."""
    times: dict[Name, NotNegative] = Field(default_factory=dict)
    """Name -> beat from the play's beginning, as of a drum in the music."""
    acts: Annotated[tuple[ActFile, ...], entries(1)]
    """One after the other."""
    sound: SoundsFile = ()
    """A sound file, or several with the times at which they begin."""
