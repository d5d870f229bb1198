"""The stepper: what happens on line is what simulate gives."""

import numpy as np
import pytest

import fantoccini as fan


@pytest.fixture(scope="module")
def arm():
    return fan.puppets.arm2d()


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_pieces_join_to_the_whole(arm, method):
    x0 = arm.rest({"hand.length": 0.8})
    whole = fan.simulate(arm, x0, t_end=0.0 + 1.0, method=method)
    stepper = arm.stepper(x0, method)
    for _ in range(20):
        stepper.advance(0.05)
    assert stepper.state.t == pytest.approx(1.0)
    assert np.allclose(stepper.state.q_D, whole.q_D[-1], atol=1e-7)


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_accelerations_drive_and_velocities_go_on(arm, method):
    """Eq. 12: the input is the acceleration of the driven coordinates."""
    x0 = arm.rest({"hand.length": 0.8})
    stepper = arm.stepper(x0, method)
    stepper.advance(0.2, {"hand.length": -1.0})
    assert stepper.state.v_K[1] == pytest.approx(-0.2, abs=1e-9)
    stepper.advance(0.2, {"hand.length": 1.0})
    assert stepper.state.v_K[1] == pytest.approx(0.0, abs=1e-9)
    assert stepper.state.q_K[1] == pytest.approx(0.8 - 0.04, abs=1e-9)
    assert arm.constraint(stepper.state)[0] < 1e-4


def test_a_law_is_asked_at_its_rate(arm):
    x0 = arm.rest({"hand.length": 0.8})
    asked = []

    def law(x):
        asked.append(x.t)
        return {"hand.length": -20.0 * (x.q_K[1] - 0.7) - 9.0 * x.v_K[1]}

    stepper = arm.stepper(x0)
    states = stepper.run(3.0, law, rate=100)
    assert len(asked) == 300 and len(states) == 301
    assert np.allclose(np.diff(asked), 0.01)
    assert stepper.state.q_K[1] == pytest.approx(0.7, abs=1e-3)


def test_an_unknown_driven_name_is_an_error(arm):
    stepper = arm.stepper(arm.rest({"hand.length": 0.8}))
    with pytest.raises(fan.UnknownNameError, match=r"hand\.length"):
        stepper.advance(0.1, {"hand.lenght": 1.0})


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_law_that_gives_no_number_is_a_status(arm, method, number):
    """17.8: `event` went on without the string whose height was no number, and said DONE."""
    x0 = arm.rest({"hand.length": 0.8})
    for asked in ({"acc_K": {"hand.x": number}}, {"u_D": [number, 0.0]}):
        stepper = arm.stepper(x0, method)
        x = stepper.advance(0.1, **asked, throw=False)
        assert stepper.status in (fan.Status.NOT_FINITE, fan.Status.NOT_SETTLED)
        assert np.all(np.isfinite(x.q_D)) and x.t < 0.1
