"""Pointing at places and looking at them, by hanging poses of the puppet.

A hand moves to 90 % of the arm's length from the shoulder. A head does not turn by its string: all
ends of the strings turn about the middle between the shoulders, and the head's string tilts the
face.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, polynomial
from fantoccini.base.documents import Mistakes
from fantoccini.control.optimal import ReachedPose, TargetKey, reach
from fantoccini.control.tasks import Bounds
from fantoccini.dynamics.marionette import Marionette, load
from fantoccini.model.puppet import bundled_files
from fantoccini.motion import State
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Ends, times
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.reachable import reachable_part
from fantoccini.theatre.gestures.walking import rise_and_return

AimTarget = str | Sequence[float]
"""Place [m], or name of a body for its place at the start."""

_ARM_SHARE = 0.9
"""Distance of the pointing hand from the shoulder, relative to the arm's length."""
_SPEED = 0.5
"""Largest speed of the strings' ends and lengths [m/s]."""
_MIN_MOVE_TIME, _HOLD_TIME = 0.7, 1.5
"""Least duration of the motion, and time for which the hand points or the face looks [s]."""
_TIME_PER_TURN = 1.8
"""Duration of a turn, relative to its angle [s/rad]."""
_MAX_TURN = np.radians(85.0)
"""Largest turn of a face to a side [rad]."""
_TILT_RANGE = np.radians((-45.0, 0.0))
"""Lowest and highest tilt of a face [rad]: the head's string cannot tilt it up."""
_FACE_DISTANCE = 0.1
"""Distance from the head's joint of the point in front of the face that is aimed [m]."""
_HEIGHT_STEP = 0.01
"""Step by which a place that is too high is lowered [m]."""
_MIN_DISTANCE = 0.02
"""Least distance of a place from the shoulder or the neck [m]."""


class Aim:
    """Target of a look or a pointing hand, with the puppet for which the pose is computed.

    Attributes:
        puppet, x0: puppet for the poses, and its rest: the bundled marionette for members with its
            strings, otherwise the puppet without contact.
        body_parts: parts of its body.
        place: target (3,) in the puppet's world [m].

    Args:
        marionette: puppet or scene.
        start: state at rest.
        of: prefix of the member's names.
        to: place, or name of a body.
        mistakes: collects mistakes.

    Raises:
        InputError: the target is not a place.
        StateError: a member of a scene has other strings than the bundled marionette.
    """

    def __init__(
        self, marionette: Marionette, start: State, of: str, to: AimTarget, mistakes: Mistakes
    ):
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
        mistakes.raise_if_any()
        self.puppet, self.x0 = marionette, start
        if of or marionette.puppet.touching is not None:
            self.puppet = _without_contact(marionette, of)
            # Hands and knees hang as bundled: with the member's lengths the rest may be unstable.
            strings = BodyParts.of(marionette, of.removesuffix(".")).strings("head", "trunk")
            names = [f"{string}.{part}" for string in strings for part in ("x", "y", "length")]
            self.x0 = self.puppet.rest({name: float(start[of + name]) for name in names})
            if of and of[:-1] in bodies:
                frame = marionette.pose(start, of[:-1])
                place = frame[:3, :3].T @ (place - frame[:3, 3])
        self.place, self.body_parts = place, BodyParts.of(self.puppet)

    def bounds_for(self, strings: tuple[str, ...]) -> Bounds:
        """Bounds under which only the given strings move."""
        names = self.puppet.coordinates.q_K
        return Bounds(held=tuple(x for x in names if x.rpartition(".")[0] not in strings))

    def direction(self, origin: Array, mistakes: Mistakes) -> Array:
        """(3,) direction from an origin towards the place.

        Raises:
            InputError: the place is at the origin.
        """
        offset = self.place - origin
        distance = float(np.linalg.norm(offset))
        if distance < _MIN_DISTANCE:
            mistakes.add(
                ("to",), f"is {distance:.3f} m away; needed: a place {_MIN_DISTANCE:g} m away"
            )
        mistakes.raise_if_any()
        return offset / distance


def check_parts(puppet: Marionette, start: State, name: str) -> None:
    """Checks that a puppet has the parts of the body for ``look`` or ``point``.

    Raises:
        StateError: one is missing, or an end or length of a string is not driven.
    """
    ends = Ends(BodyParts.of(puppet), start)
    for part in ("arm_left", "arm_right") if name == "point" else ("head",):
        ends.body_parts.strings(part)


