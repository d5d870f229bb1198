"""Derivatives of variational steps, compared with differences of the steps and closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow

STEPS = {"q_D": 3e-7, "v_D": 1e-5, "q_K": 3e-7, "v_K": 1e-5, "acc_K": 1e-2, "u_D": 1e-3, "p": 1e-4}


def hung(name, seed):
    """A puppet in motion on partly taut strings, and random inputs."""
    puppet = getattr(fan.puppets, name)()
    rng = np.random.default_rng(seed)
    batch = puppet.stepper_batch(puppet.rest(), 1, "variational")
    for _ in range(8):
        batch.advance(0.01, rng.normal(size=batch.v_K.shape))
    return puppet, [a[0].copy() for a in (batch.q_D, batch.v_D, batch.q_K, batch.v_K)], rng


@pytest.mark.parametrize("name", ["arm2d", "marionette"])
def test_partials_agree_with_differences_of_steps(name):
    """Central differences of sixth order, with an unchanged active set."""
    puppet, start, rng = hung(name, 3)
    t = puppet.coordinates
    inputs = [rng.normal(size=t.n_vK), 0.01 * rng.normal(size=t.n_vD), puppet.p]
    widths = [t.n_vD, t.n_vD, t.n_vK, t.n_vK, t.n_vK, t.n_vD, len(puppet.p)]
    places = np.cumsum([0, *widths])

    def steps(changes):
        nodes = []
        for change in changes:
            q, v, q_K, v_K, acc, u, p = np.split(change, places[1:-1])
            nodes.append(
                [
                    puppet.integrate(start[0], q),
                    start[1] + v,
                    puppet.integrate(start[2], q_K, driven=True),
                    start[3] + v_K,
                    inputs[0] + acc,
                    inputs[1] + u,
                    inputs[2] + p,
                ]
            )
        *states, p = map(np.array, zip(*nodes, strict=True))
        return puppet.linearise_steps(
            *states, p=p, method="variational", forces=True, tension_partials=True, dt=0.002
        )

    many = steps(np.zeros((1, places[-1])))
    assert many.settled.all()
    assert 0 < many.active.sum() < max(2, many.active.size)
    sizes = np.repeat(list(STEPS.values()), widths)
    jacobian = np.zeros((2 * t.n_vD + many.active.shape[1], places[-1]))
    for k, weight in ((1, 1.5), (2, -0.6), (3, 0.1)):
        moved = k * np.diag(sizes)
        after, before = steps(moved), steps(-moved)
        assert (after.active == many.active).all() and (before.active == many.active).all()
        change = [
            np.array([puppet.difference(b, a) for a, b in zip(after.q_D, before.q_D, strict=True)]),
            after.v_D - before.v_D,
            after.tension - before.tension,
        ]
        jacobian += weight * np.concatenate(change, axis=1).T / (2 * k * sizes)
    wanted = np.concatenate([many.motion[0], many.tension_partials[0]])
    for first, last in pairwise(places):
        for rows in (slice(0, t.n_vD), slice(t.n_vD, 2 * t.n_vD), slice(2 * t.n_vD, None)):
            part = wanted[rows, first:last]
            size = np.max(np.abs(part), initial=1e-6)
            assert np.allclose(jacobian[rows, first:last], part, rtol=0, atol=1e-6 * size)
    n_z = 2 * (t.n_vD + t.n_vK)
    assert np.array_equal(many.A[0][: 2 * t.n_vD], many.motion[0][:, :n_z])


def test_a_spring_follows_the_midpoint_rule():
    """xi = (2 v dt - w^2 dt^2 q) / (2 (1 + w^2 dt^2/4)): A of the implicit midpoint rule."""
    puppet = fan.loads(
        "{puppet: spring, bodies: [{name: b, mass: 2, joint: {type: prismatic, axis: [1, 0, 0],"
        " spring: {stiffness: 50}}}]}"
    )
    dt, w = 0.05, 5.0
    many = puppet.linearise_steps([0.3], [0.7], [], [], dt=dt, method="variational")
    a = (0.5 * w * dt) ** 2
    wanted = np.array([[1 - a, dt], [-(w**2) * dt, 1 - a]]) / (1 + a)
    assert many.settled.all()
    assert np.allclose(many.A[0], wanted, rtol=0, atol=1e-10)


def test_divided_steps_are_not_settled():
    puppet, start, _ = hung("arm2d", 3)
    fast = start[1] + np.array([[0.0, 0.0], [600.0, -900.0]])
    many = puppet.linearise_steps(start[0], fast, *start[2:], method="variational", dt=0.01)
    assert many.settled.tolist() == [True, False]


def test_unknown_names_are_refused():
    bar = fan.puppets.marionette_bar()
    x = bar.rest()
    state = (x.q_D, x.v_D, x.q_K, x.v_K)
    with pytest.raises(fan.errors.StateError, match="driven rotations"):
        bar.linearise_steps(*state, method="variational")
    with pytest.raises(fan.errors.StateError, match="method is 'event'"):
        bar.linearise_steps(*state, method="event")
