"""Checks the contents of the wheel; `make clean-room` installs and runs it."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder))
    command = [sys.executable, "-m", "pip", "wheel", *options, str(ROOT)]
    completed = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert completed.returncode == 0, completed.stdout + completed.stderr
    (file,) = folder.glob("fantoccini-*.whl")
    return file


def test_the_wheel_holds_the_runtime_and_the_puppets(wheel):
    """The wheel has all source files, except those that Python writes, and no others."""
    source = ROOT / "src"
    wanted = {
        file.relative_to(source).as_posix()
        for file in (source / "fantoccini").rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == wanted
    assert any(name.startswith("fantoccini/kernel/cpp/") for name in held)
    assert "fantoccini/model/puppets/arm2d.yaml" in held
    assert "fantoccini/model/puppets/marionette.yaml" in held


def test_the_wheel_names_the_command_and_the_licence(wheel):
    archive = zipfile.ZipFile(wheel)
    held = {name.split(".dist-info/")[-1]: name for name in archive.namelist()}
    points = archive.read(held["entry_points.txt"]).decode()
    assert "fantoccini = fantoccini.app.cli:main" in points
    assert any(name.endswith("LICENSE") for name in held)
