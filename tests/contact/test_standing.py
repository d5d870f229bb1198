"""Puppets that stand or lie: their rest, modes, linear systems and gradients."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import fantoccini as fan
from contact.bodies import G
from contact.files import STOOL
from oracles.differences import apart, moved

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

TOY = """
puppet: toy
floor: 0
contact: {friction: 0.6}
bodies:
- {name: toy, joint: {type: free}, mass: 0.4, com: [0, 0, -0.03], inertia: [6e-4, 9e-4, 5e-4],
   shapes: [{type: sphere, radius: 0.1}]}
pose: {toy.z: 0.1}
"""
LAMP = """
puppet: lamp
floor: 0
contact: {friction: 0.5}
bodies:
- {name: foot, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.2, 0.02], mass: 2}]}
- {name: stem, parent: foot, mass: 0.3, com: [0, 0, 0.25], inertia: [4e-3, 4e-3, 1e-5],
   joint: {name: hinge, type: revolute, axis: [0, 1, 0], at: [0, 0, 0.01], damping: 0.01,
           spring: {stiffness: 3, rest: 0.2}}}
strings:
- {name: line, path: [{body: stem, at: [0, 0, 0.5]}, {driven: [x], at: [0.1, 0, 2]}],
   length: driven}
pose: {foot.z: 0.01, line.length: 1.6}
"""


@pytest.fixture(scope="module")
def stool() -> fan.Marionette:
    return fan.loads(STOOL)


def test_a_self_righting_toy_rocks_at_its_frequency():
    """omega^2 = m g d / (I + m (R - d)^2) about each axis; it spins freely about the vertical."""
    toy = fan.loads(TOY)
    x = toy.rest({"toy.rotation": [0.1, -0.05, 0.0]})
    assert "derivatives" not in vars(toy.libraries)  # it takes as long to compile as the model
    assert np.max(np.abs(toy.linearise(x).acc_D)) < 1e-7
    modes = toy.modes(x)
    arm = 0.4 * 0.07**2
    expected = np.sqrt(0.4 * G * 0.03 / (np.array([9e-4, 6e-4]) + arm))
    frequencies = [2.0 * np.pi * mode.frequency for mode in modes.swinging]
    assert frequencies == pytest.approx(sorted(expected), rel=1e-7)
    assert [mode.damping for mode in modes.swinging] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert len(modes) == 3 and abs(modes[2].s) < 1e-5
    assert [point.name for point in modes.contacts] == ["toy|floor"]


def test_a_stem_on_a_flat_foot_swings_as_a_pendulum_upside_down():
    """I phiddot + c phidot + (k - m g l cos phi) phi = 0 about rest, k (phi - 0.2) = m g l sin."""
    lamp = fan.loads(LAMP)
    x = lamp.rest()
    phi = x["hinge"]
    assert 3 * (phi - 0.2) == pytest.approx(0.3 * G * 0.25 * np.sin(phi), abs=1e-9)
    modes = lamp.modes(x)
    (mode,) = modes
    inertia, stiffness = 4e-3 + 0.3 * 0.25**2, 3 - 0.3 * G * 0.25 * np.cos(phi)
    omega = np.sqrt(stiffness / inertia)
    assert 2 * np.pi * mode.frequency == pytest.approx(omega, rel=1e-9)
    assert mode.damping == pytest.approx(0.01 / (2 * omega * inertia), rel=1e-9)
    assert {point.mode for point in modes.contacts} == {"stick"} and modes.rows == ()


def test_at_rest_on_the_floor_rows_with_force_are_taut(promenade):
    """The head's string and both knees' limits are active; contact carries the rest."""
    x = promenade.rest()
    names = np.array(promenade.tree.row_names)
    lin = promenade.linearise(x)
    assert {"head", "knee_joint_left.lower", "knee_joint_right.lower"} <= set(names[x.taut])
    assert tuple(names[x.taut]) == lin.rows
    assert lin.tension[0] == pytest.approx(0.58, abs=0.01)
    assert np.array_equal(promenade.project(x).taut, x.taut)
    bare = x.replace(taut=np.zeros_like(x.taut))
    assert np.array_equal(promenade.project(bare).taut, x.taut)
    assert np.max(np.abs(lin.acc_D)) < 1e-7


def test_the_modes_of_a_puppet_that_stands_are_those_of_its_linear_system(promenade):
    """Every s is an eigenvalue of A; A has two more zeros for every active row."""
    x = promenade.rest()
    modes, A = promenade.modes(x), promenade.linearise(x).A
    assert "head" in modes.rows and {p.mode for p in modes.contacts} == {"stick"}
    assert len(modes.swinging) > 5
    n = promenade.coordinates.n_vD
    values = scipy.linalg.eigvals(A[: 2 * n, : 2 * n])
    for mode in modes:
        if abs(mode.s) > 1.0:
            assert np.min(np.abs(values - mode.s)) < 1e-5 * abs(mode.s)


def step_differences(puppet: fan.Marionette, x: fan.State, d: np.ndarray, size: float, dt: float):
    """Difference quotient of a step by (q_D, v_D, q_K, v_K, acc_K, u_D)."""
    t = puppet.coordinates
    places = np.cumsum([t.n_vD, t.n_vD, t.n_vK, t.n_vK, t.n_vK])

    def end(s: float) -> fan.State:
        q_D, v_D, q_K, v_K, acc, u = np.split(s * size * d, places)
        moved_state = x.replace(
            q_D=moved(x.q_D, q_D, t.scalars_D, t.quaternions_D),
            v_D=x.v_D + v_D,
            q_K=moved(x.q_K, q_K, t.scalars_K, t.quaternions_K),
            v_K=x.v_K + v_K,
        )
        return puppet.stepper(moved_state, fan.TimeStepping(dt=dt)).advance(dt, acc, u_D=u)

    def apart_by(s: float) -> np.ndarray:
        a, b = end(-s), end(s)
        dq = apart(a.q_D, b.q_D, t.n_vD, t.scalars_D, t.quaternions_D)
        return np.concatenate([dq, b.v_D - a.v_D]) / (2.0 * s * size)

    return 1.5 * apart_by(1.0) - 0.6 * apart_by(2.0) + 0.1 * apart_by(3.0)


def test_derivatives_of_a_step_flat_on_both_feet_hold_for_consistent_changes(stool):
    """The hips' distance couples both feet: they tilt together or not at all."""
    x, dt, n = stool.state(), 0.002, stool.coordinates.n_vD
    lin = stool.linearise_step(x, dt=dt)
    assert lin.differentiable and [point.mode for point in lin.contacts] == ["stick"] * 8
    steps = stool.linearise_steps(x.q_D, x.v_D, x.q_K, x.v_K, dt=dt, forces=True)
    assert steps.differentiable.all() and steps.settled.all()
    assert np.allclose(steps.A[0], lin.A, rtol=0, atol=1e-9 * np.max(np.abs(lin.A)))
    by = np.concatenate([lin.A, lin.B, lin.B_u], axis=1)
    names = stool.coordinates.v_D
    left, right = names.index("hip_left.wx"), names.index("hip_right.wx")
    directions = list(np.eye(3 * n))
    both = directions[left] + directions[right]
    directions = [d for i, d in enumerate(directions) if i not in (left, right)] + [both]
    for d in directions:
        size = 1e-8 if np.any(d[:n]) else 1e-6 if np.any(d[n : 2 * n]) else 1e-4
        expected = step_differences(stool, x, d, size, dt)
        assert np.allclose(by @ d, expected, rtol=0, atol=1e-6 * (1.0 + np.max(np.abs(expected))))


