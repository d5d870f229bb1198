"""The walk-through of docs/stand.md: its commands run, and emulated motors follow the motion."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from tests.cli.command import fantoccini
from tests.test_readme import blocks

import fantoccini as fan
from fantoccini.stand import load_stand, sending
from fantoccini.stand.sending import REPEAT_TIME

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals"),
]
ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "stand.md"
STANDS = {"six_winches": "conduct", "desktop6": "waves", "gantry21": "greeting"}


def commands(stand):
    """Lines of the block that begins with the check of a stand."""
    (block,) = [b for b in blocks(PAGE, "sh") if b.startswith(f"fantoccini check {stand}\n")]
    return [shlex.split(line)[1:] for line in block.splitlines()]


@pytest.mark.parametrize("stand", STANDS)
def test_a_stand_from_its_puppet_to_its_motors(stand, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sending, "MAX_DELAY", 5.0)  # the machine of the tests may be busy
    (waves,) = [b for b in blocks(PAGE, "yaml") if b.startswith("# waves.yaml")]
    Path("waves.yaml").write_text(waves)
    names_of_commands = [c[:2] if c[0] == "stand" else c[:1] for c in commands(stand)]
    assert names_of_commands == [
        ["check"],
        ["simulate"],
        ["stand", "check"],
        ["stand", "export"],
        ["stand", "emulate"],
        ["stand", "stream"],
    ]
    for command in commands(stand):
        if command[:2] == ["stand", "emulate"]:
            emulator, port = start_emulator(command)
            continue
        if command[:2] == ["stand", "stream"]:
            assert re.fullmatch(r"/dev/pts/\d+|127\.0\.0\.1:\d+", command[-1])
            command[-1] = port
        ended = fantoccini(*command)
        assert ended.exit_code == 0, (command, ended.stdout, ended.stderr)
    _, stderr = emulator.communicate(timeout=60)
    assert emulator.returncode == 0
    assert ("0 lost" in stderr) or ("0 wrong" in stderr)
    name = STANDS[stand]
    assert any(Path(f"{name}.{ending}").is_file() for ending in ("gcode", "cfg"))
    check_motors(stand, Path(f"{name}.csv"), fan.Trajectory.load(f"{name}.npz"))


def start_emulator(command):
    """An emulator in a process of its own, and its address."""
    path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    listen = ["--listen", "127.0.0.1:0"] if "osc" in command else []
    process = subprocess.Popen(
        [sys.executable, "-c", "from fantoccini.app.cli import main; main()", *command, *listen],
        env={**os.environ, "PYTHONPATH": path},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    watch = threading.Timer(240.0, process.kill)
    watch.daemon = True
    watch.start()
    return process, process.stdout.readline().strip()


def check_motors(stand, path, run):
    """The motors follow the run, apart from the sequences before and after it."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    t, names = table["t_s"], table.dtype.names[1:]
    axis_map = fan.stand.set_points(stand, run, controller="csv").map
    assert names == tuple(load_stand(stand).axes)
    measured = np.column_stack([table[name] for name in names])
    expected = axis_map.motion_of(run, run.t[0] + np.arange(0.0, run.duration, 0.01)).position * 1e3
    if stand == "gantry21":
        # By the receiver's clock: a packet that is 20 ms late is 20 mm off at 1 m/s.
        offset = round(100 * round(50 * REPEAT_TIME) / 50)
        errors = np.abs(measured[offset : offset + len(expected)] - expected)
        assert np.percentile(errors.max(axis=1), 90) < 30.0
        return
    # Between the table's rows, at up to 0.6 m/s, 5 ms are 3 mm. test_set_points checks steps.
    offsets = range(len(t) - len(expected) + 1)
    assert min(np.abs(measured[k : k + len(expected)] - expected).max() for k in offsets) < 7.0
