"""Walking with a control: the leg bar rocks while the hand moves the control forward.

A control is the body that the hand holds, with bars to which the strings are tied.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base.documents import Mistakes
from fantoccini.theatre.gestures.body_parts import BodyParts, string_moves
from fantoccini.theatre.gestures.gesture import Gesture, numbered_mark
from fantoccini.theatre.gestures.own_axes import OwnAxes
from fantoccini.theatre.gestures.walking import walk_parameters

_STEP_TIME = 0.8
"""Duration of a step [s]: a wrist rocks a bar more slowly than fingers wind strings."""
_ROCK_ANGLE = np.radians(23.0)
"""Angle by which a leg bar rocks to each side [rad]."""
_HALF_STEP_SHARE = 0.25
"""Distance in the first and in the last half of a step time, as a share of a step."""


def walk_on_control(
    body_parts: BodyParts,
    mistakes: Mistakes,
    count: int | None,
    length: float | None,
    turn: float | None,
) -> Gesture:
    """Gesture of equal steps straight on; the left foot goes first.

    Args:
        body_parts: parts of a puppet on a control.
        mistakes: collects mistakes.
        count: number of steps; 4 by default.
        length: length of a step; below 0 backward; 6 cm by default [m].
        turn: total turn, which must be 0 [rad].

    Raises:
        InputError: the parameters have mistakes, all of which are listed, or the leg bar cannot
            roll or the control not move forward.
        StateError: the puppet has no leg bar.
    """
    n_steps, step_length, total_turn = walk_parameters(body_parts, mistakes, count, length, turn)
    if total_turn != 0.0:
        text = f"found {np.degrees(total_turn):g} deg; needed: 0, since a control walks straight on"
        mistakes.add(("turn",), text)
    mistakes.raise_if_any()
    t = _STEP_TIME * np.array([0.0, 0.5, n_steps - 0.5, n_steps])
    distance = step_length * np.array([0.0, _HALF_STEP_SHARE, n_steps - _HALF_STEP_SHARE, n_steps])
    if n_steps == 1:
        t, distance = t[[0, -1]], distance[[0, -1]]
    offsets = {
        "leg_bar.roll_right": _rocking_points(n_steps),
        "control.forward": list(zip(t.tolist(), distance.tolist(), strict=True)),
    }
    points = {name: offsets[part] for name, (part, _) in string_moves(body_parts, offsets).items()}
    marks: dict[str, float] = {}
    for k in range(n_steps):
        marks[numbered_mark(("left", "right")[k % 2], marks)] = (k + 0.5) * _STEP_TIME
    axes = OwnAxes.for_members(body_parts.marionette, [body_parts])
    walk = Gesture.from_points(axes.own_table, points, travels=True, name="walk", marks=marks)
    return walk.in_driven_axes(axes)


def _rocking_points(n_steps: int) -> list[tuple[float, float]]:
    """Times [s] and angles [rad] of the leg bar for n steps; positive peaks lift the left knee."""
    peaks = [((k + 0.5) * _STEP_TIME, (-1.0) ** k * _ROCK_ANGLE) for k in range(n_steps)]
    return [(0.0, 0.0), *peaks, (n_steps * _STEP_TIME, 0.0)]