def test_continuous_and_discrete_time_agree_on_a_puppet_that_stands(promenade):
    """A dt + 1 equals the step's A, to its order, along motions allowed by the soles."""
    x, n, dt = promenade.rest(), promenade.coordinates.n_vD, 1e-4
    flow, step = promenade.linearise(x), promenade.linearise_step(x, dt=dt)
    assert step.differentiable and step.rows == flow.rows
    values, modes = scipy.linalg.eig(flow.A[: 2 * n, : 2 * n])
    slow = [i for i in range(2 * n) if 1.0 < abs(values[i]) < 300.0]
    assert len(slow) > 10
    for i in slow:
        z = modes[:, i]
        grown = step.A[: 2 * n, : 2 * n] @ z
        assert np.max(np.abs(grown - np.exp(values[i] * dt) * z)) < 1e-5 * np.max(np.abs(z))


def gradient_of_last(puppet: fan.Marionette, x: fan.State, n: int, more: dict[str, np.ndarray]):
    """Cost of a rollout's last state under changes of its inputs, and the gradient."""
    t, rng = puppet.coordinates, np.random.default_rng(5)
    by_q, by_v = rng.normal(size=(2, t.n_vD))

    def made(change: dict[str, np.ndarray]) -> fan.dynamics.Rollout:
        moved_state = x.replace(
            q_D=moved(x.q_D, change.get("q_D", np.zeros(t.n_vD)), t.scalars_D, t.quaternions_D),
            v_D=x.v_D + change.get("v_D", 0.0),
        )
        acc = np.zeros((n, t.n_vK)) + change.get("acc_K", 0.0)
        return puppet.rollout(moved_state, acc, np.zeros((n, t.n_vD)) + change.get("u_D", 0.0))

    run = made({})
    own = np.zeros((2, n + 1, t.n_vD))
    own[0, -1], own[1, -1] = by_q, by_v
    gradient = run.gradient(q_D=own[0], v_D=own[1])
    assert run.differentiable.all()

    def cost(change: dict[str, np.ndarray]) -> float:
        at = made(change)
        assert np.array_equal(at.n_contacts, run.n_contacts)
        dq = apart(run.q_D[-1], at.q_D[-1], t.n_vD, t.scalars_D, t.quaternions_D)
        return float(by_q @ dq + by_v @ (at.v_D[-1] - run.v_D[-1]))

    for name, d in more.items():
        expected = (cost({name: d}) - cost({name: -d})) / 2.0
        terms = getattr(gradient, name) * d
        scale = max(float(np.sum(np.abs(terms))), abs(expected))
        assert abs(np.sum(terms) - expected) < 1e-5 * scale + 1e-13, name


def test_rollouts_of_a_puppet_on_both_feet_have_gradients(stool):
    t, rng = stool.coordinates, np.random.default_rng(1)
    dq = 1e-8 * rng.normal(size=t.n_vD)
    dq[t.v_D.index("hip_left.wx")] = dq[t.v_D.index("hip_right.wx")]
    changes = {
        "q_D": dq,
        "v_D": 1e-6 * rng.normal(size=t.n_vD),
        "u_D": 1e-3 * rng.normal(size=(12, t.n_vD)),
    }
    gradient_of_last(stool, stool.state(), 12, changes)


def test_rollouts_of_the_standing_marionette_have_gradients(promenade):
    """The shoulders' strings keep their lengths: shorter ones would lift the soles."""
    t, rng = promenade.coordinates, np.random.default_rng(2)
    others = np.array(["shoulder" not in name for name in t.v_K])
    changes = {
        "v_D": 1e-7 * rng.normal(size=t.n_vD),
        "u_D": 1e-5 * rng.normal(size=(12, t.n_vD)),
        "acc_K": 1e-4 * others * rng.normal(size=(12, t.n_vK)),
    }
    gradient_of_last(promenade, promenade.rest(), 12, changes)
