"""Laws of the variational integrator: second order, energy without drift, conserved momenta."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from variational import rigs

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

STEPS = (0.01, 0.005, 0.0025)


def slope(errors) -> float:
    """Mean order of convergence over halvings of the step."""
    return float(np.log2(errors[0] / errors[-1]) / (len(errors) - 1))


def sway(puppet: fan.Marionette, x: fan.State) -> fan.Input:
    """Input that shifts the first string and winds in the last one, smoothly."""
    start = dict(zip(puppet.coordinates.q_K, x.q_K, strict=True))
    names = puppet.coordinates.q_K
    shift = next(n for n in names if n.endswith(".x"))
    wind = next(n for n in reversed(names) if n.endswith(".length"))
    moves = {shift: 0.01, wind: -0.01}
    return fan.Input.waypoints(
        puppet, {n: [(0.0, start[n]), (0.4, start[n] + by)] for n, by in moves.items()}
    )


@pytest.mark.parametrize("moving", [False, True], ids=["still", "moving inputs"])
@pytest.mark.parametrize("damped", [False, True], ids=["undamped", "damped"])
def test_it_is_of_second_order_between_catches(damped, moving):
    """This holds with damping and moving inputs too, compared with the event-driven motion."""
    puppet = rigs.marionette() if damped else rigs.doll()
    v_D = np.random.default_rng(0).normal(size=puppet.coordinates.n_vD)
    x = rigs.gentle(0.1) if damped else rigs.swinging(puppet, puppet.rest(), v_D)
    inputs = sway(puppet, x) if moving else None
    exact = fan.simulate(puppet, x, inputs, 0.4, method=fan.Event(rtol=1e-12, atol=1e-12))
    assert not [e for e in exact.events if e.kind is fan.motion.EventKind.CATCH]
    off = []
    for dt in STEPS:
        run = fan.simulate(puppet, x, inputs, 0.4, method=fan.Variational(dt=dt))
        ends = [(getattr(run, n)[-1], getattr(exact, n)[-1]) for n in ("q_D", "v_D")]
        off.append([np.max(np.abs(a - b)) for a, b in ends])
        assert run.events == ()
    orders = [slope(errors) for errors in np.transpose(off)]
    print(f"order of q_D and v_D: {orders}")
    assert orders == pytest.approx([2.0, 2.0], abs=0.05)


def test_the_energy_of_a_gentle_swing_does_not_drift():
    """The undamped marionette swings for 100 s in steps of 10 ms, with all strings taut."""
    run = fan.simulate(
        rigs.undamped(),
        rigs.gentle(0.02),
        t_end=100.0,
        method=fan.Variational(dt=0.01),
        save_every=5,
        effort=False,
    )
    E, T = rigs.energy(run), run.ledger["kinetic"]
    blocks = np.array_split(np.arange(len(run.t)), 20)
    means = np.array([[run.t[b].mean(), E[b].mean()] for b in blocks])
    (rate, _), cov = np.polyfit(*means.T, 1, cov=True)
    print(f"slope of E over T: {rate / T.mean():.2e} +- {cov[0, 0] ** 0.5 / T.mean():.1e} /s")
    assert run.events == ()
    assert np.ptp(E) < 5e-3 * T.mean()  # it oscillates with the motion, without drift
    assert abs(rate) < (1e-7 + 3.0 * cov[0, 0] ** 0.5 / T.mean()) * T.mean()
    assert np.max(np.abs(E[run.t <= 10.0] - E[0])) < 2.4e-4
    assert np.max(np.abs(run.violation.values)) < 1e-12
    assert np.min(run.tension.values) > 0.0


def momenta(puppet: fan.Marionette, run: fan.Trajectory) -> np.ndarray:
    """(T, 6) linear momentum and angular momentum about the origin of a puppet on a free joint."""
    momenta = []
    for q, v in zip(run.q_D, run.v_D, strict=True):
        at = puppet.state().replace(q_D=q, v_D=v)
        p = puppet.mass_matrix(at) @ v
        w, u = q[3], q[4:7]
        turn = p[3:6] + 2.0 * np.cross(u, w * p[3:6] + np.cross(u, p[3:6]))
        momenta.append([*p[:3], *(np.cross(q[:3], p[:3]) + turn)])
    return np.array(momenta)


@pytest.mark.parametrize("dt", [0.01, 1.0 / 30.0])
def test_symmetry_conserves_momenta_to_rounding(dt):
    flyer, free = rigs.flyer()
    v_D = 2.0 * np.random.default_rng(0).normal(size=flyer.coordinates.n_vD)
    run = fan.simulate(flyer, free.replace(v_D=v_D), t_end=10.0, method=fan.Variational(dt=dt))
    assert np.ptp(run.q_D[:, 7]) > 0.3, "the leg swings"
    assert np.max(np.ptp(momenta(flyer, run), axis=0)) < 2e-12
    hung = rigs.doll()
    swing = rigs.swinging(hung, hung.rest(), v_D)
    run = fan.simulate(hung, swing, t_end=10.0, method=fan.Variational(dt=dt))
    about = momenta(hung, run)
    assert np.ptp(about[:, 5]) < 1e-13, "about the vertical axis"
    assert np.ptp(about[:, 3]) > 0.01, "the others change"
    assert np.max(run.violation.values) < 1e-12


def test_orientations_stay_unit_quaternions_through_full_turns():
    """No angle is singular: the doll turns over several times."""
    flyer, x = rigs.flyer()
    v_D = np.array([0, 0, 0, 8.0, -5.0, 3.0, 6.0, 4.0, -7.0, 2.0])
    run = fan.simulate(flyer, x.replace(v_D=v_D), t_end=10.0, method=fan.Variational(dt=0.005))
    for first in (3, 7):
        lengths = np.linalg.norm(run.q_D[:, first : first + 4], axis=1)
        assert np.max(np.abs(lengths - 1.0)) < 1e-12
        assert np.ptp(run.q_D[:, first]) > 1.8, "more than a full turn"
    E = rigs.energy(run)
    assert np.ptp(E[len(E) // 2 :]) < 1.5 * np.ptp(E[: len(E) // 2]) + 1e-9


def test_large_steps_stay_stable():
    """The steps are 1/30 s, with shaken strings that go slack and are caught."""
    puppet = rigs.marionette()
    x = puppet.rest()
    start = dict(zip(puppet.coordinates.q_K, x.q_K, strict=True))
    lift = {
        "hand_right.length": [(0.2, 0.0), (0.7, -0.15), (1.0, -0.1), (1.3, -0.15), (2.0, 0.0)],
        "knee_left.length": [(0.5, 0.0), (1.0, -0.1), (1.5, 0.0)],
        "shoulder_left.y": [(0.0, 0.0), (0.5, 0.04), (1.0, -0.04), (1.5, 0.0)],
    }
    inputs = fan.Input.waypoints(
        puppet, {n: [(t, start[n] + by) for t, by in moves] for n, moves in lift.items()}
    )
    run = fan.simulate(puppet, x, inputs, 6.0, method=fan.Variational(dt=1.0 / 30.0))
    assert len(run.events) > 5
    assert np.max(run.violation.values) < 1e-11
    assert np.min(run.tension.values) >= 0.0
    assert np.max(run.ledger["kinetic"]) < 0.1 and run.ledger["kinetic"][-1] < 0.01
    assert np.max(np.abs(run.ledger["residual"])) < 0.03


TURNED = """
puppet: turned
bodies:
  - {name: bar, joint: {type: free, driven: true}}
  - name: weight
    parent: bar
    joint: {type: ball, at: [0.1, 0, 0], damping: 0.002}
    mass: 0.3
    com: [0.02, 0, -0.1]
    inertia: [1.0e-3, 1.0e-3, 4.0e-4]
  - name: bob
    joint: {type: free}
    mass: 0.4
    com: [0, 0, -0.05]
    inertia: [1.0e-3, 1.2e-3, 6.0e-4]
    drag: {linear: 0.05, quadratic: 0.1}
