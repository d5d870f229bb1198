"""Winches that slip: closed forms of a caught weight, the ledger, formerly impossible pulls."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

MASS, GRAVITY, MAX_TENSION = 1.0, 9.81, 20.0
DROP = 0.5  # m, fall of the weight until its string is taut

WEIGHT = """
puppet: weight
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: 1.0,
     max_tension: {parameter: most, value: 20}}
pose: {bob.z: 0.5}
"""
REWOUND = WEIGHT.replace("value: 20}", "value: 20}, rewind_speed: 0.2")

BETWEEN = """
puppet: between
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: left, path: [{body: bob}, {driven: [x], at: [-1, 0, 0.5]}], length: 1.2,
     max_tension: 30, rewind_speed: 0.3}
  - {name: right, path: [{body: bob}, {driven: [x], at: [1, 0, 0.5]}], length: 1.2}
"""


def kinds(run) -> list[str]:
    return [e.kind.value for e in run.events]


def test_a_caught_weight_slips_until_it_has_stopped():
    """v = sqrt(2 g d) decreases at (max - m g) / m; the winch absorbs max times the slip."""
    weight = fan.loads(WEIGHT)
    run = fan.simulate(weight, weight.state(), t_end=2.0)
    assert kinds(run) == ["catch", "slip", "grip"]
    speed, brake = np.sqrt(2 * GRAVITY * DROP), (MAX_TENSION - MASS * GRAVITY) / MASS
    caught, slipped, gripped = run.events
    assert caught.t == slipped.t == pytest.approx(np.sqrt(2 * DROP / GRAVITY), abs=1e-10)
    assert (caught.impulse, slipped.speed) == (0.0, pytest.approx(speed, abs=1e-10))
    assert gripped.t - slipped.t == pytest.approx(speed / brake, abs=1e-9)
    slip = speed**2 / (2 * brake)
    assert run.slip["line"][-1] == pytest.approx(slip, abs=1e-10)
    assert np.max(run.tension["line"]) == MAX_TENSION
    assert run.ledger["slip"][-1] == pytest.approx(MAX_TENSION * slip, abs=1e-9)
    assert run.ledger["impact"][-1] == 0.0
    assert np.max(np.abs(run.ledger["residual"])) < 1e-9
    assert np.max(run.violation["line"]) < 1e-12
    assert run.tension["line"][-1] == pytest.approx(MASS * GRAVITY, abs=1e-9)


def test_slip_is_wound_back_gently():
    """At the end the winch has all energy of the drop, and the string is never slack again."""
    weight = fan.loads(REWOUND)
    run = fan.simulate(weight, weight.state(), t_end=5.0)
    assert kinds(run) == ["catch", "slip", "grip"]
    assert run.slip["line"][-1] == 0.0
    rate = np.diff(run.slip["line"]) / np.maximum(np.diff(run.t), 1e-9)
    assert np.min(rate) > -0.2 - 1e-9
    assert run.ledger["slip"][-1] == pytest.approx(MASS * GRAVITY * DROP, abs=1e-9)
    assert np.max(np.abs(run.ledger["residual"])) < 1e-9


def test_time_stepping_slips_equally():
    weight = fan.loads(REWOUND)
    reference = fan.simulate(weight, weight.state(), t_end=5.0)
    errors = []
    for dt in (2e-3, 1e-3, 5e-4):
        run = fan.simulate(weight, weight.state(), t_end=5.0, method=fan.TimeStepping(dt=dt))
        assert kinds(run)[:2] == ["catch", "slip"] and "grip" in kinds(run)
        assert np.max(run.tension["line"]) <= MAX_TENSION * (1 + 1e-12)
        errors.append(abs(np.max(run.slip["line"]) - np.max(reference.slip["line"])))
    assert errors[2] < errors[0] < 0.02


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_a_winch_makes_an_impossible_pull_possible(method):
    """Two hands pull a taut line apart: the winch yields by the missing length, and rewinds."""
    between = fan.loads(BETWEEN)
    inputs = fan.Input.waypoints(between, {"left.x": [(0, -1.0), (2, -2.0), (4, -1.0)]})
    run = fan.simulate(between, between.rest(), inputs, t_end=8.0, method=method)
    assert run.status is fan.Status.DONE
    assert 0.6 < np.max(run.slip["left"]) < 0.8
    assert run.slip["left"][-1] == pytest.approx(0.0, abs=1e-9)
    assert np.max(run.tension["left"]) == pytest.approx(30.0, rel=1e-9)
    assert np.max(run.violation.values) < (1e-12 if method == "event" else 1e-4)


def test_a_state_carries_its_slip():
    """A run from another run's last state ends where one run through both does."""
    weight = fan.loads(REWOUND)
    full_run = fan.simulate(weight, weight.state(), t_end=3.0)
    first = fan.simulate(weight, weight.state(), t_end=1.0)
    x = first.state(-1)
    assert x.slip[0] > 0.1
    rest = fan.simulate(weight, x, t_end=3.0)
    assert rest.slip["line"][-1] == pytest.approx(full_run.slip["line"][-1], abs=1e-8)
    assert rest.q_D[-1] == pytest.approx(full_run.q_D[-1], abs=1e-8)
    stepper = weight.stepper(weight.state(), "event")
    assert stepper.advance(1.0).slip[0] == pytest.approx(x.slip[0], abs=1e-9)


