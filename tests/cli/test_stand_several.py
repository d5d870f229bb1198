"""Commands for a stand with several controllers."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
from tests.cli.command import fantoccini
from tests.cli.test_stand_stream import streaming
from tests.stand.test_several import EIGHT, PUPPET, SHARED, N, eight, run
from tests.stand.test_walk_through import start_emulator

import fantoccini as fan

pytestmark = [
    pytest.mark.medium,
    pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals"),
]
__all__ = ["eight", "run"]


@pytest.fixture(scope="module", name="files")
def _files(tmp_path_factory, run):
    folder = tmp_path_factory.mktemp("several")
    (folder / "eight.yaml").write_text(PUPPET)
    (folder / "stand.yaml").write_text(f"puppet: eight.yaml\n{EIGHT.lstrip()}{SHARED}")
    (folder / "one.yaml").write_text(
        f"puppet: eight.yaml\n{EIGHT.lstrip()}controller: {{type: fluidnc}}\n"
    )
    run.save(folder / "run.npz")
    return folder


def test_the_number_of_axes_is_checked_before_export(files):
    for command in (["check"], ["stand", "check"]):
        runs = [files / "run.npz"] if command[0] == "stand" else []
        done = fantoccini(*command, files / "one.yaml", *runs)
        assert done.exit_code == 2
        assert re.search(r"one\.yaml:\d+: controller: fluidnc moves up to 6 axes", done.stderr)
    done = fantoccini("check", files / "stand.yaml")
    assert done.exit_code == 0 and "8 axes on 2 controllers" in done.stdout


def test_export_writes_a_program_for_each_controller(files, tmp_path):
    out = tmp_path / "show.gcode"
    done = fantoccini("stand", "export", files / "stand.yaml", files / "run.npz", out)
    assert done.exit_code == 0, done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "show-left.gcode",
        "show-right.gcode",
    ]
    for name, odd in (("left", 0), ("right", 1)):
        assert f"show-{name}.gcode: 76 set points of 4 axes, 1.5 s" in done.stdout
        text = (tmp_path / f"show-{name}.gcode").read_text()
        letters = [f"; {letter} = winch{2 * k + odd} [mm]" for k, letter in enumerate("XYZA")]
        assert text.splitlines()[1:5] == letters


@pytest.mark.parametrize(
    "options, words",
    [
        (("--from-line", "9"), "needed: --from-time S"),
        (("--port", "/dev/x"), "needed: NAME=PORT, NAME one of left, right"),
        (("--port", "lfet=/dev/x"), "needed: NAME=PORT"),
        (("--to", "127.0.0.1:9000"), "but this stand has fluidnc, fluidnc"),
    ],
)
def test_options_that_do_not_apply_are_refused(files, options, words):
    done = fantoccini("stand", "stream", files / "stand.yaml", files / "run.npz", *options)
    assert done.exit_code == 2 and words in " ".join(done.stderr.split())


def test_emulated_controllers_follow_together(files, tmp_path, monkeypatch):
    monkeypatch.chdir(files)
    csv = tmp_path / "motors.csv"
    emulator, left = start_emulator(["stand", "emulate", "stand.yaml", "--out", str(csv)])
    right = emulator.stdout.readline().strip()
    assert left.startswith("left=/dev/") and right.startswith("right=/dev/")
    with streaming(files, "--port", left, "--port", right) as process:
        code, out, stderr = process.end()
    assert code == 0, stderr
    assert re.search(r"left: \d+ lines; up to \d+ characters in transit\nright: ", out)
    _, stderr = emulator.communicate(timeout=60)
    assert emulator.returncode == 0 and stderr.count(" 0 lost") == 2
    table = np.genfromtxt(csv, delimiter=",", names=True)
    names = [f"winch{k}" for k in range(N)]
    assert table.dtype.names == ("t_s", *names)
    at = np.column_stack([table[name] for name in names])
    loaded = fan.Trajectory.load(files / "run.npz")
    bound = fan.stand.set_points("stand.yaml", loaded, controller="csv").map
    # The common start is between two rows, and one step is 0.02 mm.
    errors = [
        np.abs(at[k : k + 140] - 1e3 * bound.motion_of(loaded, t + shift).position).max()
        for t in [np.arange(140) / 100.0]
        for shift in np.arange(0.0, 0.01, 5e-4)
        for k in range(len(at) - 140)
    ]
    assert min(errors) < 0.5


def test_a_dry_run_names_the_controllers(files):
    done = fantoccini("stand", "stream", files / "stand.yaml", files / "run.npz", "--dry-run")
    assert done.exit_code == 0
    names = [line.split(": ")[0] for line in done.stdout.splitlines()]
    assert set(names) == {"left", "right"} and abs(names.count("left") - names.count("right")) < 5
    again = fantoccini(
        "stand", "stream", files / "stand.yaml", files / "run.npz", "--dry-run", "--from-time", "1"
    )
    assert again.exit_code == 0 and "G10L20" in done.stdout and "G10L20" not in again.stdout
    assert len(again.stdout.splitlines()) < 0.6 * len(names)
