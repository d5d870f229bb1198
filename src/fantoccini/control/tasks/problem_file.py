"""Problem files: tasks of planning in YAML. Every mistake is reported with its location.

Classes with names in `File` are parts of one problem file. The types `Sized` and `Size` are a
number and a positive number of at most 1e6. A driven coordinate is an end or a length of a string,
or a driven joint; a slack string does not pull. A marionette is a puppet with its compiled
equations; `marionette.puppet` is the description in its file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from fantoccini.base.documents import (
    SIZED,
    Kind,
    Model,
    Name,
    NotNegative,
    Place,
    Positive,
    Real,
    RealShare,
    Size,
    Sized,
    Value,
    entries,
    validation_error,
)
from fantoccini.control.tasks.bounds import Bounds, Magnitudes, resolve_driven
from fantoccini.control.tasks.control_file import ControlFile, Reading, check_one_of
from fantoccini.control.tasks.driven_bounds import DrivenBounds
from fantoccini.control.tasks.goals import Goal
from fantoccini.control.tasks.plan_conditions import PlanConditions, RolloutOptions, check_count
from fantoccini.control.tasks.schema import Duration
from fantoccini.control.tasks.task import Task
from fantoccini.control.tasks.touches import touching
from fantoccini.dynamics.clearance import HalfSpace, Standing
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import WORDS
from fantoccini.motion import State


class PointGoal(Model):
    """A point of a body at a place or in a box."""

    body: str
    """The body's name."""
    at: Place = (0.0, 0.0, 0.0)
    """The point in the body's frame [m]."""
    place: Place | None = None
    """The place in the world [m]; with `to`, the lowest corner of a box."""
    by: Place | None = None
    """Displacement from the point's place at the start, instead of `place` [m]."""
    to: Place | None = None
    """The highest corner [m]."""

    @model_validator(mode="after")
    def _check_place(self) -> PointGoal:
        check_one_of(self, "place", "by")
        if self.by is not None and (self.to is not None or any(self.at)):
            raise validation_error("found `by` with `at` or `to`, which are for `place`")
        return self


NamePair = Annotated[tuple[str, str], entries(2, 2)]
"""Two names: bodies, props, obstacles, puppets, or `floor`."""


class StandGoal(Model):
    """The puppet stands at rest."""

    on: Annotated[tuple[NamePair, ...], Field(min_length=1)]
    """Pairs that must touch: feet and their supports."""
    share: RealShare = 0.1
    """Least share of the puppets' weight that these supports carry, 0 to 1."""


class ContactFile(Model):
    """Pairs that may touch."""

    touch: tuple[NamePair, ...]
    """Pairs that may touch."""


class GoalFile(Model):
    """The goal: a `pose`, a `point` or neither; in addition touches, or a stance."""

    pose: dict[str, Value] | None = None
    """Dynamic coordinate -> value, or [low, high]; a rotation as a vector or a quaternion."""
    weights: dict[str, Size] = Field(default_factory=dict)
    """Coordinate of the pose -> weight; 1 by default."""
    point: PointGoal | None = None
    """Point of a body at a place."""
    touch: tuple[NamePair, ...] = ()
    """Pairs that must touch."""
    stand: StandGoal | None = None
    """Stance of the puppet."""
    speed_weight: Sized | None = None
    """Weight of the norm of the dynamic velocities [s]; by default 0.1 for a pose, a stance or a
    point with `by`, 0 for other points and for touches."""
    driven_weight: Sized | None = None
    """Weight of the norm of the driven velocities [s]: greater than 0 if they must end at rest; 1
    for a stance, otherwise 0."""


