"""Reads mesh files of all formats."""

from __future__ import annotations

import hashlib
import json
import threading
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, MissingLibraryError
from fantoccini.model.meshes.beside import Beside
from fantoccini.model.meshes.collada import read_collada
from fantoccini.model.meshes.colours import few
from fantoccini.model.meshes.gltf import read_gltf
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.obj import read_obj
from fantoccini.model.meshes.part import Part
from fantoccini.model.meshes.plain import read_ply, read_stl
from fantoccini.model.meshes.solid import facing_out, is_closed

FORMATS = (".stl", ".obj", ".ply", ".glb", ".gltf", ".dae")
"""Endings of mesh files."""
_ALONE = (".stl", ".ply")
"""Of files that name no others."""

_NONE = "it holds no triangles with finite corners"


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Triangles of a file, of all its nodes, where these stand.

    Attributes:
        vertices: (n, 3), each place once; metres, z up, where the format has a unit and an axis.
        faces: (m, 3) indices of vertices, anticlockwise from outside; of a closed mesh also where
            the file has them the other way round.
        closed: whether they bound a volume.
        colours: (m, 3) sRGB of faces, nan where there is none; None where no face has one.
        lost: what materials have besides colours: textures, transparency.
        beside: contents of the files that it names and that are there, by their names relative to
            its folder.
    """

    vertices: Array
    faces: Indices
    closed: bool
    colours: Array | None
    lost: frozenset[str]
    beside: dict[str, bytes]


_Key = tuple[str, bytes, Path]
_kept: OrderedDict[_Key, tuple[dict[str, bytes | None], MeshFile]] = OrderedDict()
"""Files that were read last, by ending, content and folder, with what they named."""
_lock = threading.Lock()


def read(path: Path, root: Path) -> MeshFile:
    """Reads a file.

    Args:
        path: of the file.
        root: folder that no file may lie outside of which the mesh file names.

    Raises:
        ValueError: the file is broken or too large; the message goes on after its name.
        OSError: it cannot be read.
        MissingLibraryError: of a .dae file, pycollada is not installed.
    """
    content, ending = path.read_bytes(), path.suffix.lower()
    key = ending, hashlib.sha256(content).digest(), path.parent
    kept = _kept.get(key)
    if kept is not None and _named(Beside(path, root), kept[0]) == kept[0]:
        _keep(key, *kept)
        return kept[1]
    beside = Beside(path, root)
    parts = _parts(content, beside, path)
    mesh, colours = _joined(parts)
    there = {name: c for name, c in beside.found.items() if c is not None}
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    closed = is_closed(faces)
    if closed:
        faces = np.where(facing_out(mesh)[:, None], faces[:, ::-1], faces)
    lost = frozenset[str]().union(*(part.lost for part in parts))
    found = MeshFile(vertices, faces, closed, colours, lost, there)
    _keep(key, dict(beside.found), found)
    return found


def contents(path: Path, root: Path) -> dict[str, bytes]:
    """Contents of a file, under the name ".", and of those that it names, as :func:`read` has them.

    Raises:
        As :func:`read`.
    """
    beside = {} if path.suffix.lower() in _ALONE else read(path, root).beside
    return {".": path.read_bytes(), **beside}


def _keep(key: _Key, named: dict[str, bytes | None], found: MeshFile) -> None:
    """Keeps a file as the last one read, and takes out the first ones while all are too large."""
    with _lock:
        _kept[key] = named, found
        _kept.move_to_end(key)
        while len(_kept) > 1 and sum(_size(f) for _, f in _kept.values()) > LIMITS.max_triangles:
            _kept.popitem(last=False)


def _size(found: MeshFile) -> int:
    """Memory of a file, in triangles of about 32 bytes."""
    return len(found.faces) + sum(map(len, found.beside.values())) // 32 + 1000


def _named(beside: Beside, names: dict[str, bytes | None]) -> dict[str, bytes | None]:
    """Contents that files have now."""
    return {name: beside.peek(name) for name in names}


def _parts(content: bytes, beside: Beside, path: Path) -> list[Part]:
    try:
        if path.suffix.lower() in (".glb", ".gltf"):
            return read_gltf(content, beside)
        if path.suffix.lower() == ".dae":
            return read_collada(content, beside, path.name)
        if path.suffix.lower() == ".obj":
            return read_obj(content, beside)
        return read_stl(content) if path.suffix.lower() == ".stl" else read_ply(content)
    except MissingLibraryError:
        raise
    except (json.JSONDecodeError, UnicodeDecodeError):
        raise ValueError("its text is broken") from None
    except ValueError:
        raise
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except Exception as reason:  # what a broken file makes of indices, keys and types
        raise ValueError(f"it is broken: {type(reason).__name__}: {str(reason)[:60]}") from reason


def _joined(parts: list[Part]) -> tuple[Any, Array | None]:
    """All parts as one ``trimesh.Trimesh`` with each place once, and the colours of its faces."""
    import trimesh

    parts = [part for part in parts if len(part.faces)]
    if not parts or not all(np.isfinite(part.vertices[part.faces]).all() for part in parts):
        raise ValueError(_NONE)
    far = max(float(np.abs(part.vertices[part.faces]).max()) for part in parts)
    if far > LIMITS.max_coordinate:
        raise ValueError(f"it has a corner at {far:g}; allowed: up to {LIMITS.max_coordinate:g}")
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])[:-1]
    faces = np.concatenate([p.faces + at for p, at in zip(parts, starts, strict=True)])
    mesh = trimesh.Trimesh(np.concatenate([p.vertices for p in parts]), faces, process=False)
    mesh.merge_vertices()
    colours = None
    if any(part.colours is not None for part in parts):
        none = [np.full((len(p.faces), 3), np.nan) for p in parts]
        own = [n if p.colours is None else p.colours for p, n in zip(parts, none, strict=True)]
        colours = few(np.concatenate(own))
    faces = np.array(mesh.faces)
    # Corners at one place make no triangle.
    real = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
    if not real.any():
        raise ValueError(_NONE)
    mesh.update_faces(real)
    return mesh, None if colours is None else colours[real]
