"""The result of a search for a plan.

A node is a state at the end of a segment, a piece of the plan with constant accelerations of the
driven coordinates. q_D are dynamic coordinates, q_K driven ones.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fantoccini.base import Array, Times, check_not_negative, output
from fantoccini.control.planning import archive
from fantoccini.control.planning.check import Check, check_plan, confirm_plan
from fantoccini.control.planning.feedback import Feedback
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.planning.planners import Planner
from fantoccini.control.planning.polish import PolishResult
from fantoccini.control.planning.search import Search
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Problem, Rollouts
from fantoccini.control.tasks import Answer, AnswerStatus, Goal, StateArrays, TouchEvent
from fantoccini.dynamics.compiled import Method, MethodName
from fantoccini.kernel.runtime import POINT
from fantoccini.motion import Input, State, Trajectory

_TIME_LIMIT_NOTE = "a time limit ended the search, so that a second run may find another plan"


@dataclass(frozen=True, eq=False)
class PlanResult(Answer):
    """A plan, and the tree in which it was found. It is true if the plan :attr:`holds`.

    Attributes:
        plan_path: the plan as a path through the tree, and its simulations.
        status: status at the end of the search.
        search: the search, which can be continued.
        tried: number of rollouts.
        seconds: time of the search [s].
        curve: (seconds, rollouts, duration) of every plan that was the best, in order.
        refused: number of plans that arrive with the time-stepper, but not in a second simulation.
        polished: the outcome of polishing the plan; None if it was not attempted.
    """

    plan_path: PlanPath
    status: AnswerStatus
    search: Search
    tried: int
    seconds: float
    curve: tuple[tuple[float, int, float], ...]
    refused: int
    polished: PolishResult | None

    @classmethod
    def from_search(cls, search: Search) -> PlanResult:
        """The best plan of a search so far."""
        problem, record = search.problem, search.record
        tree, best = record.tree, record.best
        status = AnswerStatus.OUT_OF_TIME if record.timed_out else AnswerStatus.APPROXIMATE
        if problem.reason:
            status = AnswerStatus.INFEASIBLE_START
        elif problem.out_of_reach:
            status = AnswerStatus.INFEASIBLE_GOAL
        elif tree.distance[best] <= problem.tolerance:
            # The start alone needs no confirmation.
            is_confirmed = search.options.confirm or best == 0
            status = AnswerStatus.EXACT if is_confirmed else AnswerStatus.UNCONFIRMED
        return cls(
            PlanPath(problem, tree, tuple(tree.path(best))),
            status,
            search,
            record.tried,
            record.seconds,
            record.curve,
            record.refused,
            record.polished,
        )

    @property
    def problem(self) -> Problem:
        """The planning problem."""
        return self.plan_path.problem

    @property
    def tree(self) -> SearchTree:
        """The tree of all nodes."""
        return self.plan_path.tree

    @property
    def path(self) -> tuple[int, ...]:
        """(m + 1) nodes of the tree from the start to the plan's end."""
        return self.plan_path.path

    @property
    def start(self) -> State:
        """The state at the start of the plan."""
        return self.plan_path.start

    @property
    def goal(self) -> Goal:
        """The problem's goal."""
        return self.plan_path.goal

    @property
    def tolerance(self) -> float:
        """Weighted distance from the goal at which it counts as reached."""
        return self.plan_path.tolerance

    @property
    def rollouts(self) -> Rollouts:
        """The rollouts that simulated the plan's segments."""
        return self.plan_path.rollouts

    @property
    def times(self) -> Times:
        """(m + 1,) times of the nodes of the path [s]."""
        return self.plan_path.times

    @property
    def states(self) -> StateArrays:
        """(m + 1,) states at the nodes of the path."""
        return self.plan_path.states

    @property
    def acceleration(self) -> Array:
        """(m, n_vK) accelerations of the driven coordinates [m/s^2 or rad/s^2]."""
        return self.plan_path.acceleration

    @property
    def inputs(self) -> Input:
        """The motion of the driven coordinates; see :attr:`PlanPath.inputs`."""
        return self.plan_path.inputs

    @property
    def trajectory(self) -> Trajectory:
        """A run of the plan by the time-stepper, with the planner's step."""
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
        """The plan in a file that :meth:`save` wrote; the search can be continued.

        It continues as without an interruption, but a search for a better plan begins a new tree.

        Args:
            path: path of the file.
            problem: the planning problem.
            planner: planner of the search, if it has no name.

        Raises:
            FileError: file that is not a plan, or belongs to another problem.
        """
        return cls.from_search(archive.load(path, problem, planner))

    def grow(self, seconds: float = 1.0, iterations: int | None = None) -> PlanResult:
        """The result of a continued search, for a plan or a better one.

        Args:
            seconds: time of the continued search [s].
            iterations: largest number of rollouts.

        Raises:
            ValueError: time that is negative or not finite.
        """
        check_not_negative(seconds=seconds)
        with contextlib.suppress(KeyboardInterrupt):
            search = self.search.find_better if self.search.arrived else self.search.find_first
            search(seconds, iterations)
        return PlanResult.from_search(self.search)

    @cached_property
    def holds(self) -> bool:
        """Whether the plan ends within the tolerance with only allowed touches, when simulated.

        If the search did not confirm its plans, the first call simulates the plan.
        """
        if self.status is AnswerStatus.UNCONFIRMED:
            return confirm_plan(self.plan_path).arrives
        return self.status.holds

    def __repr__(self) -> str:
        summary = (
            f"{self.duration:.2f} s in {len(self.path) - 1} segments, {self.distance:.3g} from the "
            f"goal; {self.tried} tried, {len(self.tree)} nodes, {self.seconds:.3g} s{self._notes}"
        )
        return f"<PlanResult {self.status.name}: {self.reason or summary}>"

    @property
    def message(self) -> str:
        """Description of the search's end, the refused plans and the outcome of polishing."""
        text = self.reason or self.status.message
        if self.status is AnswerStatus.UNCONFIRMED and not self:
            text += ", and does not hold in simulation"
        return text + self._unmet_conditions + self._notes

    @property
    def _unmet_conditions(self) -> str:
        """Missing conditions at the goal, in words, if there is no plan."""
        problem = self.problem
        if self.reason or self.distance <= problem.tolerance:
            return ""
        parts = [problem.note] if problem.note else []
        if problem.push is not None:
            parts.append(problem.push.progress(problem.marionette, self.states[-1]))
        elif problem.goal.touches:
            gaps = problem.goal.gaps(self.states[-1:])[0]
            parts += [
                f"{first} is {gap:.3g} m from {second}"
                for (first, second), gap in zip(problem.goal.touches, gaps, strict=True)
                if gap > 0.0
            ]
        return "".join(f"; {text}" for text in parts)

    @property
    def _notes(self) -> str:
        text = f"; {self.refused} refused, which do not hold in simulation" if self.refused else ""
        text += f" ({self.search.fault})" if self.refused and self.search.fault else ""
        text += f"; polish: {self.polished}" if self.polished is not None else ""
        return text + (f"; {_TIME_LIMIT_NOTE}" if self.ended_by_clock else "")

    @property
    def ended_by_clock(self) -> bool:
        """Whether a time limit selected the plan, so that a second run may find another."""
        has_plan = self.distance <= self.problem.tolerance and len(self.path) > 1
        return has_plan and not self.reason and self.search.timed_out

    def polish(self, distance: float = 1e-3, seconds: float = 0.5) -> PlanResult:
        """The plan with its end nearer to the goal, and shorter where possible.

        It may become longer if necessary.

        Args:
            distance: required distance from the goal.
            seconds: time limit for shortening the plan after that [s].

        Returns:
            The plan, unchanged if that distance is not reached; ``polished`` has the reason.

        Raises:
            ValueError: result without a plan, goal that is a function, possible touches, or a
                number out of range.
        """
        check_not_negative(seconds=seconds)
        if not self:
            raise ValueError(f"there is no plan to polish: {self.message}")
        with contextlib.suppress(KeyboardInterrupt):
            self.search.polish(distance, seconds)
        return PlanResult.from_search(self.search)

    @property
    def reason(self) -> str:
        """Reason why no plan can exist, with names and numbers; may be empty."""
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
        """(T,) clearances at the samples of ``trajectory`` [m]."""
        return self.rollouts.clearance.of(self.trajectory)

    @property
    def least_clearance(self) -> float:
        """The least clearance of ``trajectory``, also between its samples [m]."""
        return self.rollouts.clearance.least(self.trajectory).distance

    @property
    def touches(self) -> tuple[TouchEvent, ...]:
        """Touches of bodies with other parts in ``trajectory``, in order."""
        return self.problem.touches.touch_events(self.trajectory)

    def plot(self, path: str | Path, **options: Any) -> Path:
        """Draws the paper's Fig. 4: the tree's nodes, the path of a point (:meth:`traces`), poses.

        Args:
            path: path of the picture; ends in ``.png``, ``.svg`` or ``.pdf``.
            options: options of :func:`fantoccini.output.plan_picture`.
        """
        marionette, (nodes, trace) = self.problem.drawn_marionette, self.traces()
        return output().plan_picture(marionette, self.trajectory, nodes, trace, path, **options)

    def traces(self) -> tuple[Array, Array]:
        """Positions of one point of the puppet: (n, 3) at the tree's nodes, (T, 3) along the plan.

        The point is that of the goal, or the first moving point of the last string [m].
        """
        return self._point(self.tree.q_D, self.tree.q_K), self._point(
            self.trajectory.q_D, self.trajectory.q_K
        )

    def animate(self, path: str | Path, **options: Any) -> Path:
        """Writes a film of the plan among its obstacles; see :func:`fantoccini.output.film`."""
        return output().film(self.problem.drawn_marionette, self.trajectory, path, **options)

    def _point(self, q_D: Array, q_K: Array) -> Array:
        """(n, 3) positions of the point that pictures follow [m]."""
        marionette, numbers = self.problem.marionette, self.goal.numbers
        if numbers.kind == POINT:
            pose = marionette.poses(q_D, q_K)[:, numbers.link]
            return pose[..., 3] + pose[..., :3] @ numbers.at
        if marionette.tree.strings:
            return list(marionette.string_points(q_D, q_K).values())[-1][:, 0]
        return marionette.poses(q_D, q_K)[:, -1, :, 3]

    def feedback(self, **options: Any) -> Feedback:
        """The feedback law that follows the plan under disturbances.

        Args:
            options: options of :meth:`Feedback.along`.
        """
        return Feedback.along(self.plan_path, **options)

    def replay(self) -> bool:
        """Whether every segment, simulated again, gives the same result to the last bit."""
        tree, rollouts = self.tree, self.rollouts.with_tolerance(tolerance=-1.0)
        for parent, node in zip(self.path, self.path[1:], strict=False):
            replayed = rollouts.replay(
                tree.states[[parent]], tree.acceleration[node], int(tree.n_checks[node])
            )
            saved = tree.states[[node]].parts
            if replayed is None or not all(
                np.array_equal(array, saved[name]) for name, array in replayed.parts.items()
            ):
                return False
        return True

    def verify(
        self,
        dt_factor: float | None = None,
        method: Method | MethodName = "timestepping",
        backend: Literal["fantoccini", "mujoco"] = "fantoccini",
    ) -> Check:
        """The result of a second simulation, from the plan's start and inputs alone.

        Args:
            dt_factor: step of ``"timestepping"``, relative to the planner's: by default 0.5, and
                0.25 in MuJoCo, whose strings stretch more with longer steps.
            method: method of the simulation; options of a method replace ``dt_factor``.
            backend: ``"fantoccini"``, or ``"mujoco"`` (extra ``mujoco``) for another program's
                equations and strings.

        Raises:
            ExchangeError: slipping winches, restitution or quadratic drag, which MuJoCo lacks.
            MissingLibraryError: MuJoCo is not installed.
            ValueError: unknown backend, or options that do not fit it.
        """
        return check_plan(self.plan_path, dt_factor, method, backend)
