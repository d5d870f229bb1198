"""Ten seconds with ten tosses are optimised to the end, with every catch kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.optimal import tosses

import fantoccini as fan
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.tasks.chosen_parameters import ChosenParameters

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def optimum() -> fan.control.Optimum:
    return fan.optimise(
        tosses.following_task(fan.loads(tosses.ARM)),
        exact=True,
        cost_tolerance=0.0,
        tolerance=tosses.KKT,
        time_limit=3600.0,  # on a busy machine as well
    )


def test_it_is_solved_with_its_catches(optimum):
    assert optimum.status is fan.control.AnswerStatus.SOLVED and optimum.kkt <= tosses.KKT
    assert tosses.count_catches(optimum.run) >= tosses.TOSSES
    assert optimum.run.t[-1] == tosses.DURATION


def test_no_direction_lowers_the_cost(optimum):
    """Along random changes of the accelerations, finite differences of the cost give a minimum."""
    task, nodes, J = optimum.task, optimum.nodes, optimum.cost
    free_parameters, objective = ChosenParameters(task.marionette, task.x0, {}), Objective(task)
    runs = EventRuns(TimeSteps(task.marionette, task.dt, 1, free_parameters), free_parameters)
    rng = np.random.default_rng(0)

    def cost(change: np.ndarray) -> float:
        nodes_and_run = runs.run(replace(nodes, acc_K=nodes.acc_K + change, run=None))
        assert nodes_and_run is not None
        return objective.cost(nodes_and_run[0], runs.ends(*nodes_and_run))

    for _ in range(5):
        change = rng.standard_normal(nodes.acc_K.shape)
        change *= 1e-4 / np.max(np.abs(change))
        cost_plus, cost_minus = cost(change), cost(-change)
        curvature = cost_plus + cost_minus - 2.0 * J
        assert curvature > 0.0
        # A Newton step along the change would save this amount, a negligible part of the cost.
        assert (cost_plus - cost_minus) ** 2 / (8.0 * curvature) < 1e-6 * J
