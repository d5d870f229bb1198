"""Meshes and materials of solids in a glTF document, without duplicates."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.output.animation.gltf import Document, Node, placed
from fantoccini.output.animation.pieces import ROUGHNESS, floor_of, hex_of, linear_colour, piece_of
from fantoccini.output.animation.scene import AnimatedScene
from fantoccini.output.view import LIGHT, Solid, TriangleMesh, coloured


def material(document: Document, colour: Array) -> int:
    """Index of the material of a colour (3,), named after the colour."""
    shading = {
        "baseColorFactor": [*linear_colour(colour), 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": ROUGHNESS,
    }
    entry = {"name": f"colour_{hex_of(colour)}", "pbrMetallicRoughness": shading}
    return document.add_once("materials", entry)


def mesh(document: Document, surfaces: Iterable[tuple[Array, TriangleMesh]]) -> int:
    """Index of a mesh of surfaces, each with its colour (3,)."""
    return document.add_once("meshes", {"primitives": [_primitive(document, *s) for s in surfaces]})


def _primitive(document: Document, colour: Array, surface: TriangleMesh) -> dict[str, Any]:
    small = len(surface.vertices) < 65535
    faces = surface.faces.reshape(-1).astype(np.uint16 if small else np.uint32)
    vertices = surface.vertices.astype(np.float32)
    attributes = {"POSITION": document.numbers("vectors", vertices, bounds=True)}
    if surface.normals is not None:
        attributes["NORMAL"] = document.numbers("vectors", surface.normals.astype(np.float32))
    return {
        "attributes": attributes,
        "indices": document.numbers("indices", faces),
        "material": material(document, colour),
    }


def solid_node(document: Document, solid: Solid, name: str) -> Node:
    """Node of a solid, in its link's frame."""
    piece = piece_of(solid)
    several = solid.full.colours is not None
    surfaces = coloured(solid) if several else [(solid.colour, piece.surface)]
    node: Node = {"name": name, "mesh": mesh(document, surfaces)}
    return placed(node, piece.r, piece.q, piece.scale)


def floor_node(document: Document, scene: AnimatedScene) -> Node:
    """Node of the floor."""
    piece = floor_of(scene)
    node: Node = {
        "name": "floor",
        "mesh": mesh(document, [(LIGHT.lower_background, piece.surface)]),
    }
    return placed(node, piece.r)
