"""Strings as chains of masses and springs: statics, waves, energy, SciPy, the massless limit."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from tests.harness import method_of

import fantoccini as fan

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

G, N = 9.81, 6
BOB = """
puppet: rope
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 0.2}
strings:
  - name: line
    path: [{body: bob}, {driven: [x], at: [0, 0, 1]}]
    length: driven
    CHAIN
pose: {bob.z: 0.2, line.length: 0.8}
"""
CHAIN = (
    "chain: {pieces: 6, mass: {parameter: mass, value: 0.03}, "
    "stiffness: {parameter: EA, value: 200}, damping: {parameter: c, value: 0.01}}"
)
SPAN = """
puppet: span
gravity: [0, 0, {parameter: g, value: -9.81}]
bodies: [{name: post}]
strings:
  - name: line
    path: [{world: [0, 0, 0]}, {body: post, at: [1, 0, 0.2]}]
    length: {parameter: L, value: 1.3}
    chain: {pieces: 6, mass: 0.03, stiffness: 200, damping: {parameter: c, value: 0}}
"""


@cache
def rope():
    return fan.loads(BOB.replace("CHAIN", CHAIN))


@cache
def span():
    return fan.loads(SPAN)


def lift(puppet):
    return fan.Input.waypoints(
        puppet, {"line.length": [(0, 0.8), (0.5, 0.6)], "line.x": [(0, 0), (0.3, 0.1), (0.6, 0.05)]}
    )


def test_a_hanging_rope_stretches_by_the_load_of_each_piece():
    x = rope().rest()
    m, piece = 0.03 / (N - 1), 0.8 / N
    carried = 0.2 + m * np.arange(N)  # load of the pieces, from the bob upwards
    z = 1.0 - np.cumsum((piece * (1 + carried * G / 200))[::-1])  # from the top downwards
    assert np.allclose(x.q_D[0::3], 0, atol=1e-12)
    assert np.allclose(x.q_D[2::3], z[::-1], rtol=0, atol=1e-12)


def test_the_hand_on_the_winch_feels_the_pull_by_virtual_work():
    """-dV/dL = mean of T (1 + T / 2 EA) over the pieces."""
    x, table = rope().rest(), rope().coordinates
    still = np.zeros((1, table.n_vD)), np.zeros((1, table.n_vK))
    force = rope().effort(x.q_D[None], still[0], x.q_K[None], still[1], *still, np.zeros((1, 0)))[0]
    T = G * (0.2 + 0.03 / (N - 1) * np.arange(N))
    assert force[table.v_K.index("line.length")] == pytest.approx(
        -np.mean(T * (1 + T / 400)), rel=1e-9
    )


@pytest.mark.parametrize("length", [1.3, 1.05, 0.9])
def test_a_rope_between_posts_hangs_in_the_discrete_catenary(length):
    """One horizontal tension H, and vertical ones that differ by the weight of a mass."""
    puppet = span().with_parameters({"L": length})
    x = puppet.rest().q_D.reshape(-1, 3)
    weight, piece = 0.03 / (N - 1) * G, length / N

    def pieces(H, V):
        pull = np.array([np.full(N, H), V + weight * np.arange(N)])  # of each piece, to the right
        T = np.linalg.norm(pull, axis=0)
        return piece * (1 + T / 200) * pull / T

    def rise(H):
        return brentq(lambda V: pieces(H, V)[1].sum() - 0.2, -400, 400, xtol=1e-15)

    H = brentq(lambda H: pieces(H, rise(H))[0].sum() - 1.0, 1e-4, 100, xtol=1e-15)
    expected = np.cumsum(pieces(H, rise(H)), axis=1)[:, :-1]
    assert np.allclose(x[:, [0, 2]], expected.T, rtol=0, atol=1e-9)
    assert np.allclose(x[:, 1], 0, atol=1e-9)


@pytest.mark.parametrize("along", [False, True])
@pytest.mark.parametrize("j", [1, 3, N - 1])
def test_standing_waves_of_a_taut_chain(along, j):
    """omega_j = 2 sqrt(kappa / m) sin(j pi / 2 n); kappa is T / d across, EA / l along."""
    puppet = span().with_parameters({"L": 0.8, "g": 0.0})
    x = puppet.rest()
    distance = np.hypot(1.0, 0.2)
    kappa = 200 * N / 0.8 if along else 200 * (distance / 0.8 - 1) * N / distance
    omega = 2 * np.sqrt(kappa * (N - 1) / 0.03) * np.sin(j * np.pi / (2 * N))
    across = np.array([1.0, 0, 0.2]) / distance if along else np.array([0.0, 1.0, 0])
    shape = np.outer(np.sin(j * np.pi * np.arange(1, N) / N), across).ravel()
    t = np.linspace(0, 6 * np.pi / omega, 13)
    run = fan.simulate(puppet, x.replace(q_D=x.q_D + 1e-6 * shape), None, t[-1], save_at=t[1:])
    places = np.searchsorted(run.t, t - 1e-12)
    swing = (run.q_D[places] - x.q_D) @ shape / (1e-6 * shape @ shape)
    assert np.allclose(swing, np.cos(omega * t), rtol=0, atol=3e-5)


@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_the_ledger_closes_while_the_rope_is_wound_in(method):
    puppet = rope()
    run = fan.simulate(puppet, puppet.rest(), lift(puppet), 0.8, method=method_of(method, dt=2e-5))
    ledger = run.ledger
    assert ledger["work"][-1] > 0.3
    assert ledger["damping"][-1] > 0
    tolerance = 1e-11 if method == "event" else 1e-3 * ledger["work"][-1]
    assert np.max(np.abs(ledger["residual"])) < tolerance


def test_scipy_agrees_on_the_equations_written_in_points():
    puppet = rope()
    x, inputs = puppet.rest(), lift(puppet)
    bound = inputs.bound(x.q_K)
    mass = np.array([0.2] + [0.03 / (N - 1)] * (N - 1))

    def slope(t, y):
        q, v = y.reshape(2, N, 3)
        (end, length), (end_rate, rate) = (np.ravel(a) for a in bound.evaluate(t)[:2])
        points = np.vstack([q, [end, 0, 1]])
        rates = np.vstack([v, [end_rate, 0, 0]])
        d, dv, piece = np.diff(points, axis=0), np.diff(rates, axis=0), length / N
        size = np.linalg.norm(d, axis=1)
        speed = (d * dv).sum(1) / size - rate / N
        pull = (200 * (size - piece) + 0.01 * speed) / piece
        force = pull[:, None] * d / size[:, None]
        a = (force - np.vstack([np.zeros(3), force[:-1]])) / mass[:, None]
        return np.concatenate([v.ravel(), (a - [0, 0, G]).ravel()])

    y0 = np.concatenate([x.q_D, x.v_D])
    exact = solve_ivp(slope, (0, 0.3), y0, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    run = fan.simulate(puppet, x, inputs, 0.3)
    assert np.allclose(run.q_D[-1], exact[: 3 * N], rtol=0, atol=1e-9)
    assert np.allclose(run.v_D[-1], exact[3 * N :], rtol=0, atol=1e-7)


def test_a_light_stiff_chain_moves_as_the_massless_string():
    massless = fan.loads(BOB.replace("CHAIN", ""))
    exact = fan.simulate(massless, massless.rest(), lift(massless), 0.3).q_D[-1]
    off = []
    for factor in (1, 10, 100):
        puppet = rope().with_parameters({"EA": 200 * factor, "mass": 0.002 / factor, "c": 0.05})
        run = fan.simulate(
            puppet, puppet.rest(), lift(puppet), 0.3, method=fan.Event(rtol=1e-9, atol=1e-9)
        )
        off.append(np.linalg.norm(run.q_D[-1, :3] - exact))
    assert off[1] < 0.15 * off[0]
    assert off[2] < 0.15 * off[1]
    assert off[2] < 1e-4


def test_mujoco_agrees_on_the_pull_of_the_springs():
    mujoco = pytest.importorskip("mujoco")
    from fantoccini.dynamics.mujoco.mjcf_model import mjcf

    puppet = span()
    x = puppet.state()
    rng = np.random.default_rng(0)
    x = x.replace(q_D=x.q_D + 0.05 * rng.normal(size=15), v_D=rng.normal(size=15))
    model = mujoco.MjModel.from_xml_string(mjcf(puppet))
    data = mujoco.MjData(model)
    order = [model.joint(name).qposadr[0] for name in puppet.coordinates.q_D]
    data.qpos[order], data.qvel[order] = x.q_D, x.v_D
    mujoco.mj_forward(model, data)
    assert np.allclose(data.qacc[order], puppet.forward_dynamics(x)[0], rtol=1e-9, atol=1e-7)


def test_mujoco_cannot_wind_a_chain():
    from fantoccini.dynamics.mujoco.mjcf_model import mjcf

    with pytest.raises(fan.errors.ExchangeError, match="a chain with a driven length"):
        mjcf(rope())


def test_a_step_too_long_for_the_springs_is_refused():
    """2 / omega, omega = 2 sqrt(k / m) cos(pi / 2n): just below it a run keeps its energy."""
    puppet = span().with_parameters({"L": 0.8, "g": 0.0})
    x = puppet.rest()
    longest = 1 / (np.sqrt(200 * N / 0.8 * (N - 1) / 0.03) * np.cos(np.pi / (2 * N)))
    shape = 1e-4 * np.random.default_rng(0).normal(size=15)
    moved = x.replace(q_D=x.q_D + shape)
    run = fan.simulate(puppet, moved, t_end=2.0, method=fan.TimeStepping(dt=0.95 * longest))
    assert np.max(np.abs(run.q_D - x.q_D)) < 2e-3
    for run, start in ((fan.simulate, moved), (fan.simulate_batch, [moved, moved])):
        with pytest.raises(fan.errors.StateError, match="is too long for the chain line: with"):
            run(puppet, start, t_end=2.0, method=fan.TimeStepping(dt=1.01 * longest))
    with pytest.raises(fan.errors.StateError, match="too long for the chain line"):
        puppet.stepper(moved, method=fan.TimeStepping(dt=1.01 * longest))
    with pytest.raises(fan.errors.StateError, match="too long for the chain line"):
        fan.Performance(puppet, moved, dt=1.01 * longest, tick=1.01 * longest)


@pytest.mark.parametrize("c", [0.02, 1.0])
def test_damping_shortens_the_longest_step(c):
    """2 (sqrt(1 + zeta^2) - zeta) / omega, zeta = omega c / 2 EA: the step's map has -1 there."""
    puppet = span().with_parameters({"L": 0.8, "g": 0.0, "c": c})
    x = puppet.rest()
    omega = 2 * np.sqrt(200 * N / 0.8 * (N - 1) / 0.03) * np.cos(np.pi / (2 * N))
    zeta = omega * c / 400
    longest = 2 * (np.sqrt(1 + zeta**2) - zeta) / omega
    own = np.linalg.eigvals(puppet.linearise_step(x, dt=(1 - 1e-9) * longest).A[:30, :30])
    assert np.min(own.real) == pytest.approx(-1.0, abs=1e-6)
    with pytest.raises(fan.errors.StateError, match="too long for the chain line"):
        fan.simulate(puppet, x, t_end=0.1, method=fan.TimeStepping(dt=1.001 * longest))


