"""Poses by plain forward kinematics, for a look at a puppet that nobody has compiled.

A notebook shows a puppet when its cell ends; deriving and compiling it then would take seconds to
minutes. Pictures ask little of a marionette: where its links and its strings' points are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.arrays import Array
from fantoccini.motion import State
from fantoccini.puppet import Number, Parameter
from fantoccini.tree import WORLD, Link, Point, Role, Tree
from fantoccini.world import World


def file_value(number: Number) -> float:
    """A number of the puppet's file; of a parameter the value that the file gives it."""
    return float(number.value) if isinstance(number, Parameter) else float(number)


class Still:
    """Offers what the pictures ask of a Marionette, without a compiled model.

    Args:
        world: the puppets, obstacles and floor.
        tree: its links and strings.
        number: value of a number of the puppet.
    """

    def __init__(self, world: World, tree: Tree, number: Callable[[Number], float] = file_value):
        self.world, self.tree, self.number = world, tree, number
        self.coordinates = tree.coordinates

    def start(self) -> State:
        """The file's pose, at rest. Strings just reach where it names no length."""
        table, strings = self.coordinates, self.tree.strings
        q_D, q_K = table.start_D.copy(), table.start_K.copy()
        spans = np.array(
            [
                np.linalg.norm(np.diff(points[0], axis=0), axis=1).sum()
                for points in self.string_points(np.nan_to_num(q_D), np.nan_to_num(q_K))
            ]
        )
        for span, string in zip(spans, strings, strict=True):
            for place, q in ((string.driven_length, q_K), (string.wound_length, q_D)):
                if place is not None and np.isnan(q[place[0]]):
                    q[place[0]] = span
        taut = np.zeros(self.tree.n_rows, dtype=bool)
        lengths = self.string_lengths(q_D, q_K)[0]
        taut[: len(strings)] = spans >= lengths * (1.0 - 1e-3)
        return State(0.0, q_D, np.zeros(table.n_vD), q_K, np.zeros(table.n_vK), taut)

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """(T, n_links, 3, 4) poses of the links, for (T, n_qD) and (T, n_qK) or one of each."""
        q_D, q_K = np.atleast_2d(q_D), np.atleast_2d(q_K)
        out = np.zeros((len(q_D), len(self.tree.links), 3, 4))
        for k, link in enumerate(self.tree.links):
            q = (q_D if link.role is Role.DYNAMIC else q_K)[:, link.q]
            up = np.broadcast_to(np.eye(3, 4), (len(q_D), 3, 4))
            if link.parent != WORLD:
                up = out[:, link.parent]
            R, r = _joint(link, q)
            to_joint = up[:, :, :3] @ link.rotation
            offset = self._numbers(link.offset)
            out[:, k, :, :3] = to_joint @ R
            out[:, k, :, 3] = (to_joint @ r[:, :, None])[..., 0] + up[:, :, :3] @ offset
            out[:, k, :, 3] += up[:, :, 3]
        return out

    def string_points(self, q_D: Array, q_K: Array) -> list[Array]:
        """For each string (T, n_points, 3) the points it passes [m]."""
        poses = self.poses(q_D, q_K)
        return [
            np.stack([self._carried(poses, point) for point in string.points], axis=1)
            for string in self.tree.strings
        ]

    def string_lengths(self, q_D: Array, q_K: Array) -> Array:
        """(T, n_strings) lengths [m], for (T, n_qD) and (T, n_qK) or one of each."""
        return self.tree.string_lengths(np.atleast_2d(q_D), np.atleast_2d(q_K), self.number)

    def _carried(self, poses: Array, point: Point) -> Array:
        at = self._numbers(point.at)
        if point.link == WORLD:
            return np.tile(at, (len(poses), 1))
        return poses[:, point.link, :, :3] @ at + poses[:, point.link, :, 3]

    def _numbers(self, numbers: tuple[Number, ...]) -> Array:
        return np.array([self.number(n) for n in numbers])


def _joint(link: Link, q: Array) -> tuple[Array, Array]:
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
