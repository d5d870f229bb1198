"""Tasks: motions that are planned, optimised or followed.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings); the
accelerations acc_K of the latter are the unknowns. A marionette is a puppet with its compiled
equations; `marionette.puppet` is the description in its file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import numpy as np

from fantoccini.base import StateError, UnknownNameError, check_positive, floats
from fantoccini.control.tasks.bounds import Bounds, Interval
from fantoccini.control.tasks.costs import Smooth, Track
from fantoccini.control.tasks.ends import End
from fantoccini.control.tasks.goals import Goal, GoalLike
from fantoccini.control.tasks.plan_conditions import PlanConditions
from fantoccini.control.tasks.touch import Touch, check_windows
from fantoccini.dynamics.clearance import HalfSpace, standing
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import FLOOR, Obstacle
from fantoccini.motion import Input, State


class InputMotion(Protocol):
    """A motion of the inputs: a plan, or an optimum."""

    @property
    def inputs(self) -> Input:
        """The motion of the driven coordinates."""

    @property
    def duration(self) -> float:
        """Its duration [s]."""


GuessLike: TypeAlias = Input | InputMotion
"""An initial guess of the inputs' motion."""


@dataclass(frozen=True, eq=False)
class Task:
    """A motion within bounds, of least cost if it is optimised::

        min J(x, acc_K)   x_{i+1} = F(x_i, acc_i),  x_0 given,  bounds

    ``plan`` searches for any motion that reaches the end, regardless of cost.

    Attributes:
        marionette: the puppet.
        x0: start.
        duration: duration of the motion [s]; two numbers if it is free between them. For plans it
            is the longest duration, unlimited by default.
        tracks: paths to follow.
        smooth: weights of the inputs' accelerations and their rates.
        bounds: bounds of the motion.
        end: state at the end, if any; dynamic and driven coordinates and velocities. Or a pose
            (``{"elbow": 1.2}``, :meth:`fantoccini.control.Goal.pose`) or a place of a point
            (:meth:`fantoccini.control.Goal.point`), with the other coordinates free. Plans also
            accept intervals, boxes, any other :class:`fantoccini.control.Goal`, or a function of
            :class:`fantoccini.control.StateArrays` that returns distances.
        periodic: instead of ``end``: the motion ends in the state in which it began, except for
            displacements of these scalar coordinates [m or rad]; ``{}`` for no displacement.
        guess: initial guess of the inputs' motion, used if the search is given no other: an input,
            a plan or an optimum.
        time_weight: cost of a second, if the duration is free [1/s].
        interval: length of the intervals between nodes, over which the inputs' accelerations are
            constant [s].
        dt: longest time step [s].
        name: name of the task, for pictures and reports.
        parameters: name -> lowest and highest value of parameters that are chosen along with the
            motion; see :class:`fantoccini.control.tasks.chosen_parameters.ChosenParameters`.
        explore: number of random explorations for motions with slack strings and catches, and more
            until a motion holds; with 0 the initial guess is improved.
        touches: places that points of bodies pass, at times that the search finds.
        obstacles: obstacles in addition to the world's.
        conditions: conditions and options of plans.
    """

    marionette: Marionette
    x0: State
    duration: float | tuple[float, float] | None = None
    tracks: Sequence[Track] = ()
    smooth: Smooth = field(default_factory=Smooth)
    bounds: Bounds = field(default_factory=Bounds)
    end: GoalLike | None = None
    periodic: Mapping[str, float] | None = None
    guess: GuessLike | None = None
    time_weight: float = 1.0
    interval: float = 0.02
    dt: float = 0.005
    name: str = ""
    parameters: Mapping[str, Interval] = field(default_factory=dict)
    explore: int = 0
    touches: Sequence[Touch] = ()
    obstacles: Sequence[Obstacle | HalfSpace | Mapping[str, Any]] = ()
    conditions: PlanConditions = field(default_factory=PlanConditions)

    def __post_init__(self) -> None:
        check_positive(interval=self.interval, dt=self.dt)
        self._check_duration()
        if not all(isinstance(entry, Track) for entry in self.tracks):
            raise StateError(f"a task's tracks are {self.tracks!r}; needed: a list of Track")
        if not all(isinstance(entry, Touch) for entry in self.touches):
            raise StateError(f"a task's touches are {self.touches!r}; needed: a list of Touch")
        check_windows(self.touches, self.x0.t, self.x0.t + self.max_duration)
        if self.explore and (self.bounds.force or self.bounds.has_motors):
            raise StateError(
                "explore excludes bounds of forces, voltages and currents: explore "
                "first, then give the motion found as a guess"
            )
        if self.explore and not self.conditions.slack:
            raise StateError(
                "explore searches motions with slack strings; needed: conditions with slack=True"
            )
        if self.explore and self.touches:
            raise StateError(
                "explore excludes touches: explore first, then give the motion as a guess"
            )
        if not isinstance(self.explore, int) or self.explore < 0:
            raise StateError(
                f"explore is {self.explore!r}; needed: a number of explorations, at least 0"
            )
        if self.explore and self.parameters:
            raise StateError(
                "explore excludes parameters: explore first, then choose the "
                "parameters with the motion found as a guess"
            )
        self.marionette.check_state(self.x0)
        if self.end is not None and self.periodic is not None:
            raise StateError("a task has an end and is periodic; needed: one of them")
        for touch in self.touches:
            self.marionette.link_index(touch.body)
        if isinstance(self.end, State):
            self.marionette.check_state(self.end)
        if self.periodic is not None:
            displaced(self.marionette, self.x0, self.periodic)

    def _check_duration(self) -> None:
        """Raises StateError or ValueError for an invalid duration."""
        if self.duration is None:
            return
        if np.ndim(self.duration) and np.shape(self.duration) != (2,):
            raise StateError(f"duration is {self.duration!r}; needed: a number, or two")
        low, high = self.durations
        check_positive(duration=low)
        if not low <= high < math.inf:
            text = f"duration is {self.duration}; needed: a number, or a lower and a higher one"
            raise StateError(text)

    @cached_property
    def required_end(self) -> End | None:
        """The end that optimisations require: ``end``, or the start displaced by ``periodic``.

        None without an end, or for one that only plans support.
        """
        table = self.marionette.coordinates
        if self.periodic is not None:
            return End.full_state(table, displaced(self.marionette, self.x0, self.periodic))
        if isinstance(self.end, State):
            return End.full_state(table, self.end)
        if isinstance(self.end, (Goal, Mapping)):
            latest_time = self.x0.t + self.max_duration
            return End.of_goal(Goal.of(self.marionette, self.end), self.x0, latest_time)
        return None

    @property
    def all_touches(self) -> tuple[Touch, ...]:
        """The touches, then the places that points must reach at the end."""
        end = self.required_end
        return (*self.touches, *(end.places if end is not None else ()))

    @property
    def world(self) -> tuple[Marionette, tuple[Obstacle | HalfSpace | Mapping[str, Any], ...]]:
        """The puppet with the obstacles that it can touch, and the obstacles it must stay clear of.

        Raises:
            FileError: a mapping is not an obstacle, or a name is used twice.
        """
        if self.marionette.contacts is None:
            return self.marionette, tuple(self.obstacles)
        half_spaces = (o for o in self._standing if isinstance(o, HalfSpace) and o.name != FLOOR)
        return self.drawn_marionette, tuple(half_spaces)

    @property
    def drawn_marionette(self) -> Marionette:
        """The puppet with all obstacles except half-spaces, for pictures."""
        return self.marionette.with_obstacles(
            [obstacle for obstacle in self._standing if not isinstance(obstacle, HalfSpace)]
        )

    @property
    def _standing(self) -> tuple[Obstacle | HalfSpace, ...]:
        """The puppet's obstacles, its floor, and the obstacles of the task."""
        return standing(self.marionette.puppet, self.obstacles)

    @property
    def durations(self) -> tuple[float, float]:
        """The shortest and the longest duration [s].

        Raises:
            StateError: task without a duration.
        """
        if self.duration is None:
            raise StateError("the task has no duration; needed: a number, or two")
        low, high = np.broadcast_to(floats(self.duration), (2,))
        return float(low), float(high)

    @property
    def max_duration(self) -> float:
        """The longest duration [s]; infinite if there is none."""
        return math.inf if self.duration is None else self.durations[1]

    @property
    def is_free(self) -> bool:
        """Whether the duration is free."""
        low, high = self.durations
        return low < high

    @property
    def n_intervals(self) -> int:
        """Number of intervals between nodes, for the longest duration."""
        return max(1, math.ceil(self.durations[1] / self.interval - 1e-9))


def displaced(marionette: Marionette, x: State, displacements: Mapping[str, float]) -> State:
    """The state with scalar coordinates, dynamic or driven, displaced [m or rad].

    Raises:
        UnknownNameError: name that is not a scalar coordinate.
    """
    table = marionette.coordinates
    q_D, q_K = np.array(x.q_D), np.array(x.q_K)
    coordinates = {table.q_D[q]: (q_D, q) for q, _ in table.scalars_D}
    coordinates |= {table.q_K[q]: (q_K, q) for q, _ in table.scalars_K}
    for name, displacement in displacements.items():
        if name not in coordinates:
            raise UnknownNameError("scalar coordinate", name, list(coordinates))
        q, index = coordinates[name]
        q[index] += displacement
    return x.replace(q_D=q_D, q_K=q_K)
