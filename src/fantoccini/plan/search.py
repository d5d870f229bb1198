"""A search: a first plan, then better ones."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from fantoccini.arrays import Array
from fantoccini.plan.check import checked
from fantoccini.plan.objective import Objective
from fantoccini.plan.planners import EST2007, Explore, Planner
from fantoccini.plan.polish import Polisher
from fantoccini.plan.problem import Problem
from fantoccini.plan.search_tree import SearchTree
from fantoccini.runtime import Segments

PLANNERS: dict[str, type] = {"explore": Explore, "est-2007": EST2007}
"""Planners by name."""

_CONFIRMED = 1e-8
"""Tolerance of the event-driven runs by which plans are confirmed."""

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
        confirm: whether a plan counts only if it arrives by the event-driven method too.
        objective: what plans are to have little of; the problem's by default.

    Raises:
        ValueError: an unknown planner or objective.
    """

    def __init__(
        self,
        problem: Problem,
        planner: str | Planner = "explore",
        seed: int = 0,
        confirm: bool = False,
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
        self.late = False
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
    ) -> None:
        """Takes up a search where it was left, but for a tree in which no plan was found yet."""
        self.tree, self._growing, self.best, self.late = tree, tree, best, late
        self.tried, self.seconds = tried, seconds
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
        if self.problem.goal.function is not None or self.best == 0:
            return
        polished = tried = None
        try:
            while (left := until - time.perf_counter()) > 0.0:
                if (self.tree, self.best) != tried and self.polish(distance, left, left):
                    polished = self.tree, self.best
                tried = self.tree, self.best
                # Another plan that costs less may be brought to the goal too.
                self.better(min(until - time.perf_counter(), _AGAIN * seconds))
        finally:
            if polished is not None and (self.tree, self.best) != polished:
                self._adopt(*polished)

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
        path, found = self.tree.path(self.best), None
        if len(path) == 1:
            return bool(self.tree.distance[self.best] <= distance)
        steps = self.tree.acceleration[path[1:]], self.tree.looks[path[1:]]
        shorter, there = not self.objective.effort, False
        try:
            ways = Polisher(self.problem)(*steps, distance, seconds, limit, shorter=shorter)
            for shortest in ways:
                found = shortest
        finally:
            # What was found when Ctrl-C came is kept.
            self.seconds += time.perf_counter() - began
            if found is not None:
                there = self._keep(found, distance)
        return there

    def _keep(self, found: Segments, distance: float) -> bool:
        """Whether a polished plan holds; it is the best then, unless that is as good already."""
        tree, interval = self.tree, self.problem.motions.interval
        made = tree.add_segments(found, np.zeros(1, dtype=int), interval)[-1]
        if self.confirm and not self._arrives(tree, made):
            tree.distance[made] = np.inf
            return False
        if tree.distance[self.best] > distance or tree.cost[made] < tree.cost[self.best]:
            self._adopt(tree, made)
        return True

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
        # A plan at the edge of the tolerance is one too, where the search ends with it.
        near = tree.distance[found] <= self.problem.tolerance
        if near and self.confirm and not self._arrives(tree, found):
            tree.distance[found] = np.inf  # it counts as one that is nowhere
        if tree.distance[found] <= motions.inner and tree.cost[found] <= tree.bound:
            self.seconds = time.perf_counter() - before
            self._adopt(tree, found)
        elif not self.arrived and tree.distance[found] < self.tree.distance[self.best]:
            self.best = found

    def _arrives(self, tree: SearchTree, node: int) -> bool:
        """Whether the plan to a node arrives when its events are located."""
        path = tree.path(node)
        return checked(
            self.problem, tree, path, method="event", rtol=_CONFIRMED, atol=_CONFIRMED
        ).arrives

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
