"""Thresholds and limits that Python and compiled code share.

A row is a string or a joint limit with its gap h <= 0, path length minus string length.
"""

from __future__ import annotations


class Constant(float):
    """A number with a unit and a meaning."""

    unit: str
    meaning: str

    def __new__(cls, value: float, unit: str, meaning: str) -> Constant:
        constant = super().__new__(cls, value)
        constant.unit = unit
        constant.meaning = meaning
        return constant


TENSION_CAP = Constant(
    1e5, "1", "largest tension relative to the weight; above it, the input is impossible"
)
CLOSED_GAP = Constant(
    5e-13, "1", "largest -h of a closed row, relative to its string's length or to 1"
)
START_GAP = Constant(1e-9, "1", "largest -h of a row that a run's start sets to h = 0, likewise")
REST_SPEED = Constant(
    1e-5,
    "m/s or rad/s",
    "largest hdot of a closed row at rest, times the largest velocity if that is above 1",
)
MIN_SCALE_LENGTH = Constant(
    1e-3, "m", "lower bound of the length by which a string's gap is divided"
)
WINCH_DECELERATION = Constant(1.0, "m/s^2", "deceleration of a rewinding winch before it stops")
HULL_VERTICES = Constant(128.0, "1", "largest number of vertices of a polytope in contact")

CONSTANTS: dict[str, Constant] = {
    "tension_cap": TENSION_CAP,
    "closed_gap": CLOSED_GAP,
    "start_gap": START_GAP,
    "rest_speed": REST_SPEED,
    "min_scale_length": MIN_SCALE_LENGTH,
    "winch_deceleration": WINCH_DECELERATION,
    "hull_vertices": HULL_VERTICES,
}
"""Name in C++ -> constant."""
