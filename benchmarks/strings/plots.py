"""Common style of the report's pictures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from . import ROOT

PICTURES = ROOT / "docs" / "pictures"

COLOUR = {
    "event": "#1f4e8c",
    "event, fixed steps": "#6fa3dc",
    "timestepping": "#2f8f5b",
    "MuJoCo, default": "#b03a2e",
    "MuJoCo, stiffest": "#e08a5b",
    "MuJoCo, overdamped": "#d9b23c",
    "penalty": "#7a5aa6",
    "Baumgarte": "#8a8a8a",
    "Baumgarte with impulse": "#202020",
}
"""One colour for each method, in every picture."""

STYLE = {
    "figure.dpi": 150,
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.5,
    "legend.frameon": False,
    "savefig.bbox": "tight",
    "svg.hashsalt": "strings",
}


@contextmanager
def picture(name: str, columns: int = 1, height: float = 3.6) -> Iterator:
    """Axes to draw on; the file appears at the end of the block.

    Args:
        name: name of the file in docs/pictures.
        columns: panels side by side.
        height: [inch].
    """
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, columns, figsize=(4.6 * columns + 0.8, height))
        yield axes
        figure.tight_layout(w_pad=2.5)
        figure.savefig(Path(PICTURES, name), metadata={"Software": None})
        plt.close(figure)
