"""Targets of the parts of a puppet that moves as a person does.

Directions are those of the person, lengths those of the puppet:

    x_hips(t) = s x_hips,clip(t),   x_end(t) = x_begin(t) + l d(t)   for each bone

with the length l of each part of the puppet, its direction d(t) in the clip, and the ratio s of the
puppet's leg to the person's. The heading is the angle of the forward direction, seen from above.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, rotation, unit
from fantoccini.theatre.capture import Capture
from fantoccini.theatre.retarget.figure import Figure, axes_along, axes_of
from fantoccini.theatre.retarget.mapping import LIMBS, SIDES

_MAX_STRETCH = 0.97
"""Largest distance between the ends of a limb, relative to a straight one."""
_MIN_LENGTH = 1e-3
"""Least length of a part of a person [m]."""
_MIN_HEADING_SINE = 0.3
"""Least sine of the angle between the left-right line of a trunk and the vertical, for which the
trunk has a heading."""
_PARTS_OF_HALVES = (
    ("neck", *(f"shoulder_{side}" for side in SIDES)),
    tuple(f"hip_{side}" for side in SIDES),
)
"""Names of points on the upper and on the lower half of a trunk."""
_FLOOR_PERCENTILE = 2.0
"""Percentage of the frames in which the lower foot may be below the floor."""


@dataclass(frozen=True, eq=False)
class PartTargets:
    """Targets over time.

    Attributes:
        parts: joint of a person, such as ``elbow_left`` -> (T, 3) target of this point [m];
            ``trunk`` is the midpoint of the hips.
        frames: body of the puppet, such as ``trunk`` -> (T, 3, 4) its orientation and origin.
        scale: ratio s of the puppet's leg to the person's.
    """

    parts: Mapping[str, Array]
    frames: Mapping[str, Array]
    scale: float


def part_targets(
    figure: Figure,
    clip: Capture,
    joints: Mapping[str, int],
    travel: float = 1.0,
    turning: float = 1.0,
) -> PartTargets:
    """Targets of a puppet's parts from a clip.

    The clip begins at the puppet's place and heading; its floor is at the puppet's lower foot.

    Args:
        figure: bodies and joints of the puppet, as a person's.
        clip: clip in metres, with z up.
        joints: part -> index of the joint.
        travel: share of the horizontal motion that is kept; 0 stays on the spot.
        turning: share of the trunk's turning about the vertical that is kept; with 0 the puppet
            keeps its heading.

    Raises:
        StateError: a part of the skeleton has no length, or a position is not finite.
    """
    positions = {part: clip.positions[:, i] for part, i in joints.items()}
    _check_positions(clip, positions)
    head_rotations = clip.rotations[:, joints["head"]]
    if turning != 1.0:
        turns = _removing_turns(positions, 1.0 - turning)
        hips = 0.5 * (positions["hip_left"] + positions["hip_right"])
        positions = {
            part: hips + np.einsum("tij,tj->ti", turns, path - hips)
            for part, path in positions.items()
        }
        head_rotations = turns @ head_rotations
    heading_turn = _turn_to_heading(figure, positions)
    positions = {part: value @ heading_turn.T for part, value in positions.items()}
    head_rotations = heading_turn @ head_rotations
    person_leg = float(
        np.median(_distances(positions, "hip", "knee") + _distances(positions, "knee", "foot"))
    )
    scale = figure.leg_length / person_leg
    axes = _trunk_axes(positions)
    parts = {"trunk": _hips_targets(figure, positions, scale, travel)}
    halves = _trunk_halves(figure, positions, axes, parts["trunk"])
    for half, half_parts in zip(halves, _PARTS_OF_HALVES, strict=True):
        for part in half_parts:
            parts[part] = half.point + half.turn @ (figure.local_point(part) - half.at)
    frames = {
        body: _frames(half.turn, half.point - half.turn @ half.at)
        for body, half in zip(("trunk", "hips"), halves, strict=True)
        if body in figure.bodies
    }
    head_turn = _head_axes(axes, head_rotations) @ figure.axes.T
    frames["head"] = _frames(head_turn, parts["neck"])
    parts["head"] = parts["neck"] + head_turn @ figure.local_point("head")
    for side in SIDES:
        for limb, half in zip(LIMBS, halves, strict=True):
            begin, middle, end, upper, lower = (f"{name}_{side}" for name in limb)
            upper_turn = _turned_along(
                half.turn, figure.local_point(middle), positions[middle] - positions[begin]
            )
            lower_turn = _turned_along(
                half.turn, figure.local_point(end), positions[end] - positions[middle]
            )
            frames[upper] = _frames(upper_turn, parts[begin])
            parts[middle] = parts[begin] + upper_turn @ figure.local_point(middle)
            frames[lower] = _frames(lower_turn, parts[middle])
            vectors = parts[middle] + lower_turn @ figure.local_point(end) - parts[begin]
            max_length = _MAX_STRETCH * sum(
                np.linalg.norm(figure.local_point(part)) for part in (middle, end)
            )
            lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
            parts[end] = parts[begin] + vectors * np.minimum(
                1.0, max_length / np.maximum(lengths, 1e-9)
            )
    return PartTargets(parts, frames, scale)


@dataclass(frozen=True, eq=False)
class _TrunkHalf:
    """Half of a trunk over time.

    Attributes:
        turn: (T, 3, 3) orientation of its body.
        point: (T, 3) position of a point of the body [m].
        at: (3,) the point in the body's frame [m].
    """

    turn: Array
    point: Array
    at: Array


def _trunk_halves(
    figure: Figure, positions: Mapping[str, Array], axes: Array, hips: Array
) -> tuple[_TrunkHalf, _TrunkHalf]:
    """Upper and lower half of the trunk, the same if it has no waist.

    Both point up from the hips to the shoulders. The line of the shoulders turns the upper half
    about that direction, the line of the hips the lower one.

    Args:
        figure: bodies and joints of the puppet, as a person's.
        positions: part -> (T, 3) position of the person.
        axes: (T, 3, 3) columns forward, left, up of the trunk.
        hips: (T, 3) targets of the midpoint between the hips.
    """
    if figure.lower_trunk is None:
        half = _TrunkHalf(axes @ figure.axes.T, hips, figure.local_point("trunk"))
        return half, half
    shoulder_line, hip_line = (
        positions[f"{p}_left"] - positions[f"{p}_right"] for p in ("shoulder", "hip")
    )
    up = axes[..., 2]
    lower_turn = axes_along(up, hip_line) @ figure.lower_trunk.axes.T
    waist = hips + lower_turn @ (figure.lower_trunk.waist - figure.local_point("trunk"))
    upper_turn = axes_along(up, shoulder_line) @ figure.axes.T
    return (
        _TrunkHalf(upper_turn, waist, figure.lower_trunk.waist_in_trunk),
        _TrunkHalf(lower_turn, hips, figure.local_point("trunk")),
    )


def _trunk_axes(positions: Mapping[str, Array]) -> Array:
    """(T, 3, 3) columns forward, left, up of the trunk."""
    return axes_of(
        positions["shoulder_left"],
        positions["shoulder_right"],
        positions["hip_left"],
        positions["hip_right"],
    )


def _check_positions(clip: Capture, positions: Mapping[str, Array]) -> None:
    """Raises StateError if a position is not finite, or a part of the person has no length."""
    name = clip.name or "clip"
    for part, path in positions.items():
        if not np.all(np.isfinite(path)):
            frame = int(np.argmin(np.all(np.isfinite(path), axis=1)))
            raise StateError(f"{name}: {part} is nowhere in frame {frame}; needed: finite numbers")
    spans = {
        f"from {first}_{side} to {second}_{side}": positions[f"{first}_{side}"]
        - positions[f"{second}_{side}"]
        for first, second in (
            ("shoulder", "elbow"),
            ("elbow", "hand"),
            ("hip", "knee"),
            ("knee", "foot"),
            ("shoulder", "hip"),
        )
        for side in SIDES
    }
    spans |= {
        f"from {part}_left to {part}_right": positions[f"{part}_left"] - positions[f"{part}_right"]
        for part in ("shoulder", "hip")
    }
    for points_text, vectors in spans.items():
        if not np.median(np.linalg.norm(vectors, axis=1)) > _MIN_LENGTH:
            raise StateError(f"{name}: the skeleton has no length {points_text}")


def _removing_turns(positions: Mapping[str, Array], share: float) -> Array:
    """(T, 3, 3) turns about z that remove a share of the trunk's turning since the first frame.

    They are interpolated where the trunk lies on its side, so that its heading is undefined.
    """
    left = _trunk_axes(positions)[..., 1]
    valid_frames = np.flatnonzero(np.hypot(left[:, 0], left[:, 1]) > _MIN_HEADING_SINE)
    heading = np.zeros(len(left))
    if len(valid_frames):
        angles = np.unwrap(np.arctan2(-left[valid_frames, 0], left[valid_frames, 1]))
        heading = np.interp(np.arange(len(left)), valid_frames, angles - angles[0])
    c, s = np.cos(share * heading), np.sin(share * heading)
    turns = np.tile(np.eye(3), (len(left), 1, 1))
    turns[:, 0, 0], turns[:, 0, 1], turns[:, 1, 0], turns[:, 1, 1] = c, s, -s, c
    return turns


def _turn_to_heading(figure: Figure, positions: Mapping[str, Array]) -> Array:
    """(3, 3) turn about z after which the clip begins at the puppet's heading."""
    left = _trunk_axes({part: path[:1] for part, path in positions.items()})[0][:, 1]
    angle = np.arctan2(figure.forward[1], figure.forward[0]) - np.arctan2(-left[0], left[1])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _hips_targets(
    figure: Figure, positions: Mapping[str, Array], scale: float, travel: float
) -> Array:
    """(T, 3) targets of the midpoint between the hips."""
    hips = 0.5 * (positions["hip_left"] + positions["hip_right"])
    feet = np.minimum(positions["foot_left"][:, 2], positions["foot_right"][:, 2])
    clip_floor = float(np.percentile(feet, _FLOOR_PERCENTILE))
    puppet_floor = min(figure.positions[f"foot_{side}"][2] for side in SIDES)
    targets = figure.positions["trunk"] + scale * travel * (hips - hips[0])
    targets[:, 2] = puppet_floor + scale * (hips[:, 2] - clip_floor)
    return np.asarray(targets)


