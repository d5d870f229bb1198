"""Captured motion: a skeleton and the positions of its joints over time.

A clip is a captured motion, and a frame one of its instants.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Indices, ShortRepr, StateError, Times, UnknownNameError, frozen

_UNIT_SIZES = {"cm": 0.01, "m": 1.0, "inches": 0.0254, "mm": 0.001, "CMU": 0.0254 / 0.45}
"""Units of captured people, with their sizes [m]; the last is that of the CMU database."""
_PERSON_HEIGHT = 1.7
"""Usual height of a person [m]."""
_MIN_CALIBRATION_JUMP_RATIO, _N_COMPARED_FRAMES = 10.0, 20
"""Least ratio of the joints' jump after a calibration pose to that between any of the next frames,
and the number of these frames."""
_MAX_BONE_CHANGE = 0.2
"""Largest change of a bone's length, relative to the skeleton's longest bone."""
_MIN_VERTICAL_EXTENT = 0.7
"""Least extent of a rest pose along an axis that may be vertical, relative to the largest one."""
_MAX_ASYMMETRY = 0.02
"""Largest mean distance of a symmetric skeleton from its reflection, relative to its extent."""
_MIN_STANDING_EXTENT = 0.9
"""Smallest extent along the vertical of a standing skeleton, relative to its rest pose."""
_ROUNDING = 1e-6
"""Rounding of the times of frames [s]."""


@dataclass(frozen=True, repr=False)
class Skeleton(ShortRepr):
    """A tree of joints.

    Attributes:
        names: names of the joints; the end of a chain has its joint's name with ``.end``.
        parents: index of each joint's parent, -1 for a root; parents come first.
        offsets: (n, 3) positions in the parents' frames with all angles 0, in the file's unit.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array

    def index(self, name: str) -> int:
        """Index of a joint.

        Raises:
            UnknownNameError: no joint has this name.
        """
        if name not in self.names:
            raise UnknownNameError("joint", name, self.names)
        return self.names.index(name)

    @property
    def rest(self) -> Array:
        """(n, 3) positions of the joints relative to the root, with all angles 0."""
        positions = np.zeros_like(self.offsets)
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                positions[i] = positions[parent] + self.offsets[i]
        return positions

    def vertical_axis(self, joints: Indices) -> int | None:
        """Vertical axis of the rest pose: 1 for y, 2 for z; None if the pose does not determine it.

        It is the one of the two along which the extent of the joints is close to the largest
        extent. In a T-pose facing x both qualify; the axis along which the skeleton is symmetric is
        then excluded.

        Args:
            joints: indices of the joints of the body.
        """
        positions = self.rest[joints]
        extents = np.ptp(positions, axis=0)
        axes = [axis for axis in (1, 2) if extents[axis] > _MIN_VERTICAL_EXTENT * extents.max()]
        if len(axes) == 2:
            axes = [axis for axis in axes if not _is_symmetric(positions, axis)]
        return axes[0] if len(axes) == 1 else None


def _is_symmetric(points: Array, axis: int) -> bool:
    """Whether points (n, 3) are symmetric under reflection along an axis."""
    mirrored = points.copy()
    mirrored[:, axis] = points[:, axis].min() + points[:, axis].max() - points[:, axis]
    distances = np.linalg.norm(points[:, None] - mirrored, axis=2).min(axis=1)
    return float(distances.mean()) < _MAX_ASYMMETRY * float(np.ptp(points, axis=0).max())


