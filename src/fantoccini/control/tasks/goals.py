"""Goals of plans, and the distances of states from them.

q_D are the dynamic coordinates and q_K the driven ones, the ends and lengths of strings; n_vD and
n_vK are the numbers of their velocities. A gap is here the distance of two parts that should touch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fantoccini.base import (
    Array,
    ConfigD,
    ConfigK,
    ShortRepr,
    StateError,
    UnknownNameError,
    rotation,
)
from fantoccini.control.tasks.goal_targets import (
    Target,
    checked_vector,
    checked_weight,
    coordinate_weights,
    goal_coordinates,
    interval_ends,
)
from fantoccini.control.tasks.state_arrays import StateArrays
from fantoccini.control.tasks.touches import Pair, TouchRules, pair_of
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import POINT, POSE, UNKNOWN, GoalNumbers
from fantoccini.motion import State

_MAX_CLOSED_GAP = 1e-5
"""Largest gap of parts that touch [m]; time-stepping leaves a thousandth of it open."""
_DRIVEN_WEIGHT = 1.0
"""Weight of the driven velocities if the goal is a state [s]."""

Distance = Callable[[StateArrays], Array]
"""States (...) -> distances (...); 0 at the goal."""

GoalLike: TypeAlias = "Goal | State | Mapping[str, Target] | Distance"
"""Any short form of a goal; see :meth:`Goal.of`."""


@dataclass(frozen=True, eq=False, repr=False)
class Goal(ShortRepr):
    """A distance that a plan reduces below a tolerance.

        d(x) = sum_i w_i |q_i - goal_i| + w_v |v_D - goal| + w_K |v_K - goal|,
        or |point - place| + ...

    Distances to an interval or a box are distances to its nearest point. Goal velocities are 0
    unless the goal is a state. Required touches add their gaps and, while any of them is open, the
    tolerance of the plan, so that all are closed at its end. Goals are made by :meth:`pose`,
    :meth:`point`, :meth:`touch`, :meth:`stand`, :meth:`displaced` or :meth:`of`.

    Attributes:
        marionette: the puppet.
        text: description for people.
        numbers: the goal for the compiled library.
        function: the goal as a Python function, if it is one.
        q_K: (n_qK,) driven coordinates at the goal, if they are given.
        touches: pairs of parts that must touch.
        share: least share of the puppets' weight that the touches carry at the end, if the puppet
            must stand on them; otherwise None.
        touch_rules: contact pairs of a problem; set by :class:`fantoccini.control.Problem`.
    """

    marionette: Marionette
    text: str
    numbers: GoalNumbers
    function: Distance | None = None
    q_K: ConfigK | None = None
    touches: tuple[tuple[str, str], ...] = ()
    share: float | None = None
    touch_rules: TouchRules | None = None

    def distance(self, states: StateArrays) -> Array:
        """(...) distances of states."""
        distances = self._function_distances(states)
        return distances + self.touch_distance(states) if self.touches else distances

    def touch_distance(self, states: StateArrays) -> Array:
        """(...) the part of the states' distances that touches contribute."""
        gaps = np.maximum(self.gaps(states), 0.0)
        sums: Array = np.sum(gaps, axis=-1)
        return sums + self.numbers.open * np.any(gaps > _MAX_CLOSED_GAP, axis=-1)

    def gaps(self, states: StateArrays) -> Array:
        """(..., n) gaps of the required touches [m]."""
        rules = (
            TouchRules(self.marionette, required=self.touches)
            if self.touch_rules is None
            else self.touch_rules
        )
        return rules.gaps(states.q_D, states.q_K)

    def for_problem(self, rules: TouchRules, tolerance: float) -> Goal:
        """The same goal with a problem's touches and tolerance."""
        if not self.touches:
            return self
        if self.function is not None:
            raise StateError("a goal that is a function cannot ask for touches")
        numbers = replace(
            self.numbers, touches=rules.touch_index, n_touches=len(rules.required), open=tolerance
        )
        return replace(self, numbers=numbers, touch_rules=rules)

    def touching(self, pairs: Iterable[Pair]) -> Goal:
        """The same goal, with pairs of parts that must also touch.

        Args:
            pairs: names of bodies, props, obstacles, ``floor``, or of puppets for all their bodies.

        Raises:
            StateError: value that is not a pair of names.
        """
        touches = self.touches + tuple(pair_of(pair) for pair in pairs)
        pair_names = ", ".join(f"{first} on {second}" for first, second in touches)
        text = f"{self.text}, {pair_names}" if self.text else pair_names
        return replace(self, touches=touches, text=text)

    def standing(self, pairs: Iterable[Pair], share: float = 0.1) -> Goal:
        """The same goal, with the puppet standing at rest on touches.

        Args:
            pairs: pairs that must touch: feet and their supports.
            share: least share of the puppets' weight that these touches carry, 0 to 1.

        Raises:
            StateError: see :meth:`touching`; or a share out of range.
        """
        if not 0.0 <= share <= 1.0:
            raise StateError(f"share is {share}; it must be 0 to 1")
        return replace(self.touching(pairs), share=float(share))

    def _function_distances(self, states: StateArrays) -> Array:
        if self.function is not None:
            distances = np.asarray(self.function(states), dtype=float)
            return np.where(np.isnan(distances), np.inf, distances)
        x, library = states.flat, self.marionette.libraries.rollouts
        return library.distances(
            self.numbers, x.q_D, x.v_D, x.q_K, x.v_K, self.marionette.p
        ).reshape(states.shape)

    @property
    def single_configuration(self) -> ConfigD | None:
        """(n_qD,) the only configuration at the goal; None if there are several."""
        numbers, table = self.numbers, self.marionette.coordinates
        indices = [v for _, v in (*table.scalars_D, *table.quaternions_D)]
        if numbers.kind != POSE or not np.all(numbers.weight[indices] > 0.0):
            return None
        return numbers.low if np.array_equal(numbers.low, numbers.high) else None

    def residuals(self, states: StateArrays) -> Array:
        """(n, m) residuals of the configurations of n states, without velocities and touches."""
        numbers, table = self.numbers, self.marionette.coordinates
        if numbers.kind == UNKNOWN:
            return self.distance(states)[:, None]
        if numbers.kind == POINT:
            pose = self.marionette.poses(states.q_D, states.q_K)[:, numbers.link]
            position = pose[..., 3] + pose[..., :3] @ numbers.at
            return position - np.clip(position, numbers.place, numbers.place_high)
        deviation = states.q_D - np.clip(states.q_D, numbers.low, numbers.high)
        columns = [
            deviation[:, q] * numbers.weight[v] for q, v in table.scalars_D if numbers.weight[v]
        ]
        for q, v in table.quaternions_D:
            if numbers.weight[v]:
                rotation_error = rotation.between(numbers.low[q : q + 4], states.q_D[:, q : q + 4])
                columns += list(numbers.weight[v] * rotation_error.T)
        return np.stack(columns, axis=1) if columns else np.zeros((len(deviation), 0))

    def start_distance(self, start: StateArrays) -> float:
        """The distance of a single state (1,).

        Raises:
            StateError: distance that is not finite, or more than one number.
        """
        distance = self.distance(start)
        if distance.shape != start.shape or not np.all(np.isfinite(distance)):
            raise StateError(
                f"the goal gives {distance!r} for the start; needed: finite distances of the shape "
                f"{start.shape}"
            )
        return float(distance[0])

    @classmethod
    def of(cls, marionette: Marionette, goal: GoalLike, speed_weight: float = 0.1) -> Goal:
        """The goal from any of its short forms.

        Args:
            marionette: the puppet.
            goal: a Goal; a state, whose dynamic configuration and velocities and driven velocities
                (weight 1 s) must be reached; names and values (see :meth:`pose`); or a function
                of :class:`StateArrays` that returns distances.
            speed_weight: see :meth:`pose`.

        Raises:
            UnknownNameError: name that is not a dynamic coordinate.
            StateError: goal of another type, or not finite.
        """
        table = marionette.coordinates
        zero_velocities = np.zeros(table.n_vD), np.zeros(table.n_vK)
        if isinstance(goal, Goal):
            if goal.marionette.tree is not marionette.tree:
                raise StateError("the goal is of another puppet")
            return replace(goal, marionette=marionette)
        if isinstance(goal, State):
            if (len(goal.q_D), len(goal.q_K)) != (table.n_qD, table.n_qK):
                raise StateError("the goal is a state of another puppet")
            if not all(np.all(np.isfinite(a)) for a in (goal.q_D, goal.v_D, goal.q_K, goal.v_K)):
                raise StateError("the goal is not finite")
            weight = coordinate_weights(marionette, dict.fromkeys(goal_coordinates(table), 1.0))
            numbers = GoalNumbers(
                POSE,
                goal.q_D,
                goal.q_D,
                weight,
                goal.v_D,
                goal.v_K,
                speed_weight=speed_weight,
                driven_weight=_DRIVEN_WEIGHT,
            )
            return cls(marionette, ", ".join(goal_coordinates(table)), numbers, q_K=goal.q_K)
        if isinstance(goal, Mapping):
            return cls.pose(marionette, goal, speed_weight=speed_weight)
        if callable(goal):
            zeros = np.zeros(table.n_qD), np.zeros(table.n_qD), np.zeros(table.n_vD)
            text = getattr(goal, "__name__", "a function")
            return cls(marionette, text, GoalNumbers(UNKNOWN, *zeros, *zero_velocities), goal)
        raise StateError(
            f"the goal is {goal!r}; it must be a state, names and values, a Goal or a function"
        )

    @classmethod
    def pose(
        cls,
        marionette: Marionette,
        values: Mapping[str, Target],
        *,
        weights: Mapping[str, float] | None = None,
        speed_weight: float = 0.1,
        driven_weight: float = 0.0,
    ) -> Goal:
        """Coordinates at values, ``{"elbow": 1.2}``, or in intervals, ``{"elbow": (1.0, 1.4)}``.

        Args:
            marionette: the puppet.
            values: name -> value or interval [rad or m]; ``joint.rotation`` takes a quaternion or
                a rotation vector, and its distance is the angle between the two rotations.
            weights: name -> weight of a coordinate in ``values``; 1 by default.
            speed_weight: weight of the norm of the dynamic velocities [s].
            driven_weight: weight of the norm of the driven velocities [s]; greater than 0 if they
                must end at rest.

        Raises:
            UnknownNameError: name that is not a dynamic coordinate, or has a weight but no value.
            StateError: value, interval or weight out of range.
        """
        indices = goal_coordinates(marionette.coordinates)
        if not values:
            raise StateError("the pose names no coordinate")
        for name in values:
            if name not in indices:
                raise UnknownNameError("dynamic coordinate", name, list(indices))
        for name, weight in (weights or {}).items():
            if name not in values:
                raise UnknownNameError("coordinate of the goal", name, list(values))
            if not 0.0 < weight < np.inf:
                raise StateError(f"the weight of {name} is {weight}; it must be greater than 0")
        intervals = {
            name: interval_ends(name, value, indices[name][1]) for name, value in values.items()
        }
        low, high = (
            marionette.state({key: limits[k] for key, limits in intervals.items()}).q_D
            for k in (0, 1)
        )
        weight_by_name = {name: float((weights or {}).get(name, 1.0)) for name in values}
        numbers = GoalNumbers(
            POSE,
            low,
            high,
            coordinate_weights(marionette, weight_by_name),
            np.zeros(marionette.coordinates.n_vD),
            np.zeros(marionette.coordinates.n_vK),
            speed_weight=checked_weight(speed_weight),
            driven_weight=checked_weight(driven_weight),
        )
        return cls(marionette, ", ".join(values), numbers)

    @classmethod
    def point(
        cls,
        marionette: Marionette,
        body: str,
        place: Sequence[float],
        *,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        to: Sequence[float] | None = None,
        speed_weight: float = 0.0,
        driven_weight: float = 0.0,
    ) -> Goal:
        """A point of a body at a place in the world, or in a box.

        Args:
            marionette: the puppet.
            body: the body's name.
            place: (3,) the place in the world [m]; with ``to``, the lowest corner of a box.
            at: (3,) the point in the body's frame [m].
            to: (3,) the highest corner [m].
            speed_weight, driven_weight: weights of the norms of the dynamic and the driven
                velocities [s].

        Raises:
            UnknownNameError: name that is not a body.
            StateError: point that is not three finite numbers, or an empty box.
        """
        table = marionette.coordinates
        target, offset = checked_vector("place", place), checked_vector("at", at)
        high = target if to is None else checked_vector("to", to)
        if np.any(high < target):
            raise StateError(
                f"the box from {place!r} to {to!r} is empty: `to` is its highest corner"
            )
        numbers = GoalNumbers(
            POINT,
            np.zeros(table.n_qD),
            np.zeros(table.n_qD),
            np.zeros(table.n_vD),
            np.zeros(table.n_vD),
            np.zeros(table.n_vK),
            marionette.link_index(body),
            offset,
            target,
            high,
            checked_weight(speed_weight),
            checked_weight(driven_weight),
        )
        return cls(marionette, f"{body} at {target.tolist()}", numbers)

    @classmethod
    def touch(
        cls,
        marionette: Marionette,
        pairs: Iterable[Pair],
        *,
        pose: Mapping[str, Target] | None = None,
        speed_weight: float = 0.0,
        driven_weight: float = 0.0,
    ) -> Goal:
        """Pairs of parts touch, ``[("hand", "table")]``, optionally at a pose.

        Args:
            marionette: the puppet.
            pairs: see :meth:`touching`.
            pose: see :meth:`pose`.
            speed_weight, driven_weight: weights of the norms of the dynamic and the driven
                velocities [s].
        """
        goal = cls._pose_or_any(marionette, pose, speed_weight, driven_weight)
        return goal.touching(pairs)

    @classmethod
    def stand(
        cls,
        marionette: Marionette,
        pairs: Iterable[Pair],
        *,
        pose: Mapping[str, Target] | None = None,
        share: float = 0.1,
        speed_weight: float = 0.1,
        driven_weight: float = 1.0,
    ) -> Goal:
        """The puppet stands at rest, ``[("foot_left", "floor"), ("foot_right", "floor")]``.

        Args:
            marionette: the puppet.
            pairs, share: see :meth:`standing`.
            pose: see :meth:`pose`.
            speed_weight, driven_weight: weights of the norms of the dynamic and the driven
                velocities [s].
        """
        goal = cls._pose_or_any(marionette, pose, speed_weight, driven_weight)
        return goal.standing(pairs, share)

    @classmethod
    def displaced(
        cls,
        marionette: Marionette,
        body: str,
        by: Sequence[float],
        start: State,
        *,
        speed_weight: float = 0.1,
        driven_weight: float = 0.0,
    ) -> Goal:
        """A body, such as a prop, displaced from its position at the start.

        Args:
            marionette: the puppet.
            body: the body's name.
            by: (3,) displacement in the world [m].
            start: start of the plan.
            speed_weight, driven_weight: weights of the norms of the dynamic and the driven
                velocities [s].

        Raises:
            UnknownNameError: name that is not a body.
            StateError: displacement that is not three finite numbers.
        """
        link = marionette.link_index(body)
        place = marionette.poses(start.q_D, start.q_K)[link, :, 3] + checked_vector("way", by)
        return cls.point(
            marionette, body, place.tolist(), speed_weight=speed_weight, driven_weight=driven_weight
        )

    @classmethod
    def _pose_or_any(
        cls,
        marionette: Marionette,
        pose: Mapping[str, Target] | None,
        speed_weight: float,
        driven_weight: float,
    ) -> Goal:
        """The goal of a pose; without a pose, any configuration."""
        if pose:
            return cls.pose(
                marionette, pose, speed_weight=speed_weight, driven_weight=driven_weight
            )
        table = marionette.coordinates
        zeros = np.zeros(table.n_qD), np.zeros(table.n_qD), np.zeros(table.n_vD)
        numbers = GoalNumbers(
            POSE,
            *zeros,
            np.zeros(table.n_vD),
            np.zeros(table.n_vK),
            speed_weight=checked_weight(speed_weight),
            driven_weight=checked_weight(driven_weight),
        )
        return cls(marionette, "", numbers)
