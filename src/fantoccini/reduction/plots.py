"""The report's plots."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fantoccini.reduction.report import ReductionReport

PICTURES = {
    "Exact tracking": "exact_tracking.png",
    "Catches": "catches.png",
    "Bandwidth": "bandwidth.png",
    "A string with mass": "string_mass.png",
}
"""Title of a section -> file of its picture."""
_APART = "largest difference [m or rad]"


def draw(
    report: ReductionReport,
    folder: Path,
    prefix: str = "",
    chosen: Container[str] = frozenset(PICTURES),
) -> list[Path]:
    """Writes the plots of what was measured into a folder.

    Args:
        report: the figures.
        folder: that exists.
        prefix: of the files' names.
        chosen: titles of sections, keys of ``PICTURES``.

    Returns:
        The files.
    """
    from fantoccini.view.curves import Curve, Panel, curves, slope

    made = {}
    event = [c for c in report.compared if c.method == "event"]
    fixed = [c for c in report.compared if c.method != "event"]
    if event:
        times = [
            Curve(f"rtol {c.step:g}", c.t, np.maximum.accumulate(c.puppet), marked=False)
            for c in event
        ]
        panels = [Panel("Exact tracking, event-driven", "up to [s]", _APART, times, log_x=False)]
        steps = []
        for method in dict.fromkeys(c.method for c in fixed):
            points = [(1e3 * c.step, c.worst[0]) for c in fixed if c.method == method]
            x, y = zip(*points, strict=True)
            steps += [Curve(method, x, y)]
            steps += [slope("", x, y, 1.0 if method == "timestepping" else 2.0)]
        if steps:
            panels.append(
                Panel("Fixed steps; dashed: orders 1 and 2", "step [ms]", _APART, steps)
            )
        made["Exact tracking"] = panels
    if report.caught:
        ratio = [c.ratio for c in report.caught]
        jump = [c.jump for c in report.caught]
        later = [c.after for c in report.caught]
        made["Catches"] = [Panel(
            f"A catch of {report.caught[0].string}", "mass of a drive / mass of the puppet",
            "difference from the mixed model",
            [Curve("jump of v_D, relative", ratio, jump), Curve("puppet later, m or rad", ratio,
             later), slope("1 / inertia", ratio, jump, -1.0)],
        )]  # fmt: skip
    if report.tracked:
        made["Bandwidth"] = [_bandwidth(report, False)]
    if report.massive:
        made["A string with mass"] = [_bandwidth(report, True)]
    return [
        curves(panels, folder / (prefix + PICTURES[title]))
        for title, panels in made.items()
        if title in chosen
    ]


def _bandwidth(report: ReductionReport, massive: bool):
    from fantoccini.view.curves import Curve, Panel, slope

    w = [t.bandwidth for t in report.tracked]
    away = [t.worst[0] for t in report.tracked]
    shown = [Curve("massless strings" if massive else "puppet", w, away)] if w else []
    if massive:
        for m in report.massive:
            x = [t.bandwidth for t in m.tracked]
            shown.append(Curve(f"{m.mass:.2g} kg", x, [t.worst[0] for t in m.tracked]))
        title = f"{report.massive[0].string} with mass"
    else:
        shown.append(Curve("drives", w, [t.worst[1] for t in report.tracked]))
        title = "Real tracking"
    if w:
        shown.append(slope("1 / bandwidth^2", w, away, -2.0))
    return Panel(title, "bandwidth of the drives [rad/s]", _APART, shown)
