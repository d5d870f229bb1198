"""Pointing at places and looking at them, by hanging poses of the puppet.

A hand goes to 90 % of the arm's length from the shoulder. One string does not turn a head: all
ends of the strings turn about the middle between the shoulders, and the head's string tilts the
face.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, polynomial
from fantoccini.base.documents import Mistakes, value_of
from fantoccini.control.optimal import ReachedPose, reach
from fantoccini.control.tasks import Bounds
from fantoccini.dynamics.marionette import Marionette, load
from fantoccini.model.puppet import bundled_files
from fantoccini.motion import State
from fantoccini.theatre.gestures.ends import BODY, Ends, times
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.reachable import reachable_part
from fantoccini.theatre.gestures.walking import there_and_back

To = str | Sequence[float]
"""A place [m], or the name of a body whose place at the start is meant."""

_ARM_SHARE = 0.9
"""Distance of the pointing hand from the shoulder, relative to the arm's length."""
_SPEED = 0.5
"""Largest speed of the strings' ends and lengths [m/s]."""
_MIN_WAY_TIME, _HOLD_TIME = 0.7, 1.5
"""Least time to move there, and time for which the hand points or the face looks [s]."""
_TURN_TIME = 1.8
"""Time of a turn, relative to its angle [s/rad]."""
_MAX_TURN = np.radians(85.0)
"""Largest turn of a face to a side [rad]."""
_TILTS = np.radians((-45.0, 0.0))
"""Lowest and highest tilt of a face [rad]: the head's string cannot tilt it up."""
_FACE = 0.1
"""Distance before the skull's joint of the point that is led to the place's direction [m]."""
_PARTS = {
    "look": ("skull",),
    "point": ("upper_arm_left", "forearm_left", "upper_arm_right", "forearm_right"),
}
"""Bodies that move in the poses of looking and pointing."""
_LOWER = 0.01
"""Steps by which a place that is too high is lowered [m]."""
_MIN_DISTANCE = 0.02
"""Least distance of a place from the shoulder or the neck [m]."""


class Aim:
    """Target of a look or a pointing hand, with the puppet for which the pose is computed.

    Attributes:
        puppet, x0: puppet for the poses, and its rest: members, and puppets with contact, are
            replaced by the bundled marionette, whose strings they have.
        place: target (3,) in the puppet's world [m].

    Args:
        marionette: puppet or scene.
        start: state at rest.
        of: prefix of the member's names.
        to: place, or name of a body.
        mistakes: collects mistakes.

    Raises:
        InputError: the target is not a place.
    """

    def __init__(self, marionette: Marionette, start: State, of: str, to: To, mistakes: Mistakes):
        bodies = [link.name for link in marionette.tree.links]
        if isinstance(to, str):
            name = of + to if of + to in bodies else to
            try:
                place = marionette.pose(start, name)[:3, 3]
            except UnknownNameError as error:
                mistakes.add(("to",), str(error))
        else:
            place = np.array(to, dtype=float)
            if place.shape != (3,) or not np.all(np.isfinite(place)):
                mistakes.add(("to",), f"found {to!r}; needed: three numbers, or the name of a body")
        mistakes.refuse()
        self.puppet, self.x0 = marionette, start
        if of or marionette.puppet.touching is not None:
            self.puppet = _by_itself()
            # Hands and knees hang as bundled: with the member's lengths the rest may be unstable.
            names = [f"{string}.{part}" for string in BODY for part in ("x", "y", "length")]
            self.x0 = self.puppet.rest({name: float(start[of + name]) for name in names})
            if of and of[:-1] in bodies:
                frame = marionette.pose(start, of[:-1])
                place = frame[:3, :3].T @ (place - frame[:3, 3])
        self.place = place

    def held(self, string: str) -> Bounds:
        """Bounds under which only one string moves."""
        names = self.puppet.coordinates.q_K
        return Bounds(held=tuple(x for x in names if not x.startswith(f"{string}.")))

    def direction(self, origin: Array, mistakes: Mistakes) -> Array:
        """(3,) direction from an origin towards the place.

        Raises:
            InputError: the place is at the origin.
        """
        way = self.place - origin
        distance = float(np.linalg.norm(way))
        if distance < _MIN_DISTANCE:
            mistakes.add(
                ("to",), f"is {distance:.3f} m away; needed: a place {_MIN_DISTANCE:g} m away"
            )
        mistakes.refuse()
        return way / distance


def check_parts(puppet: Marionette, start: State, name: str) -> None:
    """Checks that a puppet has the strings and bodies for ``look`` or ``point``.

    Raises:
        UnknownNameError: one is missing.
    """
    Ends(puppet.coordinates, start)
    strings = [string.name for string in puppet.tree.strings]
    for string in ("hand_left", "hand_right") if name == "point" else ():
        if string not in strings:
            raise UnknownNameError("string", string, strings)
    # Puppets with contact are posed as the bundled marionette.
    bodies = [link.name for link in puppet.tree.links]
    for body in _PARTS[name] if puppet.puppet.touching is None else ():
        if body not in bodies:
            raise UnknownNameError("body", body, bodies)


