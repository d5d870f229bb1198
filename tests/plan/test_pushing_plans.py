"""Plans that push a prop to its place, and props as obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plan.touching_bodies import BOB, DRAWN, HANGING_ARM, before_prop

import fantoccini as fan
from fantoccini.control.planning import solve
from fantoccini.control.problems import Problem

pytestmark = pytest.mark.slow

CRATE = {"type": "box", "size": [0.08, 0.12, 0.16], "mass": 0.05}
BALL = {"type": "sphere", "radius": 0.05, "mass": 0.05}
ALLOWED_CONTACT = {"touch": [("hand", "crate")]}


@pytest.fixture(scope="module")
def crates() -> tuple[fan.Marionette, fan.State]:
    scene = before_prop(HANGING_ARM, CRATE, 0.08)
    return scene, scene.rest(DRAWN)


def displacement_of(scene: fan.Marionette, run: fan.Trajectory) -> np.ndarray:
    """(T, 3) displacement of the prop [m]."""
    positions = scene.poses(run.q_D, run.q_K)[:, scene.link_index("crate"), :, 3]
    return positions - positions[0]


@pytest.mark.parametrize("seed", range(3))
def test_an_arm_pushes_a_crate_further(crates, seed):
    """It is moved by 10 cm and stays there, in a simulation with other steps than the planner's."""
    scene, x0 = crates
    goal = fan.control.Goal.displaced(scene, "crate", [0.1, 0.0, 0.0], x0)
    plan = fan.plan(
        scene, x0, goal, contact=ALLOWED_CONTACT, tolerance=0.05, seed=seed, time_limit=60.0
    )
    assert plan and plan.problem.hold > 0.0 and plan.touches[0].parts == ("hand", "crate")
    method = fan.TimeStepping(dt=1e-3)
    run = fan.simulate(scene, x0, plan.inputs, plan.inputs.end + 2.0, method=method)
    displacement = displacement_of(scene, run)
    assert np.linalg.norm(displacement[-1] - [0.1, 0.0, 0.0]) < 0.05
    assert np.max(np.abs(run.v_D[-1])) < 0.05
    first_contact = run.contact.involving("hand", "crate").sample[0]
    assert np.max(np.abs(displacement[:first_contact])) < 1e-6, "nothing else moves it"


def test_a_place_may_be_given_as_coordinates(crates):
    scene, x0 = crates
    plan = fan.plan(
        scene,
        x0,
        {"crate.x": (0.24, 0.26)},
        contact=ALLOWED_CONTACT,
        tolerance=0.03,
        seed=0,
        time_limit=60.0,
    )
    assert plan and abs(plan.verify().run.state(-1).q_D[2] - 0.25) < 0.04


def test_a_ball_is_pushed_past_its_place():
    """It would roll on: hold=0 only requires that it passes the place."""
    scene = before_prop(HANGING_ARM, BALL, 0.05)
    x0 = scene.rest(DRAWN)
    goal = fan.control.Goal.point(scene, "crate", [0.25, 0.0, 0.05])
    plan = fan.plan(
        scene, x0, goal, contact=ALLOWED_CONTACT, tolerance=0.05, hold=0.0, seed=0, time_limit=60.0
    )
    run = plan.verify().run
    assert plan and np.linalg.norm(displacement_of(scene, run)[-1] - [0.1, 0.0, 0.0]) < 0.05
    assert len(run.contact.involving("hand", "crate")) > 0


def test_an_avoided_prop_stays_in_place(crates):
    scene, x0 = crates
    # Behind the crate the arm has room to swing back, and none ahead.
    plan = fan.plan(scene, x0, {"shoulder": -0.1}, tolerance=0.05, seed=0, time_limit=60.0)
    verified = plan.verify()
    assert plan and verified.arrives and not verified.touches and verified.clearance > 0.0
    assert np.max(np.abs(displacement_of(scene, verified.run))) < 1e-6
    blocked = fan.plan(scene, x0, {"shoulder": 0.4, "elbow": 0.0}, tolerance=0.05, iterations=2000)
    assert not blocked
    pushing = fan.plan(
        scene,
        x0,
        {"shoulder": 0.4, "elbow": 0.0},
        contact=ALLOWED_CONTACT,
        tolerance=0.1,
        seed=0,
        time_limit=60.0,
    )
    verified = pushing.verify()
    assert pushing and verified.touches and displacement_of(scene, verified.run)[-1, 0] > 0.05


@pytest.mark.parametrize(("mass", "is_movable"), [(0.02, True), (20.0, False)])
def test_a_crate_that_is_too_heavy_reports_its_displacement(mass, is_movable):
    """A bob on a string pushes by part of its weight."""
    # A parameter, so that both crates share their library.
    scene = before_prop(BOB, CRATE | {"mass": {"parameter": "load", "value": mass}}, 0.08)
    x0 = scene.rest()
    goal = fan.control.Goal.displaced(scene, "crate", [0.1, 0.0, 0.0], x0)
    problem = Problem(
        scene,
        x0,
        goal,
        contact={"touch": [("bob", "crate")]},
        tolerance=0.05,
        bounds=fan.control.Bounds(speed=0.3, acceleration=0.5),
    )
    plan = solve(problem, seed=0, iterations=None if is_movable else 1000, time_limit=60.0)
    assert bool(plan) == is_movable
    if is_movable:
        return
    assert plan.status is fan.control.AnswerStatus.APPROXIMATE
    displacement = float(plan.message.split("crate came ")[1].split(" m of 0.1 m")[0])
    assert -0.01 < displacement < 0.05


def test_a_push_needs_an_allowed_contact(crates):
    scene, x0 = crates
    plan = fan.plan(
        scene, x0, fan.control.Goal.displaced(scene, "crate", [0.1, 0, 0], x0), tolerance=0.05
    )
    assert plan.status is fan.control.AnswerStatus.INFEASIBLE_GOAL
    assert "nothing may touch crate" in plan.message
