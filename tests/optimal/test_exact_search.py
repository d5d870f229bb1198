"""Searches with the derivatives of event-driven runs, through catches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.hybrid import ExactRuns
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.nodes import Nodes

pytestmark = pytest.mark.slow

TIP = (0.3, 0.0, 0.0)


def reaching(arm: fan.Marionette, x0: fan.State) -> fan.Task:
    """The tip rises by 3 cm and stays there, with little motion."""
    pose = arm.pose(arm.rest(), "lower")
    goal = pose[:3, 3] + pose[:3, :3] @ np.array(TIP) + np.array([0.0, 0.0, 0.03])
    tracks = [
        fan.control.Track.point("lower", goal, at=TIP, weight=100.0, end_weight=100.0),
        fan.control.Track.velocity("*", 0.0, weight=0.1, end_weight=1.0),
    ]
    return fan.Task(arm, x0, 0.8, tracks, fan.control.Smooth(1e-3, 1e-6), interval=0.05)


def test_the_gradient_through_catches_is_that_of_differences(arm: fan.Marionette):
    """J by accelerations and by the length of the intervals, along a run with two catches."""
    values = {"shoulder": -0.2, "elbow": 0.6, "hand.length": 0.95, "v:elbow": 0.5}
    x0 = arm.project(arm.state(values | {"v:shoulder": -0.3}))
    task = reaching(arm, x0)
    pull = fan.control.Track.tension("hand", 2.0, weight=0.01)
    task = replace(task, duration=(0.6, 1.0), tracks=[*task.tracks, pull])
    free_parameters = ChosenParameters(arm, x0, {})
    runs = ExactRuns(TimeSteps(arm, 0.005, 1, free_parameters), free_parameters)
    objective = Objective(task)
    acc = np.zeros((16, 2))
    acc[:, arm.coordinates.v_K.index("hand.length")] = [-5] * 5 + [6] * 8 + [0] * 3
    initial_nodes = replace(Nodes.constant(arm, x0, 0.8, 16), acc_K=acc)

    def cost(nodes: Nodes) -> float:
        nodes_and_run = runs.run(nodes)
        assert nodes_and_run is not None
        return objective.cost(nodes_and_run[0], runs.ends(*nodes_and_run))

    nodes_and_run = runs.run(initial_nodes)
    assert nodes_and_run is not None
    catches = [
        event for event in nodes_and_run[1].events if event.kind is fan.motion.EventKind.CATCH
    ]
    assert len(catches) >= 2
    nodes, ends = nodes_and_run[0], runs.ends(*nodes_and_run)
    program = objective.program(nodes, runs.linearise(nodes, ends), 0.0, 0.0)
    assert not runs.reasons
    costate = np.zeros(program.A.shape[1])
    slopes = np.zeros((16, program.B.shape[2]))
    for i in reversed(range(16)):
        k = program.B.shape[2]
        costate = costate + program.g[i, k:]
        slopes[i] = program.g[i, :k] + costate @ program.B[i]
        costate = costate @ program.A[i]
    step = 1e-4
    for i in (0, 4, 9, 13):
        for j in range(2):
            change = np.zeros_like(acc)
            change[i, j] = step
            shifted_costs = [
                cost(replace(initial_nodes, acc_K=acc + s * change)) for s in (1.0, -1.0)
            ]
            slope = (shifted_costs[0] - shifted_costs[1]) / (2.0 * step)
            assert slopes[i, j] == pytest.approx(slope, abs=1e-6 * np.max(np.abs(slopes)))
    costs_of_lengths = [cost(replace(initial_nodes, interval=0.05 + s * 1e-6)) for s in (1.0, -1.0)]
    slope = (costs_of_lengths[0] - costs_of_lengths[1]) / 2e-6
    assert slopes[0, -1] == pytest.approx(slope, rel=1e-5)


def test_it_ends_at_the_optimum_of_the_run_itself(arm: fan.Marionette):
    task = reaching(arm, arm.rest())
    with_time_steps = fan.optimise(task, cost_tolerance=0.0)
    best = fan.optimise(task, cost_tolerance=0.0, exact=True)
    assert best.status is fan.control.AnswerStatus.SOLVED
    assert best.cost < with_time_steps.cost
    # At the optimum of the run, its cost rises with the square of any change.
    random = np.random.default_rng(0)
    free_parameters = ChosenParameters(arm, task.x0, {})
    runs = ExactRuns(TimeSteps(arm, 0.005, 1, free_parameters), free_parameters)
    objective = Objective(task)
    for _ in range(5):
        u = random.normal(size=best.nodes.acc_K.shape)
        costs = []
        for size in (-1e-2, 1e-2, -2e-2, 2e-2):
            nodes_and_run = runs.run(replace(best.nodes, acc_K=best.nodes.acc_K + size * u))
            assert nodes_and_run is not None
            costs.append(objective.cost(nodes_and_run[0], runs.ends(*nodes_and_run)) - best.cost)
        assert min(costs) > 0.0
        assert abs(costs[1] - costs[0]) < 0.05 * (costs[1] + costs[0])
        assert costs[2] + costs[3] == pytest.approx(4.0 * (costs[0] + costs[1]), rel=0.05)


def test_inputs_off_their_bounds_have_no_slope_and_the_others_push_outwards():
    puppet = fan.loads("""
puppet: cart
bodies:
- {name: cart, joint: {type: translation, axes: [x], driven: true}}
- {name: rod, parent: cart, joint: {type: revolute, axis: [0, -1, 0]}, mass: 1.0,
   com: [0, 0, -0.8], inertia: [0.1, 0.1, 0.01]}
""")
    end_values = {"cart.x": 1.0, "rod": 0.0}
    tracks = [
        *(
            fan.control.Track.coordinate(n, q, weight=0.0, end_weight=100.0)
            for n, q in end_values.items()
        ),
        *(fan.control.Track.velocity(n, weight=0.0, end_weight=100.0) for n in end_values),
    ]
    bounds = fan.control.Bounds(acceleration=2.0)
    task = fan.Task(
        puppet, puppet.state(), 2.0, tracks, fan.control.Smooth(1.0, 0.0), bounds, interval=0.1
    )
    best = fan.optimise(task, tolerance=1e-9, cost_tolerance=0.0, threads=1, exact=True)
    assert best.status is fan.control.AnswerStatus.SOLVED

    def cost(u: np.ndarray) -> float:
        inputs = replace(best.nodes, acc_K=u[:, None]).inputs()
        run = fan.simulate(puppet, task.x0, inputs, 2.0)
        end_residual = [run.q_K[-1, 0] - 1.0, run.v_K[-1, 0], run.q_D[-1, 0], run.v_D[-1, 0]]
        return 0.5 * 0.1 * float(u @ u) + 50.0 * float(np.square(end_residual).sum())

    u, h = best.nodes.acc_K[:, 0], 1e-4
    assert cost(u) == pytest.approx(best.cost, rel=1e-12)
    slope = np.array([cost(u + h * e) - cost(u - h * e) for e in np.eye(len(u))]) / (2.0 * h)
    distances = np.where(slope < 0.0, 2.0 - u, 2.0 + u)
    assert np.sum(distances < 1e-6) == 4
    assert np.max(np.abs(slope * distances)) < 1e-8


def test_driven_rotations_are_refused():
    puppet = fan.puppets.marionette_bar()
    if not puppet.coordinates.rotations:
        pytest.skip("its bar does not turn")
    task = fan.Task(puppet, puppet.rest(), 0.1, [fan.control.Track.velocity("*", 0.0)])
    with pytest.raises(fan.errors.StateError, match="scalars"):
        fan.optimise(task, exact=True)
