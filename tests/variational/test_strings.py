"""Strings, limits and winches in the variational integrator: one-sided, exact and plastic."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import puppets
from fantoccini.base.errors import SimulationError, Status
from fantoccini.motion import EventKind
from variational import rigs

pytestmark = pytest.mark.slow

MAX_OVERLENGTH = 1e-11
"""Largest path length beyond the string's length [m]."""


def variational(puppet, x, inputs=None, t_end=None, dt=0.01, **more):
    simulate = fan.simulate if isinstance(x, fan.State) else fan.simulate_batch
    return simulate(puppet, x, inputs, t_end, method=fan.Variational(dt=dt), **more)


@pytest.fixture(scope="module")
def pendulum():
    return puppets.string_pendulum()


def test_a_flight_and_its_catch_converge(pendulum):
    """The bob leaves its circle, flies and is caught; both parts are at least of first order."""
    x = pendulum.rest().replace(v_D=np.array([5.2, 0.0]))
    exact = fan.simulate(pendulum, x, t_end=2.0, method=fan.Event(rtol=1e-12, atol=1e-12))
    catch = next(e for e in exact.events if e.kind is EventKind.CATCH)
    off = []
    for dt in (0.01, 0.005, 0.0025, 0.00125):
        run = variational(pendulum, x, t_end=2.0, dt=dt)
        kinds = [e.kind for e in run.events]
        assert kinds == [EventKind.RELEASE, EventKind.CATCH]
        assert abs(run.events[1].t - catch.t) <= 1.5 * dt
        assert run.events[1].impulse == pytest.approx(catch.impulse, rel=10.0 * dt)
        assert run.ledger["impact"][-1] == pytest.approx(exact.ledger["impact"][-1], rel=dt)
        assert np.max(run.violation.values) < MAX_OVERLENGTH
        assert np.min(run.tension.values) >= 0.0
        off.append(np.max(np.abs(run.q_D[-1] - exact.q_D[-1])))
    assert np.log2(off[0] / off[-1]) / 3 > 1.0
    assert off[-1] < 1e-4


def test_a_taut_string_bears_the_weight_and_a_slack_one_nothing(pendulum):
    hangs = variational(pendulum, pendulum.rest(), t_end=0.5)
    assert hangs.tension["line"] == pytest.approx(0.5 * 9.81, rel=1e-12)
    lifted = pendulum.rest().replace(q_D=np.array([0.0, -0.5]))
    falls = variational(pendulum, lifted, t_end=0.3)
    assert np.max(falls.tension["line"]) == 0.0 and not np.any(falls.taut["line"])
    assert falls.q_D[-1, 1] == pytest.approx(-0.5 - 0.5 * 9.81 * 0.09, abs=1e-12)


def test_a_string_that_is_caught_in_the_first_step_bears_nothing_before(pendulum):
    x = pendulum.rest().replace(q_D=np.array([0.0, -0.99]), v_D=np.array([0.0, -2.0]))
    run = variational(pendulum, x, t_end=0.05)
    assert run.tension["line"][0] == 0.0 and not run.taut["line"][0]
    assert run.events[0].kind is EventKind.CATCH and run.events[0].t == 0.01


def test_catches_are_plastic(pendulum):
    """After a catch the speed along the string is 0, in the same step."""
    x = pendulum.rest().replace(q_D=np.array([0.3, -0.4]), v_D=np.array([1.0, -3.0]))
    run = variational(pendulum, x, t_end=0.6, dt=0.01)
    at = next(i for i, taut in enumerate(run.taut["line"]) if taut)
    assert abs(run.q_D[at] @ run.v_D[at]) < 1e-10
    assert run.ledger["impact"][-1] > 0.1
    assert run.ledger["kinetic"][at] < run.ledger["kinetic"][at - 1]


