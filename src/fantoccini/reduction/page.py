"""A report as tables, as Markdown and as plots."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from fantoccini.equations.printing import decimal
from fantoccini.files import replacing
from fantoccini.reduction import plots

if TYPE_CHECKING:
    from fantoccini.reduction.report import ReductionReport
    from fantoccini.reduction.symbolic import Symbolic

PAGE = "reduction.md"
_LONGEST = 120
"""Characters of an expression that is printed."""


@dataclass(frozen=True)
class Table:
    """A table with its heading.

    Attributes:
        title: of the section.
        text: paragraphs before it.
        header: of the columns; those that end in ``>`` are set flush right.
        rows: cells as text.
    """

    title: str
    text: tuple[str, ...]
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Heading, text and table."""
        lines = [tuple(h.rstrip(">") for h in self.header)]
        lines.append(tuple("---:" if h.endswith(">") else "---" for h in self.header))
        cells = [*lines, *(tuple(c.replace("|", "\\|") for c in row) for row in self.rows)]
        made = "\n".join("| " + " | ".join(row) + " |" for row in cells) if self.rows else ""
        parts = (f"## {self.title}", *map(wrapped, self.text), made)
        return "\n\n".join(part for part in parts if part)


def write(report: ReductionReport, folder: Path) -> list[Path]:
    """Writes the page and the plots beside it, each under a temporary name first."""
    pictures = plots.draw(report, folder)
    path = folder / PAGE
    with replacing(path) as temporary:
        temporary.write_text(markdown(report, [p.name for p in pictures]), encoding="utf-8")
    return [path, *pictures]


def markdown(report: ReductionReport, pictures: Sequence[str]) -> str:
    """The whole page."""
    n = len(report.driven)
    opening = (
        f"What of Section VI (\"Validity of mixed kinematic-dynamic modeling\") of Johnson and "
        f"Murphey, ICRA 2007, holds for this puppet of {number(report.mass)} kg with {n} driven "
        f"coordinate{'s' * (n > 1)}. The mixed model takes them as inputs; in the full model each "
        "has a drive."
    )
    parts = [f"# Reduction of {report.name}", wrapped(opening)]
    parts += [f"- {line}" for line in verdict(report)]
    head = "\n\n".join(parts[:2]) + "\n\n" + "\n".join(parts[2:])
    sections = []
    for table in tables(report):
        sections.append(table.markdown())
        name = plots.PICTURES.get(table.title)
        if name in pictures:
            sections.append(f"![{table.title}]({name})")
        if table.title == CLAIMS:
            sections += map(wrapped, report.meaning)
            if report.structure.symbolic is not None:
                sections.append("```\n" + expressions(report.structure.symbolic) + "\n```")
    return "\n\n".join([head, *sections]) + "\n"


def verdict(report: ReductionReport) -> list[str]:
    """A few lines that say what came out."""
    fails = [c.says for c in report.claims if c.verdict == "fails"]
    said = ["(a) the claims hold" if not fails else f"(a) fails: {'; '.join(fails)}"]
    if report.exact is not None:
        said.append(
            f"(b) with exact tracking the puppets differ by {number(report.exact.worst[0])} (m, "
            f"rad) at rtol {report.exact.step:g}, up to {report.ends:.3g} s"
        )
    if report.caught:
        said.append(
            f"(b) at a catch they differ as the drives' inertia to the power "
            f"{report.catch_order:.2f}"
        )
    if report.tracked:
        power = report.bandwidth_order
        said.append(
            f"(c) with real tracking they differ as the bandwidth to the power {power:.2f}"
            if np.isfinite(power)
            else "(c) the puppet does not feel how well the drives track"
        )
    if report.massive:
        heavy = report.massive[-1]
        last = heavy.tracked[-1]
        said.append(
            f"(c) with {heavy.string} of {number(heavy.mass)} kg they stay {number(last.worst[0])} "
            f"(m, rad) apart at {last.bandwidth:.3g} rad/s"
        )
    if report.own is not None:
        said.append(f"(c) on the file's own drives it is {number(report.own.worst)} (m, rad) away")
    return said + [f"not measured: {line}" for line in report.missing]


CLAIMS, EXACT, CATCH, BANDWIDTH, MASSIVE, OWN = (
    "Structure", "Exact tracking", "Catches", "Bandwidth", "A string with mass",
    "The file's own drives",
)  # fmt: skip


def tables(report: ReductionReport) -> list[Table]:
    """The report's tables in order; those that were not measured are left out."""
    made = [_claims(report), _exact(report), _catches(report), _bandwidth(report), _massive(report)]
    made.append(_own(report))
    return [table for table in made if table.rows]


def _claims(report: ReductionReport) -> Table:
    rows = tuple((c.says, str(c.verdict), c.because) for c in report.claims)
    return Table(CLAIMS, (), ("claim", "", "found"), rows)


