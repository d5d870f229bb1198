"""Surfaces of solids, placed: few different ones, so that files keep each once.

Balls, ellipsoids and boxes are one ball and one box, scaled; capsules of one size are one.
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
    box,
    capsule,
    frame_along,
    handles,
    triangles,
)

ROUGHNESS = 0.75
"""Of all materials."""
_DIGITS = 9
"""Decimals of sizes: what differs by less is the same [m]."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A surface in the frame of a link: scaled, turned, moved.

    Attributes:
        surface: before that.
        r: (3,) its place [m].
        q: (4,) its orientation, w, x, y, z.
        scale: (3,) along its axes.
    """

    surface: TriangleMesh
    r: Vec3
    q: Quaternion = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    scale: Vec3 = field(default_factory=lambda: np.ones(3))


def named_solids(scene: AnimatedScene) -> Iterator[tuple[str, Solid]]:
    """What is seen of the links that are shown and, if all are, of the world, with names.

    Strings have beads where a hand or a winch holds them.
    """
    geometry, counts = scene.geometry, dict[int, int]()
    for solid in (*geometry.solids, *handles(scene.tree, LIGHT, geometry.size)):
        if solid.link in scene.links or (solid.link == WORLD and scene.whole):
            counts[solid.link] = counts.get(solid.link, 0) + 1
            of = "world" if solid.link == WORLD else scene.tree.links[solid.link].name
            yield f"{of}_shape{counts[solid.link]}", solid


def piece_of(solid: Solid) -> Piece:
    """The surface of a solid."""
    middle = solid.points.mean(axis=0)
    if solid.kind == "capsule":
        apart = solid.points[1] - solid.points[0]
        length, radius = float(np.linalg.norm(apart)), round(solid.radius, _DIGITS)
        if length <= 1e-9 * solid.radius:
            return Piece(_BALL, middle, scale=np.full(3, radius))
        ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * round(length, _DIGITS)
        surface = triangles(capsule(0, solid.colour, ends, radius))
        return Piece(surface, middle, rotation.quaternion(frame_along(apart / length)))
    if solid.smooth:
        return Piece(triangles(solid), np.zeros(3))
    scale = np.linalg.norm(solid.half, axis=0)
    axes = solid.half / scale
    # A ball and a box are their own mirror images.
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Piece(_BOX if solid.kind == "faces" else _BALL, middle, rotation.quaternion(axes), scale)


def floor_of(scene: AnimatedScene) -> Piece:
    """A square under the whole motion, that faces up."""
    geometry = scene.geometry
    low, high = geometry.ground_box()
    half = 0.5 * float((high - low).max()) + 0.5 * geometry.size
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    square = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), up)
    return Piece(square, np.append(0.5 * (low + high), geometry.floor))


def linear_colour(colour: Array) -> list[float]:
    """Linear red, green and blue, which files have, of the sRGB (3,) of screens."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return [round(float(c), 4) for c in linear]


def hex_of(colour: Array) -> str:
    """An sRGB colour (3,) as six hexadecimal digits: ``6e6a62``."""
    return bytes(np.rint(255.0 * np.clip(colour, 0.0, 1.0)).astype(int).tolist()).hex()


_BALL = triangles(capsule(0, np.zeros(3), np.zeros((2, 3)), 1.0))
_BOX = triangles(box(0, np.zeros(3), np.zeros(3), np.eye(3)))
