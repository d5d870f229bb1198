"""Gestures that stand a prop on something before the puppet, and take it from there again.

    q_K(t) = q_K0 + d(t)

The puppet holds the prop out over the table and lowers it until it stands and the arm is free under
the bar. Then it steps aside, inward, for the stem is on the outer side of the arm; the hand's
string, before the bar, does not pass it.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.cast import (
    CARRIED,
    OTHER_SIDE,
    Waypoints,
    aside_by,
    backwards,
    gesture_of,
    of_member,
    sign_of,
    summed,
)
from fantoccini.theatre.gestures import Gesture

DROPS = (-0.02, 0.02)
"""Least and largest height of a carried prop above what it is put on [m]."""
HIGHER = 0.022
"""Rise of a handle in that pose from where the puppet hangs [m]."""
ALONG = 0.062
"""Distance of a handle from the elbow along the forearm in that pose [m]."""

_OUT = {"forward": 0.4, "in": 0.065, "up": 0.03}
"""Offsets of the hand's string that hold something out far [m]."""
_RISES = 0.045
"""Up: the hand's string before it reaches out [m]."""
_RAISED, _GAIN = 0.027, 0.7
"""A prop that is held out with the hand's string at its height hangs so much higher than in the
pose of carrying [m], and goes down by this part of what the string does."""
_SINKS = 0.05
"""The hand's string goes down by so much more, until the arm is free under the bar [m]."""
_STANDS, _NEARER, _ASIDE = 0.147, 0.62, 0.064
"""Where something stands that was put as high as it hung: forward, by which part of the way down
it stands nearer, and to the arm's side [m]."""
_GLIDES = 0.1
"""The puppet glides so far ahead over its feet, which swing too wide in steps at a table [m]."""
_UPRIGHT, _LEAVES = 0.015, 0.11
"""Ways inward: with the arm that sets the prop upright, and to come out from under the bar [m]."""
_DURATION = 17.5


@dataclass(frozen=True)
class Putting:
    """A prop comes to stand on something, or is taken from it.

    Attributes:
        gesture: marks ``down`` and ``free``, or ``under`` and ``up``.
        forward, left: where the prop stands, seen from the puppet [m].
        touching: pairs of bodies that may touch.
    """

    gesture: Gesture
    forward: float
    left: float
    touching: tuple[tuple[str, str], ...]


def put_down(
    stage: Marionette, who: str, prop: str, height: float, *, start: State, side: str = "right"
) -> Putting:
    """The gesture by which a puppet stands a prop on something and takes its forearm away: 17.5 s.

    It begins in the pose of :func:`~fantoccini.theatre.cast.prop_gestures.carry` and ends where
    the puppet hangs.

    Args:
        stage: the scene.
        who: a member.
        prop: which hangs by its handle on the forearm; the origin of its frame is in its bottom.
        height: of what it will stand on [m].
        start: where the puppet and the prop hang in the pose of carrying.
        side: of the forearm.

    Raises:
        InputError: the member has other strings than the bundled marionette.
        ValueError: the prop hangs too low or too high above it.
    """
    drop = float(stage.pose(start, prop)[2, 3]) - height
    return putting(stage, who, prop, drop, side=side)


def pick_up(stage: Marionette, who: str, prop: str, drop: float, *, side: str = "right") -> Putting:
    """:func:`put_down` backwards: the forearm goes under the handle and lifts the prop.

    Args:
        stage: the scene.
        who: a member.
        prop: which stands at the place that is returned.
        drop: how much lower its bottom is than where it will hang [m].
        side: of the forearm.

    Raises:
        InputError: the member has other strings than the bundled marionette.
        ValueError: the prop stands too low or too high.
    """
    return putting(stage, who, prop, drop, side=side, back=True)


def putting(
    stage: Marionette,
    who: str,
    prop: str,
    drop: float,
    *,
    side: str = "right",
    along: float = ALONG,
    back: bool = False,
) -> Putting:
    """:func:`put_down` or :func:`pick_up` of something by how far it goes down.

    Args:
        stage: the scene.
        who: a member.
        prop: see there.
        drop: how much lower its bottom is than where it hangs in the pose of carrying [m].
        side: of the forearm.
        along: how far from the elbow the handle hangs then [m].
        back: whether it is picked up.

    Raises:
        InputError: the member has other strings than the bundled marionette.
        ValueError: the prop stands too low or too high.
    """
    sign, other = sign_of(side), OTHER_SIDE[side]
    lowest, highest = DROPS
    if not lowest <= drop <= highest:
        text = f"{prop} would go down by {drop:.3f} m; needed: {lowest} to {highest} m"
        raise ValueError(text)
    hand, out = f"hand_{side}", _OUT
    touches = -(drop + _RAISED) / _GAIN
    sunk = touches - _SINKS
    moves = aside_by(
        other,
        1.0,
        [
            (0, 0),
            (7.1, 0),
            (9.0, _UPRIGHT),
            (9.5, _UPRIGHT),
            (11.5, _LEAVES),
            (14.2, _LEAVES),
            (_DURATION, 0),
        ],
    )
    moves |= aside_by("forward", _GLIDES, _reach(0.0, 1.0))
    moves[f"{hand}.up"] = [
        (0, CARRIED["up"]),
        (1.0, _RISES),
        (6.0, out["up"]),
        (6.5, out["up"]),
        (8.0, touches),
        (9.0, sunk),
        (11.7, sunk),
        (14.5, 0),
        (_DURATION, 0),
    ]
    moves[f"{hand}.forward"] = _reach(0.0, _GLIDES + out["forward"])
    moves[f"{hand}.{other}"] = summed(moves[f"{hand}.{other}"], _reach(-CARRIED["out"], out["in"]))
    name, marks = "put down", {"down": 8.0, "free": 11.5}
    if back:
        moves, name = backwards(moves, _DURATION), "pick up"
        marks = {"under": _DURATION - 9.5, "up": _DURATION - 6.5}
    forward = _GLIDES + _STANDS - _NEARER * drop + along - ALONG
    touching = ((of_member(who, f"forearm_{side}"), prop),)
    return Putting(gesture_of(stage, who, moves, name, marks), forward, sign * _ASIDE, touching)


def _reach(before: float, out: float) -> Waypoints:
    """Waypoints from an offset to another while something is held out, and to none."""
    return [(0, before), (0.5, before), (6.0, out), (11.5, out), (16.0, 0), (_DURATION, 0)]
