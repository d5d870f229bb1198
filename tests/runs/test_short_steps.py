"""The last step of a run with fixed steps may be short, without an impact."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import Status

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

SWING = """
puppet: short_swing
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 0.1}
  - {name: far, joint: {type: translation, axes: [x, y, z], at: [3, 0, 0]}, mass: 0.1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 0.5]}], length: 0.5}
  - {name: rod, path: [{body: far}, {world: [3, 0, 0.5]}], length: 0.5, wire: true}
"""
REMAINDERS = np.append(np.geomspace(1e-8, 1e-3, 16), [9e-7, 1.9e-3])
"""Last steps [s]; below 1e-6 of a step they are part of the one before."""
DT, WHOLE = 0.002, 0.1


@pytest.fixture(scope="module")
def swing():
    return fan.loads(SWING)


def swinging(marionette):
    x0 = marionette.rest()
    return x0.replace(v_D=np.array([2.0, 0.5, 0.0, 2.0, 0.5, 0.0]))


def energies(run):
    return run.ledger["kinetic"] + run.ledger["potential"]


@pytest.mark.parametrize("remainder", REMAINDERS)
def test_a_short_last_step_gains_no_energy(swing, remainder):
    """It corrected a violation within itself, at up to 1 m/s, and kept that speed."""
    x0 = swinging(swing)
    run = fan.simulate(swing, x0, t_end=WHOLE + remainder, method=fan.TimeStepping(dt=DT))
    assert run.t[-1] - run.t[-2] == pytest.approx(remainder, rel=1e-6)
    assert np.max(run.violation.values[-2]) > 1e-6
    change = np.linalg.norm(run.v_D[-1] - run.v_D[-2])
    largest = np.max(np.linalg.norm(np.diff(run.v_D[:-1], axis=0), axis=1))
    # Both bobs change from moving out at violation / dt to moving in at this speed, and no faster.
    recovery = 2.0 * np.sqrt(2.0) * np.max(run.violation.values[-2]) / DT
    assert change <= 1.1 * (largest * remainder / DT + recovery)
    swings = np.max(np.abs(np.diff(energies(run)[:-1])))
    assert abs(energies(run)[-1] - energies(run)[-2]) < 5.0 * swings


def test_short_last_steps_are_the_same_in_lanes(swing):
    """A batch's last step equals the single run's."""
    x0 = swinging(swing)
    states = [x0.replace(v_D=x0.v_D * k) for k in (1.0, 0.5, -1.0, 0.2, 0.7)]
    for remainder in REMAINDERS[::5]:
        t_end = WHOLE + remainder
        batch = fan.simulate_batch(swing, states, t_end=t_end, method=fan.TimeStepping(dt=DT))
        assert batch.done.all()
        for i, x in enumerate(states):
            single = fan.simulate(swing, x, t_end=t_end, method=fan.TimeStepping(dt=DT))
            assert batch.v_D[i, -1] == pytest.approx(single.v_D[-1], abs=1e-9)


@pytest.mark.parametrize("remainder", [1e-6, 1e-5, 1e-4, 1e-3])
def test_a_catch_within_a_short_step_is_exact(swing, remainder):
    """A slack string closes within the step, and moves no farther."""
    x0 = swing.rest()
    start = x0.q_D.copy()
    speed = 2.0
    start[2] += 0.5 * remainder * speed  # half a short step away from its length
    x = x0.replace(q_D=start, v_D=np.array([0.0, 0.0, -speed, 0.0, 0.0, 0.0]), taut=())
    run = fan.simulate(swing, x, t_end=remainder, method=fan.TimeStepping(dt=DT))
    assert len(run) == 2
    assert abs(swing.constraint(run.state(1))[0]) < 1e-9


def test_many_short_pieces_keep_the_energy(swing):
    """A stepper with pieces shorter than its step keeps swinging."""
    x0 = swinging(swing)
    stepper = swing.stepper(x0, fan.TimeStepping(dt=DT))
    full_run = fan.simulate(swing, x0, t_end=0.1, method=fan.TimeStepping(dt=DT))
    rng = np.random.default_rng(3)
    while stepper.state.t < 0.1:
        stepper.advance(float(10.0 ** rng.uniform(-6, -3)))
        assert stepper.status is Status.DONE
    speed = np.linalg.norm(full_run.v_D[-1])
    assert np.linalg.norm(stepper.state.v_D) == pytest.approx(speed, rel=0.02)
