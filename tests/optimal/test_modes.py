"""Motions with slack strings and catches: derivatives, searches, and their results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

import fantoccini as fan
from fantoccini.control.optimal import exploring
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.hybrid import HybridRuns
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.drawn_inputs import DrivenConditions
from fantoccini.control.tasks.nodes import Nodes

pytestmark = pytest.mark.slow

TUGS = -30.0 * np.cos(5.0 * np.pi * (0.04 * np.arange(25) + 0.02))
"""Accelerations of the string's length in 25 intervals of a second [m/s^2]."""


@pytest.fixture(scope="module")
def throwing_runs(arm: fan.Marionette) -> tuple[HybridRuns, Nodes]:
    """A motion with releases and catches, by prescribed accelerations."""
    x0 = arm.rest({"hand.x": 0.3, "hand.length": 0.8})
    free_parameters = ChosenParameters(arm, x0, {})
    runs = HybridRuns(TimeSteps(arm, 0.005, 1, free_parameters), free_parameters)
    acc = np.stack([2.0 * np.sin(np.arange(25.0)), TUGS - np.mean(TUGS)], axis=1)
    nodes = replace(Nodes.constant(arm, x0, 1.0, len(acc)), acc_K=acc)
    nodes_and_run = runs.run(nodes)
    assert nodes_and_run is not None
    return runs, nodes_and_run[0]


@pytest.fixture(scope="module")
def swing_up() -> fan.control.Optimum:
    task = fan.control.load_task("swing_up")
    return fan.optimise(task, iterations=100, cost_tolerance=1e-7, time_limit=300.0)


