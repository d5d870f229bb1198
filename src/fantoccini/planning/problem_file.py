"""Problem files: what is to be planned as YAML. Every mistake is given with its place."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema

from fantoccini import puppets
from fantoccini.errors import FantocciniError, FileError, nearest
from fantoccini.marionette import Marionette, load
from fantoccini.motion import State
from fantoccini.planning.goals import Goal
from fantoccini.planning.obstacles import Standing
from fantoccini.planning.problem import Problem
from fantoccini.planning.rollouts import Bounds, RolloutOptions, whole_looks
from fantoccini.puppet.located import Located, read_file, shown, validate
from fantoccini.puppet.values import Angle, Model, Name, Positive, Real, Vector, mistake

_FOLDER = Path(__file__).parent / "problems"

_LARGEST = 1e6
"""Size of a number of a problem: metres, radians, seconds and their like."""


def _sized(given: Any) -> Any:
    """Refuses numbers, alone or several, that no puppet's problem has."""
    numbers = given if isinstance(given, tuple) else (given,)
    for number in numbers:
        if isinstance(number, float) and abs(number) > _LARGEST:
            raise mistake(f"found {number:g}; needed: a size of at most {_LARGEST:g}")
    return given


Sized = Annotated[Real, AfterValidator(_sized)]
Size = Annotated[Positive, AfterValidator(_sized)]
Place = Annotated[Vector, AfterValidator(_sized)]
Value = Annotated[
    Angle | tuple[Angle, ...],
    AfterValidator(_sized),
    WithJsonSchema({"type": ["number", "string", "array"]}),
]
"""A number, an angle, an interval, a rotation."""


class PointGoal(Model):
    """A point of a body at a place, or in a box."""

    body: str
    """The body's name."""
    at: Place = (0.0, 0.0, 0.0)
    """The point in the body's frame [m]."""
    place: Place
    """Where it is to be [m]; with `to`, the lowest corner of a box."""
    to: Place | None = None
    """The highest corner [m]."""


class GoalFile(Model):
    """Where the puppet is to be: a `pose` or a `point`."""

    pose: dict[str, Value] | None = None
    """Dynamic coordinate -> value, or [low, high]; a rotation as a vector or a quaternion."""
    weights: dict[str, Size] = Field(default_factory=dict)
    """Coordinate of the pose -> weight; 1 by default."""
    point: PointGoal | None = None
    """A point of a body."""
    speed_weight: Sized | None = None
    """Weight of the size of all dynamic velocities [s]; 0.1 for a pose, 0 for a point."""
    driven_weight: Sized = 0.0
    """Weight of the size of all driven velocities [s]: greater than 0 where they end at rest."""


class ProblemFile(Model):
    """What is to be planned."""

    problem: Name
    """The problem's name."""
    puppet: str
    """A bundled puppet's name, or a puppet file beside this one."""
    start: dict[str, Value] = Field(default_factory=dict)
    """Coordinate -> value: the puppet hangs at rest with the driven ones there."""
    goal: GoalFile
    """Where it is to be."""
    tolerance: Size = 0.1
    """Of the goal's distance."""
    speed: Real | dict[str, Real] = 0.5
    """Largest of the driven coordinates, of all or by name; others hold still [m/s or rad/s]."""
    acceleration: Real | dict[str, Real] = 2.0
    """Largest of the driven coordinates, of all or by name [m/s^2 or rad/s^2]."""
    segment: Positive | None = None
    """For which accelerations hold; a multiple of 0.02 s up to 10 s, 0.1 s by default [s]."""
    objective: Literal["gentle", "time", "effort"] = "gentle"
    """What better plans have less of: catches and time, time, or accelerations and time."""
    ranges: dict[str, tuple[Sized, Sized]] = Field(default_factory=dict)
    """Driven coordinate -> [low, high]."""
    margin: Sized = 0.0
    """Least clearance [m]."""
    slack: bool = True
    """Whether strings that pull may go slack on the way."""
    strings: bool = True
    """Whether strings are kept clear of obstacles."""
    self_collision: bool = False
    """Whether bodies are kept clear of one another."""
    obstacles: tuple[Standing, ...] = ()
    """More than the puppet's world has."""


def problem_schema() -> dict:
    """JSON Schema of a problem file, for editors."""
    schema = ProblemFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def problem_names() -> tuple[str, ...]:
    """Names of the bundled problems."""
    return tuple(sorted(p.stem for p in _FOLDER.glob("*.yaml")))


