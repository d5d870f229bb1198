"""Strings in a glTF document: thin tubes, skinned to the bodies that they connect.

A span is the part of a string between two of its points. It has two joints, nodes at these
points. A vertex at the share s of the span has weights 1 - s and s, so that a straight span
needs no keyframes. The joints are turned roughly along the span, which keeps the tube round. A
slack string sags by morph targets, the principal components of its curves in the run.

A skin is a surface whose vertices move with weighted nodes; a morph target is a displacement of all
vertices, which is added with a weight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.animation.figures import add_material
from fantoccini.output.animation.gltf import Channels, Document, with_transform, xyzw
from fantoccini.output.animation.keys import linear_keys
from fantoccini.output.animation.scene import AnimatedScene, Line
from fantoccini.output.animation.spans import Spans
from fantoccini.output.view import rgb

_TUBE_SIDES = 3
"""Number of sides of a string's tube."""
RINGS_PER_SPAN = 17
"""Number of rings on each span of a string that is slack at times."""
STRING_RADIUS = 0.0008
"""Radius of a string, relative to the size of the scene."""
_TURN_TOLERANCE = 0.01
"""Tolerance of a joint's orientation, as a difference of quaternions."""
_SAG_TOLERANCE = 1e-3
"""Tolerance of a slack string's curve, relative to the size of the scene."""
_MAX_SHAPES = 8
"""Largest number of morph targets of a string."""
STRING_COLOUR = rgb("#6e6a62")
"""Default colour of strings."""


