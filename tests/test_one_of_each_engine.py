"""One stepping engine: the lane record, verdicts on runs and linearised steps stand once each."""

from __future__ import annotations

import ast
from pathlib import Path

import fantoccini as fan
from fantoccini.kernel.contract import LANE

PACKAGE = Path(fan.__file__).parent


def sources() -> dict[str, ast.Module]:
    """The package's modules by their paths."""
    return {
        file.relative_to(PACKAGE).as_posix(): ast.parse(file.read_text(encoding="utf-8"))
        for file in sorted(PACKAGE.rglob("*.py"))
    }


SOURCES = sources()


def test_the_lane_record_is_declared_once():
    """No other literal names parts that only the lane record has."""
    own = {"fresh", "advanced"}
    assert own < {part.name for part in LANE}
    naming = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and node.value in own
    }
    assert naming == {"kernel/contract/lanes.py"}


def test_one_place_decides_the_status_of_a_run():
    """Others report what stopped a run, and check it; only ``decide`` sets what follows."""
    deciding = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr == "REDUNDANT_STRINGS"
    }
    assert deciding == {"dynamics/steppers/verdict.py"}
    calling = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "decide"
    }
    assert calling == {
        "dynamics/simulation/batch_verdicts.py",
        "dynamics/simulation/run.py",
        "dynamics/steppers/stepper.py",
    }
    checking = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in ("GAINED_ENERGY", "UNBALANCED")
    }
    assert checking == {"dynamics/simulation/batch_verdicts.py", "dynamics/simulation/soundness.py"}
