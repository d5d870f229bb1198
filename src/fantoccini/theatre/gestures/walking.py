"""Walking: all ends of a puppet's strings move along a path, and the knees rise in turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array, Times, polynomial
from fantoccini.base.documents import Mistakes
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Curve, Ends, times
from fantoccini.theatre.gestures.gesture import Gesture, numbered
from fantoccini.theatre.gestures.leg_order import leg_length, phases
from fantoccini.theatre.gestures.stepping import (
    MAX_STEP_LENGTH,
    MAX_STEP_TURN,
    STEP_TIME,
    Step,
    Track,
)

STEPS, STEP = 4, 0.06
"""Default number of steps of a walk, and default length of a step [m]."""
SWAY = 0.006
"""Sway of the body to the side of the standing foot [m]."""
_LEG_LENGTH = 0.26417
"""Length of a leg of the puppet to which the lengths of this module belong [m]."""
_LIFT = 0.06
"""Length by which a knee's string is wound in for a step [m]."""
_LIFT_ON_SPOT = 0.025
"""Length for a step on the spot [m]: higher knees swing into each other as the hips turn."""
_BODY_RISE = 0.004
"""Rise of the body in a step [m]."""
_PIECES_PER_STEP = 8
"""Number of pieces of a step; even, since knees are highest at its middle."""
_MAX_STEPS = 1000
"""Largest number of steps of a walk."""
_SIDES = ("left", "right")


def walk(
    ends: Ends, mistakes: Mistakes, count: int | None, length: float | None, turn: float | None
) -> Gesture:
    """Gesture of equal steps that together turn by an angle; the left foot goes first.

    Args:
        ends: ends of the puppet's strings.
        mistakes: collects mistakes.
        count: number of steps; 4 by default.
        length: length of a step; below 0 backward; 6 cm by default [m].
        turn: total turn to the left [rad].

    Raises:
        InputError: the parameters have mistakes; all of them are listed.
    """
    n, step, angle = walk_parameters(ends.body_parts, mistakes, count, length, turn)
    mistakes.raise_if_any()
    return steps(ends, [Step(step, angle / n)] * n).called("walk")


def walk_parameters(
    body_parts: BodyParts,
    mistakes: Mistakes,
    count: int | None,
    length: float | None,
    turn: float | None,
) -> tuple[int, float, float]:
    """Number of steps, length of each [m] and total turn [rad]; collects mistakes."""
    n = STEPS if count is None else count
    step = STEP * leg_ratio(body_parts) if length is None else float(length)
    angle = 0.0 if turn is None else float(turn)
    if not isinstance(n, int) or isinstance(n, bool) or not 1 <= n <= _MAX_STEPS:
        mistakes.add(("steps",), f"found {n!r}; needed: a whole number from 1 to {_MAX_STEPS}")
    elif not abs(angle) <= n * MAX_STEP_TURN:
        text = f"found {np.degrees(angle):g} deg in {n} steps; needed: at most 90 deg in each"
        mistakes.add(("turn",), text)
    if not abs(step) <= MAX_STEP_LENGTH:
        mistakes.add(("step",), f"found {step:g} m; needed: at most {MAX_STEP_LENGTH:g} m")
    return n, step, angle


def steps(ends: Ends, walk_steps: Sequence[Step], step_time: float = STEP_TIME) -> Gesture:
    """Gesture of steps along the path of :class:`Track`; the left foot goes first.

    Knees rise in turn, each together with those of diagonal neighbours, and the body rises and
    sways, except in steps that stand: those leave the feet where they are. Marks are those of a
    walk.

    Args:
        ends: ends of the puppet's strings.
        walk_steps: steps in order.
        step_time: duration of a step [s].

    Raises:
        ValueError: there are no steps, or a time is not greater than 0.
    """
    if not walk_steps:
        raise ValueError("walk_steps is empty; a gesture has at least one step")
    legs = _groups(ends.body_parts)
    for string in (*legs["left"], *legs["right"]):
        ends.check_driven(string)
    n, track = len(walk_steps), Track(walk_steps, step_time)
    scale = leg_ratio(ends.body_parts)
    clock = np.arange(n * _PIECES_PER_STEP + 1) / _PIECES_PER_STEP
    k = np.minimum(clock.astype(int), n - 1)
    up = _bump(clock - k, step_time)
    moves = np.array([not step.stands for step in walk_steps])
    # +1 in a step of the left foot, -1 in one of the right foot.
    side = np.where(moves, (-1.0) ** (np.cumsum(moves) + 1), 0.0)
    lift = scale * np.array([_LIFT if step.length else _LIFT_ON_SPOT for step in walk_steps])
    path, heading = track.at(clock * step_time)
    ends.carry(path, heading, times(-SWAY * scale * side[k], up))
    for name in ends.body:
        ends.add(f"{name}.length", times(-_BODY_RISE * scale * moves[k], up))
    marks: dict[str, float] = {}
    for name, sign in zip(_SIDES, (1.0, -1.0), strict=True):
        if np.any(side == sign):
            for string in legs[name]:
                ends.add(f"{string}.length", times(-lift[k] * (side[k] == sign), up))
    for j in np.flatnonzero(moves):
        marks[numbered(_SIDES[int(side[j] < 0.0)], marks)] = (float(j) + 0.5) * step_time
    return ends.gesture(clock * step_time, "steps", marks, travels=True)


def rise_and_return(rise: float, hold: float, pieces: int = 12) -> tuple[Times, Curve]:
    """Times, and a curve that rises from 0 to 1, stays there, and returns to 0.

    Args:
        rise: duration of the rise, and of the return [s].
        hold: time between them [s].
        pieces: number of pieces of each.
    """
    s = np.linspace(0.0, 1.0, pieces + 1)
    up = tuple(x / rise**k for k, x in enumerate(polynomial.minimum_jerk(s)))
    t = np.concatenate([rise * s, rise + hold + rise * s])
    signs = (1.0, -1.0, 1.0)
    values, rates, changes = (
        np.concatenate([x, sign * x[::-1]]) for x, sign in zip(up, signs, strict=True)
    )
    return t, (values, rates, changes)


def _groups(body_parts: BodyParts) -> dict[str, list[str]]:
    """Side -> strings of the legs that step with the first leg of this side.

    Raises:
        StateError: the puppet has no pairs of legs, or no string moves one of them.
    """
    groups: dict[str, list[str]] = {side: [] for side in _SIDES}
    for leg, phase in phases(body_parts.body_map, "trot").items():
        groups["right" if phase else "left"] += body_parts.strings(leg)
    return groups


def leg_ratio(body_parts: BodyParts) -> float:
    """Length of the legs, relative to that for which gestures are written; 0 without legs."""
    return leg_length(body_parts.body_map) / _LEG_LENGTH


def _bump(s: Array, step_time: float) -> Curve:
    """Curve from 0 to 1 and back while s goes from 0 to 1, with its derivatives by time."""
    rises = s < 0.5
    up, rate, curve = polynomial.minimum_jerk(2.0 * np.where(rises, s, 1.0 - s))
    sign = np.where(rises, 2.0, -2.0) / step_time
    return up, sign * rate, 4.0 * curve / step_time**2
