"""The plots of a reduction report."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from benchmarks.section_vi.bandwidth import TrackingRun
from benchmarks.section_vi.exact import Comparison, SharedCatch
from benchmarks.section_vi.heavy_string import HeavyString

from fantoccini.base.arrays import Array
from fantoccini.output.view.curves import Curve, Panel, draw_panels, power_law

EXACT, CATCHES, BANDWIDTH, HEAVY_STRING = (
    "Exact tracking",
    "Catches",
    "Bandwidth",
    "A string with mass",
)
PICTURES = {
    EXACT: "exact_tracking.png",
    CATCHES: "catches.png",
    BANDWIDTH: "bandwidth.png",
    HEAVY_STRING: "string_mass.png",
}
"""Title of a section -> file of its picture."""
_DIFFERENCE = "largest difference [m or rad]"


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurements:
    """The measurements of parts (b) and (c); each is empty if it was impossible.

    Attributes:
        comparisons: (b) both models with exact tracking.
        catches: (b) the first catch of a toss, with increasingly heavy drives.
        tracking: (c) drives of increasing bandwidth.
        heavy_strings: (c) a string with mass, on such drives.
    """

    comparisons: tuple[Comparison, ...] = ()
    catches: tuple[SharedCatch, ...] = ()
    tracking: tuple[TrackingRun, ...] = ()
    heavy_strings: tuple[HeavyString, ...] = ()


class _Line(NamedTuple):
    """Measured points (n,); or, with an order, the line y ~ x^order next to them."""

    label: str
    x: Array
    y: Array
    order: float | None = None
    marked: bool = True


class _Chart(NamedTuple):
    title: str
    x: str
    y: str
    lines: list[_Line]
    log_x: bool = True


def draw(
    measured: Measurements,
    folder: Path,
    prefix: str = "",
    chosen: Container[str] = frozenset(PICTURES),
) -> list[Path]:
    """Writes the plots of the measurements into a folder.

    Args:
        measured: the data.
        folder: an existing one.
        prefix: prefix of the files' names.
        chosen: titles of sections, keys of ``PICTURES``.

    Returns:
        The files.
    """
    files = []
    for title, charts in _charts(measured).items():
        if not charts or title not in chosen:
            continue
        panels = []
        for chart in charts:
            drawn = [
                Curve(line.label, line.x, line.y, line.marked)
                if line.order is None
                else power_law(line.label, line.x, line.y, line.order)
                for line in chart.lines
            ]
            panels.append(Panel(chart.title, chart.x, chart.y, drawn, chart.log_x))
        files.append(draw_panels(panels, folder / (prefix + PICTURES[title])))
    return files


def _charts(measured: Measurements) -> dict[str, list[_Chart]]:
    """Title of a section -> its charts; none if nothing was measured."""
    heavy, tracking = measured.heavy_strings, measured.tracking
    puppet = _over_bandwidth("puppet", tracking)
    drives = np.array([t.deviation.max_mechanism for t in tracking])
    massless = [puppet._replace(label="massless strings")] if tracking else []
    square = [puppet._replace(label="1 / bandwidth^2", order=-2.0)] if tracking else []
    lines = [_over_bandwidth(f"{m.mass:.2g} kg", m.tracking) for m in heavy]
    x = "bandwidth of the drives [rad/s]"
    real = _Chart(
        "Real tracking", x, _DIFFERENCE, [puppet, _Line("drives", puppet.x, drives), *square]
    )
    return {
        EXACT: _exact(measured.comparisons),
        CATCHES: _catches(measured.catches),
        BANDWIDTH: [real] if tracking else [],
        HEAVY_STRING: [
            _Chart(f"{m.string} with mass", x, _DIFFERENCE, [*massless, *lines, *square])
            for m in heavy[:1]
        ],
    }


def _exact(comparisons: Sequence[Comparison]) -> list[_Chart]:
    by_events = [
        _Line(
            f"rtol {c.setting:g}",
            c.deviation.t,
            np.maximum.accumulate(c.deviation.puppet),
            marked=False,
        )
        for c in comparisons
        if c.method == "event"
    ]
    if not by_events:
        return []
    title = "Exact tracking, event-driven"
    charts = [_Chart(title, "up to [s]", _DIFFERENCE, by_events, log_x=False)]
    by_steps = []
    for method in dict.fromkeys(c.method for c in comparisons if c.method != "event"):
        runs = [c for c in comparisons if c.method == method]
        x = np.array([1e3 * c.setting for c in runs])
        y = np.array([c.deviation.max_puppet for c in runs])
        order = 1.0 if method == "timestepping" else 2.0
        by_steps += [_Line(method, x, y), _Line("", x, y, order)]
    if by_steps:
        title = "Fixed steps; dashed: orders 1 and 2"
        charts.append(_Chart(title, "step [ms]", _DIFFERENCE, by_steps))
    return charts


def _catches(catches: Sequence[SharedCatch]) -> list[_Chart]:
    ratio = np.array([c.ratio for c in catches])
    jump = np.array([c.jump for c in catches])
    lines = [
        _Line("jump of v_D, relative", ratio, jump),
        _Line("puppet later, m or rad", ratio, np.array([c.after for c in catches])),
        _Line("1 / inertia", ratio, jump, -1.0),
    ]
    x, y = "mass of a drive / mass of the puppet", "difference from the mixed model"
    return [_Chart(f"A catch of {c.string}", x, y, lines) for c in catches[:1]]


def _over_bandwidth(label: str, runs: Sequence[TrackingRun]) -> _Line:
    w = np.array([t.bandwidth for t in runs])
    return _Line(label, w, np.array([t.deviation.max_puppet for t in runs]))
