"""Searches in turn: by time steps, by exact derivatives, over event-driven runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fantoccini.optimal.attribution import passed_bound
from fantoccini.optimal.drawn_inputs import Driven
from fantoccini.optimal.hybrid import ExactRuns
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.objective import Objective
from fantoccini.optimal.shooting import EventRuns
from fantoccini.optimal.sqp import SETTINGS, Iterate, Limits, Search, merit
from fantoccini.optimal.through_modes import HOLDS

COARSE = 0.02
"""Cost tolerance of the first of two searches, which gets half of the iterations."""

_SAME_COST = 1e-6
"""Relative difference up to which costs count as equal."""
_PUSH = 1e-3
"""Change of the accelerations by which a solved motion is tried, relative to the largest."""
_PUSHES = 3
"""Solved motions, at most, beside which the search goes on."""
_PUSH_ITERATIONS = 8
_LOWER = 1e-4
"""Relative decrease of the cost from which a motion beside a solved one is lower."""
_CONFIRM = 60.0
"""Time that an event-driven run of the answer has at least [s]."""
_RUNS_LEFT = 20.0
"""Event-driven runs for which there must be time to improve the answer by them."""


def iterate(runs: EventRuns, nodes: Nodes, objective: Objective) -> Iterate | None:
    """The motion of the nodes' inputs; None where there is none."""
    made = runs.run(nodes)
    if made is None:
        return None
    ends = runs.ends(*made)
    return Iterate(made[0], ends, objective.cost(made[0], ends))


def to_minimum(
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits,
    note: Callable[[Iterate], None],
) -> tuple[EventRuns, Iterate]:  # fmt: skip
    """The search for a local minimum: by time steps, by exact derivatives, and from beside it.

    Driven rotations have no exact derivatives.
    """
    rotates = bool(objective.task.marionette.coordinates.rotations)
    is_fine = rotates or isinstance(runs, ExactRuns)
    finer = runs if is_fine else ExactRuns(runs.steps, runs.chosen)
    solved = None
    for pushes in range(1 + _PUSHES):
        if not is_fine:
            at = _coarsely(runs, at, objective, limits, note)
        at = _finely(finer, at, objective, limits, note)
        if at.kkt > limits.tolerance:
            break
        solved = at
        if pushes == _PUSHES:
            break
        beside = lower_beside(runs, at, objective, limits.until)
        if beside is None:
            break
        at = replace(beside, iterations=at.iterations, stationarity=np.inf)
    if solved is not None and at.kkt > limits.tolerance and is_worse(at, solved, objective):
        at = replace(solved, iterations=at.iterations)
    return finer, at


def _coarsely(
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits,
    note: Callable[[Iterate], None],
) -> Iterate:  # fmt: skip
    """The search by derivatives of time steps, for half of the iterations that are left.

    Where they do not predict what steps gain, it ends earlier.
    """
    some = (limits.iterations - at.iterations + 1) // 2
    tolerance = max(limits.cost_tolerance, COARSE)
    limits = replace(
        limits, cost_tolerance=tolerance, iterations=some, damping=SETTINGS.calm
    )
    return Search(at, runs, objective, limits).run(note)


def _finely(
    runs: EventRuns, coarse: Iterate, objective: Objective, limits: Limits,
    note: Callable[[Iterate], None],
) -> Iterate:  # fmt: skip
    """The search that goes on with the derivatives of the run itself.

    Those of time steps are off by the order of the steps: what is optimal by them is not.
    """
    start = Iterate(
        coarse.nodes, coarse.ends, coarse.cost, iterations=coarse.iterations, force=coarse.force
    )
    left = replace(limits, iterations=limits.iterations - coarse.iterations)
    at = Search(start, runs, objective, left).run(note)
    if at.kkt > limits.tolerance and is_worse(at, coarse, objective):
        # Its residual by time steps says nothing of the run.
        stationarity = max(coarse.stationarity, at.stationarity)
        at = replace(
            coarse, stationarity=stationarity, solution=at.solution, iterations=at.iterations,
            stalled=at.stalled, settled=at.settled,
        )  # fmt: skip
    return at


def lower_beside(
    runs: EventRuns, at: Iterate, objective: Objective, until: float
) -> Iterate | None:
    """A motion of lower cost to which a search from beside a solved one leads; None without one.

    The conditions of optimality hold at saddles as well, as where all hangs still and first-order
    changes do nothing. Costs count what is left at the end by its multipliers.
    """
    nodes, driven = at.nodes, Driven.of(objective.task)
    noise = np.random.default_rng(0).uniform(-_PUSH, _PUSH, nodes.acc_K.shape)
    noise[:, driven.most == 0.0] = 0.0
    pushed = driven.within((nodes.acc_K + driven.scale * noise)[None], nodes.interval)[0]
    cheap = EventRuns(runs.steps, runs.chosen, until)
    start = iterate(cheap, replace(nodes, acc_K=pushed, run=None), objective)
    if start is None:
        return None
    start.force = at.force
    found = Search(start, cheap, objective, Limits(0.0, 0.0, _PUSH_ITERATIONS, until)).run()
    saved = merit(objective, at, at.force) - merit(objective, found, at.force)
    return found if saved > _LOWER * abs(at.cost) else None


def is_worse(at: Iterate, before: Iterate, objective: Objective) -> bool:
    """Whether a motion misses more than one before it, or costs more where both hold."""
    missed, allowed = (
        float(np.max(np.abs(objective.gap(one.nodes)), initial=0.0))
        + passed_bound(objective, one.nodes, one.ends).size
        for one in (at, before)
    )
    if max(missed, allowed) <= HOLDS:
        return at.cost > before.cost + _SAME_COST * abs(before.cost)
    return missed > max(allowed, HOLDS)


def confirmed(
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits,
    note: Callable[[Iterate], None],
) -> tuple[EventRuns, Iterate]:  # fmt: skip
    """The motion of time steps as an event-driven run, improved where there is time for it.

    The same where the event-driven run does not arrive in time.
    """
    began = time.perf_counter()
    events = EventRuns(runs.steps, runs.chosen, max(limits.until, began + _CONFIRM))
    made = iterate(events, at.nodes, objective)
    if made is None:
        return runs, at
    now = time.perf_counter()
    made = replace(
        at, nodes=made.nodes, ends=made.ends, cost=made.cost, damping=SETTINGS.first_damping,
        stalled=False, settled=False,
    )  # fmt: skip
    if limits.until - now > _RUNS_LEFT * (now - began):
        made = Search(made, events, objective, limits).run(note)
    return replace(events, until=np.inf), made
