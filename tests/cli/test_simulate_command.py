"""fantoccini simulate and demo: their output and their files."""

from __future__ import annotations

import csv
import errno
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.app.cli_support.reporting import longest_slack
from fantoccini.base.errors import Status

pytestmark = pytest.mark.slow

LIFT = "coordinates:\n  hand.length: [[1, 0.858], [2, 0.7]]\n"


@pytest.fixture
def lift(tmp_path):
    path = tmp_path / "lift.yaml"
    path.write_text(LIFT)
    return path


def test_numbers_pictures_plots_and_film(lift, tmp_path) -> None:
    endings = (".npz", ".csv", ".png", ".svg", ".pdf", ".mp4", ".gif")
    paths = [tmp_path / f"run{ending}" for ending in endings]
    out = [word for path in paths for word in ("--out", path)]
    plot = tmp_path / "plot.png"
    result = fantoccini("simulate", "arm2d", "--inputs", lift, *out, "--plot", plot)
    assert result.exit_code == 0, result.stderr
    assert sorted(tmp_path.iterdir()) == sorted([lift, plot, *paths])
    heads = {path.suffix: path.read_bytes()[:8] for path in [*paths, plot]}
    assert heads[".png"].startswith(b"\x89PNG")
    assert heads[".pdf"].startswith(b"%PDF")
    assert heads[".gif"].startswith(b"GIF8")
    assert heads[".mp4"][4:] == b"ftyp"
    run = fan.Trajectory.load(paths[0])
    assert (run.t[0], run.t[-1], run.method) == (0.0, 2.0, "event")
    assert run.q_K[-1, -1] == pytest.approx(0.7)
    with paths[1].open() as file:
        assert len(list(csv.reader(file))) == len(run) + 1


def test_the_summary_goes_to_stdout_and_progress_to_stderr(lift) -> None:
    result = fantoccini("simulate", "arm2d", "--inputs", lift)
    assert "hand" in result.stdout and "times real time (method event" in result.stdout
    assert "simulating 2 s" in result.stderr and "simulating" not in result.stdout
    quiet = fantoccini("simulate", "arm2d", "--inputs", lift, "--quiet")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (0, "", "")


def test_a_run_without_inputs_says_that_nothing_moves_the_strings(lift) -> None:
    note = "nothing moves the driven coordinates in these 0.5 s; --inputs takes a file"
    run = ("simulate", "arm2d", "--duration", "0.5")
    assert note in fantoccini(*run).stderr
    for options in (("--inputs", lift), ("--quiet",)):
        result = fantoccini(*run, *options)
        assert result.exit_code == 0 and "nothing moves" not in result.stderr


def test_the_variational_method_takes_its_step(tmp_path) -> None:
    out = tmp_path / "run.npz"
    words = ("--method", "variational", "--dt", "0.01", "--duration", "0.5", "--out", out)
    result = fantoccini("simulate", "string_pendulum", *words, "--quiet")
    assert result.exit_code == 0, result.stderr
    run = fan.Trajectory.load(out)
    assert (run.method, len(run)) == ("variational", 51)
    wrong = fantoccini("simulate", "string_pendulum", "--method", "variational", "--rtol", "1e-6")
    assert wrong.exit_code == 2 and "variational has --dt" in wrong.stderr


def test_it_starts_where_the_inputs_begin(tmp_path) -> None:
    table = tmp_path / "x.csv"
    t = np.linspace(2.0, 3.0, 21)
    rows = [f"{a},{0.5 - 0.05 * (a - 2) ** 2}" for a in t]
    table.write_text("\n".join(["t,hand.x", *rows]) + "\n")
    out = tmp_path / "run.npz"
    result = fantoccini("simulate", "arm2d", "--inputs", table, "--out", out, "--quiet")
    assert result.exit_code == 0, result.stderr
    run = fan.Trajectory.load(out)
    assert (run.t[0], run.q_K[0, 0]) == (2.0, 0.5)