@pytest.fixture
def small_exploration(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small explorations."""
    small = replace(exploring.SETTINGS, n_runs=32, n_best=8, n_generations=5)
    monkeypatch.setattr(exploring, "SETTINGS", small)


def elbow_straight(explore: int) -> fan.Task:
    """The arm, to be stretched for some time."""
    tracks = [fan.control.Track.coordinate("elbow", 0.5, weight=100.0)]
    return replace(
        fan.control.load_task("swing_up"), duration=0.5, end=None, tracks=tracks, explore=explore
    )


def releases_and_catches(run: fan.Trajectory) -> list[str]:
    """Releases and catches, in order."""
    kinds = (fan.motion.EventKind.RELEASE, fan.motion.EventKind.CATCH)
    return [event.kind.value for event in run.events if event.kind in kinds]


def test_derivatives_through_releases_and_catches_are_those_of_the_run(
    throwing_runs: tuple[HybridRuns, Nodes],
):
    """Derivatives of the end, along random changes of accelerations and duration, to 1e-8."""
    runs, nodes = throwing_runs
    run = runs.run(nodes)[1]
    assert releases_and_catches(run).count("release") >= 2
    assert releases_and_catches(run).count("catch") >= 2
    linear = runs.linearise(nodes, runs.ends(nodes, run))
    rng = np.random.default_rng(0)
    for interval_change in (0.0, 0.0, 1e-2):
        u = rng.standard_normal(nodes.acc_K.shape)
        z = np.zeros(nodes.n_z)
        for i in range(len(nodes)):
            z = linear.A[i] @ z + linear.B[i] @ u[i] + linear.dend_c[i, :, 0] * interval_change

        def change(
            step: float, u: np.ndarray = u, interval_change: float = interval_change
        ) -> np.ndarray:
            end_scalars = []
            for sign in (step, -step):
                changed_nodes = replace(
                    nodes,
                    acc_K=nodes.acc_K + sign * u,
                    interval=nodes.interval + sign * interval_change,
                )
                nodes_and_run = runs.run(changed_nodes)
                assert nodes_and_run is not None
                assert releases_and_catches(nodes_and_run[1]) == releases_and_catches(run)
                end_scalars.append(nodes_and_run[0].scalars[-1])
            return (end_scalars[0] - end_scalars[1]) / (2.0 * step)

        coarse, fine = change(2e-4), change(1e-4)
        differences = fine + (fine - coarse) / 3.0
        assert np.max(np.abs(differences - z)) < 1e-8 * max(1.0, np.max(np.abs(z)))


def test_tensions_change_as_their_derivatives(throwing_runs: tuple[HybridRuns, Nodes]):
    """Derivatives in every interval, along its own acceleration, with a fixed initial state."""
    runs, nodes = throwing_runs
    run = runs.run(nodes)[1]
    linear = runs.linearise(nodes, runs.ends(nodes, run))
    taut = np.flatnonzero(runs.ends(nodes, run).tension[:, 0] > 0.1)
    assert 5 < len(taut) < len(nodes)
    for i in taut:
        tensions = []
        for step in (1e-3, -1e-3):
            acc = nodes.acc_K.copy()
            acc[i, 1] += step
            nodes_and_run = runs.run(replace(nodes, acc_K=acc))
            assert nodes_and_run is not None
            tensions.append(runs.ends(*nodes_and_run).tension[i, 0])
        derivative = linear.dtension[i, 0, nodes.n_z + 1]
        assert derivative == pytest.approx((tensions[0] - tensions[1]) / 2e-3, rel=1e-6)


def test_driven_rotations_are_refused_by_name():
    bar = fan.puppets.marionette_bar()
    with pytest.raises(fan.errors.StateError, match="driven rotation"):
        fan.optimise(fan.Task(bar, bar.rest(), 0.1, [], interval=0.05, explore=1))


def test_the_arm_is_thrown_up_on_a_slack_string_and_caught(swing_up: fan.control.Optimum):
    assert swing_up.holds, swing_up.summary()
    assert swing_up.status in (fan.control.AnswerStatus.SOLVED, fan.control.AnswerStatus.SETTLED)
    task, run = swing_up.task, swing_up.run
    slack_time = np.sum(np.diff(run.t) * (run.tension["hand"][:-1] == 0.0))
    assert slack_time > 0.2
    assert releases_and_catches(run)[-1] == "catch"
    # The inputs alone reach the end, in a run of their own, and the arm stays there.
    repeated = fan.simulate(task.marionette, task.x0, swing_up.inputs, 1.0)
    assert repeated.q_D[-1] == pytest.approx(task.end.q_D, abs=1e-5)
    assert repeated.v_D[-1] == pytest.approx(0.0, abs=1e-4)
    later = fan.simulate(
        task.marionette, repeated.state(len(repeated) - 1).replace(t=0.0), None, 3.0
    )
    assert np.max(np.abs(later.q_D - task.end.q_D)) < 1e-3
    samples = repeated.resample(swing_up.t)  # where bounds apply
    for name, (low, high) in task.bounds.position.items():
        value = samples.q_K[:, task.marionette.coordinates.q_K.index(name)]
        assert np.min(value) > low - 1e-6
        assert np.max(value) < high + 1e-6
    assert np.max(np.abs(repeated.v_K)) <= 3.0 + 1e-6
    assert np.max(np.abs(swing_up.nodes.acc_K)) <= 30.0


def test_without_exploration_the_status_is_violated():
    task = replace(fan.control.load_task("swing_up"), explore=0)
    best = fan.optimise(task, iterations=30)
    assert best.status is fan.control.AnswerStatus.VIOLATED
    assert best.end_gap > 0.1


def test_another_optimiser_finds_the_same_motion_from_nearby(swing_up: fan.control.Optimum):
    """SciPy's optimiser uses only event-driven runs, with gradients by differences."""
    task, nodes = swing_up.task, swing_up.nodes
    arm, h, t = task.marionette, nodes.interval, nodes.t
    shape = nodes.acc_K.shape
    start, end = nodes.acc_K.ravel(), np.concatenate([task.end.q_D, [0.0, 0.0], task.end.q_K])

    def end_residual(a: np.ndarray) -> np.ndarray:
        """Residual at the end: q_D, v_D, q_K; the final rest of the inputs is a bound below."""
        move = fan.Input.segments(arm, t, task.x0.q_K, task.x0.v_K, a.reshape(shape))
        run = fan.simulate(arm, task.x0, move, t[-1], effort=False)
        end_values = np.concatenate([run.q_D[-1], run.v_D[-1], run.q_K[-1]])
        return np.concatenate([end_values - end, run.v_K[-1]])

    def cost(a: np.ndarray) -> float:
        acc = a.reshape(shape)
        jumps = np.diff(acc, axis=0, prepend=0.0, append=0.0)
        smooth = task.smooth
        return 0.5 * (smooth.acceleration * h * np.sum(acc**2) + smooth.jerk / h * np.sum(jumps**2))

    assert swing_up.cost == pytest.approx(cost(start), rel=1e-9)
    assert np.max(np.abs(end_residual(start))) < 1e-5
    low, high = np.transpose([task.bounds.position[name] for name in arm.coordinates.q_K])

    def margins(a: np.ndarray) -> np.ndarray:
        """Distances of places at the nodes from their bounds."""
        acc = a.reshape(shape)
        v = np.concatenate([np.zeros((1, 2)), np.cumsum(h * acc, axis=0)])
        q = task.x0.q_K + np.cumsum(0.5 * h * (v[1:] + v[:-1]), axis=0)
        return np.concatenate([q - low, high - q]).ravel()

    # Differences of 1e-6 m/s^2, for independent rows only: a taut end follows by itself.
    independent = [0, 2, 4, 5, 6, 7]
    scipy_optimum = minimize(
        cost,
        start + 0.02 * np.random.default_rng(0).standard_normal(len(start)),
        method="SLSQP",
        options={"maxiter": 100, "ftol": 1e-9, "eps": 1e-6},
        constraints=[
            {"type": "eq", "fun": lambda a: end_residual(a)[independent]},
            {"type": "ineq", "fun": margins},
        ],
    )
    assert scipy_optimum.success, scipy_optimum.message
    assert np.max(np.abs(end_residual(scipy_optimum.x))) < 1e-8
    assert swing_up.cost == pytest.approx(scipy_optimum.fun, rel=1e-5)


def test_the_seed_decides_and_threads_do_not(small_exploration: None):
    optima = [
        fan.optimise(elbow_straight(1), seed=seed, threads=threads, iterations=3)
        for seed, threads in ((0, 1), (0, 2), (1, 1))
    ]
    assert np.array_equal(optima[0].nodes.acc_K, optima[1].nodes.acc_K)
    assert not np.array_equal(optima[0].nodes.acc_K, optima[2].nodes.acc_K)


def test_the_best_of_several_explorations_is_kept(small_exploration: None):
    one_exploration, three_explorations = (
        fan.optimise(elbow_straight(n), iterations=3) for n in (1, 3)
    )
    assert three_explorations.cost <= one_exploration.cost
    assert three_explorations.iterations > one_exploration.iterations


def test_a_free_duration_ends_where_it_is_best():
    """The same cost with a price on time: the motion is shorter than the longest one."""
    task = replace(fan.control.load_task("swing_up"), duration=(0.7, 1.1), time_weight=20.0)
    best = fan.optimise(task, iterations=60, time_limit=300.0, seed=1)
    assert best.holds, best.summary()
    assert 0.7 <= best.run.t[-1] < 1.1 - 1e-3


def test_ctrl_c_while_it_explores_keeps_the_best_so_far():
    calls = []

    def interrupt(now: object) -> None:
        calls.append(now)
        if len(calls) == 8:
            raise KeyboardInterrupt

    best = fan.optimise(elbow_straight(1), progress=interrupt)
    assert best.status is fan.control.AnswerStatus.STOPPED
    assert best.cost < best.curve[0][1]


def test_random_inputs_stay_within_their_bounds(arm: fan.Marionette):
    """They can also stop there: unlimited motions come to rest at the bound."""
    task = fan.control.load_task("swing_up")
    driven, h = DrivenConditions.from_task(task), 0.03
    rng = np.random.default_rng(0)
    random_acc = 60.0 * rng.standard_normal((50, 80, 2))
    constant_acc = np.full((2, 80, 2), 40.0)
    constant_acc[1] = -40.0
    for acc in (random_acc, constant_acc):
        clipped_acc = driven.clipped(acc, h)
        v = np.cumsum(h * clipped_acc, axis=1)
        q = task.x0.q_K + np.cumsum(h * (v - 0.5 * h * clipped_acc), axis=1)
        assert np.max(np.abs(clipped_acc)) <= 30.0
        assert np.max(np.abs(v)) <= 3.0 + 1e-12
        for k, name in enumerate(arm.coordinates.q_K):
            low, high = task.bounds.position[name]
            assert np.min(q[..., k]) >= low - 1e-12
            assert np.max(q[..., k]) <= high + 1e-12
    assert np.abs(v[:, -1]) == pytest.approx(0.0, abs=1e-3)
    projected_acc = driven.projected_onto_end(random_acc, h)
    v = np.cumsum(h * projected_acc, axis=1)
    q = task.x0.q_K + np.cumsum(h * (v - 0.5 * h * projected_acc), axis=1)
    assert q[:, -1] == pytest.approx(np.tile(task.end.q_K, (50, 1)))
    assert v[:, -1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("explore", [-1, 1.5])
def test_explorations_are_counted_in_whole_numbers(arm: fan.Marionette, explore: float):
    with pytest.raises(fan.errors.StateError, match="a whole number"):
        fan.Task(arm, arm.rest(), 1.0, [], explore=explore)  # type: ignore[arg-type]


def test_parameters_are_not_chosen_while_it_explores(arm: fan.Marionette):
    with pytest.raises(fan.errors.StateError, match="explore excludes"):
        fan.Task(arm, arm.rest(), 1.0, [], parameters={"m1": (0.1, 0.2)}, explore=1)
