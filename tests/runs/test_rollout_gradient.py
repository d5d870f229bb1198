"""Gradients of rollouts: dense products of step derivatives, differences, closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fantoccini as fan
from oracles.differences import moved
from oracles.step_products import swept

pytestmark = pytest.mark.slow

PUPPETS = ("arm2d", "marionette_bar", "marionette")


def shaken(name, n=20, seed=3):
    """A thrown puppet with moving strings: some catch, some go slack."""
    puppet = getattr(fan.puppets, name)()
    rng = np.random.default_rng(seed)
    t = puppet.coordinates
    x = puppet.rest()
    return puppet, x.replace(v_D=0.3 * rng.normal(size=t.n_vD)), 2 * rng.normal(size=(n, t.n_vK))


@pytest.mark.parametrize("name", PUPPETS)
def test_a_sweep_is_the_product_of_all_steps(name):
    """Steps depend on their state alone; driven rotations are included."""
    puppet, x, acc = shaken(name)
    n, t = len(acc), puppet.coordinates
    force = 0.01 * np.random.default_rng(1).normal(size=(n, t.n_vD))
    run = puppet.rollout(x, acc, force, extrapolate=False)
    assert run.status is fan.Status.DONE
    assert run.steps == n
    assert len({tuple(row) for row in run.active}) > 1
    rng = np.random.default_rng(2)
    own = [rng.normal(size=(n + 1, w)) for w in (t.n_vD, t.n_vD, t.n_vK, t.n_vK)]
    by_tension = rng.normal(size=run.tension.shape)
    gradient = run.gradient(*own, by_tension)
    expected = swept(puppet, run, acc, force, own, by_tension)
    for key, values in expected.items():
        size = np.max(np.abs(values), initial=1e-9)
        assert np.allclose(getattr(gradient, key), values, rtol=0, atol=1e-10 * size), key


def test_it_agrees_with_differences_of_rollouts():
    """The steps use extrapolation; the arm's string catches within the rollout."""
    arm = fan.puppets.arm2d()
    t, rng = arm.coordinates, np.random.default_rng(0)
    x, acc = arm.rest().replace(v_D=np.array([0.3, -0.5])), rng.normal(size=(40, t.n_vK))
    force = 0.1 * rng.normal(size=(40, t.n_vD))
    run = arm.rollout(x, acc, force)
    assert 0 < run.active.sum() < run.active.size
    own = rng.normal(size=(2, 41, t.n_vD))
    gradient = run.gradient(q_D=own[0], v_D=own[1])
    along = {
        f.name: rng.normal(size=getattr(gradient, f.name).shape)
        for f in dataclasses.fields(gradient)
    }
    steps = {
        "q_D": 1e-5,
        "v_D": 1e-4,
        "q_K": 1e-5,
        "v_K": 1e-4,
        "acc_K": 1e-3,
        "u_D": 1e-3,
        "p": 1e-4,
    }

    def cost(name, s):
        d = {key: s * a * (key == name) for key, a in along.items()}
        moved_state = x.replace(
            q_D=moved(x.q_D, d["q_D"], t.scalars_D, t.quaternions_D),
            v_D=x.v_D + d["v_D"],
            q_K=x.q_K + d["q_K"],
            v_K=x.v_K + d["v_K"],
        )
        rollout = arm.rollout(moved_state, acc + d["acc_K"], force + d["u_D"], p=arm.p + d["p"])
        assert (rollout.active == run.active).all()
        return float(np.sum(own[0] * rollout.q_D) + np.sum(own[1] * rollout.v_D))

    for name, h in steps.items():
        first, second, third = (
            (cost(name, k * h) - cost(name, -k * h)) / (2 * k * h) for k in (1, 2, 3)
        )
        expected = 1.5 * first - 0.6 * second + 0.1 * third
        terms = getattr(gradient, name) * along[name]
        assert abs(np.sum(terms) - expected) < 1e-7 * np.sum(np.abs(terms)), name


