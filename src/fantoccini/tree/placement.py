"""Where links and points are, by plain forward kinematics: nothing is derived for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.puppet import Number
from fantoccini.tree.coordinates import Role
from fantoccini.tree.structure import WORLD, Link, Point

Value = Callable[[Number], float]


def link_poses(
    links: Sequence[Link], q_D: np.ndarray, q_K: np.ndarray, number: Value
) -> np.ndarray:
    """World poses (R | r) of links.

    Args:
        links: parents before children.
        q_D: (T, n_qD), or (1, n_qD) where the other has T rows.
        q_K: (T, n_qK) or (1, n_qK).
        number: value of a number of the puppet.

    Returns:
        (T, n_links, 3, 4).
    """
    n = max(len(q_D), len(q_K))
    out = np.zeros((n, len(links), 3, 4))
    for k, link in enumerate(links):
        q = (q_D if link.role is Role.DYNAMIC else q_K)[:, link.q]
        up = np.broadcast_to(np.eye(3, 4), (n, 3, 4))
        if link.parent != WORLD:
            up = out[:, link.parent]
        R, r = _joint(link, q)
        to_joint = up[:, :, :3] @ link.rotation
        offset = _numbers(link.offset, number)
        out[:, k, :, :3] = to_joint @ R
        out[:, k, :, 3] = (to_joint @ r[:, :, None])[..., 0] + up[:, :, :3] @ offset
        out[:, k, :, 3] += up[:, :, 3]
    return out


def place(poses: np.ndarray, point: Point, number: Value) -> np.ndarray:
    """(T, 3) place of a point [m], from (T, n_links, 3, 4) poses of the links."""
    at = _numbers(point.at, number)
    if point.link == WORLD:
        return np.tile(at, (len(poses), 1))
    return poses[:, point.link, :, :3] @ at + poses[:, point.link, :, 3]


def _numbers(numbers: tuple[Number, ...], number: Value) -> np.ndarray:
    return np.array([number(n) for n in numbers])


def _joint(link: Link, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (T, 3, 3) and translation (T, 3) of a joint's motion at q (T, n)."""
    turns, slides = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    match link.kind:
        case "revolute":
            turns = Rotation.from_rotvec(q * link.axes[:, 0]).as_matrix()
        case "prismatic" | "translation":
            slides = q @ link.axes.T
        case "ball":
            turns = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
        case "free":
            slides, turns = q[:, :3], Rotation.from_quat(q[:, [4, 5, 6, 3]]).as_matrix()
    return turns, slides
