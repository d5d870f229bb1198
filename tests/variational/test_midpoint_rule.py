"""The generated midpoint rule, compared with derivatives of the discrete Lagrangian."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from fantoccini.kernel.equations import Variational
from harness import Model, turned
from oracles.random_trees import description

pytestmark = pytest.mark.slow


def cayley(s):
    """The quaternion (1, s) / |(1, s)|."""
    return ca.vertcat(1, s) / ca.sqrt(1 + ca.dot(s, s))


def product(a, b):
    w = a[0] * b[0] - ca.dot(a[1:], b[1:])
    return ca.vertcat(w, a[0] * b[1:] + b[0] * a[1:] + ca.cross(a[1:], b[1:]))


def between(q, q_next, quaternions, scalars, n_v):
    """q_mid and xi of two configurations, computed from their difference alone."""
    middle, xi = ca.SX(q), ca.SX(n_v, 1)
    for i, j in scalars:
        middle[i], xi[j] = (q[i] + q_next[i]) / 2, q_next[i] - q[i]
    for i, j in quaternions:
        back = ca.vertcat(q[i], -q[i + 1 : i + 4])
        turn = product(back, q_next[i : i + 4])
        half = turn[1:] / (1 + turn[0])
        middle[i : i + 4] = product(q[i : i + 4], cayley(half))
        xi[j : j + 3] = 4 * half
    return middle, xi


def moved(q, change, quaternions, scalars):
    """q displaced by a small tangent vector, to first order."""
    out = ca.SX(q)
    for i, j in scalars:
        out[i] = q[i] + change[j]
    for i, j in quaternions:
        out[i : i + 4] = product(q[i : i + 4], ca.vertcat(1, change[j : j + 3] / 2))
    return out


def discrete_momenta(equations, q, q_next, q_K, q_K_next, dt, p):
    """-D_1 L_d and D_2 L_d of the dynamic coordinates, by automatic differentiation."""
    t = equations.tree.coordinates
    first, second = ca.SX.sym("first", t.n_vD), ca.SX.sym("second", t.n_vD)
    D, K = (t.quaternions_D, t.scalars_D), (t.quaternions_K, t.scalars_K)
    ends = moved(ca.SX(q), first, *D), moved(ca.SX(q_next), second, *D)
    q_mid, xi = between(*ends, *D, t.n_vD)
    K_mid, xi_K = between(ca.SX(q_K), ca.SX(q_K_next), *K, t.n_vK)
    L_d = dt * equations["lagrangian"](q_mid, xi / dt, K_mid, xi_K / dt, p)
    slopes = [-ca.gradient(L_d, first), ca.gradient(L_d, second)]
    momenta = ca.Function("momenta", [first, second], slopes)
    return [np.array(x).ravel() for x in momenta(np.zeros(t.n_vD), np.zeros(t.n_vD))]


def numbers(function, *arguments):
    return [np.array(x).ravel() for x in function.call([ca.DM(a) for a in arguments])]


@pytest.mark.parametrize("seed", range(3))
def test_the_momenta_are_the_discrete_lagrangians_slopes(seed):
    model = Model(description(seed, 9, driven=0.3, dissipative=False))
    equations, t, p, dt = model.equations, model.table, model.p, 0.03
    rng, x = np.random.default_rng(seed), model.random(seed)

    def near(q, quaternions, scalars, n_v):
        step, out = rng.normal(size=n_v), q.copy()
        for i, j in scalars:
            out[i] += 0.1 * step[j]
        for i, j in quaternions:
            out[i : i + 4] = turned(q[i : i + 4], step[j : j + 3])
        return out

    q_D, q_K = x.q_D, x.q_K
    q_D_next = near(q_D, t.quaternions_D, t.scalars_D, t.n_vD)
    q_K_next = near(q_K, t.quaternions_K, t.scalars_K, t.n_vK)
    expected = discrete_momenta(equations, q_D, q_D_next, q_K, q_K_next, dt, p)

    _, xi = between(ca.DM(q_D), ca.DM(q_D_next), t.quaternions_D, t.scalars_D, t.n_vD)
    K_mid, xi_K = between(ca.DM(q_K), ca.DM(q_K_next), t.quaternions_K, t.scalars_K, t.n_vK)
    rule = Variational(equations).functions()["midpoint_rule"]
    still = np.zeros(t.n_vD)
    lead = ca.evalf(K_mid), ca.evalf(xi_K) / dt, np.zeros(t.n_vK), q_K_next
    before, after, q_next, h, _ = numbers(rule, q_D, ca.evalf(xi), *lead, still, dt, p)
    scale = np.max(np.abs(expected))
    assert np.max(np.abs(before - expected[0])) < 1e-12 * scale
    assert np.max(np.abs(after - expected[1])) < 1e-12 * scale
    assert np.max(np.abs(q_next - q_D_next)) < 1e-13
    assert h == pytest.approx(numbers(equations["rows"], q_D_next, q_K_next, p)[0], abs=1e-12)


def test_momenta_are_mass_times_velocity():
    model = Model(description(3, 9, driven=0.4))
    equations, x, p = model.equations, model.random(0), model.p
    M, M_DK, _ = (np.array(x) for x in equations["mass_matrix"](x.q_D, x.q_K, p))
    momenta = Variational(equations).functions()["momenta"]
    (momentum,) = numbers(momenta, x.q_D, x.v_D, x.q_K, x.v_K, p)
    assert momentum == pytest.approx(M @ x.v_D + M_DK @ x.v_K, abs=1e-12)
