"""The report page: a table of all targets, then the measurements by section."""

from __future__ import annotations

from ..speed.figures import Chapter, goals_table
from ..speed.programs import flags
from ..strings.report import Table, machine, wrap_paragraph

OPENING = (
    "After this page you know the cost and the accuracy of [contact](contact.md), compared with "
    "MuJoCo on the same scenes. `make stage-report` measures everything in one run and writes "
    "this page. Compared programs are timed in turn, and ratios are computed turn by turn, so "
    "the ratios are more reliable than the times of this one machine. Every figure is the "
    "median, with the minimum and the maximum."
)


def page(chapters: list[Chapter]) -> str:
    """All of it as Markdown."""
    computer = machine(("numpy", "casadi", "mujoco"))
    table = Table(computer.header, [*computer.rows, ["compiler's flags", " ".join(flags())]])
    parts = [
        "# Contact, measured",
        wrap_paragraph(OPENING),
        goals_table(chapters).markdown(),
        table.markdown(),
        *(chapter.section.markdown() for chapter in chapters),
    ]
    return "\n\n".join(parts) + "\n"