def point(ends: Ends, aim: Aim, mistakes: Mistakes) -> Gesture:
    """Gesture of the hand on the side of the place, which goes up and points there.

    Raises:
        InputError: no hanging pose points there.
    """
    puppet, x0 = aim.puppet, aim.x0
    side = "left" if aim.place[1] > ends.middle.imag else "right"
    string, arm, forearm = f"hand_{side}", f"upper_arm_{side}", f"forearm_{side}"
    at = _attached(puppet, string)
    pose = puppet.pose(x0, forearm)
    shoulder, elbow = puppet.pose(x0, arm)[:3, 3], pose[:3, 3]
    length = float(np.linalg.norm(elbow - shoulder) + np.linalg.norm(at))
    bounds = aim.held(string)
    aim.direction(shoulder, mistakes)

    def pose_towards(place: Array) -> ReachedPose:
        way = place - shoulder
        goal = shoulder + _ARM_SHARE * length * way / np.linalg.norm(way)
        return reach(puppet, {(forearm, at): goal}, x0, bounds=bounds)[0]

    try:
        solution = pose_towards(aim.place)
        reason = "" if solution else _why_not(aim.place, shoulder, pose_towards)
    except StateError as error:
        reason = str(error)
    if reason:
        mistakes.add(("to",), f"the {side} hand cannot point there: {reason}")
    mistakes.refuse()
    names = [f"{string}.{part}" for part in ("x", "y", "length")]
    own = {name: float(solution.state[name] - ends.start[ends.of + name]) for name in names}
    way = max(_MIN_WAY_TIME, polynomial.minimum_jerk_duration(max(map(abs, own.values())), _SPEED))
    t, curve = there_and_back(way, _HOLD_TIME)
    for name, offset in own.items():
        ends.add(name, times(offset, curve))
    return ends.gesture(t, "point", {"points": way}, travels=False)


def look(ends: Ends, aim: Aim, mistakes: Mistakes) -> Gesture:
    """Gesture that turns the face towards a place, as far as the strings allow."""
    puppet, x0 = aim.puppet, aim.x0
    flat = complex(aim.place[0], aim.place[1]) - ends.middle
    turn = (
        float(np.clip(np.angle(flat), -_MAX_TURN, _MAX_TURN)) if abs(flat) > _MIN_DISTANCE else 0.0
    )
    q = {}
    for name, place in ends.places.items():
        there = np.exp(1j * turn) * (place - ends.middle) + ends.middle
        q[f"{name}.x"], q[f"{name}.y"] = float(there.real), float(there.imag)
    lengths = [name for name in puppet.coordinates.q_K if name.endswith(".length")]
    turned = puppet.rest(q | {name: float(x0[name]) for name in lengths})
    neck = puppet.pose(turned, "skull")[:3, 3]
    up = float(np.arcsin(aim.direction(neck, mistakes)[2]))
    tilt = float(np.clip(up, *_TILTS))
    face = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    pose = reach(
        puppet, {("skull", (_FACE, 0.0, 0.0)): neck + _FACE * face}, turned, bounds=aim.held("head")
    )[0].state
    # A remaining error is accepted: the head's string can do no more.
    own = {
        f"head.{part}": float(pose[f"head.{part}"] - turned[f"head.{part}"])
        for part in ("x", "y", "length")
    }
    farthest = max(abs(x) for x in own.values())
    way = max(
        _MIN_WAY_TIME, _TURN_TIME * abs(turn), polynomial.minimum_jerk_duration(farthest, _SPEED)
    )
    t, curve = there_and_back(way, _HOLD_TIME)
    ends.carry((np.zeros(len(t), dtype=complex),) * 3, times(turn, curve))
    for name, offset in own.items():
        ends.add(name, times(offset, curve))
    return ends.gesture(t, "look", {"there": way}, travels=False)


def _why_not(place: Array, shoulder: Array, pose_towards: Callable[[Array], ReachedPose]) -> str:
    """Reason why a hand cannot point at a place, and by how much a lower place would do."""
    n = max(0, int(np.ceil((place[2] - shoulder[2]) / _LOWER)))
    down = np.array([0.0, 0.0, -_LOWER])
    part = reachable_part(lambda k: bool(pose_towards(place + (n - k) * down)), n) if n else None
    if part is not None:
        lower = (n - part) * _LOWER
        return f"the place is too high; needed: {lower:.2f} m lower, or farther away"
    (distance,) = pose_towards(place).distances.values()
    return f"it comes no nearer to that direction than {100.0 * distance:.0f} cm"


@cache
def _by_itself() -> Marionette:
    return load(bundled_files.path("marionette"))


def _attached(puppet: Marionette, string: str) -> tuple[float, float, float]:
    """Point at which a string is fixed to a body, in the body's frame [m]."""
    for tied in puppet.tree.strings:
        if tied.name == string:
            x, y, z = (value_of(number) for number in tied.points[0].at)
            return x, y, z
    raise UnknownNameError("string", string, [tied.name for tied in puppet.tree.strings])
