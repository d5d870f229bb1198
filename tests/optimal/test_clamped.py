"""Real-time steps within bounds, compared with the interior point method on the same programs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal import clamped
from fantoccini.control.optimal.clamped import ClampedSteps
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.prediction import Predictions
from fantoccini.control.optimal.quadratic import StageProgram, StageSolver
from fantoccini.control.tasks.nodes import Nodes

TIP_IN_LOWER = (0.3, 0.0, 0.0)
INTERVAL, N, DAMPING = 0.02, 40, 1e-5


def predicted_nodes(arm: fan.Marionette, task: fan.Task, acc_K: np.ndarray | None = None) -> Nodes:
    """The prediction from the task's start."""
    if acc_K is None:
        acc_K = np.zeros((N, arm.coordinates.n_vK))
    prediction = Predictions(arm, 0.01, 1).predict(task.x0, 0.0, INTERVAL, acc_K[None])[0]
    assert prediction is not None
    return prediction[0]


def moving_task(arm: fan.Marionette, shift: float, **bounds: object) -> fan.Task:
    """The tip has to move, after a kick."""
    x0 = arm.project(arm.rest().replace(v_D=[1.0, -1.5]))
    pose = arm.pose(arm.rest(), "lower")
    target = pose[:3, 3] + pose[:3, :3] @ np.array(TIP_IN_LOWER) + [shift, 0.0, 0.0]
    tracks = [
        fan.control.Track.point("lower", target, at=TIP_IN_LOWER, weight=1e3, end_weight=10.0),
        fan.control.Track.velocity("*", weight=1e-2),
    ]
    return fan.Task(
        arm, x0, N * INTERVAL, tracks, bounds=fan.control.Bounds(**bounds), interval=INTERVAL
    )


def step_and_reference(arm: fan.Marionette, task: fan.Task, nodes: Nodes):
    """The step, the program, and its solution by the interior point method."""
    objective, steps = Objective(task), ClampedSteps(arm, 0.01, 1)
    step = steps.solve(objective, nodes, steps.linearise(nodes, True), DAMPING, -1)
    linear = TimeSteps(arm, 0.01, 1).linearise(nodes)
    linear.e[:] = 0.0
    program = objective.program(nodes, linear, DAMPING * objective.unit, 0.0)
    solution = StageSolver(1e-9).solve(program, objective.unit)
    assert solution.solved
    return step, program, solution, objective


def cost_decrease(program: StageProgram, u: np.ndarray) -> float:
    """Decrease of the cost of a program without rows, by the sum over its stages."""
    total, z, previous_u = 0.0, np.zeros(program.A.shape[1]), np.zeros(u.shape[1])
    for i, stage_u in enumerate(u):
        coupling = np.concatenate([previous_u, z]) @ program.cross[i] @ stage_u if i else 0.0
        z = program.A[i] @ z + program.B[i] @ stage_u
        x = np.concatenate([stage_u, z])
        total -= 0.5 * x @ program.H[i] @ x + program.g[i] @ x + coupling
        previous_u = stage_u
    return float(total)


@pytest.mark.parametrize("shift", (0.02, 0.2))
@pytest.mark.parametrize(
    "bounds",
    (
        {},
        {"acceleration": 1.0},
        {"acceleration": 2.0, "speed": 0.1},
        {"acceleration": 3.0, "speed": 0.3, "held": ("hand.length",)},
    ),
)
def test_the_step_is_that_of_the_interior_point_method(arm, shift, bounds):
    task = moving_task(arm, shift, **bounds)
    step, program, solution, objective = step_and_reference(arm, task, predicted_nodes(arm, task))
    _, u, _ = objective.expanded(solution)
    assert step.decrease == pytest.approx(cost_decrease(program, solution.u), rel=1e-5)
    if step.solved:  # else it ended where the cost is flat
        assert step.u == pytest.approx(u, abs=0.02 * np.max(np.abs(u)))
    if "held" in bounds:
        assert np.all(step.u[:, arm.coordinates.v_K.index("hand.length")] == 0.0)
    else:
        assert cost_decrease(program, step.u) == pytest.approx(step.decrease, rel=1e-9)


