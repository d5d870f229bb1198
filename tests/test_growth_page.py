"""docs/growth.md is whole, and the puppets it measures are what it says."""

from __future__ import annotations

import re

import pytest
from benchmarks.growth.__main__ import BODY, DOF, ROOT, STRINGS
from benchmarks.growth.measure import Size
from benchmarks.growth.puppets import marionette
from benchmarks.growth.report import exponent

PAGE = ROOT / "docs" / "growth.md"


def test_the_page_has_its_picture_and_says_how_it_is_made():
    text = PAGE.read_text(encoding="utf-8")
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", text)
    assert pictures == ["pictures/growth.png"]
    assert (PAGE.parent / pictures[0]).is_file()
    assert "make growth-report" in " ".join(text.split()) and str(ROOT) not in text


@pytest.mark.parametrize("kind", ["chain", "bushy"])
def test_a_puppet_has_the_size_asked_for(kind):
    for dof, strings in [*((n, 3) for n in DOF), *((BODY, n) for n in STRINGS)]:
        puppet = marionette(kind, dof, strings)
        assert (puppet.coordinates.n_vD, len(puppet.tree.strings)) == (dof, strings)


def test_the_exponent_of_a_power():
    sizes = [Size("chain", n, 3, 0, 0, 0, 0, 7.0 * n**1.5, 0, 0, 0) for n in (5, 10, 40)]
    assert exponent(sizes, "dof", "evaluate") == pytest.approx(1.5)
