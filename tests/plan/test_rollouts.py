"""Compiled rollouts compared with the simulator; laws and goals with independent computations."""

from __future__ import annotations

import signal
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import fantoccini as fan
from fantoccini.base import riccati
from fantoccini.control.problems import Problem
from fantoccini.control.problems.derivatives import segment_derivatives
from fantoccini.control.tasks import Goal, RolloutOptions, StateArrays

pytestmark = pytest.mark.medium

ARM = fan.puppets.arm3d()
START = ARM.rest({"hand.x": 0.3, "hand.length": 1.32, "shoulder.rotation": [0, 0, 0], "elbow": 0.1})
UNREACHABLE = {"elbow": 2.6}
"""A goal that no motion reaches."""


def state_arrays(*states: fan.State) -> StateArrays:
    names = ("q_D", "v_D", "slip", "q_K", "v_K")
    return StateArrays(*(np.array([getattr(x, name) for x in states]) for name in names))


FAST_BOUNDS = fan.control.Bounds(speed=1.0, acceleration=5.0)


def make_problem(**options) -> Problem:
    arguments = {"tolerance": 0.01, "bounds": FAST_BOUNDS} | options
    return Problem(ARM, START, UNREACHABLE, **arguments)


def test_motions_are_those_of_the_simulator():
    problem = make_problem()
    rollouts = problem.rollouts
    rng = np.random.default_rng(0)
    acceleration = rng.uniform(-1.0, 1.0, (9, 6, 3))
    rolled = rollouts.simulate(problem.root, np.zeros(9), acceleration)
    segment = rollouts.options.segment
    assert np.all(rolled.n_checks == rollouts.options.n_checks)
    for i in range(9):
        times = segment * np.arange(7)
        inputs = fan.Input.segments(ARM, times, START.q_K, START.v_K, acceleration[i])
        run = fan.simulate(
            ARM,
            START,
            inputs,
            t_end=times[-1],
            method=fan.TimeStepping(dt=rollouts.options.dt, extrapolate=False),
        )
        steps = rollouts.options.steps_per_check * rollouts.options.n_checks * np.arange(1, 7)
        assert np.allclose(rolled.states["q_D"][i], run.q_D[steps], atol=1e-9)
        assert np.allclose(rolled.states["v_D"][i], run.v_D[steps], atol=1e-7)
        assert np.allclose(rolled.states["q_K"][i], run.q_K[steps], atol=1e-12)


def test_a_motion_does_not_depend_on_its_neighbours_or_on_threads():
    acceleration = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 5, 3))
    one_thread = make_problem(rollouts=RolloutOptions(threads=1))
    all_rollouts = make_problem(rollouts=RolloutOptions(threads=3)).rollouts.simulate(
        one_thread.root, np.zeros(40), acceleration
    )
    for i in (0, 7, 8, 39):
        single = one_thread.rollouts.simulate(one_thread.root, np.zeros(1), acceleration[[i]])
        for name, a in single.states.items():
            assert np.array_equal(a[0], all_rollouts.states[name][i])


def test_rollouts_end_after_the_first_arrival():
    problem = Problem(
        ARM,
        START,
        {"elbow": 0.35},
        tolerance=0.1,
        bounds=fan.control.Bounds(speed=1.0, acceleration=5.0),
    )
    rng = np.random.default_rng(2)
    acceleration = rng.uniform(-2.0, 2.0, (64, 12, 3))
    rolled = problem.rollouts.simulate(problem.root, np.zeros(64), acceleration)
    is_at_goal = (rolled.n_checks > 0) & (rolled.distance <= problem.rollouts.stop_distance)
    arrived = np.flatnonzero(is_at_goal.any(axis=1))
    assert len(arrived) == 1 and rolled.n_simulated == arrived[0] + 1 < 64
    assert not rolled.n_checks[rolled.n_simulated :].any()


