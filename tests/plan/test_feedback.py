"""Feedback along plans: its gains, derivatives, and response to disturbances."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from tests.plan.seeds import first_plan, near, polished

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
    read = fan.control.load_problem("arm3d_boxes")
    arm, obstacles = read.marionette, read.rollouts.clearance.obstacles
    pose = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
    goal = fan.control.Goal.pose(arm, pose, driven_weight=0.5)
    problem = Problem(
        arm,
        read.start,
        goal,
        obstacles,
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005, speed=0.5),
        slack=False,
    )
    return first_plan(problem, near, polished)


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
    start, by = [np.eye(n)], [np.zeros((n, m * k))]
    for j in range(m):
        moved = A[j] @ by[-1]
        moved[:, j * k : (j + 1) * k] += B[j]
        start.append(A[j] @ start[-1])
        by.append(moved)
    roots = [np.sqrt(Q)] * m + [np.sqrt(Q_m)]
    rows = np.concatenate([W @ a for W, a in zip(roots, by, strict=True)])
    rows = np.concatenate([rows, np.kron(np.eye(m), np.sqrt(R))])
    right = np.concatenate([W @ a for W, a in zip(roots, start, strict=True)])
    right = np.concatenate([right, np.zeros((m * k, n))])
    best = -np.linalg.lstsq(rows, right, rcond=None)[0]

    z, (gains, P) = np.eye(n), riccati.gains(A, B, Q, R, Q_m)
    residual = rows @ best + right
    np.testing.assert_allclose(
        P[0], residual.T @ residual, rtol=1e-9, atol=1e-9 * np.abs(P[0]).max()
    )
    for j in range(m):
        a = -gains[j] @ z
        np.testing.assert_allclose(a, best[j * k : (j + 1) * k], atol=1e-9 * np.abs(best).max())
        z = A[j] @ z + B[j] @ a


def test_projected_changes_keep_taut_strings_taut(plan, law):
    """h and hdot change by less than the square of the change."""
    marionette, nodes = plan.problem.marionette, law.nodes
    onto = taut_projection(marionette, nodes, np.ones((len(nodes.q_D), 1), dtype=bool))
    rng, size = np.random.default_rng(1), 1e-4
    for k in range(0, len(onto), 5):
        z = onto[k] @ rng.normal(size=onto.shape[1]) * size
        before = Evaluation.at_state(marionette, at(plan, nodes[k]))
        after = Evaluation.at_state(marionette, at(plan, changed(plan, nodes[k], z)))
        squared = float(z @ z)
        assert abs(after.h[0] - before.h[0]) < 5.0 * squared
        assert abs(after.hdot[0] - before.hdot[0]) < 50.0 * squared


def test_derivatives_predict_where_neighbours_end(plan, law):
    """Segments without events, for neighbours with the same active set as the plan's."""
    marionette, rng = plan.problem.marionette, np.random.default_rng(2)
    free = plan.rollouts.with_tolerance(tolerance=-1.0, free=True)
    onto = taut_projection(marionette, law.nodes, np.ones((len(law.nodes.q_D), 1), dtype=bool))
    quiet = np.flatnonzero(plan.tree.catches[list(plan.path[1:])] == 0)
    for k in quiet[::4]:
        z = onto[k] @ rng.normal(size=onto.shape[1]) * 1e-4
        more = rng.normal(size=3) * 1e-4
        start = changed(plan, law.nodes[[k]], z)
        ended = free.replay(start, law.planned[k] + more, int(law.n_checks[k]))
        reached = law.away(law.nodes[k + 1], at(plan, ended[0]))
        predicted = law.A[k] @ z + law.B[k] @ more
        assert np.linalg.norm(reached - predicted) < 0.1 * np.linalg.norm(reached)


@pytest.mark.parametrize("slack", [0.005, 0.01])
def test_derivatives_include_catches(plan, slack):
    """Compared with the exact derivative through the catch of an arm that falls onto its string."""
    arm, law = plan.problem.marionette, plan.rollouts.laws[0]
    x = at(plan, StateArrays(law.q_D, np.zeros(4), np.zeros(1), law.q_K, np.zeros(3)))
    x = x.replace(q_K=x.q_K + np.array([0.0, 0.0, slack]))
    options = dataclasses.replace(plan.rollouts.run_options, dt=4e-4, save_every=50)
    A, _ = segment_derivatives(arm, StateArrays.of(x), np.zeros((1, 3)), options, 5, apart=1e-3)
    exact = fan.dynamics.sensitivity(arm, x, t_end=0.1)
    assert [event.kind.value for event in exact.run.events] == ["catch"]
    wrong = np.linalg.norm(A[0][:8, :8] - exact.by_x0[-1]) / np.linalg.norm(exact.by_x0[-1])
    assert wrong < 0.05


def test_disturbed_starts_arrive(plan, law):
    """Kicks of half a radian per second in every joint, bounds kept."""
    problem, rng = plan.problem, np.random.default_rng(3)
    within = {True: [], False: []}
    for _ in range(20):
        x = plan.start
        kicked = x.replace(v_D=x.v_D + 0.5 * rng.normal(size=len(x.v_D)))
        kicked = problem.marionette.project(kicked)
        for closed, distances in within.items():
            run = law.run(kicked, closed=closed)
            distances.append(run.distance)
            assert np.all(np.abs(run.acceleration) <= plan.rollouts.bounds.acceleration + 1e-9)
            assert np.all(np.abs(run.states.v_K) <= plan.rollouts.bounds.speed + 1e-9)
    with_law, without = (np.array(within[closed]) for closed in (True, False))
    assert np.median(with_law) < np.median(without) / 3.0
    assert np.sum(with_law <= plan.tolerance) > np.sum(without <= plan.tolerance)
    assert np.mean(with_law <= plan.tolerance) >= 0.6


