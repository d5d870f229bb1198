"""Time-stepping: bounded violation, energy, and convergence to the event-driven motion."""

import numpy as np
import pytest

import fantoccini as fan

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

PENDULUM = """
puppet: pendulum
bodies:
  - name: bob
    joint: {type: translation, axes: [x, z]}
    shapes: [{type: sphere, radius: 0.02, mass: 1.0}]
strings:
  - {name: line, path: [{body: bob, at: [0, 0, 0]}, {world: [0, 0, 0]}], length: 1.0}
"""


@pytest.fixture(scope="module")
def pendulum():
    return fan.loads(PENDULUM)


def swing(pendulum, dt, t_end=10.0):
    x0 = pendulum.state({"bob.x": 1.0, "bob.z": 0.0})
    return fan.simulate(pendulum, x0, t_end=t_end, method=fan.TimeStepping(dt=dt))


def height(run):
    return np.hypot(run.q_D[:, 0], run.q_D[:, 1]) - 1.0


def test_a_swing_keeps_its_energy_and_length(pendulum):
    """A purely velocity-level rule would lose more than a joule here."""
    run = swing(pendulum, 0.002)
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    assert abs(energy[-1] - energy[0]) < 0.05
    assert np.max(height(run)) < 1e-4


def test_violation_shrinks_with_the_step(pendulum):
    worst = [np.max(height(swing(pendulum, dt, 2.0))) for dt in (0.004, 0.002, 0.001)]
    assert worst[0] > 3 * worst[1] > 9 * worst[2] > 0


def test_the_motion_converges_at_first_order(pendulum):
    x0 = pendulum.state({"bob.x": 1.0, "bob.z": 0.0})
    reference = fan.simulate(pendulum, x0, t_end=1.0, method=fan.Event(rtol=1e-12, atol=1e-12))
    steps = (4e-3, 2e-3, 1e-3)
    ends = [swing(pendulum, dt, 1.0).q_D[-1] for dt in steps]
    errors = [np.max(np.abs(end - reference.q_D[-1])) for end in ends]
    assert 1.7 < errors[0] / errors[1] < 2.4
    assert 1.7 < errors[1] / errors[2] < 2.4


def test_the_impact_of_a_fall_converges(pendulum):
    """The bob is dropped beside its pivot, falls freely and is caught by the line."""
    x0 = pendulum.state({"bob.x": 0.3, "bob.z": 0.0})
    reference = fan.simulate(pendulum, x0, t_end=0.8)
    assert [e.kind.value for e in reference.events] == ["catch"]
    lost = reference.ledger["impact"][-1]
    errors = []
    for dt in (2e-3, 5e-4):
        run = fan.simulate(pendulum, x0, t_end=0.8, method=fan.TimeStepping(dt=dt))
        errors.append(abs(run.ledger["impact"][-1] - lost))
    assert lost > 1.0
    assert errors[1] < errors[0] < 0.1 * lost


def test_rows_lie_on_the_grid(pendulum):
    run = swing(pendulum, 0.003, 0.01)
    assert np.allclose(run.t, [0.0, 0.003, 0.006, 0.009, 0.01])


@pytest.mark.parametrize("slack", [0.0, 1e-4])
def test_the_ledger_has_a_catch_in_the_first_step(slack):
    """A bob thrown straight down on a taut string loses its whole kinetic energy to the catch."""
    bob = fan.loads("""
puppet: thrown
bodies:
- {name: bob, joint: {type: translation, axes: [x, z]}, mass: 0.5}
strings:
- {name: line, path: [{body: bob, at: [0, 0, 0]}, {world: [0, 0, 1]}], length: 1}
""")
    x0 = bob.state({"bob.z": slack}).replace(v_D=np.array([0.0, -2.0]))
    run = fan.simulate(bob, x0, t_end=0.05, method=fan.TimeStepping(dt=1e-3))
    assert abs(run.ledger["impact"][-1] - 0.5 * 0.5 * 2.0**2) < 0.02
    assert abs(run.ledger["residual"][-1]) < 0.02


def test_inputs_at_rest_equal_creeping_ones():
    """Inputs at rest are written once, and a step between two of them needs no rates: also if a
    whole move is between them, and if every lane of a batch rests at another place.
    """
    arm = fan.puppets.arm2d()
    x0 = arm.rest({"hand.length": 0.8})
    x = float(x0.q_K[0])

    def lift(creep, rise=1e-5):
        # The move lies within the step from 20 to 22 ms.
        length = [(0.0, 0.8), (0.0205, 0.8), (0.0215, 0.8 + rise)]
        ways = {"hand.length": length, "hand.x": [(0.0, x), (0.1, x + creep)]}
        return fan.Input.waypoints(arm, ways)

    how = {"t_end": 0.1, "method": fan.TimeStepping(dt=0.002)}
    rests, creeps = (fan.simulate(arm, x0, lift(creep), **how) for creep in (0.0, 1e-12))
    assert np.max(np.abs(rests.v_D)) > 1e-3
    assert np.max(np.abs(rests.v_D - creeps.v_D)) < 1e-9
    assert np.max(np.abs(rests.ledger.values - creeps.ledger.values)) < 1e-11
    rises = np.linspace(0.0, 1e-5, 9)
    batch = fan.simulate_batch(arm, x0, [lift(0.0, rise) for rise in rises], save="all", **how)
    for i, rise in enumerate(rises):
        single = fan.simulate(arm, x0, lift(0.0, rise), **how)
        assert np.array_equal(batch.trajectory(i).q_K, single.q_K)
        assert np.max(np.abs(batch.trajectory(i).v_D - single.v_D)) < 1e-10
