"""Numbers that Python and compiled code compare with: one value, one meaning."""

from __future__ import annotations


class Constant(float):
    """A number with a unit and a meaning."""

    unit: str
    meaning: str

    def __new__(cls, value: float, unit: str, meaning: str) -> Constant:
        made = super().__new__(cls, value)
        made.unit = unit
        made.meaning = meaning
        return made


TENSION_CAP = Constant(
    1e5, "1", "largest tension relative to the weight: beyond it the input is impossible"
)
CLOSED_GAP = Constant(
    5e-13, "1", "-h up to which a row is closed, relative to its string's length or to 1"
)
START_GAP = Constant(1e-9, "1", "the same where a run begins, which brings the row to h = 0")
REST_SPEED = Constant(
    1e-5,
    "m/s or rad/s",
    "hdot up to which a closed row is at rest, times the largest velocity if that is above 1",
)
LEAST_LENGTH = Constant(1e-3, "m", "lower bound of the length by which a string's gap is divided")
WINCH_DECELERATION = Constant(1.0, "m/s^2", "of a winch that rewinds, before it stops")
HULL_VERTICES = Constant(128.0, "1", "most vertices of a convex polytope that touches something")

CONSTANTS: dict[str, Constant] = {
    "tension_cap": TENSION_CAP,
    "closed_gap": CLOSED_GAP,
    "start_gap": START_GAP,
    "rest_speed": REST_SPEED,
    "least_length": LEAST_LENGTH,
    "winch_deceleration": WINCH_DECELERATION,
    "hull_vertices": HULL_VERTICES,
}
"""By their names in C++."""
