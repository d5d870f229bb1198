"""Costs of a motion: tracking errors and roughness of the inputs.

    J = sum over terms of  w/2 integral |r(x(t), t)|^2 dt  +  w_end/2 |r(x(T), T)|^2

with residuals r: the position of a point minus its path, the angle between an orientation and its
path, a coordinate, a tension, accelerations and their rates.

acc_K are the accelerations of the driven coordinates, the ends and lengths of strings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import StateError, check_not_negative
from fantoccini.control.tasks.targets import Target

TRACK_KINDS = ("point", "orientation", "coordinate", "tension", "velocity")


@dataclass(frozen=True, eq=False)
class Track:
    """A cost for leaving a path. See :meth:`point`, :meth:`orientation` and the other constructors.

    Attributes:
        kind: quantity that follows the path, one of :data:`TRACK_KINDS`.
        name: name of the body, the coordinate or the string.
        path: desired values over time.
        at: (3,) the point in the body's frame [m].
        weight: weight w of the integral.
        end_weight: weight w_end at the end.
        start, end: times between which the path counts [s]; the whole motion by default.
    """

    kind: str
    name: str
    path: Target
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    weight: float = 1.0
    end_weight: float = 0.0
    start: float = -np.inf
    end: float = np.inf

    def __post_init__(self) -> None:
        check_not_negative(weight=self.weight, end_weight=self.end_weight)
        if self.kind == "tension" and self.end_weight > 0.0:
            raise StateError(f"the tension of {self.name} has an end_weight, which it cannot have")
        if not self.start < self.end:
            raise StateError(
                f"the path of {self.name} counts from {self.start:g} s to {self.end:g} s; the "
                "first must be less"
            )
        if self.kind not in TRACK_KINDS:
            raise StateError(
                f"a Track of {self.kind!r}; it must be one of {', '.join(TRACK_KINDS)}"
            )

    @classmethod
    def point(
        cls,
        body: str,
        path: Target,
        *,
        at: tuple[float, float, float] = (0.0, 0.0, 0.0),
        **options: Any,
    ) -> Track:
        """A point of a body follows a path in the world, (T, 3) [m]; weights in 1/m^2."""
        return cls("point", body, path, at, **options)

    @classmethod
    def orientation(cls, body: str, path: Target, **options: Any) -> Track:
        """A body follows quaternions (T, 4); the residual is a rotation vector [rad]."""
        return cls("orientation", body, path, **options)

    @classmethod
    def coordinate(cls, name: str, path: Target, **options: Any) -> Track:
        """A scalar coordinate, dynamic or driven, follows values [rad or m]."""
        return cls("coordinate", name, path, **options)

    @classmethod
    def velocity(cls, name: str, path: Target = 0.0, **options: Any) -> Track:
        """A velocity, dynamic or driven, follows values [rad/s or m/s]; ``*``: all dynamic ones."""
        return cls("velocity", name, path, **options)

    @classmethod
    def tension(cls, string: str, path: Target, **options: Any) -> Track:
        """A string's tension follows values [N]."""
        return cls("tension", string, path, **options)


@dataclass(frozen=True)
class Smooth:
    """The cost w/2 integral |acc_K|^2 dt, and the same for the rate of acc_K.

    Attributes:
        acceleration: weight of the driven accelerations [s^4/m^2].
        jerk: weight of their rates, by differences between intervals [s^6/m^2].
    """

    acceleration: float = 1e-4
    jerk: float = 1e-6

    def __post_init__(self) -> None:
        check_not_negative(acceleration=self.acceleration, jerk=self.jerk)