def load_problem(
    path: str | os.PathLike[str],
    *,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Problem:
    """Reads a problem file.

    Args:
        path: of the file, or the name of a bundled problem (``arm3d_boxes``).
        progress: told what takes long while it happens.
        options: of :class:`Problem`, in place of the file's: ``tolerance=0.1``.

    Raises:
        FileError: with every mistake found, and where.
    """
    name = os.fspath(path)
    if name in problem_names() and not Path(name).exists():
        path = _FOLDER / f"{name}.yaml"
    located = read_file(path)
    file = validate(ProblemFile, located)
    marionette = _puppet(file.puppet, located, progress)
    found: list[tuple[tuple, str]] = []

    def tried(place: tuple, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except (FantocciniError, ValueError) as error:
            found.append((place, str(error)))
            return None

    for key, value in file.start.items():
        tried(("start", key), lambda key=key, value=value: marionette.state({key: value}))
    goal = _goal(file.goal, marionette, tried)
    for what in ("speed", "acceleration"):
        given = {"speed": 1.0, "acceleration": 1.0, what: getattr(file, what)}
        tried((what,), lambda given=given: Bounds.of(marionette, **given, ranges={}))
    if file.segment is not None:
        tried(("segment",), lambda: whole_looks(file.segment, RolloutOptions.dt * RolloutOptions.look))
    for key, span in file.ranges.items():
        asked = {key: span}
        tried(("ranges", key), lambda asked=asked: Bounds.of(marionette, 1.0, 1.0, asked))
    start = None if found else tried(("start",), lambda: marionette.rest(file.start))
    if found:
        raise located.error(found, FileError)
    names = (
        "tolerance", "speed", "acceleration", "segment", "objective", "ranges", "margin", "slack",
        "strings", "self_collision",
    )  # fmt: skip
    asked = {key: getattr(file, key) for key in names} | options
    made = tried((), lambda: _problem(marionette, start, goal, file, asked))
    if found:
        raise located.error(found, FileError)
    return made


def _problem(
    marionette: Marionette, start: State, goal: Goal, file: ProblemFile, asked: dict[str, Any]
) -> Problem:
    return Problem(marionette, start, goal, file.obstacles, name=file.problem, **asked)


def _puppet(name: str, located: Located, progress: Callable[[str], None] | None) -> Marionette:
    if name in puppets.names() and not (located.folder / name).exists():
        return load(puppets.path(name), progress)
    path = PurePosixPath(name)
    plain = name.isprintable() and "\\" not in name and ":" not in name and len(name) < 256
    if plain and path.parts and not path.is_absolute() and ".." not in path.parts:
        beside = (located.folder / path).resolve()
        if beside.is_relative_to(located.folder.resolve()) and beside.is_file():
            return load(beside, progress)
    hint = nearest(name, puppets.names())
    message = f"found {shown(name)}: no file in this one's folder and no bundled puppet{hint}"
    raise located.error([(("puppet",), message)], FileError)


def _goal(file: GoalFile, marionette: Marionette, tried: Callable[[tuple, Callable], Any]) -> Any:
    weight = {} if file.speed_weight is None else {"speed_weight": file.speed_weight}
    weight["driven_weight"] = file.driven_weight
    if (file.pose is None) == (file.point is None):
        text = "found both a pose and a point" if file.point else "found neither a pose nor a point"
        return tried(("goal",), lambda: _refuse(f"{text}; needed: one of them"))
    if file.point is not None:
        asked = file.point
        return tried(
            ("goal", "point"),
            lambda: Goal.point(
                marionette, asked.body, asked.place, at=asked.at, to=asked.to, **weight
            ),
        )
    good = [
        tried(
            ("goal", "pose", key), lambda key=key, value=value: Goal.pose(marionette, {key: value})
        )
        for key, value in file.pose.items()
    ]
    if not all(good):
        return None
    good = [
        tried(
            ("goal", "weights", key),
            lambda one={key: value}: Goal.pose(marionette, file.pose, weights=one),
        )
        for key, value in file.weights.items()
    ]
    if not all(good):
        return None
    return tried(
        ("goal",), lambda: Goal.pose(marionette, file.pose, weights=file.weights, **weight)
    )


def _refuse(message: str) -> None:
    raise ValueError(message)
