"""Plans: found, reproducible, valid in another simulation; and mistakes."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import FileError
from fantoccini.control.planning import EST2007, Explore, solve
from fantoccini.control.tasks import RolloutOptions, StateArrays

pytestmark = [pytest.mark.slow, pytest.mark.long]

ARM = fan.puppets.arm3d()
HANGING = ARM.rest(
    {"shoulder.rotation": [0, 0, 0], "elbow": 0.05, "hand.x": 0.3, "hand.length": 1.34}
)
RAISED = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
BOXES = [
    {"name": "low", "type": "box", "size": [0.14, 0.4, 0.12], "at": [0.25, 0.0, -0.42]},
    {"name": "high", "type": "box", "size": [0.1, 0.16, 0.2], "at": [0.32, -0.12, -0.1]},
]
TIME_LIMIT = 120.0
"""Time limit [s], much longer than a search, so that iterations decide."""


def bounds_option(**keywords) -> dict[str, fan.control.Bounds]:
    return {"bounds": fan.control.Bounds(**keywords)}


def raising_plan(seed: int = 0, obstacles=(), **options) -> fan.control.PlanResult:
    arguments = {"tolerance": 0.25, "iterations": 40_000, "time_limit": TIME_LIMIT} | options
    return fan.plan(ARM, HANGING, RAISED, obstacles, seed=seed, **arguments)


@pytest.fixture(scope="module")
def plan_among_boxes() -> fan.control.PlanResult:
    return raising_plan(seed=1, obstacles=BOXES)


def test_a_plan_among_boxes_arrives_and_stays_clear(plan_among_boxes):
    result = plan_among_boxes
    assert result and result.status is fan.control.AnswerStatus.EXACT
    assert result.distance <= 0.25
    assert result.clearance.min() > -1e-3, "between checks it may be slightly nearer"
    end = result.trajectory.state(-1)
    shoulder = 2 * np.arccos(
        abs(end.q_D[:4] @ [np.cos(np.radians(40)), 0, -np.sin(np.radians(40)), 0])
    )
    distance = shoulder + abs(end.q_D[4] - RAISED["elbow"]) + 0.1 * np.linalg.norm(end.v_D)
    assert distance == pytest.approx(result.distance, abs=1e-6)


def test_the_boxes_are_in_the_way(plan_among_boxes):
    """Without them the first plans pass through their places."""
    clear = fan.dynamics.Clearance(ARM, BOXES)
    passes = [np.min(clear.of(raising_plan(seed).trajectory)) < 0.0 for seed in range(5)]
    assert sum(passes) >= 4


def test_inputs_keep_their_bounds(plan_among_boxes):
    t = np.linspace(0, plan_among_boxes.duration, 2001)
    _, v_K, acc_K = plan_among_boxes.inputs.evaluate(t)
    assert np.max(np.abs(v_K)) <= 0.5 * (1 + 1e-9)
    assert np.max(np.abs(acc_K)) <= 2.0 * (1 + 1e-9)
    speed = {"hand.x": 0.3, "hand.length": 0.5}
    bounded = raising_plan(seed=2, **bounds_option(speed=speed))
    _, v_K, _ = bounded.inputs.evaluate(np.linspace(0, bounded.duration, 501))
    assert np.max(np.abs(v_K[:, 1])) == 0.0, "hand.y is not named and holds still"
    assert np.max(np.abs(v_K[:, 0])) <= 0.3 * (1 + 1e-9)


def test_the_same_seed_gives_the_same_plan_for_any_threads(plan_among_boxes):
    repeated = raising_plan(seed=1, obstacles=BOXES, rollouts=RolloutOptions(threads=1))
    assert repeated.path == plan_among_boxes.path and repeated.tried == plan_among_boxes.tried
    for name in ("q_D", "v_D", "q_K", "acceleration", "distance"):
        assert np.array_equal(getattr(repeated.tree, name), getattr(plan_among_boxes.tree, name))
    assert raising_plan(seed=2, obstacles=BOXES).path != plan_among_boxes.path


def test_a_plan_replays_to_the_last_bit(plan_among_boxes):
    assert plan_among_boxes.replay()
    node = plan_among_boxes.path[1]
    acceleration = plan_among_boxes.tree.acceleration[node].copy()
    plan_among_boxes.tree.acceleration[node] *= 1 + 1e-12
    assert not plan_among_boxes.replay()
    plan_among_boxes.tree.acceleration[node] = acceleration


def test_a_plan_is_verified_in_another_simulation(plan_among_boxes):
    with_same_step = plan_among_boxes.verify(dt_factor=1.0)
    assert with_same_step.arrives and with_same_step.deviation < 1e-6
    event_check = plan_among_boxes.verify(method=fan.Event(rtol=1e-10, atol=1e-10))
    assert event_check.arrives and event_check.run.t[-1] == pytest.approx(plan_among_boxes.duration)
    end = event_check.run.q_D[-1]
    coarse, fine = (plan_among_boxes.verify(dt_factor=f).run.q_D[-1] for f in (1.0, 1.0 / 16.0))
    assert np.max(np.abs(fine - end)) < np.max(np.abs(coarse - end))


def test_the_papers_planner_comes_nearer():
    biased, uniform = (
        [
            raising_plan(seed, planner=EST2007(bias=bias), iterations=400, tolerance=0.01)
            for seed in range(5)
        ]
        for bias in (4.0, 0.0)
    )
    for result in biased:
        assert 400 <= result.tried < 464 and not result
        assert result.status is fan.control.AnswerStatus.APPROXIMATE
    biased_distance, uniform_distance = (
        np.median([p.distance for p in plans]) for plans in (biased, uniform)
    )
    assert biased_distance < 0.9 * float(biased[0].tree.distance[0])
    assert biased_distance < uniform_distance, "the distance bias helps, as the paper says"


def test_the_papers_planner_solves_the_papers_problem():
    """The arm of Fig. 4, past two boxes, with the defaults of `est-2007`.

    It takes seconds with 200,000 rollouts; rollouts of 40 to 200 ms gave no plan in 400,000.
    """
    problem = fan.control.load_problem("arm3d_boxes")
    plans = [
        solve(problem, planner="est-2007", seed=seed, time_limit=TIME_LIMIT, iterations=200_000)
        for seed in range(3)
    ]
    assert all(plans) and all(p.verify(method="event").arrives for p in plans)


def test_goals_of_other_kinds():
    elbow = fan.plan(ARM, ARM.rest(), {"elbow": 1.2}, tolerance=0.05, iterations=20_000)
    assert elbow and abs(elbow.trajectory.q_D[-1, 4] - 1.2) < 0.05
    point_goal = fan.control.Goal.point(ARM, "lower", [0.35, 0.05, 0.0], at=[0, 0, -0.3])
    hand = fan.plan(ARM, ARM.rest(), point_goal, tolerance=0.03, iterations=20_000)
    assert hand
    end = hand.trajectory.state(-1)
    tip = ARM.string_points(end.q_D, end.q_K)["hand"][0]
    assert np.linalg.norm(tip - [0.35, 0.05, 0.0]) < 0.03 + 1e-6

    def excess(rows: StateArrays):
        return np.maximum(0.1 - rows.q_K[..., 1], 0.0)

    assert fan.plan(ARM, ARM.rest(), excess, tolerance=1e-6, iterations=20_000)
    state = ARM.rest({"hand.x": 0.4})
    assert fan.plan(ARM, ARM.rest(), state, tolerance=0.1, iterations=20_000)


def test_a_goal_that_is_met_needs_no_motion():
    plan = fan.plan(ARM, HANGING, HANGING)
    assert plan and plan.duration == 0.0 and plan.path == (0,)
    assert plan.trajectory.status is fan.Status.DONE


def test_a_start_in_collision_is_reported():
    stones = [{"name": "stone", "type": "sphere", "radius": 0.2, "at": [0, 0, -0.3]}]
    result = fan.plan(ARM, HANGING, RAISED, stones)
    assert not result and result.status is fan.control.AnswerStatus.INFEASIBLE_START
    assert "inside stone" in result.reason and result.tried == 0
    out_of_range = fan.plan(
        ARM, HANGING, RAISED, bounds=fan.control.Bounds(position={"hand.length": (0.2, 1.0)})
    )
    assert "hand.length starts at 1.34, outside of its range 0.2 to 1" in out_of_range.reason


def test_a_goal_out_of_reach_is_reported():
    overbent = fan.plan(ARM, HANGING, {"elbow": 3.0})
    assert (
        overbent.status is fan.control.AnswerStatus.INFEASIBLE_GOAL
        and not overbent
        and overbent.tried == 0
    )
    assert "elbow is required at 3, beyond its upper limit 2.6" in overbent.reason
    assert fan.plan(ARM, HANGING, {"elbow": (2.0, 3.0)}, iterations=64).tried > 0
    distant_goal = fan.control.Goal.point(ARM, "lower", [0.5, 0.0, -0.5], at=[0, 0, -0.3])
    result = fan.plan(ARM, HANGING, distant_goal, tolerance=0.05)
    assert result.status is fan.control.AnswerStatus.INFEASIBLE_GOAL
    assert "0.707 m from shoulder, and lower reaches at most 0.6 m" in result.reason
    assert fan.plan(ARM, HANGING, distant_goal, tolerance=0.11, iterations=64).tried > 0


def test_an_end_of_the_search_returns_the_nearest():
    def interrupting_planner(tree, rollouts, rng):
        if len(tree) > 500:
            raise KeyboardInterrupt
        return Explore()(tree, rollouts, rng)

    interrupted_plan = raising_plan(planner=interrupting_planner, tolerance=1e-9)
    assert not interrupted_plan and interrupted_plan.status is fan.control.AnswerStatus.APPROXIMATE
    assert (
        interrupted_plan.distance
        == interrupted_plan.tree.distance.min()
        < interrupted_plan.tree.distance[0]
    )
    out_of_time = raising_plan(tolerance=1e-9, time_limit=0.2, iterations=10**9)
    assert out_of_time.status is fan.control.AnswerStatus.OUT_OF_TIME and not out_of_time
    assert out_of_time.tried < 10**6, "work, not seconds: a busy machine does less of it"


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"goal": {"elbo": 1.0}}, fan.errors.UnknownNameError, "did you mean 'elbow'"),
        ({"goal": 3}, fan.errors.StateError, "the goal is 3"),
        ({"planner": "rrt"}, ValueError, "explore, est-2007"),
        ({"tolerance": 0.0}, ValueError, "tolerance is 0"),
        (bounds_option(speed=-1.0), fan.errors.StateError, "the speed of hand.x is -1"),
        (bounds_option(speed=1e7), fan.errors.StateError, "hand.x is 10000000.0; .* at most 1e.06"),
        (bounds_option(speed={"hand.z": 1.0}), fan.errors.UnknownNameError, "hand.z"),
        (bounds_option(speed=0.0), fan.errors.StateError, "no driven coordinate may move"),
        (
            bounds_option(position={"hand.x": (1.0, 0.0)}),
            fan.errors.StateError,
            "must not be empty",
        ),
        ({"obstacles": [{"name": "o", "type": "sphere", "radius": 0}]}, FileError, "radius"),
        (bounds_option(clearance=-1.0), ValueError, "clearance"),
        (
            bounds_option(jerk=1.0),
            fan.errors.StateError,
            "not support bounds of jerk; give position, speed",
        ),
        ({"iterations": 0}, ValueError, "iterations is 0"),
        ({"obstacles": [3]}, FileError, r"obstacles\[0\]: found 3"),
        ({"goal": lambda rows: 1.0}, fan.errors.StateError, "finite distances of the shape"),
        ({"goal": fan.puppets.arm2d().state()}, fan.errors.StateError, "another puppet"),
    ],
)
def test_mistakes_of_plans_are_refused(options, error, message):
    options = dict(options)
    goal, obstacles = options.pop("goal", RAISED), options.pop("obstacles", ())
    with pytest.raises(error, match=message):
        fan.plan(ARM, HANGING, goal, obstacles, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_checks": 10**6}, "a segment lasts 20000 s; it must be at most 10 s"),
        ({"dt": 1e-9, "steps_per_check": 10**6}, "takes 5000000 steps"),
        ({"steps_per_check": 0}, "steps_per_check is 0"),
        ({"threads": 0}, "threads is 0"),
        ({"reserve": 1.0}, "reserve is 1.0"),
    ],
)
def test_rollout_options_out_of_range_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        RolloutOptions(**options)


def test_a_fixed_coordinate_does_not_mislead():
    speeds = {"hand.x": 0.5, "hand.length": 0.5}
    counts = [raising_plan(seed, **bounds_option(speed=speeds)).tried for seed in range(5)]
    assert np.median(counts) <= 1.5 * np.median([raising_plan(seed).tried for seed in range(5)])


def test_the_whole_event_driven_run_is_checked(plan_among_boxes):
    event_check = plan_among_boxes.verify(method=fan.Event(rtol=1e-9, atol=1e-9))
    assert np.max(np.diff(event_check.run.t)) <= plan_among_boxes.rollouts.options.interval * (
        1 + 1e-9
    )
    dense_run = fan.simulate(
        ARM,
        HANGING,
        plan_among_boxes.inputs,
        t_end=plan_among_boxes.duration,
        method=fan.Event(rtol=1e-9, atol=1e-9),
    )
    min_clearance = np.min(plan_among_boxes.rollouts.clearance.of(dense_run))
    assert event_check.arrives and min_clearance > -1e-3


@pytest.mark.parametrize(("dt", "steps_per_check"), [(0.001, 13), (0.0037, 3), (0.003, 7)])
def test_a_plan_replays_with_any_step(dt, steps_per_check):
    result = raising_plan(seed=2, rollouts=RolloutOptions(dt=dt, steps_per_check=steps_per_check))
    assert len(result.path) > 2 and result.replay()


def test_a_start_that_moves_may_be_the_goal():
    moving_start = ARM.project(HANGING.replace(v_K=[0.1, 0.0, 0.0]))
    plan = fan.plan(ARM, moving_start, HANGING, tolerance=1.0)
    assert plan and plan.path == (0,)
    assert plan.trajectory.status is fan.Status.DONE and plan.verify().arrives


def test_an_impossible_start_is_reported():
    with pytest.raises(fan.errors.StateError, match="hand"):
        fan.plan(ARM, HANGING.replace(q_K=[0.3, 0.0, 1.0]), RAISED)


def test_a_task_is_planned_as_its_parts_are(plan_among_boxes):
    """The short form creates a task; both find the same plan, to the bit."""
    conditions = fan.control.PlanConditions(tolerance=0.25)
    task = fan.Task(ARM, HANGING, end=RAISED, obstacles=BOXES, conditions=conditions)
    result = fan.plan(task, seed=1, iterations=40_000, time_limit=TIME_LIMIT)
    assert np.array_equal(result.acceleration, plan_among_boxes.acceleration)
    assert result.problem.task is task and plan_among_boxes.problem.task.end is RAISED
    assert result.problem.fingerprint == plan_among_boxes.problem.fingerprint
    with pytest.raises(fan.errors.StateError, match="give no others"):
        fan.plan(task, HANGING)


def test_a_plan_lasts_no_longer_than_its_task():
    end = {"elbow": 0.35}
    unlimited = fan.plan(fan.Task(ARM, HANGING, end=end), seed=1, time_limit=TIME_LIMIT)
    for share in (0.9, 1.1):
        durations = (0.1, share * unlimited.duration)
        result = fan.plan(
            fan.Task(ARM, HANGING, durations, end=end),
            seed=1,
            iterations=3000,
            time_limit=TIME_LIMIT,
        )
        assert result.duration <= durations[1] + 1e-9
        assert result.problem.fingerprint != unlimited.problem.fingerprint
    assert result and result.duration == unlimited.duration


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "no end; needed: a state"),
        ({"end": RAISED, "touches": [fan.control.Touch("lower", (0.3, 0, -0.6))]}, "has touches"),
        ({"end": RAISED, "parameters": {"m1": (0.1, 0.2)}}, "has parameters"),
    ],
)
def test_a_task_that_plans_cannot_answer_is_refused(options, message):
    with pytest.raises(fan.errors.StateError, match=message):
        fan.plan(fan.Task(ARM, HANGING, 5.0, **options))


def test_compiling_does_not_count(tmp_path, monkeypatch):
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path))
    text = fan.puppets.path("arm2d").read_text(encoding="utf-8")
    fresh = fan.loads(text)
    x = fresh.rest()
    result = fan.plan(fresh, x, lambda rows: rows.q_K[..., 0] * 0 + 1, time_limit=0.5)
    assert result.tried > 0


def test_a_goal_with_impossible_ends_is_searched_without_a_law():
    problem = fan.control.Problem(
        ARM,
        ARM.rest({"hand.x": 0.3, "hand.length": 1.32}),
        RAISED,
        tolerance=0.25,
        bounds=fan.control.Bounds(position={"hand.length": (1.25, 1.6)}),
    )
    assert not problem.rollouts.laws and not problem.rests_at_goal
    assert solve(problem, iterations=200).tried >= 200


def test_a_puppet_without_strings_is_planned():
    cart = {"name": "cart", "joint": {"name": "slide", "type": "prismatic", "axis": [1, 0, 0]}}
    cart["joint"]["driven"] = True
    bob = {
        "name": "bob",
        "parent": "cart",
        "mass": 0.2,
        "com": [0, 0, -0.3],
        "joint": {"name": "swing", "type": "revolute", "axis": [0, 1, 0], "damping": 0.01},
    }
    puppet = fan.loads(str({"puppet": "gantry", "bodies": [cart, bob]}))
    result = fan.plan(puppet, puppet.state(), {"swing": 0.3}, tolerance=0.1, iterations=20_000)
    assert result and result.replay()


def test_ctrl_c_stops_all_workers():
    """The arrays of an interrupted round outlive its workers."""
    script = """
import os, signal, threading, time
import fantoccini as fan
told = []
def stop(number, frame):
    told.append(number)
    raise KeyboardInterrupt
signal.signal(signal.SIGINT, stop)
arm = fan.puppets.arm3d()
x = arm.rest({"hand.x": 0.3, "hand.length": 1.32, "elbow": 0.1})
problem = fan.control.Problem(arm, x, {"elbow": 1.0}, tolerance=1e-7)
for k in range(25):
    found = None
    try:
        threading.Timer(0.02 + 0.003 * k, os.kill, (os.getpid(), signal.SIGINT)).start()
        found = fan.control.solve(problem, seed=k, time_limit=60.0)
        while len(told) <= k:
            time.sleep(0.01)
        time.sleep(0.3)
    except KeyboardInterrupt:
        pass
    assert found is None or found.distance < 1.0
print("whole")
"""
    process = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=300
    )
    assert process.returncode == 0 and "whole" in process.stdout, process.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_fork_plans_too():
    script = """
import os, fantoccini as fan
problem = fan.control.load_problem("arm3d_boxes")
assert fan.control.solve(problem, seed=0)
child = os.fork()
if child == 0:
    os._exit(0 if fan.control.solve(problem, seed=1) else 1)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)
