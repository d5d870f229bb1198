"""The stepper: online steps agree with simulate."""

import copy
import pickle

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.kernel.runtime import Run

pytestmark = pytest.mark.medium


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_pieces_join_to_the_whole(arm, method):
    x0 = arm.rest({"hand.length": 0.8})
    full_run = fan.simulate(arm, x0, t_end=0.0 + 1.0, method=method)
    stepper = arm.stepper(x0, method)
    for _ in range(20):
        stepper.advance(0.05)
    assert stepper.state.t == pytest.approx(1.0)
    assert np.allclose(stepper.state.q_D, full_run.q_D[-1], atol=1e-7)


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_accelerations_drive_and_velocities_continue(arm, method):
    """Eq. 12: the input is the acceleration of the driven coordinates."""
    x0 = arm.rest({"hand.length": 0.8})
    stepper = arm.stepper(x0, method)
    stepper.advance(0.2, {"hand.length": -1.0})
    assert stepper.state.v_K[1] == pytest.approx(-0.2, abs=1e-9)
    stepper.advance(0.2, {"hand.length": 1.0})
    assert stepper.state.v_K[1] == pytest.approx(0.0, abs=1e-9)
    assert stepper.state.q_K[1] == pytest.approx(0.8 - 0.04, abs=1e-9)
    assert arm.constraint(stepper.state)[0] < 1e-4


def test_a_law_is_called_at_its_rate(arm):
    x0 = arm.rest({"hand.length": 0.8})
    times = []

    def law(x):
        times.append(x.t)
        return {"hand.length": -20.0 * (x.q_K[1] - 0.7) - 9.0 * x.v_K[1]}

    stepper = arm.stepper(x0)
    states = stepper.run(3.0, law, rate=100)
    assert len(times) == 300 and len(states) == 301
    assert np.allclose(np.diff(times), 0.01)
    assert stepper.state.q_K[1] == pytest.approx(0.7, abs=1e-3)


def test_an_unknown_driven_name_is_an_error(arm):
    stepper = arm.stepper(arm.rest({"hand.length": 0.8}))
    with pytest.raises(fan.errors.UnknownNameError, match=r"hand\.length"):
        stepper.advance(0.1, {"hand.lenght": 1.0})


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_law_that_gives_no_number_is_refused(arm, method, number):
    """`event` continued without the string whose height was not a number, and ended DONE."""
    x0 = arm.rest({"hand.length": 0.8})
    for asked in ({"acc_K": {"hand.x": number}}, {"u_D": [number, 0.0]}):
        stepper = arm.stepper(x0, method)
        with pytest.raises(fan.errors.StateError, match=rf"(acc_K|u_D)\[0\] is {number}"):
            stepper.advance(0.1, **asked, throw=False)
        assert stepper.state == x0
        assert stepper.advance(0.1).t == pytest.approx(0.1)


def test_an_endless_piece_is_refused(arm):
    """advance(inf) never ended; nor did a piece with too many rows for the memory."""
    stepper = arm.stepper(arm.rest({"hand.length": 0.8}))
    for duration in (np.inf, np.nan, 0.0, -1.0):
        with pytest.raises(ValueError, match="it must be a finite number greater than 0"):
            stepper.advance(duration)
    with pytest.raises(ValueError, match=r"5e\+14 samples from 0 s to 1e\+12 s"):
        stepper.advance(1e12)
    assert stepper.advance(0.1).t == pytest.approx(0.1)


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_an_interrupted_stepper_keeps_its_last_state(arm, method):
    """It kept the earlier state, and jumped from there to the later one."""
    x0 = arm.rest({"hand.length": 0.8})
    stepper, whole = arm.stepper(x0, method), arm.stepper(x0, method)
    pieces = Run.advance

    def interrupted(run, t_end):
        for i, piece in enumerate(pieces(run, t_end)):
            if i == 2:
                raise KeyboardInterrupt
            yield piece

    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Run, "advance", interrupted)
        stepper.advance(50.0, {"hand.length": -0.001})
    x = stepper.state
    assert 0.0 < x.t < 50.0
    assert x.q_K[1] == pytest.approx(0.8 - 0.0005 * x.t**2)
    y = stepper.advance(0.5)
    z = whole.advance(x.t, {"hand.length": -0.001})
    assert z.q_D == pytest.approx(x.q_D, abs=1e-8)
    z = whole.advance(0.5)
    assert y.t == pytest.approx(x.t + 0.5) and y.q_K == pytest.approx(z.q_K, abs=1e-12)
    assert y.q_D == pytest.approx(z.q_D, abs=1e-6)