def test_a_puppet_too_heavy_for_its_winch_does_not_rest():
    weight = fan.loads(WEIGHT).with_parameters({"most": 8.0})
    with pytest.raises(fan.errors.StateError, match=r"line \(8 N\) does not hold it"):
        weight.rest()
    strong = fan.loads(WEIGHT).with_parameters({"most": 9.9})
    assert strong.rest().q_D[1] == pytest.approx(0.0, abs=1e-9)


def test_a_run_continues_from_every_row_of_another():
    """Slipping, rewinding, braking: the state determines this, compiled and in Python."""
    weight = fan.loads(REWOUND)
    full_run = fan.simulate(weight, weight.state(), t_end=4.0)
    slips = full_run.slip["line"] > 0
    assert np.sum(slips) > 20
    last = {t: i for i, t in enumerate(full_run.t)}.values()  # an event is two rows at one time
    # The winch's acceleration jumps when it begins to brake, and a row there may have either value.
    jumps = np.abs(full_run.slip["line"] - 0.2**2 / 2) < 1e-9
    for i in [i for i in last if slips[i] and not jumps[i]][::2]:
        x = full_run.state(i)
        acc, tension = weight.forward_dynamics(x)
        assert acc == pytest.approx(full_run.acc_D[i], abs=1e-6)
        assert tension == pytest.approx(full_run.tension.values[i], abs=1e-6)
        assert weight.project(x).v_D == pytest.approx(x.v_D, abs=1e-9)
        if x.t < 3.9:
            run = fan.simulate(weight, x, t_end=4.0)
            assert run.q_D[-1] == pytest.approx(full_run.q_D[-1], abs=1e-9)


@pytest.mark.parametrize("t", [1e5, 1e7, 1.7e9])
def test_late_clocks_do_not_stall_a_winch(t):
    weight = fan.loads(REWOUND)
    run = fan.simulate(
        weight, weight.state().replace(t=t), t_end=t + 5.0, method=fan.Event(rtol=1e-8, atol=1e-8)
    )
    assert run.slip["line"][-1] == pytest.approx(0.0, abs=1e-6)
    assert run.q_D[-1][1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("slip", [[0.1, 0.2], [np.nan], [-0.1]])
def test_a_slip_is_a_length_for_every_string(slip):
    weight = fan.loads(WEIGHT)
    with pytest.raises(
        fan.errors.StateError, match=r"^slip(: found .* a length >= 0|\[0\] is nan)"
    ):
        fan.simulate(weight, weight.state().replace(slip=slip), t_end=0.1)


def test_rest_rewinds_slip_where_possible():
    weight = fan.loads(REWOUND)
    x = weight.rest(weight.state().replace(slip=[0.3]))
    assert x.slip[0] == 0.0 and x.q_D[1] == pytest.approx(0.0, abs=1e-9)
    held = fan.loads(WEIGHT)
    assert held.rest(held.state().replace(slip=[0.3])).q_D[1] == pytest.approx(-0.3, abs=1e-9)


def test_slip_is_not_a_violation():
    """Variational batches counted it as one, and had to exclude it from the status."""
    weight = fan.loads(WEIGHT)
    x0 = weight.state()
    batch = fan.simulate_batch(
        weight, [x0, x0], t_end=1.0, method=fan.Variational(dt=0.002), save=("slip", "q_D")
    )
    assert batch.done.all() and np.max(batch.slip["line"]) > 0.1
    assert np.max(batch.violation) < 1e-11


def test_a_winch_that_has_rewound_has_no_negative_slip():
    """18, review: the last step of rewinding left -1e-17 m, and no run could start from there."""
    weight = fan.loads(REWOUND)
    x0 = weight.state()
    for dt in (0.0013, 0.002, 0.0031):
        run = fan.simulate(weight, x0, t_end=4.0, method=fan.TimeStepping(dt=dt))
        slip = run.slip["line"]
        assert slip.max() > 0.01 and slip[-1] == 0.0
        assert np.all(slip >= 0.0)
        for i in np.flatnonzero((slip[:-1] > 0.0) & (slip[1:] == 0.0))[:3] + 1:
            fan.simulate(weight, run.state(i), t_end=run.t[i] + 0.01, method="timestepping")
