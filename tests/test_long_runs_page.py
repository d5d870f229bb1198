"""docs/long-runs.md is whole, says how it is made, and its figures are within their marks."""

from __future__ import annotations

import re

from benchmarks.long_runs.__main__ import ROOT
from benchmarks.long_runs.measure import METHODS, TREP, TREP_DRIFT

PAGE = ROOT / "docs" / "long-runs.md"


def rows(first: str) -> list[list[str]]:
    """The cells of the page's table rows that begin with some text."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    cells = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")]
    return [row for row in cells if row[0].startswith(first)]


def test_the_page_is_whole_and_names_its_command():
    text = PAGE.read_text(encoding="utf-8")
    sections = ["Energy", "Order", "Momenta", "Cost", "Measured on"]
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == sections
    assert "make long-runs-report" in " ".join(text.split())
    assert "long-runs-report:" in (ROOT / "Makefile").read_text(encoding="utf-8")
    assert str(ROOT) not in text


def test_the_figures_are_within_their_marks():
    assert {row[0] for name in METHODS for row in rows(name)} == set(METHODS)
    gentle = rows("variational, 10 ms")[0]
    assert float(gentle[2]) < TREP_DRIFT
    assert abs(float(gentle[3].split(" +- ")[0])) < 1e-7
    orders = [float(row[-1]) for row in rows("marionette, undamped") + rows("damped")]
    assert len(orders) == 3 and min(orders) > 1.9
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    slowest = float(re.search(r"at 10 ms here, ([\d.]+) us", text)[1])
    assert slowest < TREP[1] / 20
