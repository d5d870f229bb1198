"""The schema of task files.

Classes with names in `File` are parts of one task file; `SIZED` checks that a number is at most
1e6. A driven coordinate is an end or a length of a string, or a driven joint; a drive moves one by
a motor towards its command.
"""

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
    read_real,
    shown,
    sized,
    validation_error,
)
from fantoccini.control.tasks.control_file import ControlFile, check_one_of
from fantoccini.control.tasks.costs import TRACK_KINDS
from fantoccini.model.puppet import WORDS

PATH_KEYS = ("value", "values", "csv", "circle", "run")
"""Keys for the path of a track, exactly one of which is given."""


class CircleFile(Model):
    """A circle from rest to rest; it begins at its point nearest to the followed point's start."""

    centre: Place | None = None
    """Centre in the world [m]."""
    by: Place | None = None
    """Centre relative to the point's position at the start, instead of `centre` [m]."""
    radius: Size | None = None
    """Radius [m]; by default the distance of the point from the axis at the start."""
    normal: Direction
    """Direction of the circle's axis."""
    turns: Sized = 1.0
    """Number of turns about the axis, by the right hand; negative for the opposite direction."""

    @model_validator(mode="after")
    def _check_place(self) -> CircleFile:
        check_one_of(self, "centre", "by")
        return self


class RunFile(Model):
    """Motion of a part in a saved run, as the path to follow."""

    file: str
    """The run: an npz file of `simulate --out` in the same folder."""
    of: str | None = None
    """Name of the followed part in the run; by default the track's name."""
    begin: Sized | None = None
    """Time in this motion at which the run begins [s]; the run's first time by default."""
    speed: Annotated[Positive, SIZED] = 1.0
    """Speed of the run's time; 2 is twice as fast."""
    by: Place = (0.0, 0.0, 0.0)
    """Displacement added to points [m]."""


class TrackFile(Model):
    """A quantity (`point`, `orientation`, `coordinate`, `velocity` or `tension`) and its path."""

    point: str | None = None
    """Body of the point that follows a path of places [m]."""
    orientation: str | None = None
    """Body that follows quaternions [w, x, y, z] or rotation vectors [rad]."""
    coordinate: str | None = None
    """Scalar coordinate, dynamic or driven [rad or m]."""
    velocity: str | None = None
    """Velocity, dynamic or driven; `*` for all dynamic ones [rad/s or m/s]."""
    tension: str | None = None
    """String whose tension follows values [N]."""
    at: Place = (0.0, 0.0, 0.0)
    """The point in the body's frame [m]."""
    value: Value | None = None
    """Constant value."""
    times: tuple[Sized, ...] = ()
    """Times of `values`, increasing [s]; the values are linear between them."""
    values: tuple[Value, ...] | None = None
    """Values at `times`."""
    csv: str | None = None
    """A CSV file in the same folder: columns `t`, and `x`, `y`, `z` for a point, `qw`, `qx`, `qy`
    and `qz` for an orientation, otherwise `value`."""
    circle: CircleFile | None = None
    """Circle that a point follows."""
    run: RunFile | None = None
    """Motion in a saved run, which the quantity follows."""
    weight: Annotated[NotNegative, SIZED] = 1.0
    """Weight of the integral of the squared residual."""
    end_weight: Annotated[NotNegative, SIZED] = 0.0
    """Weight of the squared residual at the end."""
    start: Sized | None = None
    """Time from which the distance from the path is a cost [s]."""
    end: Sized | None = None
    """Time until which the distance from the path is a cost [s]."""

    @model_validator(mode="after")
    def _check_path(self) -> TrackFile:
        for label, keys in (("what follows", TRACK_KINDS), ("its path", PATH_KEYS)):
            names = [key for key in keys if getattr(self, key) is not None]
            if len(names) != 1:
                text = " and ".join(names) or "none"
                raise validation_error(f"{label}: found {text}; needed: one of {', '.join(keys)}")
        if self.circle is not None and self.point is None:
            raise validation_error("found a circle; it is a path of a `point`")
        if self.point is None and any(self.at):
            raise validation_error("found `at`, which is for `point`")
        if bool(self.times) != (self.values is not None):
            raise validation_error("found one of `times` and `values`; needed: both")
        if self.start is not None and self.end is not None and self.start >= self.end:
            raise validation_error(
                f"found the start {self.start:g} and the end {self.end:g}; the start must be less"
            )
        return self

    @property
    def kind(self) -> str:
        """The key of the quantity that follows the path."""
        return next(key for key in TRACK_KINDS if getattr(self, key) is not None)


class TouchFile(Model):
    """A place that a point of a body passes at a time that the search finds."""

    point: str
    """The body."""
    at: Place = (0.0, 0.0, 0.0)
    """The point in the body's frame [m]."""
    place: Place | None = None
    """The place in the world [m]."""
    by: Place | None = None
    """The place relative to the point's position at the start, instead of `place` [m]."""
    between: tuple[Sized | None, Sized | None] = (None, None)
    """First and last time [s]; null for no limit."""
    in_turn: bool = False
    """Whether it comes no earlier than the touch before it in the list."""

    @model_validator(mode="after")
    def _check_place(self) -> TouchFile:
        check_one_of(self, "place", "by")
        return self