RESTING = """
puppet: resting
bodies:
  - name: bob
    joint: {type: prismatic, axis: [0, 0, 1], limits: {lower: 0.3}}
    mass: 0.2
  - {name: other, joint: {type: translation, axes: [x, y, z]}, mass: 0.1}
strings:
  - name: slack
    path: [{body: bob}, {world: [0, 0, 1]}]
    length: 0.9
    chain: {pieces: 4, mass: 0.03, stiffness: 500}
  - {name: rod, path: [{body: other}, {world: [1, 0, 0.5]}], length: 0.4, wire: true}
pose: {bob: 0.35, other.x: 1.1, other.z: 0.8}
"""


def test_rest_beside_limits_and_wires():
    """The bob lies on its stop under a slack rope; the other bob falls under its rod."""
    puppet = fan.loads(RESTING)
    x = puppet.rest()
    q = dict(zip(puppet.coordinates.q_D, x.q_D, strict=True))
    assert q["bob"] == pytest.approx(0.3, abs=1e-12)
    assert [q[f"other.{a}"] for a in "xyz"] == pytest.approx([1.0, 0.0, 0.1], abs=1e-8)
    acc, force = puppet.forward_dynamics(x)
    assert np.max(np.abs(acc)) < 1e-5
    forces = dict(zip(puppet.tree.row_names, force, strict=True))
    assert forces["rod"] == pytest.approx(0.1 * G, rel=1e-9)
    assert 0.2 * G < forces["bob.lower"] < (0.2 + 0.03) * G


def test_rest_is_not_a_saddle():
    """The other bob begins exactly above its rod's end, at a saddle of V."""
    puppet = fan.loads(RESTING.replace("other.x: 1.1, other.z: 0.8", "other.x: 1, other.z: 0.9"))
    q = dict(zip(puppet.coordinates.q_D, puppet.rest().q_D, strict=True))
    assert q["other.z"] == pytest.approx(0.1, abs=1e-8)
