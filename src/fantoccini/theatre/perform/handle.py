"""Handles for hands, and the driven coordinates that move them to a place in the world.

A handle is a driven string end, or a body on a driven joint. Driven coordinates q_K follow the
hand, and v_K are their velocities. A link is a body on its joint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base import Array, ConfigK, Quaternion, StateError, Vec3, rotation
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import WORLD, Link, Role

HandlePose = tuple[Vec3, Quaternion]
"""Position (3,) [m] and orientation (4,) as w, x, y, z in the world."""

_MAX_DISTANCE = 1e6
"""Largest coordinate of a target, relative to the origin of the handle's joint [m]."""


@dataclass(frozen=True, eq=False)
class Handle:
    """Driven string end, or body on a driven joint, that a hand can hold.

    Attributes:
        name: name of the string or of the body.
        kind: ``end``, a string's end with a driven position; ``body``, a body on a driven joint.
        joint: fixed, revolute, prismatic, translation, ball or free.
        axes: (k, 3) directions in the world along which it moves, k from 0 to 3; if the joint's
            parent moves, those at the start.
        turn_axes: (k, 3) directions about which it turns, in the same sense.
        coordinates: names of its driven coordinates, as in q_K.
        link: index of its link.
        q, v: indices of its coordinates in q_K and v_K.
        fixed_frame: orientation (3, 3) and origin (3,) of its joint in the world; None if its
            parent moves.
    """

    name: str
    kind: Literal["end", "body"]
    joint: str
    axes: Array
    turn_axes: Array
    coordinates: tuple[str, ...]
    link: int
    q: slice
    v: slice
    fixed_frame: tuple[Array, Vec3] | None = None

    @property
    def translation_indices(self) -> slice:
        """Indices in v_K of its translations."""
        return slice(self.v.start, self.v.start + len(self.axes))

    @property
    def rotation_indices(self) -> slice:
        """Indices in v_K of its rotations."""
        return slice(self.v.stop - len(self.turn_axes), self.v.stop)


def find_handles(marionette: Marionette, poses: Array) -> tuple[Handle, ...]:
    """Handles of a puppet, in the order of its links.

    Args:
        marionette: puppet.
        poses: (n_links, 3, 4) poses of its links.
    """
    handles = []
    for i, link in enumerate(marionette.tree.links):
        command_indices = marionette.tree.commanding(i)
        if command_indices is None:
            continue
        R, r = joint_frame(marionette, link, poses)
        joint_axes, no_axes, all_axes = (R @ link.axes).T, np.zeros((0, 3)), np.eye(3)
        axes, turn_axes = {
            "revolute": (no_axes, joint_axes),
            "prismatic": (joint_axes, no_axes),
            "translation": (joint_axes, no_axes),
            "ball": (no_axes, all_axes),
            "free": (all_axes, all_axes),
        }[link.kind]
        # Names of bodies have no dots: this is a driven string end.
        is_end = link.name.endswith(".end")
        handles.append(
            Handle(
                name=link.joint if is_end else link.name,
                kind="end" if is_end else "body",
                joint=link.kind,
                axes=axes,
                turn_axes=turn_axes,
                coordinates=marionette.coordinates.q_K[command_indices[0]],
                link=i,
                q=command_indices[0],
                v=command_indices[1],
                fixed_frame=(R, r) if _has_fixed_joint(marionette, link) else None,
            )
        )
    return tuple(handles)


def _has_fixed_joint(marionette: Marionette, link: Link) -> bool:
    """Whether the joint of a link is at a fixed place in the world."""
    tree = marionette.tree
    ancestors = tree.ancestors(link.parent) if link.parent != WORLD else ()
    return all(tree.links[i].role is Role.FIXED for i in ancestors)


def joint_frame(marionette: Marionette, link: Link, poses: Array) -> tuple[Array, Vec3]:
    """Orientation (3, 3) and origin (3,) of a link's joint frame in the world."""
    offset = np.array([marionette.number(n) for n in link.offset])
    if link.parent == WORLD:
        return link.rotation, offset
    R, r = poses[link.parent, :, :3], poses[link.parent, :, 3]
    return R @ link.rotation, r + R @ offset


