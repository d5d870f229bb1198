"""Steps of the bundled marionette, as waypoints of its strings' ends.

The puppet is let down until its feet carry a third of it. In every step the ends of the shoulders'
strings sway to one side, the knee's string there lifts its leg, carries it forward and sets it
down, and the body follows. All moves have minimum jerk.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from fantoccini.base import UnknownNameError, check_positive
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State

_SIDES = (("left", 1.0), ("right", -1.0))
_BRIEF = 0.02
"""Shortest move [s]."""
_SET_BACK = 0.15
"""Share of a step in which a knee that went too far comes back."""

Waypoints = dict[str, list[tuple[float, float]]]


@dataclass(frozen=True)
class Gait:
    """Numbers of a walk; shares are of a step's time and may reach into the steps beside it.

    With the default ones ``promenade`` walks in a cycle whose feet slip by less than a millimetre a
    step (docs/optimal.md). ``fan.tune`` finds others: ``fan.tune(stage, lambda v:
    Gait(**v).inputs(stage, 20), {...}, cost, t_end=25.0)``.

    Attributes:
        stride: way of the body in a step; a foot goes twice as far [m].
        duration: of a step [s].
        lower: how far shoulders and head are let down from where the stage hangs [m].
        nod: how much farther the head [m].
        lean: how far the head's string is carried forward [m].
        slack: let out of the knees' strings; below 0 counts as 0 [m].
        ahead, apart: how far the knees' strings are carried forward and outward [m].
        lift: how far a knee's string is pulled up, beside what is let out [m].
        lifts, highest, lands: shares at which it leaves, is up and is down again.
        swings, arrives: shares between which it goes forward.
        beyond: overshoot of the knee's string, which then comes back [m].
        sway: of shoulders and head to the side of the foot that is lifted; below 0 to the other
            side [m].
        sways, swayed: start and end of the sway, as shares.
        follows, followed: start and end of the body's way, as shares.

    Raises:
        ValueError: the duration is not above 0.
    """

    stride: float = 0.02
    duration: float = 1.2
    lower: float = 0.004419
    nod: float = 0.002408
    lean: float = -0.001381
    slack: float = 0.003688
    ahead: float = -0.002969
    apart: float = 0.014247
    lift: float = 0.037766
    lifts: float = 0.032218
    highest: float = 0.234733
    lands: float = 0.72
    swings: float = 0.144954
    arrives: float = 0.671086
    beyond: float = 0.007946
    sway: float = 0.005632
    sways: float = -0.15878
    swayed: float = 0.267431
    follows: float = 0.18774
    followed: float = 0.939863

    def __post_init__(self) -> None:
        check_positive(duration=self.duration)

    def inputs(self, stage: Marionette, steps: int, x0: State | None = None) -> Input:
        """The motion of so many steps, after one step's time to get ready.

        Args:
            stage: a marionette, or a scene of one, that has the bundled one's strings.
            steps: how many; the left foot goes first, the last one closes up.
            x0: where it begins; ``stage.rest()`` when not given.

        Raises:
            UnknownNameError: the stage has other driven coordinates.
            ValueError: fewer than two steps.
        """
        if steps < 2:
            raise ValueError(f"steps is {steps!r}; at least 2 are needed, the second closes up")
        x0, known = stage.rest() if x0 is None else x0, stage.coordinates.q_K
        for name in ("head.x", "head.length", "knee_left.x", "knee_right.length"):
            if name not in known:
                raise UnknownNameError("driven coordinate", name, known)
        return Input.waypoints(stage, self.waypoints(x0, steps))

    def waypoints(self, x0: State, steps: int) -> Waypoints:
        """(time, value) of every string's end that moves, from those of a state on."""
        moves = _Moves(x0)
        first, D = x0.t + self.duration, self.duration
        for side, sign in _SIDES:
            moves.by(f"shoulder_{side}.length", x0.t, first, self.lower)
            moves.by(f"knee_{side}.length", x0.t, first, max(self.slack, 0.0))
            moves.by(f"knee_{side}.x", x0.t, first, self.ahead)
            moves.by(f"knee_{side}.y", x0.t, first, sign * self.apart)
        moves.by("head.x", x0.t, first, self.lean)
        moves.by("head.length", x0.t, first, self.lower + self.nod)
        body = ("head", "shoulder_left", "shoulder_right")
        for step in range(steps):
            side, sign = _SIDES[step % 2]
            # The first step and the last are half as long; the sway begins in the middle.
            half = 0.5 if step in (0, steps - 1) else 1.0
            sway = (2.0 if step else 1.0) * sign * self.sway

            def at(share: float, step: int = step) -> float:
                return first + D * (step + share)

            for name in body:
                moves.by(f"{name}.y", at(self.sways), at(self.swayed), sway)
            for name in (*body, "hand_left", "hand_right"):
                moves.by(f"{name}.x", at(self.follows), at(self.followed), half * self.stride)
            up = self.lift + max(self.slack, 0.0)
            moves.by(f"knee_{side}.length", at(self.lifts), at(self.highest), -up)
            moves.by(f"knee_{side}.length", at(self.highest), at(self.lands), up)
            far = 2.0 * half * self.stride + self.beyond
            moves.by(f"knee_{side}.x", at(self.swings), at(self.arrives), far)
            moves.by(f"knee_{side}.x", at(self.arrives), at(self.arrives + _SET_BACK), -self.beyond)
        start, end = (first + D * (steps + share) for share in (self.sways, self.swayed))
        for name in body:
            moves.by(f"{name}.y", start, end, moves.back(f"{name}.y"))
        return dict(moves.points)


class _Moves:
    """Waypoints as they grow.

    Args:
        x0: where all begins.
    """

    def __init__(self, x0: State) -> None:
        self._x0 = x0
        self.points: Waypoints = defaultdict(list)

    def by(self, name: str, start: float, end: float, way: float) -> None:
        """Moves a coordinate on by ``way`` [m] between two times [s], or later."""
        points = self.points[name]
        if not points:
            points.append((self._x0.t, float(self._x0[name])))
        t, value = points[-1]
        start = max(start, t)
        if start > t:
            points.append((start, value))
        points.append((max(end, start + _BRIEF), value + way))

    def back(self, name: str) -> float:
        """Distance of a coordinate from its start [m]."""
        points = self.points[name]
        return points[0][1] - points[-1][1]
