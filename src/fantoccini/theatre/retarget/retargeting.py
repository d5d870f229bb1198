"""Retargeting: the hanging poses of a puppet that are nearest to captured motion.

    min  sum_i w_i |x_i(q_D, q_K) - x_i,clip|^2 + w_K |q_K - q_K,above|^2,   the puppet hangs by q_K

With q_K = q_K,above each string is vertical above the point at which it is tied.

q_D are the dynamic coordinates of the puppet and q_K the driven ones, the ends and lengths of
strings; w_i and w_K are weights, and x_i the position of a part. A link is a body on its joint.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.base import Array, StateError, Times, check_not_negative
from fantoccini.control.optimal import ReachedPoses, TargetKey, reach
from fantoccini.control.tasks import AnswerStatus
from fantoccini.dynamics.compiled import refuse_contact
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.capture import Capture, load_bvh
from fantoccini.theatre.retarget.figure import Figure, figure_of
from fantoccini.theatre.retarget.mapping import MappingFile, joints_of, load_mapping, recognise
from fantoccini.theatre.retarget.placing import PartTargets, part_targets

PART_WEIGHTS = {
    "head": 1.0,
    "hand_left": 1.0,
    "hand_right": 1.0,
    "shoulder_left": 1.0,
    "shoulder_right": 1.0,
    "trunk": 0.3,
    "knee_left": 0.3,
    "knee_right": 0.3,
    "foot_left": 0.3,
    "foot_right": 0.3,
}
"""w_i of the followed parts."""
_VERTICAL_WEIGHT = 0.03
"""w_K, the weight of vertical strings."""
_POSE_TIME = 1.0
"""Duration for which a single pose is held [s]."""
_TOLERANCE = 3e-4
"""Distance from the nearest pose at which a search ends [m]."""
MAX_ITERATIONS = 10
"""Largest number of iterations for a pose after the first, which starts from the previous pose."""
_FIRST_ITERATIONS = 100
"""Largest number of iterations for the first pose."""
LEAN_FACTORS = 1.8, 2.6
"""Factors of the strings' lean at rest, tried in turn while strings cross."""
_MIN_UPWARD = 0.5
"""Vertical component of the trunk's unit direction below which a person lies or crawls."""


@dataclass(frozen=True, eq=False)
class RetargetedClip:
    """Clip with the hanging poses of a puppet that are nearest to it.

    Attributes:
        marionette: puppet.
        figure: puppet as a person.
        clip: clip in metres, with z up.
        t: (T,) times of the frames, from 0 [s].
        targets: targets of the puppet's parts.
        hanging_poses: nearest hanging poses.
    """

    marionette: Marionette
    figure: Figure
    clip: Capture
    t: Times
    targets: PartTargets
    hanging_poses: ReachedPoses

    def __repr__(self) -> str:
        worst = max(float(np.sqrt(np.mean(part_errors**2))) for part_errors in self.errors.values())
        return (
            f"<RetargetedClip {self.clip.name!r}: {len(self.t)} poses of {self.marionette.name!r}, "
            f"{self.settled} of them settled, {1e3 * worst:.3g} mm from the clip at most (root "
            "mean square)>"
        )

    @property
    def settled(self) -> int:
        """Number of poses that no small change improves; for others the search ended too early."""
        are_minima = (AnswerStatus.REACHED, AnswerStatus.OUT_OF_REACH)
        return sum(status in are_minima for status in self.hanging_poses.status)

    @cached_property
    def hanging_positions(self) -> dict[str, Array]:
        """Part -> (T, 3) position in the hanging poses."""
        poses = self.marionette.poses(self.hanging_poses.q_D, self.hanging_poses.q_K)
        return part_positions(self.figure, poses)

    @cached_property
    def errors(self) -> dict[str, Array]:
        """Part -> (T,) distance [m] of the pose from the clip; a local minimum if settled."""
        return {
            part: np.linalg.norm(self.hanging_positions[part] - self.targets.parts[part], axis=1)
            for part in PART_WEIGHTS
        }

    @property
    def remarks(self) -> tuple[str, ...]:
        """Signs that the clip may be placed wrongly."""
        vertical_components = self.targets.frames["trunk"][:, 2, :3] @ self.figure.axes[:, 2]
        upward = float(np.median(vertical_components))
        if upward > _MIN_UPWARD:
            return ()
        angle = np.degrees(np.arccos(max(upward, -1.0)))
        return (
            f"the trunk is {angle:.0f} degrees off the vertical in half of "
            "the frames; if nobody lies or crawls in the clip, give the axis of the file that is "
            "up: `y` or `z`",
        )

    @property
    def start(self) -> State:
        """First pose, at rest."""
        return self.marionette.rest(self.hanging_poses[0].state)


@dataclass(frozen=True, eq=False)
class PlacedClip:
    """Clip with the targets of a puppet's parts.

    Attributes:
        figure: puppet as a person.
        start: state at rest.
        clip: clip in metres, with z up.
        targets: targets of the parts.
        lean: required lean of the strings, as a multiple of that at rest; 0 is vertical.
    """

    figure: Figure
    start: State
    clip: Capture
    targets: PartTargets
    lean: float = 0.0


