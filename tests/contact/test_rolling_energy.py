"""Energy of bodies that roll without slip, by fixed steps."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

RADII = np.array([0.03, 0.025, 0.022])


@pytest.fixture(scope="module")
def egg() -> fan.Marionette:
    return fan.loads(f"""
puppet: egg
floor: 0
contact: {{friction: 0.3}}
bodies:
- name: egg
  joint: {{type: free}}
  shapes: [{{type: ellipsoid, radii: {RADII.tolist()}, mass: 1}}]
""")


def rolling(egg: fan.Marionette, turn: np.ndarray, axis: np.ndarray, speed: float) -> fan.State:
    """An egg on the floor that rolls at an angular velocity [rad/s] about an axis of the world."""
    w, x, y, z = turn / np.linalg.norm(turn)
    R = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    height = float(np.linalg.norm(RADII * R[2]))
    lowest = -R @ (RADII**2 * R[2]) / height
    spin = speed * axis / np.linalg.norm(axis)
    at = egg.state({"egg.z": height, "egg.rotation": (w, x, y, z)})
    return at.replace(v_D=np.concatenate([-np.cross(spin, lowest), R.T @ spin]))


def starts(egg: fan.Marionette, n: int, speed: float) -> list[fan.State]:
    rng = np.random.default_rng(0)
    return [rolling(egg, rng.normal(size=4), rng.normal(size=3), speed) for _ in range(n)]


def change(run: fan.Trajectory | fan.Trajectories) -> np.ndarray:
    """(..., T) change of the energy, relative to that at the start."""
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    return energy / energy[..., :1] - 1.0


@pytest.mark.parametrize(("speed", "which"), [(20.0, slice(0, 10)), (40.0, slice(9, 10))])
def test_rolling_without_slip_keeps_the_energy_for_a_minute(egg, speed, which):
    """It changes by at most 1 % in steps of 2 ms; the error converges with the step."""
    left = []
    for dt in (2e-3, 1e-3):
        changes = []
        for x in starts(egg, 10, speed)[which]:
            run = fan.simulate(egg, x, t_end=60.0, method=fan.TimeStepping(dt=dt), effort=False)
            assert run.status is Status.DONE
            assert run.ledger["friction"][-1] < 1e-3 * run.ledger["kinetic"][0]
            changes.append(np.max(np.abs(change(run))))
        left.append(np.max(changes))
    assert left[0] < 0.01
    assert left[1] < 0.6 * left[0]


def test_rolling_in_lanes_keeps_the_energy_as_alone(egg):
    initial = starts(egg, 8, 20.0)
    method = fan.TimeStepping(dt=2e-3)
    lanes = fan.simulate_batch(egg, initial, t_end=0.4, method=method, save="all", save_every=1)
    for i in (0, 5):
        single_run = fan.simulate(egg, initial[i], t_end=0.4, method=method)
        assert np.allclose(lanes.q_D[i], single_run.q_D, rtol=0, atol=1e-9)
        assert np.allclose(lanes.v_D[i], single_run.v_D, rtol=0, atol=1e-7)


def test_rolling_follows_the_event_driven_run(egg):
    """Fixed steps converge to the motion of an adaptive integrator of high order."""
    x = starts(egg, 2, 20.0)[1]
    reference = fan.simulate(egg, x, t_end=0.5)
    deviations = []
    for dt in (2e-3, 1e-3):
        run = fan.simulate(egg, x, t_end=0.5, method=fan.TimeStepping(dt=dt))
        deviations.append(np.max(np.abs(run.q_D[-1] - reference.q_D[-1])))
    assert deviations[1] < 0.6 * deviations[0] < 0.6 * 5e-3


def test_gradients_of_rolling_are_those_of_the_rollout_and_converge(egg):
    """A rollout's points stop at the start of a step, those of a live run in its middle.

    The derivative of the end by the speed is that of the rollout to 1e-5; beside the event-driven
    one it is wrong by up to 5 % in steps of 2 ms, and half as much in steps of 1 ms.
    """
    rng, d = np.random.default_rng(0), 1e-4
    turn, axis = [(rng.normal(size=4), rng.normal(size=3)) for _ in range(10)][9]

    def start(share: float) -> fan.State:
        return rolling(egg, turn, axis, 20.0 * (1.0 + share))

    def slope(end) -> float:
        return float(end(d).q_D[-1, 0] - end(-d).q_D[-1, 0]) / (2.0 * d)

    reference = slope(lambda share: fan.simulate(egg, start(share), t_end=0.5, effort=False))
    deviations = []
    for dt in (2e-3, 1e-3):
        acc_K = np.zeros((round(0.5 / dt), 0))
        run = egg.rollout(start(0.0), acc_K, dt=dt)
        by_end = np.zeros((len(acc_K) + 1, 6))
        by_end[-1, 0] = 1.0
        v_D = (start(d).v_D - start(-d).v_D) / (2.0 * d)
        gradient = float(run.gradient(q_D=by_end).v_D @ v_D)
        assert gradient == pytest.approx(
            slope(lambda share, dt=dt, acc_K=acc_K: egg.rollout(start(share), acc_K, dt=dt)),
            rel=1e-5,
        )
        deviations.append(abs(gradient / reference - 1.0))
    assert deviations[1] < 0.6 * deviations[0] < 0.6 * 0.06