def _exact(report: ReductionReport) -> Table:
    text = (
        "The full model's drives are moved by the forces of exact tracking, the mixed model's "
        "effort and the drive's inertia times acc_K, without control. Largest difference of a "
        f"coordinate up to {report.ends:.3g} s of {report.duration:.3g} s, each method beside "
        "itself.",
    )
    rows = tuple(
        (c.method, _setting(c.method, c.step), *map(number, c.worst)) for c in report.compared
    )
    return Table(EXACT, text, ("method", "setting>", "puppet>", "drives>"), rows)


def _setting(method: str, step: float) -> str:
    return f"rtol {step:g}" if method == "event" else f"{1e3 * step:.2f} ms"


def _catches(report: ReductionReport) -> Table:
    if not report.caught:
        return Table(CATCH, (), (), ())
    text = (
        f"The puppet is tossed; {report.caught[0].string} catches first. In the mixed model v_K is "
        "continuous there, a drive takes its part of the blow. Jump of v_D: difference relative to "
        "the mixed model's, in the metric of M_DD.",
    )
    rows = tuple(
        (
            f"{c.ratio:g}", number(c.impulse, 6), number(abs(1.0 - c.impulse / c.mixed_impulse)),
            number(c.jump), number(c.after),
        )
        for c in report.caught
    )  # fmt: skip
    header = (
        "drive / puppet>", "impulse [N s]>", "lacks of the mixed model's>", "jump of v_D>",
        "puppet later (m, rad)>",
    )  # fmt: skip
    return Table(CATCH, text, header, rows)


def _bandwidth(report: ReductionReport) -> Table:
    text = (
        "Drives with computed-torque control, which knows the drive and not the strings, follow "
        "the same inputs. A steady pull leaves a lag pull / (J w^2).",
    )
    rows = tuple(
        (f"{t.bandwidth:.4g}", *map(number, t.worst), t.status or "") for t in report.tracked
    )
    header = ("bandwidth [rad/s]>", "puppet (m, rad)>", "drives (m, rad)>", "")
    some = any(t.status for t in report.tracked)
    return Table(BANDWIDTH, text, header if some else header[:3],
                 rows if some else tuple(row[:3] for row in rows))  # fmt: skip


def _massive(report: ReductionReport) -> Table:
    if not report.massive:
        return Table(MASSIVE, (), (), ())
    text = (
        f"{report.massive[0].string} is a chain of point masses between stiff springs. How far the "
        "puppet is from the massless mixed model's, both counted from their own rest (m, rad). "
        "M_DK is what a straight string of that mass makes, over sqrt(M_DD M_KK).",
    )
    speeds = [f"at {t.bandwidth:.4g} rad/s>" for t in report.massive[0].tracked]
    rows = tuple(
        (number(m.mass), number(m.coupling), *(number(t.worst[0]) for t in (*m.tracked, m.exact)))
        for m in report.massive
    )
    header = ("string [kg]>", "M_DK, relative>", *speeds, "exact tracking>")
    return Table(MASSIVE, text, header, rows)


def _own(report: ReductionReport) -> Table:
    if report.own is None:
        return Table(OWN, (), (), ())
    found = report.own
    text = (
        "The same motion as commands of the drives that the file describes, from their own rest. "
        f"The puppet is up to {number(found.worst)} (m, rad) from the mixed model's, both counted "
        "from their rest." + (f" The run stopped: {found.status}." if found.status else ""),
    )
    rows = tuple(
        (name, number(found.lag[0, k]), number(np.max(found.lag[:, k])), number(found.force[k]))
        for k, name in enumerate(found.drives)
    )
    header = ("drive", "off at rest (m, rad)>", "off at most>", "largest force [N, N m]>")
    return Table(OWN, text, header, rows)


def expressions(page: Symbolic) -> str:
    """A small puppet's blocks, entry by entry."""
    lines = [f"{symbol}: {name}" for symbol, name in page.names.items()]
    for label, block in (("M_DD", page.M_DD), ("M_DK", page.M_DK), ("M_KK", page.M_KK)):
        lines += _entries(label, block)
    if page.felt is not None and not page.M_DK.is_zero_matrix:
        lines += _entries("(M_KK - M_KD M_DD^-1 M_DK)", page.felt)
    return "\n".join(lines)


def _entries(label: str, block: sp.Matrix) -> list[str]:
    if block.is_zero_matrix:
        return [f"{label} = 0  ({block.rows} x {block.cols})"]
    lines = []
    for i in range(block.rows):
        for j in range(i if block.is_symmetric() else 0, block.cols):
            if block[i, j] == 0:
                continue
            text = str(decimal(block[i, j]))
            text = text if len(text) <= _LONGEST else f"({sp.count_ops(block[i, j])} operations)"
            lines.append(f"{label}[{i + 1},{j + 1}] = {text}")
    return lines


def number(value: float, digits: int = 2) -> str:
    """A number in few characters."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.{digits}g}" if 1e-3 <= abs(value) < 1e5 or value == 0 else f"{value:.1e}"


def wrapped(text: str) -> str:
    """A paragraph in lines."""
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)
