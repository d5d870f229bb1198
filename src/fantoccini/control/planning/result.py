"""The result of a search for a plan."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fantoccini.base import Array, Times, check_not_negative, output
from fantoccini.control.planning import archive
from fantoccini.control.planning.check import Check, checked, confirmed
from fantoccini.control.planning.feedback import Feedback
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.planning.planners import Planner
from fantoccini.control.planning.polish import Polish
from fantoccini.control.planning.search import Search
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Problem, Rollouts
from fantoccini.control.tasks import Answer, AnswerStatus, Goal, Meeting, StateArrays
from fantoccini.dynamics.compiled import Method, MethodName
from fantoccini.kernel.runtime import POINT
from fantoccini.motion import Input, State, Trajectory

_TIME_LIMIT_NOTE = "a time limit ended the search, so that a second run may find another plan"


@dataclass(frozen=True, eq=False)
class PlanResult(Answer):
    """A plan, and the tree in which it was found. True where the plan :attr:`holds`.

    Attributes:
        plan_path: the plan as a path through the tree, and its simulations.
        status: how the search ended.
        search: that found it, and can go on.
        tried: rollouts simulated.
        seconds: spent searching [s].
        curve: (seconds, rollouts, duration) of every plan that was the best, in order.
        refused: plans that arrive by the time-stepper, but do not hold in simulation.
        polished: the outcome of polishing the plan; None where it was not attempted.
    """

    plan_path: PlanPath
    status: AnswerStatus
    search: Search
    tried: int
    seconds: float
    curve: tuple[tuple[float, int, float], ...]
    refused: int
    polished: Polish | None

    @classmethod
    def of(cls, search: Search) -> PlanResult:
        """What a search has found so far."""
        problem, found = search.problem, search.record
        tree, best = found.tree, found.best
        status = AnswerStatus.OUT_OF_TIME if found.late else AnswerStatus.APPROXIMATE
        if problem.reason:
            status = AnswerStatus.INFEASIBLE_START
        elif problem.out_of_reach:
            status = AnswerStatus.INFEASIBLE_GOAL
        elif tree.distance[best] <= problem.tolerance:
            # The start alone needs no confirmation.
            sure = search.options.confirm or best == 0
            status = AnswerStatus.EXACT if sure else AnswerStatus.UNCONFIRMED
        return cls(
            PlanPath(problem, tree, tuple(tree.path(best))),
            status,
            search,
            found.tried,
            found.seconds,
            found.curve,
            found.refused,
            found.polished,
        )

    @property
    def problem(self) -> Problem:
        """The problem that was planned."""
        return self.plan_path.problem

    @property
    def tree(self) -> SearchTree:
        """All nodes that were found."""
        return self.plan_path.tree

    @property
    def path(self) -> tuple[int, ...]:
        """(m + 1) nodes of the tree from the start to the plan's end."""
        return self.plan_path.path

    @property
    def start(self) -> State:
        """Where the plan begins."""
        return self.plan_path.start

    @property
    def goal(self) -> Goal:
        """The problem's goal."""
        return self.plan_path.goal

    @property
    def tolerance(self) -> float:
        """Tolerance of the goal's distance."""
        return self.plan_path.tolerance

    @property
    def rollouts(self) -> Rollouts:
        """Simulates segments."""
        return self.plan_path.rollouts

    @property
    def times(self) -> Times:
        """(m + 1,) of the nodes of the path [s]."""
        return self.plan_path.times

    @property
    def states(self) -> StateArrays:
        """(m + 1,) at the nodes of the path."""
        return self.plan_path.states

    @property
    def acceleration(self) -> Array:
        """(m, n_vK) of the driven coordinates [m/s^2 or rad/s^2]."""
        return self.plan_path.acceleration

    @property
    def inputs(self) -> Input:
        """The driven coordinates; see :attr:`PlanPath.inputs`."""
        return self.plan_path.inputs

    @property
    def trajectory(self) -> Trajectory:
        """The plan by the time-stepper, with the planner's step."""
        return self.plan_path.trajectory

    def save(self, path: str | Path) -> None:
        """Writes the plan with its tree as npz; the file appears whole or not at all."""
        record = replace(
            self.search.record,
            tree=self.tree,
            best=self.path[-1],
            tried=self.tried,
            seconds=self.seconds,
            curve=self.curve,
        )
        archive.save(path, self.search, record, self.status.name)

    @classmethod
    def load(cls, path: str | Path, problem: Problem, planner: Planner | None = None) -> PlanResult:
        """Reads what :meth:`save` wrote; the search can go on.

        It goes on as if it had never stopped, except that a tree in which it looked for a better
        plan begins anew.

        Args:
            path: of the file.
            problem: that was planned.
            planner: that was used, where it has no name.

        Raises:
            FileError: the file is not a plan, or belongs to another problem.
        """
        return cls.of(archive.load(path, problem, planner))

    def grow(self, seconds: float = 1.0, iterations: int | None = None) -> PlanResult:
        """Continues the search: for a plan, or for a better one where there is one.

        Args:
            seconds: how long.
            iterations: rollouts, at most.

        Raises:
            ValueError: a number of seconds that is negative or not finite.
        """
        check_not_negative(seconds=seconds)
        with contextlib.suppress(KeyboardInterrupt):
            go_on = self.search.find_better if self.search.arrived else self.search.find_first
            go_on(seconds, iterations)
        return PlanResult.of(self.search)

    @cached_property
    def holds(self) -> bool:
        """Whether the plan ends within the tolerance and touches only what it may, in simulation.

        Where the search did not confirm its plans, the first call simulates the plan.
        """
        if self.status is AnswerStatus.UNCONFIRMED:
            return confirmed(self.plan_path).arrives
        return self.status.holds

    def __repr__(self) -> str:
        found = (
            f"{self.duration:.2f} s in {len(self.path) - 1} segments, {self.distance:.3g} from the "
            f"goal; {self.tried} tried, {len(self.tree)} nodes, {self.seconds:.3g} s{self._notes}"
        )
        return f"<PlanResult {self.status.name}: {self.reason or found}>"

    @property
    def message(self) -> str:
        """How the search ended, how many plans were refused, and the outcome of polishing."""
        text = self.reason or self.status.message
        if self.status is AnswerStatus.UNCONFIRMED and not self:
            text += ", and does not hold in simulation"
        return text + self._missing + self._notes

    @property
    def _missing(self) -> str:
        """What is missing at the goal, where there is no plan."""
        problem = self.problem
        if self.reason or self.distance <= problem.tolerance:
            return ""
        found = [problem.note] if problem.note else []
        if problem.push is not None:
            found.append(problem.push.progress(problem.marionette, self.states[-1]))
        elif problem.goal.touches:
            gaps = problem.goal.gaps(self.states[-1:])[0]
            found += [
                f"{a} is {gap:.3g} m from {b}"
                for (a, b), gap in zip(problem.goal.touches, gaps, strict=True)
                if gap > 0.0
            ]
        return "".join(f"; {text}" for text in found)

    @property
    def _notes(self) -> str:
        text = f"; {self.refused} refused that do not hold in simulation" if self.refused else ""
        text += f" ({self.search.fault})" if self.refused and self.search.fault else ""
        text += f"; polish: {self.polished}" if self.polished is not None else ""
        return text + (f"; {_TIME_LIMIT_NOTE}" if self.ended_by_clock else "")

    @property
    def ended_by_clock(self) -> bool:
        """Whether a time limit selected the plan, so that a second run may find another."""
        found = self.distance <= self.problem.tolerance and len(self.path) > 1
        return found and not self.reason and self.search.late

    def polish(self, distance: float = 1e-3, seconds: float = 0.5) -> PlanResult:
        """The plan, ended nearer to the goal, and made shorter where possible.

        It may last longer where it comes no nearer otherwise.

        Args:
            distance: from the goal that is near enough.
            seconds: how long to make it shorter, once it is there.

        Returns:
            The plan unchanged where it cannot be brought so near; ``polished`` says why.

        Raises:
            ValueError: there is no plan, its goal is a function, something may touch, or a number
                is out of range.
        """
        check_not_negative(seconds=seconds)
        if not self:
            raise ValueError(f"there is no plan to polish: {self.message}")
        with contextlib.suppress(KeyboardInterrupt):
            self.search.polish(distance, seconds)
        return PlanResult.of(self.search)

    @property
    def reason(self) -> str:
        """Why no plan can exist, with names and numbers; empty where one may."""
        return self.problem.infeasible

    @property
    def duration(self) -> float:
        """Duration of the plan [s]."""
        return float(self.tree.time[self.path[-1]])

    @property
    def cost(self) -> float:
        """Cost of the plan, by its objective [s]."""
        return float(self.tree.cost[self.path[-1]])

    @property
    def distance(self) -> float:
        """Distance from the goal at the plan's end."""
        return float(self.tree.distance[self.path[-1]])

    @property
    def clearance(self) -> Array:
        """(T,) of the samples of ``trajectory`` [m]."""
        return self.rollouts.clearance.of(self.trajectory)

    @property
    def least_clearance(self) -> float:
        """The least clearance of ``trajectory``, also between its samples [m]."""
        return self.rollouts.clearance.least(self.trajectory).distance

    @property
    def touches(self) -> tuple[Meeting, ...]:
        """What bodies of a puppet touch that is not their own, in ``trajectory``, in order."""
        return self.problem.touches.meetings(self.trajectory)

    def plot(self, path: str | Path, **options: Any) -> Path:
        """Draws the paper's Fig. 4: the tree's nodes, the path of a point (:meth:`traces`), poses.

        Args:
            path: ends in ``.png``, ``.svg`` or ``.pdf``.
            options: of :func:`fantoccini.output.plan_picture`.
        """
        drawn, (nodes, way) = self.problem.drawn_marionette, self.traces()
        return output().plan_picture(drawn, self.trajectory, nodes, way, path, **options)

    def traces(self) -> tuple[Array, Array]:
        """Positions of one point of the puppet: (n, 3) at the tree's nodes, (T, 3) along the plan.

        It is the goal's point, if it has one, otherwise the first moving point of the last string
        [m].
        """
        return self._point(self.tree.q_D, self.tree.q_K), self._point(
            self.trajectory.q_D, self.trajectory.q_K
        )

    def animate(self, path: str | Path, **options: Any) -> Path:
        """Writes a film of the plan among its obstacles; see :func:`fantoccini.output.film`."""
        return output().film(self.problem.drawn_marionette, self.trajectory, path, **options)

    def _point(self, q_D: Array, q_K: Array) -> Array:
        """(n, 3) of the point that pictures follow [m]."""
        marionette, numbers = self.problem.marionette, self.goal.numbers
        if numbers.kind == POINT:
            pose = marionette.poses(q_D, q_K)[:, numbers.link]
            return pose[..., 3] + pose[..., :3] @ numbers.at
        if marionette.tree.strings:
            return marionette.string_points(q_D, q_K)[-1][:, 0]
        return marionette.poses(q_D, q_K)[:, -1, :, 3]

    def feedback(self, **options: Any) -> Feedback:
        """The feedback law that follows the plan under disturbances.

        Args:
            options: of :meth:`Feedback.along`.
        """
        return Feedback.along(self.plan_path, **options)

    def replay(self) -> bool:
        """Whether every segment, simulated again, comes out the same to the last bit."""
        tree, rollouts = self.tree, self.rollouts.where(tolerance=-1.0)
        for before, node in zip(self.path, self.path[1:], strict=False):
            again = rollouts.replay(
                tree.states[[before]], tree.acceleration[node], int(tree.looks[node])
            )
            there = tree.states[[node]].parts
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
        """Simulates the plan again, from its start and inputs alone.

        Args:
            dt_factor: step of ``"timestepping"``, relative to the planner's: by default 0.5, and
                0.25 in MuJoCo, whose strings stretch more with longer steps.
            method: of the simulation; options of a method replace ``dt_factor``.
            backend: ``"fantoccini"``, or ``"mujoco"`` (extra ``mujoco``) for another program's
                equations and strings.

        Raises:
            ExchangeError: MuJoCo cannot do slipping winches, restitution or quadratic drag.
            MissingLibraryError: MuJoCo is not installed.
            ValueError: an unknown backend, or options that do not fit it.
        """
        return checked(self.plan_path, dt_factor, method, backend)
