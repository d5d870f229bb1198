"""Pages of the API reference: every public name under its canonical import path."""

from __future__ import annotations

import ast
from pathlib import Path

from docs.site.links import ROOT

PACKAGE = ROOT / "src" / "fantoccini"

TITLES = {
    "dynamics": "Marionettes and what they do",
    "motion": "States, inputs, trajectories",
    "control": "Plans and optimal control",
    "theatre": "Gestures, plays and performances",
    "lab": "Identification, sweeps, the kinematic reduction",
    "stand": "Stands",
    "output": "Pictures, films and formats",
    "app": "Browser",
    "model": "Puppets and scenes as data",
    "kernel": "Equations",
    "base": "Errors",
}
"""The title of every room's page, in the order of the navigation."""

FIRST = ("Marionette", "load", "loads", "State", "Input", "Trajectory", "simulate", "Performance")
"""Names that lead their page; the others follow as exported."""

ENUMERATIONS = ("AnswerStatus", "EventKind", "PolishStatus", "Status")
"""Names whose members explain themselves, without a docstring each."""

BUNDLED = (
    "arm2d",
    "arm3d",
    "crane",
    "marionette",
    "marionette_bar",
    "names",
    "path",
    "performance",
    "performances",
    "promenade",
    "scenes",
    "stand6",
    "string_pendulum",
    "stroll",
    "visit",
)

MORE = {
    "dynamics": tuple(f"marionette.puppets.{name}" for name in BUNDLED),
    "kernel": ("equations.printing.printable",),
}
"""Further names that the guide uses."""


def stub(file: Path) -> dict[str, list[str]]:
    """The names of a stub file by the package they come from; packages themselves left out."""
    names: dict[str, list[str]] = {}
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            names.setdefault(node.module, []).extend(alias.name for alias in node.names)
    return names


def paths() -> dict[str, list[str]]:
    """Canonical import paths of all documented names, by page."""
    first = stub(PACKAGE / "__init__.pyi")
    found: dict[str, list[str]] = {}
    for room in TITLES:
        modules = ("errors", "puppets")
        names = [name for name in first.get(room, []) if name not in modules]
        face = PACKAGE / room / "__init__.pyi"
        passed_on = stub(face).values() if face.exists() else ()
        rest = [name for names in passed_on for name in names if name not in modules]
        found[room] = [
            f"fantoccini.{name}" for name in sorted(names, key=lambda name: name not in FIRST)
        ]
        found[room] += [
            f"fantoccini.{room}.{name}"
            for name in (*rest, *MORE.get(room, ()))
            if name not in names
        ]
    return found


def page(room: str, names: list[str]) -> str:
    """The reference of one room."""
    parts = [f"# {TITLES[room]}\n"]
    for name in names:
        parts.append(f"::: {name}")
        if name.split(".")[-1] in ENUMERATIONS:
            parts.append("    options: {show_if_no_docstring: true}")
        parts.append("")
    return "\n".join(parts)


def index() -> str:
    """The list of all documented names."""
    lines = [
        "# API reference\n",
        "Look up any public name. Import each by the path shown here; `import fantoccini as fan` "
        "gives those without a package in their path.\n",
    ]
    for room, names in paths().items():
        links = ", ".join(f"[`{name}`]({room}.md#{name})" for name in names)
        lines.append(f"## [{TITLES[room]}]({room}.md)\n\n{links}\n")
    return "\n".join(lines)
