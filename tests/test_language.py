"""The lint of language reports fragments, fillers and unknown words, and passes plain text."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
_SPEC = importlib.util.spec_from_file_location("language", ROOT / ".ci" / "language.py")
language = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(language)

PLAIN = '''"""Sizes of puppets."""

MIN_STEP_LENGTH = 1e-3  # m


def mass(bodies, gap: float) -> float:
    """Total mass of the bodies [kg]; `qxz` is code, and phidot a rate.

    Args:
        bodies: bodies with shapes.
        gap: colour of the linearised tension.
    """
    total = sum(body.mass for body in bodies)
    if not total:
        raise ValueError(f"{bodies} have no mass; needed: a positive one")
    return total
'''


def texts(tmp_path: Path, source: str, name: str = "a.py") -> list[tuple[int, str]]:
    """Line and text of every finding."""
    path = tmp_path / name
    path.write_text(source, encoding="utf-8")
    return [(line, text) for line, text, _ in language.findings(path)]


def test_plain_english_passes(tmp_path):
    assert texts(tmp_path, PLAIN) == []


@pytest.mark.parametrize(
    ("old", "new", "finding"),
    [
        ("Total mass of", "What is heavy in", (7, "What")),
        ("Total mass of", "By how much there is of", (7, "By")),
        ("Total mass of", "Mass by what is in", (7, "by what")),
        ("bodies: bodies with", "bodies: of the puppet, with", (10, "of")),
        ("bodies: bodies with", "bodies: whose mass, with", (10, "whose")),
        ("total = sum", "found = sum", (13, "found")),
        ("for body in", "for one in", (13, "one")),
        ("MIN_STEP_LENGTH", "_LEAST", (3, "_LEAST")),
        ("Total mass", "Total strign", (7, "strign")),
        ("# m", "# lenght in m", (3, "lenght")),
        ("have no mass", "have no recieved mass", (15, "recieved")),
        ("have no mass", "have mass of how much", (15, "of how much")),
    ],
)
def test_a_fragment_a_filler_and_an_unknown_word_fail(tmp_path, old, new, finding):
    assert old in PLAIN
    assert finding in texts(tmp_path, PLAIN.replace(old, new, 1))


def test_comments_of_headers_and_prose_of_pages_are_checked(tmp_path):
    assert texts(tmp_path, "// Mass.\nint a;  // the gohst\n", "a.hpp") == [(2, "gohst")]
    assert texts(tmp_path, "# Mass\n\n`gohst`\n\n```\ngohst\n```\n\nThe gohst.\n", "a.md") == [
        (9, "gohst")
    ]


def test_the_remaining_files_exist():
    assert [name for name in language.TABLE["remaining"] if not (ROOT / name).exists()] == []