def place_clip(
    marionette: Marionette,
    clip: Capture | str | os.PathLike[str],
    mapping: MappingFile | str | os.PathLike[str] | None = None,
    start: State | None = None,
    travel: float = 1.0,
    up: str | None = None,
    turning: float = 1.0,
    of: str = "",
    begin: float | None = None,
    end: float | None = None,
) -> PlacedClip:
    """Targets of a puppet's parts in captured motion, or in a part of it.

    There is no search, so that mistakes in a clip are reported at once.

    Args:
        marionette, clip, mapping, start, travel, up, turning, of: see :func:`retarget_clip`.
        begin, end: part of the clip to follow, in its time [s]; all of it by default.
    """
    if not isinstance(clip, Capture):
        clip = load_bvh(clip)
    refuse_contact(marionette, "follow")
    check_not_negative(travel=travel, turning=turning)
    name = clip.name or "clip"
    clip = clip.holding_single_pose(_POSE_TIME).without_calibration()
    if mapping is None:
        recognised = recognise(clip.skeleton, name, clip.positions)
        mapping = recognised.mapping
        clip = replace(clip, notes=clip.notes + recognised.notes(name))
    elif not isinstance(mapping, MappingFile):
        mapping = load_mapping(mapping)
    joints = joints_of(mapping, clip.skeleton, name)
    # The vertical and the unit are guessed from the whole clip.
    clip = clip.upright(_trunk_axis(clip, joints) if up is None else up).between(begin, end)
    start = marionette.rest() if start is None else start
    figure = figure_of(marionette, start, mapping.puppet, of)
    return PlacedClip(figure, start, clip, part_targets(figure, clip, joints, travel, turning))


def retarget_clip(
    marionette: Marionette,
    clip: Capture | PlacedClip | str | os.PathLike[str],
    mapping: MappingFile | str | os.PathLike[str] | None = None,
    start: State | None = None,
    travel: float = 1.0,
    up: str | None = None,
    turning: float = 1.0,
    of: str = "",
) -> RetargetedClip:
    """Hanging poses of a puppet that are nearest to captured motion, one for each frame.

    Args:
        marionette: puppet without contact.
        clip: motion; a BVH file, or the result of :func:`load_bvh`.
        mapping: joints of the parts of a person: a file, or the name of a bundled mapping; by
            default the bundled one with the skeleton's joint names, or else one found by the shape
            of the skeleton, which the clip's notes report.
        start: state at rest from which the search for the first pose begins.
        travel: share of the horizontal motion that is kept; with 0 the puppet stays on the spot.
        up: vertical axis of the file, ``y`` or ``z``; by default that of the rest pose or, if it is
            not clear, the main direction of the trunk.
        turning: share of the trunk's turning about the vertical that is kept; with 0 the puppet
            keeps its heading.
        of: name of the scene's puppet that follows the clip; by default the only one with the
            parts of a person.

    Raises:
        FileError: the files have mistakes, or joints are missing.
        StateError: the puppet does not have the bodies of a person, or has contact; or the vertical
            axis of the clip is unclear.
        ValueError: a negative share.
    """
    if not isinstance(clip, PlacedClip):
        clip = place_clip(marionette, clip, mapping, start, travel, up, turning, of)
    figure, start, targets = clip.figure, clip.start, clip.targets
    reach_targets: dict[TargetKey, Any] = {
        figure.points[part]: targets.parts[part] for part in PART_WEIGHTS
    }
    weights: dict[TargetKey, float] = {figure.points[part]: w for part, w in PART_WEIGHTS.items()}
    string_targets = vertical_strings(figure, targets.frames, start, clip.lean)
    for coordinate, values in string_targets.items():
        reach_targets[coordinate] = values
        weights[coordinate] = _VERTICAL_WEIGHT
    first_targets = {target: values[:1] for target, values in reach_targets.items()}
    options: dict[str, Any] = {
        "slack": True,
        "tolerance": _TOLERANCE,
        "weights": weights,
        "single_pass": True,
    }
    first_state = marionette.rest(
        reach(marionette, first_targets, start, iterations=_FIRST_ITERATIONS, **options)[0].state
    )
    try:
        reached_poses = reach(
            marionette, reach_targets, first_state, iterations=MAX_ITERATIONS, **options
        )
    except StateError:  # a small change of the first pose would make the puppet tip over
        reached_poses = reach(
            marionette, reach_targets, start, iterations=MAX_ITERATIONS, **options
        )
    t = clip.clip.t - clip.clip.t[0]
    return RetargetedClip(marionette, figure, clip.clip, t, targets, reached_poses)


