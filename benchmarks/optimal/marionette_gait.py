"""Gait of the bundled marionette with twenty numbers, as waypoints of its strings' ends.

The puppet is lowered until its feet carry a third of its weight. In every step the ends of the
shoulders' strings sway to one side, the knee's string there lifts its leg, carries it forward and
sets it down, and the body follows. All moves have minimum jerk.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from fantoccini.base import UnknownNameError, check_positive
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State

_SIDES = (("left", 1.0), ("right", -1.0))
_MIN_TIME = 0.02
"""Least duration of a move [s]."""
_RETURN_SHARE = 0.15
"""Share of a step in which a knee returns from its overshoot."""

Waypoints = dict[str, list[tuple[float, float]]]


@dataclass(frozen=True)
class MarionetteGait:
    """Parameters of a walk; shares are of a step's time and may extend into adjacent steps.

    With the default values ``promenade`` walks in a cycle whose feet slip by less than a millimetre
    per step (docs/optimal-measured.md). ``fan.tune`` finds others: ``fan.tune(stage, lambda v:
    MarionetteGait(**v).inputs(stage, 20), {...}, cost, t_end=25.0)``.

    Attributes:
        stride: distance of the body in a step; a foot goes twice as far [m].
        duration: duration of a step [s].
        lower: distance by which shoulders and head are lowered from the stage's rest [m].
        nod: additional distance by which the head is lowered [m].
        lean: distance by which the head's string is carried forward [m].
        slack: length let out of the knees' strings; below 0 counts as 0 [m].
        ahead, apart: distances by which the knees' strings are carried forward and outward [m].
        lift: length by which a knee's string is pulled up, in addition to the slack [m].
        lifts, highest, lands: shares at which a knee leaves, is highest and is down again.
        swings, arrives: shares between which a knee goes forward.
        beyond: overshoot of the knee's string, which then returns [m].
        sway: distance of shoulders and head towards the side of the lifted foot; below 0 to the
            other side [m].
        sways, swayed: start and end of the sway, as shares.
        follows, followed: start and end of the body's motion, as shares.

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
        """Motion of several steps, after one step's time of preparation.

        Args:
            stage: a marionette, or a scene of one, with the strings of the bundled one.
            steps: number of steps; the left foot goes first, the last step closes up.
            x0: state at the start; ``stage.rest()`` by default.

        Raises:
            UnknownNameError: the stage has other driven coordinates.
            ValueError: there are fewer than two steps.
        """
        if steps < 2:
            raise ValueError(f"steps is {steps!r}; at least 2 are needed, the second closes up")
        x0, known = stage.rest() if x0 is None else x0, stage.coordinates.q_K
        for name in ("head.x", "head.length", "knee_left.x", "knee_right.length"):
            if name not in known:
                raise UnknownNameError("driven coordinate", name, known)
        return Input.waypoints(stage, self.waypoints(x0, steps))

    def waypoints(self, x0: State, steps: int) -> Waypoints:
        """(time, value) of every moved coordinate of the strings, starting at those of a state."""
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
            # The first step and the last are half as long; the sway begins at the middle.
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
            reach = 2.0 * half * self.stride + self.beyond
            moves.by(f"knee_{side}.x", at(self.swings), at(self.arrives), reach)
            moves.by(
                f"knee_{side}.x", at(self.arrives), at(self.arrives + _RETURN_SHARE), -self.beyond
            )
        start, end = (first + D * (steps + share) for share in (self.sways, self.swayed))
        for name in body:
            moves.by(f"{name}.y", start, end, moves.back(f"{name}.y"))
        return dict(moves.points)


class _Moves:
    """Waypoints under construction.

    Args:
        x0: state at the start.
    """

    def __init__(self, x0: State) -> None:
        self._x0 = x0
        self.points: Waypoints = defaultdict(list)

    def by(self, name: str, start: float, end: float, way: float) -> None:
        """Moves a coordinate by ``way`` [m] between two times [s], after its last waypoint."""
        points = self.points[name]
        if not points:
            points.append((self._x0.t, float(self._x0[name])))
        t, value = points[-1]
        start = max(start, t)
        if start > t:
            points.append((start, value))
        points.append((max(end, start + _MIN_TIME), value + way))

    def back(self, name: str) -> float:
        """Offset that returns a coordinate to its start [m]."""
        points = self.points[name]
        return points[0][1] - points[-1][1]
