"""Shapes of a puppet file for solids of other programs."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, Quaternion
from fantoccini.model.meshes import LIMITS
from fantoccini.model.puppet import QUANTITIES
from fantoccini.output.exchange.draft import Draft, number, numbers, placed

GREY = np.array([0.7, 0.7, 0.7, 1.0])
"""Colour of solids without one."""

_SECTIONS = 32  # Sides of a cylinder's mesh
_OPAQUE = 1e-3  # Opacity from which a solid is seen


def box(edges: Array, at: Array, turn: Quaternion) -> dict[str, Any]:
    """A box of given edges [m]."""
    return {"type": "box", "size": numbers(edges), **placed(at, turn)}


def sphere(radius: float, at: Array) -> dict[str, Any]:
    """A ball."""
    return {"type": "sphere", "radius": number(radius), **placed(at)}


def ellipsoid(radii: Array, at: Array, turn: Quaternion) -> dict[str, Any]:
    """An ellipsoid of given half axes [m]."""
    return {"type": "ellipsoid", "radii": numbers(radii), **placed(at, turn)}


def capsule(radius: float, half: float, at: Array, along: Array) -> dict[str, Any]:
    """A capsule about ``at``, its axis the unit vector ``along``."""
    ends = {"from": numbers(at - half * along), "to": numbers(at + half * along)}
    return {"type": "capsule", **ends, "radius": number(radius)}


def cylinder(
    draft: Draft, radius: float, length: float, at: Array, turn: Quaternion
) -> dict[str, Any]:
    """A cylinder along z, as a mesh of 32 sides; all cylinders of a puppet share one file."""
    scale = numbers([radius, radius, length])
    return mesh(draft, ("cylinder",), cylinder_stl, at, turn, "cylinder") | {"scale": scale}


def mesh(
    draft: Draft,
    key: Hashable,
    content: Callable[[], bytes],
    at: Array,
    turn: Quaternion,
    stem: str,
    ending: str = "stl",
) -> dict[str, Any]:
    """A mesh; its file is written once for each key.

    Args:
        draft: of the puppet.
        key: what tells the mesh from others of the model.
        content: returns the file's content.
        at, turn: pose.
        stem, ending: of the file's name.
    """
    if key not in draft.mesh_paths:
        draft.mesh_paths[key] = draft.mesh(stem, content(), ending)
    return {"type": "mesh", "file": draft.mesh_paths[key], **placed(at, turn)}


def stl(vertices: Array, faces: Array | Indices) -> bytes:
    """A binary STL file of triangles: (n, 3) corners, (m, 3) indices."""
    import trimesh

    made = trimesh.Trimesh(np.asarray(vertices, float), np.asarray(faces), process=False)
    return bytes(made.export(file_type="stl"))


def ply(vertices: Array, faces: Array | Indices, colours: Array) -> bytes:
    """A binary PLY file of triangles with a colour each: (m, 3), from 0 to 1; grey for nan.

    Where there is no room for one more colour, it is the nearest to grey instead.
    """
    import trimesh

    finite = np.isfinite(colours)
    others, grey = np.unique(colours[finite.all(axis=1)], axis=0), GREY[:3]
    if len(others) >= LIMITS.max_colours:
        grey = others[np.argmin(np.linalg.norm(others - grey, axis=1))]
    known = np.where(finite, colours, grey)
    made = trimesh.Trimesh(
        np.asarray(vertices, float),
        np.asarray(faces),
        process=False,
        face_colors=np.round(255.0 * known).astype(np.uint8),
    )
    return bytes(made.export(file_type="ply"))


def coloured(shape: dict[str, Any], rgba: Array) -> dict[str, Any]:
    """The shape with a colour of red, green, blue from 0 to 1."""
    r, g, b = (round(255 * min(max(float(c), 0.0), 1.0)) for c in rgba[:3])
    return shape | {"colour": f"#{r:02x}{g:02x}{b:02x}"}


def is_seen(rgba: Array) -> bool:
    """Whether a colour is not transparent."""
    return bool(rgba[3] > _OPAQUE)


def fits(*lengths: float) -> bool:
    """Whether a puppet file allows lengths [m]."""
    allowed = QUANTITIES["length"]
    return all(allowed.min_size <= x <= allowed.max_size for x in lengths)


def cylinder_stl() -> bytes:
    """An STL file of a cylinder of radius and height 1."""
    import trimesh

    made = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=_SECTIONS)
    return stl(made.vertices, made.faces)
