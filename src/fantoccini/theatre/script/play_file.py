"""Schema of play files: the cast, its props, the stage with its marks, and acts of cues.

A mark is a named place on the stage, a cue a verb with its players and time. Classes with names in
`File` are parts of one play file.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fantoccini.base.documents import (
    Angle,
    Document,
    Kind,
    Length,
    Model,
    Name,
    NotNegative,
    PositiveLength,
    Real,
    Size,
    entries,
    validation_error,
)
from fantoccini.model.puppet import WORDS, AnyObstacle, AnyShape, Colour, Mass, PoseValue
from fantoccini.theatre.script.score_file import SoundsFile
from fantoccini.theatre.script.unions import AnyPlayCue
from fantoccini.theatre.script.values import Facing, Factor, NameList, StageAngle, StagePlace, Time

_MAX_CAMERA_ELEVATION = math.radians(80.0)
"""Largest angle of a camera above or below the horizontal [rad]."""


class MarkFile(Model):
    """A mark: a named place on the stage."""

    at: tuple[Real, Real]
    """x towards the audience, y to the audience's right, which is stage left [m]."""
    facing: Facing = 0.0
    """Direction of a player that stands there; towards the audience by default."""


class SpaceFile(Model):
    """A rectangle that bounds the hands."""

    x: tuple[Real, Real]
    """Lowest and highest x [m]."""
    y: tuple[Real, Real]
    """Lowest and highest y [m]."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses empty intervals."""
        for key, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise validation_error(
                    f"found {key}: [{low:g}, {high:g}]; needed: the lower one first"
                )


class StageFile(Model):
    """The stage: its marks, its obstacles, and bounds of the hands above it."""

    marks: dict[Name, MarkFile] = Field(default_factory=dict)
    """Name -> place."""
    space: SpaceFile | None = None
    """Bounds of the upper ends of the strings; none by default."""
    speed: Size = 1.5
    """Largest speed of driven coordinates [m/s or rad/s]."""
    acceleration: Size = 12.0
    """Largest acceleration of driven coordinates [m/s^2 or rad/s^2]."""
    clear: Size = 0.005
    """Least distance between players, obstacles and strings [m]."""
    floor: Real = 0.0
    """Height of the floor [m]."""
    obstacles: tuple[AnyObstacle, ...] = ()
    """Shapes that stand on the stage, as in scene files."""


class PlayerFile(Model):
    """A puppet of the cast."""

    puppet: str = "marionette"
    """File beside this one, or the name of a bundled puppet."""
    at: str | tuple[Real, Real]
    """The mark or place where it hangs at the start."""
    facing: Facing | None = None
    """Direction at the start; that of the mark by default."""
    lift: Length = 0.025
    """Length by which all its strings are wound in, to hang clear of the floor [m]."""
    walks: Literal["above the floor", "on the floor"] = "above the floor"
    """Whether its feet touch the floor when it walks straight; its puppet then needs a gait."""
    pose: dict[str, PoseValue] = Field(default_factory=dict)
    """Start values that replace those of the puppet's file."""
    colours: dict[str, Colour] = Field(default_factory=dict)
    """Colour of the puppet's file, or name of a body -> colour on the stage."""


