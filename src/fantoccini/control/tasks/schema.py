"""The schema of task files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from fantoccini.base.documents import (
    SIZED,
    Angle,
    Direction,
    Kind,
    Model,
    Name,
    NotNegative,
    Place,
    Positive,
    Real,
    Size,
    Sized,
    Value,
    mistake,
    read_real,
    shown,
    sized,
)
from fantoccini.control.tasks.control_file import ControlFile, check_one_of
from fantoccini.control.tasks.costs import KINDS
from fantoccini.model.puppet import WORDS

PATHS = ("value", "values", "csv", "circle", "run")
"""Keys of which a track has one: its path."""


class CircleFile(Model):
    """A circle from rest to rest; it begins where it is nearest to the point at the start."""

    centre: Place | None = None
    """Its centre in the world [m]."""
    by: Place | None = None
    """The centre, from where the point is at the start, instead of `centre` [m]."""
    radius: Size | None = None
    """Radius; by default so that it begins where the point starts [m]."""
    normal: Direction
    """Direction of its axis."""
    turns: Sized = 1.0
    """Rounds about the axis; negative ones go the other way."""

    @model_validator(mode="after")
    def _is_somewhere(self) -> CircleFile:
        check_one_of(self, "centre", "by")
        return self


class RunFile(Model):
    """What a saved run did."""

    file: str
    """The run: an npz file beside this one, as `simulate --out` writes it."""
    of: str | None = None
    """Name in the run of what is followed, where it has another one there."""
    begin: Sized | None = None
    """Time at which the run begins; its own first time by default [s]."""
    speed: Annotated[Positive, SIZED] = 1.0
    """Of its time."""
    by: Place = (0.0, 0.0, 0.0)
    """Added to the places of points [m]."""


class TrackFile(Model):
    """What follows a path: one of `point`, `orientation`, `coordinate`, `velocity`, `tension`."""

    point: str | None = None
    """A body, of which a point follows places [m]."""
    orientation: str | None = None
    """A body that turns: quaternions [w, x, y, z] or rotation vectors [rad]."""
    coordinate: str | None = None
    """A scalar coordinate, dynamic or driven [rad or m]."""
    velocity: str | None = None
    """A velocity, dynamic or driven; `*` for all dynamic ones [rad/s or m/s]."""
    tension: str | None = None
    """A string's tension [N]."""
    at: Place = (0.0, 0.0, 0.0)
    """The point in the body's frame [m]."""
    value: Value | None = None
    """A value that holds."""
    times: tuple[Sized, ...] = ()
    """Times of `values`, rising [s]; linear between them."""
    values: tuple[Value, ...] | None = None
    """Values at `times`."""
    csv: str | None = None
    """A CSV file beside this one: columns `t`, and `x`, `y`, `z` of a point, `qw`, `qx`, `qy`, `qz`
    of an orientation, otherwise `value`."""
    circle: CircleFile | None = None
    """A circle of a point."""
    run: RunFile | None = None
    """What a saved run did."""
    weight: Annotated[NotNegative, SIZED] = 1.0
    """Of the integral of the square of what is left."""
    end_weight: Annotated[NotNegative, SIZED] = 0.0
    """Of its square at the end."""
    start: Sized | None = None
    """From when on it counts [s]."""
    end: Sized | None = None
    """Until when it counts [s]."""

    @model_validator(mode="after")
    def _is_one(self) -> TrackFile:
        for what, keys in (("what follows", KINDS), ("its path", PATHS)):
            found = [key for key in keys if getattr(self, key) is not None]
            if len(found) != 1:
                listed = " and ".join(found) or "none"
                raise mistake(f"{what}: found {listed}; needed: one of {', '.join(keys)}")
        if self.circle is not None and self.point is None:
            raise mistake("found a circle; it is a path of a `point`")
        if self.point is None and any(self.at):
            raise mistake("found `at`; it goes with `point`")
        if bool(self.times) != (self.values is not None):
            raise mistake("found one of `times` and `values`; they go together")
        if self.start is not None and self.end is not None and self.start >= self.end:
            raise mistake(
                f"found the start {self.start:g} and the end {self.end:g}; the start must be less"
            )
        return self

    @property
    def kind(self) -> str:
        """What follows: the key."""
        return next(key for key in KINDS if getattr(self, key) is not None)


class TouchFile(Model):
    """A place that a point of a body passes at a time that is found."""

    point: str
    """The body."""
    at: Place = (0.0, 0.0, 0.0)
    """The point in the body's frame [m]."""
    place: Place | None = None
    """The place in the world [m]."""
    by: Place | None = None
    """The place, from where the point is at the start, instead of `place` [m]."""
    between: tuple[Sized | None, Sized | None] = (None, None)
    """First and last time [s]; null where it is open."""
    in_turn: bool = False
    """Whether it comes no earlier than the touch before it."""

    @model_validator(mode="after")
    def _is_somewhere(self) -> TouchFile:
        check_one_of(self, "place", "by")
        return self


