"""What a planner found."""

from __future__ import annotations

import contextlib
import enum
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.arrays import Array
from fantoccini.motion import Input, State, Trajectory
from fantoccini.plan.goals import Goal, Rows
from fantoccini.plan.motions import Motions
from fantoccini.plan.problem import Problem
from fantoccini.plan.search import Search
from fantoccini.plan.search_tree import SearchTree
from fantoccini.runtime import STATE
from fantoccini.simulate import simulate


class PlanStatus(enum.Enum):
    """How a search ended."""

    EXACT = "the plan ends within the tolerance"
    APPROXIMATE = "the search ended before it came within the tolerance; this is the nearest"
    INFEASIBLE_START = "the start is in collision or outside of the bounds"

    @property
    def message(self) -> str:
        """In words."""
        return self.value


@dataclass(frozen=True)
class Check:
    """A plan made again.

    Attributes:
        arrives: whether it ends within the tolerance and touches nothing; the margin was for this.
        distance: from the goal at the end.
        clearance: the least on the way [m].
        gap: largest difference of a dynamic coordinate from the plan's own run, at its nodes.
        run: the trajectory.
    """

    arrives: bool
    distance: float
    clearance: float
    gap: float
    run: Trajectory


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A plan, and the tree it was found in. True where the plan is exact.

    Attributes:
        status: how the search ended.
        problem: what was to be planned.
        path: nodes of the tree from the start to the plan's end.
        tree: the one in which the plan was found.
        search: what found it, to go on.
        tried: motions that were tried.
        seconds: that the search took [s].
        curve: (seconds, motions, time of the plan) of every plan that was the best so far.
    """

    status: PlanStatus
    problem: Problem
    path: tuple[int, ...]
    tree: SearchTree
    search: Search
    tried: int
    seconds: float
    curve: tuple[tuple[float, int, float], ...]

    @classmethod
    def of(cls, search: Search) -> PlanResult:
        """What a search has found so far."""
        problem, tree = search.problem, search.tree
        status = PlanStatus.APPROXIMATE
        if problem.reason:
            status = PlanStatus.INFEASIBLE_START
        elif tree.distance[search.best] <= problem.tolerance:
            status = PlanStatus.EXACT
        path = tuple(tree.path(search.best))
        curve = tuple(search.curve)
        return cls(status, problem, path, tree, search, search.tried, search.seconds, curve)

    def grow(self, seconds: float = 1.0, iterations: int | None = None) -> PlanResult:
        """Goes on with the search: for a plan, or a shorter one where there is one.

        Args:
            seconds: for so long.
            iterations: and with so many motions at most.
        """
        with contextlib.suppress(KeyboardInterrupt):
            go_on = self.search.shorter if self.search.arrived else self.search.first
            go_on(seconds, iterations)
        return PlanResult.of(self.search)

    def __bool__(self) -> bool:
        return self.status is PlanStatus.EXACT

    def __repr__(self) -> str:
        found = (
            f"{self.duration:.2f} s in {len(self.path) - 1} motions, {self.distance:.3g} from the "
            f"goal; {self.tried} tried, {len(self.tree)} nodes, {self.seconds:.3g} s"
        )
        return f"<PlanResult {self.status.name}: {self.reason or found}>"

    def polish(self, distance: float = 1e-3, seconds: float = 0.5) -> PlanResult:
        """The plan, ended nearer to the goal and made shorter where it can be.

        Args:
            distance: that is near enough.
            seconds: how long to look for shorter plans.

        Returns:
            The plan as it is where none comes so near.

        Raises:
            ValueError: there is no plan, or its goal is a function.
        """
        if not self:
            raise ValueError(f"there is no plan to polish: {self.status.message}")
        with contextlib.suppress(KeyboardInterrupt):
            self.search.polish(distance, seconds)
        return PlanResult.of(self.search)

    @property
    def reason(self) -> str:
        """Why there is no plan, where a name or a number says more than the status."""
        return self.problem.reason

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
    def distance(self) -> float:
        """From the goal at the plan's end."""
        return float(self.tree.distance[self.path[-1]])

    @cached_property
    def inputs(self) -> Input:
        """The driven coordinates: constant accelerations from node to node, then held.

        A plan without a motion goes on for a step.
        """
        tree, path = self.tree, list(self.path)
        times, acceleration = self.start.t + tree.time[path], tree.acceleration[path[1:]]
        if len(path) == 1:
            times = np.append(times, times + self.motions.dt)
            acceleration = np.zeros((1, len(self.start.v_K)))
        return Input.segments(
            self.motions.marionette, times, self.start.q_K, self.start.v_K, acceleration
        )

    @cached_property
    def trajectory(self) -> Trajectory:
        """The plan by the time-stepper, with the planner's step."""
        return self._run(method="timestepping", dt=self.motions.dt)

    @property
    def clearance(self) -> Array:
        """(T,) of ``trajectory`` [m]."""
        return self.motions.clearance.of(self.trajectory)

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

    def verify(self, dt_factor: float = 0.5, method: str = "timestepping", **options) -> Check:
        """Simulates the plan anew, from its start and inputs alone.

        Args:
            dt_factor: step, as part of the planner's (time-stepping).
            method: ``"timestepping"`` or ``"event"``.
            options: more of :func:`fantoccini.simulate`, as ``rtol``.
        """
        if method == "timestepping":
            options["dt"] = self.motions.dt * dt_factor
        run = self._run(method=method, **options)
        end = run.state(-1)
        rows = Rows(*(getattr(end, name)[None] for name in STATE))
        distance = float(self.goal.distance(rows)[0])
        clearance = float(np.min(self.motions.clearance.of(run)))
        times = self.start.t + self.tree.time[list(self.path)]
        near = np.array([int(np.argmin(np.abs(run.t - t))) for t in times])
        gap = float(np.max(np.abs(run.q_D[near] - self.tree.q_D[list(self.path)])))
        reached = run.t[-1] >= times[-1] - 1e-9
        arrives = reached and distance <= self.tolerance and clearance >= 0.0
        return Check(bool(arrives), distance, clearance, gap, run)

    def _run(self, **options) -> Trajectory:
        # A plan of one node has nothing to run; it stands for one step.
        end = self.start.t + max(self.duration, self.motions.dt)
        if options["method"] == "event":
            # The nodes, and looks from start to end.
            nodes = self.start.t + self.tree.time[list(self.path)]
            looks = np.arange(self.start.t, end, self.motions.interval)
            options["save_at"] = np.unique(np.minimum(np.append(nodes, looks), end))
        return simulate(
            self.motions.marionette, self.start, self.inputs, t_end=end, throw=False, **options
        )
