"""Pages of the API reference: every public name under its canonical import path."""

from __future__ import annotations

import ast
from pathlib import Path

from docs.site.links import ROOT

PACKAGE = ROOT / "src" / "fantoccini"

TITLES = {
    "dynamics": "Marionettes and their dynamics",
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
"""Title of the page of each package, in the order of the navigation."""

FIRST = ("Marionette", "load", "loads", "State", "Input", "Trajectory", "simulate", "Performance")
"""Names at the top of their pages; the others follow in the order of export."""

ENUMERATIONS = ("AnswerStatus", "EventKind", "PolishStatus", "Status")
"""Enumerations whose members have no docstrings."""

BUNDLED = (
    "airplane",
    "arm2d",
    "arm3d",
    "crane",
    "dachshund",
    "dragon",
    "hans",
    "heron",
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
"""Additional names that the guides use."""


def stub(file: Path) -> dict[str, list[str]]:
    """Names of a stub file by their package, without the packages themselves."""
    names: dict[str, list[str]] = {}
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            names.setdefault(node.module, []).extend(alias.name for alias in node.names)
    return names


def paths() -> dict[str, list[str]]:
    """Canonical import paths of all documented names, by page."""
    first = stub(PACKAGE / "__init__.pyi")
    pages: dict[str, list[str]] = {}
    for package in TITLES:
        modules = ("errors", "puppets")
        names = [name for name in first.get(package, []) if name not in modules]
        face = PACKAGE / package / "__init__.pyi"
        passed_on = stub(face).values() if face.exists() else ()
        rest = [name for names in passed_on for name in names if name not in modules]
        pages[package] = [
            f"fantoccini.{name}" for name in sorted(names, key=lambda name: name not in FIRST)
        ]
        pages[package] += [
            f"fantoccini.{package}.{name}"
            for name in (*rest, *MORE.get(package, ()))
            if name not in names
        ]
    return pages


def page(package: str, names: list[str]) -> str:
    """Page of the reference for one package."""
    parts = [f"# {TITLES[package]}\n"]
    for name in names:
        parts.append(f"::: {name}")
        if name.split(".")[-1] in ENUMERATIONS:
            parts.append("    options: {show_if_no_docstring: true}")
        parts.append("")
    return "\n".join(parts)


def index() -> str:
    """Index of all documented names."""
    lines = [
        "# API reference\n",
        "Every public name, by the path from which to import it; `import fantoccini as fan` "
        "gives the names without a package in their path.\n",
    ]
    for package, names in paths().items():
        links = ", ".join(f"[`{name}`]({package}.md#{name})" for name in names)
        lines.append(f"## [{TITLES[package]}]({package}.md)\n\n{links}\n")
    return "\n".join(lines)