class SmoothFile(Model):
    """Weights of the driven accelerations and their rates."""

    acceleration: Annotated[NotNegative, SIZED] = 1e-4
    """Of accelerations [s^4/m^2]."""
    jerk: Annotated[NotNegative, SIZED] = 1e-6
    """Of their rates [s^6/m^2]."""


End = Annotated[Angle | None, SIZED]
"""An end of an interval; nothing where it is open."""
Span = Annotated[tuple[End, End], sized(2)]
Between = Annotated[tuple[Annotated[Angle, SIZED], Annotated[Angle, SIZED]], sized(2)]
Most = Real | dict[str, Real] | None


class BoundsFile(Model):
    """What the motion may not leave. Names that are not mentioned are free."""

    position: dict[str, Span] = Field(default_factory=dict)
    """Driven scalar coordinate -> [low, high]; null where it is open [m or rad]."""
    joint: dict[str, Span] = Field(default_factory=dict)
    """Dynamic scalar coordinate -> [low, high] [rad or m]."""
    tension: dict[str, Span] = Field(default_factory=dict)
    """String -> [low, high] [N]."""
    force: dict[str, Span] = Field(default_factory=dict)
    """Driven velocity -> [low, high] of the force that drives it [N or N m]."""
    speed: Most = None
    """Of all driven coordinates, or by name [m/s or rad/s]."""
    acceleration: Most = None
    """Likewise [m/s^2 or rad/s^2]."""
    jerk: Most = None
    """Likewise [m/s^3 or rad/s^3]."""
    voltage: Most = None
    """Of what controllers ask of dc motors, for all or by the command's name [V]."""
    current: Most = None
    """Likewise [A]."""
    held: tuple[str, ...] = ()
    """Driven velocities that do not move at all."""
    clearance: Annotated[NotNegative | None, SIZED] = None
    """Of bodies and strings from obstacles and other puppets, at least [m]."""
    own_body: bool = False
    """Whether bodies of one puppet that no joint connects keep it, too."""


def _duration(value: Any) -> Any:
    """A positive number, or two of them that do not fall."""
    ends = [read_real(end) for end in (value if isinstance(value, (list, tuple)) else [value])]
    if len(ends) > 2 or not ends or min(ends) <= 0.0:
        raise mistake(f"found {shown(value)}; needed: a positive number, or [shortest, longest]")
    if ends[0] > ends[-1]:
        raise mistake(f"found {ends[0]:g} before {ends[1]:g}; the first is the shortest duration")
    return ends[0] if len(ends) == 1 else tuple(ends)


Duration = Annotated[
    float | tuple[float, float],
    BeforeValidator(_duration),
    SIZED,
    WithJsonSchema({"type": ["number", "array"]}),
]
"""A duration, or the shortest and the longest."""


class TaskFile(ControlFile):
    """A task of optimal control."""

    kind: ClassVar = Kind(
        "task",
        "a task file has the keys `puppet`, `task` and `duration`",
        Path(__file__).parent / "bundled",
        words=WORDS,
    )

    task: Name
    """The task's name."""
    end: dict[str, Value] | None = None
    """Coordinate -> value: it ends at rest with the driven ones there; others as at the start."""
    periodic: dict[str, Angle] | None = None
    """Instead: it ends as it began, but for these scalar coordinates, which have moved by so much
    [m or rad]; `{}` where none have."""
    duration: Duration
    """Of the motion, or [shortest, longest] [s]."""
    tracks: tuple[TrackFile, ...] = ()
    """What follows which paths."""
    touches: tuple[TouchFile, ...] = ()
    """Places that points pass at times that are found."""
    smooth: SmoothFile = SmoothFile()
    """Weights of accelerations and their rates."""
    bounds: BoundsFile = BoundsFile()
    """What the motion may not leave."""
    parameters: dict[str, Between] = Field(default_factory=dict)
    """Parameter of the puppet -> [low, high] between which it is chosen along with the motion."""
    guess: str | None = None
    """A performance file beside this one: the motion that the search begins with."""
    slack: bool = False
    """Whether strings that pull at the start may go slack."""
    explore: Annotated[int, Field(ge=0)] = 0
    """How many random explorations look for motions through slack strings and catches."""
    time_weight: Annotated[NotNegative, SIZED] = 1.0
    """Cost of a second, where the duration is free [1/s]."""
    interval: Positive = 0.02
    """For which driven accelerations are constant [s]."""
    step: Positive = 0.005
    """Longest time step of the derivatives [s]."""

    @model_validator(mode="after")
    def _ends_once(self) -> TaskFile:
        if self.end is not None and self.periodic is not None:
            raise mistake("found both `end` and `periodic`; needed: one of them at most")
        return self
