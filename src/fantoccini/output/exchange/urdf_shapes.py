"""Visuals and collisions of URDF as shapes."""

from __future__ import annotations

from collections.abc import Callable, Container
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from fantoccini.base import MissingLibraryError, nearest, rotation
from fantoccini.model import meshes
from fantoccini.output.exchange import solids
from fantoccini.output.exchange.draft import Draft, numbers

_PLAIN = "each triangle has one opaque colour here"


def add_shapes(
    draft: Draft,
    link: Any,
    made: dict[str, Any],
    materials: dict[str, Any],
    capsules: Container[tuple[str, str, int]],
) -> None:
    """Adds a link's visuals to its body, or its collisions where it has none.

    A colour of URDF hides those of a mesh's file.

    Args:
        draft: of the puppet.
        link: yourdfpy's.
        made: the body.
        materials: name of a material -> yourdfpy's, with a colour or texture.
        capsules: see :class:`UrdfText`.
    """
    line, part = draft.file.line_of("link", link.name), made["name"]

    def note(text: str) -> None:
        draft.note("link", link.name, text, line, part)

    kind = "visual" if link.visuals else "collision"
    for k, solid in enumerate(link.visuals or link.collisions):
        origin = np.eye(4) if solid.origin is None else solid.origin
        round_ends = (link.name, kind, k) in capsules
        found = _shape(draft, solid.geometry, origin, round_ends, note)
        if found is None:
            continue
        shape, own = found
        material = getattr(solid, "material", None)
        if material is not None and material.color is None and material.texture is None:
            name = material.name or ""
            material = materials.get(name)
            if name and material is None:
                what = f"has a solid of the material {name[:100]!r}, which is not defined"
                note(f"{what}{nearest(name, materials)}")
        if material is not None and material.texture is not None:
            note(f"has the texture {str(material.texture.filename)[:100]!r}, left out")
        if material is not None and material.color is not None:
            rgba = material.color.rgba
            if rgba[3] < 1.0:
                note("has a transparent solid, which is opaque here")
            shape = solids.coloured(shape, rgba)
        else:
            if own is None or own.colours is None:
                shape = solids.coloured(shape, solids.GREY)
            if own is not None and own.lost:
                note(f"has a mesh with {' and '.join(sorted(own.lost))}; {_PLAIN}")
        made.setdefault("shapes", []).append(shape)


def _shape(
    draft: Draft, geometry: Any, origin: Any, round_ends: bool, note: Callable[[str], None]
) -> tuple[dict[str, Any], meshes.MeshFile | None] | None:
    """A solid as a shape, and the mesh file if it is of one; None where it is left out."""
    at, turn = origin[:3, 3], rotation.quaternion(origin[:3, :3])
    box, ball, rod, mesh = geometry.box, geometry.sphere, geometry.cylinder, geometry.mesh
    if box is not None and solids.fits(*box.size):
        return solids.box(box.size, at, turn), None
    if ball is not None and solids.fits(ball.radius):
        return solids.sphere(ball.radius, at), None
    if rod is not None and round_ends and solids.fits(rod.radius):
        return solids.capsule(rod.radius, 0.5 * rod.length, at, origin[:3, 2]), None
    if rod is not None and not round_ends and solids.fits(rod.radius, rod.length):
        return solids.cylinder(draft, rod.radius, rod.length, at, turn), None
    if mesh is None:
        note("has a solid of a size that is left out")
        return None
    file = _find(mesh.filename, draft.file.path.resolve().parent)
    if file is not None:
        draft.sources.append(file)
        if file not in draft.mesh_files:
            draft.mesh_files[file] = _read(file)
    read = "is not there" if file is None else draft.mesh_files[file]
    if file is None or isinstance(read, str):
        note(f"has the mesh {str(mesh.filename)[:100]!r}, left out: it {read}")
        return None
    scale = 1.0 if mesh.scale is None else mesh.scale
    factors = numbers(np.broadcast_to(np.asarray(scale, float), 3))
    if not all(factors):
        note("has a mesh with a scale of 0, left out")
        return None
    ending = "stl" if read.colours is None else "ply"
    shape = solids.mesh(draft, str(file), lambda: _written(read), at, turn, file.stem, ending)
    return shape if factors == [1, 1, 1] else shape | {"scale": factors}, read


def _find(name: str, folder: Path) -> Path | None:
    """The file of a mesh, whose name may begin with ``package://PACKAGE/``; None if not there.

    A package is a folder of that name above the model's folder, or next to one of those. If no
    file has the name as written, ``%20`` and the like are decoded.
    """
    return _find_plain(name, folder) or _find_plain(unquote(name), folder)


def _find_plain(name: str, folder: Path) -> Path | None:
    scheme, mark, rest = name.partition("://")
    if not mark:
        places = [folder / name]
    elif scheme == "file":
        places = [Path(rest.removeprefix("localhost")), folder / rest]
    else:
        package, _, inside = rest.partition("/")
        above = (folder, *folder.parents)
        places = [p / inside for p in above if p.name == package]
        places += [p / package / inside for p in above]
        places += [p / inside for p in above[:3]]
    try:
        return next((p for p in places if p.is_file()), None)
    except (OSError, ValueError):
        return None


def _read(file: Path) -> meshes.MeshFile | str:
    """A mesh, or why it is left out."""
    if file.suffix.lower() not in meshes.FORMATS:
        return f"is not one of {', '.join(meshes.FORMATS)}"
    try:
        return meshes.read(file, file.parent)
    except (OSError, ValueError, MissingLibraryError) as error:
        return f"cannot be read: {error}"


def _written(mesh: meshes.MeshFile) -> bytes:
    """A mesh as STL, or with its colours as PLY."""
    if mesh.colours is None:
        return solids.stl(mesh.vertices, mesh.faces)
    return solids.ply(mesh.vertices, mesh.faces, mesh.colours)