class ProblemFile(ControlFile):
    """A planning problem."""

    kind: ClassVar = Kind(
        "problem",
        "a problem file has the keys `puppet`, `problem` and `goal`",
        Path(__file__).parent / "bundled_problems",
        words=WORDS,
    )

    problem: Name
    """The problem's name."""
    goal: GoalFile
    """End of the plan."""
    duration: Duration | None = None
    """Longest duration of the plan, or [shortest, longest]; unlimited by default [s]."""
    contact: Literal["keep off"] | ContactFile = "keep off"
    """`keep off`, or the pairs that may touch. Required touches of the goal are allowed, and so are
    touches between props and their supports."""
    tolerance: Size = 0.1
    """Weighted distance from the goal at which it counts as reached."""
    hold: Annotated[NotNegative, SIZED] | None = None
    """Time for which the puppet must stay at the goal after the plan's end [s]; by default 1 if the
    goal is a touch, a stance or the place of a prop, otherwise 0."""
    speed: Real | dict[str, Real] = 0.5
    """Bound for all driven coordinates, or by name; others hold still [m/s or rad/s]."""
    acceleration: Real | dict[str, Real] = 2.0
    """Bound for all driven coordinates, or by name; others hold still [m/s^2 or rad/s^2]."""
    reserve: Real = 0.0
    """Share of these bounds that plans reserve for feedback, 0 to less than 1."""
    segment: Positive | None = None
    """Duration of a piece with constant accelerations [s]: a multiple of 0.02 s up to 10 s, by
    default 0.1 s."""
    objective: Literal["gentle", "time", "acceleration"] = "gentle"
    """Cost that better plans reduce: time alone, or with catches of strings, or accelerations."""
    ranges: dict[str, tuple[Sized, Sized]] = Field(default_factory=dict)
    """Driven coordinate -> [low, high]."""
    margin: Sized = 0.0
    """Least distance of bodies and strings from obstacles [m]."""
    slack: bool = True
    """Whether taut strings may go slack on the way."""
    strings: bool = True
    """Whether strings are kept clear of obstacles."""
    self_collision: bool = False
    """Whether bodies are kept clear of one another."""
    obstacles: tuple[Standing, ...] = ()
    """Obstacles in addition to the world's."""


def task_of_problem(reading: Reading[ProblemFile]) -> Task:
    """The task of a problem file.

    Raises:
        FileError: all mistakes with their locations.
    """
    file, marionette, check = reading.file, reading.marionette, reading.check
    goal = _goal(reading, marionette.state())
    _check_touches(reading)
    bounds = Bounds(
        file.ranges,
        file.speed,
        file.acceleration,
        clearance=file.margin,
        own_body=file.self_collision,
    )
    partial_bounds: list[tuple[tuple[str, ...], Bounds]] = [(("speed",), Bounds(speed=file.speed))]
    partial_bounds += [(("acceleration",), Bounds(acceleration=file.acceleration))]
    partial_bounds += [(("ranges", key), Bounds({key: span})) for key, span in file.ranges.items()]
    for key_path, bounds_of_key in partial_bounds:
        check(
            key_path,
            lambda bounds_of_key=bounds_of_key: DrivenBounds.from_bounds(marionette, bounds_of_key),
        )
    check(("reserve",), lambda: RolloutOptions(reserve=file.reserve))
    n_checks = check(("segment",), lambda: _n_checks(file.segment))
    check.raise_if_any()
    start = reading.start
    if file.goal.point is not None and file.goal.point.by is not None:
        goal = _goal(reading, start)
    assert goal is not None and n_checks is not None  # otherwise mistakes were reported
    bounds = replace(
        bounds,
        speed=_all_named(marionette, file.speed, "speed"),
        acceleration=_all_named(marionette, file.acceleration, "acceleration"),
    )
    conditions = PlanConditions(
        file.tolerance,
        file.hold,
        file.contact if file.contact == "keep off" else {"touch": file.contact.touch},
        file.slack,
        file.objective,
        RolloutOptions(n_checks=n_checks, reserve=file.reserve, strings=file.strings),
    )
    return check.need(
        (),
        lambda: Task(
            marionette,
            start,
            file.duration,
            bounds=bounds,
            end=goal,
            name=file.problem,
            obstacles=file.obstacles,
            conditions=conditions,
        ),
    )


