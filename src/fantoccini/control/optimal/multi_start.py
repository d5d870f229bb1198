"""Multi-start search: random explorations, each refined to a local optimum.

An exploration is a search with random motions, through slack and taut strings. A node is a time at
which the inputs may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fantoccini.base import OnProgress, Progress, StateError
from fantoccini.control.optimal.attribution import largest_bound_violation
from fantoccini.control.optimal.exploring import Exploration
from fantoccini.control.optimal.hybrid import HybridRuns
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.optimal.trust_region import TrustRegionSearch
from fantoccini.dynamics.compiled import refuse_contact

MAX_RESIDUAL = 1e-3
"""Largest violation of bounds and error at the end of a valid motion [SI units]."""

_MAX_REPETITIONS = 2
"""Number of repetitions of an exploration near a refined motion that is not valid."""


class MultiStartSearch:
    """A search for the best of the motions from several explorations.

    It makes ``task.explore`` explorations with different random numbers, and more until a motion is
    valid: it keeps its bounds and reaches the end.

    Attributes:
        best: the best motion so far.
        objective: cost and bounds, scaled for that motion.

    Args:
        first: start of explorations.
        runs: simulates motions.
        objective: cost and bounds.
        limits: limits of every refinement, and the time at which the search ends.
        seed: seed of the random numbers.

    Raises:
        StateError: the puppet has contact or driven rotations.
    """

    def __init__(
        self, first: Iterate, runs: HybridRuns, objective: Objective, limits: Limits, seed: int
    ):
        marionette = objective.task.marionette
        refuse_contact(marionette, "exploring")
        if rotations := list(marionette.coordinates.rotations):
            raise StateError(
                f"exploring: {', '.join(rotations)} is a driven rotation, so that catches have "
                "no derivatives; needed: scalar driven coordinates"
            )
        self.best, self.objective = first, objective
        self._runs, self._limits, self._seed = runs, limits, seed
        self._first, self._iterations = first.nodes, 0

    def run(self, progress: OnProgress | None = None) -> Iterate:
        """The best motion of all attempts.

        Args:
            progress: called after every generation and iteration, with their total number.
        """
        task, attempt, n_valid = self.objective.task, 0, 0
        while attempt < task.explore or (not n_valid and not self._is_late):
            n_valid += self._attempt(np.random.default_rng([self._seed, attempt]), progress)
            attempt += 1
            if self._is_late:
                break
        return self.best

    @property
    def _is_late(self) -> bool:
        return time.perf_counter() > self._limits.deadline

    def _attempt(self, rng: np.random.Generator, progress: OnProgress | None) -> bool:
        """Explores and refines, repeatedly if needed; returns whether a valid motion was found."""
        objective, previous = Objective(self.objective.task), (self.best, self.objective)

        def keep_better(motion: Iterate) -> None:
            motion = replace(motion, iterations=self._iterations)
            is_better = self._rank(motion) <= self._rank(previous[0])
            self.best, self.objective = (motion, objective) if is_better else previous

        def count_iteration(report: Progress) -> None:
            self._iterations += 1
            keep_better(report.best)
            if progress is not None:
                best = replace(self.best, iterations=self._iterations)
                progress(replace(report, done=self._iterations, best=best))

        start = self._first
        for i in range(1 + _MAX_REPETITIONS):
            limits, threads = self._limits, self._runs.steps.threads
            exploration = Exploration(
                start, objective, rng, threads, limits.deadline, is_near=i > 0
            )
            explored = exploration.run(count_iteration)
            nodes_and_run = None if explored is None else self._runs.run(explored.nodes)
            if nodes_and_run is None:
                return False
            ends = self._runs.ends(*nodes_and_run)
            motion = Iterate(nodes_and_run[0], ends, objective.cost(nodes_and_run[0], ends))
            refined = TrustRegionSearch(motion, self._runs, objective, limits).run(count_iteration)
            keep_better(refined)
            if not self._rank(refined)[0]:
                return True
            if self._is_late:
                break
            start = refined.nodes
        return False

    def _rank(self, iterate: Iterate) -> tuple[bool, float]:
        """(False, cost) of a valid motion, (True, largest residual) of another; lower is better."""
        gap = float(np.max(np.abs(self.objective.end_gap(iterate.nodes)), initial=0.0))
        residual = max(
            largest_bound_violation(self.objective, iterate.nodes, iterate.ends).size, gap
        )
        return (True, residual) if residual > MAX_RESIDUAL else (False, iterate.cost)
