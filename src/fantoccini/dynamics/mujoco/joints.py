"""MuJoCo's joints for a puppet's coordinates, and the pose of a link in its parent.

A link is a body on its joint. A driven length is given as a function of time; a winch changes it.
In names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fantoccini.base import Array, rotation
from fantoccini.base.documents import Number
from fantoccini.model.tree import WORLD, Link, Role, StringRow, Tree


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of MuJoCo, with coordinates equal to the puppet's.

    Quaternions are w, x, y, z. Angular velocities are in the body's axes, the velocity of a free
    joint's origin in the world's.

    Attributes:
        name: name of the coordinate for a hinge or slide, of the puppet's joint otherwise.
        kind: type of the joint in MuJoCo.
        role: dynamic or driven.
        q, v: indices in (q_D, v_D) or (q_K, v_K), by role.
        axis: (3,) axis of a hinge or slide, in the joint frame.
    """

    name: str
    kind: Literal["free", "ball", "hinge", "slide"]
    role: Role
    q: slice
    v: slice
    axis: Array | None = None


def joints_of(link: Link) -> list[Joint]:
    """The joints between a link and its parent, in MuJoCo's order.

    A free joint becomes MuJoCo's own if its coordinates are the link's pose in the world. Otherwise
    it becomes three slides and a ball.
    """
    q, v, name = link.q.start, link.v.start, link.joint
    if link.kind == "fixed":
        return []
    if link.kind == "free" and _is_free_in_world(link):
        return [Joint(name, "free", link.role, link.q, link.v)]
    if link.kind == "revolute":
        return [Joint(name, "hinge", link.role, link.q, link.v, link.axes[:, 0])]
    joints = []
    axes = np.eye(3) if link.kind == "free" else link.axes
    for k, axis in enumerate(axes.T):
        joint_name = name if link.kind == "prismatic" else f"{name}.{'xyz'[int(np.argmax(axis))]}"
        joints.append(
            Joint(
                joint_name,
                "slide",
                link.role,
                slice(q + k, q + k + 1),
                slice(v + k, v + k + 1),
                axis,
            )
        )
    if link.kind in ("ball", "free"):
        n = len(joints)
        slices = slice(q + n, q + n + 4), slice(v + n, v + n + 3)
        joints.append(Joint(name, "ball", link.role, *slices))
    return joints


def winch_of(string: StringRow) -> Joint:
    """Slide joint of a driven length: its coordinate is the length."""
    assert string.driven_length is not None
    q, v = string.driven_length
    slices = slice(q, q + 1), slice(v, v + 1)
    return Joint(f"{string.name}.length", "slide", Role.DRIVEN, *slices, np.array([-1.0, 0.0, 0.0]))


def all_joints(tree: Tree) -> list[Joint]:
    """All joints of a puppet, including those of its winches."""
    joints_of_links = [joint for link in tree.links for joint in joints_of(link)]
    return joints_of_links + [winch_of(s) for s in tree.strings if s.driven_length is not None]


def pose_in_parent(link: Link, q: Array, number: Callable[[Number], float]) -> tuple[Array, Array]:
    """Orientation (3, 3) and origin (3,) of a link in its parent.

    Args:
        link: the link.
        q: configuration of its joint; empty for the joint frame itself.
        number: function from a number of the file, or its parameter, to the value.
    """
    R, r = link.rotation, np.array([number(x) for x in link.offset])
    if not len(q):
        return R, r
    if link.kind == "revolute":
        return R @ rotation.about(link.axes[:, 0], np.cos(q[0]), np.sin(q[0])), r
    axes = np.eye(3) if link.kind == "free" else link.axes
    n = axes.shape[1]
    if link.kind in ("ball", "free"):
        return R @ rotation.matrix(rotation.normalised(q[n:])), r + R @ axes @ q[:n]
    return R, r + R @ axes @ q


def _is_free_in_world(link: Link) -> bool:
    """Whether a free joint has its pose in the world as coordinates, no damping and no armature."""
    is_moved = any(link.offset) or not np.array_equal(link.rotation, np.eye(3))
    is_free = not link.damping and not link.armature
    return link.parent == WORLD and link.role is Role.DYNAMIC and not is_moved and is_free