def test_weak_gravity_allows_inputs():
    """The cap on tensions was 1e5 weights: every input without gravity was impossible."""
    text = fan.puppets.path("arm2d").read_text(encoding="utf-8")
    assert "gravity" not in text
    gravity_text = "\ngravity: [0, 0, {parameter: fall, value: -9.81}]\n"
    for gravity in (0.0, 1e-9, 1e-3, 9.81):
        arm = fan.loads(text + gravity_text).with_parameters({"fall": -gravity})
        x0 = arm.project(arm.state())
        length = x0.q_K[1]
        inputs = fan.Input.waypoints(arm, {"hand.length": [(0, length), (1, length - 0.1)]})
        for method in ("event", "timestepping"):
            assert fan.simulate(arm, x0, inputs, method=method).status is fan.Status.DONE
        assert arm.tension_cap == pytest.approx(1e5 * arm.mass * max(1.0, gravity))


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_steppers_are_copied_and_pickled(arm, method):
    """Copies continue independently, as the stepper does."""
    stepper = arm.stepper(arm.rest({"hand.length": 0.8}), method)
    stepper.advance(0.4, {"hand.length": -0.2, "hand.x": 0.1})
    copies = [copy.copy(stepper), copy.deepcopy(stepper), pickle.loads(pickle.dumps(stepper))]
    assert all(copied.state == stepper.state for copied in copies)
    assert all(np.array_equal(copied.tension, stepper.tension) for copied in copies)
    copies[0].advance(0.1, {"hand.length": 0.5})
    x = stepper.advance(0.4, {"hand.length": -0.1})
    for copied in copies[1:]:
        y = copied.advance(0.4, {"hand.length": -0.1})
        np.testing.assert_allclose(y.q_D, x.q_D, atol=1e-7)
        np.testing.assert_allclose(y.v_D, x.v_D, atol=1e-6)
    assert copies[0].state.t == pytest.approx(0.5) and copies[0].status.name == "DONE"


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_copies_continue_to_the_same_bits(arm, method):
    """Copies forgot the earlier accelerations, the mode and the ledger."""
    stepper = arm.stepper(arm.rest({"hand.length": 0.8}), method)
    stepper.advance(0.3, {"hand.length": 2.0})
    stepper.advance(0.0731, {"hand.length": -9.0, "hand.x": 3.0})
    copies = [copy.copy(stepper), copy.deepcopy(stepper), pickle.loads(pickle.dumps(stepper))]
    for k in range(10):
        acc_K = {"hand.length": 2.0 * np.sin(k), "hand.x": np.cos(k)}
        x = stepper.advance(0.002, acc_K)
        for copied in copies:
            assert copied.advance(0.002, acc_K) == x and copied.status is stepper.status
            assert np.array_equal(copied.samples, stepper.samples)
            assert np.array_equal(copied.events, stepper.events)


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_a_stepper_begins_with_the_velocities_of_its_state(arm, method):
    """The tensions at its start include moving driven coordinates."""
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
    run = fan.simulate(arm, arm.rest({"hand.length": 0.8}), lift, method=method)
    row = int(np.argmin(np.abs(run.t - 0.7)))
    x = run.state(row)
    stepper = arm.stepper(x, method)
    _, tension = arm.forward_dynamics(x)
    assert np.abs(x.v_K[1]) > 0.1
    assert np.allclose(stepper.tension, tension, atol=0.05 * arm.weight)
    split = arm.sample_layout.split(stepper.samples)
    assert np.array_equal(split["v_K"][0], x.v_K) and split["taut"][0, 0] == 1.0
