"""Gestures that put a prop on something in front of the puppet, and pick it up from there.

    q_K(t) = q_K0 + d(t)

q_K are the driven coordinates, the ends and lengths of strings; q_K0 are their values at rest and
d(t) the offsets of the gesture. A prop hangs across a forearm by its handle, a T: a bar with free
ends on a stem. The puppet holds the prop out over the table and lowers it until the prop stands
and the arm is free under the bar. Then the puppet steps aside, inward, because the stem is on the
outer side of the arm; the hand's string, in front of the bar, does not touch it. Offsets are
written for an arm of 19 cm, and multiplied by the ratio of lengths for others.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.cast import (
    OTHER_SIDE,
    Physique,
    Waypoints,
    add_waypoints,
    carry_offsets,
    member_gesture,
    reverse_waypoints,
    shifted,
    side_sign,
)
from fantoccini.theatre.gestures import Gesture

DROP_RANGE = (-0.02, 0.02)
"""Least and largest height of a carried prop above its later place [m]."""
CARRY_RISE = 0.022
"""Rise of a handle in the pose for carrying, relative to rest [m]."""
_ELBOW_DISTANCE = 0.062
"""Distance of a handle from the elbow along the forearm in that pose [m]."""

_HELD_OUT = {"forward": 0.4, "in": 0.065, "up": 0.03}
"""Offsets of the hand's string that hold a prop far out [m]."""
_EMPTY_FORWARD, _EMPTY_FORWARD_PER_DROP = 0.03, 0.8
"""Additional forward offset of the hand's string while an arm comes under the bar of a standing
prop [m], and increase of that relative to a drop: without a prop the arm hangs farther back, and
its string would pass the bar within 2 mm."""
_RISE = 0.045
"""Rise of the hand's string before it reaches out [m]."""
_HELD_OUT_RISE, _PROP_PER_STRING = 0.027, 0.7
"""Rise of a prop that is held out, relative to the pose for carrying, with the hand's string at its
height there [m]; and vertical motion of the prop, relative to that of the string."""
_FREE_DESCENT = 0.05
"""Further descent of the hand's string, until the arm is free under the bar [m]."""
_FORWARD, _FORWARD_PER_DROP, _OUTWARD = 0.1415, 0.62, -0.009
"""Place of a prop that is put down at the height at which it hung, from the elbow: distance forward
[m], decrease of that relative to the drop, and distance outward [m]."""
_GLIDE = 0.1
"""Distance by which the puppet glides ahead over its feet; steps would swing too wide [m]."""
_UPRIGHT, _WITHDRAWN = 0.015, 0.11
"""Inward offsets of the arm: to set the prop upright, and to leave the space under the bar [m]."""
_DURATION = 17.5
"""Duration of the gestures [s]."""


@dataclass(frozen=True)
class Putting:
    """Gesture that puts a prop on something, or picks it up; its marks are named times.

    Attributes:
        gesture: gesture with the marks ``down`` (the prop stands) and ``free`` (the arm is away),
            or ``under`` (the arm is under the handle) and ``up``.
        forward, left: place of the prop relative to the puppet [m].
        touching: pairs of bodies that may touch in the gesture.
    """

    gesture: Gesture
    forward: float
    left: float
    touching: tuple[tuple[str, str], ...]


def put_down(
    stage: Marionette, who: str, prop: str, height: float, *, start: State, side: str = "right"
) -> Putting:
    """Gesture that puts a prop on something and takes the forearm away: 17.5 s.

    It begins in the pose of :func:`~fantoccini.theatre.cast.prop_gestures.carry` and ends in the
    pose in which the puppet rests.

    Args:
        stage: marionette of the scene with the puppet and the prop.
        who: puppet of the scene that holds the prop.
        prop: prop that hangs by its handle on the forearm; the origin of its frame is at its
            bottom.
        height: height of the place for the prop [m].
        start: state of the puppet with the prop in the pose for carrying.
        side: side of the forearm.

    Raises:
        StateError: the member lacks the arm, or a string that lifts it.
        ValueError: the prop hangs too low or too high above its place.
    """
    drop = float(stage.pose(start, prop)[2, 3]) - height
    return putting(stage, who, prop, drop, side=side)


