"""Ends of tasks that plans and optimisations share: states, poses, and plans as guesses."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.planning import solve

pytestmark = [pytest.mark.slow, pytest.mark.long]

SMOOTH = fan.control.Smooth(1e-2, 0.0)


def carried(crane: fan.Marionette, end: object, **parts: object) -> fan.control.Optimum:
    """The motion of least acceleration that moves the bob to an end within 1.5 s."""
    return fan.optimise(
        fan.Task(crane, crane.rest(), 1.5, end=end, smooth=SMOOTH, interval=0.1, **parts)
    )


def test_a_pose_leaves_other_coordinates_free(small_crane: fan.Marionette):
    """The bob comes to rest at a place; it costs less than if the hand has to rest above it."""
    pose = carried(small_crane, {"bob.x": 0.4})
    assert pose and pose.run.state(-1)["bob.x"] == pytest.approx(0.4, abs=1e-5)
    assert np.max(np.abs(pose.run.v_D[-1])) < 1e-5
    rest = carried(small_crane, small_crane.rest({"line.x": 0.4}))
    assert rest and pose.cost < 0.98 * rest.cost
    again = carried(small_crane, pose.run.state(-1))
    assert again and again.cost == pytest.approx(pose.cost, rel=1e-4)


def test_weights_of_a_pose_select_the_velocities_that_must_be_zero(small_crane: fan.Marionette):
    weights = {"speed_weight": 0.0, "driven_weight": 1.0}
    goal = fan.control.Goal.pose(small_crane, {"bob.x": 0.4}, **weights)
    moving = carried(small_crane, goal)
    assert moving and moving.run.state(-1)["bob.x"] == pytest.approx(0.4, abs=1e-5)
    assert np.max(np.abs(moving.run.v_K[-1])) < 1e-5 and np.max(np.abs(moving.run.v_D[-1])) > 1e-2


@pytest.mark.parametrize("end", [{"bob.x": (0.3, 0.4)}, lambda states: states.q_D[..., 0]])
def test_ends_without_derivatives_are_only_for_plans(small_crane: fan.Marionette, end: object):
    with pytest.raises(fan.errors.StateError, match="which only plans support; needed: a state"):
        carried(small_crane, end)


def test_a_pose_beyond_its_bounds_is_refused(small_crane: fan.Marionette):
    bounds = fan.control.Bounds(joint={"bob.x": (-0.1, 0.1)})
    with pytest.raises(fan.errors.StateError, match=r"bob\.x is 0\.4 at the end, beyond its"):
        carried(small_crane, {"bob.x": 0.4}, bounds=bounds)


def test_one_task_is_planned_and_optimised():
    """The plan is the first iterate, of its own duration; the optimum costs less and holds."""
    problem = fan.control.load_problem("arm3d_boxes")
    bounds = fan.control.Bounds(speed=0.5, acceleration=2.0, clearance=0.005)
    task = fan.Task(
        problem.task.marionette,
        problem.task.x0,
        (0.5, 6.0),
        smooth=SMOOTH,
        bounds=bounds,
        end={"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)},
        interval=0.1,
        dt=0.02,
        obstacles=problem.task.obstacles,
        conditions=problem.task.conditions,
    )
    plan = fan.plan(task, seed=3).polish()
    assert plan and plan.polished.reached
    assert np.array_equal(plan.path, solve(problem, seed=3).polish().path)
    first = fan.optimise(task, guess=plan, iterations=0)
    assert first.duration == pytest.approx(plan.duration)
    event = plan.verify(method="event").run
    assert first.run.q_D[-1] == pytest.approx(event.q_D[-1], abs=0.02)
    best = fan.optimise(task, guess=plan, time_limit=60.0)
    assert best.holds and best.cost < first.cost and best.end_gap < 1e-3
    clear = fan.dynamics.Clearance(problem.marionette, problem.task.obstacles)
    assert clear.nearest(best.run).distance > 0.004
    assert problem.goal.distance(fan.control.StateArrays.of(best.run.state(-1)))[0] < 1e-3
