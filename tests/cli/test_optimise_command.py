"""fantoccini optimise: its output, its files, and its refusals."""

from __future__ import annotations

import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.app.cli_support.terminal import ProgressDisplay

pytestmark = pytest.mark.medium

CIRCLE = """\
task: ring
puppet: arm2d
start: {hand.length: 0.8}
duration: 1.5
tracks:
  - point: lower
    at: [0.3, 0, 0]
    circle: {by: [0, 0, 0.02], normal: [0, 1, 0]}
    weight: 1.0e+4
bounds: {speed: 1.0}
interval: 0.05
step: 0.025
"""
TOO_FAR = """\
task: leap
puppet: crane
start: {trolley: 0}
end: {trolley: 1}
duration: 0.5
bounds: {acceleration: 1}
interval: 0.1
step: 0.025
"""


@pytest.fixture
def task(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ring.yaml").write_text(CIRCLE)
    return "ring.yaml"


def test_touches_are_reported_with_their_times(task, tmp_path) -> None:
    """The saved motion of the command is a path of another task."""
    touch = "touches: [{point: lower, at: [0.3, 0, 0], by: [0.03, 0, 0.03]}]\n"
    head = "task: dab\npuppet: arm2d\nduration: 0.8\ninterval: 0.05\n"
    weights = 'tracks: [{velocity: "*", value: 0, weight: 0.01}]\nsmooth: {acceleration: 0.01}\n'
    (tmp_path / "dab.yaml").write_text(head + weights + touch)
    result = fantoccini("optimise", "dab.yaml", "--out", "dab.npz")
    assert result.exit_code == 0, result.stderr
    assert "Touches" in result.stdout and "distance [m]" in result.stdout
    clip = "tracks: [{point: lower, at: [0.3, 0, 0], weight: 1.0e+4, run: {file: dab.npz}}]\n"
    (tmp_path / "again.yaml").write_text(head.replace("dab", "again") + clip)
    result = fantoccini("optimise", "again.yaml", "--out", "again.npz")
    assert result.exit_code == 0, result.stderr
    runs = [
        fan.Trajectory.load(name).resample(np.linspace(0, 0.8, 9))
        for name in ("dab.npz", "again.npz")
    ]
    assert runs[1].q_D == pytest.approx(runs[0].q_D, abs=0.01)
    assert np.ptp(runs[0].q_D[:, 1]) > 0.05


def test_a_task_is_solved_drawn_and_written(task, tmp_path) -> None:
    result = fantoccini(
        "optimise",
        task,
        "--picture",
        "ring.png",
        "--save",
        "best.npz",
        "--out",
        "run.npz",
        "--tolerance",
        "1e-4",
        "--cost-tolerance",
        "1e-9",
    )
    assert result.exit_code == 0, result.stderr
    for part in ("solved", "lower", "root mean square", "hand"):
        assert part in result.stdout
    run, inputs = fan.Trajectory.load("run.npz"), fan.theatre.Recording.load("best.npz").inputs
    # The recording contains the same inputs, and simulate repeats the motion.
    again = fan.simulate(fan.puppets.arm2d(), run.state(0), inputs, 1.5)
    assert again.q_D[-1] == pytest.approx(run.q_D[-1], abs=1e-9)
    repeated = fantoccini(
        "simulate", "arm2d", "--inputs", "best.npz", "--out", "again.npz", "--quiet"
    )
    assert repeated.exit_code == 0, repeated.stderr
    end = fan.Trajectory.load("again.npz")
    assert end.t[-1] == pytest.approx(1.5) and end.q_D[-1] == pytest.approx(run.q_D[-1], abs=1e-9)

    from matplotlib.image import imread

    pixels = imread("ring.png")[..., :3]
    assert pixels.shape[:2] == (1800, 3000)
    left = pixels[:, :1380]
    for name, colour in (("the motion", "#2b6cb0"), ("the path", "#d1495b")):
        wanted = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        near = np.abs(left - wanted).max(axis=-1) < 0.02
        assert near.sum() > 30, name
        rows, columns = np.nonzero(near)
        assert np.ptp(rows) > 30 and np.ptp(columns) > 30, name


def test_tasks_are_listed_and_the_schema_printed() -> None:
    assert fantoccini("optimise").stdout.split() == ["circle", "crane", "swing_up"]
    schema = fantoccini("schema", "task")
    assert schema.exit_code == 0 and '"tracks"' in schema.stdout


def test_a_file_is_only_checked(task) -> None:
    result = fantoccini("optimise", task, "--check")
    assert (result.exit_code, result.stdout) == (0, "ring.yaml: no mistakes\n")
    assert "optimising" not in result.stderr


def test_a_check_refuses_what_the_search_would_refuse() -> None:
    assert "the task has no duration" in mistake("optimise", "arm3d_boxes", "--check")
    assert "bundled task or problem" in mistake("optimise", "arm3d_boxse", "--check")


def test_a_motion_beyond_its_bounds_is_exit_code_one(tmp_path) -> None:
    (tmp_path / "leap.yaml").write_text(TOO_FAR)
    result = fantoccini(
        "optimise", tmp_path / "leap.yaml", "--iterations", "3", "--out", tmp_path / "run.csv"
    )
    assert result.exit_code == 1
    assert "violated" in result.stdout and "does not reach its end" in result.stderr
    assert (tmp_path / "run.csv").stat().st_size > 0, "the best motion is still written"


def test_ctrl_c_keeps_the_best_motion(task, monkeypatch) -> None:
    begin = ProgressDisplay.bar

    def interrupted(self, text):
        done = begin(self, text)

        def update(at):
            done(at)
            if text == "optimising" and at.done >= 2.0:
                raise KeyboardInterrupt

        return update

    monkeypatch.setattr(ProgressDisplay, "bar", interrupted)
    result = fantoccini("optimise", task, "--save", "best.npz")
    assert result.exit_code == 130
    assert "stopped" in result.stdout
    assert len(fan.theatre.Recording.load("best.npz")) == 30


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("cran",), "the name of a bundled task or problem; did you mean 'crane'?"),
        (
            ("ball",),
            "the names are arm3d_boxes, circle, crane, marionette_bell, marionette_stand, swing_up",
        ),
        (("ring.yaml", "--tolerance", "0"), "not a positive number"),
        (("ring.yaml", "--iterations", "0"), "iterations"),
        (("ring.yaml", "--time-limit", "-1"), "not a positive number"),
        (("ring.yaml", "--threads", "0"), "threads"),
        (("ring.yaml", "--save", "best.csv"), "allowed: .npz"),
        (("ring.yaml", "--picture", "best.gif"), "allowed: .png"),
        (("ring.yaml", "--out", "nowhere/run.npz"), "no folder nowhere"),
        (("ring.yaml", "--fps", "10"), "applies to a film"),
        (("ring.yaml", "--check", "--save", "best.npz"), "writes nothing"),
    ],
)
def test_wrong_arguments(task, tmp_path, arguments, message) -> None:
    assert message in " ".join(mistake("optimise", *arguments).split())
    assert [p.name for p in tmp_path.iterdir()] == ["ring.yaml"]


def test_mistakes_in_files_are_listed(task, tmp_path) -> None:
    (tmp_path / "ring.yaml").write_text(CIRCLE.replace("lower", "lowr").replace("speed", "sped"))
    assert mistake("optimise", task).splitlines() == [
        "ring.yaml:10: bounds.sped: this key is not known; did you mean 'speed'?"
    ]
    (tmp_path / "ring.yaml").write_text(CIRCLE.replace("lower", "lowr"))
    assert "ring.yaml:6: tracks[0].point: " in mistake("optimise", task, "--check").splitlines()[-1]