class SmoothFile(Model):
    """Weights of the driven accelerations and their rates."""

    acceleration: Annotated[NotNegative, SIZED] = 1e-4
    """Weight of the driven accelerations [s^4/m^2]."""
    jerk: Annotated[NotNegative, SIZED] = 1e-6
    """Weight of their rates [s^6/m^2]."""


IntervalEnd = Annotated[Angle | None, SIZED]
"""An end of an interval; null for no limit."""
Span = Annotated[tuple[IntervalEnd, IntervalEnd], sized(2)]
ParameterInterval = Annotated[tuple[Annotated[Angle, SIZED], Annotated[Angle, SIZED]], sized(2)]
Magnitudes = Real | dict[str, Real] | None


class BoundsFile(Model):
    """Bounds of the motion; names without an entry are free."""

    position: dict[str, Span] = Field(default_factory=dict)
    """Driven scalar coordinate -> [low, high]; null for no limit [m or rad]."""
    joint: dict[str, Span] = Field(default_factory=dict)
    """Dynamic scalar coordinate -> [low, high] [rad or m]."""
    tension: dict[str, Span] = Field(default_factory=dict)
    """String -> [low, high] [N]."""
    force: dict[str, Span] = Field(default_factory=dict)
    """Driven velocity -> [low, high] of the force that drives it [N or N m]."""
    speed: Magnitudes = None
    """Largest speed, for all driven coordinates or name -> speed [m/s or rad/s]."""
    acceleration: Magnitudes = None
    """Largest acceleration, for all or name -> acceleration [m/s^2 or rad/s^2]."""
    jerk: Magnitudes = None
    """Largest jerk, for all or name -> jerk [m/s^3 or rad/s^3]."""
    voltage: Magnitudes = None
    """Largest voltage of dc motors, for all or name of the command -> voltage [V]."""
    current: Magnitudes = None
    """Largest current of dc motors, for all or name of the command -> current [A]."""
    held: tuple[str, ...] = ()
    """Driven velocities that stay 0."""
    clearance: Annotated[NotNegative | None, SIZED] = None
    """Smallest distance of bodies and strings from obstacles and other puppets [m]."""
    own_body: bool = False
    """Whether the clearance also applies to bodies of one puppet that no joint connects."""


def _duration(value: Any) -> Any:
    """A positive number, or two of them in ascending order."""
    limits = [read_real(end) for end in (value if isinstance(value, (list, tuple)) else [value])]
    if len(limits) > 2 or not limits or min(limits) <= 0.0:
        raise validation_error(
            f"found {shown(value)}; needed: a positive number, or [shortest, longest]"
        )
    if limits[0] > limits[-1]:
        raise validation_error(
            f"found {limits[0]:g} before {limits[1]:g}; the first is the shortest duration"
        )
    return limits[0] if len(limits) == 1 else tuple(limits)


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
    """Coordinate -> value: the motion ends in a state of rest with these driven coordinates, others
    as at the start; values of dynamic coordinates only begin the search for this state."""
    periodic: dict[str, Angle] | None = None
    """Instead of `end`: the motion ends in its first state, except for displacements of these
    scalar coordinates [m or rad]; `{}` for no displacement."""
    duration: Duration
    """Duration of the motion, or [shortest, longest] [s]."""
    tracks: tuple[TrackFile, ...] = ()
    """Quantities and their paths."""
    touches: tuple[TouchFile, ...] = ()
    """Places that points pass at times that the search finds."""
    smooth: SmoothFile = SmoothFile()
    """Weights of accelerations and their rates."""
    bounds: BoundsFile = BoundsFile()
    """Bounds of the motion."""
    parameters: dict[str, ParameterInterval] = Field(default_factory=dict)
    """Parameter of the puppet -> [low, high]; it is chosen along with the motion."""
    guess: str | None = None
    """A performance file in the same folder: the initial guess of the motion."""
    slack: bool = False
    """Whether strings that pull at the start may go slack."""
    explore: Annotated[int, Field(ge=0)] = 0
    """Number of random explorations, for motions in which strings go slack and taut again."""
    time_weight: Annotated[NotNegative, SIZED] = 1.0
    """Cost of a second, if the duration is free [1/s]."""
    interval: Positive = 0.02
    """Length of the intervals over which driven accelerations are constant [s]."""
    step: Positive = 0.005
    """Longest time step of the simulation from which derivatives are computed [s]."""

    @model_validator(mode="after")
    def _check_end(self) -> TaskFile:
        if self.end is not None and self.periodic is not None:
            raise validation_error("found both `end` and `periodic`; needed: one of them at most")
        return self
