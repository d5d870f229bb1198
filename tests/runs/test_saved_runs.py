"""Batches and problems are pickled and copied; what cannot be says so."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control import Problem, RolloutOptions, solve

ARM = fan.puppets.arm2d()
REST = ARM.rest({"hand.length": 0.8})
ACCELERATION = np.array([[0.5, -0.3], [-0.4, 0.2], [0.1, 0.9]])
ARRAYS = ("t", "q_D", "v_D", "q_K", "v_K", "tension", "taut", "energy_terms", "violation", "status")


def moving_batch(method: str):
    batch = ARM.stepper_batch([REST] * 3, method=method)
    batch.advance(0.3, ACCELERATION)
    return batch


@pytest.mark.parametrize("method", ["timestepping", "event"])
@pytest.mark.parametrize(
    "duplicate", [copy.copy, copy.deepcopy, lambda batch: pickle.loads(pickle.dumps(batch))]
)
def test_a_copied_batch_goes_on_as_the_original_and_by_itself(method, duplicate) -> None:
    batch = moving_batch(method)
    other = duplicate(batch)
    before = batch.q_D.copy()
    for _ in range(3):
        other.advance(0.1, -ACCELERATION)
    assert np.array_equal(batch.q_D, before)
    for _ in range(3):
        batch.advance(0.1, -ACCELERATION)
    for name in ARRAYS:
        assert np.array_equal(getattr(batch, name), getattr(other, name)), name
    other.reset([1])
    assert np.array_equal(other.q_D[1], REST.q_D)
    assert not np.array_equal(batch.q_D[1], REST.q_D)


def test_a_pickled_problem_has_the_same_plan() -> None:
    options = RolloutOptions(strings=False)
    problem = Problem(ARM, REST, {"elbow": 1.0}, tolerance=0.05, rollouts=options)
    for other in (pickle.loads(pickle.dumps(problem)), copy.deepcopy(problem)):
        assert other.fingerprint == problem.fingerprint
    a, b = (solve(p, time_limit=60.0, iterations=2000) for p in (problem, other))
    assert np.array_equal(a.tree.q_D, b.tree.q_D)
    assert np.array_equal(pickle.loads(pickle.dumps(a)).tree.q_D, a.tree.q_D)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_memory_of_a_library_cannot_be_copied(duplicate) -> None:
    with pytest.raises(TypeError, match="a Rollout cannot be pickled or copied"):
        duplicate(ARM.rollout(REST, np.zeros((3, 2)), dt=0.002))
    mpc = fan.MPC(ARM, {"lower": (0.3, 0.0, 0.5)}, nodes=5, horizon=0.2)
    with pytest.raises(TypeError, match="an MPC cannot be pickled or copied"):
        duplicate(mpc)
