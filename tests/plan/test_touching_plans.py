"""Plans with requested contacts that avoid everything else."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plan.touching_bodies import POST, over_table

import fantoccini as fan
from fantoccini.base.errors import StateError, UnknownNameError
from fantoccini.control.planning import PlanResult, check, solve
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.planning.polish import PolishStatus
from fantoccini.control.problems import Problem
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.tasks import TouchRules
from fantoccini.dynamics.clearance import Clearance

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

ARM, START = over_table()
TOUCH_TABLE = fan.control.Goal.touch(ARM, [("hand", "table")])


@pytest.fixture(scope="module")
def problem_past_post() -> Problem:
    return Problem(ARM, START, TOUCH_TABLE, [POST], bounds=fan.control.Bounds(clearance=0.005))


@pytest.fixture(scope="module")
def touching_plan(problem_past_post) -> PlanResult:
    return solve(problem_past_post, seed=0, time_limit=60.0)


@pytest.mark.parametrize("method", ["timestepping", "event"])
def test_the_hand_touches_the_table_and_keeps_off_the_post(
    problem_past_post, touching_plan, method
):
    assert touching_plan and touching_plan.status is fan.control.AnswerStatus.EXACT
    checked = touching_plan.verify(method=method)
    assert checked.arrives and checked.distance < 1e-5 and not checked.fault
    assert (
        float(Clearance(ARM, [POST], free=[frozenset({"hand", "table"})]).of(checked.run).min()) > 0
    )
    (touch,) = checked.touches
    assert touch.parts == ("hand", "table") and touch.allowed and touch.force > 0.0
    assert 0.0 < touch.t <= checked.run.t[-1]
    gaps = problem_past_post.touches.gaps(checked.run.q_D, checked.run.q_K)[:, 0]
    assert gaps[0] > 0.1 and gaps.min() > -1e-5 and abs(gaps[-1]) < 1e-5


def test_the_speed_of_a_touch_is_that_of_the_gap_before_it(touching_plan):
    """It is computed from gaps with fixed steps, and located event-driven."""
    speeds = [
        touching_plan.verify(0.125).touches[0].speed,
        touching_plan.verify(method="event").touches[0].speed,
    ]
    assert speeds[0] == pytest.approx(speeds[1], rel=0.1) and speeds[1] > 0.01
    run = touching_plan.verify(method="event").run
    state_before = run.at(touching_plan.verify(method="event").touches[0].t - 1e-4)
    state_ahead = state_before.replace(
        q_D=state_before.q_D + 1e-5 * state_before.v_D,
        q_K=state_before.q_K + 1e-5 * state_before.v_K,
    )
    gaps = [
        touching_plan.problem.touches.gaps(x.q_D, x.q_K)[0] for x in (state_before, state_ahead)
    ]
    assert (gaps[0] - gaps[1]) / 1e-5 == pytest.approx(speeds[1], rel=0.05)


def test_a_touching_plan_is_saved_and_replayed(problem_past_post, touching_plan, tmp_path):
    assert touching_plan.replay()
    touching_plan.save(tmp_path / "plan.npz")
    loaded = PlanResult.load(tmp_path / "plan.npz", problem_past_post)
    assert loaded and loaded.path == touching_plan.path
    other = Problem(
        ARM, START, TOUCH_TABLE, [POST], bounds=fan.control.Bounds(clearance=0.005), hold=0.5
    )
    with pytest.raises(fan.errors.FileError, match="another problem"):
        PlanResult.load(tmp_path / "plan.npz", other)


def test_functions_without_contact_refuse_it(problem_past_post, touching_plan):
    assert solve(problem_past_post, improve=0.05).polished.status is PolishStatus.MAY_TOUCH
    with pytest.raises(ValueError, match="cannot be polished"):
        touching_plan.polish()
    with pytest.raises(ValueError, match="feedback does not support"):
        touching_plan.feedback()
    with pytest.raises(ValueError, match="does not support contact"):
        touching_plan.verify(backend="mujoco")


def test_a_goal_may_ask_for_a_pose_and_a_touch():
    goal = fan.control.Goal.touch(ARM, [("hand", "table")], pose={"shoulder": (0.3, 0.4)})
    plan = fan.plan(ARM, START, goal, tolerance=0.02, seed=0, time_limit=60.0)
    checked = plan.verify()
    assert plan and checked.touches and 0.28 < checked.run.q_D[-1, 0] < 0.42


def test_keeping_off_is_the_default():
    """The arm sinks to above the table, and nothing touches in a simulation with contact."""
    plan = fan.plan(ARM, START, {"shoulder": 0.2, "elbow": 0.35}, tolerance=0.1, seed=0)
    checked = plan.verify(method="event")
    assert plan and not plan.problem.touches.expected
    assert checked.arrives and not checked.touches and checked.clearance > 0.0
    end_state = solve(Problem(ARM, START, TOUCH_TABLE), seed=0).verify().run.state(-1)
    resting = ARM.rest(end_state)
    for contact, status in (
        ("keep off", fan.control.AnswerStatus.INFEASIBLE_START),
        ({"touch": [("hand", "table")]}, fan.control.AnswerStatus.EXACT),
    ):
        lifting_plan = fan.plan(ARM, resting, {"elbow": 0.0}, contact=contact, seed=0)
        assert lifting_plan.status is status
    refused_plan = fan.plan(ARM, resting, {"elbow": 0.0})
    assert "contact: {touch: [[hand, table]]}" in refused_plan.message


def test_unwanted_contact_is_reported(touching_plan):
    """The plan was found without the post in its way, and is simulated with it."""
    without_post = Problem(ARM, START, TOUCH_TABLE)
    plan = solve(without_post, seed=0)
    state = plan.verify().run.at(0.6 * plan.touches[0].t)
    tip = ARM.poses(state.q_D, state.q_K)[1] @ [0.2, 0.0, 0.0, 1.0]
    post = POST | {"size": [0.02, 0.3, 0.02], "at": (tip - [0.0, 0.0, 0.03]).tolist()}
    with_post = Problem(ARM, START, TOUCH_TABLE, [post])
    checked = check.check_plan(PlanPath(with_post, plan.tree, plan.path))
    (touch,) = checked.forbidden
    assert not checked.arrives and touch.parts == ("hand", "post") and touch.speed > 0.0
    assert f"hand touches post at {touch.t:.3g} s" in checked.fault
    assert solve(with_post, seed=0, time_limit=30.0).verify().forbidden == ()


def test_rollouts_end_at_forbidden_contact(problem_past_post, touching_plan):
    """This holds between checks too: clearance is not measured here."""
    rollouts, start = problem_past_post.rollouts, np.zeros(1, dtype=int)
    acceleration = touching_plan.acceleration[None]
    unchecked = rollouts.with_tolerance(tolerance=-1.0).simulate(
        problem_past_post.root, start, acceleration
    )
    assert np.all(unchecked.n_checks > 0)
    all_pairs = np.ones(len(problem_past_post.touches.may_touch), dtype=bool)
    strict_rollouts = Rollouts(
        problem_past_post.marionette,
        rollouts.clearance,
        rollouts.bounds,
        problem_past_post.goal,
        rollouts.options,
        tolerance=-1.0,
        margin=-np.inf,
        slack=True,
        forbidden_pairs=all_pairs,
    )
    strict_run = strict_rollouts.simulate(problem_past_post.root, start, acceleration)
    first = int(np.flatnonzero(strict_run.n_checks[0] == 0)[0])
    touch = touching_plan.touches[0]
    assert (
        touching_plan.times[first]
        <= touch.t
        <= touching_plan.times[first + 1] + rollouts.options.interval
    )


def test_a_table_out_of_reach_is_recognised():
    shelf = {"name": "shelf", "type": "box", "size": [0.2, 0.3, 0.02], "at": [1.0, 0, 0.4]}
    goal = fan.control.Goal.touch(ARM, [("hand", "shelf")])
    plan = fan.plan(ARM, START, goal, [shelf], time_limit=60.0)
    assert plan.status is fan.control.AnswerStatus.INFEASIBLE_GOAL and not plan
    assert "shelf is at least" in plan.message and "hand reaches at most" in plan.message


def test_a_failed_touch_reports_its_distance():
    """The strings hardly move, which is not recognised beforehand."""
    plan = fan.plan(
        ARM,
        START,
        TOUCH_TABLE,
        bounds=fan.control.Bounds(
            position={"wrist.length": (0.5, 0.6), "sleeve.length": (0.5, 0.61)}
        ),
        iterations=200,
        time_limit=60.0,
    )
    assert not plan and plan.status is fan.control.AnswerStatus.APPROXIMATE
    assert "hand is 0." in plan.message and "m from table" in plan.message


@pytest.mark.parametrize(
    ("contact", "error", "message"),
    [
        ("touch", StateError, "must be 'keep off'"),
        ({"touch": ["hand"]}, StateError, "a pair of names"),
        ({"touch": [("hand", "tabel")]}, UnknownNameError, "tabel"),
        ({"touch": [("hand", "upper")]}, UnknownNameError, "upper"),
    ],
)
def test_mistakes_in_allowed_contacts(contact, error, message):
    marionette = ARM
    if message == "upper":  # of the arm, only the hand may touch the table
        rules = {"meets": [], "pairs": [{"between": ["hand", "table"], "friction": 0.4}]}
        puppet = ARM.puppet.model_copy(update={"contact": fan.model.Contact(**rules)})
        marionette = fan.Marionette(puppet)
    with pytest.raises(error, match=message):
        Problem(marionette, START, {"elbow": 0.2}, contact=contact)


def test_a_puppet_without_contact_touches_nothing():
    without_contact = fan.Marionette(ARM.puppet.model_copy(update={"contact": None}))
    with pytest.raises(StateError, match="says nothing of contact"):
        Problem(
            without_contact,
            without_contact.rest(START),
            fan.control.Goal.touch(without_contact, [("hand", "table")]),
        )
    with pytest.raises(StateError, match="never touch"):
        TouchRules(ARM, {"touch": [("table", "table")]})
    with pytest.raises(StateError, match="a function cannot ask for touches"):
        goal = fan.control.Goal.of(ARM, lambda x: x.q_D[..., 0]).touching([("hand", "table")])
        Problem(ARM, START, goal)
