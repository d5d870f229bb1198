"""fantoccini plan: its output, its files, and its refusals."""

from __future__ import annotations

import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan


def test_a_bundled_problem_is_planned_verified_and_written(tmp_path) -> None:
    paths = {name: tmp_path / name for name in ("run.npz", "run.png", "tree.png", "plan.npz")}
    result = fantoccini(
        "plan",
        "arm3d_boxes",
        "--seed",
        "1",
        "--confirm",
        "--out",
        paths["run.npz"],
        "--out",
        paths["run.png"],
        "--picture",
        paths["tree.png"],
        "--save",
        paths["plan.npz"],
    )
    assert result.exit_code == 0, result.stderr
    assert "exact" in result.stdout and "event-driven" in result.stdout
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(paths)
    run = fan.Trajectory.load(paths["run.npz"])
    plan = fan.control.PlanResult.load(paths["plan.npz"], fan.control.load_problem("arm3d_boxes"))
    assert plan and plan.replay()
    assert np.array_equal(run.q_D, plan.trajectory.q_D)
    for picture in (paths["run.png"], paths["tree.png"]):
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_problems_are_listed_and_the_schema_printed() -> None:
    listed = ["arm3d_boxes", "marionette_bell", "marionette_stand"]
    assert fantoccini("plan").stdout.split() == listed
    schema = fantoccini("schema", "problem")
    assert schema.exit_code == 0 and '"tolerance"' in schema.stdout


def test_no_plan_is_exit_code_one() -> None:
    result = fantoccini(
        "plan",
        "arm3d_boxes",
        "--planner",
        "est-2007",
        "--time-limit",
        "0.05",
        "--tolerance",
        "0.01",
    )
    assert result.exit_code == 1
    assert "out_of_time" in result.stdout and "nearest" in result.stderr
    assert "Verification" not in result.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("arm3d_boxse",), "or the name of a bundled problem or task"),
        (("arm3d_boxes", "--planner", "rrt"), "rrt"),
        (("arm3d_boxes", "--objective", "speed"), "speed"),
        (("arm3d_boxes", "--seed", "-1"), "negative"),
        (("arm3d_boxes", "--tolerance", "0"), "not a positive number"),
        (("arm3d_boxes", "--save", "plan.txt"), "allowed: .npz"),
        (("arm3d_boxes", "--picture", "plan.jpg"), "allowed: .png"),
        (("arm3d_boxes", "--out", "nowhere/run.npz"), "no folder nowhere"),
        (("arm3d_boxes", "--threads", "0"), "threads"),
    ],
)
def test_mistakes(arguments, message) -> None:
    assert message in " ".join(mistake("plan", *arguments).split())


def test_a_start_in_collision_is_reported(tmp_path) -> None:
    path = tmp_path / "inside.yaml"
    path.write_text(
        "problem: inside\npuppet: arm3d\ngoal: {pose: {elbow: 1}}\n"
        "obstacles: [{name: stone, type: sphere, radius: 0.2, at: [0, 0, -0.3]}]\n"
    )
    result = fantoccini("plan", path)
    assert result.exit_code == 1 and "inside stone" in result.stderr