def _all_named(marionette: Marionette, bound: Magnitudes, kind: str) -> Magnitudes:
    """A bound of the file, with 0 for coordinates without an entry, as plans hold them still."""
    if not isinstance(bound, Mapping):
        return bound
    names = marionette.coordinates.q_K
    named = resolve_driven(marionette.coordinates, names, bound, kind)
    return {**bound, **{name: 0.0 for k, name in enumerate(names) if k not in named}}


def _n_checks(segment: float | None) -> int:
    """Number of checks of clearances and bounds in a segment of this duration [s]."""
    defaults = RolloutOptions()
    return defaults.n_checks if segment is None else check_count(segment, defaults.interval)


def _check_touches(reading: Reading[ProblemFile]) -> None:
    """Reports pairs of a file that cannot touch."""
    file, marionette = reading.file, reading.marionette
    entries_to_check: list[tuple[tuple[str | int, ...], tuple[str, str]]] = []
    if file.contact != "keep off":
        entries_to_check += [
            (("contact", "touch", k), pair) for k, pair in enumerate(file.contact.touch)
        ]
    entries_to_check += [(("goal", "touch", k), pair) for k, pair in enumerate(file.goal.touch)]
    if file.goal.stand is not None:
        pairs = file.goal.stand.on
        entries_to_check += [(("goal", "stand", "on", k), pair) for k, pair in enumerate(pairs)]
    solids = (o for o in file.obstacles if not isinstance(o, HalfSpace))
    marionette_with_obstacles = (
        marionette.with_obstacles((*marionette.puppet.obstacles, *solids))
        if entries_to_check
        else marionette
    )
    for key_path, pair in entries_to_check:
        reading.check(key_path, lambda pair=pair: touching(marionette_with_obstacles, pair))


def _goal(reading: Reading[ProblemFile], start: State) -> Goal | None:
    """The goal of a file; None if it has mistakes.

    Args:
        reading: the file.
        start: start, from which displacements of bodies are measured.
    """
    file, goal = reading.file.goal, _goal_without_touches(reading, start)
    if goal is None:
        return None
    stand = file.stand
    if stand is not None:
        goal = goal.standing(stand.on, stand.share)
    return goal.touching(file.touch) if file.touch else goal


def _goal_without_touches(reading: Reading[ProblemFile], start: State) -> Goal | None:
    """The pose or the point of a goal, without touches; None if it has mistakes."""
    file, marionette, check = reading.file.goal, reading.marionette, reading.check
    defaults = {} if file.stand is None else {"speed_weight": 0.1, "driven_weight": 1.0}
    weights_in_file = {"speed_weight": file.speed_weight, "driven_weight": file.driven_weight}
    speed_weights = defaults | {
        key: value for key, value in weights_in_file.items() if value is not None
    }
    pose, point, weights = file.pose, file.point, file.weights
    if point is not None and pose is not None:
        reading.add_mistake(("goal",), "found both a pose and a point; needed: one")
        return None
    if point is not None:
        return check(
            ("goal", "point"), lambda: _point_goal(point, marionette, start, speed_weights)
        )
    if pose is None:
        if not file.touch and file.stand is None:
            text = "found neither a pose nor a point, touch or stand; needed: one of them"
            reading.add_mistake(("goal",), text)
            return None
        return check(("goal",), lambda: Goal.touch(marionette, (), pose=None, **speed_weights))
    goals = [
        check(
            ("goal", "pose", key), lambda key=key, value=value: Goal.pose(marionette, {key: value})
        )
        for key, value in pose.items()
    ]
    if not all(goals):
        return None
    goals = [
        check(
            ("goal", "weights", key),
            lambda single={key: value}: Goal.pose(marionette, pose, weights=single),
        )
        for key, value in weights.items()
    ]
    if not all(goals):
        return None
    return check(("goal",), lambda: Goal.pose(marionette, pose, weights=weights, **speed_weights))


def _point_goal(
    point: PointGoal, marionette: Marionette, start: State, weight: dict[str, float]
) -> Goal:
    if point.by is not None:
        return Goal.displaced(marionette, point.body, point.by, start, **weight)
    assert point.place is not None  # otherwise a mistake was reported
    return Goal.point(marionette, point.body, point.place, at=point.at, to=point.to, **weight)
