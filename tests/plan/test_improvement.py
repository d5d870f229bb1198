"""Plans become shorter, end closer to the goal, and searches are continued."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plan.seeds import first_plan, is_polished, polish_plan

import fantoccini as fan
from fantoccini.control.planning import EST2007, PolishStatus, Search, SearchOptions, solve
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import OBJECTIVES, Objective, RolloutOptions

pytestmark = pytest.mark.medium

ARM = fan.puppets.arm3d()
START = ARM.rest({"hand.x": 0.3, "hand.length": 1.32, "shoulder.rotation": [0, 0, 0], "elbow": 0.1})
RAISED = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
BOX = {"name": "low", "type": "box", "size": [0.14, 0.4, 0.12], "at": [0.25, 0.0, -0.42]}


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem(
        ARM,
        START,
        RAISED,
        [BOX],
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005),
        slack=False,
    )


def test_plans_become_shorter(problem):
    search = Search(problem, SearchOptions(seed=3))
    search.find_first(60.0)
    first = float(search.tree.time[search.best])
    search.find_better(60.0, iterations=4000)
    times = [t for _, _, t in search.curve]
    assert times[0] == first and np.all(np.diff(times) < 0) and len(times) > 1
    result = fan.control.PlanResult.from_search(search)
    assert result and result.duration == times[-1] and result.replay()
    seconds = [s for s, _, _ in result.curve]
    assert np.all(np.diff(seconds) >= 0.0) and seconds[-1] <= result.seconds


def test_what_a_plan_costs(problem):
    """The cost of a node is summed along its path in the tree."""
    search = Search(problem, SearchOptions(seed=3, objective="acceleration"))
    search.find_first(60.0)
    tree, interval = search.tree, problem.rollouts.options.interval
    for node in range(0, len(tree), 97):
        path = tree.path(node)[1:]
        durations = interval * tree.n_checks[path]
        effort = np.sum(durations * np.sum(tree.acceleration[path] ** 2, axis=1))
        assert tree.time[node] == pytest.approx(durations.sum())
        assert tree.cost[node] == pytest.approx(durations.sum() + effort)
    gentle_search = Search(problem, SearchOptions(seed=3))
    gentle_search.find_first(60.0)
    assert gentle_search.objective == OBJECTIVES["gentle"] and len(gentle_search.tree) == len(tree)
    for node in range(0, len(tree), 97):
        catches = gentle_search.tree.catches[tree.path(node)].sum()
        assert gentle_search.tree.cost[node] == pytest.approx(
            gentle_search.tree.time[node] + 3.0 * catches
        )


def test_better_plans_cost_less(problem):
    catches, efforts = {}, {}
    for objective in ("gentle", "time", "acceleration"):
        catches[objective], efforts[objective] = [], []
        for seed in (1, 2, 3):
            search = Search(problem, SearchOptions(seed=seed, objective=objective))
            search.find_first(60.0)
            first = float(search.tree.cost[search.best])
            search.find_better(60.0, iterations=3000)
            tree, best = search.tree, search.best
            assert tree.cost[best] < first
            catches[objective].append(tree.catches[tree.path(best)].sum())
            efforts[objective].append(_effort(tree, best))
    assert np.sum(catches["gentle"]) <= np.sum(catches["time"])
    assert np.mean(efforts["acceleration"]) < np.mean(efforts["time"])
    with pytest.raises(ValueError, match="one of gentle, time, acceleration"):
        Search(problem, SearchOptions(objective="speed"))


def test_a_user_defined_objective(problem, tmp_path):
    """Catches and accelerations count with their weights, in saved plans too."""
    objective = Objective(catch=0.5, acceleration=0.25)
    result = solve(problem, seed=3, objective=objective).grow(60.0, iterations=1000)
    path = list(result.path[1:])
    effort = problem.rollouts.options.interval * _effort(result.tree, result.path[-1])
    catches = result.tree.catches[path].sum()
    assert result.cost == pytest.approx(result.duration + 0.5 * catches + 0.25 * effort)
    result.save(tmp_path / "plan.npz")
    loaded = fan.control.PlanResult.load(tmp_path / "plan.npz", problem)
    assert loaded.search.objective == objective and loaded.cost == result.cost
    for wrong in (-1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="acceleration"):
            Objective(acceleration=wrong)


def _effort(tree, node) -> float:
    path = tree.path(node)[1:]
    return float(np.sum(tree.n_checks[path] * np.sum(tree.acceleration[path] ** 2, axis=1)))


def test_saving_effort_does_not_shorten_the_plan(problem):
    result = solve(problem, seed=3, objective="acceleration")
    assert result.polish(1e-3, seconds=5.0).duration >= result.duration - 1e-9
    shorter = []
    for seed in range(3):
        search = Search(problem, SearchOptions(seed=seed))
        search.find_first(60.0)
        search.find_better(60.0, iterations=3000)
        result = fan.control.PlanResult.from_search(search)
        shorter.append(result.polish(1e-3, seconds=20.0).duration / result.duration)
    assert min(shorter) < 0.9


def test_a_search_continues_from_a_polished_plan(problem):
    """Its next plan does not cost more than the polished one."""
    search = first_plan(problem, is_polished, lambda plan: plan.polish(1e-3, 10.0)).search
    cost = float(search.tree.cost[search.best])
    search.find_better(60.0, iterations=2000)
    assert float(search.tree.cost[search.best]) <= cost
    assert search.curve[-1][2] == float(search.tree.time[search.best])


def test_ctrl_c_keeps_the_polished_plan(problem, monkeypatch):
    from fantoccini.control.planning import polish

    approach, calls = polish.approach, []

    def approach_then_stop(*arguments):
        calls.append(result := approach(*arguments))
        if sum(call.arrives for call in calls[:-1]):
            raise KeyboardInterrupt
        return result

    monkeypatch.setattr(polish, "approach", approach_then_stop)
    polished_plan = first_plan(problem, is_polished, lambda plan: plan.polish(1e-3, seconds=20.0))
    assert polished_plan.distance <= 1e-3 and polished_plan.replay()


def test_puppets_without_constraints_are_polished():
    """A puppet without limits and obstacles whose string may go slack; and a one-segment plan."""
    arm = fan.puppets.arm2d()
    start = arm.rest({"hand.x": 0.3, "hand.length": 1.2})
    result = first_plan(
        Problem(arm, start, {"elbow": start.q_D[1] + 0.3}), is_polished, polish_plan
    )
    assert result.distance <= 1e-3
    close_goal = fan.control.Goal.pose(ARM, {"elbow": float(START.q_D[4]) + 0.03}, speed_weight=0.0)
    other_problem = Problem(ARM, START, close_goal, tolerance=0.025)
    result = first_plan(other_problem, is_polished, lambda plan: plan.polish(1e-4, seconds=0.0))
    assert result.distance <= 1e-4


def test_seconds_make_sense(problem):
    result = solve(problem, seed=0)
    for seconds in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="seconds is"):
            result.grow(seconds)
        with pytest.raises(ValueError, match="seconds is"):
            result.polish(seconds=seconds)


def test_iterations_determine_the_result(problem):
    """The result is the same for any number of threads, if no time limit ends the search."""
    searches = []
    for threads in (1, 2):
        other_problem = Problem(
            ARM,
            START,
            RAISED,
            [BOX],
            tolerance=0.25,
            bounds=fan.control.Bounds(clearance=0.005),
            rollouts=RolloutOptions(threads=threads),
            slack=False,
        )
        search = Search(other_problem, SearchOptions(seed=5))
        search.find_first(60.0)
        search.find_better(60.0, iterations=1500)
        searches.append(search)
    a, b = (fan.control.PlanResult.from_search(s) for s in searches)
    assert a.path == b.path and np.array_equal(a.tree.q_D, b.tree.q_D)


def test_a_polished_plan_ends_at_the_goal(problem):
    result = first_plan(problem, is_polished, polish_plan)
    assert result.distance <= 1e-3 and result.polished.status is PolishStatus.POLISHED
    assert result.replay() and result.clearance.min() > 0.0
    assert result.trajectory.tension["hand"].min() >= 0.0
    _, v_K, acc_K = result.inputs.evaluate(np.linspace(0, result.duration, 2001))
    assert np.max(np.abs(v_K)) <= 0.5 * (1 + 1e-9) and np.max(np.abs(acc_K)) <= 2.0 * (1 + 1e-9)
    assert result.verify(method=fan.Event(rtol=1e-10, atol=1e-10)).arrives
    assert result.polish(1e-3, seconds=0.0).distance <= 1e-3, "it may be polished again"


def test_inputs_end_at_rest_on_request():
    goal = fan.control.Goal.pose(ARM, RAISED, driven_weight=0.5)
    other_problem = Problem(
        ARM,
        START,
        goal,
        [BOX],
        tolerance=0.25,
        bounds=fan.control.Bounds(clearance=0.005),
        slack=False,
    )
    assert other_problem.rests_at_goal
    result = first_plan(other_problem, is_polished, polish_plan)
    assert result.distance <= 1e-3
    assert np.linalg.norm(result.trajectory.v_K[-1]) <= 2e-3
    end = result.trajectory.state(-1)
    at_rest = ARM.rest(end.replace(v_D=np.zeros(4), v_K=np.zeros(3)))
    assert abs(at_rest.q_D[4] - RAISED["elbow"]) < 0.1, "it hangs at rest near its final pose"


def test_a_plan_is_improved_and_polished_at_once(problem):
    """The time may run out before the polish ends, on a slow machine; the plan then reports it."""
    result = solve(problem, seed=0, improve=2.0)
    assert result and result.replay() and result.polished is not None
    if result.polished.reached:
        assert result.distance <= 1e-3
    else:
        assert 1e-3 < result.distance <= problem.tolerance
        assert str(result.polished) in result.message


def test_a_plan_found_at_the_time_limit_says_that_it_is_not_polished(problem, monkeypatch):
    search = Search(problem, SearchOptions(seed=3))
    search.find_first(60.0)

    def find_better(seconds):
        search.polished = None

    monkeypatch.setattr(search, "find_better", find_better)
    monkeypatch.setattr(search, "polish", lambda *_: False)
    search.improve(0.01, 1e-3)
    assert search.polished.status is PolishStatus.TIMEOUT and search.polished.required == 1e-3


def test_a_search_is_continued(problem):
    first_result = solve(problem, seed=2, iterations=1)
    if not first_result:
        first_result = first_result.grow(seconds=60.0)
    assert first_result
    first_duration = first_result.duration
    assert first_result.grow(seconds=60.0, iterations=3000).duration < first_duration


def test_the_papers_planner_grows_too():
    other_problem = Problem(ARM, START, RAISED, tolerance=0.25)
    first_result = solve(other_problem, planner=EST2007(), iterations=50)
    assert (
        first_result.tried >= 50
        and first_result.grow(60.0, iterations=50).tried >= first_result.tried + 50
    )
    single = solve(other_problem, planner=EST2007(batch=1), iterations=50)
    assert single.tried == 50, "one node at a time, as in the paper"


def test_plans_that_cannot_be_polished_are_reported(problem):
    with pytest.raises(ValueError, match="no plan to polish"):
        solve(problem, seed=0, planner=EST2007(), iterations=1).polish()
    function_goal = Problem(ARM, START, lambda rows: np.maximum(0.3 - rows.q_K[..., 1], 0.0))
    with pytest.raises(ValueError, match="is a function"):
        solve(function_goal, seed=0).polish()
    for invalid_tolerance in (0.0, np.nan):
        with pytest.raises(ValueError, match="greater than 0"):
            solve(problem, seed=0).polish(invalid_tolerance)
    polished_plan = solve(problem, seed=0).polish(1.0, seconds=0.0)
    assert polished_plan and polished_plan.distance <= 0.25, "a plan is never made worse"
    with pytest.raises(ValueError, match="improve is -1"):
        solve(problem, improve=-1.0)


def test_search_options_are_one_object_or_keywords(problem):
    with pytest.raises(ValueError, match="either options or seed, not both"):
        solve(problem, SearchOptions(), seed=1)
    with pytest.raises(ValueError, match="planner is 'rrt'"):
        SearchOptions(planner="rrt")
    by_object, by_keyword = solve(problem, SearchOptions(seed=5)), solve(problem, seed=5)
    assert by_object.path == by_keyword.path and len(by_object.tree) == len(by_keyword.tree)