def point(ends: Ends, aim: Aim, mistakes: Mistakes) -> Gesture:
    """Gesture of the hand on the side of the place, which rises and points to the place.

    Raises:
        InputError: no hanging pose points to the place.
        StateError: the puppet has no arm on this side, or no string moves it.
    """
    puppet, x0 = aim.puppet, aim.x0
    ahead = np.exp(-1j * aim.body_parts.heading) * (complex(*aim.place[:2]) - ends.middle)
    side = "left" if ahead.imag > 0.0 else "right"
    strings = aim.body_parts.strings(f"arm_{side}")
    arm = aim.body_parts.body_map.parts[f"arm_{side}"]
    hand, at = arm.bodies[-1], arm.end
    joints = [puppet.pose(x0, body)[:3, 3] for body in arm.bodies]
    length = float(sum(np.linalg.norm(b - a) for a, b in pairwise(joints)) + np.linalg.norm(at))
    shoulder, bounds = joints[0], aim.bounds_for(strings)
    aim.direction(shoulder, mistakes)

    def pose_towards(place: Array) -> ReachedPose:
        offset = place - shoulder
        goal = shoulder + _ARM_SHARE * length * offset / np.linalg.norm(offset)
        return reach(puppet, {(hand, at): goal}, x0, bounds=bounds)[0]

    try:
        solution = pose_towards(aim.place)
        reason = "" if solution else _unreached(aim.place, shoulder, pose_towards)
    except StateError as error:
        reason = str(error)
    if reason:
        mistakes.add(("to",), f"the {side} hand cannot point there: {reason}")
    mistakes.raise_if_any()
    names = _channels(puppet, strings)
    offsets = {name: float(solution.state[name] - ends.start[ends.prefix + name]) for name in names}
    farthest = max(map(abs, offsets.values()))
    move_time = max(_MIN_MOVE_TIME, polynomial.minimum_jerk_duration(farthest, _SPEED))
    t, curve = rise_and_return(move_time, _HOLD_TIME)
    for name, offset in offsets.items():
        ends.add(name, times(offset, curve))
    return ends.gesture(t, "point", {"points": move_time}, travels=False)


def look(ends: Ends, aim: Aim, mistakes: Mistakes) -> Gesture:
    """Gesture that turns the face towards a place, as far as the strings allow.

    Raises:
        InputError: the place is at the neck.
        StateError: the puppet has no head, or no string moves it.
    """
    puppet, x0, first = aim.puppet, aim.x0, aim.body_parts.heading
    strings = aim.body_parts.strings("head")
    head = aim.body_parts.body_map.head
    assert head is not None, "a head has strings"
    z = np.exp(-1j * first) * (complex(aim.place[0], aim.place[1]) - ends.middle)
    turn = float(np.clip(np.angle(z), -_MAX_TURN, _MAX_TURN)) if abs(z) > _MIN_DISTANCE else 0.0
    q = {}
    for name, place in ends.places.items():
        z = np.exp(1j * turn) * (place - ends.middle) + ends.middle
        q[f"{name}.x"], q[f"{name}.y"] = float(z.real), float(z.imag)
    lengths = [name for name in puppet.coordinates.q_K if name.endswith(".length")]
    turned = puppet.rest(q | {name: float(x0[name]) for name in lengths})
    neck = puppet.pose(turned, head.body)[:3, 3]
    up = float(np.arcsin(aim.direction(neck, mistakes)[2]))
    tilt, angle = float(np.clip(up, *_TILT_RANGE)), first + turn
    face = np.array([np.cos(tilt) * np.cos(angle), np.cos(tilt) * np.sin(angle), np.sin(tilt)])
    ahead = aim.body_parts.own_axes(head.body).T @ [np.cos(first), np.sin(first), 0.0]
    x, y, z = (_FACE_DISTANCE * ahead).tolist()
    targets: dict[TargetKey, Array] = {(head.body, (x, y, z)): neck + _FACE_DISTANCE * face}
    pose = reach(puppet, targets, turned, bounds=aim.bounds_for(strings))[0].state
    # A remaining error is accepted: the head's strings can do no more.
    offsets = {name: float(pose[name] - turned[name]) for name in _channels(puppet, strings)}
    farthest = max(map(abs, offsets.values()))
    move_time = max(
        _MIN_MOVE_TIME,
        _TIME_PER_TURN * abs(turn),
        polynomial.minimum_jerk_duration(farthest, _SPEED),
    )
    t, curve = rise_and_return(move_time, _HOLD_TIME)
    ends.carry((np.zeros(len(t), dtype=complex),) * 3, times(turn, curve))
    for name, offset in offsets.items():
        ends.add(name, times(offset, curve))
    return ends.gesture(t, "look", {"there": move_time}, travels=False)


def _unreached(place: Array, shoulder: Array, pose_towards: Callable[[Array], ReachedPose]) -> str:
    """Reason why a hand cannot point at a place, with a lower height that it can point at."""
    n = max(0, int(np.ceil((place[2] - shoulder[2]) / _HEIGHT_STEP)))
    down = np.array([0.0, 0.0, -_HEIGHT_STEP])
    part = reachable_part(lambda k: bool(pose_towards(place + (n - k) * down)), n) if n else None
    if part is not None:
        lower = (n - part) * _HEIGHT_STEP
        return f"the place is too high; needed: {lower:.2f} m lower, or farther away"
    (distance,) = pose_towards(place).distances.values()
    return f"it comes no nearer to that direction than {100.0 * distance:.0f} cm"


def _without_contact(marionette: Marionette, of: str) -> Marionette:
    """Puppet of a scene's member, or a puppet with contact, in its own scene without contact."""
    strings = {string.name.removeprefix(of) for string in marionette.tree.strings}
    if strings >= {string.name for string in _bundled().tree.strings}:
        return _bundled()
    if of:
        raise StateError(
            f"{of[:-1]} looks and points only by itself: in a scene that needs the strings of the "
            "bundled marionette; load the gesture for its puppet alone"
        )
    return Marionette(marionette.puppet.model_copy(update={"contact": None}))


@cache
def _bundled() -> Marionette:
    return load(bundled_files.path("marionette"))


def _channels(puppet: Marionette, strings: tuple[str, ...]) -> list[str]:
    """Driven coordinates of strings."""
    names = [f"{string}.{part}" for string in strings for part in ("x", "y", "length")]
    return [name for name in names if name in puppet.coordinates.q_K]
