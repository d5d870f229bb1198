"""Searches in sequence: with time steps, with exact derivatives, with event-driven runs.

The inputs are the accelerations of the driven coordinates, constant between successive nodes.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fantoccini.base import OnProgress
from fantoccini.control.optimal.attribution import largest_bound_violation
from fantoccini.control.optimal.hybrid import ExactRuns
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.multi_start import MAX_RESIDUAL
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.optimal.sqp import SETTINGS, Iterate, Search, merit
from fantoccini.control.tasks import DrivenConditions, Nodes

COARSE_COST_TOLERANCE = 0.02
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
_CONFIRMATION_TIME = 60.0
"""Smallest time limit of the event-driven run of an answer [s]."""
_MIN_REMAINING_RUNS = 20.0
"""Smallest remaining time for a search by event-driven runs, in durations of one run."""


def iterate(runs: EventRuns, nodes: Nodes, objective: Objective) -> Iterate | None:
    """The motion of the nodes' inputs; None if it cannot be simulated."""
    nodes_and_run = runs.run(nodes)
    if nodes_and_run is None:
        return None
    ends = runs.ends(*nodes_and_run)
    return Iterate(nodes_and_run[0], ends, objective.cost(nodes_and_run[0], ends))


def event_driven_runs(runs: EventRuns, deadline: float = 0.0) -> EventRuns:
    """Event-driven runs of the same puppet, with at least a minute for the first.

    Args:
        runs: runs by any method.
        deadline: earliest deadline, as a time of ``time.perf_counter`` [s].
    """
    deadline = max(deadline, time.perf_counter() + _CONFIRMATION_TIME)
    return EventRuns(runs.steps, runs.free_parameters, deadline)


def search_minimum(
    runs: EventRuns, motion: Iterate, objective: Objective, limits: Limits, progress: OnProgress
) -> tuple[EventRuns, Iterate]:
    """The best motion of searches with time steps, exact derivatives, and perturbed solutions.

    Driven rotations have no exact derivatives.
    """
    has_rotations = bool(objective.task.marionette.coordinates.rotations)
    is_fine = has_rotations or isinstance(runs, ExactRuns)
    exact_runs = runs if is_fine else ExactRuns(runs.steps, runs.free_parameters)
    optimum = None
    for n_restarts in range(1 + _MAX_RESTARTS):
        if not is_fine:
            motion = _search_by_steps(runs, motion, objective, limits, progress)
        motion = _search_exactly(exact_runs, motion, objective, limits, progress)
        if motion.kkt > limits.tolerance:
            break
        optimum = motion
        if n_restarts == _MAX_RESTARTS:
            break
        restarted = restart_from_perturbed(runs, motion, objective, limits.deadline)
        if restarted is None:
            break
        motion = replace(
            restarted,
            iterations=motion.iterations,
            stationarity=np.inf,
            stalled=False,
            settled=False,
        )
    if (
        optimum is not None
        and motion.kkt > limits.tolerance
        and is_worse(motion, optimum, objective)
    ):
        motion = replace(optimum, iterations=motion.iterations)
    return exact_runs, motion


def _search_by_steps(
    runs: EventRuns, motion: Iterate, objective: Objective, limits: Limits, progress: OnProgress
) -> Iterate:
    """The result of a search with derivatives of time steps, by half of the remaining iterations.

    It ends earlier if the derivatives do not predict the decrease of the cost.
    """
    n_iterations = (limits.iterations - motion.iterations + 1) // 2
    tolerance = max(limits.cost_tolerance, COARSE_COST_TOLERANCE)
    limits = replace(
        limits,
        cost_tolerance=tolerance,
        iterations=n_iterations,
        damping=SETTINGS.max_settled_damping,
    )
    return Search(motion, runs, objective, limits).run(progress)


def _search_exactly(
    runs: EventRuns, coarse: Iterate, objective: Objective, limits: Limits, progress: OnProgress
) -> Iterate:
    """The result of a search continued with exact derivatives of the run.

    Derivatives of time steps have errors of the order of the step, and so has their optimum.
    """
    start = Iterate(
        coarse.nodes, coarse.ends, coarse.cost, iterations=coarse.iterations, force=coarse.force
    )
    remaining_limits = replace(limits, iterations=limits.iterations - coarse.iterations)
    motion = Search(start, runs, objective, remaining_limits).run(progress)
    if motion.kkt > limits.tolerance and is_worse(motion, coarse, objective):
        # The residual by time steps does not apply to the run; keep the exact one.
        stationarity = max(coarse.stationarity, motion.stationarity)
        motion = replace(
            coarse,
            stationarity=stationarity,
            solution=motion.solution,
            iterations=motion.iterations,
            stalled=motion.stalled,
            settled=motion.settled,
        )
    return motion


def restart_from_perturbed(
    runs: EventRuns, motion: Iterate, objective: Objective, until: float
) -> Iterate | None:
    """A motion of lower cost, searched from a perturbed solution; None if there is none.

    The conditions of optimality also hold at saddles, for instance if everything hangs still and
    changes have no first-order effect. Costs include the error of the end by its multipliers.
    """
    nodes, driven = motion.nodes, DrivenConditions.from_task(objective.task)
    noise = np.random.default_rng(0).uniform(-_PERTURBATION, _PERTURBATION, nodes.acc_K.shape)
    noise[:, driven.max_acceleration == 0.0] = 0.0
    perturbed = driven.clipped((nodes.acc_K + driven.scale * noise)[None], nodes.interval)[0]
    limited_runs = EventRuns(runs.steps, runs.free_parameters, until)
    start = iterate(limited_runs, replace(nodes, acc_K=perturbed, run=None), objective)
    if start is None:
        return None
    start.force = motion.force
    result = Search(
        start, limited_runs, objective, Limits(0.0, 0.0, _RESTART_ITERATIONS, until)
    ).run()
    saved = merit(objective, motion, motion.force) - merit(objective, result, motion.force)
    return result if saved > _MIN_COST_DECREASE * abs(motion.cost) else None


def is_worse(motion: Iterate, previous: Iterate, objective: Objective) -> bool:
    """Whether a motion violates more than an earlier one, or costs more if both hold."""
    error, error_before = (
        float(np.max(np.abs(objective.gap(candidate.nodes)), initial=0.0))
        + largest_bound_violation(objective, candidate.nodes, candidate.ends).size
        for candidate in (motion, previous)
    )
    if max(error, error_before) <= MAX_RESIDUAL:
        return motion.cost > previous.cost + _SAME_COST * abs(previous.cost)
    return error > max(error_before, MAX_RESIDUAL)


def confirm_event_driven(
    runs: EventRuns, motion: Iterate, objective: Objective, limits: Limits, progress: OnProgress
) -> tuple[EventRuns, Iterate]:
    """The event-driven run of a motion of time steps, improved if there is time for it.

    The motion of time steps is returned if the event-driven run does not arrive in time.
    """
    start_time = time.perf_counter()
    event_runs = event_driven_runs(runs, limits.deadline)
    event_iterate = iterate(event_runs, motion.nodes, objective)
    if event_iterate is None:
        return runs, motion
    end_time = time.perf_counter()
    event_iterate = replace(
        motion,
        nodes=event_iterate.nodes,
        ends=event_iterate.ends,
        cost=event_iterate.cost,
        damping=SETTINGS.first_damping,
        stalled=False,
        settled=False,
    )
    if limits.deadline - end_time > _MIN_REMAINING_RUNS * (end_time - start_time):
        event_iterate = Search(event_iterate, event_runs, objective, limits).run(progress)
    return replace(event_runs, deadline=np.inf), event_iterate
