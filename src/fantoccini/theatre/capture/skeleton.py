"""Captured motion: a skeleton and the positions of its joints over time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Indices, ShortRepr, StateError, Times, UnknownNameError, frozen

_UNITS = {"cm": 0.01, "m": 1.0, "inches": 0.0254, "mm": 0.001, "CMU": 0.0254 / 0.45}
"""Units of captured people, with their sizes [m]; the last is that of the CMU database."""
_PERSON_HEIGHT = 1.7
"""Usual height of a person [m]."""
_MIN_JUMP_RATIO, _N_NEXT_FRAMES = 10.0, 20
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
        placed = np.zeros_like(self.offsets)
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                placed[i] = placed[parent] + self.offsets[i]
        return placed

    def vertical_axis(self, joints: Indices) -> int | None:
        """Vertical axis of the rest pose: 1 for y, 2 for z; None if the pose does not determine it.

        It is the one of the two along which the extent of the joints is close to the largest
        extent. In a T-pose facing x both qualify; the axis along which the skeleton is symmetric is
        then excluded.

        Args:
            joints: indices of the joints of the body.
        """
        places = self.rest[joints]
        extent = np.ptp(places, axis=0)
        axes = [axis for axis in (1, 2) if extent[axis] > _MIN_VERTICAL_EXTENT * extent.max()]
        if len(axes) == 2:
            axes = [axis for axis in axes if not _symmetric(places, axis)]
        return axes[0] if len(axes) == 1 else None


def _symmetric(places: Array, axis: int) -> bool:
    """Whether points (n, 3) are symmetric under reflection along an axis."""
    mirrored = places.copy()
    mirrored[:, axis] = places[:, axis].min() + places[:, axis].max() - places[:, axis]
    apart = np.linalg.norm(places[:, None] - mirrored, axis=2).min(axis=1)
    return float(apart.mean()) < _MAX_ASYMMETRY * float(np.ptp(places, axis=0).max())


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
        length = np.linalg.norm(offsets, axis=1)
        part, longest = np.arange(len(parents)), length[np.array(parents) >= 0].max(initial=0.0)
        for i, parent in enumerate(parents):
            if parent < 0:
                continue
            if i <= self._first_branch:
                continue
            away = np.linalg.norm(self.positions[:, i] - self.positions[:, parent], axis=1)
            if np.max(np.abs(away - length[i])) <= _MAX_BONE_CHANGE * longest:
                part[i] = part[parent]
        body = np.flatnonzero(part == np.bincount(part).argmax())
        return body if 2 * len(body) > len(part) else np.arange(len(part))

    @cached_property
    def _first_branch(self) -> int:
        """Index of the first joint with several children, if a single chain leads to it; else 0."""
        parents = self.skeleton.parents
        children = np.bincount([i for i in parents if i >= 0], minlength=len(parents))
        i = 0
        while children[i] == 1 and parents.count(-1) == 1:
            i = parents.index(i)
        return i if children[i] > 1 else 0

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
        extent, rest = self._extent, self.skeleton.vertical_axis(self.body_joints)
        if rest is None:
            return int(1 + np.argmax(extent[1:]))
        tall, other = (
            _MIN_STANDING_EXTENT * np.ptp(self.skeleton.rest[self.body_joints, rest]),
            3 - rest,
        )
        return other if extent[rest] < tall <= extent[other] else rest

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
            name: abs(np.log(self.height * size / _PERSON_HEIGHT)) for name, size in _UNITS.items()
        }
        name = min(sizes, key=lambda unit: sizes[unit])
        return name, _UNITS[name]

    def without_calibration(self) -> Capture:
        """Copy without a first frame that is a calibration pose, from which the joints jump.

        Files of the CMU data base begin with one.
        """
        steps = np.max(np.linalg.norm(np.diff(self.positions, axis=0), axis=2), axis=1)
        if len(steps) < 3 or not steps[0] > _MIN_JUMP_RATIO * np.max(steps[1 : 1 + _N_NEXT_FRAMES]):
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
        first, last = self.t[0], self.t[-1]
        low, high = (first if begin is None else begin), (last if end is None else end)
        inside = (self.t >= low - _ROUNDING) & (self.t <= high + _ROUNDING)
        if np.sum(inside) < 2:
            raise StateError(
                f"{self.name or 'the clip'} has {np.sum(inside)} frames from {low:g} s to "
                f"{high:g} s and lasts from {first:g} s to {last:g} s; needed: two frames or more"
            )
        return replace(
            self,
            t=self.t[inside],
            positions=self.positions[inside],
            rotations=self.rotations[inside],
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
        notes, rest = self.notes, self.skeleton.vertical_axis(self.body_joints)
        if up is None and rest not in (None, self.vertical_axis):
            stands, lies = "xyz"[self.vertical_axis], "xyz"[rest or 0]
            notes += (
                f"{self.name or 'clip'}: taken as standing along {stands}, as in most frames; the "
                f"rest pose stands along {lies}; if the person lies, say that {lies} is up "
                f"(--up {lies})",
            )
        is_up = up == "z" or (up is None and self.vertical_axis == 2)
        turn = np.eye(3) if is_up else np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
        size = self.unit[1]
        skeleton = Skeleton(
            self.skeleton.names, self.skeleton.parents, size * self.skeleton.offsets @ turn.T
        )
        return replace(
            self,
            skeleton=skeleton,
            positions=size * self.positions @ turn.T,
            rotations=turn @ self.rotations @ turn.T,
            notes=notes,
        )
