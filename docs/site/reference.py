"""Pages of the API reference: every public name under its canonical import path."""

from __future__ import annotations

import ast

from docs.site.links import ROOT

PACKAGE = ROOT / "src" / "fantoccini"

TITLES = {
    "puppets": "Bundled puppets",
    "marionette": "Marionette",
    "motion": "States, inputs, trajectories",
    "simulation": "Simulation",
    "optimal": "Optimal control",
    "gestures": "Gestures",
    "capture": "Motion capture",
    "retarget": "Puppets that follow captured motion",
    "plays": "Plays",
    "perform": "Live performance",
    "planning": "Planning",
    "stand": "Stands",
    "identification": "Identification",
    "sweeps": "Sweeps",
    "lab": "Validation of the mixed model",
    "view": "Pictures and films",
    "animation": "Animations for other programs",
    "web": "Browser",
    "puppet": "Puppet schema",
    "scene": "Scenes",
    "exchange": "Exchange with MuJoCo and URDF",
    "equations": "Printed equations",
    "tree": "Measures of a puppet",
    "errors": "Errors",
}
"""Pages by package, in the order of the navigation."""

WHOLE = ("puppets", "planning", "view", "puppet", "exchange")
"""Packages whose exported names are all documented."""

FIRST = ("Marionette", "load", "loads", "State", "Input", "Trajectory", "simulate", "Performance")
"""Names that lead their page; the others follow as exported."""

ENUMERATIONS = ("EventKind", "OptimalStatus", "PlanStatus", "PolishStatus", "Status")
"""Names whose members explain themselves, without a docstring each."""

MORE = {
    "marionette": ("warnings", "input_warnings"),
    "equations": ("printing.printable",),
    "tree": ("measure", "Size"),
}
"""Further names that the guide uses."""


def top_level() -> dict[str, list[str]]:
    """The names of ``fantoccini/__init__.pyi`` by the package they come from."""
    names: dict[str, list[str]] = {}
    for node in ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            names.setdefault(node.module, []).extend(alias.name for alias in node.names)
    return names


def exported(package: str) -> list[str]:
    """``__all__`` of a package; without one, its public functions."""
    names: list[str] = []
    for node in ast.parse((PACKAGE / package / "__init__.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            names.append(node.name)
    return names


def paths() -> dict[str, list[str]]:
    """Canonical import paths of all documented names, by page."""
    first = top_level()
    found: dict[str, list[str]] = {}
    for package in TITLES:
        names = sorted(first.get(package, []), key=lambda name: name not in FIRST)
        rest = exported(package) if package in WHOLE else list(MORE.get(package, ()))
        found[package] = [f"fantoccini.{name}" for name in names]
        found[package] += [f"fantoccini.{package}.{name}" for name in rest if name not in names]
    return found


def page(package: str, names: list[str]) -> str:
    """The reference of one package."""
    parts = [f"# {TITLES[package]}\n"]
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
    for package, names in paths().items():
        links = ", ".join(f"[`{name}`]({package}.md#{name})" for name in names)
        lines.append(f"## [{TITLES[package]}]({package}.md)\n\n{links}\n")
    return "\n".join(lines)
