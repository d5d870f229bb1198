"""Complete candidates: residuals, derivatives, and steps computed from them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plan.seeds import first_plan, is_polished, polish_plan, without_catches

import fantoccini as fan
from fantoccini.control.planning.descent import step
from fantoccini.control.planning.shooting import Shooting


@pytest.fixture(scope="module")
def shooting(boxes) -> Shooting:
    return Shooting(boxes)


@pytest.fixture(scope="module")
def V(boxes, shooting) -> np.ndarray:
    """Velocities of a plan without catches, as polished."""
    plan = first_plan(
        boxes,
        lambda candidate_plan: is_polished(candidate_plan) and without_catches(candidate_plan),
        polish_plan,
    )
    return shooting.velocities(plan.tree.acceleration[list(plan.path[1:])])


def test_candidates_are_the_plans_own_rollouts(boxes, shooting, V):
    candidate = shooting.candidates(V[None])
    inputs = fan.Input.segments(
        boxes.marionette,
        shooting.segment * np.arange(len(V) + 1),
        boxes.start.q_K,
        boxes.start.v_K,
        shooting.accelerations(V),
    )
    run = fan.simulate(
        boxes.marionette,
        boxes.start,
        inputs,
        t_end=shooting.segment * len(V),
        method=fan.TimeStepping(dt=boxes.rollouts.options.dt, extrapolate=False),
    )
    check_steps = boxes.rollouts.options.steps_per_check
    np.testing.assert_allclose(candidate.nodes.q_D[0], run.q_D[::check_steps], atol=1e-10)
    # Spare tension: constraints contain 0.3 of its part of the weight, and 2 % of the target.
    spare_tension = candidate.constraints[0, :, -1] / 0.3 + 0.02
    tension = run.tension["hand"][check_steps::check_steps] / boxes.marionette.weight
    # The time-stepper's tension is that of a step: it lags by less than the interval of checks.
    change = np.abs(np.diff(tension))
    nearby_change = np.maximum(np.append(change, 0.0), np.append(0.0, change))
    assert np.all(np.abs(spare_tension - tension) < 0.01 + nearby_change)
    clearance = candidate.constraints[0, :, 0] + 0.007
    np.testing.assert_allclose(
        clearance, boxes.rollouts.clearance.of(run)[check_steps::check_steps], atol=1e-10
    )
    assert candidate.distance[0] <= 1e-3 and candidate.first_calm_segment[0] == 0


def test_derivatives_are_those_of_larger_changes(shooting, V):
    candidate = shooting.candidates(V[None])
    derivatives = shooting.derivatives(candidate)
    random = np.random.default_rng(0)
    x = random.normal(size=derivatives.residual.shape[1])
    size = 3e-4
    forward, backward = (
        shooting.candidates(shooting.with_step(V, derivatives.basis, s * size * x)[None])
        for s in (1.0, -1.0)
    )
    residual = (forward.residual[0] - backward.residual[0]) / (2.0 * size)
    assert np.linalg.norm(derivatives.residual @ x - residual) < 0.01 * np.linalg.norm(residual)
    check, kind = derivatives.near_violations.T
    spare = (forward.constraints[0] - backward.constraints[0])[check, kind] / (2.0 * size)
    assert len(spare) and np.max(np.abs(derivatives.constraints @ x - spare)) < 0.05 * np.max(
        np.abs(spare)
    )


def test_first_segments_are_kept_on_request(shooting, V):
    candidate = shooting.candidates(V[None])
    derivatives = shooting.derivatives(candidate, first_segment=len(V) - 7)
    assert (
        not derivatives.basis[: len(V) - 7].any()
        and derivatives.basis[len(V) - 7 :].any(axis=1).all()
    )


def test_steps_keep_bounds_and_reduce_the_distance(boxes, shooting, V):
    """They start from deflected paths."""
    random, bounds = np.random.default_rng(1), boxes.rollouts.bounds
    for _ in range(3):
        deflected = shooting.within(V + 0.02 * random.normal(size=V.shape))
        candidate = shooting.candidates(deflected[None])
        derivatives = shooting.derivatives(candidate)
        x = step(shooting, candidate, derivatives, trust=0.1)
        assert np.max(np.abs(x)) <= 0.1 + 1e-6
        stepped = shooting.with_step(deflected, derivatives.basis, x)
        assert np.all(np.abs(stepped) <= bounds.speed + 1e-6)
        assert np.all(np.abs(shooting.accelerations(stepped)) <= bounds.acceleration + 1e-5)
        shortened_steps = [
            shooting.with_step(deflected, derivatives.basis, share * x)
            for share in 0.5 ** np.arange(8)
        ]
        best_candidate = shooting.candidates(shooting.within(np.stack(shortened_steps))).best
        assert best_candidate.merit[0] < 0.95 * candidate.merit[0]


def test_velocities_are_followed_as_bounds_allow(boxes, shooting):
    bounds = boxes.rollouts.bounds
    too_fast = 3.0 * np.random.default_rng(2).normal(size=(4, 30, 3))
    limited = shooting.within(too_fast)
    assert np.all(np.abs(limited) <= bounds.speed)
    assert np.all(np.abs(shooting.accelerations(limited)) <= bounds.acceleration * (1 + 1e-9))
    np.testing.assert_array_equal(shooting.within(limited), limited)
