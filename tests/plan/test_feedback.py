"""Feedback along plans: its gains, derivatives, and response to disturbances."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from tests.plan.seeds import first_plan, is_polished, polish_plan

import fantoccini as fan
from fantoccini.base import riccati, tangent
from fantoccini.base.errors import StateError
from fantoccini.control.planning import PlanResult, solve
from fantoccini.control.planning.feedback import Feedback
from fantoccini.control.problems import Problem
from fantoccini.control.problems.derivatives import segment_derivatives, taut_projection
from fantoccini.control.tasks import StateArrays
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.steppers import Stepper
from fantoccini.motion import State


@pytest.fixture(scope="module")
def plan() -> PlanResult:
    """A plan without a time limit. It ends at rest, where the arm hangs."""
    file_problem = fan.control.load_problem("arm3d_boxes")
    arm, obstacles = file_problem.marionette, file_problem.rollouts.clearance.obstacles
    pose = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
    goal = fan.control.Goal.pose(arm, pose, driven_weight=0.5)
    problem = Problem(
        arm,
        file_problem.start,
        goal,
        obstacles,
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005, speed=0.5),
        slack=False,
    )
    return first_plan(problem, is_polished, polish_plan)


@pytest.fixture(scope="module")
def law(plan) -> Feedback:
    return plan.feedback()


def test_gains_are_those_of_least_squares():
    """The same problem is one large least-squares problem in all accelerations."""
    rng = np.random.default_rng(0)
    m, n, k = 7, 5, 2
    A, B = rng.normal(size=(m, n, n)), rng.normal(size=(m, n, k))
    Q, Q_m = np.diag(rng.uniform(0.1, 1.0, n)), np.diag(rng.uniform(1.0, 9.0, n))
    R = np.diag([0.3, 0.7])
    # z_j = start[j] z_0 + by[j] a, with all accelerations in a.
    state_gains, input_gains = [np.eye(n)], [np.zeros((n, m * k))]
    for j in range(m):
        next_gains = A[j] @ input_gains[-1]
        next_gains[:, j * k : (j + 1) * k] += B[j]
        state_gains.append(A[j] @ state_gains[-1])
        input_gains.append(next_gains)
    roots = [np.sqrt(Q)] * m + [np.sqrt(Q_m)]
    rows = np.concatenate([W @ a for W, a in zip(roots, input_gains, strict=True)])
    rows = np.concatenate([rows, np.kron(np.eye(m), np.sqrt(R))])
    offsets = np.concatenate([W @ a for W, a in zip(roots, state_gains, strict=True)])
    offsets = np.concatenate([offsets, np.zeros((m * k, n))])
    solution = -np.linalg.lstsq(rows, offsets, rcond=None)[0]

    z, (gains, P) = np.eye(n), riccati.gains(A, B, Q, R, Q_m)
    residual = rows @ solution + offsets
    np.testing.assert_allclose(
        P[0], residual.T @ residual, rtol=1e-9, atol=1e-9 * np.abs(P[0]).max()
    )
    for j in range(m):
        a = -gains[j] @ z
        np.testing.assert_allclose(
            a, solution[j * k : (j + 1) * k], atol=1e-9 * np.abs(solution).max()
        )
        z = A[j] @ z + B[j] @ a


def test_projected_changes_keep_taut_strings_taut(plan, law):
    """h and hdot change by less than the square of the change."""
    marionette, nodes = plan.problem.marionette, law.nodes
    projections = taut_projection(marionette, nodes, np.ones((len(nodes.q_D), 1), dtype=bool))
    rng, size = np.random.default_rng(1), 1e-4
    for k in range(0, len(projections), 5):
        z = projections[k] @ rng.normal(size=projections.shape[1]) * size
        evaluation = Evaluation.at_state(marionette, state_of_row(plan, nodes[k]))
        changed_evaluation = Evaluation.at_state(
            marionette, state_of_row(plan, changed_row(plan, nodes[k], z))
        )
        squared = float(z @ z)
        assert abs(changed_evaluation.h[0] - evaluation.h[0]) < 5.0 * squared
        assert abs(changed_evaluation.hdot[0] - evaluation.hdot[0]) < 50.0 * squared


def test_derivatives_predict_where_neighbours_end(plan, law):
    """Segments without events, for neighbours with the same active set as the plan's."""
    marionette, rng = plan.problem.marionette, np.random.default_rng(2)
    rollouts = plan.rollouts.with_tolerance(tolerance=-1.0, unbounded=True)
    projections = taut_projection(
        marionette, law.nodes, np.ones((len(law.nodes.q_D), 1), dtype=bool)
    )
    segments_without_catches = np.flatnonzero(plan.tree.catches[list(plan.path[1:])] == 0)
    for k in segments_without_catches[::4]:
        z = projections[k] @ rng.normal(size=projections.shape[1]) * 1e-4
        acceleration_change = rng.normal(size=3) * 1e-4
        start = changed_row(plan, law.nodes[[k]], z)
        end = rollouts.replay(
            start, law.planned_acceleration[k] + acceleration_change, int(law.n_checks[k])
        )
        deviation = law.deviation(law.nodes[k + 1], state_of_row(plan, end[0]))
        predicted = law.A[k] @ z + law.B[k] @ acceleration_change
        assert np.linalg.norm(deviation - predicted) < 0.1 * np.linalg.norm(deviation)


