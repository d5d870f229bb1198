"""Sequence of searches: with time steps, with exact derivatives, with event-driven runs."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fantoccini.base import OnProgress
from fantoccini.control.optimal.attribution import passed_bound
from fantoccini.control.optimal.hybrid import ExactRuns
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.optimal.sqp import SETTINGS, Iterate, Search, merit
from fantoccini.control.optimal.through_modes import HOLDS
from fantoccini.control.tasks import Driven, Nodes

COARSE = 0.02
"""Cost tolerance of the first of two searches, which gets half of the iterations."""

_SAME_COST = 1e-6
"""Relative difference up to which costs count as equal."""
_PERTURBATION = 1e-3
"""Perturbation of a solution's accelerations before a restart, relative to the largest."""
_MAX_RESTARTS = 3
"""Maximum number of restarts from a perturbed solution."""
_RESTART_ITERATIONS = 8
_MIN_COST_DECREASE = 1e-4
"""Relative decrease of the cost above which the result of a restart is kept."""
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


def search_minimum(
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits, note: OnProgress
) -> tuple[EventRuns, Iterate]:
    """Searches with time steps, with exact derivatives, and from perturbed solutions.

    Driven rotations have no exact derivatives.
    """
    rotates = bool(objective.task.marionette.coordinates.rotations)
    is_fine = rotates or isinstance(runs, ExactRuns)
    finer = runs if is_fine else ExactRuns(runs.steps, runs.chosen)
    solved = None
    for pushes in range(1 + _MAX_RESTARTS):
        if not is_fine:
            at = _search_by_steps(runs, at, objective, limits, note)
        at = _search_exactly(finer, at, objective, limits, note)
        if at.kkt > limits.tolerance:
            break
        solved = at
        if pushes == _MAX_RESTARTS:
            break
        beside = restart_from_perturbed(runs, at, objective, limits.until)
        if beside is None:
            break
        at = replace(
            beside, iterations=at.iterations, stationarity=np.inf, stalled=False, settled=False
        )
    if solved is not None and at.kkt > limits.tolerance and is_worse(at, solved, objective):
        at = replace(solved, iterations=at.iterations)
    return finer, at


def _search_by_steps(
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits, note: OnProgress
) -> Iterate:
    """The search with derivatives of time steps, for at most half of the remaining iterations.

    It ends earlier if the derivatives do not predict the decrease of the cost.
    """
    some = (limits.iterations - at.iterations + 1) // 2
    tolerance = max(limits.cost_tolerance, COARSE)
    limits = replace(limits, cost_tolerance=tolerance, iterations=some, damping=SETTINGS.calm)
    return Search(at, runs, objective, limits).run(note)


def _search_exactly(
    runs: EventRuns, coarse: Iterate, objective: Objective, limits: Limits, note: OnProgress
) -> Iterate:
    """The search continued with exact derivatives of the run.

    Derivatives of time steps have errors of the order of the step, and so has their optimum.
    """
    start = Iterate(
        coarse.nodes, coarse.ends, coarse.cost, iterations=coarse.iterations, force=coarse.force
    )
    left = replace(limits, iterations=limits.iterations - coarse.iterations)
    at = Search(start, runs, objective, left).run(note)
    if at.kkt > limits.tolerance and is_worse(at, coarse, objective):
        # The residual by time steps does not apply to the run; keep the exact one.
        stationarity = max(coarse.stationarity, at.stationarity)
        at = replace(
            coarse,
            stationarity=stationarity,
            solution=at.solution,
            iterations=at.iterations,
            stalled=at.stalled,
            settled=at.settled,
        )
    return at


def restart_from_perturbed(
    runs: EventRuns, at: Iterate, objective: Objective, until: float
) -> Iterate | None:
    """A motion of lower cost, searched from a perturbed solution; None if none is found.

    The conditions of optimality also hold at saddles, for instance where everything hangs still and
    changes have no first-order effect. Costs include the error of the end by its multipliers.
    """
    nodes, driven = at.nodes, Driven.of(objective.task)
    noise = np.random.default_rng(0).uniform(-_PERTURBATION, _PERTURBATION, nodes.acc_K.shape)
    noise[:, driven.most == 0.0] = 0.0
    pushed = driven.within((nodes.acc_K + driven.scale * noise)[None], nodes.interval)[0]
    cheap = EventRuns(runs.steps, runs.chosen, until)
    start = iterate(cheap, replace(nodes, acc_K=pushed, run=None), objective)
    if start is None:
        return None
    start.force = at.force
    found = Search(start, cheap, objective, Limits(0.0, 0.0, _RESTART_ITERATIONS, until)).run()
    saved = merit(objective, at, at.force) - merit(objective, found, at.force)
    return found if saved > _MIN_COST_DECREASE * abs(at.cost) else None


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
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits, note: OnProgress
) -> tuple[EventRuns, Iterate]:
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
        at,
        nodes=made.nodes,
        ends=made.ends,
        cost=made.cost,
        damping=SETTINGS.first_damping,
        stalled=False,
        settled=False,
    )
    if limits.until - now > _RUNS_LEFT * (now - began):
        made = Search(made, events, objective, limits).run(note)
    return replace(events, until=np.inf), made
