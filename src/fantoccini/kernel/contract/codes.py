"""Numbers with a meaning in both languages; ``errors.Status`` is one more of them."""

from __future__ import annotations

import enum

from fantoccini.base import Status


class Code(enum.IntEnum):
    """A number with a meaning."""

    meaning: str

    def __new__(cls, value: int, meaning: str = "") -> Code:
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member


class EventCode(Code):
    """What happened to a row or a drive."""

    CATCH = 0, "a slack string came taut, or a limit was reached"
    RELEASE = 1, "a string went slack, or a limit was left"
    ACCUMULATION = 2, "infinitely many catches were taken as one"
    BREAKPOINT = 3, "the inputs may jump in acceleration"
    SLIP = 4, "the winch began to slip"
    GRIP = 5, "the winch grips again"
    LOST_STEP = 6, "a stepper motor lost a step"
    RAN_AWAY = 7, "a drive ran away"
    TOUCH = 8, "two solids came into contact"
    LIFT = 9, "two solids parted"
    STICK = 10, "two solids that touch stopped sliding"
    SLIDE = 11, "two solids that touch began to slide"


class Hold(Code):
    """What a row does between two events."""

    SLACK = 0, "no force"
    HELD = 1, "active"
    IDLE = 2, "redundant: depends on the held rows, active without tension"
    PINNED = 3, "redundant, at its winch's largest tension"
    SLIPPING = 4, "pulls with its winch's largest tension while the winch slips"


class SolidKind(Code):
    """Kinds of solids."""

    SEGMENT = 0, "from a to b, inflated by the radius; with half[0] > 0 the ellipsoid in it"
    BOX = 1, "centre a, axes the columns of R, half edges, inflated by the radius"
    HALF_SPACE = 2, "below the plane through a with the normal b"
    HULL = 3, "convex polytope `hull`: its origin a, axes the columns of R, inflated by the radius"


class GoalKind(Code):
    """Kinds of goals."""

    UNKNOWN = 0, "evaluated in Python"
    POSE = 1, "every dynamic coordinate with a weight lies between low and high"
    POINT = 2, "a point of a link lies in the box from place to place_high"


class Solved(Code):
    """How a complementarity solve ended."""

    YES = 0, "solved"
    INFEASIBLE = 1, "there is no solution"
    UNSETTLED = 2, "the bound on iterations was reached"
    NO_ROOM = 3, "more rows than the puppet has, or no memory"


class ReachEnd(Code):
    """How a search for the pose nearest to places ended."""

    REACHED = 0, "it is there, within the tolerance"
    NEAREST = 1, "no hanging pose near by is nearer"
    STALLED = 2, "no step came nearer any more, or the iterations ended first"
    LOST = 3, "the puppet does not hang where it was to begin"
    TIPS = 4, "any nearer, no pose that hangs stably is found"


class StepEdge(Code):
    """What a fixed step is on the edge of, as bits; from LEAVES_LAW on it has no derivative."""

    WITHOUT_FORCE = 1, "a point touches without force"
    STRAINED = 2, "a point sticks at the edge of its cone"
    MAY_REBOUND = (
        4,
        ("a point springs back if it is any faster, or is not the only one that touches first"),
    )
    NOT_SMOOTH = 8, "the place of a point has no derivative"
    ASKEW = 16, "a point touches without force, and slides askew of those that push"
    LEAVES_LAW = (
        32,
        (
            "bodies are wedged in, restitution is scaled down to add no energy, or points spring "
            "back one after the other"
        ),
    )
    JAMS = 64, "friction jams: no forces keep the modes"
    OPEN_SHARES = 128, "solids slide on more points than the law can share force among"
    CROWDED = 256, "more points push than there is room for"

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
"""Codes whose members are qualified by the code's name in C++."""
