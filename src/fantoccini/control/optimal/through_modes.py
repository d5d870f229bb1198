"""Searches through modes: explorations, each tightened, until enough motions hold."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fantoccini.base import OnProgress, Progress, StateError
from fantoccini.control.optimal.attribution import passed_bound
from fantoccini.control.optimal.exploring import Exploration
from fantoccini.control.optimal.hybrid import HybridRuns
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.optimal.tightening import Tightening
from fantoccini.dynamics.compiled import refuse_contact

HOLDS = 1e-3
"""Violation of bounds, and distance from the end, up to which a motion holds [SI]."""

_AGAIN = 2
"""How often an exploration goes on near a motion that was tightened and does not hold."""


class ThroughModes:
    """The best of the motions that several explorations lead to.

    ``task.explore`` explorations are made, and more while none of their motions holds, each with
    random numbers of its own.

    Attributes:
        best: the best motion so far.
        objective: its cost and bounds.

    Args:
        first: where explorations begin.
        runs: makes motions.
        objective: cost and bounds.
        limits: of every tightening, and the time at which all ends.
        seed: of the random numbers.

    Raises:
        StateError: the puppet has contact, or rotations are driven.
    """

    def __init__(
        self, first: Iterate, runs: HybridRuns, objective: Objective, limits: Limits, seed: int
    ):
        marionette = objective.task.marionette
        refuse_contact(marionette, "exploring")
        if rotations := list(marionette.coordinates.rotations):
            raise StateError(
                f"exploring: {', '.join(rotations)} is a driven rotation, through whose catches "
                "motions are not differentiated; needed: scalar driven coordinates"
            )
        self.best, self.objective = first, objective
        self._runs, self._limits, self._seed = runs, limits, seed
        self._first, self._iterations = first.nodes, 0

    def run(self, progress: OnProgress | None = None) -> Iterate:
        """Explores and tightens.

        Args:
            progress: called after every generation and iteration, with the number of all so far.
        """
        task, attempt, held = self.objective.task, 0, 0
        while attempt < task.explore or (not held and not self._is_late):
            held += self._attempt(np.random.default_rng([self._seed, attempt]), progress)
            attempt += 1
            if self._is_late:
                break
        return self.best

    @property
    def _is_late(self) -> bool:
        return time.perf_counter() > self._limits.until

    def _attempt(self, rng: np.random.Generator, progress: OnProgress | None) -> bool:
        """Explores, and again near what does not hold yet; whether a motion holds."""
        objective, before = Objective(self.objective.task), (self.best, self.objective)

        def keep(now: Iterate) -> None:
            now = replace(now, iterations=self._iterations)
            better = self._rank(now) <= self._rank(before[0])
            self.best, self.objective = (now, objective) if better else before

        def count(now: Progress) -> None:
            self._iterations += 1
            keep(now.best)
            if progress is not None:
                best = replace(self.best, iterations=self._iterations)
                progress(replace(now, done=self._iterations, best=best))

        start = self._first
        for i in range(1 + _AGAIN):
            limits, threads = self._limits, self._runs.steps.threads
            explored = Exploration(start, objective, rng, threads, limits.until, near=i > 0)
            drawn = explored.run(count)
            made = None if drawn is None else self._runs.run(drawn.nodes)
            if made is None:
                return False
            ends = self._runs.ends(*made)
            at = Iterate(made[0], ends, objective.cost(made[0], ends))
            found = Tightening(at, self._runs, objective, limits).run(count)
            keep(found)
            if not self._rank(found)[0]:
                return True
            if self._is_late:
                break
            start = found.nodes
        return False

    def _rank(self, at: Iterate) -> tuple[bool, float]:
        """Whether a motion does not hold, and its cost, or what it is away from holding."""
        gap = float(np.max(np.abs(self.objective.end_gap(at.nodes)), initial=0.0))
        away = max(passed_bound(self.objective, at.nodes, at.ends).size, gap)
        return (True, away) if away > HOLDS else (False, at.cost)
