"""What a planner found."""

from __future__ import annotations

import contextlib
import enum
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Method, MethodName, TimeStepping
from fantoccini.motion import Input, State, Trajectory
from fantoccini.planning import archive
from fantoccini.planning.check import Check, checked, holds, inputs_along, run_along
from fantoccini.planning.feedback import Feedback
from fantoccini.planning.goals import Goal
from fantoccini.planning.motions import Motions
from fantoccini.planning.planners import Planner
from fantoccini.planning.polish import Polish
from fantoccini.planning.problem import Problem
from fantoccini.planning.search import Search
from fantoccini.planning.search_tree import SearchTree
from fantoccini.runtime import POINT


class PlanStatus(enum.Enum):
    """How a search ended."""

    EXACT = "the plan ends within the tolerance and touches nothing, event-driven too"
    UNCONFIRMED = "the plan ends within the tolerance by time-stepping; it was not confirmed"
    APPROXIMATE = "the search ended before it came within the tolerance; this is the nearest"
    TIMEOUT = "the time ended before the search came within the tolerance; this is the nearest"
    INFEASIBLE_START = "the start is in collision or outside of the bounds"
    INFEASIBLE_GOAL = "the goal is out of reach"

    @property
    def message(self) -> str:
        """In words."""
        return self.value


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A plan, and the tree it was found in. True where the plan :attr:`holds`.

    Attributes:
        status: how the search ended.
        problem: what was to be planned.
        path: nodes of the tree from the start to the plan's end.
        tree: the one in which the plan was found.
        search: what found it, to go on.
        tried: motions that were tried.
        seconds: that the search took [s].
        curve: (seconds, motions, time of the plan) of every plan that was the best so far.
        refused: plans that were found and arrive by the time-stepper, but do not hold.
        polished: what came of polishing the plan, and why it did not help; None where it was not
            asked.
    """

    status: PlanStatus
    problem: Problem
    path: tuple[int, ...]
    tree: SearchTree
    search: Search
    tried: int
    seconds: float
    curve: tuple[tuple[float, int, float], ...]
    refused: int
    polished: Polish | None

    @classmethod
    def of(cls, search: Search) -> PlanResult:
        """What a search has found so far."""
        problem, tree = search.problem, search.tree
        status = PlanStatus.TIMEOUT if search.late else PlanStatus.APPROXIMATE
        if problem.reason:
            status = PlanStatus.INFEASIBLE_START
        elif problem.out_of_reach:
            status = PlanStatus.INFEASIBLE_GOAL
        elif tree.distance[search.best] <= problem.tolerance:
            # The start alone has nothing to confirm.
            sure = search.confirm or search.best == 0
            status = PlanStatus.EXACT if sure else PlanStatus.UNCONFIRMED
        path = tuple(tree.path(search.best))
        curve = tuple(search.curve)
        return cls(
            status, problem, path, tree, search, search.tried, search.seconds, curve,
            search.refused, search.polished,
        )  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Writes the plan with its tree as npz; the file appears whole or not at all."""
        archive.save(self, path)

    @classmethod
    def load(cls, path: str | Path, problem: Problem, planner: Planner | None = None) -> PlanResult:
        """Reads what :meth:`save` wrote; the search can go on.

        It goes on as if it had never ended, but that a tree in which it looked for a better plan
        begins anew.

        Args:
            path: of the file.
            problem: what was planned.
            planner: the one that was used, where that has no name.

        Raises:
            FileError: the file is no plan, or one of another problem.
        """
        return cls.of(archive.load(path, problem, planner))

    def grow(self, seconds: float = 1.0, iterations: int | None = None) -> PlanResult:
        """Goes on with the search: for a plan, or a better one where there is one.

        Args:
            seconds: for so long.
            iterations: and with so many motions at most.

        Raises:
            ValueError: a number of seconds that is negative or not finite.
        """
        _check(seconds)
        with contextlib.suppress(KeyboardInterrupt):
            go_on = self.search.better if self.search.arrived else self.search.first
            go_on(seconds, iterations)
        return PlanResult.of(self.search)

    @cached_property
    def holds(self) -> bool:
        """Whether it ends within the tolerance and touches nothing when its events are located.

        A search that confirms its plans knows; of others the first question makes the plan again.
        """
        if self.status is PlanStatus.UNCONFIRMED:
            return holds(self.problem, self.tree, self.path)
        return self.status is PlanStatus.EXACT

    def __bool__(self) -> bool:
        return self.holds

    def __repr__(self) -> str:
        found = (
            f"{self.duration:.2f} s in {len(self.path) - 1} motions, {self.distance:.3g} from the "
            f"goal; {self.tried} tried, {len(self.tree)} nodes, {self.seconds:.3g} s{self._notes}"
        )
        return f"<PlanResult {self.status.name}: {self.reason or found}>"

    @property
    def message(self) -> str:
        """How the search ended, how many plans did not hold, and what came of polishing."""
        text = self.reason or self.status.message
        if self.status is PlanStatus.UNCONFIRMED and not self:
            text += ", and does not hold event-driven"
        return text + self._notes

    @property
    def _notes(self) -> str:
        text = f"; {self.refused} refused that do not hold event-driven" if self.refused else ""
        return text + (f"; polish: {self.polished}" if self.polished is not None else "")

    def polish(self, distance: float = 1e-3, seconds: float = 0.5) -> PlanResult:
        """The plan, ended nearer to the goal, and made shorter where it can be.

        Where it comes no nearer otherwise it may last longer.

        Args:
            distance: that is near enough.
            seconds: how long to make it shorter, once it is there.

        Returns:
            The plan as it is where none comes so near; ``polished`` says why.

        Raises:
            ValueError: there is no plan, its goal is a function, or a number out of range.
        """
        _check(seconds)
        if not self:
            raise ValueError(f"there is no plan to polish: {self.message}")
        with contextlib.suppress(KeyboardInterrupt):
            self.search.polish(distance, seconds)
        return PlanResult.of(self.search)

    @property
    def reason(self) -> str:
        """Why there is no plan, where a name or a number says more than the status."""
        return self.problem.hopeless

    @property
    def start(self) -> State:
        """Where the plan begins."""
        return self.problem.start

    @property
    def goal(self) -> Goal:
        """Where it was to end."""
        return self.problem.goal

    @property
    def tolerance(self) -> float:
        """Of the goal's distance."""
        return self.problem.tolerance

    @property
    def motions(self) -> Motions:
        """What made it."""
        return self.problem.motions

    @property
    def duration(self) -> float:
        """Of the plan [s]."""
        return float(self.tree.time[self.path[-1]])

    @property
    def cost(self) -> float:
        """Of the plan, by its objective [s]."""
        return float(self.tree.cost[self.path[-1]])

    @property
    def distance(self) -> float:
        """From the goal at the plan's end."""
        return float(self.tree.distance[self.path[-1]])

    @cached_property
    def inputs(self) -> Input:
        """The driven coordinates: constant accelerations from node to node, then held.

        A plan without a motion goes on for a step.
        """
        return inputs_along(self.problem, self.tree, self.path)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The plan by the time-stepper, with the planner's step."""
        return run_along(
            self.problem, self.tree, self.path, TimeStepping(dt=self.motions.dt, extrapolate=False)
        )

    @property
    def clearance(self) -> Array:
        """(T,) of ``trajectory`` [m]."""
        return self.motions.clearance.of(self.trajectory)

    def plot(self, path: str | Path, **options) -> Path:
        """Writes a picture as the paper's Fig. 4: the tree's nodes, the way taken, poses.

        Nodes and way are those of a point of the puppet; see :meth:`traces`.

        Args:
            path: ends in ``.png``, ``.svg`` or ``.pdf``.
            options: of :func:`fantoccini.view.plan_picture`.
        """
        from fantoccini import view

        nodes, way = self.traces()
        return view.plan_picture(self.problem.stage, self.trajectory, nodes, way, path, **options)

    def traces(self) -> tuple[Array, Array]:
        """Where the point that pictures follow is: (n, 3) at the tree's nodes, (T, 3) on the way.

        It is the goal's point, where that is one, otherwise the last string's first point that
        moves [m].
        """
        nodes, way = (self._point(a.q_D, a.q_K) for a in (self.tree, self.trajectory))
        return nodes, way

    def animate(self, path: str | Path, **options) -> Path:
        """Writes a film of the plan among its obstacles; see :func:`fantoccini.view.film`."""
        from fantoccini import view

        return view.film(self.problem.stage, self.trajectory, path, **options)

    def _point(self, q_D: Array, q_K: Array) -> Array:
        """(n, 3) of the point that pictures follow [m]."""
        marionette, numbers = self.problem.marionette, self.goal.numbers
        if numbers.kind == POINT:
            pose = marionette.poses(q_D, q_K)[:, numbers.link]
            return pose[..., 3] + pose[..., :3] @ numbers.at
        if marionette.tree.strings:
            return marionette.string_points(q_D, q_K)[-1][:, 0]
        return marionette.poses(q_D, q_K)[:, -1, :, 3]

    def feedback(self, **options: float) -> Feedback:
        """The law that follows the plan although something pushes; see :class:`Feedback`.

        Args:
            options: of :meth:`Feedback.along`.
        """
        return Feedback.along(self, **options)

    def replay(self) -> bool:
        """Makes every motion of the plan again; whether it comes out the same, to the last bit."""
        tree, motions = self.tree, self.motions.where(tolerance=-1.0)
        for before, node in zip(self.path, self.path[1:], strict=False):
            again = motions.replay(
                tree.rows[[before]], tree.acceleration[node], int(tree.looks[node])
            )
            there = tree.rows[[node]].parts
            if again is None or not all(
                np.array_equal(a, there[name]) for name, a in again.parts.items()
            ):
                return False
        return True

    def verify(
        self,
        dt_factor: float | None = None,
        method: Method | MethodName = "timestepping",
        backend: Literal["fantoccini", "mujoco"] = "fantoccini",
    ) -> Check:
        """Simulates the plan anew, from its start and inputs alone.

        Args:
            dt_factor: step, as part of the planner's: half of it by default, and in MuJoCo a
                quarter, since its strings give the more the longer it is. None of ``event``.
            method: of the simulation; with its options the step is theirs.
            backend: ``"fantoccini"``, or ``"mujoco"`` (extra ``mujoco``): another program's
                equations and strings.

        Raises:
            ExchangeError: MuJoCo cannot do what the puppet has: slipping winches, restitution,
                quadratic drag.
            MissingLibraryError: MuJoCo is not installed.
            ValueError: an unknown backend, or what does not go with it.
        """
        return checked(self.problem, self.tree, self.path, dt_factor, method, backend)


def _check(seconds: float) -> None:
    if not 0.0 <= seconds < np.inf:
        raise ValueError(f"seconds is {seconds}; it must be a finite number of at least 0")
