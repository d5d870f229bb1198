"""The page and the picture of the measurements."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from benchmarks.growth.choices import COMPILERS, EVALUATION, FACTORISATION, FACTORS, VARIANTS
from benchmarks.growth.measure import Size
from benchmarks.strings.plots import STYLE
from benchmarks.strings.report import Table, machine, number

FIGURES = {
    "operations": "operations",
    "derive": "derive [s]",
    "compile": "compile [s]",
    "compile_cpu": "compilers [s]",
    "evaluate": "evaluate [us]",
    "step": "step [us]",
    "memory": "memory [MB]",
    "compiler_memory": "compiler [MB]",
}
"""Field of a size -> heading."""

DRAWN = ("operations", "derive", "compile_cpu", "evaluate", "memory", "compiler_memory")
COLOUR = {"chain": "#b03a2e", "bushy": "#1f4e8c"}
FITTED = 25
"""Degrees of freedom from which an exponent is fitted."""
_MEGABYTES = (50, 70, 100, 150, 200, 300, 400)
LONGEST = 60.0
"""Target for compiling 100 degrees of freedom [s]."""


def write(root: Path, sizes: Sequence[Size], body: int, missing: Sequence[str]) -> None:
    """Writes docs/growth.md, which names the sizes not measured, and docs/pictures/growth.png."""
    by_dof = {
        kind: sorted((s for s in sizes if s.kind == kind and s.strings == 3), key=_dof)
        for kind in COLOUR
    }
    by_strings = sorted((s for s in sizes if s.kind == "bushy" and s.dof == body), key=_strings)
    draw(root / "docs" / "pictures" / "growth.png", by_dof)
    parts = ["# Growth", *map(_wrapped, _OPENING)]
    if missing:
        parts.append(_wrapped(f"Not measured this time: {'; '.join(missing)}."))
    for kind, rows in by_dof.items():
        parts += [f"## {_TITLE[kind]}", _by_size(rows, "dof", "DOF").markdown(), _marks(rows)]
    parts += [
        "![Six panels over the degrees of freedom, both axes logarithmic: operations, derivation, "
        "compilation, evaluation, memory of the process and of a compiler; chain and bushy, with "
        "their exponents.](pictures/growth.png)",
        "## More strings",
        _wrapped(_MORE_STRINGS.format(body=body)),
        _by_size(by_strings, "strings", "strings").markdown(),
        "## Design choices",
        _wrapped(FACTORISATION),
        FACTORS.markdown(),
        _wrapped(EVALUATION),
        VARIANTS.markdown(),
        _wrapped(COMPILERS),
        "## Measured on",
        machine().markdown(),
        _wrapped(
            f"{os.cpu_count()} processors, with a load of {os.getloadavg()[2]:.1f} in the last "
            "quarter of an hour: a load above the number of processors means that other programs "
            "computed, too, which lengthens wall-clock times. Written by `make growth-report`."
        ),
    ]
    (root / "docs" / "growth.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def exponent(sizes: Sequence[Size], by: str, figure: str) -> float:
    """Slope of the straight line through the logarithms."""
    x, y = (np.array([float(getattr(s, name)) for s in sizes]) for name in (by, figure))
    known = np.isfinite(y)
    return float(np.polyfit(np.log(x[known]), np.log(y[known]), 1)[0])


def draw(file: Path, by_dof: dict[str, list[Size]]) -> None:
    """A panel for each figure, both axes logarithmic."""
    with plt.rc_context(STYLE):
        fig, axes = plt.subplots(2, 3, figsize=(10, 5.6), layout="constrained")
        for panel, figure in zip(axes.flat, DRAWN, strict=True):
            for kind, sizes in by_dof.items():
                x, y = [s.dof for s in sizes], [getattr(s, figure) for s in sizes]
                slope = exponent([s for s in sizes if s.dof >= FITTED], "dof", figure)
                panel.loglog(x, y, "o-", color=COLOUR[kind], label=f"{kind}, exponent {slope:.2f}")
            if figure == "compile_cpu":
                panel.axhline(LONGEST, color="#8a8a8a", linestyle="--", linewidth=1)
            panel.set_title(FIGURES[figure])
            ticks = sorted({s.dof for sizes in by_dof.values() for s in sizes})
            panel.set_xticks(ticks, [str(n) for n in ticks])
            panel.minorticks_off()
            if "memory" in figure:
                panel.set_yticks(_MEGABYTES, [str(n) for n in _MEGABYTES])
                panel.set_ylim(_MEGABYTES[0], _MEGABYTES[-1])
            panel.legend(loc="upper left")
            panel.margins(y=0.18)
        for panel in axes[-1]:
            panel.set_xlabel("degrees of freedom")
        fig.savefig(file)
        plt.close(fig)


def _by_size(sizes: Sequence[Size], by: str, heading: str) -> Table:
    rows = [[str(getattr(s, by)), *(number(getattr(s, f), 3) for f in FIGURES)] for s in sizes]
    late = [s for s in sizes if by != "dof" or s.dof >= FITTED]
    if len(late) > 1:
        rows.append(["exponent", *(f"{exponent(late, by, f):.2f}" for f in FIGURES)])
    return Table([heading, *FIGURES.values()], rows)


def _marks(sizes: Sequence[Size]) -> str:
    size = next((s for s in sizes if s.dof == 100), None)
    if size is None:
        return "100 DOF were not measured."
    verdict = "met" if size.compile <= LONGEST else "**not met**"
    return _wrapped(
        f"100 DOF compile in {size.compile:.1f} s; the limit is {LONGEST:g} s: {verdict}. The "
        f"compilers' own time, {size.compile_cpu:.1f} s, divided by the number of processors is "
        "the time on an idle machine."
    )


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)


def _dof(size: Size) -> int:
    return size.dof


def _strings(size: Size) -> int:
    return size.strings


_TITLE = {"chain": "A chain", "bushy": "A binary tree of bodies"}

_OPENING = (
    "After this page you know how derivation, compilation, evaluation and memory grow with a "
    "puppet's size. The puppets are capsules on damped hinges with three kinds of axes, one of "
    "them oblique, hung from three strings with driven lengths: a chain, and a bushy tree. "
    f"Exponents are slopes in the logarithms from {FITTED} DOF on.",
    "`operations`: additions, products, roots and so on of one exact evaluation of the "
    "accelerations and all tensions, with the powers of the ledger and the limits. `derive`: "
    "processor time from the tree to the source code. `compile`: wall-clock time, with pieces in "
    "parallel on all processors of a shared machine; `compilers`: their total processor time. "
    "`evaluate`, `step`: one evaluation of an event-driven run and of a time step, the shortest "
    "of many. `memory`: peak of the process that derives, compiles and evaluates, with Python "
    "and CasADi; `compiler`: peak of one compiler.",
)

_MORE_STRINGS = (
    "The bushy puppet of {body} DOF hung from more strings. G = A_D M^-1 A_D^T has the square of "
    "their number as entries, which affects the exponent from 30 strings on."
)
