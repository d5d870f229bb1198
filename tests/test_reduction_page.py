"""docs/reduction.md is whole, says how it is made, and its figures are within their marks."""

from __future__ import annotations

import re

import pytest
from benchmarks.reduction.__main__ import BOOM, BUNDLED, ROOT

import fantoccini as fan

PAGE = ROOT / "docs" / "reduction.md"
PUPPETS = (*BUNDLED, fan.load(BOOM).name)


def table(title: str) -> list[list[str]]:
    """The rows of the first table below a heading."""
    below = PAGE.read_text(encoding="utf-8").split(f"\n{title}\n", 1)[1]
    lines = re.search(r"(\|.*\n)+", below)[0].splitlines()[2:]
    return [line.strip("| ").split(" | ") for line in lines]


def test_the_page_is_whole_and_names_its_command():
    text, makefile = PAGE.read_text(encoding="utf-8"), (ROOT / "Makefile").read_text("utf-8")
    sections = ["What came out", "The structure, (a)", *PUPPETS, "Strings as chains", "Measured on"]
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == sections
    assert "make reports" in " ".join(text.split())
    assert "reports: long-runs-report reduction-report" in makefile
    assert str(ROOT) not in text and "Not measured" not in text
    pictures = re.findall(r"\]\(pictures/(.*?)\)", text)
    assert len(pictures) == 4 * len(PUPPETS)
    assert all((ROOT / "docs" / "pictures" / name).is_file() for name in pictures)


def test_the_claims_are_those_of_the_puppets():
    found = {row[0]: row[1:] for row in table("## What came out")}
    assert tuple(found) == PUPPETS
    for name in BUNDLED:
        assert found[name] == ["holds"] * 4 + ["**fails**"]
    fails, holds = "**fails**", "holds"
    assert found["boom"] == [fails, holds, fails, holds, fails]


@pytest.mark.parametrize("name", PUPPETS)
def test_the_figures_are_within_their_marks(name):
    exact = {(row[0], row[1]): float(row[2]) for row in table(f"### Exact tracking of {name}")}
    assert exact["event", "rtol 1e-12"] < 1e-10
    jump = [float(row[3]) for row in table(f"### Catches of {name}")]
    assert jump[-1] == pytest.approx(jump[-2] / 10, rel=0.1)
    puppet = [float(row[1]) for row in table(f"### Bandwidth of {name}")]
    assert 3.5 < puppet[-2] / puppet[-1] < 4.5
    heavy = [float(x) for x in table(f"### A string with mass of {name}")[-1][2:]]
    assert heavy[-1] > 20 * puppet[-1] and heavy[-1] > 0.5 * heavy[-2]