class PropFile(Model):
    """A prop, with its holder or its place at the start."""

    like: Name | None = None
    """Name of a bundled prop; the prop's own name by default."""
    shapes: tuple[AnyShape, ...] = ()
    """Solids as in scene files, instead of those of a bundled prop; the bottom is at z = 0."""
    mass: Mass | None = None
    """Mass, instead of the sum over the shapes [kg]."""
    handle: Size | None = None
    """Height above its bottom of the bar by which it hangs on a forearm [m]."""
    seat: Size | None = None
    """Height of the seat above its bottom [m]; a player on it faces along the prop's x."""
    held_by: Name | None = Field(None, alias="held by")
    """The player on whose forearm it hangs at the start."""
    side: Literal["left", "right"] = "right"
    """Side of that forearm."""
    at: StagePlace | None = None
    """The mark or place where it stands at the start."""
    on: Name | None = None
    """The obstacle on which it stands; the floor by default."""
    facing: Facing = 0.0
    """Direction of its x axis."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses contradictory keys."""
        if (self.held_by is None) == (self.at is None and self.on is None):
            count_text = "nothing" if self.held_by is None else "both"
            raise validation_error(
                f"found {count_text} of `held by` and a place; needed: one of them"
            )
        if self.held_by is None and "side" in self.model_fields_set:
            raise validation_error("found `side` without `held by`; only held props have a side")
        if self.held_by is not None and "facing" in self.model_fields_set:
            raise validation_error("found both `held by` and `facing`; needed: one of them")
        if self.shapes and self.like is not None:
            raise validation_error("found both `like` and `shapes`; needed: one of them")
        if self.at is not None and not isinstance(self.at, str) and len(self.at) != 2:
            raise validation_error("found a place of three numbers in `at`; needed: [x, y]")


class LeashFile(Model):
    """A leash from a player's hand to the neck of another; it must stay slack."""

    held_by: Name = Field(alias="held by")
    """The player that holds it."""
    side: Literal["left", "right"] = "right"
    """Side of the hand."""
    to: Name
    """The player on whose neck it ends."""
    length: PositiveLength
    """Largest distance of hand and neck [m]."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses a leash of one player."""
        if self.held_by == self.to:
            raise validation_error(f"found {self.to!r} at both ends; needed: two players")


class ShotFile(Model):
    """A shot of the film's camera, until the next one begins."""

    when: Time = 0.0
    """Time at which it begins: a beat of the act, a time of the play by name, a moment of a cue,
    `NAME arrives` or `NAME is done`, with an offset in beats."""
    at: NameList = ("all",)
    """Players and props that it shows and follows, a mark or an obstacle, or `all`."""
    from_: StageAngle = Field(0.0, alias="from")
    """Direction from which it sees them; from the audience by default."""
    above: Angle = math.radians(10.0)
    """Angle above the horizontal from which it sees them [rad]."""
    zoom: Factor = 1.0
    """Factor of their size in the picture; at 1 they just fill it."""
    over: NotNegative = 0.0
    """Duration of the camera's move to this shot [beats]; 0, the default, is a cut."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses a camera that looks straight down or up."""
        if not abs(self.above) <= _MAX_CAMERA_ELEVATION:
            degrees = math.degrees(self.above)
            raise validation_error(f"found `above: {degrees:.4g} deg`; needed: -80 to 80 deg")


class ActFile(Model):
    """An act: it begins when everything before it has ended."""

    act: str
    """Name of the act."""
    after: NotNegative = 0.0
    """Pause before it [beats]."""
    cues: Annotated[tuple[AnyPlayCue, ...], entries(1)]
    """Cues in any order; those of one player follow each other in this order."""
    camera: tuple[ShotFile, ...] = ()
    """Shots of the film's camera, in any order."""


class PlayFile(Document):
    """A play."""

    kind: ClassVar = Kind("play", "a play has the keys `play`, `cast` and `acts`", words=WORDS)

    play: Name
    """Name of the play."""
    about: str = ""
    """Description of the play."""
    tempo: Factor = 60.0
    """Beats in a minute. A step of a walk takes a beat, several or a part of one, near 0.6 s."""
    cast: Annotated[dict[Name, PlayerFile], Field(min_length=1)]
    """Name -> puppet and its start."""
    props: dict[Name, PropFile] = Field(default_factory=dict)
    """Name -> prop and its start."""
    leashes: dict[Name, LeashFile] = Field(default_factory=dict)
    """Name -> leash."""
    stage: StageFile = Field(default_factory=StageFile)
    """The stage."""
    times: dict[Name, NotNegative] = Field(default_factory=dict)
    """Name -> beat from the play's beginning, for instance of a drum in the music."""
    acts: Annotated[tuple[ActFile, ...], entries(1)]
    """Acts in order."""
    sound: SoundsFile = ()
    """A sound file, or several with the times at which they begin."""
