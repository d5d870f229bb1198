"""Every example runs unchanged in an empty folder, and writes the files that it announces."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.long]

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def test_there_are_examples():
    assert [e.name[:2] for e in EXAMPLES] == [f"{k:02d}" for k in range(1, len(EXAMPLES) + 1)]
    assert len(EXAMPLES) >= 5


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: e.stem)
def test_an_example_runs(example, tmp_path, monkeypatch, capsys):
    """The example runs in this process: another Python would spend most of its time on imports."""
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    assert 2 <= len(capsys.readouterr().out.splitlines()) <= 20
    promised = re.findall(r"out/\w+\.\w+", example.read_text(encoding="utf-8").split('"""')[1])
    assert promised
    for name in promised:
        assert (tmp_path / name).stat().st_size > 0, name
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]