def test_motions_end_at_obstacles_bounds_and_slackness():
    wall = {"name": "wall", "type": "half_space", "at": [0.1, 0, 0], "normal": [-1, 0, 0]}
    walled = make_problem(obstacles=[wall], rollouts=RolloutOptions(strings=False))
    pushing = np.zeros((1, 12, 3))
    pushing[0, :4, 0] = 2.0
    pushing[0, :, 2] = -0.4
    free_rollouts = make_problem().rollouts.simulate(walled.root, np.zeros(1), pushing)
    cut_rollouts = walled.rollouts.simulate(walled.root, np.zeros(1), pushing)
    n_reached = int((cut_rollouts.n_checks > 0).sum())
    assert 0 < n_reached < (free_rollouts.n_checks > 0).sum()
    clear = walled.rollouts.clearance
    q_D, q_K = cut_rollouts.states["q_D"][0, :n_reached], cut_rollouts.states["q_K"][0, :n_reached]
    assert clear.at(q_D, q_K).min() >= 0.0
    assert (
        clear.at(
            free_rollouts.states["q_D"][0, n_reached], free_rollouts.states["q_K"][0, n_reached]
        )
        < 0.0
    )
    narrow_problem = make_problem(bounds=replace(FAST_BOUNDS, position={"hand.length": (1.2, 1.4)}))
    cut_rollouts = narrow_problem.rollouts.simulate(narrow_problem.root, np.zeros(1), pushing)
    lengths = cut_rollouts.states["q_K"][0, (cut_rollouts.n_checks[0] > 0)][:, 2]
    assert lengths.min() >= 1.2 and len(lengths) < 12
    lowering = np.zeros((1, 12, 3))
    lowering[0, :3, 2] = 3.0
    taut_rollouts, slack_rollouts = (
        make_problem(slack=slack).rollouts.simulate(walled.root, np.zeros(1), lowering)
        for slack in (False, True)
    )
    assert (taut_rollouts.n_checks > 0).sum() < (slack_rollouts.n_checks > 0).sum()


def test_a_regulator_for_many_steps_tends_to_the_infinite_horizon():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6))
    A *= 0.95 / np.max(np.abs(np.linalg.eigvals(A)))
    B, Q, R = rng.normal(size=(6, 2)), np.eye(6), 0.1 * np.eye(2)
    P = solve_discrete_are(A, B, Q, R)
    expected = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    assert np.allclose(riccati.stationary_gain(A, B, Q, R, 7), expected, atol=1e-9)


def test_derivatives_of_segments_are_those_of_the_simulators_steps():
    """The product of the exact derivatives of the steps, over a segment of a swinging arm."""
    rollouts = make_problem().rollouts
    acc = np.array([0.3, -0.2, -0.1])
    x, A = START, np.eye(14)
    B = np.zeros((14, 3))
    for _ in range(rollouts.options.steps_per_check * rollouts.options.n_checks):
        step = ARM.linearise_step(x, acc, dt=rollouts.options.dt)
        A, B = step.A @ A, step.A @ B + step.B
        x = step.x_next
    segment_A, segment_B = segment_derivatives(
        ARM, state_arrays(START), acc[None], rollouts.run_options, rollouts.options.n_checks
    )
    assert np.allclose(segment_B[0], B, atol=2e-5)
    assert segment_A.shape == (1, 14, 14)


def test_regulated_motions_come_to_rest_at_the_goal():
    task = Problem(ARM, START, {"shoulder.rotation": [0, -0.6, 0], "elbow": 1.2}, tolerance=1e-3)
    rolled = task.rollouts.with_tolerance(tolerance=-1.0).simulate(
        task.root,
        np.zeros(4),
        np.zeros((4, 100, 3)),
        n_prescribed=np.zeros(4),
        lead_time=np.array([0.3, 0.5, 0.8, 1.0]),
    )
    assert np.all(rolled.distance[:, -1] < 0.02)


