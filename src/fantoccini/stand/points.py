"""Set points: positions of a stand's axes over time, with the moves before and after the motion.

An axis is a motor of the stand. Homing finds its position with a switch. Slack is the length that
drums let out and wind in again before the start.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fantoccini.base import (
    Array,
    FileError,
    Indices,
    Mistake,
    StandError,
    Times,
    did_you_mean,
    polynomial,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.stand.axes import Axis, AxisMap, AxisMotion
from fantoccini.stand.check import check_stand
from fantoccini.stand.controllers import Controller, too_many_axes
from fantoccini.stand.motors import Drum
from fantoccini.stand.stand_file import Stand, load_stand

GCODE_RATE = 50.0
"""Set points per second of G-code."""
SLOW_SPEED_SHARE = 0.2
"""Speed of moves to the start and to the parking position, relative to an axis' largest speed."""
RAMP_TIME_FACTOR = 2.0
"""Duration of a change between rest and motion along the path, over the time that the axes need for
their largest speed."""
PULL_OFF_DISTANCE = 0.002
"""Distance from the switch after homing and when parked [m or rad]."""
CONTROLLER_TYPES = (
    "grbl",
    "fluidnc",
    "klipper",
    "marlin",
    "csv",
    "odrive",
    "can",
    "dynamixel",
    "ros2",
    "osc",
    "artnet",
)
"""Kinds of controllers."""


@dataclass(frozen=True, eq=False)
class SetPoints:
    """Positions of all axes over time; T points, n axes.

    Attributes:
        map: the stand, bound to the puppet.
        rate: points per second; the last interval may be shorter.
        motion: positions, velocities and accelerations at times from 0 on.
        home: whether the controller homes the axes first.
        slack: length that drums let out and wind in again before the start [m].
        park: whether the axes go home at the end.
        resumed: (T,) times in the whole motion, of one that was stopped and goes on: the controller
            knows the positions of its axes, and moves them slowly to the first point.
        warning: reason for which the stand cannot do the motion; "" if it can.
    """

    map: AxisMap
    rate: float
    motion: AxisMotion
    home: bool = False
    slack: float = 0.0
    park: bool = False
    resumed: Times | None = None
    warning: str = ""

    def __len__(self) -> int:
        return len(self.motion)

    def __repr__(self) -> str:
        kinds = ", ".join(part.controller.type for part in self.parts.values())
        return (
            f"<SetPoints: {len(self)} of {len(self.axes)} axes of {self.map.stand.name}, for "
            f"{kinds}>"
        )

    @property
    def controller(self) -> Any:
        """The controller that receives them.

        Raises:
            StandError: the stand has several; each takes one of the ``parts``.
        """
        if self.map.stand.controllers:
            names = ", ".join(self.map.stand.controllers)
            raise StandError(
                f"{self.map.stand.name} has several controllers ({names}); needed: the set points "
                "of one of them, `points.parts[NAME]`"
            )
        return self.map.stand.controller

    @property
    def parts(self) -> dict[str, SetPoints]:
        """Name of a controller -> its set points; {"": self} with one controller."""
        if not self.map.stand.controllers:
            return {"": self}
        maps = {name: self.map.part(stand) for name, stand in self.map.stand.parts.items()}
        return {
            name: dataclasses.replace(self, map=axis_map, motion=self.motion.of_axes(axis_map.axes))
            for name, axis_map in maps.items()
        }

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The axes."""
        return self.map.axes

    @property
    def ramp_time(self) -> float:
        """Duration of a change between rest and motion along the path [s].

        The axes then need at most half more than their largest acceleration.
        """
        return RAMP_TIME_FACTOR * max(
            (axis.file.speed or 0.0) / (axis.file.acceleration or np.inf) for axis in self.axes
        )

    @property
    def counts(self) -> Indices:
        """(T, n) whole microsteps or counts, without the motors' directions."""
        return np.rint(self.motion.position * [axis.counts_per_unit for axis in self.axes]).astype(
            np.int64
        )

    def home_position(self) -> Array:
        """(n,) positions after homing; an axis without `home` stays where the motion ends."""
        position = self.motion.position[-1].copy()
        for k, axis in enumerate(self.axes):
            home = axis.file.home
            if home is not None:
                position[k] = home.at + PULL_OFF_DISTANCE * (1.0 if home.towards == "min" else -1.0)
        return position

    def targets_before(self) -> list[Array]:
        """Positions (n,) at the ends of the moves before the motion; the last is its start."""
        start, targets = self.motion.position[0], []
        if self.slack:
            position = start.copy()
            for k, axis in enumerate(self.axes):
                if isinstance(axis.transmission, Drum):
                    position[k] += self.slack * _unwinding_direction(axis)
            targets.append(position)
        return [*targets, start] if targets or self.home else []

    def target_after(self) -> Array | None:
        """Parking positions (n,) of the axes; None without parking."""
        return self.home_position() if self.park else None

    def complete_motion(self) -> AxisMotion:
        """The motion together with smooth moves before and after it, from t = 0 on.

        Raises:
            StandError: it begins with homing, which only G-code can request.
        """
        if self.home:
            raise StandError(
                f"homing is not part of set points for {self.controller.type}: let the controller "
                "do it, and leave out --home"
            )
        pieces, m = [], self.motion
        targets = self.targets_before()
        for start, end in zip(targets[-1:] + targets[:-1], targets, strict=True):
            pieces.append(self._smooth_move(start, end))
        pieces.append((m.t, m.position, m.velocity, m.acceleration))
        parking_position = self.target_after()
        if parking_position is not None:
            pieces.append(self._smooth_move(m.position[-1], parking_position))
        t, rows = pieces[0][0], [list(pieces[0][1:])]
        for piece in pieces[1:]:
            t = np.append(t, t[-1] + piece[0][1:])
            rows.append([values[1:] for values in piece[1:]])
        p, v, a = (np.vstack([row[i] for row in rows]) for i in range(3))
        return AxisMotion(self.axes, t, p, v, a)

    def _smooth_move(self, first: Array, last: Array) -> tuple[Array, Array, Array, Array]:
        """A smooth move from rest to rest, sampled at the points' rate."""
        distance = np.abs(last - first)
        speed = SLOW_SPEED_SHARE * np.array([axis.file.speed for axis in self.axes])
        acceleration = np.array([axis.file.acceleration for axis in self.axes])
        duration = polynomial.minimum_jerk_duration(distance, speed, acceleration)
        n = max(1, int(np.ceil(duration * self.rate)))
        T = n / self.rate
        s = np.arange(n + 1)[:, None] / n
        displacement, (share, rate, curve) = last - first, polynomial.minimum_jerk(s)
        return (
            np.arange(n + 1) / self.rate,
            first + displacement * share,
            displacement * rate / T,
            displacement * curve / T**2,
        )


