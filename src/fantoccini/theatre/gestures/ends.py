"""Ends of a puppet's strings, moved together as one rigid body or individually.

    z(t) + exp(i theta(t)) (a + i w(t))

z = x + i y is the middle between the shoulders' ends, theta the heading, a an end's place relative
to the middle at the start, w the sway.

The carrying strings hold the trunk; n_vK is the number of driven velocities, and `coef` are the
coefficients of the polynomials between `breaks`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, StateError, Times, polynomial
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State, pieces
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.moves import not_driven

Curve = tuple[Array, Array, Array]
"""Values and their first and second derivatives with respect to time."""
Complex = NDArray[np.complex128]
"""Any shape, x + i y [m]."""
ComplexCurve = tuple[Complex, Complex, Complex]
"""Places and their first and second derivatives with respect to time."""


@dataclass
class Ends:
    """Ends of a puppet's strings, with their places and motion.

    Attributes:
        body_parts: parts of the puppet's body.
        body_strings: names of the strings that carry head and trunk.
        positions: string -> x + i y of its end at the start [m].
        middle: midpoint of the ends of the strings that carry the trunk [m].
        curves: driven coordinate -> offsets.
        changes_heading: whether the heading changes.

    Args:
        start: state at rest.

    Raises:
        StateError: an end or length of a string that carries head or trunk is not driven.
    """

    body_parts: BodyParts
    start: State
    body_strings: tuple[str, ...] = field(default=(), init=False)
    positions: dict[str, complex] = field(default_factory=dict, init=False)
    middle: complex = field(default=0j, init=False)
    curves: dict[str, Curve] = field(default_factory=dict, init=False)
    changes_heading: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        trunk_strings = self.body_parts.strings("trunk")
        has_head = bool(self.body_parts.body_map.looking)
        self.body_strings = self.body_parts.strings("head", "trunk") if has_head else trunk_strings
        channels = pieces.channel_names(self.table)
        coordinate_names = [
            name[len(self.prefix) :] for name in channels if name.startswith(self.prefix)
        ]
        owners = {name.rsplit(".", 1)[0] for name in coordinate_names}
        for owner in self.body_strings:
            self.check_driven(owner)
        for owner in sorted(owners):
            if (
                f"{owner}.x" in coordinate_names
                and f"{owner}.y" in coordinate_names
                and "." not in owner
            ):
                x, y = (float(self.start[f"{self.prefix}{owner}.{part}"]) for part in "xy")
                self.positions[owner] = complex(x, y)
        self.middle = sum(self.positions[name] for name in trunk_strings) / len(trunk_strings)

    @property
    def table(self) -> CoordinateTable:
        """Coordinates of the puppet or scene."""
        return self.body_parts.marionette.coordinates

    @property
    def prefix(self) -> str:
        """Prefix of the strings' names: ``pierrot.``, or nothing."""
        return self.body_parts.prefix

    def check_driven(self, string: str) -> None:
        """Raises StateError unless a string's end moves along x and y, and it is wound."""
        channels = pieces.channel_names(self.table)
        for part in ("x", "y", "length"):
            if f"{self.prefix}{string}.{part}" not in channels:
                raise StateError(f"it moves {not_driven(f'{self.prefix}{string}.{part}', True)}")

    def move_rigidly(
        self,
        path: ComplexCurve,
        heading: Curve,
        sway: Curve | ComplexCurve | None = None,
        names: Iterable[str] | None = None,
    ) -> None:
        """Moves ends as one rigid body along a path, and turns them about the middle.

            moved = z + exp(i theta) (arm + i w) - arm

        Args:
            path: z, place of the middle relative to its first one, for a puppet that looks along
                x [m].
            heading: theta, relative to the first one [rad].
            sway: w, to the left of the path; -i times an offset forward [m].
            names: strings whose ends move; all by default.
        """
        self.changes_heading = self.changes_heading or bool(np.any(heading[0] != 0.0))
        theta, angular_rate, angular_acceleration = heading
        w0, w1, w2 = sway if sway is not None else (0.0 * theta,) * 3
        if file_heading := self.body_parts.heading:
            # Ends lie about the middle as they do in the file; path and sway turn with the puppet.
            file_turn = np.exp(1j * file_heading)
            path, (w0, w1, w2) = scale_curve(file_turn, path), scale_curve(file_turn, (w0, w1, w2))
        rotation = np.exp(1j * theta)
        for name in self.positions if names is None else names:
            position = self.positions[name]
            home = position - self.middle
            arm = rotation * (home + 1j * w0)
            offset = path[0] + arm - home
            velocity = path[1] + 1j * angular_rate * arm + 1j * rotation * w1
            acceleration = (
                path[2]
                + (1j * angular_acceleration - angular_rate**2) * arm
                - 2.0 * angular_rate * rotation * w1
                + 1j * rotation * w2
            )
            for part, component in (("x", np.real), ("y", np.imag)):
                self.add(
                    f"{name}.{part}",
                    (component(offset), component(velocity), component(acceleration)),
                )

    def add(self, name: str, curve: Curve) -> None:
        """Adds an offset to the motion of a coordinate."""
        existing = self.curves.get(name)
        if existing is not None:
            curve = (existing[0] + curve[0], existing[1] + curve[1], existing[2] + curve[2])
        self.curves[name] = curve

    def gesture(self, t: Times, name: str, marks: dict[str, float], travels: bool) -> Gesture:
        """Motion as a gesture with breaks at the curves' times.

        Args:
            t: times of the curves [s].
            name: name of the gesture.
            marks: mark -> time [s].
            travels: whether the next gesture begins where this one ends.
        """
        durations, n_vK = np.diff(t), self.table.n_vK
        coef, named = (
            np.zeros((len(durations), n_vK, polynomial.N_COEF)),
            np.zeros(n_vK, dtype=bool),
        )
        travel, channels = np.zeros(n_vK), pieces.channel_names(self.table)
        for channel, curve in self.curves.items():
            v = channels[self.prefix + channel][1].start
            offset, rate, acceleration = curve
            start_values, end_values = (
                (offset[:-1], rate[:-1], acceleration[:-1]),
                (offset[1:], rate[1:], acceleration[1:]),
            )
            coef[:, v] = polynomial.hermite(durations, start_values, end_values)
            named[v], travel[v] = True, curve[0][-1] if travels else 0.0
        return Gesture(self.table, t, coef, named, travel, name, marks, self.changes_heading)


def scale_curve(factor: Any, curve: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    """A curve multiplied by a factor."""
    return factor * curve[0], factor * curve[1], factor * curve[2]
