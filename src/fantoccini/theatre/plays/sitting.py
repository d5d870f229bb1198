"""Gestures that sit down on a seat behind the puppet, and stand up again.

    q_K(t) = q_K0 + d(t)

Offsets are relative to the puppet's rest. They are written for legs of 26.4 cm and arms of 19 cm,
and multiplied by the ratio of lengths for others.

q_K are the driven coordinates, the ends and lengths of strings; q_K0 are their values at rest and
d(t) the offsets of the gesture. A slack string does not pull. The stage is the scene with all
players, props and obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.cast import ContactBodies, Physique, Waypoints, member_gesture
from fantoccini.theatre.gestures import Gesture

_PELVIS_HEIGHT = 0.016
"""Height of the hips above the bottom of the pelvis [m]."""
_DISTANCE, _DISTANCE_RANGE = 0.135, (0.12, 0.2)
"""Usual distance of the seat's middle behind the puppet, and its least and largest value [m]."""
_AHEAD_GOING_DOWN = 0.005
"""Distance of the string ends in front of the seat's middle, on the way down [m]."""
_AHEAD_SEATED, _AHEAD_BEFORE_RISING = 0.075, 0.115
"""The same while seated, which keeps the trunk upright, and just before the puppet rises, which
puts the weight over the feet [m]."""
_SLACK, _SAG = 0.005, 0.008
"""Additional length of the strings beyond the descent, at its end and before, so that the seat
carries weight [m]."""
_KNEE_ENDS_AHEAD, _KNEE_SLACK, _KNEE_SLACK_PER_DEPTH = 0.185, 0.025, 0.3
"""Distance of the knee strings' ends in front of the seat's middle [m]: the strings lean forward
and do not cross. Their additional length at :data:`_LEVEL_DEPTH` [m], and its increase per metre of
further descent."""
_KNEE_LIFT = 0.012
"""Length by which the knee strings are wound in on the way down: shins clear the edge [m]."""
_LEVEL_DEPTH = 0.114
"""Depth of a seat below the pelvis at which the knees are as high as at rest [m]."""
_LAP = {"forward": 0.09, "out": 0.22, "down": 0.8}
"""Place of the hand strings' ends forward and out from the puppet's place, at which the hands lie
on the thighs, outside the knee strings [m]; and their descent, relative to that of the trunk."""
_T_TOUCH, _T_STRAIGHTEN, _T_SEATED = 2.6, 3.0, 4.0
"""Times from the start of sitting down: the seat is touched, the trunk begins to straighten, the
puppet is seated [s]."""
_T_BEHIND = _T_TOUCH - 0.6
"""Time at which the string ends are above the seat [s]."""
_T_BENT, _T_FORWARD, _T_LIFTED, _T_UPRIGHT = 0.8, 1.6, 3.4, 3.6
"""Times from the start of rising: bent forward, string ends begin to return to their places before
sitting, trunk lifted, string ends returned [s]."""
_SEAT_DEPTHS = (0.09, 0.18)
"""Least and largest depth of a seat below the pelvis [m]."""


@dataclass(frozen=True)
class Sitting:
    """Gestures with which a puppet sits down on a seat behind it, and stands up again.

    Attributes:
        down: gesture of sitting down, with the mark ``down``.
        up: gesture that returns to the place where it stood, with the mark ``up``.
        back: distance of the middle of the seat behind the puppet [m].
        touching: pairs of bodies that may touch.
    """

    down: Gesture
    up: Gesture
    back: float
    touching: tuple[tuple[str, str], ...]


def sit(
    stage: Marionette,
    who: str,
    on: str,
    height: float,
    *,
    distance: float | None = None,
    start: State | None = None,
) -> Sitting:
    """Gestures that sit a puppet down on a seat behind it, and stand it up again.

    In 4 s it moves back and down, straightens, and lowers its hands onto its thighs; in 3.6 s it
    bends forward and stands up at its former place.

    Args:
        stage: the scene.
        who: member that sits down.
        on: name of the prop or obstacle with the seat.
        height: height of the seat [m].
        distance: distance of the seat's middle behind the puppet [m]; by default 13.5 cm for legs
            of 26.4 cm.
        start: state at rest; ``stage.rest()`` by default.

    Raises:
        StateError: the member lacks a limb or a string that lifts it.
        ValueError: the seat is too low or too high, or so near that the puppet stands on it.
    """
    start = stage.rest() if start is None else start
    physique = Physique.of(stage, who)
    size = physique.leg_ratio
    distance = _DISTANCE * size if distance is None else distance
    drop = _pelvis_bottom_height(physique, start) - height
    low, high = (size * bound for bound in _SEAT_DEPTHS)
    if not low <= drop <= high:
        text = f"the seat is {drop:.3f} m below the pelvis; needed: {low:.3g} to {high:.3g} m"
        raise ValueError(text)
    closest, farthest = (size * bound for bound in _DISTANCE_RANGE)
    if not closest <= distance <= farthest:
        text = f"the seat is {distance:g} m behind; needed: {closest:.3g} to {farthest:.3g} m"
        raise ValueError(text)
    down, up = _trunk_waypoints(physique, drop, distance)
    for side in ("left", "right"):
        limb_down, limb_up = _limb_waypoints(physique, start, side, drop, distance)
        down |= limb_down
        up |= limb_up
    bodies = ContactBodies.of("", physique.body_parts.body_map)
    return Sitting(
        member_gesture(stage, who, down, "sit", {"down": _T_SEATED}),
        member_gesture(stage, who, up, "stand up", {"up": _T_UPRIGHT}),
        distance,
        tuple((body.removeprefix("."), on) for body in (*bodies.seated, *bodies.feet)),
    )