@dataclass(frozen=True, eq=False)
class Capture:
    """Motion of a skeleton.

    Attributes:
        skeleton: tree of joints.
        t: (T,) times [s].
        positions: (T, n, 3) positions of the joints: in the file's unit and axes as read, in metres
            with z up after :meth:`upright`.
        rotations: (T, n, 3, 3) orientations of the joints' frames.
        name: name of the clip.
        notes: differences between the file and its header.
    """

    skeleton: Skeleton
    t: Times
    positions: Array
    rotations: Array
    name: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in ("t", "positions", "rotations"):
            object.__setattr__(self, field, frozen(getattr(self, field)))

    def __repr__(self) -> str:
        frames, joints = self.positions.shape[:2]
        return f"<Capture {self.name!r}: {joints} joints, {frames} frames, {self.duration:g} s>"

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def body_joints(self) -> Indices:
        """Indices of the joints connected by bones; all joints if bones connect less than half.

        A bone keeps its length in all frames. Some programs add joints at the origin above the
        hips, or targets of inverse kinematics, which have no bones. A person branches at the hips:
        a chain of single joints that leads to them, for instance from the floor, is left out.
        """
        parents, offsets = self.skeleton.parents, self.skeleton.offsets
        lengths = np.linalg.norm(offsets, axis=1)
        components, max_length = (
            np.arange(len(parents)),
            lengths[np.array(parents) >= 0].max(initial=0.0),
        )
        for i, parent in enumerate(parents):
            if parent < 0:
                continue
            if i <= self._first_branch:
                continue
            distances = np.linalg.norm(self.positions[:, i] - self.positions[:, parent], axis=1)
            if np.max(np.abs(distances - lengths[i])) <= _MAX_BONE_CHANGE * max_length:
                components[i] = components[parent]
        largest = np.flatnonzero(components == np.bincount(components).argmax())
        return largest if 2 * len(largest) > len(components) else np.arange(len(components))

    @cached_property
    def _first_branch(self) -> int:
        """Index of the first joint with several children, if a single chain leads to it; else 0."""
        parents = self.skeleton.parents
        children = np.bincount([joint for joint in parents if joint >= 0], minlength=len(parents))
        joint = 0
        while children[joint] == 1 and parents.count(-1) == 1:
            joint = parents.index(joint)
        return joint if children[joint] > 1 else 0

    @cached_property
    def _extent(self) -> Array:
        """(3,) extent of the body along each axis: the median over the frames."""
        return np.asarray(np.median(np.ptp(self.positions[:, self.body_joints], axis=1), axis=0))

    @cached_property
    def vertical_axis(self) -> int:
        """Vertical axis: 1 for y, 2 for z.

        Taken from the rest pose, unless the skeleton stands along the other axis in most frames, as
        in files with a rotated root. Where the rest pose has no clear vertical, it is the axis
        along which the body extends farther in most frames.
        """
        extents, rest_axis = self._extent, self.skeleton.vertical_axis(self.body_joints)
        if rest_axis is None:
            return int(1 + np.argmax(extents[1:]))
        standing_extent, other_axis = (
            _MIN_STANDING_EXTENT * np.ptp(self.skeleton.rest[self.body_joints, rest_axis]),
            3 - rest_axis,
        )
        return (
            other_axis if extents[rest_axis] < standing_extent <= extents[other_axis] else rest_axis
        )

    @property
    def height(self) -> float:
        """Height of the skeleton in its rest pose, in the file's unit.

        Where the rest pose has no clear vertical, the median over the frames.
        """
        axis = self.skeleton.vertical_axis(self.body_joints)
        if axis is None:
            return float(self._extent[self.vertical_axis])
        return float(np.ptp(self.skeleton.rest[self.body_joints, axis]))

    @property
    def unit(self) -> tuple[str, float]:
        """Unit in which the skeleton is as tall as a person, and its size [m]."""
        sizes = {
            name: abs(np.log(self.height * size / _PERSON_HEIGHT))
            for name, size in _UNIT_SIZES.items()
        }
        name = min(sizes, key=lambda unit: sizes[unit])
        return name, _UNIT_SIZES[name]

    def without_calibration(self) -> Capture:
        """Copy without a first frame that is a calibration pose, from which the joints jump.

        Files of the CMU data base begin with one.
        """
        jumps = np.max(np.linalg.norm(np.diff(self.positions, axis=0), axis=2), axis=1)
        if len(jumps) < 3 or not jumps[0] > _MIN_CALIBRATION_JUMP_RATIO * np.max(
            jumps[1 : 1 + _N_COMPARED_FRAMES]
        ):
            return self
        return replace(
            self, t=self.t[1:], positions=self.positions[1:], rotations=self.rotations[1:]
        )

    def holding_single_pose(self, seconds: float) -> Capture:
        """Copy with two frames, ``seconds`` apart, of a single pose; else the capture itself."""
        if len(self.t) > 1:
            return self
        t = self.t[0] + np.array([0.0, seconds])
        positions, rotations = (np.repeat(x, 2, axis=0) for x in (self.positions, self.rotations))
        return replace(self, t=t, positions=positions, rotations=rotations)

    def between(self, begin: float | None, end: float | None) -> Capture:
        """Copy with the frames from one time to another [s]; None for the clip's start or end.

        Raises:
            StateError: there are fewer than two frames between the two times.
        """
        clip_start, clip_end = self.t[0], self.t[-1]
        begin = clip_start if begin is None else begin
        end = clip_end if end is None else end
        is_inside = (self.t >= begin - _ROUNDING) & (self.t <= end + _ROUNDING)
        if np.sum(is_inside) < 2:
            raise StateError(
                f"{self.name or 'the clip'} has {np.sum(is_inside)} frames from {begin:g} s to "
                f"{end:g} s and lasts from {clip_start:g} s to {clip_end:g} s; needed: two frames "
                "or more"
            )
        return replace(
            self,
            t=self.t[is_inside],
            positions=self.positions[is_inside],
            rotations=self.rotations[is_inside],
        )

    def upright(self, up: str | None = None) -> Capture:
        """Copy in metres, with z up. If y was up, x stays and z turns towards the viewer, to -y.

        The unit is guessed from the height. If the vertical is not that of the rest pose,
        :attr:`notes` says so, because the person may lie all the time instead.

        Args:
            up: vertical axis of the file, ``y`` or ``z``; :attr:`vertical_axis` by default.
        """
        if up not in (None, "y", "z"):
            raise StateError(f"up is {up!r}; needed: y or z")
        notes, rest_axis = self.notes, self.skeleton.vertical_axis(self.body_joints)
        if up is None and rest_axis not in (None, self.vertical_axis):
            standing, lying = "xyz"[self.vertical_axis], "xyz"[rest_axis or 0]
            notes += (
                f"{self.name or 'clip'}: taken as standing along {standing}, as in most frames; "
                f"the rest pose stands along {lying}; if the person lies, say that {lying} is up "
                f"(--up {lying})",
            )
        is_z_up = up == "z" or (up is None and self.vertical_axis == 2)
        turn = np.eye(3) if is_z_up else np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
        unit_size = self.unit[1]
        skeleton = Skeleton(
            self.skeleton.names, self.skeleton.parents, unit_size * self.skeleton.offsets @ turn.T
        )
        return replace(
            self,
            skeleton=skeleton,
            positions=unit_size * self.positions @ turn.T,
            rotations=turn @ self.rotations @ turn.T,
            notes=notes,
        )
