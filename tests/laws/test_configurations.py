"""Configurations and the tangent vectors between them."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.compiled import Evaluation


@pytest.fixture(scope="module", params=["marionette", "marionette_bar", "arm2d"])
def puppet(request):
    return getattr(fan.puppets, request.param)()


def drawn(puppet, rng, n: int, driven: bool) -> np.ndarray:
    """(n, n_q) configurations with random orientations."""
    t = puppet.coordinates
    n_q, quaternions = (t.n_qK, t.quaternions_K) if driven else (t.n_qD, t.quaternions_D)
    q = rng.normal(size=(n, n_q))
    for at, _ in quaternions:
        q[:, at : at + 4] /= np.linalg.norm(q[:, at : at + 4], axis=1, keepdims=True)
    return q


def same(puppet, p, q, driven) -> None:
    """Equality, except for the signs of quaternions."""
    t, p = puppet.coordinates, np.array(p)
    for at, _ in t.quaternions_K if driven else t.quaternions_D:
        turn = slice(at, at + 4)
        p[..., turn] *= np.sign(np.sum(p[..., turn] * q[..., turn], axis=-1, keepdims=True))
    np.testing.assert_allclose(p, q, atol=1e-12)


@pytest.mark.parametrize("driven", [False, True])
def test_integrate_undoes_difference(puppet, driven):
    """integrate(q0, difference(q0, q1)) is q1, for one and for many."""
    rng = np.random.default_rng(5)
    t = puppet.coordinates
    n_v = t.n_vK if driven else t.n_vD
    q0, q1 = (drawn(puppet, rng, 20, driven) for _ in range(2))
    dq = puppet.difference(q0, q1, driven)
    assert dq.shape == (20, n_v)
    same(puppet, puppet.integrate(q0, dq, driven), q1, driven)
    np.testing.assert_allclose(puppet.difference(q0[3], q1[3], driven), dq[3], atol=1e-14)
    tangent = puppet.difference(q0[0], q1, driven)
    same(puppet, puppet.integrate(q0[0], tangent, driven), q1, driven)
    small = 0.3 * rng.normal(size=(20, n_v))
    np.testing.assert_allclose(
        puppet.difference(q0, puppet.integrate(q0, small, driven), driven), small, atol=1e-12
    )


def test_tangent_vectors_are_those_of_linearise():
    """Derivatives of accelerations are with respect to these tangent vectors."""
    arm = fan.puppets.arm3d()
    x = arm.rest()
    lin = arm.linearise(x, rows=[])
    rng = np.random.default_rng(1)
    dq, step = rng.normal(size=arm.coordinates.n_vD), 1e-6

    def acc(s: float) -> np.ndarray:
        there = x.replace(q_D=arm.integrate(x.q_D, s * dq))
        evaluation = Evaluation.at_state(arm, there)
        return evaluation.solve_factor(evaluation.w0)

    np.testing.assert_allclose(
        (acc(step) - acc(-step)) / (2 * step), lin.acc.q_D @ dq, rtol=1e-6, atol=1e-6
    )


def test_arrays_of_other_sizes_are_refused(puppet):
    """The message states the sizes."""
    q = puppet.state().q_D
    with pytest.raises(fan.errors.StateError, match="q has the shape"):
        puppet.difference(q[:-1], q)
    with pytest.raises(fan.errors.StateError, match="dq has the shape"):
        puppet.integrate(q, np.zeros(puppet.coordinates.n_vD + 1))