def test_an_undisturbed_puppet_follows_the_plan(plan, law):
    followed, planned = law.run(), law.run(closed=False)
    assert followed.arrives and planned.arrives
    # Rounding, and its effects.
    np.testing.assert_allclose(followed.acceleration, law.planned, atol=1e-5)
    assert abs(planned.distance - plan.distance) < 1e-5
    assert law.run(method="event").arrives


def test_steppers_that_lose_steps_are_followed_to_the_end(plan, law):
    """Stepper motors continue after a loss; the puppet has then not arrived, at any place."""
    arm = plan.problem.marionette

    class Losing(Stepper):
        @property
        def status(self) -> fan.Status:
            return fan.Status.LOST_STEPS

    def stepper(x, method, **options):
        losing = arm.stepper(x, method, **options)
        losing.__class__ = Losing
        return losing

    weak = SimpleNamespace(coordinates=arm.coordinates, stepper=stepper)
    followed = law.run(marionette=weak)
    assert followed.t[-1] == pytest.approx(plan.start.t + plan.duration)
    assert followed.distance <= plan.tolerance
    assert followed.status is fan.Status.LOST_STEPS and not followed.arrives


def test_without_events_gains_go_by_time(plan, law):
    """If the plan's string is taut all the way, this holds to the last bit."""
    assert np.all(law.active) and not len(law.extended.late)
    by_time = plan.feedback(window=0)
    kicked = plan.problem.marionette.project(plan.start.replace(v_D=[0.3, 0.1, 0.0, -0.4]))
    runs = [each.run(kicked) for each in (law, by_time)]
    np.testing.assert_array_equal(runs[0].acceleration, runs[1].acceleration)


def test_pushes_are_absorbed_and_the_goal_is_held(plan, law):
    def push(t: float) -> np.ndarray:
        return np.array([0.0, 0.01, 0.0, 0.0]) if t < 0.5 else np.zeros(4)

    pushed = law.run(push=push, hold=2.0)
    assert pushed.t[-1] >= plan.duration + 2.0 - 1e-9
    assert pushed.distance < 0.05
    assert law.run(push=push, closed=False).distance > 2.0 * law.run(push=push).distance


def test_ranges_are_kept_for_any_state(plan, law):
    """Large gains, and a distant puppet."""
    wild = dataclasses.replace(law, gains=-30.0 * law.gains)
    low, high = plan.rollouts.bounds.low.copy(), plan.rollouts.bounds.high.copy()
    problem, random = plan.problem, np.random.default_rng(0)
    k = problem.marionette.coordinates.q_K.index("hand.length")
    assert low[k] > 0.0 and high[k] == np.inf
    for _ in range(5):
        x = plan.start
        kicked = x.replace(v_D=x.v_D + 2.0 * random.normal(size=len(x.v_D)))
        run = wild.run(problem.marionette.project(kicked), hold=3.0)
        assert np.all(run.states.q_K >= low - 1e-9)
        assert np.all(np.abs(run.states.v_K) <= plan.rollouts.bounds.speed + 1e-9)
    spans = {"hand.x": (0.2, 0.6), "hand.length": (0.4, 1.4)}
    narrow = Problem(
        problem.marionette,
        plan.start,
        plan.goal,
        tolerance=0.25,
        slack=False,
        bounds=fan.control.Bounds(position=spans),
    )
    wide_plan = solve(narrow, seed=0)
    law = dataclasses.replace(wide_plan.feedback(), gains=-30.0 * wide_plan.feedback().gains)
    q_K = law.run(hold=3.0).states.q_K
    names = problem.marionette.coordinates.q_K
    for name, (lowest, highest) in spans.items():
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


def at(plan: PlanResult, row: StateArrays) -> State:
    """One row as a state."""
    rows = plan.problem.marionette.tree.n_rows
    return State(0.0, row.q_D, row.v_D, row.q_K, row.v_K, np.zeros(rows, dtype=bool), row.slip)


def changed(plan: PlanResult, row: StateArrays, z: np.ndarray) -> StateArrays:
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
    left = np.max(np.abs(inputs.evaluate(inputs.end)[1]))
    assert 0.0 < left < 5e-4
    held = inputs.then(fan.Input.hold(arm, 0.5))
    assert held.evaluate(inputs.end)[1].tolist() == [0.0, 0.0, 0.0]
    first = fan.simulate(arm, plan.start, held, method="timestepping")
    two = fan.simulate(arm, plan.start, inputs, t_end=inputs.end + 0.5, method="timestepping")
    np.testing.assert_allclose(first.q_D[-1], two.q_D[-1], atol=1e-9)


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
    again = Problem(
        arm,
        x.replace(t=0.0),
        problem.goal,
        problem.rollouts.clearance.obstacles,
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005, speed=0.5),
        slack=False,
    )
    replanned = solve(again, seed=3)
    assert replanned and replanned.verify(method="event").arrives
    assert replanned.feedback().run(method="event").arrives
