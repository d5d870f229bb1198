"""Scores in the physics: inputs with which points are where they would hang, on the beat.

    min  integral of  sum_i |x_i(t) - x_i,hung(q_K(t))|^2 + smoothness   over the inputs, in bounds

x_i,hung are the places of the points in the pose in which the puppet hangs under the score's own
inputs q_K(t): what the hands mean, without swing and lag.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.errors import StateError
from fantoccini.gestures.score import Score
from fantoccini.gestures.timekeeping import Point, hanging, places, ties
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.optimal import Bounds, Optimum, Smooth, follow

_INTERVAL = 0.04
"""Between nodes [s]."""
_SETTLES = 0.4
"""Time after the score's end in which the puppet is still followed [s]."""
_SMOOTH = Smooth(acceleration=1e-4, jerk=1e-7)
_ITERATIONS = 12


def on_beat(
    score: Score,
    x0: State | None = None,
    points: Sequence[Point] | None = None,
    **options: Any,
) -> Optimum:
    """The motion of the hands with which a score is on its beats in the simulation.

    The hands lead by as much as limbs lag, and take their swing out. ``found.inputs`` are those
    inputs, ``found.run`` the event-driven run, ``found.status`` how the search ended.

    Args:
        score: of a puppet without contact.
        x0: where it hangs; at rest when not given.
        points: that are to be on the beat; where the strings that the score moves are tied when
            not given.
        options: of :func:`fantoccini.optimise`: ``iterations`` (12), ``time_limit``, ``threads``.

    Raises:
        StateError: the puppet has contact, or cannot hang where the score takes it.
    """
    marionette = score.marionette
    x0 = marionette.rest() if x0 is None else x0
    inputs = score.inputs(x0)
    n = int(np.ceil((inputs.duration + _SETTLES) / _INTERVAL))
    t = x0.t + _INTERVAL * np.arange(n + 1, dtype=float)
    paths = _hung(marionette, inputs.evaluate(t)[0], x0, t, points or _ties(score))
    bounds = Bounds(speed=_plain(score.speed), acceleration=_plain(score.acceleration))
    options.setdefault("guess", inputs.extended(t[-1]))
    options.setdefault("iterations", _ITERATIONS)
    return follow(
        marionette, {point: (t, path) for point, path in paths.items()}, n * _INTERVAL, x0,
        bounds=bounds, smooth=_SMOOTH, slack=True, interval=_INTERVAL, **options,
    )  # fmt: skip


def _hung(
    marionette: Marionette, q_K: Array, x0: State, t: Times, points: Sequence[Point]
) -> dict[Point, Array]:
    """(T, 3) places of points where the puppet hangs."""
    found = hanging(marionette, q_K, x0, t)
    named = {str(i): point for i, point in enumerate(points)}
    at = places(marionette, found.q_D, found.q_K, named)
    return {point: at[:, i] for i, point in enumerate(points)}


def _ties(score: Score) -> tuple[Point, ...]:
    """Where the strings that a score moves are tied to bodies that move by themselves."""
    tied = ties(score.marionette)
    found = dict.fromkeys(point for name, point in tied.items() if name in score.gesture.uses)
    if not found:
        raise StateError(f"the score {score.name} moves no string; give the points to follow")
    return tuple(found)


def _plain(bound: Any) -> Any:
    return dict(bound) if isinstance(bound, dict) else float(bound)
