"""Searches for a first plan, then for better ones.

A node of the tree is a state that a simulation has reached. In names, K stands for driven
coordinates: ends and lengths of strings, driven joints. A segment is a piece of a motion with
constant driven accelerations.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.control.planning.check import confirm_plan
from fantoccini.control.planning.options import SearchOptions
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.planning.polish import Polisher, PolishResult, PolishStatus
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import Objective
from fantoccini.kernel.runtime import Segments


@dataclass(frozen=True)
class _Effort:
    """Distribution of a search's effort."""

    max_nodes: int = 20_000
    """Largest number of nodes of a tree in the search for better plans; then a new tree begins."""
    first_growth: float = 0.15
    """Share of the time for improvement that passes before the first plan is polished."""
    later_growth: float = 0.1
    """Share that passes between attempts to polish a plan."""


_EFFORT = _Effort()
_TIME_ERROR = 1e-9
"""Rounding error of the times of nodes, which are sums of intervals [s]."""


@dataclass(frozen=True, eq=False)
class SearchRecord:
    """The results of a search so far.

    Attributes:
        tree: tree that contains the best plan.
        best: index of that plan's end node; without a plan, of the node nearest to the goal.
        tried: number of rollouts.
        seconds: time of the search [s].
        curve: (seconds, rollouts, duration) of every plan that was the best, in order. A polished
            plan is nearer to the goal, but may be longer than the previous one.
        random_state: state of the random generator, as plain data.
        timed_out: whether a time limit ended the search, or its last stage.
        refused: number of plans that reached the goal in the search, not in a second simulation.
        polished: the outcome of polishing the best plan; None if it was not attempted.
    """

    tree: SearchTree
    best: int
    tried: int
    seconds: float
    curve: tuple[tuple[float, int, float], ...]
    random_state: Mapping[str, Any]
    timed_out: bool
    refused: int
    polished: PolishResult | None


