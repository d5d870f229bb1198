"""Tasks of plans that are optimised: held coordinates, clearances and guesses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.optimal.small_crane import CRANE_TEXT

import fantoccini as fan
from fantoccini.control.optimal import check_task

pytestmark = pytest.mark.slow

SMOOTH = fan.control.Smooth(1e-2, 0.0)
PROBLEM_YAML = "problem: p\npuppet: crane.yaml\nduration: 2\ngoal: {pose: {bob.x: 0.2}}\n"
POST_YAML = """\
obstacles: [{name: post, type: box, size: [0.05, 0.05, 0.3], at: [0, 0.1, -0.4]}]
margin: 0.2
"""


def load_task(folder: Path, text: str) -> fan.Task:
    (folder / "crane.yaml").write_text(CRANE_TEXT)
    (folder / "p.yaml").write_text(PROBLEM_YAML + text)
    return fan.control.load_task(folder / "p.yaml")


@pytest.mark.parametrize(
    "bounds",
    ["speed: {line.x: 0.5}", "speed: {line.x: 0.5, line.length: 0}", "acceleration: {line.x: 2}"],
)
def test_coordinates_that_a_problem_file_does_not_name_hold_still(tmp_path, bounds):
    task = load_task(tmp_path, bounds + "\n")
    problem, table = fan.control.Problem.from_task(task), task.marionette.coordinates
    assert [
        name
        for name, is_movable in zip(table.q_K, problem.bounds.movable, strict=True)
        if is_movable
    ] == ["line.x"]
    best = fan.optimise(task, iterations=20)
    length = table.q_K.index("line.length")
    assert best.holds and np.all(best.run.q_K[:, length] == best.run.q_K[0, length])
    assert np.ptp(best.run.q_K[:, table.q_K.index("line.x")]) > 0.1


def test_the_fingerprint_of_a_problem_file_is_that_of_the_bounds_it_gives(tmp_path):
    """Plans on disk stay those of their problem: unnamed coordinates have no new bounds."""
    task = load_task(tmp_path, "speed: {line.x: 0.5}\n")
    by_hand = fan.control.Problem(
        task.marionette,
        task.x0,
        fan.control.Goal.pose(task.marionette, {"bob.x": 0.2}),
        bounds=fan.control.Bounds(speed={"line.x": 0.5}, acceleration=2.0, clearance=0.0),
    )
    by_hand.max_duration = task.max_duration
    assert fan.control.Problem.from_task(task).fingerprint == by_hand.fingerprint


def test_a_held_coordinate_of_zero_speed_is_one_of_held(small_crane):
    tasks = [
        fan.Task(
            small_crane,
            small_crane.rest(),
            1.0,
            end={"bob.x": 0.1},
            smooth=SMOOTH,
            bounds=bounds,
            interval=0.1,
        )
        for bounds in (
            fan.control.Bounds(speed={"line.length": 0.0}),
            fan.control.Bounds(held=("line.length",)),
        )
    ]
    by_speed, by_held = (fan.optimise(task, iterations=3) for task in tasks)
    assert by_speed.cost == by_held.cost
    with pytest.raises(fan.errors.StateError, match="must be greater than 0"):
        fan.control.Bounds(speed=0.0).magnitudes(small_crane, "speed")


@pytest.mark.parametrize(("text", "with_strings"), [("", True), ("strings: false\n", False)])
def test_strings_are_kept_clear_as_a_problem_file_says(tmp_path, text, with_strings):
    """The line hangs nearer to a post than the margin, the bob below it farther away."""
    violation = fan.optimise(load_task(tmp_path, POST_YAML + text), iterations=0).violation
    assert violation == pytest.approx(0.125 if with_strings else 0.0, abs=1e-6)


def test_a_guess_that_ends_early_holds_still_afterwards(small_crane):
    x0 = small_crane.rest()
    guess = fan.Input.waypoints(small_crane, {"line.x": [(0.0, 0.0), (0.5, 0.2), (1.0, 0.6)]})
    task = fan.Task(small_crane, x0, 2.0, end={"bob.x": 0.5}, smooth=SMOOTH, interval=0.1)
    nodes = fan.optimise(task, guess=guess, iterations=0).nodes
    is_late = nodes.t > 1.15
    assert np.all(np.abs(nodes.v_K[is_late]) < 1e-9)


@pytest.mark.parametrize("guess", [[0.0, 1.0], "plan", 3.0])
def test_a_guess_that_is_no_motion_is_refused(small_crane, guess):
    task = fan.Task(small_crane, small_crane.rest(), 1.0, end={"bob.x": 0.5}, smooth=SMOOTH)
    with pytest.raises(fan.errors.StateError, match="needed: an input, a plan or an optimum"):
        fan.optimise(task, guess=guess)


def test_a_plan_that_does_not_arrive_is_refused_as_a_guess(small_crane):
    task = fan.Task(small_crane, small_crane.rest(), 1.0, end={"bob.x": 5.0}, smooth=SMOOTH)
    plan = fan.plan(task, iterations=1)
    assert not plan
    with pytest.raises(fan.errors.StateError, match="a plan that does not arrive"):
        fan.optimise(task, guess=plan)


def test_a_drives_own_name_may_be_held():
    """A held coordinate with a drive may have its own name or its command's, in all searches."""
    drive = "{on: line.length, mass: 0.1, control: {type: pd, stiffness: 900, damping: 40}}"
    crane = fan.loads(CRANE_TEXT + f"drives: [{drive}]\n")
    drive_name, command_name = next(iter(crane.coordinates.commands.items()))
    poses = [
        fan.reach(crane, {"bob": (0.1, 0.0, np.nan)}, bounds=fan.control.Bounds(held=(name,)))[0]
        for name in (drive_name, command_name)
    ]
    assert poses[0].distance == poses[1].distance < 1e-5


def test_explorations_need_slack_strings(small_crane):
    conditions = fan.control.PlanConditions(slack=False)
    with pytest.raises(fan.errors.StateError, match="explore searches motions with slack strings"):
        fan.Task(small_crane, small_crane.rest(), 1.0, explore=1, conditions=conditions)


def test_a_check_refuses_tasks_that_only_plans_support(small_crane):
    task = fan.Task(small_crane, small_crane.rest(), end={"bob.x": 0.5})
    with pytest.raises(fan.errors.StateError, match="the task has no duration"):
        check_task(task)
