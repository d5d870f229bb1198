"""Numbers that stand for something in both languages; ``errors.Status`` is one more of them."""

from __future__ import annotations

import enum

from fantoccini.errors import Status


class Code(enum.IntEnum):
    """A number with a meaning."""

    meaning: str

    def __new__(cls, value: int, meaning: str) -> Code:
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member


class EventCode(Code):
    """What happened to a row or a drive."""

    CATCH = 0, "it came taut"
    RELEASE = 1, "it fell slack"
    ACCUMULATION = 2, "catches without end were taken as one"
    BREAKPOINT = 3, "the inputs may jump in acceleration"
    SLIP = 4, "its winch began to slip"
    GRIP = 5, "its winch grips again"
    LOST_STEP = 6, "a stepper lost a step"
    RUNAWAY = 7, "a drive ran away"


class Hold(Code):
    """What a row does between two events."""

    SLACK = 0, "nothing"
    HELD = 1, "it holds"
    IDLE = 2, "it depends on the held ones and holds with them, at no tension"
    PINNED = 3, "likewise, at its winch's largest tension"
    SLIPPING = 4, "it pulls with its winch's largest tension and gives way"


class SolidKind(Code):
    """Kinds of solids."""

    SEGMENT = 0, "from a to b, swollen by the radius; with half[0] > 0 the ellipsoid in it"
    BOX = 1, "centre a, axes the columns of R, half edges, swollen by the radius"
    HALF_SPACE = 2, "below the plane through a with the normal b"


class GoalKind(Code):
    """Kinds of goals."""

    UNKNOWN = 0, "only Python can tell"
    POSE = 1, "every dynamic coordinate with a weight lies between low and high"
    POINT = 2, "a point of a link lies in the box from place to place_high"


class Solved(Code):
    """How a complementarity problem ended."""

    YES = 0, "solved"
    INFEASIBLE = 1, "there is no solution"
    UNSETTLED = 2, "the bound on rounds was met"
    NO_ROOM = 3, "more rows than the puppet has, or no memory"


CODES: tuple[type[enum.IntEnum], ...] = (Status, EventCode, Hold, SolidKind, GoalKind, Solved)
"""All codes."""

SCOPED = (Solved,)
"""Those whose names need their code's name before them in C++."""
