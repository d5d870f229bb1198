"""Formats of numbers, goals and the soak in the reports of benchmarks/strings."""

from __future__ import annotations

import json

import pytest
from benchmarks.strings import soak
from benchmarks.strings.report import Mark, Section, Table, marks_table, number, order


@pytest.mark.parametrize(
    "value, text",
    [
        (0, "0"),
        (1.6e-7, "1.6e-7"),
        (0.0123, "0.012"),
        (250.4, "250"),
        (1e-3, "0.001"),
        (float("nan"), "-"),
        (2e5, "2e5"),
        (9.99, "10"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


def test_orders_between_neighbours():
    assert order([4e-3, 1e-3, 5e-4], [0.2, 0.1, 0.05]) == ["", "2.0", "1.0"]


def test_missed_goals_are_marked():
    section = Section("one", marks=[Mark("a", 1e-9, 1e-8), Mark("b", 1e-7, 1e-8)])
    assert [row[-1] for row in marks_table([section]).rows] == ["yes", "**no**"]
    assert Table(["x", "y"], [["1", "2"]]).markdown() == "| x | y |\n| --- | ---: |\n| 1 | 2 |"


def test_a_soak_is_shown(tmp_path, monkeypatch):
    """The soak is shown for any entries of its file; without a file the page names the command."""
    monkeypatch.setattr(soak, "RESULT", tmp_path / "soak.json")
    assert "make soak" in soak.section().markdown()
    entries = {"runs": 10, "worst_violation": 1.5e-13, "failures": [], "kinds": {"catch": 3}}
    soak.RESULT.write_text(json.dumps(entries), encoding="utf-8")
    text = soak.section().markdown()
    assert "| worst violation | 1.5e-13 |" in text and "| kinds | catch 3 |" in text
    assert "| failures | none |" in text
