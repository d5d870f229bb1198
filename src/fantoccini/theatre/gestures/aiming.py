"""Pointing at places and looking at them, by hanging poses of the puppet.

A hand moves to 90 % of the arm's length from the shoulder. A head does not turn by its string: all
ends of the strings turn about the middle between the shoulders, and the head's string tilts the
face.

A hanging pose is the pose at rest for given driven coordinates q_K, the ends and lengths of
strings. A marionette is a puppet with its compiled equations; `marionette.puppet` is the
description in its file. A member is a puppet of a scene. The heading is the angle of the forward
direction, seen from above.
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
from fantoccini.theatre.gestures.ends import Ends, scale_curve
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.reachable import reachable_part
from fantoccini.theatre.gestures.walking import rise_and_return

AimTarget = str | Sequence[float]
"""Place [m], or name of a body for its place at the start."""

_REACH_SHARE = 0.9
"""Distance of the pointing hand from the shoulder, relative to the arm's length."""
_MAX_SPEED = 0.5
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
        target: target (3,) in the puppet's world [m].

    Args:
        marionette: puppet or scene.
        start: state at rest.
        prefix: prefix of the member's names.
        target: place, or name of a body.
        mistakes: collects mistakes.

    Raises:
        InputError: the target is not a place.
        StateError: a member of a scene has other strings than the bundled marionette.
    """

    def __init__(
        self,
        marionette: Marionette,
        start: State,
        prefix: str,
        target: AimTarget,
        mistakes: Mistakes,
    ):
        bodies = [link.name for link in marionette.tree.links]
        if isinstance(target, str):
            name = prefix + target if prefix + target in bodies else target
            try:
                position = marionette.pose(start, name)[:3, 3]
            except UnknownNameError as error:
                mistakes.add(("to",), str(error))
        else:
            position = np.array(target, dtype=float)
            if position.shape != (3,) or not np.all(np.isfinite(position)):
                mistakes.add(
                    ("to",), f"found {target!r}; needed: three numbers, or the name of a body"
                )
        mistakes.raise_if_any()
        self.puppet, self.x0 = marionette, start
        if prefix or marionette.puppet.touching is not None:
            self.puppet = _puppet_without_contact(marionette, prefix)
            # Hands and knees hang as bundled: with the member's lengths the rest may be unstable.
            strings = BodyParts.for_puppet(marionette, prefix.removesuffix(".")).strings(
                "head", "trunk"
            )
            names = [f"{string}.{part}" for string in strings for part in ("x", "y", "length")]
            self.x0 = self.puppet.rest({name: float(start[prefix + name]) for name in names})
            if prefix and prefix[:-1] in bodies:
                frame = marionette.pose(start, prefix[:-1])
                position = frame[:3, :3].T @ (position - frame[:3, 3])
        self.target, self.body_parts = position, BodyParts.for_puppet(self.puppet)

    def bounds_for(self, strings: tuple[str, ...]) -> Bounds:
        """Bounds under which only the given strings move."""
        names = self.puppet.coordinates.q_K
        return Bounds(held=tuple(x for x in names if x.rpartition(".")[0] not in strings))

    def direction(self, origin: Array, mistakes: Mistakes) -> Array:
        """(3,) direction from an origin towards the place.

        Raises:
            InputError: the place is at the origin.
        """
        offset = self.target - origin
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
    ends = Ends(BodyParts.for_puppet(puppet), start)
    for part_name in ("arm_left", "arm_right") if name == "point" else ("head",):
        ends.body_parts.strings(part_name)


def pointing_gesture(ends: Ends, aim: Aim, mistakes: Mistakes) -> Gesture:
    """Gesture of the hand on the side of the place, which rises and points to the place.

    Raises:
        InputError: no hanging pose points to the place.
        StateError: the puppet has no arm on this side, or no string moves it.
    """
    puppet, x0 = aim.puppet, aim.x0
    relative_target = np.exp(-1j * aim.body_parts.heading) * (
        complex(*aim.target[:2]) - ends.middle
    )
    side = "left" if relative_target.imag > 0.0 else "right"
    strings = aim.body_parts.strings(f"arm_{side}")
    arm = aim.body_parts.body_map.parts[f"arm_{side}"]
    hand_body, hand_point = arm.bodies[-1], arm.end
    joint_positions = [puppet.pose(x0, body)[:3, 3] for body in arm.bodies]
    arm_length = float(
        sum(np.linalg.norm(b - a) for a, b in pairwise(joint_positions))
        + np.linalg.norm(hand_point)
    )
    shoulder, bounds = joint_positions[0], aim.bounds_for(strings)
    aim.direction(shoulder, mistakes)

    def pose_towards(target: Array) -> ReachedPose:
        offset = target - shoulder
        hand_goal = shoulder + _REACH_SHARE * arm_length * offset / np.linalg.norm(offset)
        return reach(puppet, {(hand_body, hand_point): hand_goal}, x0, bounds=bounds)[0]

    try:
        pose = pose_towards(aim.target)
        reason = "" if pose else _unreached_text(aim.target, shoulder, pose_towards)
    except StateError as error:
        reason = str(error)
    if reason:
        mistakes.add(("to",), f"the {side} hand cannot point there: {reason}")
    mistakes.raise_if_any()
    names = _driven_coordinates(puppet, strings)
    offsets = {name: float(pose.state[name] - ends.start[ends.prefix + name]) for name in names}
    largest_offset = max(map(abs, offsets.values()))
    rise_time = max(_MIN_MOVE_TIME, polynomial.minimum_jerk_duration(largest_offset, _MAX_SPEED))
    t, curve = rise_and_return(rise_time, _HOLD_TIME)
    for name, offset in offsets.items():
        ends.add(name, scale_curve(offset, curve))
    return ends.gesture(t, "point", {"points": rise_time}, travels=False)


def looking_gesture(ends: Ends, aim: Aim, mistakes: Mistakes) -> Gesture:
    """Gesture that turns the face towards a place, as far as the strings allow.

    Raises:
        InputError: the place is at the neck.
        StateError: the puppet has no head, or no string moves it.
    """
    puppet, x0, heading = aim.puppet, aim.x0, aim.body_parts.heading
    strings = aim.body_parts.strings("head")
    head = aim.body_parts.body_map.head
    assert head is not None, "a head has strings"
    relative_target = np.exp(-1j * heading) * (complex(*aim.target[:2]) - ends.middle)
    is_apart = abs(relative_target) > _MIN_DISTANCE
    turn = float(np.clip(np.angle(relative_target), -_MAX_TURN, _MAX_TURN)) if is_apart else 0.0
    turned_ends: dict[str, float] = {}
    for name, position in ends.positions.items():
        turned = np.exp(1j * turn) * (position - ends.middle) + ends.middle
        turned_ends |= {f"{name}.x": float(turned.real), f"{name}.y": float(turned.imag)}
    lengths = [name for name in puppet.coordinates.q_K if name.endswith(".length")]
    turned_state = puppet.rest(turned_ends | {name: float(x0[name]) for name in lengths})
    neck = puppet.pose(turned_state, head.body)[:3, 3]
    elevation = float(np.arcsin(aim.direction(neck, mistakes)[2]))
    tilt, face_angle = float(np.clip(elevation, *_TILT_RANGE)), heading + turn
    face = np.array(
        [np.cos(tilt) * np.cos(face_angle), np.cos(tilt) * np.sin(face_angle), np.sin(tilt)]
    )
    local_forward = aim.body_parts.own_axes(head.body).T @ [np.cos(heading), np.sin(heading), 0.0]
    x, y, z = (_FACE_DISTANCE * local_forward).tolist()
    targets: dict[TargetKey, Array] = {(head.body, (x, y, z)): neck + _FACE_DISTANCE * face}
    pose = reach(puppet, targets, turned_state, bounds=aim.bounds_for(strings))[0].state
    # A remaining error is accepted: the head's strings can do no more.
    offsets = {
        name: float(pose[name] - turned_state[name])
        for name in _driven_coordinates(puppet, strings)
    }
    largest_offset = max(map(abs, offsets.values()))
    turn_time = max(
        _MIN_MOVE_TIME,
        _TIME_PER_TURN * abs(turn),
        polynomial.minimum_jerk_duration(largest_offset, _MAX_SPEED),
    )
    t, curve = rise_and_return(turn_time, _HOLD_TIME)
    ends.move_rigidly((np.zeros(len(t), dtype=complex),) * 3, scale_curve(turn, curve))
    for name, offset in offsets.items():
        ends.add(name, scale_curve(offset, curve))
    return ends.gesture(t, "look", {"there": turn_time}, travels=False)


def _unreached_text(
    target: Array, shoulder: Array, pose_towards: Callable[[Array], ReachedPose]
) -> str:
    """Reason why a hand cannot point at a place, with a lower height that it can point at."""
    n_steps = max(0, int(np.ceil((target[2] - shoulder[2]) / _HEIGHT_STEP)))
    step = np.array([0.0, 0.0, -_HEIGHT_STEP])
    reachable = (
        reachable_part(lambda k: bool(pose_towards(target + (n_steps - k) * step)), n_steps)
        if n_steps
        else None
    )
    if reachable is not None:
        lowering = (n_steps - reachable) * _HEIGHT_STEP
        return f"the place is too high; needed: {lowering:.2f} m lower, or farther away"
    (miss,) = pose_towards(target).distances.values()
    return f"it comes no nearer to that direction than {100.0 * miss:.0f} cm"


def _puppet_without_contact(marionette: Marionette, prefix: str) -> Marionette:
    """Puppet of a scene's member, or a puppet with contact, in its own scene without contact."""
    string_names = {string.name.removeprefix(prefix) for string in marionette.tree.strings}
    if string_names >= {string.name for string in _bundled_marionette().tree.strings}:
        return _bundled_marionette()
    if prefix:
        raise StateError(
            f"{prefix[:-1]} looks and points only by itself: in a scene that needs the strings of "
            "the bundled marionette; load the gesture for its puppet alone"
        )
    return Marionette(marionette.puppet.model_copy(update={"contact": None}))


@cache
def _bundled_marionette() -> Marionette:
    return load(bundled_files.path("marionette"))


def _driven_coordinates(puppet: Marionette, strings: tuple[str, ...]) -> list[str]:
    """Driven coordinates of strings."""
    names = [f"{string}.{part}" for string in strings for part in ("x", "y", "length")]
    return [name for name in names if name in puppet.coordinates.q_K]
