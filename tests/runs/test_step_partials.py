"""Compiled derivatives of time steps, compared with single steps and central differences."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow

PUPPETS = ("arm2d", "stand6", "marionette_bar", "marionette")


def moving(name, n=4, seed=0):
    """A puppet, and n of its states with active and inactive strings and limits."""
    puppet = getattr(fan.puppets, name)()
    rng = np.random.default_rng(seed)
    batch = puppet.stepper_batch(puppet.rest(), n)
    for _ in range(15):
        batch.advance(0.01, 2.0 * rng.normal(size=batch.v_K.shape))
    batch.reset(
        v_D=batch.v_D + 0.3 * rng.normal(size=batch.v_D.shape),
        q_D=batch.q_D,
        q_K=batch.q_K,
        v_K=batch.v_K,
    )
    return puppet, batch, rng


def split(puppet, steps):
    """Places of the columns of `motion`."""
    t = puppet.coordinates
    widths = (t.n_vD, t.n_vD, t.n_vK, t.n_vK, t.n_vK, t.n_vD, len(puppet.p))
    return np.split(steps, np.cumsum(widths)[:-1], axis=-1)


@pytest.mark.parametrize("name", PUPPETS)
def test_many_steps_are_differentiated_as_one(name):
    puppet, batch, rng = moving(name)
    acc, force = rng.normal(size=batch.v_K.shape), 0.01 * rng.normal(size=batch.v_D.shape)
    steps = puppet.linearise_steps(
        batch.q_D,
        batch.v_D,
        batch.q_K,
        batch.v_K,
        acc,
        force,
        forces=True,
        tension_partials=True,
        threads=2,
    )
    assert steps.settled.all() and steps.active.any()
    for i in range(len(steps)):
        single = puppet.linearise_step(batch.state(i), acc[i], force[i])
        size = np.max(np.abs(single.A))
        names = tuple(puppet.tree.row_names[r] for r in np.flatnonzero(steps.active[i]))
        assert names == single.rows
        assert np.allclose(steps.q_D[i], single.x_next.q_D, rtol=0, atol=1e-12)
        assert np.allclose(steps.v_D[i], single.x_next.v_D, rtol=0, atol=1e-9)
        assert np.allclose(steps.A[i], single.A, rtol=0, atol=1e-10 * size)
        assert np.allclose(steps.B[i], single.B, rtol=0, atol=1e-10)
        *_, by_u, by_p = split(puppet, steps.motion[i])
        n = puppet.coordinates.n_vD
        assert np.allclose(
            by_u, single.B_u[: 2 * n], rtol=0, atol=1e-10 * (1 + np.max(np.abs(by_u)))
        )
        assert np.allclose(by_p, single.B_p[: 2 * n], rtol=0, atol=1e-10)
        for block, expected in zip(
            split(puppet, steps.tension_partials[i]),
            vars(single.tension_partials).values(),
            strict=True,
        ):
            scale = np.max(np.abs(expected), initial=1.0)
            assert np.allclose(block, expected, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("name", ["arm2d", "marionette_bar", "marionette"])
def test_they_agree_with_central_differences(name):
    """The steps themselves are the oracle: fixed steps that depend on their state alone."""
    puppet, batch, rng = moving(name, n=1, seed=3)
    t, acc = puppet.coordinates, rng.normal(size=(1, batch.v_K.shape[1]))
    start = [a[0].copy() for a in (batch.q_D, batch.v_D, batch.q_K, batch.v_K)]
    steps = puppet.linearise_steps(*start, acc)
    n, k = t.n_vD, t.n_vK
    h, widths = 1e-6, (n, n, k, k)
    moved, changes = [], np.eye(2 * (n + k))
    for sign in (1.0, -1.0):
        for change in changes:
            dq, dv, dq_K, dv_K = np.split(sign * h * change, np.cumsum(widths)[:-1])
            moved.append(
                [
                    puppet.integrate(start[0], dq),
                    start[1] + dv,
                    puppet.integrate(start[2], dq_K, driven=True),
                    start[3] + dv_K,
                ]
            )
    after = puppet.linearise_steps(*map(np.array, zip(*moved, strict=True)), acc)
    assert (after.active == steps.active).all()
    half = len(changes)
    dq = np.array([puppet.difference(after.q_D[half + i], after.q_D[i]) for i in range(half)])
    dv = after.v_D[:half] - after.v_D[half:]
    slope = np.concatenate([dq, dv], axis=1).T / (2 * h)
    expected = steps.A[0][: 2 * n]
    assert np.allclose(slope, expected, rtol=0, atol=1e-7 * np.max(np.abs(expected)))


def test_parameters_may_differ_from_node_to_node():
    arm = fan.puppets.arm2d()
    x = arm.rest()
    p = np.array([[0.12, 0.08], [0.2, 0.05]])
    steps = arm.linearise_steps(x.q_D, x.v_D, x.q_K, x.v_K, p=p)
    for i, own in enumerate(p):
        single = arm.with_parameters(dict(zip(("m1", "m2"), own, strict=True))).linearise_step(x)
        assert np.allclose(steps.A[i], single.A, rtol=0, atol=1e-9)
        assert np.allclose(steps.motion[i][:, -2:], single.B_p[:4], rtol=0, atol=1e-12)


def test_a_shortened_step_is_not_settled():
    arm = fan.puppets.arm2d()
    x = arm.rest()
    steps = arm.linearise_steps(x.q_D, [[0.0, 0.0], [3000.0, -3000.0]], x.q_K, x.v_K)
    assert steps.settled.tolist() == [True, False]


def test_threads_make_no_difference():
    puppet, batch, _ = moving("arm2d", n=23)
    args = batch.q_D, batch.v_D, batch.q_K, batch.v_K
    single_thread, two_threads = (puppet.linearise_steps(*args, threads=n) for n in (1, 2))
    assert np.array_equal(single_thread.motion, two_threads.motion)


@pytest.mark.parametrize("slip", [[0.5, 0.5], [-0.1]])
def test_a_negative_or_foreign_slip_is_refused(slip):
    arm = fan.puppets.arm2d()
    with pytest.raises(fan.errors.StateError, match="slip: found"):
        arm.linearise_step(arm.rest().replace(slip=slip))
