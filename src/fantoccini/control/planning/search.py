"""A search: a first plan, then better ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.control.planning.check import confirmed
from fantoccini.control.planning.options import SearchOptions
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.planning.polish import Polish, Polisher, PolishStatus
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Objective, Problem
from fantoccini.kernel.runtime import Segments


@dataclass(frozen=True)
class _Effort:
    """How a search spreads its effort."""

    max_nodes: int = 20_000
    """Nodes of a tree that looks for a better plan before another replaces it."""
    first_growth: float = 0.15
    """Part of the time for improvement in which trees grow before a plan is polished."""
    later_growth: float = 0.1
    """Part in which they grow again after every attempt to polish one."""


_EFFORT = _Effort()


@dataclass(frozen=True, eq=False)
class SearchRecord:
    """What a search has found so far.

    Attributes:
        tree: that holds the best plan.
        best: its node: the plan's end, or the nearest to the goal while there is no plan.
        tried: rollouts simulated.
        seconds: spent searching [s].
        curve: (seconds, rollouts, duration) of every plan that was the best, in order. A polished
            plan is nearer to the goal, but may be longer than the one before it.
        random_state: of the random choices to come, as plain data.
        late: whether a time limit ended the search or its last part.
        refused: plans that arrive by the time-stepper, but do not hold in simulation.
        polished: the outcome of polishing the best plan; None where it was not attempted.
    """

    tree: SearchTree
    best: int
    tried: int
    seconds: float
    curve: tuple[tuple[float, int, float], ...]
    random_state: Mapping[str, Any]
    late: bool
    refused: int
    polished: Polish | None


class Search:
    """A tree that grows until it holds a plan, then trees in which plans must cost less.

    Better plans are found as in AO-x (Hauser and Zhou 2016): after each plan a new tree begins at
    the start, with the plan's cost as a bound; nodes that cannot end below it are left out.

    Attributes:
        problem, options: see below.
        objective: cost of plans: the options', or else the problem's.
        tree, best, tried, seconds, curve, late, refused, polished: see :class:`SearchRecord`.
        fault: why the last plan was refused, in words; empty where none was.

    Args:
        problem: what is planned.
        options: of the search; whoever calls its methods keeps the time limits.
    """

    def __init__(self, problem: Problem, options: SearchOptions):
        self.problem, self.options = problem, options
        given = options.objective
        self.objective = problem.objective if given is None else Objective.of(given)
        self.tree, self.best, self.tried, self.seconds = self._fresh(np.inf), 0, 0, 0.0
        self.late, self.refused = False, 0
        self.polished: Polish | None = None
        self.fault = ""
        self.curve: list[tuple[float, int, float]] = []
        self._planner = options.planner_round
        self._rng = np.random.default_rng(options.seed)
        self._growing = self.tree
        if self.arrived:
            self.curve.append((0.0, 0, 0.0))

    @property
    def arrived(self) -> bool:
        """Whether there is a plan."""
        return bool(self.tree.distance[self.best] <= self.problem.rollouts.stop_distance)

    @property
    def record(self) -> SearchRecord:
        """What was found so far."""
        return SearchRecord(
            self.tree,
            self.best,
            self.tried,
            self.seconds,
            tuple(self.curve),
            self._rng.bit_generator.state,
            self.late,
            self.refused,
            self.polished,
        )

    def restore(self, record: SearchRecord) -> None:
        """Goes back to a record; a tree in which no plan was found yet is lost."""
        self.tree, self._growing, self.best = record.tree, record.tree, record.best
        self.tried, self.seconds, self.curve = record.tried, record.seconds, list(record.curve)
        self.late, self.refused, self.polished = record.late, record.refused, record.polished
        self._rng.bit_generator.state = record.random_state

    def find_first(self, time_limit: float, iterations: int | None = None) -> None:
        """Searches for a first plan, within a time limit [s] and a number of rollouts."""
        self._run(lambda: self.arrived, time_limit, iterations)

    def find_better(self, time_limit: float, iterations: int | None = None) -> None:
        """Searches for plans that cost less, for a time [s] and a number of rollouts."""
        self._run(lambda: False, time_limit, iterations)

    def improve(self, seconds: float, distance: float) -> None:
        """Searches for better plans, and polishes one.

        Args:
            seconds: how long.
            distance: from the goal that is near enough.
        """
        until = time.perf_counter() + seconds
        if self.problem.touches.expected:
            self.find_better(seconds)
            self.polished = Polish(PolishStatus.MAY_TOUCH, distance)
            return
        self.find_better(_EFFORT.first_growth * seconds)
        if self.problem.goal.function is not None:
            self.polished = Polish(PolishStatus.UNKNOWN_GOAL, distance)
            return
        if self.best == 0:
            self.polish(distance, 0.0)
            return
        polished = tried = None
        self.polished = Polish(PolishStatus.TIMEOUT, distance)
        try:
            while (left := until - time.perf_counter()) > 0.0:
                if (self.tree, self.best) != tried and self.polish(distance, left, left):
                    polished = self.tree, self.best, self.polished
                tried = self.tree, self.best
                # Another plan that costs less may be brought to the goal too.
                left = until - time.perf_counter()
                self.find_better(min(left, _EFFORT.later_growth * seconds))
        finally:
            if polished is not None and (self.tree, self.best) != polished[:2]:
                self._adopt(*polished[:2])
            if polished is not None:
                self.polished = polished[2]
            elif self.polished is None:  # a plan that was found last has not been tried
                self.polished = Polish(PolishStatus.TIMEOUT, distance)

    def polish(self, distance: float, seconds: float, limit: float = np.inf) -> bool:
        """Brings the end of the best plan nearer to the goal, and makes it shorter.

        It may last longer than before where it comes no nearer otherwise.

        Args:
            distance: from the goal that is near enough.
            seconds: how long to make it shorter, once it is there.
            limit: time after which polishing is abandoned if it is not [s].

        Returns:
            Whether a plan came so near; it is the best then.

        Raises:
            ValueError: the goal is a function, something may touch, or the distance is not greater
                than 0.
        """
        if not distance > 0.0:
            raise ValueError(f"distance is {distance}; it must be greater than 0")
        began, distance = time.perf_counter(), min(distance, self.problem.rollouts.stop_distance)
        plan, found = self._path(self.tree, self.best), []
        if len(plan.path) == 1:
            end = float(self.tree.distance[self.best])
            near = end <= distance
            status = PolishStatus.NO_BETTER if near else PolishStatus.NO_MOTION
            self.polished = Polish(status, distance, end)
            return self.polished.reached
        polisher, status = Polisher(self.problem), PolishStatus.INTERRUPTED
        try:
            shorter = not self.objective.acceleration
            steps = plan.acceleration, plan.looks
            for shortest in polisher(*steps, distance, seconds, limit, shorter=shorter):
                found.append(shortest)
            status = PolishStatus.TIMEOUT if polisher.late else PolishStatus.NOT_NEAR
        finally:
            # What was found when Ctrl-C came is kept: the shortest plan that holds.
            self.seconds += time.perf_counter() - began
            self.late = self.late or seconds > 0.0 or polisher.late
            kept = (self._kept(one, distance) for one in reversed(found))
            held = next((one for one in kept if one is not None), None)
            if found:
                status = PolishStatus.NOT_HELD if held is None else held
            self.polished = polisher.outcome(status, distance)
        return self.polished.reached

    def _kept(self, found: Segments, distance: float) -> PolishStatus | None:
        """Makes a polished plan the best if it is better; None where it does not hold."""
        tree, interval = self.tree, self.problem.rollouts.options.interval
        made = tree.add_segments(found, np.zeros(1, dtype=int), interval)[-1]
        if tree.time[made] > self.problem.longest or not self._confirmed(tree, made):
            return None
        if tree.distance[self.best] > distance or tree.cost[made] < tree.cost[self.best]:
            self._adopt(tree, made)
            return PolishStatus.POLISHED
        return PolishStatus.NO_BETTER

    def _adopt(self, tree: SearchTree, node: int) -> None:
        """Makes a node the end of the best plan."""
        self.tree, self.best = tree, node
        self.curve.append((self.seconds, self.tried, float(tree.time[node])))

    def _run(self, done: Callable[[], bool], time_limit: float, iterations: int | None) -> None:
        began, most = time.perf_counter(), self.tried + (iterations or 0)
        before = began - self.seconds
        try:
            while not done() and not self.problem.infeasible:
                self.late = time.perf_counter() - began > time_limit
                if self.late or (iterations is not None and self.tried >= most):
                    break
                self._round(before)
        finally:
            self.seconds = time.perf_counter() - before

    def _round(self, before: float) -> None:
        """One round of the planner; the search began at ``before``."""
        rollouts, tree = self.problem.rollouts, self._growing
        if self.arrived and (tree is self.tree or len(tree) > _EFFORT.max_nodes):
            tree = self._growing = self._fresh(np.inf)
        if self.arrived:
            # Better by a look at least than the best, which may have been polished.
            cost = float(self.tree.cost[self.best])
            tree.bound = min(tree.bound, cost - 0.5 * rollouts.options.interval)
        grown = self._planner(tree, rollouts, self._rng)
        self.tried += grown.rollouts
        if not len(grown.nodes):
            return
        new = slice(grown.nodes.start, grown.nodes.stop)
        tree.distance[new][tree.time[new] > self.problem.longest] = np.inf
        found = _best(tree, grown.nodes, rollouts.stop_distance)
        there = tree.distance[found] <= rollouts.stop_distance and tree.cost[found] <= tree.bound
        nearer = not self.arrived and tree.distance[found] < self.tree.distance[self.best]
        if not (there or nearer):
            return
        # A plan between stop distance and tolerance counts too, if the search ends with it.
        if tree.distance[found] <= self.problem.tolerance and not self._confirmed(tree, found):
            return
        if there:
            self.seconds, self.polished = time.perf_counter() - before, None
            self._adopt(tree, found)
        else:
            self.best = found

    def _confirmed(self, tree: SearchTree, node: int) -> bool:
        """Whether the plan to a node counts; otherwise the node is set infinitely far away."""
        if not self.options.confirm:
            return True
        check = confirmed(self._path(tree, node))
        if check.arrives:
            return True
        self.fault = check.fault
        tree.distance[node] = np.inf
        self.refused += 1
        return False

    def _path(self, tree: SearchTree, node: int) -> PlanPath:
        return PlanPath(self.problem, tree, tuple(tree.path(node)))

    def _fresh(self, bound: float) -> SearchTree:
        problem = self.problem
        n_vK = problem.marionette.coordinates.n_vK
        return SearchTree(problem.root, problem.distance, n_vK, bound, self.objective)


def _best(tree: SearchTree, nodes: range, stop_distance: float) -> int:
    """The cheapest of the nodes at the goal; without any, the nearest node."""
    distance = np.nan_to_num(tree.distance[nodes.start : nodes.stop], nan=np.inf)
    there = np.flatnonzero(distance <= stop_distance)
    if len(there):
        return nodes[int(there[np.argmin(tree.cost[nodes.start + there])])]
    return nodes[int(np.argmin(distance))]
