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
    sections = [
        "Results", "The structure, (a)", "Exact tracking, (b)", "Catches, (b)",
        "Bandwidth, (c)", "A string with mass, (c)", "Strings as chains", "Measured on",
    ]  # fmt: skip
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == sections
    assert "make reports" in " ".join(text.split())
    assert "reports: long-runs-report reduction-report" in makefile
    assert str(ROOT) not in text and "Not measured" not in text
    pictures = re.findall(r"\]\(pictures/(.*?)\)", text)
    assert len(pictures) == 3
    assert all((ROOT / "docs" / "pictures" / name).is_file() for name in pictures)


def test_the_claims_are_those_of_the_puppets():
    found = {row[0]: row[1:] for row in table("## Results")}
    assert tuple(found) == PUPPETS
    for name in BUNDLED:
        assert found[name] == ["holds"] * 4 + ["**fails**"]
    fails, holds = "**fails**", "holds"
    assert found["boom"] == [fails, holds, fails, holds, fails]


@pytest.mark.parametrize("name", PUPPETS)
def test_the_figures_are_within_their_marks(name):
    def figures(title: str, first: int) -> list[list[float]]:
        return [[float(x) for x in row[first:]] for row in table(title) if row[0] == name]

    exact = figures("## Exact tracking, (b)", 1)[0]
    assert exact[3] < 1e-10
    assert exact[4] > 1.8 * exact[6] and exact[7] > 12 * exact[9]
    jump = figures("## Catches, (b)", 2)[0]
    assert jump[-2] / jump[-1] == pytest.approx(10, rel=0.05)
    puppet = figures("## Bandwidth, (c)", 2)[0]
    assert 3.5 < puppet[-2] / puppet[-1] < 4.5
    heavy = figures("## A string with mass, (c)", 4)
    for row in heavy:
        assert row[-1] > 20 * puppet[-1] and row[-2] == pytest.approx(row[-1], rel=0.05)
    assert sorted(row[-1] for row in heavy) == [row[-1] for row in heavy]