def set_points(
    stand: Stand | str | os.PathLike[str],
    run: Trajectory,
    marionette: Marionette | None = None,
    *,
    rate: float | None = None,
    controller: str | None = None,
    home: bool = False,
    slack: float = 0.0,
    park: bool = False,
    force: bool = False,
) -> SetPoints:
    """The set points of a run on a stand.

    Args:
        stand: a stand, its file or the name of a bundled one.
        run: the run.
        marionette: the run's puppet, needed if the run does not describe it.
        rate: points per second; the controller's by default, 50 for G-code.
        controller: kind of controller instead of the stand's, with its default values.
        home: let the controller home the axes first (G-code).
        slack: length that drums let out and wind in again before the start [m].
        park: go home at the end.
        force: export the run even if :func:`check_stand` finds that the stand cannot do it; its
            reason becomes the ``warning`` of the set points and a comment in their G-code.

    Raises:
        FileError: the stand does not fit the run, or has no controller.
        StandError: the stand cannot do it.
    """
    if not isinstance(stand, Stand):
        stand = load_stand(stand)
    chosen_stand = with_controller(stand, controller)
    rate = getattr(chosen_stand.controller, "rate", GCODE_RATE) if rate is None else rate
    if not 1.0 <= rate <= 10_000.0:
        raise ValueError(f"rate: found {rate:g}; needed: 1 to 10000 set points per second")
    if not 0.0 <= slack <= 1.0:
        raise ValueError(f"slack: found {slack:g}; needed: 0 to 1 m")
    check = check_stand(stand, run, marionette)
    if not check.ok and not force:
        raise StandError(
            f"{check.summary()}; `fantoccini stand check` lists remedies; --force (force=True) "
            "ignores this"
        )
    n = int(np.floor(run.duration * rate + 1e-9))
    t = np.arange(n + 1) / rate
    if run.duration - t[-1] > 1e-6:
        t = np.append(t, run.duration)
    axis_map = AxisMap.from_stand(chosen_stand, run.coordinates)
    sampled_motion = axis_map.motion_of(run, run.t[0] + t)
    motion = AxisMotion(
        sampled_motion.axes,
        t,
        sampled_motion.position,
        sampled_motion.velocity,
        sampled_motion.acceleration,
    )
    warning = "" if check.ok else check.summary()
    points = SetPoints(axis_map, rate, motion, home, slack, park, warning=warning)
    _check_sequences(stand, points)
    return points


def _check_sequences(stand: Stand, points: SetPoints) -> None:
    """Raises an error if homing, slack or parking is impossible."""
    without_home = [axis.name for axis in points.axes if axis.file.home is None]
    if (points.home or points.park) and without_home:
        text = f"this key is missing; homing and parking need it for every axis ({without_home[0]})"
        stand.raise_if_any([(("axes", without_home[0], "home"), text)])
    for target in points.targets_before():
        for k, axis in enumerate(points.axes):
            low, high = axis.travel
            if points.slack and not low <= target[k] <= high:
                raise StandError(
                    f"{axis.name} would go to {target[k]:.4g} {axis.unit} to let out slack of "
                    f"{points.slack:g} m, but its travel is {low:g} to {high:g}"
                )


def with_controller(stand: Stand, kind: str | None = None) -> Stand:
    """The stand with its own controllers, or with one of another kind with its default values.

    Raises:
        FileError: the stand has no controller, or there is no such kind.
        StandError: controllers of that kind move fewer axes.
    """
    controllers = [part.controller for part in stand.parts.values()]
    if kind is None and controllers == [None]:
        text = "this key is missing: it names the controller; or give --controller"
        stand.raise_if_any([(("controller",), text)])
    if kind is None or all(
        controller is not None and controller.type == kind for controller in controllers
    ):
        return stand
    if kind not in CONTROLLER_TYPES:
        text = f"found {kind!r}{did_you_mean(kind, CONTROLLER_TYPES)}"
        raise FileError([Mistake("--controller", None, "", text)])
    if reason := too_many_axes(kind, len(stand.axes)):
        raise StandError(reason)
    adapter: TypeAdapter[Any] = TypeAdapter(Controller)
    try:
        controller = adapter.validate_python({"type": kind})
    except ValidationError as error:  # pragma: no cover - defaults are valid
        raise AssertionError(kind) from error
    return stand.model_copy(update={"controller": controller, "controllers": {}})


def _unwinding_direction(axis: Axis) -> float:
    """1 if a drum's string gets longer as its position grows, else -1."""
    factors = [factor for name, factor in axis.file.moves.items() if name.endswith(".length")]
    return float(np.sign(factors[0])) if factors else 1.0
