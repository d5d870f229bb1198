"""The report: everything measured on one puppet, as tables, Markdown and plots."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from benchmarks.section_vi import plots
from benchmarks.section_vi.deviation import convergence_order
from benchmarks.section_vi.exact import Comparison
from benchmarks.section_vi.file_drives import FileDrives
from benchmarks.section_vi.plots import BANDWIDTH, CATCHES, EXACT, HEAVY_STRING
from benchmarks.section_vi.symbolic import Symbolic

from fantoccini.base.files import replacing
from fantoccini.lab import ReductionReport

PAGE = "reduction.md"
STRUCTURE, FILE_DRIVES = "Structure", "The file's own drives"
VERDICT_WORDS = {True: "holds", False: "fails", None: "-"}
"""Whether a claim holds -> the word for it."""


@dataclass(frozen=True)
class Table:
    """A table with its heading.

    Attributes:
        title: title of the section.
        text: paragraph before it.
        header: headings of the columns; those that end in ``>`` are aligned right.
        lines: cells as text.
    """

    title: str
    text: str
    header: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Heading, text and table."""
        cells = [tuple(h.rstrip(">") for h in self.header)]
        cells.append(tuple("---:" if h.endswith(">") else "---" for h in self.header))
        cells += [tuple(c.replace("|", "\\|") for c in line) for line in self.lines]
        grid = "\n".join("| " + " | ".join(line) + " |" for line in cells)
        return "\n\n".join(
            part for part in (f"## {self.title}", wrap_paragraph(self.text), grid) if part
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionReport(plots.Measurements):
    """Which claims of Sec. VI hold for a puppet, with the measurements.

    Attributes:
        reduction: (a) the kinetic energy, symmetric products, taut strings; the claims.
        symbolic: (a) the blocks of the kinetic energy as expressions; None for a large puppet.
        mass: mass of the puppet, and of each drive unless stated otherwise [kg].
        duration, first_impact: duration of the compared motion, and time of its first catch [s].
        missing: impossible measurements, with reasons.
        file_drives: (c) the drives of the puppet's file; None if it has none.
    """

    reduction: ReductionReport
    symbolic: Symbolic | None
    mass: float
    duration: float
    first_impact: float
    missing: tuple[str, ...]
    file_drives: FileDrives | None = None

    @property
    def name(self) -> str:
        """Name of the puppet."""
        return self.reduction.name

    @property
    def exact(self) -> Comparison | None:
        """The event-driven comparison with the smallest tolerance."""
        by_events = (c for c in self.comparisons if c.method == "event")
        return min(by_events, key=lambda c: c.setting, default=None)

    @property
    def catch_order(self) -> float:
        """The exponent of the drives' inertia in the difference at a catch; -1 is expected."""
        return convergence_order([c.ratio for c in self.catches], [c.jump for c in self.catches])

    @property
    def bandwidth_order(self) -> float:
        """The exponent of the bandwidth in the puppet's difference; -2 is expected."""
        return convergence_order(
            [t.bandwidth for t in self.tracking], [t.deviation.max_puppet for t in self.tracking]
        )

    def write(self, folder: str | Path) -> list[Path]:
        """Writes reduction.md and its plots into an existing folder; returns the files."""
        folder = Path(folder)
        pictures = plots.draw(self, folder)
        path = folder / PAGE
        with replacing(path) as temporary:
            temporary.write_text(self.markdown([p.name for p in pictures]), encoding="utf-8")
        return [path, *pictures]

    def markdown(self, pictures: Sequence[str]) -> str:
        """The whole page, with those pictures that exist."""
        n = len(self.reduction.driven)
        opening = (
            f'Which claims of Section VI ("Validity of mixed kinematic-dynamic modeling") of '
            f"Johnson and Murphey, ICRA 2007, hold for this puppet of {number(self.mass)} kg with "
            f"{n} driven coordinate{'s' * (n > 1)}. The mixed model takes them as inputs; in the "
            "full model each has a drive."
        )
        verdicts = "\n".join(f"- {line}" for line in self.verdicts())
        sections = [f"# Reduction of {self.name}", wrap_paragraph(opening), verdicts]
        for table in self.tables():
            sections.append(table.markdown())
            name = plots.PICTURES.get(table.title)
            if name in pictures:
                sections.append(f"![{table.title}]({name})")
            if table.title == STRUCTURE and self.symbolic is not None:
                sections.append("```\n" + self.symbolic.text() + "\n```")
        return "\n\n".join(sections) + "\n"

    def verdicts(self) -> list[str]:
        """The results, one line each."""
        fails = [c.text for c in self.reduction.claims if c.holds is False]
        lines = [
            f"(a) fails: {'; '.join(fails)}" if fails else "(a) the claims hold",
            f"(a) {self.reduction.conclusion}",
        ]
        if self.exact is not None:
            lines.append(
                f"(b) with exact tracking the puppets differ by "
                f"{number(self.exact.deviation.max_puppet)} (m, rad) at rtol "
                f"{self.exact.setting:g}, up to {self.first_impact:.3g} s"
            )
        if self.catches:
            lines.append(
                f"(b) at a catch they differ as the drives' inertia to the power "
                f"{self.catch_order:.2f}"
            )
        if self.tracking:
            power = self.bandwidth_order
            lines.append(
                f"(c) with real tracking they differ as the bandwidth to the power {power:.2f}"
                if np.isfinite(power)
                else "(c) the drives' tracking error has no effect on the puppet"
            )
        if self.heavy_strings:
            heavy = self.heavy_strings[-1]
            last = heavy.tracking[-1]
            lines.append(
                f"(c) with {heavy.string} of {number(heavy.mass)} kg they stay "
                f"{number(last.deviation.max_puppet)} (m, rad) apart at {last.bandwidth:.3g} rad/s"
            )
        if self.file_drives is not None:
            apart = number(self.file_drives.deviation.max_puppet)
            lines.append(f"(c) on the file's own drives they differ by {apart} (m, rad)")
        return lines + [f"not measured: {line}" for line in self.missing]

    def tables(self) -> list[Table]:
        """The tables of the measurements, in order."""
        claims = tuple((c.text, VERDICT_WORDS[c.holds], c.evidence) for c in self.reduction.claims)
        tables = [Table(STRUCTURE, "", ("claim", "", "evidence"), claims)]
        if self.comparisons:
            tables.append(self._exact_table())
        if self.catches:
            tables.append(self._catch_table())
        if self.tracking:
            tables.append(self._bandwidth_table())
        if self.heavy_strings:
            tables.append(self._heavy_string_table())
        if self.file_drives is not None:
            tables.append(_file_drives_table(self.file_drives))
        return tables

    def _exact_table(self) -> Table:
        text = (
            "The full model's drives are moved by the forces of exact tracking, the mixed model's "
            "effort plus the drive's inertia times acc_K, without feedback. Largest difference of "
            f"a coordinate up to {self.first_impact:.3g} s of {self.duration:.3g} s; both models "
            "use the same method."
        )
        lines = tuple(
            (
                c.method,
                f"rtol {c.setting:g}" if c.method == "event" else f"{1e3 * c.setting:.2f} ms",
                *_number_pair(c.deviation.max_puppet, c.deviation.max_mechanism),
            )
            for c in self.comparisons
        )
        return Table(EXACT, text, ("method", "setting>", "puppet>", "drives>"), lines)

    def _catch_table(self) -> Table:
        text = (
            f"The puppet is tossed; {self.catches[0].string} catches first. In the mixed model v_K "
            "is continuous there, while a drive takes part of the impulse. Jump of v_D: difference "
            "from the mixed model's, relative to it, in the metric of M_DD."
        )
        lines = tuple(
            (
                f"{c.ratio:g}",
                number(c.impulse, 6),
                number(abs(1.0 - c.impulse / c.mixed_impulse)),
                number(c.jump),
                number(c.after),
            )
            for c in self.catches
        )
        header = (
            "drive / puppet>",
            "impulse [N s]>",
            "less than the mixed model's, relative>",
            "jump of v_D>",
            "puppet later (m, rad)>",
        )
        return Table(CATCHES, text, header, lines)

    def _bandwidth_table(self) -> Table:
        text = (
            "Drives with computed-torque control, which knows the drive but not the strings, "
            "follow the same inputs. A steady pull causes a lag of pull / (J w^2)."
        )
        lines = tuple(
            (
                f"{t.bandwidth:.4g}",
                *_number_pair(t.deviation.max_puppet, t.deviation.max_mechanism),
                t.deviation.status,
            )
            for t in self.tracking
        )
        header = ("bandwidth [rad/s]>", "puppet (m, rad)>", "drives (m, rad)>", "")
        n = 4 if any(t.deviation.status for t in self.tracking) else 3
        return Table(BANDWIDTH, text, header[:n], tuple(line[:n] for line in lines))

    def _heavy_string_table(self) -> Table:
        heavy = self.heavy_strings
        text = (
            f"{heavy[0].string} is a chain of point masses between stiff springs. Differences of "
            "the puppet from the massless mixed model, each motion relative to its own rest (m, "
            "rad). M_DK of a straight string of that mass, relative to sqrt(M_DD M_KK)."
        )
        speeds = [f"at {t.bandwidth:.4g} rad/s>" for t in heavy[0].tracking]
        lines = tuple(
            (
                *_number_pair(m.mass, m.coupling),
                *(number(t.deviation.max_puppet) for t in m.tracking),
                number(m.exact.max_puppet),
            )
            for m in heavy
        )
        header = ("string [kg]>", "M_DK, relative>", *speeds, "exact tracking>")
        return Table(HEAVY_STRING, text, header, lines)


def _file_drives_table(found: FileDrives) -> Table:
    apart = found.deviation
    text = (
        "The same motion as commands of the drives that the file describes. The puppet differs by "
        f"up to {number(apart.max_puppet)} (m, rad) from the mixed model, each motion relative to "
        "its own rest." + (f" The run stopped: {apart.status}." if apart.status else "")
    )
    lines = tuple(
        (name, *_number_pair(found.lag[0, k], np.max(found.lag[:, k])), number(found.force[k]))
        for k, name in enumerate(found.drives)
    )
    header = ("drive", "lag at rest (m, rad)>", "largest lag>", "largest force [N, N m]>")
    return Table(FILE_DRIVES, text, header, lines)


def _number_pair(first: float, second: float) -> tuple[str, str]:
    return number(first), number(second)


def number(value: float, digits: int = 2) -> str:
    """A number as a short text."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.{digits}g}" if 1e-3 <= abs(value) < 1e5 or value == 0 else f"{value:.1e}"


def wrap_paragraph(text: str) -> str:
    """A paragraph in lines of at most 100 characters."""
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)
