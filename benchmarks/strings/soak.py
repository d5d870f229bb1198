"""Section 10: results of the soak run."""

from __future__ import annotations

import json

from . import ROOT
from .report import Section, Table, number

RESULT = ROOT / "benchmarks" / "soak.json"


def section() -> Section:
    """A table of the soak's entries, or how to make them."""
    out = Section("10. Soak")
    if not RESULT.is_file():
        out.parts.append("There is no result of a soak here yet; `make soak` makes one.")
        return out
    entries = json.loads(RESULT.read_text(encoding="utf-8"))
    out.parts = [
        "Random puppets under random inputs, run by `make soak`.",
        Table(["entry", "value"], [[_label(k), _shown(v)] for k, v in entries.items()]),
    ]
    return out


def _label(name: str) -> str:
    return name.replace("_", " ")


def _shown(value) -> str:
    if isinstance(value, float):
        return number(value, 3)
    if isinstance(value, dict):
        return ", ".join(f"{_label(k)} {_shown(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list):
        return ", ".join(map(_shown, value)) or "none"
    return str(value).replace("|", "\\|")
