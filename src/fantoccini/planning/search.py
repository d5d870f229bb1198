"""A search: a first plan, then better ones."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from fantoccini.arrays import Array
from fantoccini.planning.check import holds
from fantoccini.planning.objective import Objective
from fantoccini.planning.planners import EST2007, Explore, Planner
from fantoccini.planning.polish import Polish, Polisher, PolishStatus
from fantoccini.planning.problem import Problem
from fantoccini.planning.search_tree import SearchTree
from fantoccini.runtime import Segments

PLANNERS: dict[str, type] = {"explore": Explore, "est-2007": EST2007}
"""Planners by name."""

_LARGEST = 20_000
"""Nodes of a tree that looks for a better plan, before another takes its place."""

_GROWN = 0.15
"""Part of the time for improvements in which new trees are grown; then a plan is polished."""

_AGAIN = 0.1
"""Part in which they are grown on where a plan could not be polished."""


class Search:
    """A tree that grows until it holds a plan, and trees in which plans must cost less.

    Better plans are looked for as AO-x does (Hauser and Zhou 2016): a new tree begins at the start
    whenever a plan was found, with its cost as a bound; what cannot end below it is left out.

    Attributes:
        problem: what is planned.
        planner_name: empty where the planner has none.
        confirm, objective: see below.
        refused: plans that arrive by the time-stepper, but do not hold event-driven.
        polished: what came of polishing the best plan; None where that was not asked.
        tree: the one that holds the best plan; the only one as long as there is none.
        best: the node where that ends: the nearest to the goal as long as none is there.
        tried: motions that were tried.
        seconds: that the search has taken [s].
        late: whether the time limit ended it.
        curve: (seconds, motions, time of the plan) of every plan that was the best, the last one
            is; a polished one is nearer to the goal, but may be longer than the one before it.

    Args:
        problem: what is planned.
        planner: a name of ``PLANNERS``, or one round of a planner.
        seed: of all random choices.
        confirm: whether a plan counts only if it arrives by the event-driven method too; the search
            goes on where it does not.
        objective: what plans are to have little of; the problem's by default.

    Raises:
        ValueError: an unknown planner or objective.
    """

    def __init__(
        self,
        problem: Problem,
        planner: str | Planner = "explore",
        seed: int = 0,
        confirm: bool = True,
        objective: str | Objective | None = None,
    ):
        self.planner_name = planner if isinstance(planner, str) else ""
        if isinstance(planner, str):
            if planner not in PLANNERS:
                names = ", ".join(PLANNERS)
                raise ValueError(f"planner is {planner!r}; it must be one of {names}")
            planner = PLANNERS[planner]()
        self.problem, self.planner, self.confirm = problem, planner, confirm
        self.objective = problem.objective if objective is None else Objective.of(objective)
        self.tree, self.best, self.tried, self.seconds = self._fresh(np.inf), 0, 0, 0.0
        self.late, self.refused = False, 0
        self.polished: Polish | None = None
        self.curve: list[tuple[float, int, float]] = []
        self._rng = np.random.default_rng(seed)
        self._growing = self.tree
        if self.arrived:
            self.curve.append((0.0, 0, 0.0))

    @property
    def arrived(self) -> bool:
        """Whether there is a plan."""
        return bool(self.tree.distance[self.best] <= self.problem.motions.inner)

    @property
    def random_state(self) -> dict:
        """Of the random choices to come, as plain data."""
        return self._rng.bit_generator.state

    def restore(
        self,
        tree: SearchTree,
        best: int,
        tried: int,
        seconds: float,
        curve: Array,
        random_state: dict,
        late: bool,
        refused: int,
        polished: Polish | None,
    ) -> None:
        """Takes up a search where it was left, but for a tree in which no plan was found yet."""
        self.tree, self._growing, self.best, self.late = tree, tree, best, late
        self.tried, self.seconds, self.refused = tried, seconds, refused
        self.polished = polished
        self.curve = [(float(s), int(n), float(t)) for s, n, t in curve.reshape(-1, 3)]
        self._rng.bit_generator.state = random_state

    def first(self, time_limit: float, iterations: int | None = None) -> None:
        """Looks for a first plan, for so long and with so many motions at most."""
        self._run(lambda: self.arrived, time_limit, iterations)

    def better(self, time_limit: float, iterations: int | None = None) -> None:
        """Looks for plans that cost less, for so long and with so many motions."""
        self._run(lambda: False, time_limit, iterations)

    def improve(self, seconds: float, distance: float) -> None:
        """Looks for better plans, and brings one to the goal.

        Args:
            seconds: for so long.
            distance: from the goal that is near enough.
        """
        until = time.perf_counter() + seconds
        self.better(_GROWN * seconds)
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
                self.better(min(until - time.perf_counter(), _AGAIN * seconds))
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
            distance: that is near enough.
            seconds: how long to make it shorter, once it is there.
            limit: after which it is given up where none comes so near [s].

        Returns:
            Whether a plan came so near; it is the best then.

        Raises:
            ValueError: the goal is a function, or a distance that is none.
        """
        if not distance > 0.0:
            raise ValueError(f"distance is {distance}; it must be greater than 0")
        began, distance = time.perf_counter(), min(distance, self.problem.motions.inner)
        path, found = self.tree.path(self.best), []
        if len(path) == 1:
            status = PolishStatus.NO_MOTION
            if self.tree.distance[self.best] <= distance:
                status = PolishStatus.NO_BETTER
            self.polished = Polish(status, distance, float(self.tree.distance[self.best]))
            return self.polished.reached
        steps = self.tree.acceleration[path[1:]], self.tree.looks[path[1:]]
        polisher, status = Polisher(self.problem), PolishStatus.INTERRUPTED
        try:
            shorter = not self.objective.effort
            for shortest in polisher(*steps, distance, seconds, limit, shorter=shorter):
                found.append(shortest)
            status = PolishStatus.TIMEOUT if polisher.late else PolishStatus.NOT_NEAR
        finally:
            # What was found when Ctrl-C came is kept: the shortest plan that holds.
            self.seconds += time.perf_counter() - began
            kept = (self._kept(one, distance) for one in reversed(found))
            held = next((one for one in kept if one is not None), None)
            if found:
                status = PolishStatus.NOT_HELD if held is None else held
            self.polished = polisher.outcome(status, distance)
        return self.polished.reached

    def _kept(self, found: Segments, distance: float) -> PolishStatus | None:
        """Makes a polished plan the best, if that is not as good; None where it does not hold."""
        tree, interval = self.tree, self.problem.motions.interval
        made = tree.add_segments(found, np.zeros(1, dtype=int), interval)[-1]
        if not self._confirmed(tree, made):
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
            while not done() and not self.problem.hopeless:
                self.late = time.perf_counter() - began > time_limit
                if self.late or (iterations is not None and self.tried >= most):
                    break
                self._round(before)
        finally:
            self.seconds = time.perf_counter() - before

    def _round(self, before: float) -> None:
        """One round of the planner; the search has gone on since ``before``."""
        motions, tree = self.problem.motions, self._growing
        if self.arrived and (tree is self.tree or len(tree) > _LARGEST):
            tree = self._growing = self._fresh(np.inf)
        if self.arrived:
            # Better by a look at least than the best, which may have been polished meanwhile.
            cost = float(self.tree.cost[self.best])
            tree.bound = min(tree.bound, cost - 0.5 * motions.interval)
        grown = self.planner(tree, motions, self._rng)
        self.tried += grown.motions
        if not len(grown.nodes):
            return
        found = _best(tree, grown.nodes, motions.inner)
        there = tree.distance[found] <= motions.inner and tree.cost[found] <= tree.bound
        nearer = not self.arrived and tree.distance[found] < self.tree.distance[self.best]
        if not (there or nearer):
            return
        # A plan at the edge of the tolerance is one too, where the search ends with it.
        if tree.distance[found] <= self.problem.tolerance and not self._confirmed(tree, found):
            return
        if there:
            self.seconds, self.polished = time.perf_counter() - before, None
            self._adopt(tree, found)
        else:
            self.best = found

    def _confirmed(self, tree: SearchTree, node: int) -> bool:
        """Whether the plan to a node counts; one that does not is nowhere."""
        if not self.confirm or holds(self.problem, tree, tree.path(node)):
            return True
        tree.distance[node] = np.inf
        self.refused += 1
        return False

    def _fresh(self, bound: float) -> SearchTree:
        problem = self.problem
        n_vK = problem.marionette.coordinates.n_vK
        return SearchTree(problem.root, problem.distance, n_vK, bound, self.objective)


def _best(tree: SearchTree, nodes: range, inner: float) -> int:
    """Of nodes at the goal the one that costs least, otherwise the nearest."""
    distance = np.nan_to_num(tree.distance[nodes.start : nodes.stop], nan=np.inf)
    there = np.flatnonzero(distance <= inner)
    if len(there):
        return nodes[int(there[np.argmin(tree.cost[nodes.start + there])])]
    return nodes[int(np.argmin(distance))]
