"""Shapes of a puppet file, as plain data, from the solids of other programs' models.

A key is here an entry of the puppet file.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, Quaternion
from fantoccini.model.meshes import LIMITS
from fantoccini.model.puppet import QUANTITIES
from fantoccini.output.exchange.draft import Draft, pose_keys, written_number, written_numbers

GREY = np.array([0.7, 0.7, 0.7, 1.0])
"""Default colour of solids."""

_SECTIONS = 32  # Sides of a cylinder's mesh
_MIN_OPACITY = 1e-3  # Opacity above which a solid is visible


def box(edge_lengths: Array, position: Array, orientation: Quaternion) -> dict[str, Any]:
    """Box with given edges [m]."""
    return {
        "type": "box",
        "size": written_numbers(edge_lengths),
        **pose_keys(position, orientation),
    }


def sphere(radius: float, position: Array) -> dict[str, Any]:
    """Sphere with given radius [m]."""
    return {"type": "sphere", "radius": written_number(radius), **pose_keys(position)}


def ellipsoid(radii: Array, position: Array, orientation: Quaternion) -> dict[str, Any]:
    """Ellipsoid with given half axes [m]."""
    return {
        "type": "ellipsoid",
        "radii": written_numbers(radii),
        **pose_keys(position, orientation),
    }


def capsule(radius: float, half_length: float, position: Array, axis: Array) -> dict[str, Any]:
    """Capsule centred at ``position``, with its axis along the unit vector ``axis`` [m]."""
    ends = {
        "from": written_numbers(position - half_length * axis),
        "to": written_numbers(position + half_length * axis),
    }
    return {"type": "capsule", **ends, "radius": written_number(radius)}


def cylinder(
    draft: Draft, radius: float, length: float, position: Array, orientation: Quaternion
) -> dict[str, Any]:
    """Cylinder along z, as a mesh with 32 sides; all cylinders of a puppet share one file."""
    scale = written_numbers([radius, radius, length])
    return mesh(draft, ("cylinder",), cylinder_stl, position, orientation, "cylinder") | {
        "scale": scale
    }


def mesh(
    draft: Draft,
    key: Hashable,
    make_content: Callable[[], bytes],
    position: Array,
    orientation: Quaternion,
    stem: str,
    suffix: str = "stl",
) -> dict[str, Any]:
    """Mesh; shapes with the same key share one file.

    Args:
        draft: puppet that is being built from the model.
        key: key that identifies the mesh in the model.
        make_content: function that returns the file's content.
        position: (3,) position [m].
        orientation: (4,) w, x, y, z.
        stem, suffix: name of the file, without the dot.
    """
    if key not in draft.mesh_paths:
        draft.mesh_paths[key] = draft.mesh(stem, make_content(), suffix)
    return {"type": "mesh", "file": draft.mesh_paths[key], **pose_keys(position, orientation)}


def stl(vertices: Array, faces: Array | Indices) -> bytes:
    """Binary STL file of triangles: (n, 3) corners, (m, 3) indices."""
    import trimesh

    triangles = trimesh.Trimesh(np.asarray(vertices, float), np.asarray(faces), process=False)
    return bytes(triangles.export(file_type="stl"))


def ply(vertices: Array, faces: Array | Indices, colours: Array) -> bytes:
    """Binary PLY file of triangles with colours (m, 3) from 0 to 1; NaN means grey.

    If there are ``LIMITS.max_colours`` colours already, the one nearest to grey is used for NaN.
    """
    import trimesh

    finite = np.isfinite(colours)
    used_colours, grey = np.unique(colours[finite.all(axis=1)], axis=0), GREY[:3]
    if len(used_colours) >= LIMITS.max_colours:
        grey = used_colours[np.argmin(np.linalg.norm(used_colours - grey, axis=1))]
    face_colours = np.where(finite, colours, grey)
    triangles = trimesh.Trimesh(
        np.asarray(vertices, float),
        np.asarray(faces),
        process=False,
        face_colors=np.round(255.0 * face_colours).astype(np.uint8),
    )
    return bytes(triangles.export(file_type="ply"))


def with_colour(shape: dict[str, Any], rgba: Array) -> dict[str, Any]:
    """The shape with a colour: red, green and blue, from 0 to 1."""
    r, g, b = (round(255 * min(max(float(c), 0.0), 1.0)) for c in rgba[:3])
    return shape | {"colour": f"#{r:02x}{g:02x}{b:02x}"}


def is_visible(rgba: Array) -> bool:
    """Whether a colour is not fully transparent."""
    return bool(rgba[3] > _MIN_OPACITY)


def is_valid_size(*lengths: float) -> bool:
    """Whether a puppet file allows these lengths [m]."""
    allowed = QUANTITIES["length"]
    return all(allowed.min_size <= x <= allowed.max_size for x in lengths)


def cylinder_stl() -> bytes:
    """STL file of a cylinder with radius and height 1."""
    import trimesh

    cylinder_mesh = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=_SECTIONS)
    return stl(cylinder_mesh.vertices, cylinder_mesh.faces)