def test_without_inputs_it_hangs_still_for_five_seconds(tmp_path) -> None:
    out = tmp_path / "run.npz"
    assert fantoccini("simulate", "arm2d", "--quiet", "--out", out).exit_code == 0
    run = fan.Trajectory.load(out)
    assert run.duration == 5.0
    assert np.ptp(run.q_D, axis=0) == pytest.approx(0.0, abs=1e-6)


def test_a_driven_start_hangs_and_a_dynamic_one_swings(tmp_path) -> None:
    out = tmp_path / "run.npz"
    common = ("simulate", "arm2d", "--quiet", "--duration", "1", "--out", out)
    assert fantoccini(*common, "--start", "hand.length=0.8").exit_code == 0
    run = fan.Trajectory.load(out)
    assert run.ledger["kinetic"].max() == pytest.approx(0.0, abs=1e-9)
    options = (
        "--start",
        "shoulder=-30 deg",
        "--start",
        "v:elbow=0.5",
        "--start",
        "hand.length=1.2",
    )
    assert fantoccini(*common, *options).exit_code == 0
    run = fan.Trajectory.load(out)
    assert run.q_D[0, 0] == pytest.approx(np.radians(-30))
    assert run.v_D[0, 1] == 0.5
    assert run.ledger["kinetic"].max() > 0.01


def test_a_start_beyond_a_string_is_brought_onto_it(tmp_path) -> None:
    out = tmp_path / "run.npz"
    result = fantoccini(
        "simulate", "string_pendulum", "--duration", "0.1", "--start", "bob.z=-2", "--out", out
    )
    assert result.exit_code == 0
    assert "to the nearest state that strings and limits allow: bob.z is -1" in (result.stderr)
    assert fan.Trajectory.load(out).q_D[0] == pytest.approx([0.0, -1.0], abs=1e-9)


def test_timestepping_keeps_its_step(tmp_path) -> None:
    out = tmp_path / "run.npz"
    options = ("--method", "timestepping", "--dt", "0.01", "--duration", "1")
    assert fantoccini("simulate", "arm2d", "--quiet", *options, "--out", out).exit_code == 0
    run = fan.Trajectory.load(out)
    assert run.method == "timestepping"
    assert np.diff(run.t) == pytest.approx(0.01)


def test_a_start_that_contradicts_the_inputs_is_a_mistake(lift) -> None:
    stderr = mistake("simulate", "-q", "arm2d", "--inputs", lift, "--start", "hand.length=0.9")
    assert "hand.length" in stderr and "in the inputs at t = 0 s" in stderr


def test_impossible_inputs_leave_the_partial_run_and_end_with_1(tmp_path) -> None:
    inputs, out = tmp_path / "x.yaml", tmp_path / "run.npz"
    inputs.write_text("coordinates:\n  hand.x: [[0, 0.45], [1, 3.0]]\n")
    result = fantoccini("simulate", "arm2d", "--inputs", inputs, "--out", out)
    assert result.exit_code == 1
    assert "at t = 0." in result.stderr.splitlines()[-1]
    run = fan.Trajectory.load(out)
    assert run.status not in (Status.DONE, Status.STOPPED)
    assert 0.0 < run.t[-1] < 1.0
    assert np.all(np.isfinite(run.q_D))


ANNOUNCING_COMMAND = """
import sys
from fantoccini.app.cli import main
from fantoccini.dynamics.simulation import run

advance = run.Run.advance

def announced(self, t_end):
    for piece in advance(self, t_end):
        print("begun", file=sys.stderr, flush=True)
        yield piece

run.Run.advance = announced
main()
"""
"""The command; stderr announces every finished piece of the run."""