def _pelvis_bottom_height(physique: Physique, start: State) -> float:
    """Height of the bottom of the pelvis of a puppet that hangs upright [m]."""
    root = physique.body_parts.body_map.trunk[0]
    hips = physique.place(root)[2] - physique.place(physique.limb("leg_left").bodies[0])[2]
    return (
        float(physique.stage.pose(start, root)[2, 3] - hips) - physique.leg_ratio * _PELVIS_HEIGHT
    )


def _trunk_waypoints(
    physique: Physique, drop: float, distance: float
) -> tuple[dict[str, Waypoints], dict[str, Waypoints]]:
    """Waypoints of the strings of trunk and head: down, and up."""
    size = physique.leg_ratio
    lowered, seated_drop = drop + size * _SAG, drop + size * _SLACK
    down: dict[str, Waypoints] = {}
    up: dict[str, Waypoints] = {}
    for string in physique.trunk_strings:
        # Strings of the pelvis stay above it; those of shoulders and head straighten the trunk.
        ahead = size * physique.tie_height_ratio(string)
        seated, bent = distance - ahead * _AHEAD_SEATED, distance - ahead * _AHEAD_BEFORE_RISING
        # A pelvis with a string moves back first, and the trunk bends forward over it.
        first = seated if physique.holds_pelvis else distance - size * _AHEAD_GOING_DOWN
        down[f"{string}.down"] = [
            (0, 0),
            (0.4, 0),
            (_T_TOUCH, lowered),
            (_T_STRAIGHTEN, lowered),
            (_T_SEATED, seated_drop),
        ]
        down[f"{string}.back"] = [
            (0, 0),
            (_T_BEHIND, first),
            (_T_STRAIGHTEN, first),
            (_T_SEATED, seated),
        ]
        up[f"{string}.down"] = [(0, seated_drop), (_T_BENT, seated_drop), (_T_LIFTED, 0)]
        up[f"{string}.back"] = [(0, seated), (_T_BENT, bent), (_T_FORWARD, bent), (_T_UPRIGHT, 0)]
    return down, up


def _limb_waypoints(
    physique: Physique, start: State, side: str, drop: float, distance: float
) -> tuple[dict[str, Waypoints], dict[str, Waypoints]]:
    """Waypoints of the strings of the limbs of a side: down, and up."""
    size, arm = physique.leg_ratio, physique.arm_ratio(side)
    knee, hand = physique.knee_string(side), physique.hand_string(side)
    knee_end, hand_end = physique.end(start, knee), physique.end(start, hand)
    slack = size * _KNEE_SLACK + _KNEE_SLACK_PER_DEPTH * (drop - size * _LEVEL_DEPTH)
    back, lift = knee_end.real + distance - size * _KNEE_ENDS_AHEAD, size * _KNEE_LIFT
    lap = {
        "back": hand_end.real - arm * _LAP["forward"],
        side: arm * _LAP["out"] - abs(hand_end.imag),
        "down": _LAP["down"] * drop,
    }
    down: dict[str, Waypoints] = {
        f"{knee}.down": [(0, 0), (1.0, -lift), (_T_BEHIND, -lift), (_T_STRAIGHTEN, slack)],
        f"{knee}.back": [(0, 0), (_T_BEHIND, back)],
    }
    up: dict[str, Waypoints] = {
        f"{knee}.down": [(0, slack), (_T_FORWARD, slack), (_T_UPRIGHT, 0)],
        f"{knee}.back": [(0, back), (_T_FORWARD, back), (_T_UPRIGHT, 0)],
    }
    for way, offset in lap.items():
        arrival, departure = (_T_SEATED, _T_BENT) if way == "down" else (_T_TOUCH, _T_FORWARD)
        down[f"{hand}.{way}"] = [(0, 0), (arrival, offset)]
        up[f"{hand}.{way}"] = [(0, offset), (departure, offset), (_T_UPRIGHT, 0)]
    return down, up