def _trunk_axis(clip: Capture, joints: Mapping[str, int]) -> str | None:
    """Main direction of the trunk as the vertical axis; None if the rest pose determines it."""
    if clip.skeleton.vertical_axis(clip.body_joints) is not None:
        return None
    positions = {part: clip.positions[:, i] for part, i in joints.items()}
    shoulders, hips = (
        positions[f"{part}_left"] + positions[f"{part}_right"] for part in ("shoulder", "hip")
    )
    direction = np.mean(shoulders - hips, axis=0)
    axis = int(np.argmax(np.abs(direction)))
    if axis == 0 or direction[axis] < 0.0:
        raise StateError(
            f"{clip.name or 'clip'}: trunks point along {'-' if direction[axis] < 0.0 else ''}"
            f"{'xyz'[axis]}; needed: along y or z; give the axis that is up: `y` or `z`"
        )
    return "xyz"[axis]


def part_positions(figure: Figure, poses: Array) -> dict[str, Array]:
    """Part -> (T, 3) positions in poses (T, n_links, 3, 4)."""
    positions = {}
    for part, (body, point) in figure.points.items():
        frames = poses[:, figure.marionette.link_index(body)]
        positions[part] = frames[:, :, :3] @ np.array(point) + frames[:, :, 3]
    return positions


@dataclass(frozen=True, eq=False)
class TiedString:
    """String that is tied to a part of the figure, and its upper end.

    Attributes:
        name: name of the string.
        part: part of the puppet to which it is tied.
        at: (3,) tied point, in the part's frame [m].
        top: (3,) upper end at the start [m].
        ends: driven coordinate of the upper end -> (3,) its axis in the world.
        length: driven coordinate of the string's length; empty for strings of fixed length.
    """

    name: str
    part: str
    at: Array
    top: Array
    ends: Mapping[str, Array]
    length: str


def tied_strings(figure: Figure, start: State) -> list[TiedString]:
    """Strings tied to parts of a figure, with the positions of their upper ends in a state."""
    marionette = figure.marionette
    tree, table = marionette.tree, marionette.coordinates
    parts = {marionette.link_index(body): part for part, body in figure.bodies.items()}
    poses = marionette.poses(start.q_D[None], start.q_K[None])[0]
    driven = {table.q_K[q] for q, _ in table.scalars_K}
    strings = []
    for string in tree.strings:
        points = sorted(string.points, key=lambda point: point.link not in parts)
        tie, top_end = points[0], points[-1]
        if tie.link not in parts or top_end.link < 0 or len(points) != 2:
            continue
        link, pose = tree.links[top_end.link], poses[top_end.link]
        top_position = pose[:, :3] @ _numbers(marionette, top_end.at) + pose[:, 3]
        names = table.q_K[link.q]
        moves = link.kind == "translation" and set(names) <= driven
        axes = dict(zip(names, (pose[:, :3] @ link.axes).T, strict=True)) if moves else {}
        length = table.q_K[string.driven_length[0]] if string.driven_length else ""
        at = _numbers(marionette, tie.at)
        strings.append(TiedString(string.name, parts[tie.link], at, top_position, axes, length))
    return strings


def vertical_strings(
    figure: Figure, frames: Mapping[str, Array], start: State, lean: float = 0.0
) -> dict[str, Array]:
    """Driven scalar -> (T,) values that make the strings vertical.

    Coordinates without a string keep their value in the state.

    Args:
        figure: figure of the puppet.
        frames: part -> (T, 3, 4) orientation and origin of its body.
        start: state.
        lean: multiple of the strings' lean in that state, turned with the trunk; the strings of
            the head stay vertical.
    """
    table, n = figure.marionette.coordinates, len(frames["trunk"])
    values = {table.q_K[q]: np.full(n, start.q_K[q]) for q, _ in table.scalars_K}
    poses = figure.marionette.poses(start.q_D[None], start.q_K[None])[0]
    for string in tied_strings(figure, start):
        frame = frames[string.part]
        tie_positions = frame[:, :, :3] @ string.at + frame[:, :, 3]
        offset = np.zeros(3)
        if lean and string.part != "head":
            pose = poses[figure.marionette.link_index(figure.bodies[string.part])]
            offset = lean * (string.top - pose[:, :3] @ string.at - pose[:, 3]) * [1.0, 1.0, 0.0]
            offset = _heading(figure, frames["trunk"]) @ offset
        for name, axis in string.ends.items():
            values[name] = values[name] + (tie_positions + offset - string.top) @ axis
        if string.length:
            height = np.maximum(string.top[2] - tie_positions[:, 2], 0.01)
            values[string.length] = np.hypot(height, np.linalg.norm(offset, axis=-1))
    return values


def _heading(figure: Figure, trunk: Array) -> Array:
    """(T, 3, 3) turns about z from the puppet's heading at the start to that of its trunk."""
    left = trunk[:, :, :3] @ figure.axes[:, 1]
    angle = np.arctan2(-left[:, 0], left[:, 1]) - np.arctan2(figure.forward[1], figure.forward[0])
    c, s, turn = np.cos(angle), np.sin(angle), np.tile(np.eye(3), (len(left), 1, 1))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c, -s, s, c
    return turn


def _numbers(model: Any, at: Any) -> Array:
    return np.array([model.number(x) for x in at], dtype=float)