def test_shaken_strings_keep_their_lengths_and_never_push():
    puppet = rigs.marionette()
    x = puppet.rest()
    rng = np.random.default_rng(4)
    thrown = puppet.project(x.replace(v_D=rng.normal(size=puppet.coordinates.n_vD)))
    run = variational(puppet, thrown, t_end=3.0, dt=0.01)
    kinds = {e.kind for e in run.events}
    assert {EventKind.CATCH, EventKind.RELEASE, EventKind.LIMIT_ON} <= kinds
    assert np.max(run.violation.values) < MAX_OVERLENGTH
    assert np.min(run.tension.values) >= 0.0 and np.min(run.limit_force.values) >= 0.0
    assert all(e.impulse > 0.0 for e in run.events if e.kind is EventKind.CATCH)


BENCH = """
puppet: bench
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
  - name: arm
    joint: {type: revolute, axis: [0, 1, 0], damping: 3.0}
    mass: 0.1
    com: [0, 0, -0.2]
    inertia: [1e-3, 1e-3, 1e-4]
  - name: hand
    parent: arm
    joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, -0.4], spring: {stiffness: 40.0, rest: 0.2}}
    mass: 0.02
    com: [0, 0, -0.05]
    inertia: [5e-5, 5e-5, 1e-5]
strings:
  - {name: left, path: [{body: bob}, {driven: [x], at: [-1, 0, 1]}], length: driven}
  - {name: right, path: [{body: bob}, {world: [1, 0, 1]}], length: driven}
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: driven, max_tension: 15,
     rewind_speed: 0.3}
pose: {left.length: 5, right.length: 5, line.length: 5}
"""
"""A bob on two strings and a winch that slips, beside a stiff and heavily damped arm."""


@pytest.fixture(scope="module")
def bench():
    return fan.loads(BENCH)


def test_strings_pulled_apart_end_with_their_names(bench):
    x = bench.rest({"left.length": 1.6, "right.length": 1.6})
    pull = fan.Input.waypoints(bench, {"left.x": [(0, -1), (1, -2.5)]})
    with pytest.raises(SimulationError, match="left, right") as caught:
        variational(bench, x, pull, 1.0)
    run = caught.value.trajectory
    assert caught.value.status in (Status.TENSION_CAP, Status.IMPOSSIBLE_INPUT)
    exact = fan.simulate(bench, x, pull, 1.0, throw=False)
    assert run.t[-1] == pytest.approx(exact.t[-1], abs=2e-3)
    assert np.all(np.isfinite(run.q_D)) and np.max(run.violation.values) < MAX_OVERLENGTH
    seldom = variational(bench, x, pull, 1.0, save_every=50, throw=False)
    assert seldom.t[-1] == run.t[-1], "the last state is written whatever is saved"


def test_stiff_springs_and_heavy_damping_do_not_stop_it(bench):
    """A step that the iteration cannot solve is halved; the motion agrees with the event method."""
    x = bench.rest({"line.length": 0.8})
    x = x.replace(q_D=x.q_D + np.array([0, 0, 1.0, 0.3]))
    exact = fan.simulate(bench, x, t_end=0.5)
    off = []
    for dt in (0.01, 0.0025):
        # The longer step is 3.6 / omega of the spring: its ledger may show a gain of energy.
        run = variational(bench, x, t_end=0.5, dt=dt, throw=False)
        off.append(np.max(np.abs(run.q_D[-1, 2:] - exact.q_D[-1, 2:])))
    print(f"off by {off}")
    assert run.status is fan.Status.DONE
    assert off[1] < 0.01 and off[1] < 0.5 * off[0]


def test_steps_of_a_microsecond_are_solved_too():
    """Rounding of the lengths acts as a speed, and is large compared with the change of momenta."""
    run = variational(rigs.marionette(), rigs.gentle(0.5), t_end=3e-5, dt=1e-6)
    assert np.max(run.violation.values) < 1e-14 and not run.events


