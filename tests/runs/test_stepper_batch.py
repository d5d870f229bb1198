"""Batches of steppers: each equals a single stepper."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import Status

pytestmark = pytest.mark.slow

ARM = fan.puppets.arm2d()
HANG = ARM.rest({"hand.length": 0.8})
BLOCK = fan.loads(
    """
puppet: block
floor: 0
gravity: [2.9, 0, -9.37]
contact: {friction: 0.2}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]}
pose: {body.z: 0.05}
"""
)


def wandering(rng, batch, size=0.5):
    return rng.normal(scale=size, size=(len(batch), batch.q_K.shape[1]))


@pytest.mark.parametrize("method", ["timestepping", "variational", "event"])
def test_each_equals_the_single_stepper(method):
    batch = ARM.stepper_batch(HANG, 11, method, threads=2)
    steppers = [ARM.stepper(HANG, method) for _ in range(11)]
    rng = np.random.default_rng(0)
    for _ in range(12):
        acc, force = wandering(rng, batch), rng.normal(scale=0.01, size=(11, 2))
        assert batch.advance(0.025, acc, u_D=force).all()
        for i, single in enumerate(steppers):
            single.advance(0.025, acc[i], u_D=force[i])
    assert np.allclose(batch.t, 0.3)
    assert np.ptp(batch.q_D, axis=0).max() > 1e-3
    for i, single in enumerate(steppers):
        x = batch.state(i)
        for name in ("q_D", "v_D", "q_K", "v_K"):
            assert np.allclose(getattr(x, name), getattr(single.state, name), rtol=0, atol=1e-9), (
                name
            )
        assert np.array_equal(x.taut, single.state.taut)
        assert np.allclose(batch.tension[i], single.tension, rtol=1e-6, atol=1e-6)
        sample = ARM.sample_layout.split(single.samples[-1:])
        for name, sum_ in zip(("work", "damping", "impact"), batch.energy_terms[i], strict=False):
            assert sum_ == pytest.approx(sample[name][0], abs=1e-8)


def test_rotations_are_driven():
    """A turning control bar, with quaternions."""
    bar = fan.puppets.marionette_bar()
    x0 = bar.rest()
    batch, steppers = bar.stepper_batch(x0, 3), [bar.stepper(x0) for _ in range(3)]
    rng = np.random.default_rng(1)
    for _ in range(5):
        acc = rng.normal(scale=0.5, size=(3, bar.coordinates.n_vK))
        batch.advance(0.02, acc)
        for i, single in enumerate(steppers):
            single.advance(0.02, acc[i])
    for i, single in enumerate(steppers):
        assert np.allclose(batch.q_K[i], single.state.q_K, rtol=0, atol=1e-12)
        assert np.allclose(batch.q_D[i], single.state.q_D, rtol=0, atol=1e-9)


def test_solids_slide_as_they_do_alone():
    batch, single = BLOCK.stepper_batch(BLOCK.state(), 9), BLOCK.stepper(BLOCK.state())
    for _ in range(20):
        assert batch.advance(0.02).all()
        single.advance(0.02)
    assert single.state["v:body.x"] > 0.3
    for i in range(9):
        assert np.allclose(batch.q_D[i], single.state.q_D, rtol=0, atol=1e-8)
    friction = BLOCK.sample_layout.split(single.samples[-1:])["friction"][0]
    assert np.allclose(batch.energy_terms[:, 4], friction, rtol=1e-6)


@pytest.mark.parametrize("method", ["timestepping", "event"])
def test_some_are_reset_and_the_others_continue(method):
    rng = np.random.default_rng(2)
    batch, undisturbed = (ARM.stepper_batch(HANG, 10, method) for _ in range(2))
    other = ARM.rest({"hand.length": 0.7}).replace(t=5.0)
    acc = [wandering(rng, batch) for _ in range(8)]
    for a in acc[:4]:
        batch.advance(0.02, a)
        undisturbed.advance(0.02, a)
    batch.reset([2, 7], other)
    assert np.allclose(batch.t, [0.08, 0.08, 5.0, *[0.08] * 4, 5.0, 0.08, 0.08])
    assert np.allclose(batch.tension[2], ARM.stepper(other, method).tension, rtol=1e-9)
    late = ARM.stepper(other, method)
    for a in acc[4:]:
        batch.advance(0.02, a)
        undisturbed.advance(0.02, a)
        late.advance(0.02, a[7])
    others = [i for i in range(10) if i not in (2, 7)]
    assert np.array_equal(batch.q_D[others], undisturbed.q_D[others])
    assert np.array_equal(batch.energy_terms[others], undisturbed.energy_terms[others])
    assert np.allclose(batch.q_D[7], late.state.q_D, rtol=0, atol=1e-9)
    batch.reset()
    assert (
        np.all(batch.t == 0.0)
        and np.all(batch.q_D == HANG.q_D)
        and np.all(batch.energy_terms == 0.0)
    )


def test_neighbours_and_threads_make_no_difference():
    rng = np.random.default_rng(3)
    acc = rng.normal(scale=0.5, size=(6, 29, 2))
    batch = ARM.stepper_batch(HANG, 29, threads=2)
    small = ARM.stepper_batch(HANG, 5, threads=1)
    for a in acc:
        batch.advance(0.02, a)
        small.advance(0.02, a[13:18])
    assert np.array_equal(batch.q_D[13:18], small.q_D)
    assert np.array_equal(batch.tension[13:18], small.tension)


@pytest.mark.parametrize("method", ["timestepping", "variational", "event"])
def test_each_has_its_own_parameters(method):
    masses = np.linspace(0.05, 0.2, 9)
    batch = ARM.stepper_batch(HANG, method=method, parameters={"m2": masses})
    assert len(batch) == 9
    for _ in range(4):
        batch.advance(0.05, {"hand.length": np.full(9, -0.4)})
    for i in (0, 4, 8):
        single = ARM.with_parameters({"m2": masses[i]}).stepper(HANG, method)
        for _ in range(4):
            single.advance(0.05, {"hand.length": -0.4})
        assert np.allclose(batch.q_D[i], single.state.q_D, rtol=0, atol=1e-7)
    before = batch.q_D[4].copy()
    batch.reset([3], parameters={"m2": 0.5})
    assert batch.p[3, 1] == 0.5 and batch.p[4, 1] == masses[4]
    assert np.array_equal(batch.q_D[4], before)


def test_a_stopped_stepper_keeps_its_state_until_it_is_reset():
    """Its winch runs out of string; the others continue."""
    batch = ARM.stepper_batch(HANG, 3)
    acc = np.zeros((3, 2))
    acc[1, 1] = -40.0
    for _ in range(15):
        arrived = batch.advance(0.02, acc)
    assert arrived.tolist() == [True, False, True]
    assert batch.status[1] == Status.LENGTH_NOT_POSITIVE and batch.causes(1) == ("hand",)
    assert batch.t[1] < 0.21 and batch.t[0] == pytest.approx(0.3)
    saved = batch.q_D[1].copy()
    batch.advance(0.02)
    assert np.array_equal(batch.q_D[1], saved)
    batch.reset(batch.status != Status.DONE)
    assert batch.advance(0.02).all() and batch.t[1] == pytest.approx(0.02)


def test_initial_states_may_be_arrays():
    batch = ARM.stepper_batch(HANG, 4)
    v_D = np.array([[0.1, 0.0], [0.0, 0.2]])
    x0 = HANG.replace(v_D=v_D[1])
    batch.reset([1, 3], v_D=v_D, t=np.array([1.0, 2.0]))
    assert np.array_equal(batch.v_D[[1, 3]], v_D) and np.all(batch.v_D[[0, 2]] == HANG.v_D)
    batch.advance(0.02)
    single = ARM.stepper(x0)
    single.advance(0.02)
    assert np.allclose(batch.q_D[3], single.state.q_D, rtol=0, atol=1e-12)
    assert batch.t.tolist() == pytest.approx([0.02, 1.02, 0.02, 2.02])


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda b: b.advance(0.0), ValueError, "duration"),
        (
            lambda b: b.advance(0.1, {"hand.lenght": 1.0}),
            fan.errors.UnknownNameError,
            r"hand\.length",
        ),
        (lambda b: b.advance(0.1, np.zeros((3, 2))), ValueError, "acc_K has 3 rows"),
        (lambda b: b.advance(0.1, np.full(2, np.nan)), fan.errors.StateError, "must be finite"),
        (lambda b: b.advance(0.1, u_D=np.zeros(5)), fan.errors.StateError, "u_D has the shape"),
        (lambda b: b.reset([9]), fan.errors.StateError, "needed: whole numbers from 0 to 3"),
        (lambda b: b.reset([0.5]), fan.errors.StateError, "needed: whole numbers from 0 to 3"),
        (lambda b: b.reset([True, False]), fan.errors.StateError, r"or a mask \(4,\)"),
        (lambda b: b.reset(np.zeros((2, 3))), fan.errors.StateError, r"needed: indices \(m,\)"),
        (
            lambda b: b.advance(0.1, {"hand.length": np.zeros(2)}),
            fan.errors.StateError,
            r"found the shape \(2,\); needed: a number, or \(4,\)",
        ),
        (lambda b: b.reset([0], q_D=np.zeros((1, 2))), fan.errors.StateError, "hand is violated"),
        (lambda b: b.reset([0], q=np.zeros(2)), TypeError, "takes t, q_D"),
        (lambda b: b.reset([0, 1], [HANG] * 3), ValueError, "3 rows"),
    ],
)
def test_wrong_arguments_change_nothing(call, error, says):
    batch = ARM.stepper_batch(HANG, 4)
    batch.advance(0.02)
    before = batch.q_D.copy(), batch.t.copy(), batch.p.copy()
    with pytest.raises(error, match=says):
        call(batch)
    after = batch.q_D, batch.t, batch.p
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))


def test_as_many_runs_as_states_and_parameters():
    with pytest.raises(ValueError, match="3 values of parameters for 4 runs"):
        ARM.stepper_batch(HANG, 4, parameters={"m2": [0.1, 0.2, 0.3]})
    with pytest.raises(ValueError, match="n is 0"):
        ARM.stepper_batch(HANG, 0)


def test_nothing_is_driven():
    """Accelerations of no coordinates, and a batch that is reset by arrays."""
    batch = BLOCK.stepper_batch(BLOCK.state({"body.z": 0.05}), 3)
    batch.advance(0.01, np.zeros((3, 0)))
    batch.reset([0, 2], slip=np.zeros((2, 0)))
    assert batch.advance(0.01, np.zeros(0)).all()