@pytest.mark.parametrize("slack", [0.005, 0.01])
def test_derivatives_include_catches(plan, slack):
    """Compared with the exact derivative through the catch of an arm that falls onto its string."""
    arm, law = plan.problem.marionette, plan.rollouts.laws[0]
    x = state_of_row(plan, StateArrays(law.q_D, np.zeros(4), np.zeros(1), law.q_K, np.zeros(3)))
    x = x.replace(q_K=x.q_K + np.array([0.0, 0.0, slack]))
    options = dataclasses.replace(plan.rollouts.run_options, dt=4e-4, save_every=50)
    A, _ = segment_derivatives(
        arm, StateArrays.of(x), np.zeros((1, 3)), options, 5, difference=1e-3
    )
    exact = fan.dynamics.sensitivity(arm, x, t_end=0.1)
    assert [event.kind.value for event in exact.run.events] == ["catch"]
    relative_error = np.linalg.norm(A[0][:8, :8] - exact.by_x0[-1]) / np.linalg.norm(
        exact.by_x0[-1]
    )
    assert relative_error < 0.05


def test_disturbed_starts_arrive(plan, law):
    """Kicks of half a radian per second in every joint, bounds kept."""
    problem, rng = plan.problem, np.random.default_rng(3)
    distances_by_law = {True: [], False: []}
    for _ in range(20):
        x = plan.start
        kicked = x.replace(v_D=x.v_D + 0.5 * rng.normal(size=len(x.v_D)))
        kicked = problem.marionette.project(kicked)
        for closed, distances in distances_by_law.items():
            run = law.run(kicked, closed=closed)
            distances.append(run.distance)
            assert np.all(np.abs(run.acceleration) <= plan.rollouts.bounds.acceleration + 1e-9)
            assert np.all(np.abs(run.states.v_K) <= plan.rollouts.bounds.speed + 1e-9)
    with_law, without_law = (np.array(distances_by_law[closed]) for closed in (True, False))
    assert np.median(with_law) < np.median(without_law) / 3.0
    assert np.sum(with_law <= plan.tolerance) > np.sum(without_law <= plan.tolerance)
    assert np.mean(with_law <= plan.tolerance) >= 0.6


def test_an_undisturbed_puppet_follows_the_plan(plan, law):
    closed_loop, open_loop = law.run(), law.run(closed=False)
    assert closed_loop.arrives and open_loop.arrives
    # Rounding, and its effects.
    np.testing.assert_allclose(closed_loop.acceleration, law.planned_acceleration, atol=1e-5)
    assert abs(open_loop.distance - plan.distance) < 1e-5
    assert law.run(method="event").arrives


def test_steppers_that_lose_steps_are_followed_to_the_end(plan, law):
    """Stepper motors continue after a loss; the puppet has then not arrived, at any place."""
    arm = plan.problem.marionette

    class LosingStepper(Stepper):
        @property
        def status(self) -> fan.Status:
            return fan.Status.LOST_STEPS

    def stepper(x, method, **options):
        stepper_instance = arm.stepper(x, method, **options)
        stepper_instance.__class__ = LosingStepper
        return stepper_instance

    weak_puppet = SimpleNamespace(coordinates=arm.coordinates, stepper=stepper)
    rollout = law.run(marionette=weak_puppet)
    assert rollout.t[-1] == pytest.approx(plan.start.t + plan.duration)
    assert rollout.distance <= plan.tolerance
    assert rollout.status is fan.Status.LOST_STEPS and not rollout.arrives


def test_without_events_gains_go_by_time(plan, law):
    """If the plan's string is taut all the way, this holds to the last bit."""
    assert np.all(law.active_sets) and not len(law.extensions.offset)
    by_time = plan.feedback(window=0)
    kicked = plan.problem.marionette.project(plan.start.replace(v_D=[0.3, 0.1, 0.0, -0.4]))
    runs = [feedback.run(kicked) for feedback in (law, by_time)]
    np.testing.assert_array_equal(runs[0].acceleration, runs[1].acceleration)


def test_pushes_are_absorbed_and_the_goal_is_held(plan, law):
    def push(t: float) -> np.ndarray:
        return np.array([0.0, 0.01, 0.0, 0.0]) if t < 0.5 else np.zeros(4)

    rollout = law.run(push=push, hold=2.0)
    assert rollout.t[-1] >= plan.duration + 2.0 - 1e-9
    assert rollout.distance < 0.05
    assert law.run(push=push, closed=False).distance > 2.0 * law.run(push=push).distance


