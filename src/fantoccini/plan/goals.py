"""Where a plan is to end: distances of states from a goal, many at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, ConfigD, ConfigK
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.marionette import Marionette
from fantoccini.motion import State


@dataclass(frozen=True, eq=False)
class Rows:
    """States side by side.

    Attributes:
        q_D, v_D, slip, q_K, v_K: (..., n) as of :class:`fantoccini.State`.
    """

    q_D: Array
    v_D: Array
    slip: Array
    q_K: Array
    v_K: Array

    def __getitem__(self, index) -> Rows:
        return Rows(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the leading axes."""
        return self.q_D.shape[:-1]


Distance = Callable[[Rows], Array]
"""Rows (...) -> distances (...); 0 at the goal."""


@dataclass(frozen=True, eq=False)
class Goal:
    """A distance that a plan takes below a tolerance.

        d(x) = sum_i w_i |q_i - goal_i| + w_v |v_D|    or    |point - place| + w_v |v_D|

    Made by :meth:`pose`, :meth:`point` or :meth:`of`.

    Attributes:
        distance: of rows.
        text: what is asked, for people.
        q_D: (n_qD,) the configuration that it asks for, where it asks for a whole one.
        q_K: (n_qK,) where the driven coordinates are at the goal, where that was given.
    """

    distance: Distance
    text: str
    q_D: ConfigD | None = None
    q_K: ConfigK | None = None

    def of_start(self, rows: Rows) -> float:
        """The distance of one state, rows (1,).

        Raises:
            StateError: the goal's function does not give one finite distance for it.
        """
        found = np.asarray(self.distance(rows))
        if found.shape != rows.shape or not np.all(np.isfinite(found)):
            raise StateError(
                f"the goal gives {found!r} for the start; needed: finite distances of the shape "
                f"{rows.shape}"
            )
        return float(found[0])

    @classmethod
    def of(cls, marionette: Marionette, goal, speed_weight: float = 0.1) -> Goal:
        """A goal from what a user gives.

        Args:
            marionette: the puppet.
            goal: a Goal; a state, whose dynamic configuration is to be reached; names and values
                (see :meth:`pose`); or a function of :class:`Rows`.
            speed_weight: see :meth:`pose`.

        Raises:
            UnknownNameError: a name that is no dynamic coordinate.
            StateError: a goal that is none of these, or not finite.
        """
        if isinstance(goal, Goal):
            return goal
        if isinstance(goal, State):
            wanted = marionette.coordinates.n_qD, marionette.coordinates.n_qK
            if (len(goal.q_D), len(goal.q_K)) != wanted:
                raise StateError("the goal is a state of another puppet")
            return _configuration(marionette, goal.q_D, None, speed_weight, goal.q_K)
        if isinstance(goal, Mapping):
            return cls.pose(marionette, goal, speed_weight=speed_weight)
        if callable(goal):
            return cls(goal, getattr(goal, "__name__", "a function"))
        raise StateError(
            f"the goal is {goal!r}; it must be a state, names and values, a Goal or a function"
        )

    @classmethod
    def pose(
        cls,
        marionette: Marionette,
        values: Mapping[str, float | Sequence[float]],
        *,
        weights: Mapping[str, float] | None = None,
        speed_weight: float = 0.1,
    ) -> Goal:
        """Some coordinates at some values: ``{"elbow": 1.2}``.

        Args:
            marionette: the puppet.
            values: name -> value [rad or m]; ``joint.rotation`` takes a quaternion or a rotation
                vector and counts by the angle between.
            weights: name -> weight; 1 by default.
            speed_weight: of the size of all dynamic velocities [s].

        Raises:
            UnknownNameError: a name that is no dynamic coordinate.
        """
        places = _names(marionette.coordinates)
        for name in [*values, *(weights or {})]:
            if name not in places:
                raise UnknownNameError("dynamic coordinate", name, list(places))
        aimed = marionette.state(values)
        weight = {name: float((weights or {}).get(name, 1.0)) for name in values}
        return _configuration(marionette, aimed.q_D, weight, speed_weight, None)

    @classmethod
    def point(
        cls,
        marionette: Marionette,
        body: str,
        place: Sequence[float],
        *,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        speed_weight: float = 0.0,
    ) -> Goal:
        """A point of a body at a place in the world.

        Args:
            marionette: the puppet.
            body: its name.
            place: (3,) in the world [m].
            at: (3,) the point in the body's frame [m].
            speed_weight: of the size of all dynamic velocities [s].

        Raises:
            UnknownNameError: no body has this name.
        """
        link = marionette.link(body)
        target, offset = np.asarray(place, dtype=float), np.asarray(at, dtype=float)
        if target.shape != (3,) or offset.shape != (3,) or not np.all(np.isfinite(target)):
            raise StateError(f"a point's place is {place!r} and at {at!r}; needed: three numbers")

        def distance(rows: Rows) -> Array:
            pose = marionette.poses(rows.q_D, rows.q_K)[..., link, :, :]
            there = pose[..., 3] + pose[..., :3] @ offset
            return _size(there - target) + speed_weight * _size(rows.v_D)

        return cls(distance, f"{body} at {target.tolist()}")


def _configuration(
    marionette: Marionette,
    q_D: Array,
    weight: Mapping[str, float] | None,
    speed_weight: float,
    driven: ConfigK | None,
) -> Goal:
    """The goal of a configuration, or of the coordinates that have a weight."""
    table = marionette.coordinates
    if not np.all(np.isfinite(q_D)):
        raise StateError("the goal is not finite")
    scalars, turns, shown = [], [], []
    for name, (q, is_turn) in _names(table).items():
        w = 1.0 if weight is None else weight.get(name)
        if w is None:
            continue
        (turns if is_turn else scalars).append((q, w))
        shown.append(name)
    places = np.array([q for q, _ in scalars], dtype=int)
    factors = np.array([w for _, w in scalars])
    aims = q_D[places]

    def distance(rows: Rows) -> Array:
        total = np.abs(rows.q_D[..., places] - aims) @ factors
        for q, w in turns:
            # |p . q| is the cosine of half the angle between.
            cosine = np.abs(rows.q_D[..., q : q + 4] @ q_D[q : q + 4])
            total = total + 2.0 * w * np.arccos(np.minimum(cosine, 1.0))
        return total + speed_weight * _size(rows.v_D)

    whole = len(shown) == len(_names(table))
    return Goal(distance, ", ".join(shown), q_D if whole else None, driven)


def _names(table) -> dict[str, tuple[int, bool]]:
    """Dynamic coordinates that a goal may name -> (place in q_D, whether it is a quaternion)."""
    found = {table.q_D[q]: (q, False) for q, _ in table.scalars_D}
    for q, _ in table.quaternions_D:
        found[table.q_D[q].rsplit(".", 1)[0] + ".rotation"] = (q, True)
    return found


def _size(vectors: Array) -> Array:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
