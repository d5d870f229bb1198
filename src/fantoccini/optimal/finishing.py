"""The search that follows a first one: with exact derivatives, or over event-driven runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fantoccini.optimal.hybrid import ExactRuns
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.objective import Objective
from fantoccini.optimal.shooting import EventRuns
from fantoccini.optimal.sqp import SETTINGS, Iterate, Limits, Search
from fantoccini.optimal.through_modes import HOLDS

COARSE = 0.02
"""Cost tolerance of the first of two searches, which gets half of the iterations."""

_SAME_COST = 1e-6
"""Relative difference up to which costs count as equal."""
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


def finer(
    runs: EventRuns, at: Iterate, objective: Objective, limits: Limits
) -> tuple[EventRuns, Search]:
    """The search that goes on from a motion of a first one with derivatives of time steps.

    Where a tension or a force is at its bound, and where drives follow commands, it takes exact
    ones, if there are any: those of time steps are not those of tensions just after nodes, nor of
    stiff drives.
    """
    if limits.iterations > 0 and time.perf_counter() < limits.until:
        exactly = ExactRuns(runs.steps, runs.chosen)
        has_drives = bool(runs.steps.marionette.coordinates.commands)
        wanted = has_drives or objective.rows.pulls_bind(at.nodes, at.ends)
        if wanted and exactly.has(at.nodes, at.ends):
            again = Iterate(at.nodes, at.ends, at.cost, iterations=at.iterations, force=at.force)
            return exactly, Search(again, exactly, objective, limits)
    is_over = at.kkt <= limits.tolerance or at.stalled
    if is_over or (at.settled and limits.cost_tolerance >= COARSE):
        limits = replace(limits, iterations=0)
    else:
        at.settled = False
    return runs, Search(at, runs, objective, limits)


def is_worse(at: Iterate, before: Iterate, objective: Objective) -> bool:
    """Whether a motion misses more than one before it, or costs more where both hold."""
    missed, allowed = (
        float(np.max(np.abs(objective.gap(one.nodes)), initial=0.0))
        + objective.violation(one.nodes, one.ends)
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
