"""Placed surfaces of solids; solids share surfaces, so that files store each only once.

Balls and ellipsoids are one unit ball, scaled, and boxes one unit box; equal capsules share one.

A solid is a shape of a body or an obstacle, and a link a body on its joint.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import Array, Quaternion, Vec3, rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.animation.scene import AnimatedScene
from fantoccini.output.view import (
    LIGHT,
    Solid,
    TriangleMesh,
    box_solid,
    capsule_solid,
    frame_along,
    handle_solids,
    triangulate,
)

ROUGHNESS = 0.75
"""Roughness of all materials."""
_DIGITS = 9
"""Decimals to which sizes are rounded before they are compared [m]."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A surface in the frame of a link: scaled, rotated, moved.

    Attributes:
        surface: the surface before that.
        r: (3,) position [m].
        q: (4,) orientation, w, x, y, z.
        scale: (3,) factors along the surface's axes.
    """

    surface: TriangleMesh
    r: Vec3
    q: Quaternion = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    scale: Vec3 = field(default_factory=lambda: np.ones(3))


def named_solids(scene: AnimatedScene) -> Iterator[tuple[str, Solid]]:
    """Solids of the shown links and, if all links are shown, of the world, with names.

    They include the beads where a hand or a winch holds a string.
    """
    geometry, counts = scene.geometry, dict[int, int]()
    for solid in (*geometry.solids, *handle_solids(scene.tree, LIGHT, geometry.size)):
        if solid.link in scene.links or (solid.link == WORLD and scene.complete):
            counts[solid.link] = counts.get(solid.link, 0) + 1
            owner = "world" if solid.link == WORLD else scene.tree.links[solid.link].name
            yield f"{owner}_shape{counts[solid.link]}", solid


def solid_piece(solid: Solid) -> Piece:
    """Placed surface of a solid."""
    centre = solid.points.mean(axis=0)
    if solid.kind == "capsule":
        axis = solid.points[1] - solid.points[0]
        length, radius = float(np.linalg.norm(axis)), round(solid.radius, _DIGITS)
        if length <= 1e-9 * solid.radius:
            return Piece(_UNIT_BALL, centre, scale=np.full(3, radius))
        ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * round(length, _DIGITS)
        surface = triangulate(capsule_solid(0, solid.colour, ends, radius))
        return Piece(surface, centre, rotation.quaternion(frame_along(axis / length)))
    if solid.smooth:
        return Piece(triangulate(solid), np.zeros(3))
    scale = np.linalg.norm(solid.half_axes, axis=0)
    axes = solid.half_axes / scale
    # A ball and a box are their own mirror images.
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Piece(
        _UNIT_BOX if solid.kind == "faces" else _UNIT_BALL, centre, rotation.quaternion(axes), scale
    )


def floor_piece(scene: AnimatedScene) -> Piece:
    """Square under the whole motion, facing up."""
    geometry = scene.geometry
    low, high = geometry.ground_box()
    half_side = 0.5 * float((high - low).max()) + 0.5 * geometry.size
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half_side
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    square = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), normals)
    return Piece(square, np.append(0.5 * (low + high), geometry.floor))


def linear_colour(colour: Array) -> list[float]:
    """Linear red, green and blue of an sRGB colour (3,)."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return [round(float(c), 4) for c in linear]


def hex_digits(colour: Array) -> str:
    """An sRGB colour (3,) as six hexadecimal digits: ``6e6a62``."""
    return bytes(np.rint(255.0 * np.clip(colour, 0.0, 1.0)).astype(int).tolist()).hex()


_UNIT_BALL = triangulate(capsule_solid(0, np.zeros(3), np.zeros((2, 3)), 1.0))
_UNIT_BOX = triangulate(box_solid(0, np.zeros(3), np.zeros(3), np.eye(3)))
