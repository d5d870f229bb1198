"""Poses of links and positions of points, by numerical forward kinematics.

A link is a body on its joint. q_D and q_K are the dynamic and driven coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fantoccini.base import rotation
from fantoccini.base.documents import Number
from fantoccini.model.tree.coordinates import Role
from fantoccini.model.tree.structure import WORLD, Link, Point

Value = Callable[[Number], float]


def link_poses(
    links: Sequence[Link], q_D: np.ndarray, q_K: np.ndarray, number: Value
) -> np.ndarray:
    """World poses (R | r) of links.

    Args:
        links: links, parents before children.
        q_D, q_K: (T, n_qD) and (T, n_qK) configurations; one of them may have a single row.
        number: function from a number of the file, or its parameter, to the value.

    Returns:
        (T, n_links, 3, 4).
    """
    n = max(len(q_D), len(q_K))
    poses = np.zeros((n, len(links), 3, 4))
    for k, link in enumerate(links):
        q = (q_D if link.role is Role.DYNAMIC else q_K)[:, link.q]
        parent_pose = np.broadcast_to(np.eye(3, 4), (n, 3, 4))
        if link.parent != WORLD:
            parent_pose = poses[:, link.parent]
        R, r = _joint_transforms(link, q)
        to_joint = parent_pose[:, :, :3] @ link.rotation
        offset = _numbers(link.offset, number)
        poses[:, k, :, :3] = to_joint @ R
        poses[:, k, :, 3] = (to_joint @ r[:, :, None])[..., 0] + parent_pose[:, :, :3] @ offset
        poses[:, k, :, 3] += parent_pose[:, :, 3]
    return poses


def point_position(poses: np.ndarray, point: Point, number: Value) -> np.ndarray:
    """(T, 3) position of a point [m], from (T, n_links, 3, 4) poses of the links."""
    local_position = _numbers(point.at, number)
    if point.link == WORLD:
        return np.tile(local_position, (len(poses), 1))
    return poses[:, point.link, :, :3] @ local_position + poses[:, point.link, :, 3]


def _numbers(numbers: tuple[Number, ...], number: Value) -> np.ndarray:
    return np.array([number(n) for n in numbers])


def joint_transform(
    link: Link, q: Sequence[Any], cos: Callable[[Any], Any], sin: Callable[[Any], Any]
) -> tuple[list[list[Any]], list[Any]]:
    """Rotation (3 x 3 entries) and translation (3 entries) of a joint's motion.

    Args:
        link: link that the joint carries.
        q: configuration of the joint: numbers, arrays (T,) or symbols.
        cos, sin: functions for these.
    """
    R: list[list[Any]] = np.eye(3).tolist()
    r: list[Any] = [0.0, 0.0, 0.0]
    match link.kind:
        case "revolute":
            R = rotation.about_rows(link.axes[:, 0].tolist(), cos(q[0]), sin(q[0]))
        case "prismatic" | "translation":
            columns = link.axes.tolist()
            r = [sum(a * x for a, x in zip(row, q, strict=True)) for row in columns]
        case "ball":
            R = rotation.matrix_rows(*q)
        case "free":
            R, r = rotation.matrix_rows(*q[3:]), list(q[:3])
    return R, r


def _joint_transforms(link: Link, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (T, 3, 3) and translation (T, 3) of a joint's motion at q (T, n)."""
    if link.kind in ("ball", "free"):
        unit = q[:, -4:] / np.linalg.norm(q[:, -4:], axis=1, keepdims=True)
        q = np.hstack([q[:, :-4], unit])
    rows, translation = joint_transform(link, list(q.T), np.cos, np.sin)
    R, r = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
    for i in range(3):
        r[:, i] = translation[i]
        for j in range(3):
            R[:, i, j] = rows[i][j]
    return R, r
