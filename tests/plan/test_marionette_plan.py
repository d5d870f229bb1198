"""A plan of the full marionette: 25 degrees of freedom, 21 driven coordinates, and a lamp."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.problems.balance import nearest_equilibrium

pytestmark = [pytest.mark.slow, pytest.mark.long]


def test_the_marionette_touches_the_bell_past_the_lamp():
    problem = fan.control.load_problem("marionette_bell")
    result = fan.control.solve(problem, seed=0, time_limit=60.0)
    assert result and result.replay()
    event_check = result.verify(method=fan.Event(rtol=1e-9, atol=1e-9))
    assert event_check.arrives and event_check.clearance > 0.0
    run = result.trajectory
    tip = problem.marionette.link_index("forearm_right")
    pose = problem.marionette.poses(run.q_D[-1:], run.q_K[-1:])[0, tip]
    hand = pose[:, 3] + pose[:, :3] @ [0.0, 0.0, -0.09]
    assert np.linalg.norm(hand - [0.14, -0.14, 0.55]) < 0.02
    assert max(float(t.max()) for _, t in run.tension.items()) < 2.0 * problem.marionette.weight
    # Without the lamp the direct path is free, and goes through its place.
    without_lamp = fan.control.Problem(
        problem.marionette,
        problem.start,
        problem.goal,
        tolerance=0.02,
        bounds=fan.control.Bounds(speed=0.4, acceleration=1.0),
        slack=False,
    )
    direct_plans = [fan.control.solve(without_lamp, seed=s) for s in range(4)]
    hits = [float(problem.rollouts.clearance.of(p.trajectory).min()) < 0.0 for p in direct_plans]
    assert all(direct_plans) and sum(hits) >= 3


def test_feedback_along_the_bell_absorbs_kicks():
    """Kicks of half a radian per second, over 25 degrees of freedom together."""
    problem = fan.control.load_problem("marionette_bell")
    plan = fan.control.solve(problem, seed=0, time_limit=60.0)
    law, random, arrivals = plan.feedback(), np.random.default_rng(0), []
    assert law.run().arrives
    for _ in range(4):
        x, kick = plan.start, random.normal(size=len(plan.start.v_D))
        kicked = problem.marionette.project(x.replace(v_D=0.5 * kick / np.linalg.norm(kick)))
        arrivals.append(law.run(kicked).distance <= plan.tolerance)
    assert all(arrivals)


def test_the_rest_at_the_goal_is_a_stable_equilibrium():
    problem = fan.control.load_problem("marionette_bell")
    puppet, movable = problem.marionette, problem.rollouts.bounds.movable
    q_D, q_K, residual = nearest_equilibrium(puppet, problem.goal, problem.start, movable)
    assert residual < 1e-9 * puppet.weight
    equilibrium = problem.start.replace(q_D=q_D, q_K=q_K)
    assert np.max(np.abs(puppet.rest(equilibrium).q_D - q_D)) < 1e-6
