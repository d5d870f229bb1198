"""Joints of inputs: small jumps are removed and larger ones refused, by one rule."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import InputError, StateError
from fantoccini.motion import Input, Inputs


@pytest.fixture(scope="module")
def x0(arm):
    return arm.rest({"hand.length": 0.8})


def nearly_stopped(arm, left: float) -> Input:
    """Constant accelerations, as planners use them, with a remaining final speed."""
    acc = np.array([[0.0, -1.0], [0.0, 1.0 - left / 0.3]])
    return Input.segments(arm, [0.0, 0.3, 0.6], [0.45, 0.8], [0.0, 0.0], acc)


def is_smooth(inputs: Input) -> None:
    for t in inputs.breaks[1:-1]:
        before, after = (inputs.evaluate(t + s) for s in (-1e-10, 1e-10))
        for a, b in zip(before[:2], after[:2], strict=True):
            np.testing.assert_allclose(a, b, atol=1e-9)


def test_small_jumps_between_inputs_are_removed(arm):
    """A plan that ends with 1.25e-5 m/s can be followed by standing still."""
    plan = nearly_stopped(arm, 1.25e-5)
    assert plan.evaluate(0.6)[1][1] == pytest.approx(-1.25e-5)
    inputs = plan.then(Input.hold(arm, 0.5))
    is_smooth(inputs)
    t = np.linspace(0.0, 0.6, 50)
    for own, joined in zip(plan.evaluate(t)[:2], inputs.evaluate(t)[:2], strict=True):
        np.testing.assert_allclose(own, joined, atol=3e-5)
    assert inputs.evaluate(0.6)[1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_a_run_goes_beyond_inputs_that_nearly_stop(arm, x0, method):
    """Runs of one and of many end later than the inputs; their energies balance."""
    plan = nearly_stopped(arm, 1.25e-5)
    run = fan.simulate(arm, x0, plan, t_end=1.0, method=method)
    assert run.v_K[-1].tolist() == [0.0, 0.0]
    exact = fan.simulate(arm, x0, nearly_stopped(arm, 0.0), t_end=1.0, method=method)
    np.testing.assert_allclose(run.q_D[-1], exact.q_D[-1], atol=1e-4)
    if method == "event":
        assert np.max(np.abs(run.ledger["residual"])) < 1e-9
    many = fan.simulate_batch(arm, x0, [plan, plan], t_end=1.0, method=method, save="all")
    np.testing.assert_allclose(many.trajectory(1).q_D[-1], run.q_D[-1], atol=1e-9)


def test_noise_at_the_start_is_removed(arm, x0):
    """A spline with an initial speed of 5.8e-9 m/s begins at rest."""
    for speed in (5.8e-9, 2e-5):
        noisy = Input.segments(arm, [0.0, 0.3, 0.6], [0.45, 0.8], [0.0, speed], [[0, -1], [0, 1]])
        bound = noisy.bound(x0.q_K, 0.0, x0.v_K)
        assert np.max(np.abs(bound.evaluate(0.0)[1])) <= 5.8e-9
        is_smooth(bound)
        run = fan.simulate(arm, x0, noisy, t_end=0.5)
        assert run.status.name == "DONE" and np.max(np.abs(run.ledger["residual"])) < 1e-9


def test_positions_are_met_to_a_part_of_the_move(arm, x0):
    """A start may be 1e-7 m away from the beginning of a move of 0.3 m."""
    lift = Input.waypoints(arm, {"hand.length": [(0.0, 0.8 + 1e-7), (1.0, 0.5)]})
    bound = lift.bound(x0.q_K, 0.0, x0.v_K)
    assert bound.evaluate(0.0)[0][1] == x0.q_K[1]
    assert bound.evaluate(1.0)[0][1] == pytest.approx(0.5, abs=1e-14)
    assert fan.simulate(arm, x0, lift).status.name == "DONE"
    with pytest.raises(InputError, match=r"but 0\.8 in the start state"):
        fan.simulate(arm, x0, Input.waypoints(arm, {"hand.length": [(0.0, 0.80001), (1.0, 0.5)]}))


def test_larger_jumps_are_refused(arm, x0):
    """Jumps are compared with the largest speed in the inputs."""
    for left in (2e-3, 0.1):
        with pytest.raises(InputError, match=r"hand.length: jumps in velocity by .* at t = 0.6"):
            nearly_stopped(arm, left).then(Input.hold(arm, 0.5))
        with pytest.raises(InputError, match=r"end at t = 0\.6 s with the velocity"):
            fan.simulate(arm, x0, nearly_stopped(arm, left), t_end=1.0)
    fast = Input.segments(arm, [0.0, 0.6], [0.45, 0.8], [0.0, 2e-3], [[0.0, -0.1]])
    with pytest.raises(StateError, match=r"hand\.length would jump"):
        fan.simulate(arm, x0, fast, t_end=0.5)
    with pytest.raises(StateError, match=r"hand\.length of run 1 would jump"):
        fan.simulate_batch(arm, x0, [nearly_stopped(arm, 0.0), fast], t_end=0.5)


def test_rotations_remove_jumps_of_angular_velocity():
    """Two rotations join with different angular velocities."""
    bar = fan.puppets.marionette_bar()
    x, t = bar.state(), bar.coordinates
    rng = np.random.default_rng(0)
    v = 0.3 * rng.normal(size=t.n_vK)
    v[[name.endswith(".length") for name in t.v_K]] = 0.0
    first = Input.segments(bar, [0.0, 0.5], x.q_K, v, np.zeros((1, t.n_vK)))
    q, w, _ = first.evaluate(0.5)
    off = np.where(v != 0.0, 1e-6, 0.0)
    two = Input.segments(bar, [0.0, 0.5], q, w + off, np.zeros((1, t.n_vK)))
    inputs = first.then(two)
    is_smooth(inputs)
    np.testing.assert_allclose(inputs.evaluate(0.5)[1], w + off, atol=1e-12)
    here = first.evaluate(0.2)
    bound = first.bound(here[0], 0.2, here[1] + off)
    np.testing.assert_allclose(bound.evaluate(0.2)[1], here[1] + off, atol=1e-12)
    np.testing.assert_allclose(bound.evaluate(0.5)[0], q, atol=1e-12)


def test_inputs_without_jumps_are_unchanged(arm, x0):
    """Inputs without jumps are unchanged to the last bit."""
    lift = Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
    assert lift.checked() is lift and lift.at_rest() is lift
    bound = lift.bound(x0.q_K, 0.0, x0.v_K)
    assert np.array_equal(bound.coef[:, 1], lift.coef[:, 1])
    many = Inputs.stack([lift, lift])
    assert many.at_rest() is many


def test_the_repr_of_an_input_is_one_line(arm):
    """It names the coordinates and the duration."""
    lift = Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]}).with_name("lift")
    assert repr(lift) == "<Input 'lift': 0 to 1.5 s, hand.length, 1 piece>"
    t = np.linspace(0, 1, 1000)
    samples = Input.samples(arm, t, {"hand.length": 0.8 + 0.0 * t})
    text = repr(samples.with_forces({"elbow": [(0, 1)]}))
    assert len(text) < 100 and "forces" in text


def test_lengths_without_a_value_do_not_matter(table):
    """Inputs are joined before lengths of other coordinates are known."""
    assert np.isnan(table.start_K[0])
    crank = Input.waypoints(table, {"crank": [(0.0, 0.0), (1.0, 1.0)]})
    inputs = crank.then(Input.waypoints(table, {"crank": [(0.0, 1.0 + 1e-8), (1.0, 0.0)]}))
    assert np.isnan(inputs.coef[0, 0, 0]) and inputs.evaluate(1.0)[0][9] == pytest.approx(1.0)