def test_a_weight_that_is_hoisted_follows_its_string():
    """The end height of a weight on a taut string: dz/da_k = dt^2 (n - k - 1/2)."""
    puppet = fan.loads(
        "{puppet: bob, bodies: [{name: b, joint: {type: translation, axes: [z]}, mass: 2}],"
        " strings: [{name: s, path: [{body: b}, {world: [0, 0, 3]}], length: driven}],"
        " pose: {b.z: 1}}"
    )
    n, dt = 30, 0.01
    run = puppet.rollout(puppet.rest({"s.length": 2.0}), np.full((n, 1), -0.3), dt=dt)
    assert run.active.all()
    last = np.zeros((n + 1, 1))
    last[-1] = 1.0
    gradient = run.gradient(q_D=last)
    assert np.allclose(
        gradient.acc_K[:, 0], -(dt**2) * (n - np.arange(n) - 0.5), rtol=0, atol=1e-12
    )
    assert np.allclose(gradient.u_D, 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("extrapolate", [False, True])
def test_the_rollout_is_that_of_the_stepper(extrapolate):
    puppet, x, acc = shaken("marionette", 10)
    run = puppet.rollout(x, acc, extrapolate=extrapolate)
    stepper = puppet.stepper(x, fan.TimeStepping(extrapolate=extrapolate))
    for i, a in enumerate(acc):
        y = stepper.advance(0.002, a)
        assert np.allclose(run.q_D[i + 1], y.q_D, rtol=0, atol=1e-12)
        assert np.allclose(run.q_K[i + 1], y.q_K, rtol=0, atol=1e-14)
        assert np.allclose(run.v_D[i + 1], y.v_D, rtol=0, atol=1e-10)


def test_a_missing_gradient_has_a_reason():
    arm = fan.puppets.arm2d()
    x, acc = arm.rest(), np.zeros((3, arm.coordinates.n_vK))
    run = arm.rollout(x.replace(v_D=np.array([3000.0, -3000.0])), acc)
    with pytest.raises(fan.errors.StateError, match="velocities of step 0 down"):
        run.gradient()
    with pytest.raises(fan.errors.StateError, match="v_D has the shape"):
        arm.rollout(x, acc).gradient(v_D=np.zeros((3, 2)))
    with pytest.raises(fan.errors.StateError, match="u_D has 2 rows"):
        arm.rollout(x, acc, np.zeros((2, 2)))
    acc[1] = -1e7
    run = arm.rollout(x, acc, throw=False)
    with pytest.raises(fan.errors.StateError, match="was stopped"):
        run.gradient()


def test_a_rollout_that_stopped_raises_or_is_cut_at_the_stop():
    """Regression: the rest of the rollout was filled with zeros."""
    arm = fan.puppets.arm2d()
    x, acc = arm.rest().replace(t=1.0), np.zeros((5, arm.coordinates.n_vK))
    acc[2:] = -1e7
    with pytest.raises(fan.errors.SimulationError, match=r"at step 2 of 5, t = 1.004 s") as stopped:
        arm.rollout(x, acc)
    assert stopped.value.status is fan.Status.LENGTH_NOT_POSITIVE
    run = arm.rollout(x, acc, throw=False)
    assert run.status is fan.Status.LENGTH_NOT_POSITIVE and run.steps == 2
    whole = arm.rollout(x, acc[:2])
    for name in ("q_D", "v_D", "q_K", "v_K", "tension", "held", "n_contacts", "edges"):
        assert np.array_equal(getattr(run, name), getattr(whole, name)), name
    assert len(run.q_D) == 3 and len(run.tension) == len(run.differentiable) == 2


def test_accelerations_of_a_rollout_have_a_row_for_each_step():
    """One row of n_vK numbers used to count as one step."""
    arm = fan.puppets.arm2d()
    x, n = arm.rest(), arm.coordinates.n_vK
    for shape in ((n,), (2, 3, n)):
        with pytest.raises(fan.errors.StateError, match="a row for each step"):
            arm.rollout(x, np.zeros(shape))
    with pytest.raises(fan.errors.StateError, match="p has the shape"):
        arm.rollout(x, np.zeros((1, n)), p=np.tile(arm.p, (2, 1)))
    assert arm.rollout(x, np.zeros((2, n))).steps == 2
