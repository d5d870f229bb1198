"""Sizes of shapes and puppets: the boxes around them.

A link is a body on its joint. q_D and q_K are the dynamic and driven coordinates of the start pose.
"""

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
        lower, upper: (3,) corners of the box around the moving bodies [m], along the world's axes.
        mass: mass of the moving bodies [kg].
        hanging_height: height of the highest support of a string above the lowest point of the
            moving bodies [m]; None if no string has a support.
        bodies: (n_links, 3) lengths of the box around each link's shapes, along the link's axes
            [m]; nan for a link without shapes.
        masses: (n_links,) masses of the links [kg].
        poses: (n_links, 3, 4) poses of the links.
    """

    lower: np.ndarray
    upper: np.ndarray
    mass: float
    hanging_height: float | None
    bodies: np.ndarray
    masses: np.ndarray
    poses: np.ndarray

    @property
    def lengths(self) -> np.ndarray:
        """(3,) lengths of the box around the moving bodies [m]."""
        return self.upper - self.lower


def measure(tree: Tree, number: Value) -> Size:
    """The size and the mass of a puppet in its start pose.

    Args:
        tree: tree of the puppet.
        number: function from a number of the file, or its parameter, to the value.
    """
    table = tree.coordinates
    q_D, q_K = np.nan_to_num(table.start_D)[None], np.nan_to_num(table.start_K)[None]
    poses = link_poses(tree.links, q_D, q_K, number)
    n, identity = len(tree.links), np.eye(3, 4)
    is_moving = [
        any(tree.links[j].role is Role.DYNAMIC for j in tree.ancestors(i)) for i in range(n)
    ]
    bodies, masses, corners = np.full((n, 3), np.nan), np.zeros(n), []
    for i, link in enumerate(tree.links):
        masses[i], com, _ = link_inertia(link, number)
        if link.shapes:
            boxes = np.array([shape_box(shape, identity) for shape in link.shapes])
            bodies[i] = boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)
        if is_moving[i] or not any(is_moving):
            corners += [c for shape in link.shapes for c in shape_box(shape, poses[0, i])]
            if masses[i] > 0:
                corners.append(poses[0, i, :, :3] @ com + poses[0, i, :, 3])
    all_corners = np.array(corners or [np.zeros(3)])
    lower, upper = all_corners.min(axis=0), all_corners.max(axis=0)
    suspension_heights = [
        point_position(poses, point, number)[0, 2]
        for string in (*tree.strings, *tree.chains)
        for point in (string.points[0], string.points[-1])
        if point.link == WORLD or not is_moving[point.link]
    ]
    hanging_height = float(max(suspension_heights) - lower[2]) if suspension_heights else None
    moving_mass = float(sum(m for m, does_move in zip(masses, is_moving, strict=True) if does_move))
    return Size(lower, upper, moving_mass, hanging_height, bodies, masses, poses[0])


def path_lengths(tree: Tree, poses: np.ndarray, number: Value) -> dict[str, float]:
    """Lengths of the strings' paths [m]; for a chain, the distance between its ends.

    Args:
        tree: tree with the strings.
        poses: (n_links, 3, 4) poses of the links.
        number: function from a number of the file, or its parameter, to the value.
    """
    lengths = {}
    for string in (*tree.strings, *tree.chains):
        ends = (string.points[0], string.points[-1])
        points = string.points if isinstance(string, StringRow) else ends
        positions = np.array([point_position(poses[None], point, number)[0] for point in points])
        lengths[string.name] = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    return lengths


def shape_box(shape: Shape, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (3,) of the box around a shape, along the axes of a frame [m].

    Args:
        shape: shape of a link.
        pose: (3, 4) pose of the link in this frame.
    """
    R, r = pose[:, :3], pose[:, 3]
    if isinstance(shape, Mesh):
        vertices = np.asarray(load_mesh(shape).vertices) @ R.T + r
        return vertices.min(axis=0), vertices.max(axis=0)
    if isinstance(shape, Capsule):
        ends = np.array([shape.from_, shape.to]) @ R.T + r
        return ends.min(axis=0) - shape.radius, ends.max(axis=0) + shape.radius
    if not isinstance(shape, Sphere | Box | Ellipsoid):
        raise TypeError(f"{type(shape).__name__} is not a shape")
    middle = R @ np.array(shape.at) + r
    if isinstance(shape, Sphere):
        return middle - shape.radius, middle + shape.radius
    axes = R if shape.orientation is None else R @ shape.orientation.matrix
    if isinstance(shape, Box):
        half_lengths = np.abs(axes) @ (0.5 * np.array(shape.size))
    else:
        half_lengths = np.linalg.norm(axes * np.array(shape.radii), axis=1)
    return middle - half_lengths, middle + half_lengths
