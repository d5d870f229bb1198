"""Sizes of shapes and puppets: the boxes around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Mesh, Shape, Sphere, load_mesh
from fantoccini.model.tree.coordinates import Role
from fantoccini.model.tree.inertia import link_inertia
from fantoccini.model.tree.placement import Value, link_poses, point_position
from fantoccini.model.tree.structure import WORLD, StringRow, Tree


@dataclass(frozen=True, eq=False)
class Size:
    """Size of a puppet in its start pose.

    Attributes:
        low, high: (3,) corners of the box around the moving bodies [m], along the world's axes.
        mass: mass of the moving bodies [kg].
        hanging_height: height of the strings' highest support above the lowest point of the moving
            bodies [m]; None if no string has a support.
        bodies: (n_links, 3) lengths of the boxes around the links' shapes, along their own axes
            [m]; nan for a link without shapes.
        masses: (n_links,) masses of the links [kg].
        poses: (n_links, 3, 4) poses of the links.
    """

    low: np.ndarray
    high: np.ndarray
    mass: float
    hanging_height: float | None
    bodies: np.ndarray
    masses: np.ndarray
    poses: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        """(3,) lengths of the box around the moving bodies [m]."""
        return self.high - self.low


def measure(tree: Tree, number: Value) -> Size:
    """The size and the mass of a puppet in its start pose.

    Args:
        tree: tree of the puppet.
        number: value of a number of the puppet.
    """
    table = tree.coordinates
    q_D, q_K = np.nan_to_num(table.start_D)[None], np.nan_to_num(table.start_K)[None]
    poses = link_poses(tree.links, q_D, q_K, number)
    n, own = len(tree.links), np.eye(3, 4)
    moving = [any(tree.links[j].role is Role.DYNAMIC for j in tree.ancestors(i)) for i in range(n)]
    bodies, masses, corners = np.full((n, 3), np.nan), np.zeros(n), []
    for i, link in enumerate(tree.links):
        masses[i], com, _ = link_inertia(link, number)
        if link.shapes:
            boxes = np.array([shape_box(shape, own) for shape in link.shapes])
            bodies[i] = boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)
        if moving[i] or not any(moving):
            corners += [c for shape in link.shapes for c in shape_box(shape, poses[0, i])]
            if masses[i] > 0:
                corners.append(poses[0, i, :, :3] @ com + poses[0, i, :, 3])
    spread = np.array(corners or [np.zeros(3)])
    low, high = spread.min(axis=0), spread.max(axis=0)
    tops = [
        point_position(poses, point, number)[0, 2]
        for string in (*tree.strings, *tree.chains)
        for point in (string.points[0], string.points[-1])
        if point.link == WORLD or not moving[point.link]
    ]
    height = float(max(tops) - low[2]) if tops else None
    total = float(sum(m for m, moves in zip(masses, moving, strict=True) if moves))
    return Size(low, high, total, height, bodies, masses, poses[0])


def path_lengths(tree: Tree, poses: np.ndarray, number: Value) -> dict[str, float]:
    """Lengths of the strings' paths [m]; for a chain, the distance of its ends.

    Args:
        tree: tree with the strings.
        poses: (n_links, 3, 4) poses of the links.
        number: value of a number of the puppet.
    """
    lengths = {}
    for string in (*tree.strings, *tree.chains):
        ends = (string.points[0], string.points[-1])
        points = string.points if isinstance(string, StringRow) else ends
        at = np.array([point_position(poses[None], point, number)[0] for point in points])
        lengths[string.name] = float(np.linalg.norm(np.diff(at, axis=0), axis=1).sum())
    return lengths


def shape_box(shape: Shape, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (3,) of the box around a shape [m], along the axes of ``pose``.

    Args:
        shape: shape of a link.
        pose: (3, 4) pose of the link.
    """
    R, r = pose[:, :3], pose[:, 3]
    if isinstance(shape, Mesh):
        at = np.asarray(load_mesh(shape).vertices) @ R.T + r
        return at.min(axis=0), at.max(axis=0)
    if isinstance(shape, Capsule):
        ends = np.array([shape.from_, shape.to]) @ R.T + r
        return ends.min(axis=0) - shape.radius, ends.max(axis=0) + shape.radius
    if not isinstance(shape, Sphere | Box | Ellipsoid):
        raise TypeError(f"{type(shape).__name__} is not a shape")
    middle = R @ np.array(shape.at) + r
    if isinstance(shape, Sphere):
        return middle - shape.radius, middle + shape.radius
    turn = R if shape.orientation is None else R @ shape.orientation.matrix
    if isinstance(shape, Box):
        half = np.abs(turn) @ (0.5 * np.array(shape.size))
    else:
        half = np.linalg.norm(turn * np.array(shape.radii), axis=1)
    return middle - half, middle + half
