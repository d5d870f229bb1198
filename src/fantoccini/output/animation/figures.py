"""Meshes and materials of solids in a glTF document, without duplicates.

glTF is a format of scenes in files and on web pages. A node is an object with a pose, and a link a
body on its joint.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.output.animation.gltf import Document, Node, with_transform
from fantoccini.output.animation.pieces import (
    ROUGHNESS,
    floor_piece,
    hex_digits,
    linear_colour,
    solid_piece,
)
from fantoccini.output.animation.scene import AnimatedScene
from fantoccini.output.view import LIGHT, Solid, TriangleMesh, coloured_surfaces


def add_material(document: Document, colour: Array) -> int:
    """Index of the material of a colour (3,), named after the colour."""
    shading = {
        "baseColorFactor": [*linear_colour(colour), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": ROUGHNESS,
    }
    entry = {"name": f"colour_{hex_digits(colour)}", "pbrMetallicRoughness": shading}
    return document.add_once("materials", entry)


def add_mesh(document: Document, surfaces: Iterable[tuple[Array, TriangleMesh]]) -> int:
    """Index of a mesh of surfaces, each with its colour (3,)."""
    return document.add_once("meshes", {"primitives": [_primitive(document, *s) for s in surfaces]})


def _primitive(document: Document, colour: Array, surface: TriangleMesh) -> dict[str, Any]:
    fits_uint16 = len(surface.vertices) < 65535
    faces = surface.faces.reshape(-1).astype(np.uint16 if fits_uint16 else np.uint32)
    vertices = surface.vertices.astype(np.float32)
    attributes = {"POSITION": document.add_accessor("vectors", vertices, bounds=True)}
    if surface.normals is not None:
        attributes["NORMAL"] = document.add_accessor("vectors", surface.normals.astype(np.float32))
    return {
        "attributes": attributes,
        "indices": document.add_accessor("indices", faces),
        "material": add_material(document, colour),
    }


def solid_node(document: Document, solid: Solid, name: str) -> Node:
    """Node of a solid, in its link's frame."""
    piece = solid_piece(solid)
    has_several_colours = solid.most_detailed.colours is not None
    surfaces = coloured_surfaces(solid) if has_several_colours else [(solid.colour, piece.surface)]
    node: Node = {"name": name, "mesh": add_mesh(document, surfaces)}
    return with_transform(node, piece.r, piece.q, piece.scale)


def floor_node(document: Document, scene: AnimatedScene) -> Node:
    """Node of the floor."""
    piece = floor_piece(scene)
    node: Node = {
        "name": "floor",
        "mesh": add_mesh(document, [(LIGHT.lower_background, piece.surface)]),
    }
    return with_transform(node, piece.r)
