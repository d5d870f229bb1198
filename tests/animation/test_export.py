"""Exports from Python and from the command line, and refused exports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.animation.glb_reader import Player
from tests.animation.test_glb import TOLERANCE, errors
from tests.cli.command import fantoccini, mistake
from tests.plays.tiny import write_play

import fantoccini as fan
from fantoccini.theatre.perform import Performance

pytestmark = [pytest.mark.medium, pytest.mark.long]


def test_an_unknown_ending_lists_the_known_ones(thrown: fan.Trajectory, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"ends in '\.fbx'; an animation ends in \.glb, \.usda"):
        fan.export(thrown, tmp_path / "run.fbx")
    with pytest.raises(ValueError, match="has no ending"):
        fan.export(thrown, tmp_path / "run")


def test_an_unknown_body_gets_the_nearest_name(thrown: fan.Trajectory, tmp_path: Path) -> None:
    with pytest.raises(
        fan.errors.UnknownNameError, match="no body is called 'bop'; did you mean 'bob'"
    ):
        fan.export(thrown, tmp_path / "run.glb", bodies=["bop"])
    assert list(tmp_path.iterdir()) == []


def test_a_mirrored_twin_is_a_body(greeting: fan.Trajectory, tmp_path: Path) -> None:
    with pytest.raises(fan.errors.UnknownNameError, match="did you mean 'shin_right'"):
        fan.export(greeting, tmp_path / "run.bvh", bodies=["shin_rigt"])


@pytest.mark.parametrize("fps", [0.0, -1.0, np.nan, np.inf, 1e4])
def test_an_impossible_rate_is_refused(thrown: fan.Trajectory, tmp_path: Path, fps: float) -> None:
    with pytest.raises(ValueError, match="fps is"):
        fan.export(thrown, tmp_path / "run.glb", fps=fps)


def test_an_object_without_motion_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="found Marionette; expected a run"):
        fan.export(fan.puppets.arm2d(), tmp_path / "run.glb")


def test_a_missing_folder_is_named(thrown: fan.Trajectory, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        fan.export(thrown, tmp_path / "none" / "run.glb")


def test_a_run_of_another_puppet_is_refused(thrown: fan.Trajectory, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="the run is of another puppet than arm2d"):
        fan.export(thrown, tmp_path / "run.glb", marionette=fan.puppets.arm2d())


def test_a_single_sample_is_a_picture(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    run = fan.simulate(arm, arm.rest(), t_end=0.5).resample(np.array([0.2]))
    player = Player(fan.export(run, tmp_path / "run.glb"))
    assert not player.gltf.animations
    assert {"upper", "lower"} <= set(player.names)


def test_a_recording_is_exported_as_its_run(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    performance = Performance(arm)
    performance.record()
    performance.advance(0.4)
    recording = performance.stop()
    files = [
        fan.export(what, tmp_path / f"{k}.glb")
        for k, what in enumerate((recording, recording.trajectory))
    ]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_plan_is_exported_among_its_obstacles(tmp_path: Path) -> None:
    problem = fan.control.load_problem("arm3d_boxes")
    plan = fan.control.solve(problem, time_limit=20.0, confirm=False)
    path = fan.export(plan, tmp_path / "plan.glb")
    run, player = plan.trajectory, Player(path)
    assert max(errors(path, run).values()) < TOLERANCE
    boxes = [name for name in player.names if name.startswith("world_shape")]
    assert len(boxes) >= len(problem.rollouts.clearance.obstacles) > 0


def test_a_play_is_exported_from_python_and_from_the_command_line(tmp_path: Path) -> None:
    play = write_play(tmp_path)
    verified = fan.theatre.verify_play(fan.load_play(play))
    path = fan.export(verified, tmp_path / "python.glb")
    player = Player(path)
    assert {"one.ball", "two.ball", "one.hold", "two.hold"} <= set(player.names)
    assert max(errors(path, verified.run).values()) < TOLERANCE
    assert fantoccini("play", play, "--out", tmp_path / "command.glb").exit_code == 0
    assert (tmp_path / "command.glb").read_bytes() == path.read_bytes()


def test_simulate_writes_animations(tmp_path: Path) -> None:
    out = [tmp_path / "run.glb", tmp_path / "run.npz"]
    done = fantoccini(
        "simulate",
        "arm2d",
        "--duration",
        "1",
        "--out",
        out[0],
        "--out",
        out[1],
        "--bodies",
        "lower",
    )
    assert done.exit_code == 0, done.stderr
    player = Player(out[0])
    assert "lower" in player.names
    assert "upper" not in player.names

    again = tmp_path / "again.glb"
    done = fantoccini("export", out[1], again, "--bodies", "lower")
    assert done.exit_code == 0, done.stderr
    assert again.read_bytes() == out[0].read_bytes()


def test_export_writes_the_other_formats_of_a_run(tmp_path: Path) -> None:
    run, table = tmp_path / "run.npz", tmp_path / "run.csv"
    arm = fan.puppets.arm2d()
    fan.simulate(arm, arm.rest(), t_end=0.2).save(run)
    assert fantoccini("export", run, table).exit_code == 0
    assert table.read_text().startswith("t,")


def test_a_run_that_stopped_early_is_reported(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    pull = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (2.0, 0.05)]})
    run = fan.simulate(arm, arm.rest({"hand.length": 0.8}), pull, 2.0, throw=False)
    run.save(tmp_path / "run.npz")
    done = fantoccini("export", tmp_path / "run.npz", tmp_path / "run.glb")
    assert done.exit_code == 0
    assert f"ended at t = {run.t[-1]:g} s: {run.status.message}" in done.stderr


REFUSED = {
    "an ending": (["run.fbx"], "allowed: .npz, .csv, .png, .svg, .pdf, .mp4, .gif, .glb, .usda"),
    "a body": (["run.glb", "--bodies", "loer"], "did you mean 'lower'?"),
    "no body": (["run.glb", "--bodies", "lower,,"], "is not NAME,NAME,..."),
    "a rate": (["run.glb", "--fps", "-3"], "must be positive"),
    "bodies of numbers": (["run.npz", "--bodies", "lower"], "applies to an animation"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_mistakes_are_found_before_the_run(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fantoccini.app.cli.simulate.simulate", pytest.fail)
    arguments, wanted = REFUSED[case]
    assert wanted in " ".join(mistake("simulate", "arm2d", "--out", *arguments).split())
    assert list(tmp_path.iterdir()) == []


def test_a_puppet_takes_no_options_of_motions(tmp_path: Path) -> None:
    said = mistake("export", "arm2d", tmp_path / "c", "--fps", "24")
    assert "applies to motions (.npz)" in said
