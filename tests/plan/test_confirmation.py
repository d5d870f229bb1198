"""Plans are confirmed in simulation, and failures have reasons."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from tests.plan.seeds import first_plan, near, polished

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

DAMPED = fan.loads(fan.puppets.path("arm3d").read_text(encoding="utf-8").replace("2.0e-4", "0.2"))
START = {"hand.x": 0.3, "hand.length": 1.32, "shoulder.rotation": [0, 0, 0], "elbow": 0.1}
RAISED = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
BOXES = [
    {"name": "low", "type": "box", "size": [0.14, 0.4, 0.12], "at": [0.25, 0.0, -0.42]},
    {"name": "high", "type": "box", "size": [0.1, 0.16, 0.2], "at": [0.32, -0.12, -0.1]},
]


@pytest.fixture(scope="module")
def damped() -> Problem:
    """A string goes slack near the boxes: the time-stepper differs at catches."""
    start = DAMPED.rest(START)
    return Problem(
        DAMPED, start, RAISED, BOXES, tolerance=0.1, bounds=fan.control.Bounds(acceleration=5.0)
    )


def test_plans_are_confirmed_event_driven_by_default(damped):
    """They end at the goal without contact, checked every millisecond."""
    for seed in range(16):
        plan = solve(damped, seed=seed, time_limit=60.0)
        assert plan and plan.status is fan.control.AnswerStatus.EXACT
        run = fan.simulate(DAMPED, damped.start, plan.inputs, t_end=plan.duration)
        every = run.resample(np.arange(0.0, run.t[-1], 1e-3))
        assert damped.rollouts.clearance.of(every).min() >= -1e-3
        assert damped.goal.distance(StateArrays.of(run.state(-1))) <= damped.tolerance + 1e-6


def refused(plan: PlanPath) -> check.Check:
    return dataclasses.replace(check.confirm_plan(plan), arrives=False, fault="it misses the goal")


def test_the_search_continues_after_an_unconfirmed_plan(boxes, monkeypatch, tmp_path):
    """The next one is used, and the number of refused plans is reported."""
    plans = []

    def not_the_first_two(plan: PlanPath) -> check.Check:
        plans.append(plan)
        return check.confirm_plan(plan) if len(plans) > 2 else refused(plan)

    monkeypatch.setattr(search, "confirm_plan", not_the_first_two)
    plan = solve(boxes, seed=0, time_limit=60.0)
    assert plan and plan.verify(method="event").arrives
    assert plan.refused >= 2 and len(plans) == plan.refused + 1
    assert f"{plan.refused} refused, which do not hold in simulation" in repr(plan)
    plan.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz", boxes).refused == plan.refused
    monkeypatch.setattr(search, "confirm_plan", refused)
    none = solve(boxes, seed=0, iterations=2000, time_limit=60.0)
    assert not none and none.status is fan.control.AnswerStatus.APPROXIMATE and none.refused > 0
    assert "do not hold in simulation" in none.message and none.distance > boxes.tolerance
    assert "(it misses the goal)" in none.message


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
    stopped = dataclasses.replace(full_run, status=fan.Status.STOPPED)
    monkeypatch.setattr(plan_path, "simulate", lambda *_, **__: stopped)
    plan = solve(boxes, seed=0, time_limit=60.0)
    assert not plan and plan.refused == 0 and plan.status is fan.control.AnswerStatus.APPROXIMATE


def test_a_true_plan_is_confirmed_in_any_case(boxes, monkeypatch):
    """bool(plan) of an unconfirmed search simulates the plan."""
    plan = first_plan(boxes, made=lambda p: solve(boxes, seed=0, confirm=False))
    assert plan.status is fan.control.AnswerStatus.UNCONFIRMED and plan.holds
    monkeypatch.setattr(result, "confirm_plan", refused)
    repeated = PlanResult.from_search(plan.search)
    assert not repeated and "does not hold in simulation" in repeated.message
    assert repeated.distance <= boxes.tolerance
    with pytest.raises(ValueError, match="no plan to polish"):
        repeated.polish()


def test_contact_between_checks_is_found(boxes):
    """The string passes a bead between two checks, without contact at either."""
    plan = solve(boxes, seed=0)
    run = plan.verify(method="event").run
    arm, first = boxes.marionette, np.arange(0.0, run.t[-1], boxes.rollouts.options.interval)
    fast = float(first[np.argmax(np.abs(run.resample(first).v_K[:, 0]))])
    between = run.at(fast + 0.5 * boxes.rollouts.options.interval)
    bead = {"name": "bead", "type": "sphere", "radius": 1.2e-3}
    middle = np.mean(arm.string_points(between.q_D, between.q_K)["hand"], axis=0)
    with_bead = Problem(
        arm, boxes.start, boxes.goal, [bead | {"at": middle.tolist()}], tolerance=0.25
    )
    clearances = with_bead.rollouts.clearance.of(run.resample(first))
    assert clearances.min() > 0.0
    plan_checked = check.check_plan(PlanPath(with_bead, plan.tree, plan.path), method="event")
    assert plan_checked.clearance < 0.0 and not plan_checked.arrives


def test_polish_says_that_polished_versions_are_too_long(monkeypatch):
    """The allowed time is a tenth of the duration of a plan."""
    boxes = fan.control.load_problem("arm3d_boxes")
    plan = first_plan(boxes)
    monkeypatch.setattr(plan.search.problem, "max_duration", 0.1 * plan.duration)
    tried = plan.polish(1e-3, seconds=0.0)
    assert tried.polished.status is PolishStatus.TOO_LONG and tried.path == plan.path
    assert "take longer than the problem allows" in tried.message and tried.refused == plan.refused


def test_polish_has_a_status(boxes, monkeypatch, tmp_path):
    """An unchanged plan has a reason."""
    plan_checked = first_plan(boxes, near, polished)
    assert plan_checked.polished.status is PolishStatus.POLISHED and "as required" in repr(
        plan_checked
    )
    assert plan_checked.polish(1e-3, seconds=0.0).polished.status is PolishStatus.NO_BETTER
    tried = plan_checked.polish(1e-15, seconds=0.0)
    assert tried.path == plan_checked.path and tried.polished.status is PolishStatus.NOT_NEAR
    assert 1e-15 < tried.polished.nearest < 1e-3 and "nearest:" in tried.message
    tried.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz", boxes).polished == tried.polished
    monkeypatch.setattr(search, "confirm_plan", refused)
    plan = solve(boxes, confirm=False)
    plan.search.options = dataclasses.replace(plan.search.options, confirm=True)
    left = plan.polish(0.2, seconds=0.0)
    assert left.path == plan.path and left.polished.status is PolishStatus.NOT_HELD


def test_improving_names_the_reason_for_a_missing_polish():
    """A goal that is a function, a plan without a motion, and no time."""
    arm = fan.puppets.arm3d()
    hangs = arm.rest(START)
    function = Problem(arm, hangs, lambda rows: np.maximum(0.3 - rows.q_K[..., 1], 0.0))
    assert solve(function, improve=0.01).polished.status is PolishStatus.UNKNOWN_GOAL
    met = solve(Problem(arm, hangs, {"elbow": hangs.q_D[4] + 0.02}), improve=0.01)
    assert met and met.polished.status is PolishStatus.NO_MOTION
    late = solve(Problem(arm, hangs, {"elbow": 1.0}), improve=1e-9)
    assert late and late.polished.status is PolishStatus.TIMEOUT
    assert math.isnan(late.polished.nearest) and "the time ended" in late.message


def test_a_goal_state_at_rest_ends_at_rest():
    """This includes driven velocities; the crane's trolley and its winch."""
    crane = fan.puppets.crane()
    start, goal = (crane.rest({"trolley": x}) for x in (-1.5, 1.5))
    problem = Problem(crane, start, goal, bounds=fan.control.Bounds(speed=2.0, acceleration=2.0))
    assert problem.rests_at_goal
    for seed in range(4):
        plan = solve(problem, seed=seed)
        assert plan and np.linalg.norm(plan.trajectory.v_K[-1]) <= problem.tolerance
    plan_checked = first_plan(problem, near, polished)
    assert np.linalg.norm(plan_checked.trajectory.v_K[-1]) <= 2e-3
    assert plan_checked.trajectory.q_K[-1] == pytest.approx(goal.q_K, abs=0.02)