def test_ctrl_c_writes_the_partial_run_and_ends_with_130(tmp_path) -> None:
    fan.puppets.arm2d().rest()  # so that nothing is compiled below
    out = tmp_path / "run.npz"
    command = [
        sys.executable,
        "-c",
        ANNOUNCING_COMMAND,
        "simulate",
        "arm2d",
        "--out",
        str(out),
        "--method",
        "timestepping",
        "--dt",
        "0.0005",
        "--duration",
        "3600",
    ]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as run:
        for wanted in ("simulating", "begun"):  # the search for a rest comes first
            assert any(line.startswith(wanted) for line in run.stderr)
        run.send_signal(signal.SIGINT)
        _, stderr = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "Traceback" not in stderr
    assert "stopped from outside: at t = " in stderr
    assert fan.Trajectory.load(out).status is Status.STOPPED


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_rights_is_a_mistake(tmp_path) -> None:
    tmp_path.chmod(0o500)
    assert "cannot write" in mistake("simulate", "arm2d", "--out", tmp_path / "x.npz")


def test_an_output_that_cannot_be_written_ends_with_1(tmp_path, monkeypatch) -> None:
    def disk_full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(fan.Trajectory, "save", disk_full)
    result = fantoccini("simulate", "arm2d", "-q", "--duration", "1", "--out", tmp_path / "x.npz")
    assert result.exit_code == 1
    assert (
        result.stderr == f"fantoccini: cannot write {tmp_path / 'x.npz'}: No space left on device\n"
    )


def test_an_output_that_fails_leaves_the_run_and_the_others(tmp_path, monkeypatch):
    def disk_full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(fan.Trajectory, "save", disk_full)
    lost, table = tmp_path / "x.npz", tmp_path / "x.csv"
    result = fantoccini("simulate", "arm2d", "--duration", "0.2", "--out", lost, "--out", table)
    assert result.exit_code == 1 and f"cannot write {lost}" in result.stderr
    assert table.is_file() and "events:" in result.stdout


def test_demo_leaves_numbers_a_picture_and_a_film(tmp_path) -> None:
    folder = tmp_path / "new" / "out"
    result = fantoccini("demo", "--out", folder)
    assert result.exit_code == 0, result.stderr
    names = [f"marionette{ending}" for ending in (".mp4", ".npz", ".png")]
    assert sorted(path.name for path in folder.iterdir()) == names
    run = fan.Trajectory.load(folder / "marionette.npz")
    assert run.duration == pytest.approx(12.0)
    assert len(run.contact) > 0
    slack = {name: longest_slack(run, name) for name in run.tension}
    assert max(slack.values()) >= 0.1
    for name in run.tension:
        assert f"\n{name} " in result.stdout
    table = ("catches", "longest slack [s]", "residual", "times real time", "method timestepping")
    for part in table:
        assert part in result.stdout


def test_longest_slack_counts_to_the_end() -> None:
    pendulum = fan.puppets.string_pendulum()
    x = pendulum.state({"bob.x": 0.0, "bob.z": -0.5})
    run = fan.simulate(pendulum, x, t_end=0.2)
    assert longest_slack(run, "line") == pytest.approx(0.2)


def test_a_bundled_performance_by_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    by_name = ("simulate", "arm2d", "--inputs", "toss", "--duration", "0.2", "-q", "--out")
    assert fantoccini(*by_name, "a.npz").exit_code == 0
    by_path = [fan.puppets.performance("toss") if a == "toss" else a for a in by_name]
    assert fantoccini(*by_path, "b.npz").exit_code == 0
    a, b = (fan.Trajectory.load(tmp_path / f"{name}.npz") for name in "ab")
    assert np.array_equal(a.q_K, b.q_K) and np.ptp(a.q_K) > 0.0
    checked = fantoccini("check", "arm2d", "arm3d", "--inputs", "toss", "--inputs", "stir")
    assert checked.exit_code == 2  # each drives only one of them, and mistakes name the file
    assert "stir.yaml:" in checked.stderr and "toss.yaml: no mistakes" in checked.stdout


@pytest.mark.parametrize("command", ["simulate", "check"])
def test_a_name_of_no_performance_is_a_mistake(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stderr = mistake(command, "arm2d", "--inputs", "tos")
    assert (
        stderr
        == "tos: no such file, and no bundled performance with this name; did you mean 'toss'?\n"
    )


def test_a_file_goes_before_a_performance_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "toss").write_text("")
    assert "ending ''" in mistake("simulate", "arm2d", "--inputs", "toss")
