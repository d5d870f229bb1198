"""docs/equations.md is complete and correct: every equation has a row, a function and a test."""

from __future__ import annotations

import ast
import functools
import importlib
import re
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]

EQUATIONS = {*(f"Eq. {n}" for n in range(1, 16)), "delta_1", "delta_2"} | {
    "Sec. I",
    "Sec. III-C",
    "Sec. VI",
}


@dataclass(frozen=True)
class Row:
    """One row of the ledger: a label, dotted paths of functions, ``file::test`` of tests."""

    label: str
    functions: tuple[str, ...]
    tests: tuple[str, ...]


def rows() -> list[Row]:
    """The rows of the table; functions and tests stand in backticks, several to a cell."""
    rows = []
    for line in (ROOT / "docs" / "equations.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("| ") and len(cells) == 4 and cells[0] != "Paper":
            functions, tests = (tuple(re.findall(r"`([^`]+)`", cell)) for cell in cells[2:])
            rows.append(Row(cells[0], functions, tests))
    return rows


def resolve(path: str) -> object:
    """The object under a dotted path: the longest part that is a module, then attributes."""
    parts = path.split(".")
    for n in range(len(parts), 0, -1):
        name = ".".join(parts[:n])
        try:
            thing: object = importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is None or not name.startswith(error.name):
                raise
            continue
        for attribute in parts[n:]:
            thing = getattr(thing, attribute)
        return thing
    raise ModuleNotFoundError(path)


@functools.cache
def collected(file: str) -> frozenset[str]:
    """``test_x`` and ``TestY::test_x`` of a test file, found without importing it."""
    names = set()
    for node in ast.parse((ROOT / file).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ClassDef):
            names |= {f"{node.name}::{f.name}" for f in node.body if isinstance(f, ast.FunctionDef)}
    return frozenset(name for name in names if "test" in name)


def test_every_equation_of_the_paper_has_one_row():
    labels = [row.label for row in rows()]
    assert len(labels) == len(set(labels))
    assert set(labels) == EQUATIONS


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.label)
def test_an_equation_is_computed_by_functions_that_exist(row):
    assert row.functions
    for path in row.functions:
        thing = resolve(path)
        assert not isinstance(thing, ModuleType), f"{path} is a module"


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.label)
def test_an_equation_is_checked_by_tests_that_exist(row):
    assert row.tests
    for path in row.tests:
        file, _, name = path.partition("::")
        assert re.fullmatch(r"tests/[\w/]+\.py", file), path
        assert (ROOT / file).is_file(), path
        assert name in collected(file), path
