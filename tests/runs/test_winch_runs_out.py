"""A winch that runs out of string stops its run, and only this run, with a status."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import Status

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

METHODS = ("event", "timestepping", "variational")

WINCHES = """
puppet: winches
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1}
  - {name: other, joint: {type: translation, axes: [x, y, z], at: [3, 0, 0]}, mass: 1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: driven}
  - {name: far, path: [{body: other}, {world: [3, 0, 1]}], length: driven}
pose: {line.length: 0.5, far.length: 0.6}
"""
ENDS = np.sqrt(2 * 0.5 / 1.2)
"""Time at which a length of 0.5 m, shrinking at 1.2 m/s^2, runs out [s]."""


@pytest.fixture(scope="module")
def winches():
    return fan.loads(WINCHES)


def wound_in(marionette, x0, acceleration, parts=2):
    """Inputs that wind `line` in at a constant acceleration for 2 s, in several pieces."""
    acc = np.tile([acceleration, 0.0], (parts, 1))
    return fan.Input.segments(marionette, np.linspace(0, 2, parts + 1), x0.q_K, x0.v_K, acc)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parts", [1, 2, 16])
def test_a_winch_that_runs_out_is_a_status(winches, method, parts):
    """No exception; all earlier rows are there, and the string is named."""
    x0 = winches.rest()
    inputs = wound_in(winches, x0, -1.2, parts)
    run = fan.simulate(winches, x0, inputs, method=method, throw=False)
    assert run.status is Status.LENGTH_NOT_POSITIVE
    within = {"event": 1e-5, "timestepping": 0.0021, "variational": 1e-5}[method]
    assert ENDS - within < run.t[-1] < ENDS + 1e-9
    assert run.q_D[-1][2] == pytest.approx(1.0, abs=0.01)
    assert np.all(np.isfinite(run.v_D)) and np.max(run.violation.values) < 1e-6
    assert run.causes == ("line",)
    with pytest.raises(fan.errors.SimulationError, match="driven to zero"):
        fan.simulate(winches, x0, inputs, method=method)


def test_inputs_that_begin_after_the_run_run_out_too(winches):
    """The time is located as in a run that begins with its inputs, not skipped."""
    x0 = winches.rest()
    inputs = wound_in(winches, x0, -1.2, 1)
    for later in (0.0, 1.0):
        run = fan.simulate(winches, x0, inputs.shifted(later), throw=False)
        assert run.status is Status.LENGTH_NOT_POSITIVE and run.causes == ("line",)
        assert run.q_K[-1][0] == pytest.approx(1e-6, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_one_lane_that_runs_out_stops_no_other(winches, method):
    """Each run of a batch has its own end, also if many inputs begin at the state."""
    x0 = winches.rest()
    inputs = [wound_in(winches, x0, a) for a in (0.0, -1.2, 0.1, -4.8)]
    batch = fan.simulate_batch(winches, x0, inputs, 1.5, method=method)
    out_of_length = Status.LENGTH_NOT_POSITIVE
    assert batch.status.tolist() == [Status.DONE, out_of_length, Status.DONE, out_of_length]
    assert batch.reached == pytest.approx([1.5, ENDS, 1.5, ENDS / 2], abs=0.0021)
    attribution = batch.attribution.values
    assert attribution[[1, 3]].tolist() == [[1.0, 0.0], [1.0, 0.0]] and not np.any(
        attribution[[0, 2]]
    )
    wide = fan.motion.Inputs.random(winches, n=8, seed=0, t_end=1.5, every=0.5, reach=0.9)
    ended = fan.simulate_batch(winches, x0, wide, 1.5, method=method).counts()
    assert ended[out_of_length] >= 1 and ended[Status.DONE] >= 1 and sum(ended.values()) == 8


@pytest.mark.parametrize("method", METHODS)
def test_a_stepper_runs_out(winches, method):
    """A feedback loop that winds in for too long gets a status from `advance`."""
    stepper = winches.stepper(winches.rest(), method)
    for _ in range(40):
        x = stepper.advance(0.05, {"line.length": -1.2}, throw=False)
        if stepper.status is not Status.DONE:
            break
    assert stepper.status is Status.LENGTH_NOT_POSITIVE
    assert x.t == pytest.approx(ENDS, abs=0.0021)
    with pytest.raises(fan.errors.SimulationError, match="driven to zero"):
        stepper.advance(0.05)


def test_a_length_that_only_dips_runs_out(winches):
    """This holds even if it is positive again long before the end of the next step."""
    x0 = winches.rest()
    dip = 0.5 + 1e-4
    times = np.array([0.0, 1.0, 2.0])
    acc = np.array([[-2 * dip, 0.0], [6 * dip, 0.0]])
    inputs = fan.Input.segments(winches, times, x0.q_K, x0.v_K, acc)
    run = fan.simulate(winches, x0, inputs, throw=False, method=fan.Event(rtol=1e-3, atol=1e-3))
    assert run.status is Status.LENGTH_NOT_POSITIVE and run.causes == ("line",)
    assert run.t[-1] == pytest.approx(np.sqrt(0.5 / dip), abs=1e-5)


def test_a_flow_ends_where_its_winch_runs_out(winches):
    """Other integrators go no further either."""
    x0 = winches.rest()
    assert winches.flow(x0, wound_in(winches, x0, -1.2)).t_end == pytest.approx(ENDS, abs=1e-5)


def test_a_mistake_in_waypoints_is_still_one(winches):
    """A negative length in waypoints is refused immediately."""
    with pytest.raises(fan.errors.InputError, match=r"line\.length: .* must stay above 0"):
        fan.Input.waypoints(winches, {"line.length": [(0, 0.5), (1, 0.0)]})
