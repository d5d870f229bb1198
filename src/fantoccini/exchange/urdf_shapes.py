"""Visuals and collisions of URDF as shapes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini import meshes
from fantoccini.errors import MissingLibraryError
from fantoccini.exchange import solids
from fantoccini.exchange.draft import Draft, numbers, quaternion

_GREY = np.array([0.7, 0.7, 0.7, 1.0])  # Colour of visuals without one


def add_shapes(draft: Draft, link: Any, made: dict[str, Any], colours: dict[str, Any]) -> None:
    """Adds a link's visuals to its body, or its collisions where it has none.

    Args:
        draft: of the puppet.
        link: yourdfpy's.
        made: the body.
        colours: name of a material -> its colour.
    """
    line = draft.file.line_of("link", link.name)
    for solid in link.visuals or link.collisions:
        origin = np.eye(4) if solid.origin is None else solid.origin
        part = made["name"]
        shape = _shape(draft, solid.geometry, origin, link.name, line, part)
        if shape is None:
            continue
        material = getattr(solid, "material", None)
        colour = None
        if material is not None:
            colour = material.color or colours.get(material.name)
        rgba = _GREY if colour is None else colour.rgba
        if rgba[3] < 1.0:
            text = "has a transparent solid, which is opaque here"
            draft.note("link", link.name, text, line, part)
        made.setdefault("shapes", []).append(solids.coloured(shape, rgba))


def _shape(
    draft: Draft, geometry: Any, origin: Any, link: str, line: int | None, part: str
) -> dict[str, Any] | None:
    at, turn = origin[:3, 3], quaternion(Rotation.from_matrix(origin[:3, :3]))
    box, ball, rod, mesh = geometry.box, geometry.sphere, geometry.cylinder, geometry.mesh
    if box is not None and solids.fits(*box.size):
        return solids.box(box.size, at, turn)
    if ball is not None and solids.fits(ball.radius):
        return solids.sphere(ball.radius, at)
    if rod is not None and solids.fits(rod.radius, rod.length):
        return solids.cylinder(draft, rod.radius, rod.length, at, turn)
    if mesh is None:
        draft.note("link", link, "has a solid of a size that is left out", line, part)
        return None
    file = _find(mesh.filename, draft.file.path.resolve().parent)
    read, what = (None, "is not there") if file is None else _triangles(file)
    if read is not None and what:
        draft.note("link", link, f"has the mesh {str(mesh.filename)[:100]!r}: {what}", line, part)
    if file is not None:
        draft.sources.append(file)
    if file is None or read is None:
        name = str(mesh.filename)[:100]
        draft.note("link", link, f"has the mesh {name!r}, left out: it {what}", line, part)
        return None
    scale = 1.0 if mesh.scale is None else mesh.scale
    factors = numbers(np.broadcast_to(np.asarray(scale, float), 3))
    if not all(factors):
        draft.note("link", link, "has a mesh with a scale of 0, left out", line, part)
        return None
    shape = solids.mesh(draft, str(file), lambda: read, at, turn, file.stem)
    return shape if factors == [1, 1, 1] else shape | {"scale": factors}


def _find(name: str, folder: Path) -> Path | None:
    """The file of a mesh, whose name may begin with ``package://PACKAGE/``; None if not there.

    A package is a folder of its name above the model's, or beside one of those.
    """
    scheme, mark, rest = name.partition("://")
    if not mark:
        places = [folder / name]
    elif scheme == "file":
        places = [Path(rest)]
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


def _triangles(file: Path) -> tuple[bytes | None, str]:
    """A mesh as STL and what it loses, or None and why it is left out."""
    if file.suffix.lower() not in meshes.FORMATS:
        return None, f"is not one of {', '.join(meshes.FORMATS)}"
    try:
        found = meshes.read(file, file.parent)
    except (OSError, ValueError, MissingLibraryError) as error:
        return None, f"cannot be read: {error}"
    lost = "" if found.colours is None else "its own colours are left out"
    return solids.stl(found.vertices, found.faces), lost
