"""Walking: all ends of a puppet's strings move along a path, and the knees rise in turn.

The sway is the motion of the body to the side of the standing foot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array, Times, polynomial
from fantoccini.base.documents import Mistakes
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Curve, Ends, scale_curve
from fantoccini.theatre.gestures.gesture import Gesture, numbered_mark
from fantoccini.theatre.gestures.leg_order import gait_phases, leg_length
from fantoccini.theatre.gestures.stepping import (
    MAX_STEP_LENGTH,
    MAX_STEP_TURN,
    STEP_TIME,
    Step,
    StepPath,
)

DEFAULT_STEPS, DEFAULT_STEP_LENGTH = 4, 0.06
"""Default number of steps of a walk, and default length of a step [m]."""
SWAY = 0.006
"""Sway of the body to the side of the standing foot [m]."""
_LEG_LENGTH = 0.26417
"""Length of a leg of the puppet to which the lengths of this module belong [m]."""
_KNEE_LIFT = 0.06
"""Length by which a knee's string is wound in for a step [m]."""
_KNEE_LIFT_ON_SPOT = 0.025
"""Length for a step on the spot [m]: higher knees swing into each other as the hips turn."""
_SLOW_STEP_TIME, _SLOW_LIFT_WITH_WAIST = 0.9, 0.03
"""Least duration of a slow step [s], and length for it if the trunk has a waist [m]: two slow steps
take as long as a swing of the pelvis about the vertical. A higher knee turns it so far that the leg
swings out and its string meets that of a shoulder."""
_BODY_RISE = 0.004
"""Rise of the body in a step [m]."""
_PIECES_PER_STEP = 8
"""Number of pieces of a step; even, since knees are highest at its middle."""
_MAX_STEP_COUNT = 1000
"""Largest number of steps of a walk."""
_SIDES = ("left", "right")


def walk(
    ends: Ends,
    mistakes: Mistakes,
    step_count: int | None,
    step_length: float | None,
    turn: float | None,
) -> Gesture:
    """Gesture of equal steps that together turn by an angle; the left foot goes first.

    Args:
        ends: ends of the puppet's strings.
        mistakes: collects mistakes.
        step_count: number of steps; 4 by default.
        step_length: length of a step; below 0 backward; 6 cm by default [m].
        turn: total turn to the left [rad].

    Raises:
        InputError: the parameters have mistakes; all of them are listed.
    """
    count, length, total_turn = walk_parameters(
        ends.body_parts, mistakes, step_count, step_length, turn
    )
    mistakes.raise_if_any()
    return step_gesture(ends, [Step(length, total_turn / count)] * count).called("walk")


def walk_parameters(
    body_parts: BodyParts,
    mistakes: Mistakes,
    count: int | None,
    length: float | None,
    turn: float | None,
) -> tuple[int, float, float]:
    """Number of steps, length of each [m] and total turn [rad]; collects mistakes."""
    n_steps = DEFAULT_STEPS if count is None else count
    step_length = DEFAULT_STEP_LENGTH * leg_ratio(body_parts) if length is None else float(length)
    total_turn = 0.0 if turn is None else float(turn)
    if (
        not isinstance(n_steps, int)
        or isinstance(n_steps, bool)
        or not 1 <= n_steps <= _MAX_STEP_COUNT
    ):
        mistakes.add(
            ("steps",), f"found {n_steps!r}; needed: a whole number from 1 to {_MAX_STEP_COUNT}"
        )
    elif not abs(total_turn) <= n_steps * MAX_STEP_TURN:
        degrees = np.degrees(total_turn)
        text = f"found {degrees:g} deg in {n_steps} steps; needed: at most 90 deg in each"
        mistakes.add(("turn",), text)
    if not abs(step_length) <= MAX_STEP_LENGTH:
        mistakes.add(("step",), f"found {step_length:g} m; needed: at most {MAX_STEP_LENGTH:g} m")
    return n_steps, step_length, total_turn