def test_steps_from_a_motion_in_its_bounds_are_as_good(arm):
    """Inputs of the previous motion are within their bounds, and move away from there."""
    task = moving_task(arm, 0.2, acceleration=2.0, speed=0.15)
    random = np.random.default_rng(3)
    acc_K = np.zeros((N, 2))
    for j in range(2):  # runs into the bound of speed, and back
        sign = random.choice([-1.0, 1.0])
        acc_K[:3, j], acc_K[20:26, j] = sign * 2.0, -sign * 2.0
    nodes = predicted_nodes(arm, task, acc_K)
    step, program, solution, _ = step_and_reference(arm, task, nodes)
    assert step.decrease == pytest.approx(cost_decrease(program, solution.u), rel=1e-4)


def test_every_motion_keeps_its_bounds_with_any_number_of_factorisations(arm, monkeypatch):
    task = moving_task(arm, 0.4, acceleration=2.0, speed=0.3, position={"hand.x": (0.2, 0.52)})
    nodes = predicted_nodes(arm, task)
    column = arm.coordinates.v_K.index("hand.x")
    last_decrease = 0.0
    for factorisations in (1.0, 1.5, 3.0, 20.0):
        monkeypatch.setattr(clamped, "MIN_FACTORISATIONS", factorisations)
        monkeypatch.setattr(clamped, "MAX_FACTORISATIONS", factorisations)
        steps = ClampedSteps(arm, 0.01, 1)
        step = steps.solve(Objective(task), nodes, steps.linearise(nodes, True), DAMPING, -1)
        assert step.stages <= (factorisations + 0.2) * N
        next_nodes = predicted_nodes(arm, task, nodes.acc_K + step.u)
        assert np.all(np.abs(next_nodes.acc_K) <= 2.0 + 1e-9)
        assert np.all(np.abs(next_nodes.v_K) <= 0.3 + 1e-9)
        assert np.all(next_nodes.q_K[:, column] <= 0.52 + 1e-9)
        assert step.decrease >= last_decrease > -1.0
        last_decrease = step.decrease
    assert np.max(next_nodes.q_K[:, column]) > 0.51


def test_soft_bounds_have_their_price(arm):
    unbounded_task = moving_task(arm, 0.2, acceleration=20.0)
    task = moving_task(arm, 0.2, acceleration=20.0, joint={"elbow": (0.2, 1.55)})
    nodes = predicted_nodes(arm, task)
    step, _, solution, objective = step_and_reference(arm, task, nodes)
    _, u, _ = objective.expanded(solution)
    assert np.max(np.abs(u - step_and_reference(arm, unbounded_task, nodes)[0].u)) > 1.0
    assert step.u == pytest.approx(u, abs=0.05 * np.max(np.abs(u)))


def test_bounds_of_jerks_are_kept_by_the_interior_point_method(arm):
    task = moving_task(arm, 0.02, acceleration=20.0, jerk=200.0)
    nodes = predicted_nodes(arm, task)
    step, _, solution, _ = step_and_reference(arm, task, nodes)
    jumps = np.diff(nodes.acc_K + step.u, axis=0, prepend=0.0)
    assert np.max(np.abs(jumps)) < 200.0 * INTERVAL + np.max(solution.violation) + 0.02
    assert np.max(np.abs(jumps)) > 3.9


def test_a_tracked_tension_is_part_of_the_program(arm):
    task = moving_task(arm, 0.0, acceleration=5.0)
    tension = float(arm.forward_dynamics(arm.rest()).tension[0])
    tension_track = fan.control.Track.tension("hand", 1.2 * tension, weight=1.0)
    task = replace(task, x0=arm.rest(), tracks=[*task.tracks, tension_track])
    step, _, solution, objective = step_and_reference(arm, task, predicted_nodes(arm, task))
    _, u, _ = objective.expanded(solution)
    assert np.max(np.abs(u)) > 0.1
    assert step.u == pytest.approx(u, abs=2e-3)


def test_a_program_similar_to_the_previous_one_needs_less_work(arm):
    task = moving_task(arm, 0.2, acceleration=1.0)
    nodes = predicted_nodes(arm, task)
    steps = ClampedSteps(arm, 0.01, 1)
    objective = Objective(task)
    slopes = steps.linearise(nodes, True)
    first = steps.solve(objective, nodes, slopes, DAMPING, -1)
    repeated = steps.solve(objective, nodes, slopes, DAMPING, 0)
    assert first.solved and repeated.solved
    assert repeated.iterations == 1 < first.iterations
    assert repeated.u == pytest.approx(first.u, abs=1e-6)
