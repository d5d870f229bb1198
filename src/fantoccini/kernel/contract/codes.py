"""Enumerations shared by Python and C++; ``errors.Status`` is another one.

A row is a string or a joint limit; a winch changes the length of a string.
"""

from __future__ import annotations

import enum

from fantoccini.base import Status


class Code(enum.IntEnum):
    """Base of enumerations whose members carry their meaning."""

    meaning: str

    def __new__(cls, value: int, meaning: str = "") -> Code:
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member


class EventCode(Code):
    """Kind of an event."""

    CATCH = 0, "a slack string became taut, or a limit was reached"
    RELEASE = 1, "a string went slack, or a limit was left"
    ACCUMULATION = 2, "infinitely many catches were treated as one"
    BREAKPOINT = 3, "the inputs' acceleration may jump"
    SLIP = 4, "the winch began to slip"
    GRIP = 5, "the winch grips again"
    LOST_STEP = 6, "a stepper motor lost a step"
    RAN_AWAY = 7, "a drive ran away"
    TOUCH = 8, "two solids came into contact"
    LIFT = 9, "two solids separated"
    STICK = 10, "two solids that touch stopped sliding"
    SLIDE = 11, "two solids that touch began to slide"


class Hold(Code):
    """Mode of a row between two events."""

    SLACK = 0, "inactive, without force"
    HELD = 1, "active"
    IDLE = 2, "active without tension: linearly dependent on the held rows"
    PINNED = 3, "active at its winch's largest tension, linearly dependent"
    SLIPPING = 4, "pulls with its winch's largest tension while the winch slips"


class SolidKind(Code):
    """Kinds of solids."""

    SEGMENT = 0, "from a to b, inflated by the radius; if half[0] > 0, the ellipsoid in it"
    BOX = 1, "centre a, axes the columns of R, half edges, inflated by the radius"
    HALF_SPACE = 2, "below the plane through a with the normal b"
    HULL = 3, "convex polytope `hull`: its origin a, axes the columns of R, inflated by the radius"


class GoalKind(Code):
    """Kinds of goals."""

    UNKNOWN = 0, "evaluated in Python"
    POSE = 1, "every dynamic coordinate with a weight lies between low and high"
    POINT = 2, "a point of a link lies in the box from place to place_high"


class Solved(Code):
    """Outcome of a complementarity solve."""

    YES = 0, "solved"
    INFEASIBLE = 1, "there is no solution"
    UNSETTLED = 2, "the bound on iterations was reached"
    TOO_LARGE = 3, "more rows than the puppet has, or not enough memory"


class ReachEnd(Code):
    """Outcome of a search for the hanging pose nearest to targets."""

    REACHED = 0, "the targets are reached within the tolerance"
    NEAREST = 1, "no neighbouring hanging pose is nearer"
    STALLED = 2, "no step reduced the distance, or the bound on iterations was reached"
    LOST = 3, "there is no equilibrium at the start of the search"
    TIPS = 4, "nearer poses are not stable equilibria"


class StepEdge(Code):
    """Reasons, as bits, why a step is not smooth; from LAW_CHANGED on it has no derivative."""

    WITHOUT_FORCE = 1, "a point touches without force"
    STRAINED = 2, "a point sticks at the edge of its cone"
    REBOUND_BEGINS = (
        4,
        "a point would rebound if faster, or is not the only one that touches first",
    )
    NOT_SMOOTH = 8, "the position of a point has no derivative"
    SLIDES_ELSEWHERE = 16, "a point touches without force, and slides in another direction"
    LAW_CHANGED = (
        32,
        (
            "bodies are wedged in, restitution is scaled down to add no energy, or points "
            "rebound one after the other"
        ),
    )
    JAMS = 64, "friction jams: no forces keep the modes"
    OPEN_SHARES = 128, "solids slide on so many points that their forces are not unique"
    TOO_MANY_POINTS = 256, "there are more points with force than a step allows"

    @classmethod
    def meanings(cls, bits: int) -> tuple[str, ...]:
        """The meanings of the bits that are set."""
        return tuple(edge.meaning for edge in cls if bits & edge)


CODES: tuple[type[Code] | type[Status], ...] = (
    Status,
    EventCode,
    Hold,
    SolidKind,
    GoalKind,
    Solved,
    ReachEnd,
    StepEdge,
)
"""All codes."""

SCOPED = (Solved, ReachEnd)
"""Enumerations that are scoped in C++."""
