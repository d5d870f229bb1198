"""Texts of G-code that all controllers share: units, numbers, and the title of a file."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array
from fantoccini.stand.axes import Axis
from fantoccini.stand.points import SetPoints


def gcode_units(axes: tuple[Axis, ...]) -> Array:
    """(n,) units of G-code per unit of the axes: mm per m, or degrees per rad."""
    return np.array([1000.0 if axis.unit == "m" else np.degrees(1.0) for axis in axes])


def title_lines(points: SetPoints) -> list[str]:
    """Comment lines: the stand, the size of the motion and the warning, if there is one."""
    name, seconds = points.map.stand.name, points.motion.t[-1]
    lines = [f"; {name}: {len(points)} set points in {seconds:.3f} s"]
    return [*lines, f"; warning: {points.warning}"] if points.warning else lines


def with_decimals(value: float, decimals: int) -> str:
    """A number with at most this many decimals, without zeros at its end."""
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def with_significant_digits(value: float, digits: int) -> str:
    """A positive number with this many significant digits, without exponent."""
    before = int(np.floor(np.log10(value))) + 1 if value > 0.0 else 1
    return with_decimals(value, max(0, digits - max(before, 1)))
