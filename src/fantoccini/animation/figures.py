"""Meshes and materials of solids in a glTF document; what looks the same is kept once."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.animation.gltf import Document, Node, placed
from fantoccini.arrays import Array
from fantoccini.view.meshes import TriangleMesh, frame_along, triangles
from fantoccini.view.silhouettes import Solid, box, capsule

_ROUGHNESS = 0.75


def material(document: Document, colour: Array) -> int:
    """The material of a colour (3,); glTF's are linear, ours those of screens."""
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    look = {
        "baseColorFactor": [*(round(float(c), 4) for c in linear), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": _ROUGHNESS,
    }
    return document.once("materials", {"pbrMetallicRoughness": look})


def mesh(document: Document, surface: TriangleMesh, colour: Array) -> int:
    """The mesh of a surface."""
    small = len(surface.vertices) < 65535
    faces = surface.faces.reshape(-1).astype(np.uint16 if small else np.uint32)
    vertices = surface.vertices.astype(np.float32)
    attributes = {"POSITION": document.numbers("vectors", vertices, bounds=True)}
    if surface.normals is not None:
        attributes["NORMAL"] = document.numbers("vectors", surface.normals.astype(np.float32))
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": document.numbers("indices", faces),
        "material": material(document, colour),
    }
    return document.once("meshes", {"primitives": [primitive]})


def solid_node(document: Document, solid: Solid, name: str) -> Node:
    """A node with a solid, in its link's frame.

    Balls, ellipsoids and boxes are one ball and one box, scaled; capsules of one size are one.
    """
    node: Node = {"name": name}
    same = np.zeros(3)
    if solid.kind == "capsule":
        apart = solid.points[1] - solid.points[0]
        length, radius = float(np.linalg.norm(apart)), solid.radius
        middle = solid.points.mean(axis=0)
        if length <= 1e-9 * radius:
            node["mesh"] = mesh(document, _BALL, solid.colour)
            return placed(node, middle, None, np.full(3, radius))
        ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * round(length, 9)
        shape = triangles(capsule(0, solid.colour, ends, round(radius, 9)))
        node["mesh"] = mesh(document, shape, solid.colour)
        return placed(node, middle, _turn(frame_along(apart / length)))
    if solid.kind == "faces" and solid.smooth:
        node["mesh"] = mesh(document, triangles(solid), solid.colour)
        return placed(node, same)
    centre = solid.points.mean(axis=0)
    scale = np.linalg.norm(solid.half, axis=0)
    axes = solid.half / scale
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    unit = _BOX if solid.kind == "faces" else _BALL
    node["mesh"] = mesh(document, unit, solid.colour)
    return placed(node, centre, _turn(axes), scale)


def floor_node(document: Document, middle: Array, half: float, colour: Array) -> Node:
    """A square that faces up, about ``middle`` (3,)."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    square = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), up)
    return placed({"name": "floor", "mesh": mesh(document, square, colour)}, middle)


def _turn(axes: Array) -> Array:
    """(4,) quaternion of axes (3, 3)."""
    return np.roll(Rotation.from_matrix(axes).as_quat(), 1)


_BALL = triangles(capsule(0, np.zeros(3), np.zeros((2, 3)), 1.0))
_BOX = triangles(box(0, np.zeros(3), np.zeros(3), np.eye(3)))
