"""Conversion of visuals and collisions of URDF to shapes.

URDF is the format of robots in ROS; a visual is a shape for pictures, a collision one for contacts.
A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from fantoccini.base import MissingLibraryError, did_you_mean, rotation
from fantoccini.model import meshes
from fantoccini.output.exchange import solids
from fantoccini.output.exchange.draft import Draft, written_numbers

_ONE_COLOUR = "each triangle has one opaque colour here"


def add_shapes(
    draft: Draft,
    link: Any,
    body: dict[str, Any],
    materials: dict[str, Any],
    capsules: Container[tuple[str, str, int]],
) -> None:
    """Adds a link's visuals to its body or, if it has none, its collisions.

    A colour in the URDF replaces those of a mesh's file.

    Args:
        draft: draft of the puppet.
        link: link of yourdfpy.
        body: the body.
        materials: name -> material of yourdfpy, with a colour or texture.
        capsules: see :class:`UrdfText`.
    """
    line, part = draft.file.line_of("link", link.name), body["name"]

    def note(text: str) -> None:
        draft.note("link", link.name, text, line, part)

    kind = "visual" if link.visuals else "collision"
    for k, solid in enumerate(link.visuals or link.collisions):
        origin = np.eye(4) if solid.origin is None else solid.origin
        is_capsule = (link.name, kind, k) in capsules
        result = _solid_shape(draft, solid.geometry, origin, is_capsule, note)
        if result is None:
            continue
        shape, mesh_file = result
        material = getattr(solid, "material", None)
        if material is not None and material.color is None and material.texture is None:
            name = material.name or ""
            material = materials.get(name)
            if name and material is None:
                message = f"has a solid of the material {name[:100]!r}, which is not defined"
                note(f"{message}{did_you_mean(name, materials)}")
        if material is not None and material.texture is not None:
            note(f"has the texture {str(material.texture.filename)[:100]!r}, left out")
        if material is not None and material.color is not None:
            rgba = material.color.rgba
            if rgba[3] < 1.0:
                note("has a transparent solid, which is opaque here")
            shape = solids.with_colour(shape, rgba)
        else:
            if mesh_file is None or mesh_file.colours is None:
                shape = solids.with_colour(shape, solids.GREY)
            if mesh_file is not None and mesh_file.lost:
                note(f"has a mesh with {' and '.join(sorted(mesh_file.lost))}; {_ONE_COLOUR}")
        body.setdefault("shapes", []).append(shape)


def _solid_shape(
    draft: Draft, geometry: Any, origin: Any, is_capsule: bool, note: Callable[[str], None]
) -> tuple[dict[str, Any], meshes.MeshFile | None] | None:
    """A solid as a shape, and its mesh file, if any; None if it is left out."""
    position, orientation = origin[:3, 3], rotation.quaternion(origin[:3, :3])
    box, sphere, cylinder, mesh = geometry.box, geometry.sphere, geometry.cylinder, geometry.mesh
    if box is not None and solids.is_valid_size(*box.size):
        return solids.box(box.size, position, orientation), None
    if sphere is not None and solids.is_valid_size(sphere.radius):
        return solids.sphere(sphere.radius, position), None
    if cylinder is not None and is_capsule and solids.is_valid_size(cylinder.radius):
        return solids.capsule(cylinder.radius, 0.5 * cylinder.length, position, origin[:3, 2]), None
    if (
        cylinder is not None
        and not is_capsule
        and solids.is_valid_size(cylinder.radius, cylinder.length)
    ):
        return solids.cylinder(draft, cylinder.radius, cylinder.length, position, orientation), None
    if mesh is None:
        note("has a solid whose size a puppet file does not allow, left out")
        return None
    file = _find_mesh(mesh.filename, draft.file.path.resolve().parent)
    if file is not None:
        draft.sources.append(file)
        if file not in draft.mesh_files:
            draft.mesh_files[file] = _read_mesh(file)
    mesh_file = "is not there" if file is None else draft.mesh_files[file]
    if file is None or isinstance(mesh_file, str):
        note(f"has the mesh {str(mesh.filename)[:100]!r}, left out: it {mesh_file}")
        return None
    scale = 1.0 if mesh.scale is None else mesh.scale
    factors = written_numbers(np.broadcast_to(np.asarray(scale, float), 3))
    if not all(factors):
        note("has a mesh with a scale of 0, left out")
        return None
    suffix = "stl" if mesh_file.colours is None else "ply"
    shape = solids.mesh(
        draft, str(file), lambda: _mesh_content(mesh_file), position, orientation, file.stem, suffix
    )
    return shape if factors == [1, 1, 1] else shape | {"scale": factors}, mesh_file


def _find_mesh(name: str, folder: Path) -> Path | None:
    """Path of a mesh file, whose name may begin with ``package://PACKAGE/``; None if not found.

    A package is an ancestor folder of the model with that name, or a folder beside one. If no
    file has the name as written, escapes such as ``%20`` are decoded.
    """
    return _find_exact(name, folder) or _find_exact(unquote(name), folder)


def _find_exact(name: str, folder: Path) -> Path | None:
    scheme, separator, path_text = name.partition("://")
    if not separator:
        candidates = [folder / name]
    elif scheme == "file":
        candidates = [Path(path_text.removeprefix("localhost")), folder / path_text]
    else:
        package, _, path_in_package = path_text.partition("/")
        ancestors = (folder, *folder.parents)
        candidates = [p / path_in_package for p in ancestors if p.name == package]
        candidates += [p / package / path_in_package for p in ancestors]
        candidates += [p / path_in_package for p in ancestors[:3]]
    try:
        return next((p for p in candidates if p.is_file()), None)
    except (OSError, ValueError):
        return None


def _read_mesh(file: Path) -> meshes.MeshFile | str:
    """The mesh, or the reason to leave it out."""
    if file.suffix.lower() not in meshes.FORMATS:
        return f"is not one of {', '.join(meshes.FORMATS)}"
    try:
        return meshes.read(file, file.parent)
    except (OSError, ValueError, MissingLibraryError) as error:
        return f"cannot be read: {error}"


def _mesh_content(mesh: meshes.MeshFile) -> bytes:
    """Content of a mesh file: STL, or PLY with colours."""
    if mesh.colours is None:
        return solids.stl(mesh.vertices, mesh.faces)
    return solids.ply(mesh.vertices, mesh.faces, mesh.colours)