def test_distances_from_goals():
    goal = Goal.pose(
        ARM,
        {"shoulder.rotation": [0.1, -0.7, 0.3], "elbow": (0.5, 0.9)},
        weights={"elbow": 2.0},
        speed_weight=0.3,
    )
    rng = np.random.default_rng(4)
    states = [
        ARM.state({"shoulder.rotation": rng.normal(size=3), "elbow": e}).replace(
            v_D=rng.normal(size=4)
        )
        for e in (0.2, 0.6, 1.4)
    ]
    distances = goal.distance(state_arrays(*states))
    for x, d in zip(states, distances, strict=True):
        half_angle = np.sqrt(0.1**2 + 0.7**2 + 0.3**2) / 2
        axis = np.array([0.1, -0.7, 0.3]) / (2 * half_angle)
        cosine = abs(x.q_D[:4] @ np.concatenate([[np.cos(half_angle)], np.sin(half_angle) * axis]))
        deviation = max(0.5 - x.q_D[4], x.q_D[4] - 0.9, 0.0)
        expected = 2 * np.arccos(min(cosine, 1.0)) + 2.0 * deviation + 0.3 * np.linalg.norm(x.v_D)
        assert d == pytest.approx(expected, abs=1e-9)
    rest_goal = Goal.pose(ARM, {"elbow": 0.5}, speed_weight=0.0, driven_weight=0.4)
    moving = states[0].replace(v_K=[0.3, 0.0, -0.4])
    assert rest_goal.distance(state_arrays(moving))[0] == pytest.approx(0.3 + 0.4 * 0.5, abs=1e-12)
    moved_state = states[1].replace(v_K=[0.1, 0.0, 0.0])
    assert np.any(moved_state.v_D)
    state_distances = Goal.of(ARM, moved_state).distance(
        state_arrays(moved_state, moving.replace(q_D=moved_state.q_D))
    )
    missing_speed = 0.1 * np.linalg.norm(moving.v_D - moved_state.v_D) + np.linalg.norm(
        [0.2, 0.0, -0.4]
    )
    assert state_distances == pytest.approx([0.0, missing_speed], abs=1e-12), (
        "17.4: a state's velocities count"
    )
    point_goal = Goal.point(ARM, "lower", [0.1, 0.0, -0.5], at=[0, 0, -0.3], to=[0.2, 0.1, -0.4])
    for x, d in zip(states, point_goal.distance(state_arrays(*states)), strict=True):
        place = ARM.string_points(x.q_D, x.q_K)["hand"][0]
        nearest = np.clip(place, [0.1, 0.0, -0.5], [0.2, 0.1, -0.4])
        assert d == pytest.approx(np.linalg.norm(place - nearest), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_index": np.array([5])}, "start ranges from 5"),
        ({"n_segments": np.array([200])}, "n_segments ranges from 200"),
        ({"n_segments": np.array([0])}, "n_segments ranges from 0"),
        ({"n_prescribed": np.array([0])}, "law ranges from 0"),
        ({"acceleration": np.zeros((1, 4, 1))}, "the accelerations have the shape"),
    ],
)
def test_indices_outside_of_arrays_are_refused(change, message):
    task = make_problem()
    task.rollouts.laws = []
    arguments = {"start_index": np.zeros(1), "acceleration": np.zeros((1, 4, 3))} | change
    with pytest.raises(ValueError, match=message):
        task.rollouts.simulate(task.root, **arguments)


def test_a_goal_counts_with_the_parameters_of_the_puppet_that_plans():
    text = fan.puppets.path("arm3d").read_text(encoding="utf-8")
    goal = Goal.point(ARM, "lower", [0.3, 0.0, -0.4], at=[0, 0, -0.3])
    assert Goal.of(ARM, goal).marionette is ARM
    other = fan.loads(text)
    with pytest.raises(fan.errors.StateError, match="another puppet"):
        Goal.of(other, goal)


def test_python_hears_signals_while_many_rollouts_are_simulated():
    """A timer's handler runs repeatedly during one long sweep."""
    if not hasattr(signal, "setitimer"):
        pytest.skip("needs setitimer")
    task, signals = make_problem(rollouts=RolloutOptions(dt=0.002, n_checks=1000)), []
    acceleration = np.random.default_rng(0).uniform(-0.01, 0.01, (256, 1, 3))
    previous_handler = signal.signal(signal.SIGALRM, lambda *_: signals.append(len(signals)))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.005, 0.005)
        task.rollouts.with_tolerance(tolerance=-1.0, unbounded=True).simulate(
            task.root, np.zeros(256), acceleration
        )
        n_signals = len(signals)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous_handler)
    assert n_signals > 3