def pick_up(stage: Marionette, who: str, prop: str, drop: float, *, side: str = "right") -> Putting:
    """:func:`put_down` reversed in time: the forearm moves under the handle and lifts the prop.

    The arm, which hangs farther back without the prop, is held out farther.

    Args:
        stage: marionette of the scene with the puppet and the prop.
        who: puppet of the scene that picks up the prop.
        prop: prop that stands at the place given by ``forward`` and ``left`` of the result.
        drop: height of its bottom after the gesture minus its height before [m].
        side: side of the forearm.

    Raises:
        StateError: the member lacks the arm, or a string that lifts it.
        ValueError: the prop stands too low or too high.
    """
    return putting(stage, who, prop, drop, side=side, pick_up=True)


def putting(
    stage: Marionette,
    who: str,
    prop: str,
    drop: float,
    *,
    side: str = "right",
    elbow_distance: float | None = None,
    pick_up: bool = False,
) -> Putting:
    """Gesture of :func:`put_down` or :func:`pick_up`, for a height difference.

    Args:
        stage: marionette of the scene with the puppet and the prop.
        who: puppet of the scene that handles the prop.
        prop: see :func:`put_down`.
        drop: height of its bottom in the pose for carrying minus that of its place [m].
        side: side of the forearm.
        elbow_distance: distance of the handle from the elbow in that pose [m]; by default the
            usual one.
        pick_up: whether it is picked up.

    Raises:
        StateError: the member lacks the arm, or a string that lifts it.
        ValueError: the prop stands too low or too high.
    """
    sign, inner_side, physique = side_sign(side), OTHER_SIDE[side], Physique.of(stage, who)
    scale, carry_pose_offsets = physique.arm_ratio(side), carry_offsets(physique, side)
    min_drop, max_drop = (scale * bound for bound in DROP_RANGE)
    if not min_drop <= drop <= max_drop:
        text = f"{prop} would go down by {drop:.3f} m; needed: {min_drop:.3g} to {max_drop:.3g} m"
        raise ValueError(text)
    string, glide = physique.hand_string(side), scale * _GLIDE
    held_out = {way: scale * offset for way, offset in _HELD_OUT.items()}
    if pick_up:
        held_out["forward"] += scale * _EMPTY_FORWARD + _EMPTY_FORWARD_PER_DROP * max(drop, 0.0)
    touch_offset = -(drop + scale * _HELD_OUT_RISE) / _PROP_PER_STRING
    lowest_offset = touch_offset - scale * _FREE_DESCENT
    waypoints = shifted(
        physique,
        inner_side,
        1.0,
        [
            (0, 0),
            (7.1, 0),
            (9.0, _UPRIGHT),
            (9.5, _UPRIGHT),
            (11.5, _WITHDRAWN),
            (14.2, _WITHDRAWN),
            (_DURATION, 0),
        ],
    )
    waypoints |= shifted(physique, "forward", glide, _reach(0.0, 1.0))
    waypoints[f"{string}.up"] = [
        (0, carry_pose_offsets["up"]),
        (1.0, scale * _RISE),
        (6.0, held_out["up"]),
        (6.5, held_out["up"]),
        (8.0, touch_offset),
        (9.0, lowest_offset),
        (11.7, lowest_offset),
        (14.5, 0),
        (_DURATION, 0),
    ]
    waypoints[f"{string}.forward"] = _reach(0.0, glide + held_out["forward"])
    waypoints[f"{string}.{inner_side}"] = add_waypoints(
        waypoints[f"{string}.{inner_side}"], _reach(-carry_pose_offsets["out"], held_out["in"])
    )
    name, marks = "put down", {"down": 8.0, "free": 11.5}
    if pick_up:
        waypoints, name = reverse_waypoints(waypoints, _DURATION), "pick up"
        marks = {"under": _DURATION - 9.5, "up": _DURATION - 6.5}
    elbow = physique.place(physique.forearm(side))
    distance_error = 0.0 if elbow_distance is None else elbow_distance - scale * _ELBOW_DISTANCE
    forward = glide + scale * _FORWARD + float(elbow[0]) - _FORWARD_PER_DROP * drop + distance_error
    touching = ((physique.forearm(side), prop),)
    return Putting(
        member_gesture(stage, who, waypoints, name, marks),
        forward,
        float(elbow[1]) + sign * _OUTWARD,
        touching,
    )


def _reach(first: float, held_out: float) -> Waypoints:
    """Waypoints from a first offset to one that holds the prop out, and then to 0."""
    return [(0, first), (0.5, first), (6.0, held_out), (11.5, held_out), (16.0, 0), (_DURATION, 0)]