def test_ranges_are_kept_for_any_state(plan, law):
    """Large gains, and a distant puppet."""
    strong_law = dataclasses.replace(law, gains=-30.0 * law.gains)
    low, high = plan.rollouts.bounds.low.copy(), plan.rollouts.bounds.high.copy()
    problem, random = plan.problem, np.random.default_rng(0)
    k = problem.marionette.coordinates.q_K.index("hand.length")
    assert low[k] > 0.0 and high[k] == np.inf
    for _ in range(5):
        x = plan.start
        kicked = x.replace(v_D=x.v_D + 2.0 * random.normal(size=len(x.v_D)))
        run = strong_law.run(problem.marionette.project(kicked), hold=3.0)
        assert np.all(run.states.q_K >= low - 1e-9)
        assert np.all(np.abs(run.states.v_K) <= plan.rollouts.bounds.speed + 1e-9)
    ranges = {"hand.x": (0.2, 0.6), "hand.length": (0.4, 1.4)}
    narrow_problem = Problem(
        problem.marionette,
        plan.start,
        plan.goal,
        tolerance=0.25,
        slack=False,
        bounds=fan.control.Bounds(position=ranges),
    )
    narrow_plan = solve(narrow_problem, seed=0)
    law = dataclasses.replace(narrow_plan.feedback(), gains=-30.0 * narrow_plan.feedback().gains)
    q_K = law.run(hold=3.0).states.q_K
    names = problem.marionette.coordinates.q_K
    for name, (lowest, highest) in ranges.items():
        column = q_K[:, names.index(name)]
        assert lowest - 1e-9 <= column.min() and column.max() <= highest + 1e-9
    assert np.ptp(q_K[:, names.index("hand.x")]) > 0.3, "it was pulled to the ends"


def test_invalid_arguments_of_feedback_are_refused(plan, law):
    with pytest.raises(StateError, match="other coordinates"):
        law.run(marionette=fan.puppets.arm2d())
    with pytest.raises(ValueError, match="acceleration is 0"):
        plan.feedback(acceleration=0.0)
    with pytest.raises(ValueError, match="no segment"):
        Feedback.along(dataclasses.replace(plan.plan_path, path=plan.path[:1]))


def state_of_row(plan: PlanResult, row: StateArrays) -> State:
    """One row as a state."""
    rows = plan.problem.marionette.tree.n_rows
    return State(0.0, row.q_D, row.v_D, row.q_K, row.v_K, np.zeros(rows, dtype=bool), row.slip)


def changed_row(plan: PlanResult, row: StateArrays, z: np.ndarray) -> StateArrays:
    """A state, changed by a tangent vector."""
    table = plan.problem.marionette.coordinates
    n, k = table.n_vD, table.n_vK
    q_D, v_D, q_K, v_K = np.split(z, np.cumsum([n, n, k]))
    return StateArrays(
        tangent.moved(table.scalars_D, table.quaternions_D, row.q_D, q_D),
        row.v_D + v_D,
        row.slip,
        tangent.moved(table.scalars_K, table.quaternions_K, row.q_K, q_K),
        row.v_K + v_K,
    )


def test_a_plan_may_be_followed_by_a_rest(plan):
    """The small final speed of a polished plan is removed."""
    arm, inputs = plan.problem.marionette, plan.inputs
    final_speed = np.max(np.abs(inputs.evaluate(inputs.end)[1]))
    assert 0.0 < final_speed < 5e-4
    inputs_and_rest = inputs.then(fan.Input.hold(arm, 0.5))
    assert inputs_and_rest.evaluate(inputs.end)[1].tolist() == [0.0, 0.0, 0.0]
    with_rest = fan.simulate(arm, plan.start, inputs_and_rest, method="timestepping")
    held_by_simulation = fan.simulate(
        arm, plan.start, inputs, t_end=inputs.end + 0.5, method="timestepping"
    )
    np.testing.assert_allclose(with_rest.q_D[-1], held_by_simulation.q_D[-1], atol=1e-9)


def test_plans_begin_at_time_stepped_states(plan):
    """Such a plan is checked event-driven, from the nearest state with exact lengths."""
    problem, arm = plan.problem, plan.problem.marionette
    hold = fan.Input.hold(arm, 0.1)
    x = arm.project(plan.start.replace(v_D=plan.start.v_D + 0.3))
    run = fan.simulate(arm, x, hold, method="timestepping")
    x = next(
        run.state(i)
        for i in range(1, len(run))
        if abs(Evaluation.at_state(arm, run.state(i)).h[0]) > 1e-9
    )
    problem_there = Problem(
        arm,
        x.replace(t=0.0),
        problem.goal,
        problem.rollouts.clearance.obstacles,
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005, speed=0.5),
        slack=False,
    )
    replanned = solve(problem_there, seed=3)
    assert replanned and replanned.verify(method="event").arrives
    assert replanned.feedback().run(method="event").arrives
