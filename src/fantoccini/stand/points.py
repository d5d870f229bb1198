"""Set points: where a stand's axes are to be at what time, and what comes before and after."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fantoccini.base import Array, FileError, Indices, Mistake, StandError, nearest, polynomial
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.stand.axes import Axis, AxisMap, AxisMotion
from fantoccini.stand.check import check_stand
from fantoccini.stand.controllers import Controller
from fantoccini.stand.motors import Drum
from fantoccini.stand.stand_file import Stand, load_stand

GCODE_RATE = 50.0
"""Set points per second of G-code."""
GENTLE = 0.2
"""Of an axis' largest speed, with which it goes to the start and is parked."""
PULL_OFF = 0.002
"""Of the switch, after homing and where it is parked [m or rad]."""
TYPES = (
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
        controller: that takes them.
        rate: points per second; the last interval may be shorter.
        motion: positions, velocities and accelerations at times from 0 on.
        home: whether the controller finds the axes' places first.
        slack: by how much drums pay out and wind in again before the start [m].
        park: whether the axes go home in the end.
    """

    map: AxisMap
    controller: Any
    rate: float
    motion: AxisMotion
    home: bool = False
    slack: float = 0.0
    park: bool = False

    def __len__(self) -> int:
        return len(self.motion)

    def __repr__(self) -> str:
        name, kind = self.map.stand.name, self.controller.type
        return f"<SetPoints: {len(self)} of {len(self.axes)} axes of {name}, for {kind}>"

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The axes."""
        return self.map.axes

    @property
    def counts(self) -> Indices:
        """(T, n) whole microsteps or counts, without the motors' directions."""
        return np.rint(self.motion.position * [axis.counts for axis in self.axes]).astype(np.int64)

    def at_home(self) -> Array:
        """(n,) where the axes stand after homing; where the motion ends for those without."""
        out = self.motion.position[-1].copy()
        for k, axis in enumerate(self.axes):
            home = axis.file.home
            if home is not None:
                out[k] = home.at + PULL_OFF * (1.0 if home.towards == "min" else -1.0)
        return out

    def legs_before(self) -> list[Array]:
        """Positions (n,) to which the axes go before the motion, the last of them its start."""
        start, legs = self.motion.position[0], []
        if self.slack:
            out = start.copy()
            for k, axis in enumerate(self.axes):
                if isinstance(axis.transmission, Drum):
                    out[k] += self.slack * _pays_out(axis)
            legs.append(out)
        return [*legs, start] if legs or self.home else []

    def leg_after(self) -> Array | None:
        """Positions (n,) where the axes are parked."""
        return self.at_home() if self.park else None

    def whole(self) -> AxisMotion:
        """The motion with smooth moves before and after, from t = 0 on.

        Raises:
            StandError: they begin with homing, which only G-code can ask for.
        """
        if self.home:
            raise StandError(
                f"homing is not part of set points for {self.controller.type}: let the controller "
                "do it, and leave out --home"
            )
        parts, m = [], self.motion
        legs = self.legs_before()
        for first, last in zip(legs[-1:] + legs[:-1], legs, strict=True):
            parts.append(self._leg(first, last))
        parts.append((m.t, m.position, m.velocity, m.acceleration))
        park = self.leg_after()
        if park is not None:
            parts.append(self._leg(m.position[-1], park))
        t, rows = parts[0][0], [list(parts[0][1:])]
        for part in parts[1:]:
            t = np.append(t, t[-1] + part[0][1:])
            rows.append([values[1:] for values in part[1:]])
        p, v, a = (np.vstack([row[i] for row in rows]) for i in range(3))
        return AxisMotion(self.axes, t, p, v, a)

    def _leg(self, first: Array, last: Array) -> tuple[Array, Array, Array, Array]:
        """A smooth move from rest to rest at the points' rate."""
        far = np.abs(last - first)
        speed = GENTLE * np.array([axis.file.speed for axis in self.axes])
        acceleration = np.array([axis.file.acceleration for axis in self.axes])
        need = polynomial.minimum_jerk_duration(far, speed, acceleration)
        n = max(1, int(np.ceil(need * self.rate)))
        T = n / self.rate
        s = np.arange(n + 1)[:, None] / n
        way, (share, rate, curve) = last - first, polynomial.minimum_jerk(s)
        return (
            np.arange(n + 1) / self.rate,
            first + way * share,
            way * rate / T,
            way * curve / T**2,
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
    anyway: bool = False,
) -> SetPoints:
    """The set points of a run on a stand.

    Args:
        stand: a stand, its file or the name of a bundled one.
        run: what it is to do.
        marionette: the run's puppet, where the run does not say.
        rate: points per second; the controller's by default, 50 for G-code.
        controller: kind of controller instead of the stand's, with its default values.
        home: let the controller find the axes' places first (G-code).
        slack: by how much drums pay out and wind in again before the start [m].
        park: go home in the end.
        anyway: also what :func:`check_stand` says that the stand cannot do.

    Raises:
        FileError: the stand does not fit the run, or has no controller.
        StandError: the stand cannot do it.
    """
    if not isinstance(stand, Stand):
        stand = load_stand(stand)
    kind = controller_of(stand, controller)
    rate = getattr(kind, "rate", GCODE_RATE) if rate is None else rate
    if not 1.0 <= rate <= 10_000.0:
        raise ValueError(f"rate: found {rate:g}; needed: 1 to 10000 set points per second")
    if not 0.0 <= slack <= 1.0:
        raise ValueError(f"slack: found {slack:g}; needed: 0 to 1 m")
    if not anyway:
        check = check_stand(stand, run, marionette)
        if not check.ok:
            raise StandError(f"{check.summary()}; `anyway` exports it all the same")
    n = int(np.floor(run.duration * rate + 1e-9))
    t = np.arange(n + 1) / rate
    if run.duration - t[-1] > 1e-6:
        t = np.append(t, run.duration)
    bound = AxisMap.of(stand, run.coordinates)
    moved = bound.motion_of(run, run.t[0] + t)
    motion = AxisMotion(moved.axes, t, moved.position, moved.velocity, moved.acceleration)
    made = SetPoints(bound, kind, rate, motion, home, slack, park)
    _refuse_sequences(stand, made)
    return made


def _refuse_sequences(stand: Stand, made: SetPoints) -> None:
    """Raises an error where homing, slack or parking cannot be."""
    homeless = [axis.name for axis in made.axes if axis.file.home is None]
    if (made.home or made.park) and homeless:
        text = f"this key is missing; homing and parking need it of every axis ({homeless[0]})"
        stand.refuse([(("axes", homeless[0], "home"), text)])
    for leg in made.legs_before():
        for k, axis in enumerate(made.axes):
            low, high = axis.travel
            if made.slack and not low <= leg[k] <= high:
                raise StandError(
                    f"{axis.name} would go to {leg[k]:.4g} {axis.unit} to pay out slack of "
                    f"{made.slack:g} m, and its travel is {low:g} to {high:g}"
                )


def controller_of(stand: Stand, kind: str | None = None) -> Any:
    """The controller of a stand, or one of another kind with its default values.

    Raises:
        FileError: the stand names none, or there is no such kind.
    """
    own = stand.controller
    if kind is None or (own is not None and own.type == kind):
        if own is None:
            text = "this key is missing: it says what takes the set points; or give --controller"
            stand.refuse([(("controller",), text)])
        return own
    if kind not in TYPES:
        text = f"found {kind!r}{nearest(kind, TYPES)}"
        raise FileError([Mistake("--controller", None, "", text)])
    adapter: TypeAdapter[Any] = TypeAdapter(Controller)
    try:
        return adapter.validate_python({"type": kind})
    except ValidationError as error:  # pragma: no cover - defaults are valid
        raise AssertionError(kind) from error


def _pays_out(axis: Axis) -> float:
    """1 where a drum's string gets longer as its position grows, else -1."""
    wound = [factor for name, factor in axis.file.moves.items() if name.endswith(".length")]
    return float(np.sign(wound[0])) if wound else 1.0
