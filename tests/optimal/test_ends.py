"""Ends of tasks that plans and optimisations share: states, poses, and plans as guesses."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = [pytest.mark.slow, pytest.mark.long]

SMOOTH = fan.control.Smooth(1e-2, 0.0)


def move_bob(crane: fan.Marionette, end: object, **options: object) -> fan.control.Optimum:
    """The motion of least acceleration that moves the bob to an end within 1.5 s."""
    return fan.optimise(
        fan.Task(crane, crane.rest(), 1.5, end=end, smooth=SMOOTH, interval=0.1, **options)
    )


def test_a_pose_leaves_other_coordinates_free(small_crane: fan.Marionette):
    """The bob comes to rest at a place; it costs less than if the hand has to rest above it."""
    to_pose = move_bob(small_crane, {"bob.x": 0.4})
    assert to_pose and to_pose.run.state(-1)["bob.x"] == pytest.approx(0.4, abs=1e-5)
    assert np.max(np.abs(to_pose.run.v_D[-1])) < 1e-5
    to_rest = move_bob(small_crane, small_crane.rest({"line.x": 0.4}))
    assert to_rest and to_pose.cost < 0.98 * to_rest.cost
    to_state = move_bob(small_crane, to_pose.run.state(-1))
    assert to_state and to_state.cost == pytest.approx(to_pose.cost, rel=1e-4)


def test_weights_of_a_pose_select_the_velocities_that_must_be_zero(small_crane: fan.Marionette):
    weights = {"speed_weight": 0.0, "driven_weight": 1.0}
    goal = fan.control.Goal.pose(small_crane, {"bob.x": 0.4}, **weights)
    moving = move_bob(small_crane, goal)
    assert moving and moving.run.state(-1)["bob.x"] == pytest.approx(0.4, abs=1e-5)
    assert np.max(np.abs(moving.run.v_K[-1])) < 1e-5 and np.max(np.abs(moving.run.v_D[-1])) > 1e-2


@pytest.mark.parametrize("duration", [1.5, (0.3, 3.0)])
def test_a_place_equals_the_pose_at_which_the_point_is_there(
    small_crane: fan.Marionette, duration: float | tuple[float, float]
):
    """The bob's joint translates along x and z, so that its place is its pose."""
    bounds = fan.control.Bounds(acceleration=2.0)
    place = fan.control.Goal.point(small_crane, "bob", (0.4, 0.0, -0.9), speed_weight=0.1)
    best = [
        fan.optimise(
            fan.Task(
                small_crane,
                small_crane.rest(),
                duration,
                end=end,
                smooth=SMOOTH,
                bounds=bounds,
                interval=0.1,
            )
        )
        for end in (place, {"bob.x": 0.4, "bob.z": -0.9})
    ]
    assert all(motion.holds for motion in best), [motion.summary() for motion in best]
    assert best[0].end_gap < 1e-3 and best[0].gains.shape == best[1].gains.shape
    at_place = best[0].run.state(-1)
    assert [at_place["bob.x"], at_place["bob.z"]] == pytest.approx([0.4, -0.9], abs=1e-5)
    assert np.max(np.abs(at_place.v_D)) < 1e-5
    assert best[0].cost == pytest.approx(best[1].cost, rel=1e-3)


def test_a_place_out_of_reach_is_violated(small_crane: fan.Marionette):
    distant_place = fan.control.Goal.point(small_crane, "bob", (50.0, 0.0, -0.9))
    best = move_bob(small_crane, distant_place, bounds=fan.control.Bounds(acceleration=1.0))
    assert best.status is fan.control.AnswerStatus.VIOLATED and best.end_gap > 10.0
    conditions = fan.control.PlanConditions(slack=True)
    with pytest.raises(fan.errors.StateError, match="explore excludes a place"):
        move_bob(small_crane, distant_place, explore=1, conditions=conditions)


def test_a_box_is_only_for_plans(small_crane: fan.Marionette):
    box = fan.control.Goal.point(small_crane, "bob", (0.3, -0.1, -1.1), to=(0.4, 0.1, -0.9))
    with pytest.raises(fan.errors.StateError, match="a box"):
        move_bob(small_crane, box)


@pytest.mark.parametrize("end", [{"bob.x": (0.3, 0.4)}, lambda states: states.q_D[..., 0]])
def test_ends_without_derivatives_are_only_for_plans(small_crane: fan.Marionette, end: object):
    with pytest.raises(fan.errors.StateError, match="which only plans support; needed: a state"):
        move_bob(small_crane, end)


def test_a_pose_beyond_its_bounds_is_refused(small_crane: fan.Marionette):
    bounds = fan.control.Bounds(joint={"bob.x": (-0.1, 0.1)})
    with pytest.raises(fan.errors.StateError, match=r"bob\.x is 0\.4 at the end, beyond its"):
        move_bob(small_crane, {"bob.x": 0.4}, bounds=bounds)


def test_one_task_is_planned_and_optimised(small_crane: fan.Marionette):
    """The bob is lifted over a post: a plan is the first iterate, with its duration.

    Plans of other seeds lead to the same least time; the search without a plan takes much longer.
    """
    post = {"name": "post", "type": "box", "size": [0.05, 0.3, 0.4], "at": [0.3, 0, -1.1]}
    task = fan.Task(
        small_crane,
        small_crane.rest(),
        (0.5, 4.0),
        smooth=SMOOTH,
        bounds=fan.control.Bounds(speed=0.5, acceleration=2.0, clearance=0.005),
        end={"bob.x": 0.6, "bob.z": -1.0},
        interval=0.05,
        dt=0.01,
        obstacles=[post],
        conditions=fan.control.PlanConditions(slack=False),
    )
    optima = []
    for seed in (0, 1):
        plan = fan.plan(task, seed=seed).polish(seconds=0.0)
        assert plan and plan.polished.reached
        first_iterate = fan.optimise(task, guess=plan, iterations=0)
        assert first_iterate.duration == pytest.approx(plan.duration)
        event_run = plan.verify(method="event").run
        assert first_iterate.run.q_D[-1] == pytest.approx(event_run.q_D[-1], abs=0.01)
        optimum = fan.optimise(task, guess=plan, tolerance=1e-4)
        assert optimum and optimum.duration < plan.duration and optimum.end_gap < 1e-4
        assert fan.dynamics.Clearance(small_crane, [post]).nearest(optimum.run).distance > 0.004
        assert min(optimum.run.tension["line"]) > 0.0
        optima.append(optimum)
    assert optima[0].cost == pytest.approx(optima[1].cost, rel=1e-3)