class Search:
    """A search with a tree that grows to a first plan, then trees with plans of lower cost.

    Better plans are found as in AO-x (Hauser and Zhou 2016): after each plan a new tree begins at
    the start, with the plan's cost as a bound; nodes that cannot lead to a lower cost are left out.

    Attributes:
        problem, options: see below.
        objective: cost of plans: that of the options, otherwise that of the problem.
        tree, best, tried, seconds, curve, timed_out, refused, polished: see :class:`SearchRecord`.
        fault: reason why the last plan was refused; empty if none was.

    Args:
        problem: the planning problem.
        options: options of the search; the time limits are arguments of its methods instead.
    """

    def __init__(self, problem: Problem, options: SearchOptions):
        self.problem, self.options = problem, options
        objective = options.objective
        self.objective = problem.objective if objective is None else Objective.of(objective)
        self.tree, self.best, self.tried, self.seconds = self._new_tree(np.inf), 0, 0, 0.0
        self.timed_out, self.refused = False, 0
        self.polished: PolishResult | None = None
        self.fault = ""
        self.curve: list[tuple[float, int, float]] = []
        self._planner = options.planner_round
        self._rng = np.random.default_rng(options.seed)
        self._growing_tree = self.tree
        if self.arrived:
            self.curve.append((0.0, 0, 0.0))

    @property
    def arrived(self) -> bool:
        """Whether there is a plan."""
        return bool(self.tree.distance[self.best] <= self.problem.rollouts.stop_distance)

    @property
    def record(self) -> SearchRecord:
        """The results of the search so far."""
        return SearchRecord(
            self.tree,
            self.best,
            self.tried,
            self.seconds,
            tuple(self.curve),
            self._rng.bit_generator.state,
            self.timed_out,
            self.refused,
            self.polished,
        )

    def restore(self, record: SearchRecord) -> None:
        """Returns to a record; a tree that has no plan yet is discarded."""
        self.tree, self._growing_tree, self.best = record.tree, record.tree, record.best
        self.tried, self.seconds, self.curve = record.tried, record.seconds, list(record.curve)
        self.timed_out = record.timed_out
        self.refused = record.refused
        self.polished = record.polished
        self._rng.bit_generator.state = record.random_state

    def find_first(self, time_limit: float, iterations: int | None = None) -> None:
        """Searches for a first plan, within a time limit [s] and a number of rollouts."""
        self._run(lambda: self.arrived, time_limit, iterations)

    def find_better(self, time_limit: float, iterations: int | None = None) -> None:
        """Searches for plans that cost less, for a time [s] and a number of rollouts."""
        self._run(lambda: False, time_limit, iterations)

    def improve(self, seconds: float, distance: float) -> None:
        """Searches for better plans and polishes the best.

        Args:
            seconds: time for the search [s].
            distance: required distance from the goal.
        """
        until = time.perf_counter() + seconds
        if self.problem.touches.expected:
            self.find_better(seconds)
            self.polished = PolishResult(PolishStatus.MAY_TOUCH, distance)
            return
        self.find_better(_EFFORT.first_growth * seconds)
        if self.problem.goal.function is not None:
            self.polished = PolishResult(PolishStatus.UNKNOWN_GOAL, distance)
            return
        if self.best == 0:
            self.polish(distance, 0.0)
            return
        best_polished = attempted = None
        self.polished = PolishResult(PolishStatus.TIMEOUT, distance)
        try:
            while (time_left := until - time.perf_counter()) > 0.0:
                if (self.tree, self.best) != attempted and self.polish(
                    distance, time_left, time_left
                ):
                    best_polished = self.tree, self.best, self.polished
                attempted = self.tree, self.best
                # Another plan of lower cost may reach the goal after polishing, too.
                time_left = until - time.perf_counter()
                self.find_better(min(time_left, _EFFORT.later_growth * seconds))
        finally:
            if best_polished is not None and (self.tree, self.best) != best_polished[:2]:
                self._adopt(*best_polished[:2])
            if best_polished is not None:
                self.polished = best_polished[2]
            elif self.polished is None:  # there was no time left for the last plan
                self.polished = PolishResult(PolishStatus.TIMEOUT, distance)

    def polish(self, distance: float, seconds: float, time_limit: float = np.inf) -> bool:
        """Brings the end of the best plan nearer to the goal, and shortens the plan.

        The plan may last longer than before if it cannot come near enough otherwise.

        Args:
            distance: required distance from the goal.
            seconds: time to shorten the plan once it ends within that distance [s].
            time_limit: time after which polishing is abandoned if it does not [s].

        Returns:
            Whether the best plan now ends within the distance.

        Raises:
            ValueError: the goal is a function, the plan may touch something, or the distance is not
                greater than 0.
        """
        if not distance > 0.0:
            raise ValueError(f"distance is {distance}; it must be greater than 0")
        start_time, distance = (
            time.perf_counter(),
            min(distance, self.problem.rollouts.stop_distance),
        )
        plan, candidates = self._path(self.tree, self.best), []
        if len(plan.path) == 1:
            end_distance = float(self.tree.distance[self.best])
            is_near = end_distance <= distance
            status = PolishStatus.NO_BETTER if is_near else PolishStatus.NO_MOTION
            self.polished = PolishResult(status, distance, end_distance)
            return self.polished.reached
        polisher, status = Polisher(self.problem), PolishStatus.INTERRUPTED
        try:
            shorten = not self.objective.acceleration
            segments = plan.acceleration, plan.n_checks
            for candidate in polisher(*segments, distance, seconds, time_limit, shorten=shorten):
                candidates.append(candidate)
            status = PolishStatus.TIMEOUT if polisher.timed_out else PolishStatus.NOT_NEAR
        finally:
            # After Ctrl-C the shortest plan that a simulation confirms is kept.
            self.seconds += time.perf_counter() - start_time
            self.timed_out = self.timed_out or seconds > 0.0 or polisher.timed_out
            if candidates:
                status = self._accept_first_confirmed(reversed(candidates), distance)
            self.polished = polisher.outcome(status, distance)
        return self.polished.reached

    def _accept_first_confirmed(self, plans: Iterable[Segments], distance: float) -> PolishStatus:
        """Accepts the first polished plan that qualifies; returns its status.

        If none qualifies, the result is the status of the first one.
        """
        statuses = []
        for segments in plans:
            status = self._accept(segments, distance)
            if status.reached:
                return status
            statuses.append(status)
        return statuses[0]

    def _accept(self, segments: Segments, distance: float) -> PolishStatus:
        """Makes a polished plan the best one if it is better and confirmed; returns the status."""
        tree, interval = self.tree, self.problem.rollouts.options.interval
        node = tree.add_segments(segments, np.zeros(1, dtype=int), interval)[-1]
        if tree.time[node] > self.problem.max_duration + _TIME_ERROR:
            return PolishStatus.TOO_LONG
        if not self._confirmed(tree, node):
            return PolishStatus.NOT_HELD
        if tree.distance[self.best] > distance or tree.cost[node] < tree.cost[self.best]:
            self._adopt(tree, node)
            return PolishStatus.POLISHED
        return PolishStatus.NO_BETTER

    def _adopt(self, tree: SearchTree, node: int) -> None:
        """Makes a node the end of the best plan."""
        self.tree, self.best = tree, node
        self.curve.append((self.seconds, self.tried, float(tree.time[node])))

    def _run(self, is_done: Callable[[], bool], time_limit: float, iterations: int | None) -> None:
        start_time, max_tried = time.perf_counter(), self.tried + (iterations or 0)
        search_start = start_time - self.seconds
        try:
            while not is_done() and not self.problem.infeasible:
                self.timed_out = time.perf_counter() - start_time > time_limit
                if self.timed_out or (iterations is not None and self.tried >= max_tried):
                    break
                self._round(search_start)
        finally:
            self.seconds = time.perf_counter() - search_start

    def _round(self, search_start: float) -> None:
        """Runs one round of the planner.

        Args:
            search_start: time at which the search began [s].
        """
        rollouts, tree = self.problem.rollouts, self._growing_tree
        if self.arrived and (tree is self.tree or len(tree) > _EFFORT.max_nodes):
            tree = self._growing_tree = self._new_tree(np.inf)
        if self.arrived:
            # Better than the best plan, which may have been polished, by at least one check.
            cost = float(self.tree.cost[self.best])
            tree.bound = min(tree.bound, cost - 0.5 * rollouts.options.interval)
        planner_round = self._planner(tree, rollouts, self._rng)
        self.tried += planner_round.rollouts
        if not len(planner_round.nodes):
            return
        new_nodes = slice(planner_round.nodes.start, planner_round.nodes.stop)
        tree.distance[new_nodes][tree.time[new_nodes] > self.problem.max_duration + _TIME_ERROR] = (
            np.inf
        )
        node = _best(tree, planner_round.nodes, rollouts.stop_distance)
        at_goal = tree.distance[node] <= rollouts.stop_distance and tree.cost[node] <= tree.bound
        is_nearer = not self.arrived and tree.distance[node] < self.tree.distance[self.best]
        if not (at_goal or is_nearer):
            return
        # A plan between stop distance and tolerance is a plan if the search ends with it.
        if tree.distance[node] <= self.problem.tolerance and not self._confirmed(tree, node):
            return
        if at_goal:
            self.seconds, self.polished = time.perf_counter() - search_start, None
            self._adopt(tree, node)
        else:
            self.best = node

    def _confirmed(self, tree: SearchTree, node: int) -> bool:
        """Whether a second simulation confirms the plan to a node; if not, it is discarded."""
        if not self.options.confirm:
            return True
        check = confirm_plan(self._path(tree, node))
        if check.arrives:
            return True
        self.fault = check.fault
        tree.distance[node] = np.inf
        self.refused += 1
        return False

    def _path(self, tree: SearchTree, node: int) -> PlanPath:
        return PlanPath(self.problem, tree, tuple(tree.path(node)))

    def _new_tree(self, bound: float) -> SearchTree:
        problem = self.problem
        n_vK = problem.marionette.coordinates.n_vK
        return SearchTree(problem.root, problem.distance, n_vK, bound, self.objective)


def _best(tree: SearchTree, nodes: range, stop_distance: float) -> int:
    """The node of lowest cost among those at the goal; if there are none, the nearest node."""
    distance = np.nan_to_num(tree.distance[nodes.start : nodes.stop], nan=np.inf)
    at_goal = np.flatnonzero(distance <= stop_distance)
    if len(at_goal):
        return nodes[int(at_goal[np.argmin(tree.cost[nodes.start + at_goal])])]
    return nodes[int(np.argmin(distance))]
