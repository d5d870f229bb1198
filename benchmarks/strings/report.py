"""The page: tables, pictures and marks, written as Markdown."""

from __future__ import annotations

import itertools
import math
import os
import platform
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

import fantoccini as fan
from fantoccini.kernel import build

PACKAGES = ("numpy", "scipy", "casadi", "mujoco")


@dataclass(frozen=True)
class Table:
    """Rows under a header; numbers are written by :func:`number`."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def markdown(self) -> str:
        marks = ["---"] + ["---:"] * (len(self.header) - 1)
        lines = [self.header, marks, *self.rows]
        return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


@dataclass(frozen=True)
class Picture:
    """A picture and its caption."""

    name: str
    alt: str

    def markdown(self) -> str:
        return f"![{self.alt}](pictures/{self.name})"


@dataclass(frozen=True)
class Mark:
    """A figure with an upper bound as its target."""

    what: str
    value: float
    bound: float

    @property
    def met(self) -> bool:
        return bool(self.value <= self.bound)


@dataclass
class Section:
    """A heading, the content below it, and its marks."""

    title: str
    parts: list[str | Table | Picture] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)

    def markdown(self) -> str:
        bodies = [wrap_paragraph(p) if isinstance(p, str) else p.markdown() for p in self.parts]
        return "\n\n".join([f"## {self.title}", *bodies])


def number(value: float, digits: int = 2) -> str:
    """A number in few characters: 1.6e-7, 0.012, 250."""
    if value != value:
        return "-"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        text = f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"
        return text if "e" not in text else f"{float(text):g}"
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    return f"{float(mantissa):g}e{int(power)}"


def order(errors: Sequence[float], steps: Sequence[float]) -> list[str]:
    """Orders of convergence between neighbours, the first one blank."""
    pairs = zip(itertools.pairwise(errors), itertools.pairwise(steps), strict=True)
    return ["", *(f"{_slope(e, s):.1f}" for e, s in pairs)]


def marks_table(sections: Sequence[Section]) -> Table:
    """All marks of the page, those not met in bold."""
    rows = []
    for section in sections:
        for mark in section.marks:
            met = "yes" if mark.met else "**no**"
            rows.append([mark.what, number(mark.value), number(mark.bound), met])
    return Table(["Figure", "measured", "to stay below", "met"], rows)


def machine(packages: Sequence[str] = PACKAGES) -> Table:
    """The machine on which the figures were measured, and versions of packages."""
    names = [platform.machine()]
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    except OSError:
        pass
    rows = [
        ["processor", f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores"],
        ["compiler", build.find_compiler().version],
        ["python", platform.python_version()],
        ["fantoccini", fan.__version__],
        *([name, metadata.version(name)] for name in packages),
    ]
    return Table(["Made with", ""], rows)


def write(path: Path, opening: str, sections: Sequence[Section]) -> None:
    """The whole page."""
    head = ["# Strings, measured", wrap_paragraph(opening), marks_table(sections).markdown()]
    body = [section.markdown() for section in sections]
    text = "\n\n".join([*head, machine().markdown(), *body]) + "\n"
    path.write_text(text, encoding="utf-8")


def wrap_paragraph(text: str) -> str:
    """A paragraph in lines; headings as they are."""
    if text.startswith("#"):
        return text
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)


def _slope(errors: tuple[float, float], steps: tuple[float, float]) -> float:
    if min(errors) <= 0:
        return math.nan
    return math.log(errors[0] / errors[1]) / math.log(steps[0] / steps[1])