def step_gesture(ends: Ends, steps: Sequence[Step], step_time: float = STEP_TIME) -> Gesture:
    """Gesture of steps along the path of :class:`StepPath`; the left foot goes first.

    Knees rise in turn, each together with those of diagonal neighbours, and the body rises and
    sways, except in steps that stand: those leave the feet where they are. Marks are those of a
    walk.

    Args:
        ends: ends of the puppet's strings.
        steps: steps in order.
        step_time: duration of a step [s].

    Raises:
        ValueError: there are no steps, or a time is not greater than 0.
    """
    if not steps:
        raise ValueError("steps is empty; a gesture has at least one step")
    strings_by_side = _strings_by_side(ends.body_parts)
    for string in (*strings_by_side["left"], *strings_by_side["right"]):
        ends.check_driven(string)
    n_steps, step_path = len(steps), StepPath(steps, step_time)
    scale = leg_ratio(ends.body_parts)
    step_clock = np.arange(n_steps * _PIECES_PER_STEP + 1) / _PIECES_PER_STEP
    k = np.minimum(step_clock.astype(int), n_steps - 1)
    rise = _rise_and_fall(step_clock - k, step_time)
    is_moving = np.array([not step.stands for step in steps])
    # +1 in a step of the left foot, -1 in one of the right foot.
    side_sign = np.where(is_moving, (-1.0) ** (np.cumsum(is_moving) + 1), 0.0)
    lifts = scale * np.array([_knee_lift(ends.body_parts, step, step_time) for step in steps])
    path, heading = step_path.at(step_clock * step_time)
    ends.move_rigidly(path, heading, scale_curve(-SWAY * scale * side_sign[k], rise))
    for string in ends.body_strings:
        ends.add(f"{string}.length", scale_curve(-_BODY_RISE * scale * is_moving[k], rise))
    marks: dict[str, float] = {}
    for side, sign in zip(_SIDES, (1.0, -1.0), strict=True):
        if np.any(side_sign == sign):
            for string in strings_by_side[side]:
                ends.add(f"{string}.length", scale_curve(-lifts[k] * (side_sign[k] == sign), rise))
    for moving_step in np.flatnonzero(is_moving):
        marks[numbered_mark(_SIDES[int(side_sign[moving_step] < 0.0)], marks)] = (
            float(moving_step) + 0.5
        ) * step_time
    return ends.gesture(step_clock * step_time, "steps", marks, travels=True)


def _knee_lift(body_parts: BodyParts, step: Step, step_time: float) -> float:
    """Length by which a knee's string is wound in for a step, for legs of 26.4 cm [m]."""
    if not step.length:
        return _KNEE_LIFT_ON_SPOT
    has_waist = len(body_parts.body_map.trunk) > 1
    is_slow = step_time >= _SLOW_STEP_TIME
    return _SLOW_LIFT_WITH_WAIST if has_waist and is_slow else _KNEE_LIFT


def rise_and_return(rise: float, hold: float, pieces: int = 12) -> tuple[Times, Curve]:
    """Times, and a curve that rises from 0 to 1, stays there, and returns to 0.

    Args:
        rise: duration of the rise, and of the return [s].
        hold: time between them [s].
        pieces: number of pieces of each.
    """
    progress = np.linspace(0.0, 1.0, pieces + 1)
    up = tuple(x / rise**k for k, x in enumerate(polynomial.minimum_jerk(progress)))
    t = np.concatenate([rise * progress, rise + hold + rise * progress])
    signs = (1.0, -1.0, 1.0)
    values, rates, changes = (
        np.concatenate([x, sign * x[::-1]]) for x, sign in zip(up, signs, strict=True)
    )
    return t, (values, rates, changes)


def _strings_by_side(body_parts: BodyParts) -> dict[str, list[str]]:
    """Side -> strings of the legs that step with the first leg of this side.

    Raises:
        StateError: the puppet has no pairs of legs, or no string moves one of them.
    """
    strings: dict[str, list[str]] = {side: [] for side in _SIDES}
    for leg, phase in gait_phases(body_parts.body_map, "trot").items():
        strings["right" if phase else "left"] += body_parts.strings(leg)
    return strings


def leg_ratio(body_parts: BodyParts) -> float:
    """Length of the legs, relative to that for which gestures are written; 0 without legs."""
    return leg_length(body_parts.body_map) / _LEG_LENGTH


def _rise_and_fall(phase: Array, step_time: float) -> Curve:
    """Curve from 0 to 1 and back while the phase goes from 0 to 1, with its derivatives by time."""
    is_rising = phase < 0.5
    value, rate, second_derivative = polynomial.minimum_jerk(
        2.0 * np.where(is_rising, phase, 1.0 - phase)
    )
    sign = np.where(is_rising, 2.0, -2.0) / step_time
    return value, sign * rate, 4.0 * second_derivative / step_time**2