@dataclass(frozen=True)
class StringMeshWriter:
    """Adds the strings of a scene to a document.

    Args:
        document: the document to add to.
        channels: channels of its animation.
        scene: the scene with the strings.
        nodes: nodes of the links, by index.
        root: node of the world.
    """

    document: Document
    channels: Channels
    scene: AnimatedScene
    nodes: dict[int, int]
    root: int

    def add(self, line: Line, spans: Spans) -> int:
        """Adds one line; returns the node of its mesh."""
        joints = self._joints(line, spans)
        rings = 2 if spans.slack_length is None else RINGS_PER_SPAN
        shapes, weights = _morph_targets(spans, _SAG_TOLERANCE * self.scene.geometry.size, rings)
        primitive = self._tube(line, len(spans.directions), rings)
        mesh: dict[str, Any] = {"name": line.name, "primitives": [primitive]}
        if len(shapes):
            primitive["targets"] = [
                {"POSITION": self.document.add_accessor("vectors", shape.astype(np.float32), True)}
                for shape in shapes
            ]
            mesh["weights"] = [round(float(w), 6) for w in weights[0]]
        node = {
            "name": line.name,
            "mesh": self.document.add("meshes", mesh),
            "skin": self._skin(joints),
        }
        index = self.document.add("nodes", node)
        if len(shapes):
            tolerance = _SAG_TOLERANCE * self.scene.geometry.size / np.sqrt(len(shapes))
            keys = linear_keys(spans.t, weights, tolerance)
            self.channels.add(
                index, "weights", spans.t[keys], weights[keys].reshape(-1, 1), "LINEAR"
            )
        return index

    def _skin(self, joints: list[int]) -> int:
        """Skin of a line's joints; the first skin also has all bodies as joints.

        Blender makes bones only from the joints of skins and their ancestors.
        """
        if "skins" not in self.document.content:
            joints = [*joints, *self.nodes.values()]
        return self.document.add("skins", {"name": self.scene.tree.name, "joints": joints})

    def _joints(self, line: Line, spans: Spans) -> list[int]:
        """Two nodes for each span, at its ends, with z along it."""
        joints = []
        for k, frame in enumerate(spans.frames):
            for side, point in enumerate(line.points[k : k + 2]):
                parent = self.root if point.link == WORLD else self.nodes[point.link]
                q = frame
                if point.link != WORLD:
                    q = rotation.multiply(rotation.conjugate(spans.orientations[point.link]), frame)
                q = rotation.continuous(q)
                node = with_transform(
                    {"name": f"{line.name}_{2 * k + side}"}, self.scene.at(point), q[0]
                )
                index = self.document.add("nodes", node)
                self.document.content["nodes"][parent].setdefault("children", []).append(index)
                joints.append(index)
                keys = linear_keys(spans.t, q, _TURN_TOLERANCE, is_quaternion=True)
                if np.abs(q - q[0]).max() > _TURN_TOLERANCE:
                    self.channels.add(index, "rotation", spans.t[keys], xyzw(q[keys]), "LINEAR")
        return joints

    def _tube(self, line: Line, n_spans: int, rings: int) -> dict[str, Any]:
        """Primitive of a tube: all its rings lie at the origin, and the joints pull them apart."""
        angles = 2.0 * np.pi * np.arange(_TUBE_SIDES) / _TUBE_SIDES
        ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_TUBE_SIDES)])
        normals = np.tile(ring, (rings * n_spans, 1))
        position = np.tile(np.repeat(np.linspace(0.0, 1.0, rings), _TUBE_SIDES), n_spans)
        span_of_vertex = np.repeat(np.arange(n_spans), rings * _TUBE_SIDES)
        weights = np.column_stack([1.0 - position, position, np.zeros((len(position), 2))])
        joints = np.column_stack(
            [2 * span_of_vertex, 2 * span_of_vertex + 1, np.zeros((len(position), 2))]
        )
        # Where the weight is 0, glTF requires joint 0.
        joints[:, :2][weights[:, :2] == 0.0] = 0.0
        corner = np.arange(_TUBE_SIDES)
        next_corner = (corner + 1) % _TUBE_SIDES
        first_vertex = (np.arange(n_spans)[:, None] * rings + np.arange(rings - 1)).reshape(
            -1, 1
        ) * _TUBE_SIDES
        a, b, c, d = (
            (first_vertex + offset).ravel()
            for offset in (corner, next_corner, _TUBE_SIDES + corner, _TUBE_SIDES + next_corner)
        )
        faces = np.stack([a, b, c, b, d, c], axis=1).reshape(-1)
        radius = STRING_RADIUS * self.scene.geometry.size
        add_accessor = self.document.add_accessor
        attributes = {
            "POSITION": add_accessor("vectors", (radius * normals).astype(np.float32), True),
            "NORMAL": add_accessor("vectors", normals.astype(np.float32)),
            "JOINTS_0": add_accessor("many joints", joints.astype(np.uint16))
            if np.max(joints) > np.iinfo(np.uint8).max
            else add_accessor("joints", joints.astype(np.uint8)),
            "WEIGHTS_0": add_accessor("weights", weights.astype(np.float32)),
        }
        colour = STRING_COLOUR if line.colour is None else line.colour
        return {
            "attributes": attributes,
            "indices": add_accessor("indices", faces.astype(np.uint16)),
            "material": add_material(self.document, colour),
        }


def _morph_targets(spans: Spans, tolerance: float, rings: int) -> tuple[Array, Array]:
    """Morph targets (m, n_vertices, 3), at most 1 m in size, and their weights (T, m) [m]."""
    n = len(spans.directions)
    if spans.slack_length is None:
        return np.zeros((0, 0, 3)), np.zeros((len(spans.t), 0))
    sag_rows = spans.sag_offsets(rings).reshape(len(spans.t), -1)
    shapes = np.linalg.eigh(sag_rows.T @ sag_rows)[1].T[::-1]
    weights = sag_rows @ shapes.T
    for m in range(1, _MAX_SHAPES + 1):
        if np.abs(weights[:, :m] @ shapes[:m] - sag_rows).max() <= tolerance:
            break
    sizes = np.abs(shapes[:m]).max(axis=1)
    shapes = (shapes[:m] / sizes[:, None]).reshape(m, n * rings, 3)
    return np.repeat(shapes, _TUBE_SIDES, axis=1), weights[:, :m] * sizes