strings:
  - {name: a, path: [{body: bar, at: [-0.2, 0, 0]}, {body: bob, at: [-0.1, 0, 0]}], length: 0.5}
  - {name: b, path: [{body: bar, at: [0, 0.2, 0]}, {body: bob, at: [0, 0.1, 0]}], length: 0.5}
pose: {bar.z: 1.0, bob.z: 0.4}
"""
"""A control bar that carries a weight on a ball joint, and a bob with drag on two strings."""


def test_a_bar_that_turns_and_moves_mass_is_of_second_order():
    """Driven orientations, nonzero M_DK, drag and damping: the motion and the work."""
    puppet = fan.loads(TURNED)
    x = puppet.rest()
    turn = {
        "bar.rotation": [(0.0, [1, 0, 0, 0]), (0.5, [0.2, -0.3, 0.5])],
        "bar.x": [(0.0, 0.0), (0.5, 0.1)],
    }
    inputs = fan.Input.waypoints(puppet, turn)
    exact = fan.simulate(puppet, x, inputs, 0.5, method=fan.Event(rtol=1e-12, atol=1e-12))
    off = []
    for dt in STEPS:
        run = fan.simulate(puppet, x, inputs, 0.5, method=fan.Variational(dt=dt))
        work = run.ledger["work"][-1] - exact.ledger["work"][-1]
        lost = run.ledger["damping"][-1] - exact.ledger["damping"][-1]
        moved = np.max(np.abs(run.q_D[-1] - exact.q_D[-1]))
        off.append([moved, abs(work), abs(lost), np.max(np.abs(run.ledger["residual"]))])
    orders = [slope(errors) for errors in np.transpose(off)]
    print(f"order of q_D, work, damping, residual: {orders}")
    assert orders == pytest.approx([2.0] * 4, abs=0.1)