def _head_axes(trunk_axes: Array, head_rotations: Array) -> Array:
    """(T, 3, 3) columns forward, left, up of the head, with the mean orientation of the trunk.

    Skeletons differ in the orientation of a head's frame; the mean over the clip counts as upright.
    """
    mean_rotation = np.mean(trunk_axes.swapaxes(1, 2) @ head_rotations, axis=0)
    u, _, v = np.linalg.svd(mean_rotation)
    neutral = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return np.asarray(head_rotations @ neutral.T)


def _turned_along(trunk: Array, axis: Array, vectors: Array) -> Array:
    """(T, 3, 3) orientations of the trunk, turned least so that `axis` points along `vectors`."""
    current, wanted = unit(trunk @ axis), unit(vectors)
    return rotation.matrix(rotation.shortest(current, wanted)) @ trunk


def _frames(turn: Array, origin: Array) -> Array:
    """(T, 3, 4) frames with these orientations and origins."""
    return np.concatenate([turn, origin[:, :, None]], axis=2)


def _distances(positions: Mapping[str, Array], first: str, second: str) -> Array:
    """(T,) distances between two parts on the left [m]."""
    return np.asarray(
        np.linalg.norm(positions[f"{first}_left"] - positions[f"{second}_left"], axis=1)
    )
