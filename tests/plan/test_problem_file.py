"""Problem files: bundled ones, their schema, and mistakes with their places."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError
from fantoccini.control import tasks
from fantoccini.control.tasks import problem_names, problem_schema

PROBLEM_YAML = """\
problem: lift
puppet: arm3d
start: {hand.x: 0.3, hand.length: 1.3}
goal:
  pose: {elbow: 60 deg}
  weights: {elbow: 2}
tolerance: 0.1
ranges: {hand.x: [-1, 1]}
obstacles:
  - {name: stone, type: sphere, radius: 0.05, at: [0.4, 0, -0.5]}
"""


def write_problem(tmp_path, text: str):
    path = tmp_path / "problem.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_bundled_problems_have_their_stated_content():
    assert set(problem_names()) >= {"arm3d_boxes", "marionette_bell", "marionette_stand"}
    arm = fan.control.load_problem("arm3d_boxes")
    assert arm.name == "arm3d_boxes" and not arm.reason and arm.tolerance == 0.25
    assert np.array_equal(arm.rollouts.bounds.speed, [0.5] * 3)
    assert [o.name for o in arm.rollouts.clearance.obstacles] == ["low", "high"]
    assert fan.control.load_problem("arm3d_boxes", tolerance=0.1).tolerance == 0.1


def test_a_file_equals_a_gesture_in_python(tmp_path):
    file_problem = fan.control.load_problem(write_problem(tmp_path, PROBLEM_YAML))
    arm = fan.puppets.arm3d()
    problem = fan.control.Problem(
        arm,
        arm.rest({"hand.x": 0.3, "hand.length": 1.3}),
        fan.control.Goal.pose(arm, {"elbow": np.radians(60)}, weights={"elbow": 2.0}),
        [{"name": "stone", "type": "sphere", "radius": 0.05, "at": [0.4, 0, -0.5]}],
        bounds=fan.control.Bounds(position={"hand.x": (-1.0, 1.0)}),
    )
    a, b = fan.control.solve(file_problem, seed=3), fan.control.solve(problem, seed=3)
    assert a and a.path == b.path and np.array_equal(a.tree.q_D, b.tree.q_D)


def test_a_file_chooses_segments_and_an_objective(tmp_path):
    """Accelerations hold for a whole number of segments, and count in the cost of plans."""
    text = PROBLEM_YAML + "segment: 0.06\nobjective: acceleration\n"
    problem = fan.control.load_problem(write_problem(tmp_path, text))
    assert problem.rollouts.options.n_checks == 3 and problem.objective.acceleration > 0.0
    plan = fan.control.solve(problem, seed=3)
    assert plan and plan.replay()
    n_checks = plan.tree.n_checks[list(plan.path[1:])]
    assert np.all(n_checks[:-1] == 3) and 1 <= n_checks[-1] <= 3
    assert plan.search.objective == problem.objective
    assert fan.control.solve(problem, seed=3, objective="time").search.objective.acceleration == 0.0
    slow = fan.control.solve(problem, seed=3, planner="est-2007", iterations=400)
    assert set(slow.tree.n_checks[1:]) <= set(range(1, 16)) and np.max(slow.tree.n_checks) > 3
    other = fan.control.load_problem(write_problem(tmp_path, PROBLEM_YAML + "segment: 0.2\n"))
    assert fan.control.solve(other, seed=3) and other.fingerprint != problem.fingerprint


def test_a_reserve_remains_for_feedback(tmp_path):
    problem = fan.control.load_problem(write_problem(tmp_path, PROBLEM_YAML + "reserve: 0.25\n"))
    assert np.array_equal(problem.bounds.speed, [0.5] * 3)
    assert np.array_equal(problem.bounds.acceleration, [2.0] * 3)
    assert np.array_equal(problem.rollouts.bounds.low, problem.bounds.low)
    plan = fan.control.solve(problem, seed=3, improve=0.2)
    assert plan
    assert np.abs(plan.acceleration).max() <= 0.75 * 2.0 + 1e-12
    assert np.abs(plan.trajectory.v_K).max() <= 0.75 * 0.5 + 1e-12
    # Feedback has other bounds than the plan, unless the plan has all.
    text = PROBLEM_YAML + "speed: 0.375\nacceleration: 1.5\n"
    assert (
        problem.fingerprint != fan.control.load_problem(write_problem(tmp_path, text)).fingerprint
    )
    # Far from the plan, feedback uses its full bounds.
    law, x = plan.feedback(), problem.start
    accelerations = [
        law.acceleration(0, x.replace(q_D=[*x.q_D[:-1], x.q_D[-1] + offset]))
        for offset in (-2.0, 2.0)
    ]
    largest = np.abs(accelerations).max()
    assert 0.75 * 2.0 + 1e-3 < largest <= 2.0


@pytest.mark.parametrize("reserve", ["-0.1", "1", "1.5"])
def test_a_reserve_is_part_of_the_bounds(tmp_path, reserve):
    path = write_problem(tmp_path, f"{PROBLEM_YAML}reserve: {reserve}\n")
    with pytest.raises(FileError, match=rf"problem.yaml:11:.*reserve is {float(reserve)!r}"):
        fan.control.load_problem(path)


@pytest.mark.parametrize("segment", ["0.05", "0.01", "-0.1", ".inf", "soon", "1e6", "1e300"])
def test_a_wrong_segment_is_reported_with_its_line(tmp_path, segment):
    with pytest.raises(FileError, match=r"problem\.yaml:11: segment"):
        fan.control.load_problem(write_problem(tmp_path, PROBLEM_YAML + f"segment: {segment}\n"))


def test_a_puppet_may_be_in_the_folder_of_its_problem(tmp_path):
    text = fan.puppets.path("arm3d").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(text)
    problem = fan.control.load_problem(
        write_problem(tmp_path, PROBLEM_YAML.replace("arm3d", "mine.yaml"))
    )
    file, line = problem.marionette.puppet.locate("lower")
    assert file.endswith("mine.yaml") and line is not None


def test_the_schema_accepts_bundled_problems_and_refuses_others(tmp_path):
    schema = problem_schema()
    for name in problem_names():
        path = Path(tasks.__file__).parent / "bundled_problems" / f"{name}.yaml"
        jsonschema.validate(json.loads(json.dumps(read_file(path).data)), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"problem": "x", "puppet": "arm3d"}, schema)


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("elbow: 60 deg}", "elbo: 60 deg}"), 5, "did you mean 'elbow'"),
        (("hand.x: 0.3", "hand.z: 0.3"), 3, "hand.z"),
        (("ranges: {hand.x: [-1, 1]}", "ranges: {hand.x: [1, -1]}"), 8, "must not be empty"),
        (("ranges: {hand.x: [-1, 1]}", "speed: {hand.y: -1}"), 8, "hand.y is -1"),
        (("radius: 0.05", "radius: 0"), 10, "radius"),
        (("puppet: arm3d", "puppet: arm3"), 2, "did you mean 'arm3d'"),
        (("puppet: arm3d", "puppet: ../../etc/passwd"), 2, "no file in this one's folder"),
        (("puppet: arm3d", "puppet: " + "x" * 5000), 2, "no file in this one's folder"),
        (("pose: {elbow: 60 deg}", "pose: {}"), 6, "names no coordinate"),
        (("tolerance: 0.1", "tolerance: 0"), 7, "positive"),
        (("tolerance: 0.1", "tolerence: 0.1"), 7, "did you mean 'tolerance'"),
        (("tolerance: 0.1", "tolerance: 1e300"), 7, "a size of at most 1e.06"),
        (("hand.x: 0.3", "hand.x: 1e300"), 3, "a size of at most 1e.06"),
        (("ranges: {hand.x: [-1, 1]}", "speed: 1e300"), 8, "at most 1e.06"),
        (("ranges: {hand.x: [-1, 1]}", "ranges: {hand.x: [-1, 1e300]}"), 8, "at most 1e.06"),
        (("elbow: 60 deg}", "elbow: 1e300}"), 5, "a size of at most 1e.06"),
        (("  pose: {elbow: 60 deg}\n  weights: {elbow: 2}", "  speed_weight: 1"), 4, "neither"),
        (("weights: {elbow: 2}", "weights: {elbo: 2}"), 6, "did you mean 'elbow'"),
        (
            (
                "  pose: {elbow: 60 deg}\n  weights: {elbow: 2}",
                "  point: {body: hand, place: [0, 0, 0]}",
            ),
            5,
            "no body is called 'hand'",
        ),
    ],
)
def test_mistakes_have_places(tmp_path, change, line, message):
    assert change[0] in PROBLEM_YAML
    path = write_problem(tmp_path, PROBLEM_YAML.replace(*change))
    with pytest.raises(FileError, match=message) as caught:
        fan.control.load_problem(path)
    assert f"problem.yaml:{line}" in str(caught.value)


def test_several_mistakes_are_reported_at_once(tmp_path):
    text = PROBLEM_YAML.replace("hand.x: 0.3", "hand.z: 0.3").replace("elbow: 60", "elbo: 60")
    with pytest.raises(FileError) as caught:
        fan.control.load_problem(write_problem(tmp_path, text))
    assert len(caught.value.mistakes) >= 2


def test_an_unknown_problem_is_named():
    with pytest.raises(FileError, match="found nothing here"):
        fan.control.load_problem("arm3d_boxse")