def test_a_winch_slips_at_its_largest_tension(bench):
    x = bench.rest({"line.length": 0.8})
    jerk = fan.Input.waypoints(bench, {"line.length": [(0, 0.8), (0.3, 0.55)]})
    exact = fan.simulate(bench, x, jerk, 0.6, method=fan.Event(rtol=1e-12, atol=1e-12))
    assert np.max(exact.slip["line"]) > 0.005
    run = variational(bench, x, jerk, 0.6, dt=0.001)
    assert np.max(run.tension["line"]) <= 15.0 * (1 + 1e-12)
    assert np.max(run.slip["line"]) == pytest.approx(np.max(exact.slip["line"]), rel=0.02)
    assert run.ledger["slip"][-1] == pytest.approx(exact.ledger["slip"][-1], rel=0.02)
    assert np.max(run.violation.values) < MAX_OVERLENGTH
    assert {e.kind for e in run.events} >= {EventKind.SLIP, EventKind.GRIP}


def test_steppers_and_batches_make_the_same_motion(pendulum):
    x = pendulum.rest().replace(v_D=np.array([5.2, 0.0]))
    run = variational(pendulum, x, t_end=1.5)
    many = variational(pendulum, [x, pendulum.rest()], t_end=1.5, save="all")
    assert list(many.status) == [Status.DONE, Status.DONE]
    assert many.q_D[0] == pytest.approx(run.q_D, abs=1e-10)
    assert many.v_D[0] == pytest.approx(run.v_D, abs=1e-9)
    assert many.tension["line"][0] == pytest.approx(run.tension["line"], abs=1e-7)
    assert np.array_equal(many.taut["line"][0], run.taut["line"])
    assert list(many.catches) == [1, 0]
    stepper = pendulum.stepper(x, fan.Variational(dt=0.01))
    for k in range(1, 31):
        stepper.advance(0.05)
        assert stepper.state.q_D == pytest.approx(run.q_D[5 * k], abs=1e-10)


def test_a_trajectory_of_a_batch_is_independent_of_its_neighbours(bench):
    """Lanes that swing, that halve their steps, that slip and that stop, in either order."""
    x = bench.rest({"left.length": 1.6, "right.length": 1.6, "line.length": 0.9})
    wild = x.replace(q_D=x.q_D + np.array([0, 0, 1.0, 0.3]), v_D=np.array([0, 0, 30.0, -60.0]))
    hold = fan.Input.hold(bench)
    pull = fan.Input.waypoints(bench, {"left.x": [(0, -1), (0.3, -2.5)]})
    jerk = fan.Input.waypoints(bench, {"line.length": [(0, 0.9), (0.2, 0.6)]})
    cases = [(x, hold), (x, pull), (wild, hold), (wild, pull), (x, jerk), (wild, jerk)] * 2

    def batch(order):
        states, inputs = zip(*order, strict=True)
        return variational(bench, list(states), list(inputs), 0.4, save="all", threads=1)

    there, back = batch(cases), batch(cases[::-1])
    for name in ("status", "reached", "violation", "catches", "q_D", "v_D", "acc_D"):
        assert np.array_equal(getattr(there, name), getattr(back, name)[::-1], equal_nan=True), name
    for name in ("tension", "limit_force", "taut", "slip", "ledger", "attribution"):
        own, other = getattr(there, name).values, getattr(back, name).values
        assert np.array_equal(own, other[::-1], equal_nan=True), name
    for k, (start, inputs) in enumerate(cases[:6]):
        alone = variational(bench, start, inputs, 0.4, throw=False)
        assert alone.status == Status(there.status[k])
        assert alone.t[-1] == pytest.approx(there.reached[k], abs=1e-6)
        n = int(np.sum(np.isfinite(there.q_D[k, :, 0])))
        assert there.q_D[k, :n] == pytest.approx(alone.q_D[:n], abs=1e-7)
    assert Status.DONE in there.status and there.status[1] != Status.DONE
