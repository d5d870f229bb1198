"""A cache folder for every test, and small sources for it."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from fantoccini.kernel.build import Source

KEY = "ab" * 32


def _c_source(value: int = 7, **info) -> Source:
    text = f'extern "C" __attribute__((visibility("default"))) int answer() {{ return {value}; }}\n'
    return Source({"model.cpp": text}, "model.cpp", info)


@pytest.fixture
def key() -> str:
    return KEY


@pytest.fixture
def source():
    """A function that makes a source whose library answers with a number."""
    return _c_source


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder, no remembered compilers, and separate temporary files."""
    folder = tmp_path / "cache"
    refuge = tmp_path / "temporary"
    refuge.mkdir()
    monkeypatch.setenv("FANTOCCINI_CACHE", str(folder))
    monkeypatch.delenv("FANTOCCINI_CXX", raising=False)
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(refuge))
    return folder


@pytest.fixture
def program(tmp_path: Path):
    """A function that writes an executable shell script and returns its path."""

    def write(name: str, body: str) -> Path:
        file = tmp_path / "bin" / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(f"#!/bin/sh\n{body}\n")
        os.chmod(file, file.stat().st_mode | stat.S_IXUSR)
        return file

    return write
