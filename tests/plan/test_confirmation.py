"""Plans are confirmed in simulation, and failures have reasons."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from tests.plan.seeds import first_plan, is_polished, polish_plan

import fantoccini as fan
from fantoccini.control.planning import (
    PlanResult,
    PolishStatus,
    check,
    plan_path,
    result,
    search,
    solve,
)
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import StateArrays

pytestmark = pytest.mark.medium

DAMPED_ARM = fan.loads(
    fan.puppets.path("arm3d").read_text(encoding="utf-8").replace("2.0e-4", "0.2")
)
START = {"hand.x": 0.3, "hand.length": 1.32, "shoulder.rotation": [0, 0, 0], "elbow": 0.1}
RAISED = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
BOXES = [
    {"name": "low", "type": "box", "size": [0.14, 0.4, 0.12], "at": [0.25, 0.0, -0.42]},
    {"name": "high", "type": "box", "size": [0.1, 0.16, 0.2], "at": [0.32, -0.12, -0.1]},
]


@pytest.fixture(scope="module")
def damped_problem() -> Problem:
    """A string goes slack near the boxes: the time-stepper differs at catches."""
    start = DAMPED_ARM.rest(START)
    return Problem(
        DAMPED_ARM, start, RAISED, BOXES, tolerance=0.1, bounds=fan.control.Bounds(acceleration=5.0)
    )


def test_plans_are_confirmed_event_driven_by_default(damped_problem):
    """They end at the goal without contact, checked every millisecond."""
    for seed in range(16):
        plan = solve(damped_problem, seed=seed, time_limit=60.0)
        assert plan and plan.status is fan.control.AnswerStatus.EXACT
        run = fan.simulate(DAMPED_ARM, damped_problem.start, plan.inputs, t_end=plan.duration)
        samples = run.resample(np.arange(0.0, run.t[-1], 1e-3))
        assert damped_problem.rollouts.clearance.of(samples).min() >= -1e-3
        assert (
            damped_problem.goal.distance(StateArrays.of(run.state(-1)))
            <= damped_problem.tolerance + 1e-6
        )


def refuse_plan(plan: PlanPath) -> check.Check:
    return dataclasses.replace(check.confirm_plan(plan), arrives=False, fault="it misses the goal")


def test_the_search_continues_after_an_unconfirmed_plan(boxes, monkeypatch, tmp_path):
    """The next one is used, and the number of refused plans is reported."""
    plans = []

    def refuse_first_two(plan: PlanPath) -> check.Check:
        plans.append(plan)
        return check.confirm_plan(plan) if len(plans) > 2 else refuse_plan(plan)

    monkeypatch.setattr(search, "confirm_plan", refuse_first_two)
    plan = solve(boxes, seed=0, time_limit=60.0)
    assert plan and plan.verify(method="event").arrives
    assert plan.refused >= 2 and len(plans) == plan.refused + 1
    assert f"{plan.refused} refused, which do not hold in simulation" in repr(plan)
    plan.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz", boxes).refused == plan.refused
    monkeypatch.setattr(search, "confirm_plan", refuse_plan)
    without_plan = solve(boxes, seed=0, iterations=2000, time_limit=60.0)
    assert (
        not without_plan
        and without_plan.status is fan.control.AnswerStatus.APPROXIMATE
        and without_plan.refused > 0
    )
    assert (
        "do not hold in simulation" in without_plan.message
        and without_plan.distance > boxes.tolerance
    )
    assert "(it misses the goal)" in without_plan.message


@pytest.mark.parametrize("status", [fan.Status.LOST_STEPS, fan.Status.RUNAWAY])
def test_a_plan_with_too_weak_drives_is_not_confirmed(boxes, monkeypatch, status):
    """This holds even if the run reaches its end within the tolerance."""
    plan = solve(boxes, seed=0, time_limit=60.0)
    assert plan.verify(method="event").arrives
    simulate = PlanPath.simulate
    monkeypatch.setattr(
        PlanPath, "simulate", lambda *a, **o: dataclasses.replace(simulate(*a, **o), status=status)
    )
    assert not plan.verify(method="event").arrives
    assert not check.confirm_plan(plan.plan_path).arrives


def test_ctrl_c_while_a_plan_is_confirmed_ends_the_search(boxes, monkeypatch):
    """A run stopped by Ctrl-C says nothing about the plan, and is not refused."""
    full_run = fan.simulate(boxes.marionette, boxes.start, t_end=0.1)
    stopped_run = dataclasses.replace(full_run, status=fan.Status.STOPPED)
    monkeypatch.setattr(plan_path, "simulate", lambda *_, **__: stopped_run)
    plan = solve(boxes, seed=0, time_limit=60.0)
    assert not plan and plan.refused == 0 and plan.status is fan.control.AnswerStatus.APPROXIMATE


def test_a_true_plan_is_confirmed_in_any_case(boxes, monkeypatch):
    """bool(plan) of an unconfirmed search simulates the plan."""
    plan = first_plan(boxes, process=lambda p: solve(boxes, seed=0, confirm=False))
    assert plan.status is fan.control.AnswerStatus.UNCONFIRMED and plan.holds
    monkeypatch.setattr(result, "confirm_plan", refuse_plan)
    repeated = PlanResult.from_search(plan.search)
    assert not repeated and "does not hold in simulation" in repeated.message
    assert repeated.distance <= boxes.tolerance
    with pytest.raises(ValueError, match="no plan to polish"):
        repeated.polish()


def test_contact_between_checks_is_found(boxes):
    """The string passes a bead between two checks, without contact at either."""
    plan = solve(boxes, seed=0)
    run = plan.verify(method="event").run
    arm, check_times = boxes.marionette, np.arange(0.0, run.t[-1], boxes.rollouts.options.interval)
    fastest_time = float(check_times[np.argmax(np.abs(run.resample(check_times).v_K[:, 0]))])
    state_between = run.at(fastest_time + 0.5 * boxes.rollouts.options.interval)
    bead = {"name": "bead", "type": "sphere", "radius": 1.2e-3}
    middle = np.mean(arm.string_points(state_between.q_D, state_between.q_K)["hand"], axis=0)
    with_bead = Problem(
        arm, boxes.start, boxes.goal, [bead | {"at": middle.tolist()}], tolerance=0.25
    )
    clearances = with_bead.rollouts.clearance.of(run.resample(check_times))
    assert clearances.min() > 0.0
    checked = check.check_plan(PlanPath(with_bead, plan.tree, plan.path), method="event")
    assert checked.clearance < 0.0 and not checked.arrives


def test_polish_says_that_polished_versions_are_too_long(monkeypatch):
    """The allowed time is a tenth of the duration of a plan."""
    boxes = fan.control.load_problem("arm3d_boxes")
    plan = first_plan(boxes)
    monkeypatch.setattr(plan.search.problem, "max_duration", 0.1 * plan.duration)
    unchanged = plan.polish(1e-3, seconds=0.0)
    assert unchanged.polished.status is PolishStatus.TOO_LONG and unchanged.path == plan.path
    assert (
        "take longer than the problem allows" in unchanged.message
        and unchanged.refused == plan.refused
    )


def test_polish_has_a_status(boxes, monkeypatch, tmp_path):
    """An unchanged plan has a reason."""
    polished_plan = first_plan(boxes, is_polished, polish_plan)
    assert polished_plan.polished.status is PolishStatus.POLISHED and "as required" in repr(
        polished_plan
    )
    assert polished_plan.polish(1e-3, seconds=0.0).polished.status is PolishStatus.NO_BETTER
    not_near = polished_plan.polish(1e-15, seconds=0.0)
    assert not_near.path == polished_plan.path and not_near.polished.status is PolishStatus.NOT_NEAR
    assert 1e-15 < not_near.polished.nearest < 1e-3 and "nearest:" in not_near.message
    not_near.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz", boxes).polished == not_near.polished
    monkeypatch.setattr(search, "confirm_plan", refuse_plan)
    plan = solve(boxes, confirm=False)
    plan.search.options = dataclasses.replace(plan.search.options, confirm=True)
    not_held = plan.polish(0.2, seconds=0.0)
    assert not_held.path == plan.path and not_held.polished.status is PolishStatus.NOT_HELD


def test_improving_names_the_reason_for_a_missing_polish():
    """A goal that is a function, a plan without a motion, and no time."""
    arm = fan.puppets.arm3d()
    hanging = arm.rest(START)
    function_goal = Problem(arm, hanging, lambda rows: np.maximum(0.3 - rows.q_K[..., 1], 0.0))
    assert solve(function_goal, improve=0.01).polished.status is PolishStatus.UNKNOWN_GOAL
    met_goal = solve(Problem(arm, hanging, {"elbow": hanging.q_D[4] + 0.02}), improve=0.01)
    assert met_goal and met_goal.polished.status is PolishStatus.NO_MOTION
    out_of_time = solve(Problem(arm, hanging, {"elbow": 1.0}), improve=1e-9)
    assert out_of_time and out_of_time.polished.status is PolishStatus.TIMEOUT
    assert math.isnan(out_of_time.polished.nearest) and "the time ended" in out_of_time.message


def test_a_goal_state_at_rest_ends_at_rest():
    """This includes driven velocities; the crane's trolley and its winch."""
    crane = fan.puppets.crane()
    start, goal = (crane.rest({"trolley": x}) for x in (-1.5, 1.5))
    problem = Problem(crane, start, goal, bounds=fan.control.Bounds(speed=2.0, acceleration=2.0))
    assert problem.rests_at_goal
    for seed in range(4):
        plan = solve(problem, seed=seed)
        assert plan and np.linalg.norm(plan.trajectory.v_K[-1]) <= problem.tolerance
    polished_plan = first_plan(problem, is_polished, polish_plan)
    assert np.linalg.norm(polished_plan.trajectory.v_K[-1]) <= 2e-3
    assert polished_plan.trajectory.q_K[-1] == pytest.approx(goal.q_K, abs=0.02)