def handle_pose(marionette: Marionette, handle: Handle, q_K: ConfigK, poses: Array) -> HandlePose:
    """Place of a handle at a driven configuration.

    Args:
        marionette: puppet.
        handle: one of its handles.
        q_K: (n_qK,) driven configuration.
        poses: (n_links, 3, 4) poses of the links; may be empty for a joint at a fixed place.
    """
    link = marionette.tree.links[handle.link]
    R, r = handle.fixed_frame or joint_frame(marionette, link, poses)
    q, rotation_in_joint = q_K[handle.q], None
    match link.kind:
        case "revolute":
            rotation_in_joint = rotation.exp(link.axes[:, 0] * q[0])
        case "prismatic" | "translation":
            r = r + R @ (link.axes @ q)
        case "ball":
            rotation_in_joint = q
        case "free":
            r, rotation_in_joint = r + R @ q[:3], q[3:]
    wxyz = rotation.quaternion(R)
    return r, wxyz if rotation_in_joint is None else rotation.normalised(
        rotation.multiply(wxyz, rotation_in_joint)
    )


def handle_coordinates(
    marionette: Marionette,
    handle: Handle,
    q: Array,
    poses: Array,
    position: Vec3 | None,
    wxyz: Quaternion | None,
) -> Array:
    """(n,) coordinates that move a handle as near to a place as its joint allows.

    Args:
        marionette: puppet.
        handle: one of its handles.
        q: (n,) present target, for a position or orientation that is None.
        poses: (n_links, 3, 4) poses of the links; may be empty for a joint at a fixed place.
        position: (3,) position [m], or None.
        wxyz: (4,) orientation, or None.

    Raises:
        StateError: a position or orientation is invalid.
    """
    link = marionette.tree.links[handle.link]
    R, r = handle.fixed_frame or joint_frame(marionette, link, poses)
    q = np.array(q)
    if position is not None and len(handle.axes):
        # Dot is twice as fast as @ for vectors.
        local = R.T.dot(_checked_position(handle, position) - r)
        translation = local if link.kind == "free" else link.axes.T.dot(local)
        q[: len(handle.axes)] = _clipped(translation)
    if wxyz is not None and len(handle.turn_axes):
        target = _checked_orientation(handle, wxyz)
        rotation_in_joint = rotation.multiply(rotation.conjugate(rotation.quaternion(R)), target)
        if link.kind == "revolute":
            angle = 2.0 * np.arctan2(rotation_in_joint[1:] @ link.axes[:, 0], rotation_in_joint[0])
            q[0] = rotation.nearest_angle(angle, q[0])
        else:
            q[-4:] = rotation_in_joint
    return q


def _checked_position(handle: Handle, position: ArrayLike) -> Vec3:
    """(3,) position; raises StateError if it is invalid."""
    vector = np.asarray(position, dtype=float)
    if vector.shape != (3,) or not all(map(math.isfinite, vector.tolist())):
        raise StateError(f"{handle.name}: found {position!r}; a position is three finite numbers")
    return _clipped(vector)


def _clipped(x: Vec3) -> Vec3:
    """Vector with components of at most 1,000 km."""
    components = x.tolist()
    if min(components) >= -_MAX_DISTANCE and max(components) <= _MAX_DISTANCE:
        return x  # the usual case; np.clip takes ten times as long
    return np.clip(x, -_MAX_DISTANCE, _MAX_DISTANCE)


def _checked_orientation(handle: Handle, wxyz: ArrayLike) -> Quaternion:
    """Unit quaternion; raises StateError if it is invalid."""
    quaternion = np.asarray(wxyz, dtype=float)
    if quaternion.shape != (4,) or not np.all(np.isfinite(quaternion)) or not np.any(quaternion):
        raise StateError(
            f"{handle.name}: found {wxyz!r}; an orientation is a quaternion (w, x, y, z), not zero"
        )
    return rotation.normalised(quaternion)
