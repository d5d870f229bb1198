"""The wheel holds all that is needed: it works from an empty folder, without the source tree."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

SIMULATE = """
from pathlib import Path
import fantoccini as fan
assert Path(fan.__file__).is_relative_to({site!r}), fan.__file__
arm = fan.puppets.arm2d()
x0 = arm.rest({{"hand.length": 0.8}})
lift = fan.Input.waypoints(arm, {{"hand.length": [(0, 0.8), (0.2, 0.7)]}})
run = fan.simulate(arm, x0, lift, t_end=0.3)
assert run.t[-1] == 0.3, run.status
assert run.tension["hand"].min() >= 0
print("simulated", len(run.t))
"""


def run(*command: str, cwd: Path, **environment: str) -> str:
    """Runs a command and returns what it printed; its words are the failure's message."""
    done = subprocess.run(
        command,
        cwd=cwd,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder))
    run(sys.executable, "-m", "pip", "wheel", *options, str(ROOT), cwd=folder)
    (file,) = folder.glob("fantoccini-*.whl")
    return file


def test_the_wheel_holds_the_runtime_and_the_puppets(wheel):
    """Everything in the source folder but what Python writes there, and nothing beside it."""
    source = ROOT / "src"
    wanted = {
        file.relative_to(source).as_posix()
        for file in (source / "fantoccini").rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == wanted
    assert any(name.startswith("fantoccini/cpp/") for name in held)
    assert "fantoccini/puppets/arm2d.yaml" in held
    assert "fantoccini/puppets/marionette.yaml" in held


def test_the_wheel_names_the_command_and_the_licence(wheel):
    archive = zipfile.ZipFile(wheel)
    held = {name.split(".dist-info/")[-1]: name for name in archive.namelist()}
    points = archive.read(held["entry_points.txt"]).decode()
    assert "fantoccini = fantoccini.cli:main" in points
    assert any(name.endswith("LICENSE") for name in held)


def test_the_wheel_simulates_from_an_empty_folder(wheel, tmp_path):
    """With a cache of its own, so that the puppet is derived and compiled from the wheel alone."""
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    install = ("install", "--quiet", "--no-deps", "--no-index", "--target", str(site), str(wheel))
    run(sys.executable, "-m", "pip", *install, cwd=empty)
    said = run(
        sys.executable,
        "-c",
        SIMULATE.format(site=str(site)),
        cwd=empty,
        PYTHONPATH=str(site),
        FANTOCCINI_CACHE=str(tmp_path / "cache"),
    )
    assert "simulated" in said
