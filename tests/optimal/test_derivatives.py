"""Derivatives of optimal control, compared with central differences."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.hybrid import ExactRuns
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.costs import Track
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.residuals import NodeKinematics, track_residual

DIFFERENCE_STEP = 1e-6


@pytest.fixture(scope="module")
def nodes(crane: fan.Marionette) -> Nodes:
    """Several states in motion, with all strings taut."""
    x0 = crane.rest()
    random = np.random.default_rng(3)
    resting = Nodes.constant(crane, x0, 0.8, 8)
    n = resting.table.n_vD
    z = np.zeros((9, resting.n_z))
    z[1:, 3:6] = 0.1 * random.normal(size=(8, 3))
    z[1:, n : 2 * n] = 0.05 * random.normal(size=(8, n))
    return resting.after_step(z, 0.2 * random.normal(size=resting.acc_K.shape))


@pytest.mark.parametrize(
    "track",
    [
        Track.point("load", (1.0, 0.2, 0.5), at=(0.1, 0.2, 0.3)),
        Track.orientation("load", (0.9, 0.1, -0.3, 0.2)),
        Track.coordinate("load.z", 0.7),
        Track.coordinate("trolley", lambda t: 0.3 * t),
        Track.velocity("*"),
        Track.velocity("hoist.length", 0.1),
    ],
    ids=lambda track: f"{track.kind}-{track.name}",
)
def test_residuals_by_changes_of_states(crane: fan.Marionette, nodes: Nodes, track: Track):
    residual = track_residual(crane, track, nodes)
    derivative = residual.derivatives(NodeKinematics(crane, nodes))
    for j in range(nodes.n_z):
        z = np.zeros((len(nodes) + 1, nodes.n_z))
        z[:, j] = DIFFERENCE_STEP
        zeros = np.zeros_like(nodes.acc_K)
        up, down = (
            residual.value(NodeKinematics(crane, nodes.after_step(sign * z, zeros)))
            for sign in (1.0, -1.0)
        )
        assert derivative[:, :, j] == pytest.approx((up - down) / (2.0 * DIFFERENCE_STEP), abs=1e-7)


def test_a_search_keeps_its_number_of_steps_where_a_free_duration_gets_shorter(crane):
    """Otherwise the dynamics would jump where the duration crosses a multiple of the step."""
    steps = TimeSteps(crane, 0.012, max_interval=0.05)
    for interval in np.linspace(0.005, 0.05, 50):
        assert steps.split(interval) == (5, pytest.approx(interval / 5))


def test_extrapolated_derivatives_are_off_by_the_square_of_the_step(crane, nodes: Nodes):
    runs = EventRuns(TimeSteps(crane, 0.05), ChosenParameters(crane, crane.rest(), {}))
    nodes_and_run = runs.run(nodes)
    assert nodes_and_run is not None
    exact = ExactRuns(runs.steps, runs.free_parameters).linearise(
        nodes_and_run[0], runs.ends(*nodes_and_run)
    )
    deviations = []
    for dt in (0.025, 0.0125):
        linear = TimeSteps(crane, dt).extrapolated(nodes_and_run[0])
        deviations.append(
            [np.max(np.abs(getattr(linear, n) - getattr(exact, n))) for n in ("B", "dend_c")]
        )
    assert np.all(np.array(deviations[1]) < 0.35 * np.array(deviations[0]))
    assert np.max(deviations[1]) < 1e-2


@pytest.mark.parametrize("i", [0, 4])
def test_ends_of_intervals_by_states_and_accelerations(crane: fan.Marionette, nodes: Nodes, i: int):
    steps = TimeSteps(crane, 0.025)
    assert steps.split(nodes.interval) == (4, pytest.approx(0.025))
    parts = {name: getattr(nodes, name)[i : i + 2] for name in ("q_D", "v_D", "q_K", "v_K")}
    interval_nodes = Nodes(nodes.table, 0.0, nodes.interval, **parts, acc_K=nodes.acc_K[i : i + 1])
    n_z, k = interval_nodes.n_z, interval_nodes.acc_K.shape[1]
    # The second node is at the end of the interval, where changes are small.
    correction = np.concatenate([np.zeros((1, n_z)), steps.linearise(interval_nodes).e])
    interval_nodes = interval_nodes.after_step(correction, np.zeros((1, k)))
    linear = steps.linearise(interval_nodes)
    assert np.all(linear.settled) and np.all(linear.taut)
    assert linear.e == pytest.approx(0.0, abs=1e-12)
    derivatives = np.concatenate([linear.A, linear.B], axis=2)[0]
    for j in range(n_z + k):
        z, u = np.zeros((2, n_z)), np.zeros((1, k))
        if j < n_z:
            z[0, j] = DIFFERENCE_STEP
        else:
            u[0, j - n_z] = DIFFERENCE_STEP
        up, down = (
            steps.linearise(interval_nodes.after_step(sign * z, sign * u)) for sign in (1.0, -1.0)
        )
        assert derivatives[:, j] == pytest.approx(
            (up.e - down.e)[0] / (2.0 * DIFFERENCE_STEP), abs=2e-6
        )
        dtension = (up.tension - down.tension)[0] / (2.0 * DIFFERENCE_STEP)
        scale = 1.0 + np.max(np.abs(dtension))
        assert linear.dtension[0, :, j] / scale == pytest.approx(dtension / scale, abs=1e-5)


def test_ends_by_the_length_of_intervals(crane: fan.Marionette):
    x0 = crane.rest()
    acc = np.array([[0.4, 0.0], [-0.3, 0.1], [0.2, -0.1]])
    swing = Nodes.constant(crane, x0, 0.9, 3).after_step(np.zeros((4, 16)), acc)
    runs = EventRuns(TimeSteps(crane, 0.0005), ChosenParameters(crane, x0, {}))
    nodes_and_run = runs.run(swing)
    assert nodes_and_run is not None
    nodes, run = nodes_and_run
    linear = runs.linearise(nodes, runs.ends(nodes, run))
    # All intervals get longer by d: the last state moves by the sum of `shift` through A.
    z = np.zeros(16)
    for A, shift in zip(linear.A, linear.dend_c[..., 0], strict=True):
        z = A @ z + shift
    runs_of_both_signs = [
        runs.run(swing.after_step(np.zeros((4, 16)), 0.0 * acc, np.array([d])))
        for d in (1e-4, -1e-4)
    ]
    (up, _), (down, _) = runs_of_both_signs[0], runs_of_both_signs[1]
    difference = down.changes_to(up.q_D, up.v_D, up.q_K, up.v_K, first_node=0)[-1] / 2e-4
    assert z == pytest.approx(difference, abs=0.01 * np.max(np.abs(difference)))


def test_nodes_move_by_their_difference(crane: fan.Marionette, nodes: Nodes):
    random = np.random.default_rng(0)
    z, u = 0.3 * random.normal(size=(9, nodes.n_z)), random.normal(size=(8, 2))
    new_nodes = nodes.after_step(z, u)
    new_states = (new_nodes.q_D, new_nodes.v_D, new_nodes.q_K, new_nodes.v_K)
    assert nodes.changes_to(*new_states, first_node=0) == pytest.approx(z, abs=1e-12)
    assert new_nodes.acc_K - nodes.acc_K == pytest.approx(u, abs=1e-12)
