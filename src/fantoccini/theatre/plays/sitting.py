"""Gestures that sit down on a seat behind the puppet, and stand up again.

    q_K(t) = q_K0 + d(t)

Offsets are those of the bundled marionette, relative to its rest, as in
:mod:`fantoccini.theatre.cast.prop_gestures`.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.cast import BODY, FEET, SEATED, Waypoints, gesture_of, of_member
from fantoccini.theatre.gestures import Gesture

_PELVIS_HEIGHT = 0.091
"""Height of the waist above the bottom of the pelvis [m]."""
_SITS_BACK = 0.005
"""Distance of the strings before the middle of the seat while the puppet sits down [m]."""
_LEANS, _RISES = 0.075, 0.115
"""Distance of the strings before the middle of the seat afterwards, which sets the trunk upright,
and before standing up, with the weight over the feet [m]."""
_SLACK, _SAG = 0.005, 0.008
"""Additional length of the strings beyond the descent, at the end and on the way, so that the seat
bears weight [m]."""
_KNEES, _KNEES_SLACK, _KNEES_GIVE = 0.085, 0.025, 0.3
"""Distance of the ends of the knees' strings before the others, in front of the knees, so that they
lean forward and do not cross; their additional length [m], and its increase relative to the
descent beyond :data:`_LEVEL`."""
_KNEES_UP = 0.012
"""Length by which they are wound in until the seat is touched: shins pass over the edge [m]."""
_LEVEL = 0.114
"""Depth of a seat below the pelvis with which the knees are as high as at rest [m]."""
_LAP = {"back": 0.05, "out": 0.08, "down": 0.8}
"""Offsets of the hands' strings, back and out, with which the hands lie on the thighs, outside the
knees' strings [m]; and down, relative to the descent."""
_TOUCHES, _SITS, _DOWN = 2.6, 3.0, 4.0
"""Times at which the puppet touches the seat, begins to set itself upright, and sits [s]."""
_BENDS, _OFF, _UP, _STANDS = 0.8, 1.6, 3.4, 3.6
"""Times at which it has bent forward, its strings move back, have lifted it, and are back [s]."""
_SEATS = (0.09, 0.18)
"""Lowest and highest seat below the pelvis [m]."""


@dataclass(frozen=True)
class Sitting:
    """Gestures with which a puppet sits down on a seat behind it, and stands up again.

    Attributes:
        down: gesture of sitting down, with the mark ``down``.
        up: gesture back to the place where it stood, with the mark ``up``.
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
    distance: float = 0.135,
    start: State | None = None,
) -> Sitting:
    """Gestures that sit a puppet down on a seat behind it, and stand it up again.

    It goes back and down, sets itself upright, and lets its hands sink onto its thighs in 4 s; then
    it bends forward, and stands again at its place in 3.6 s.

    Args:
        stage: the scene.
        who: member that sits down.
        on: name of the prop or obstacle with the seat.
        height: height of the seat [m].
        distance: distance of the seat's middle behind the puppet [m].
        start: state at rest; ``stage.rest()`` by default.

    Raises:
        InputError: the member's strings differ from those of the bundled marionette.
        ValueError: the seat is too low or too high, or so near that the puppet stands on it.
    """
    start = stage.rest() if start is None else start
    drop = float(stage.pose(start, of_member(who, "torso"))[2, 3]) - _PELVIS_HEIGHT - height
    low, high = _SEATS
    if not low <= drop <= high:
        raise ValueError(f"the seat is {drop:.3f} m below the pelvis; needed: {low} to {high} m")
    if not 0.12 <= distance <= 0.2:
        raise ValueError(f"the seat is {distance:g} m behind; needed: 0.12 to 0.2 m")
    first, seated, bent = distance - _SITS_BACK, distance - _LEANS, distance - _RISES
    down: dict[str, Waypoints] = {}
    up: dict[str, Waypoints] = {}
    there = _TOUCHES - 0.6
    for string in BODY:
        sagged, rests = drop + _SAG, drop + _SLACK
        down[f"{string}.down"] = [
            (0, 0),
            (0.4, 0),
            (_TOUCHES, sagged),
            (_SITS, sagged),
            (_DOWN, rests),
        ]
        down[f"{string}.back"] = [(0, 0), (there, first), (_SITS, first), (_DOWN, seated)]
        up[f"{string}.down"] = [(0, rests), (_BENDS, rests), (_UP, 0)]
        up[f"{string}.back"] = [(0, seated), (_BENDS, bent), (_OFF, bent), (_STANDS, 0)]
    gives, back = _KNEES_SLACK + _KNEES_GIVE * (drop - _LEVEL), distance - _KNEES
    lap = {"back": _LAP["back"], "out": _LAP["out"], "down": _LAP["down"] * drop}
    for side in ("left", "right"):
        knee, hand = f"knee_{side}", f"hand_{side}"
        down[f"{knee}.down"] = [(0, 0), (1.0, -_KNEES_UP), (there, -_KNEES_UP), (_SITS, gives)]
        down[f"{knee}.back"] = [(0, 0), (there, back)]
        up[f"{knee}.down"] = [(0, gives), (_OFF, gives), (_STANDS, 0)]
        up[f"{knee}.back"] = [(0, back), (_OFF, back), (_STANDS, 0)]
        for way, offset in lap.items():
            begins = _BENDS if way == "down" else _OFF
            down[f"{hand}.{way}"] = [(0, 0), (_DOWN if way == "down" else _TOUCHES, offset)]
            up[f"{hand}.{way}"] = [(0, offset), (begins, offset), (_STANDS, 0)]
    return Sitting(
        gesture_of(stage, who, down, "sit", {"down": _DOWN}),
        gesture_of(stage, who, up, "stand up", {"up": _STANDS}),
        distance,
        tuple((of_member(who, part), on) for part in (*SEATED, *FEET)),
    )
