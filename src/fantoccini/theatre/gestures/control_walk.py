"""Walking with a control: the leg bar rocks while the hand moves the control forward."""

from __future__ import annotations

import numpy as np

from fantoccini.base.documents import Mistakes
from fantoccini.theatre.gestures.body_parts import BodyParts, moves_of
from fantoccini.theatre.gestures.gesture import Gesture, numbered
from fantoccini.theatre.gestures.own_axes import OwnAxes
from fantoccini.theatre.gestures.walking import walk_parameters

_STEP_TIME = 0.8
"""Duration of a step [s]: a wrist rocks a bar more slowly than fingers wind strings."""
_ROCK_ANGLE = np.radians(23.0)
"""Angle by which a leg bar rocks to each side [rad]."""
_END_SHARE = 0.25
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
    n, step, angle = walk_parameters(body_parts, mistakes, count, length, turn)
    if angle != 0.0:
        text = f"found {np.degrees(angle):g} deg; needed: 0, since a control walks straight on"
        mistakes.add(("turn",), text)
    mistakes.raise_if_any()
    t = _STEP_TIME * np.array([0.0, 0.5, n - 0.5, n])
    distance = step * np.array([0.0, _END_SHARE, n - _END_SHARE, n])
    if n == 1:
        t, distance = t[[0, -1]], distance[[0, -1]]
    offsets = {
        "leg_bar.roll_right": _rocking(n),
        "control.forward": list(zip(t.tolist(), distance.tolist(), strict=True)),
    }
    points = {name: offsets[part] for name, (part, _) in moves_of(body_parts, offsets).items()}
    marks: dict[str, float] = {}
    for k in range(n):
        marks[numbered(("left", "right")[k % 2], marks)] = (k + 0.5) * _STEP_TIME
    axes = OwnAxes.of(body_parts.marionette, [body_parts])
    walk = Gesture.of(axes.own, points, travels=True, name="walk", marks=marks)
    return walk.placed(axes)


def _rocking(n: int) -> list[tuple[float, float]]:
    """Times [s] and angles [rad] of the leg bar for n steps; positive peaks lift the left knee."""
    peaks = [((k + 0.5) * _STEP_TIME, (-1.0) ** k * _ROCK_ANGLE) for k in range(n)]
    return [(0.0, 0.0), *peaks, (n * _STEP_TIME, 0.0)]
