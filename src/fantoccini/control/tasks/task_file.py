"""Converter of task files to tasks. Every mistake is reported with its location.

A track is a quantity that should follow a path, a touch a point of a body that should pass a place.
A node is a time at which the inputs may change. In names, D stands for dynamic coordinates, which
move by the equations of motion, and K for driven ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, StateError, did_you_mean, rotation
from fantoccini.base.documents import Located, Mistakes, rotation_vector_quaternion, shown
from fantoccini.control.tasks.bounds import Bounds, Interval, Magnitudes
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.clip import Clip
from fantoccini.control.tasks.control_file import Reading
from fantoccini.control.tasks.costs import Smooth, Track
from fantoccini.control.tasks.ends import End
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.plan_conditions import PlanConditions
from fantoccini.control.tasks.residuals import track_residual
from fantoccini.control.tasks.schema import CircleFile, RunFile, TaskFile, TouchFile, TrackFile
from fantoccini.control.tasks.shapes import Circle
from fantoccini.control.tasks.targets import Target
from fantoccini.control.tasks.task import Task, displaced
from fantoccini.control.tasks.touch import Touch, check_windows
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State, Trajectory, csv_columns

_COLUMNS = {"point": ("x", "y", "z"), "orientation": ("qw", "qx", "qy", "qz")}
"""Columns of a CSV file by the kind of a track; `value` for other kinds."""
_MAX_INTERVALS = 10_000
"""Largest number of intervals of a motion, and of time steps in an interval."""

Location = tuple[str | int, ...]
"""Keys and indices that lead to an entry of a file."""


def task_of_file(reading: Reading[TaskFile]) -> Task:
    """The task of a task file.

    Raises:
        FileError: all mistakes with their locations.
    """
    file, marionette, check = reading.file, reading.marionette, reading.check
    reading.check_values("end", file.end or {})
    _check_intervals(reading)
    _check_exploring(reading)
    bounds = _bounds(reading)
    for i, track in enumerate(file.tracks):
        _check_name(track, marionette, ("tracks", i), check)
    check.raise_if_any()
    x0 = reading.start
    check(("bounds",), lambda: bounds.check_state(marionette, x0, "at the start"))
    for name, span in file.parameters.items():
        check(
            ("parameters", name),
            lambda interval={name: span}: ChosenParameters(marionette, x0, interval),
        )
    track_reader = _TrackReader(reading, x0)
    tracks = [track_reader.track(track, ("tracks", i)) for i, track in enumerate(file.tracks)]
    touches = [track_reader.touch(touch, ("touches", i)) for i, touch in enumerate(file.touches)]
    check.raise_if_any()
    end = None
    if file.end is not None:
        goal = {**file.start, **file.end}
        end = check.need(("end",), lambda: marionette.rest(goal))
        required_end = End.full_state(marionette.coordinates, end)
        check(("end",), lambda: bounds.check_end(marionette, x0, required_end))
    for key, displacement in (file.periodic or {}).items():
        check(
            ("periodic", key),
            lambda key=key, displacement=displacement: displaced(
                marionette, x0, {key: displacement}
            ),
        )
    check.raise_if_any()
    if displacements := file.periodic:
        periodic_end = End.full_state(
            marionette.coordinates, displaced(marionette, x0, displacements)
        )
        check(("periodic",), lambda: bounds.check_end(marionette, x0, periodic_end))
    if not file.parameters:
        check(("bounds", "held"), lambda: bounds.check_moves(marionette))
    guess = None
    if file.guess is not None:
        guess = check(("guess",), lambda: _guess(reading))
    check.raise_if_any()
    smooth = Smooth(file.smooth.acceleration, file.smooth.jerk)
    return check.need(
        (),
        lambda: Task(
            marionette,
            x0,
            file.duration,
            [track for track in tracks if track is not None],
            smooth,
            bounds,
            end,
            time_weight=file.time_weight,
            interval=file.interval,
            dt=file.step,
            name=file.task,
            parameters=file.parameters,
            explore=file.explore,
            periodic=file.periodic,
            guess=guess,
            touches=[touch for touch in touches if touch is not None],
            conditions=PlanConditions(slack=file.slack),
        ),
    )


def _guess(reading: Reading[TaskFile]) -> Input:
    """The motion in the performance file that a task file names."""
    return Input.load(
        reading.marionette, _in_same_folder(reading.file.located, str(reading.file.guess))
    )


def _in_same_folder(located: Located, name: str) -> Path:
    """Path of the file with a name, in the folder of the task file."""
    path = located.file_in_folder(name)
    if path is None:
        raise StateError(f"found {shown(name)}: no file in this one's folder")
    return path


class _TrackReader:
    """Converts the tracks and touches of a file.

    Args:
        reading: the file.
        x0: start of the motion.
    """

    def __init__(self, reading: Reading[TaskFile], x0: State):
        self._marionette, self._x0 = reading.marionette, x0
        self._duration, self._located = reading.file.duration, reading.file.located
        self._check = reading.check
        self._touches: list[Touch] = []

    def track(self, file: TrackFile, location: Location) -> Track | None:
        """The track; None if it has mistakes."""
        path = self._path(file, location)
        if path is None:
            return None
        start = -math.inf if file.start is None else file.start
        end = math.inf if file.end is None else file.end
        track = Track(
            file.kind,
            getattr(file, file.kind),
            path,
            file.at,
            file.weight,
            file.end_weight,
            start,
            end,
        )
        if file.kind != "tension":  # a tension's values were checked when read
            nodes = Nodes.constant(self._marionette, self._x0, 1.0, 1)
            if (
                self._check(location, lambda: track_residual(self._marionette, track, nodes))
                is None
            ):
                return None
        return track

    def touch(self, file: TouchFile, location: Location) -> Touch | None:
        """The touch; None if it has mistakes."""
        place = self._check((*location, "point"), lambda: self._position(file.point, file.at))
        if place is None:
            return None
        target = place + np.array(file.by) if file.place is None else np.array(file.place)
        touch = self._check((*location, "between"), lambda: self._touch(file, target))
        if touch is not None:
            self._touches.append(touch)
        return touch

    def _touch(self, file: TouchFile, place: Array) -> Touch:
        """A touch, after checking its time against the earlier ones."""
        low, high = file.between
        between = (-math.inf if low is None else low, math.inf if high is None else high)
        touch = Touch(file.point, place, file.at, between, file.in_turn)
        end = self._x0.t + float(np.max(self._duration))
        check_windows([*self._touches, touch], self._x0.t, end)
        return touch

    def _position(self, body: str, at: tuple[float, ...]) -> Array:
        """(3,) the position of a point of a body at the start."""
        link = self._marionette.link_index(body)
        pose = self._marionette.poses(self._x0.q_D[None], self._x0.q_K[None])[0, link]
        return np.asarray(pose[:, :3] @ np.array(at) + pose[:, 3])

    def _path(self, file: TrackFile, location: Location) -> Target | None:
        """The path of a track; None if it has mistakes."""
        check, kind = self._check, file.kind
        if file.circle is not None:
            circle = file.circle
            return check((*location, "circle"), lambda: self._circle(file, circle))
        if file.csv is not None:
            name = file.csv
            return check((*location, "csv"), lambda: self._csv(kind, name))
        if file.run is not None:
            clip = file.run
            return check((*location, "run"), lambda: self._clip(file, clip))
        if file.values is None:
            return check((*location, "value"), lambda: _number(kind, file.value))
        values = [
            check((*location, "values", j), lambda value=value: _number(kind, value))
            for j, value in enumerate(file.values)
        ]
        times = check((*location, "times"), lambda: _times(file.times, len(values)))
        valid = [value for value in values if value is not None]
        if times is None or len(valid) < len(values):
            return None
        return times, _continuous(kind, np.array(valid))

    def _circle(self, file: TrackFile, circle: CircleFile) -> Circle:
        x0 = self._x0
        start = x0.t if file.start is None else max(file.start, x0.t)
        if file.end is None and not isinstance(self._duration, float):
            raise StateError(
                "the duration is free; needed: the track's `end`, when the circle is closed"
            )
        end = file.end if file.end is not None else x0.t + float(np.max(self._duration))
        if end <= start:
            raise StateError(f"it would end at {end:g} s, before its start at {start:g} s")
        place = self._position(getattr(file, file.kind), file.at)
        centre = place + np.array(circle.by) if circle.centre is None else np.array(circle.centre)
        normal = np.array(circle.normal)
        return Circle.near(place, centre, normal, circle.radius, circle.turns, start, end)

    def _clip(self, file: TrackFile, section: RunFile) -> Clip:
        run = Trajectory.load(_in_same_folder(self._located, section.file))
        clip = Clip(run, section.of, section.begin, section.speed, section.by)
        start_time = np.array([self._x0.t])
        clip.values(self._marionette, file.kind, getattr(file, file.kind), file.at, start_time)
        return clip

    def _csv(self, kind: str, name: str) -> tuple[Array, Array]:
        columns, _ = csv_columns(_in_same_folder(self._located, name))
        required_columns = ("t", *_COLUMNS.get(kind, ("value",)))
        for column in required_columns:
            if column not in columns:
                known_names = ", ".join(columns)
                raise StateError(f"{name} has no column {column}; found: {known_names}")
        if unknown := [column for column in columns if column not in required_columns]:
            hint = did_you_mean(unknown[0], required_columns)
            raise StateError(f"{name} has the column {shown(unknown[0])}{hint}")
        values = np.stack([columns[column] for column in required_columns[1:]], axis=1)
        if not np.all(np.isfinite(values)):
            raise StateError(f"{name} has a number that is not finite")
        times = _times(tuple(columns["t"].tolist()), len(values))
        return times, _continuous(kind, values)


def _number(kind: str, value: float | tuple[float, ...] | None) -> Array:
    """(width,) numbers of one value of a path."""
    assert value is not None  # otherwise a mistake was reported
    numbers = np.atleast_1d(np.asarray(value, dtype=float))
    if kind == "orientation" and len(numbers) == 3:
        return np.array(rotation_vector_quaternion(tuple(numbers)))
    width = len(_COLUMNS.get(kind, ("value",)))
    if len(numbers) != width:
        allowed = {3: "3 numbers", 4: "a quaternion or a rotation vector"}.get(width, "a number")
        raise StateError(f"found {shown(value)}; needed: {allowed}")
    return numbers


def _times(times: tuple[float, ...], n: int) -> Array:
    """(n,) ascending times, checked."""
    if len(times) != n:
        raise StateError(f"found {len(times)} times for {n} values; needed: as many")
    array = np.array(times)
    index = np.flatnonzero(~(np.diff(array) > 0.0))
    if len(index):
        earlier, later = array[index[0] : index[0] + 2]
        raise StateError(f"found {earlier:g} before {later:g}; needed: rising times")
    return array


def _continuous(kind: str, values: Array) -> Array:
    """The values of a path; quaternions are normalised, with continuous signs."""
    if kind != "orientation":
        return values
    if np.any(np.linalg.norm(values, axis=1) < 0.5):
        raise StateError("found a quaternion of almost no length; needed: unit quaternions")
    return rotation.continuous(rotation.normalised(values))


def _check_intervals(reading: Reading[TaskFile]) -> None:
    """Reports an interval or step that is too short."""
    file = reading.file
    longest = float(np.max(file.duration))
    for key, total, step in (
        ("interval", longest, file.interval),
        ("step", file.interval, file.step),
    ):
        if total / step > _MAX_INTERVALS:
            text = f"found {step:g}, of which there would be {total / step:.3g}"
            reading.add_mistake((key,), f"{text}; allowed: {_MAX_INTERVALS}")


def _check_exploring(reading: Reading[TaskFile]) -> None:
    """Reports entries of the file that cannot be combined with explorations."""
    file = reading.file
    if file.explore and not file.slack:
        text = "it searches motions with slack strings; needed: slack: true"
        reading.add_mistake(("explore",), text)
    for key, value in (
        ("parameters", file.parameters),
        ("touches", file.touches),
        ("bounds.force", file.bounds.force),
        ("bounds.voltage", file.bounds.voltage),
        ("bounds.current", file.bounds.current),
    ):
        if file.explore and value:
            reading.add_mistake(("explore",), f"it excludes {key}; needed: one of them")


def _check_name(
    file: TrackFile, marionette: Marionette, location: Location, check: Mistakes
) -> None:
    """Reports a track whose name the puppet does not have."""
    name, kind = getattr(file, file.kind), file.kind
    if kind == "tension":
        check((*location, kind), lambda: Bounds(tension={name: (0.0, 1.0)}).tensions(marionette))
        return
    nodes = Nodes.constant(marionette, marionette.state(), 1.0, 1)
    value = {"point": np.zeros(3), "orientation": np.array([1.0, 0.0, 0.0, 0.0])}.get(kind, 0.0)
    check((*location, kind), lambda: track_residual(marionette, Track(kind, name, value), nodes))


def _bounds(reading: Reading[TaskFile]) -> Bounds:
    """The bounds of a file; reports each mistake."""
    file, marionette, check = reading.file.bounds, reading.marionette, reading.check

    def intervals(key: str) -> dict[str, Interval]:
        section: Mapping[str, tuple[float | None, float | None]] = getattr(file, key)
        spans = {
            name: (-math.inf if lower is None else lower, math.inf if upper is None else upper)
            for name, (lower, upper) in section.items()
        }
        for name, span in spans.items():
            bounds = _bounds_of(key, {name: span})
            if not span[0] < span[1]:
                text = f"found {span[0]:g} and {span[1]:g}; the first must be less"
                reading.add_mistake(("bounds", key, name), text)
            elif key == "tension":
                check(("bounds", key, name), lambda bounds=bounds: bounds.tensions(marionette))
            elif key == "force":
                check(("bounds", key, name), lambda bounds=bounds: bounds.forces(marionette))
            else:
                check(("bounds", key, name), lambda bounds=bounds: bounds.intervals(marionette))
        return spans

    def magnitudes(key: str) -> Magnitudes:
        section: Magnitudes | None = getattr(file, key)
        if section is None:
            return math.inf
        locations: list[tuple[Location, Magnitudes]] = [((), section)]
        if isinstance(section, dict):
            locations = [((name,), {name: value}) for name, value in section.items()]
        for location, value in locations:
            bounds = _bounds_of(key, value)
            check_bounds = bounds.motors if key in ("voltage", "current") else bounds.magnitudes
            check(
                ("bounds", key, *location),
                lambda check_bounds=check_bounds: check_bounds(marionette, key),
            )
        return section

    for j, name in enumerate(file.held):
        held = Bounds(held=(name,))
        check(("bounds", "held", j), lambda held=held: held.magnitudes(marionette, "acceleration"))
    return Bounds(
        intervals("position"),
        magnitudes("speed"),
        magnitudes("acceleration"),
        magnitudes("jerk"),
        intervals("tension"),
        intervals("joint"),
        file.held,
        file.clearance,
        file.own_body,
        intervals("force"),
        magnitudes("voltage"),
        magnitudes("current"),
    )


def _bounds_of(key: str, value: Any) -> Bounds:
    """Bounds of one kind alone."""
    return Bounds(**{key: value})
