"""Reads mesh files of all formats.

A part is the triangles of one material, and a node places parts in the frame of the file.
"""

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
from fantoccini.model.meshes.collada import read_collada
from fantoccini.model.meshes.colours import reduced
from fantoccini.model.meshes.gltf import read_gltf
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles
from fantoccini.model.meshes.obj import read_obj
from fantoccini.model.meshes.part import Part
from fantoccini.model.meshes.plain import read_ply, read_stl
from fantoccini.model.meshes.solid import faces_to_reverse, is_closed

FORMATS = (".stl", ".obj", ".ply", ".glb", ".gltf", ".dae")
"""Endings of mesh files."""
_SELF_CONTAINED = (".stl", ".ply")
"""Endings of formats that do not refer to other files."""

_NO_TRIANGLES = "it holds no triangles with finite corners"


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Triangles of a mesh file, of all its nodes, in the frame of the file.

    Attributes:
        vertices: (n, 3) distinct positions; in metres with z up if the format defines them.
        faces: (m, 3) indices of vertices, anticlockwise from outside; corrected for closed meshes.
        closed: whether the triangles bound a volume.
        colours: (m, 3) sRGB of faces, nan for no colour; None if no face has one.
        lost: properties of materials that are not kept: textures, transparency.
        linked_contents: names of existing files to which it refers, relative to its folder ->
            contents.
    """

    vertices: Array
    faces: Indices
    closed: bool
    colours: Array | None
    lost: frozenset[str]
    linked_contents: dict[str, bytes]


_Key = tuple[str, bytes, Path]
_cache: OrderedDict[_Key, tuple[dict[str, bytes | None], MeshFile]] = OrderedDict()
"""Ending, content and folder of recent files -> contents of the files they name, and the mesh."""
_lock = threading.Lock()


def read(path: Path, root: Path) -> MeshFile:
    """Reads a mesh file.

    Args:
        path: path of the file.
        root: folder that must contain all files to which it refers.

    Raises:
        ValueError: the file is broken or too large; the message is the end of a sentence about it.
        OSError: the file cannot be read.
        MissingLibraryError: it is a .dae file, and pycollada is not installed.
    """
    content, suffix = path.read_bytes(), path.suffix.lower()
    key = suffix, hashlib.sha256(content).digest(), path.parent
    cached = _cache.get(key)
    if cached is not None and _current_contents(LinkedFiles(path, root), cached[0]) == cached[0]:
        _cache_file(key, *cached)
        return cached[1]
    linked_files = LinkedFiles(path, root)
    parts = _parts(content, linked_files, path)
    mesh, colours = _merged(parts)
    existing = {name: c for name, c in linked_files.contents.items() if c is not None}
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    is_closed_ = is_closed(faces)
    if is_closed_:
        faces = np.where(faces_to_reverse(mesh)[:, None], faces[:, ::-1], faces)
    ignored = frozenset[str]().union(*(part.lost for part in parts))
    file = MeshFile(vertices, faces, is_closed_, colours, ignored, existing)
    _cache_file(key, dict(linked_files.contents), file)
    return file


def contents(path: Path, root: Path) -> dict[str, bytes]:
    """Contents of a mesh file, under the name ".", and of the files to which it refers.

    Raises:
        ValueError, OSError, MissingLibraryError: :func:`read` raises them.
    """
    linked_contents = (
        {} if path.suffix.lower() in _SELF_CONTAINED else read(path, root).linked_contents
    )
    return {".": path.read_bytes(), **linked_contents}


def _cache_file(key: _Key, contents_by_name: dict[str, bytes | None], file: MeshFile) -> None:
    """Adds a file to the cache, and removes the oldest files while the cache is too large."""
    with _lock:
        _cache[key] = contents_by_name, file
        _cache.move_to_end(key)
        while len(_cache) > 1 and sum(_size(f) for _, f in _cache.values()) > LIMITS.max_triangles:
            _cache.popitem(last=False)


def _size(file: MeshFile) -> int:
    """Memory of a file, in triangles of about 32 bytes."""
    return len(file.faces) + sum(map(len, file.linked_contents.values())) // 32 + 1000


def _current_contents(
    linked_files: LinkedFiles, contents_by_name: dict[str, bytes | None]
) -> dict[str, bytes | None]:
    """Present contents of files."""
    return {name: linked_files.current(name) for name in contents_by_name}


def _parts(content: bytes, linked_files: LinkedFiles, path: Path) -> list[Part]:
    try:
        if path.suffix.lower() in (".glb", ".gltf"):
            return read_gltf(content, linked_files)
        if path.suffix.lower() == ".dae":
            return read_collada(content, linked_files, path.name)
        if path.suffix.lower() == ".obj":
            return read_obj(content, linked_files)
        return read_stl(content) if path.suffix.lower() == ".stl" else read_ply(content)
    except MissingLibraryError:
        raise
    except (json.JSONDecodeError, UnicodeDecodeError):
        raise ValueError("its text is broken") from None
    except ValueError:
        raise
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except Exception as reason:  # a broken file causes errors of many classes
        raise ValueError(f"it is broken: {type(reason).__name__}: {str(reason)[:60]}") from reason


def _merged(parts: list[Part]) -> tuple[Any, Array | None]:
    """All parts as a ``trimesh.Trimesh`` with distinct positions, and the colours of its faces."""
    import trimesh

    parts = [part for part in parts if len(part.faces)]
    if not parts or not all(np.isfinite(part.vertices[part.faces]).all() for part in parts):
        raise ValueError(_NO_TRIANGLES)
    max_coordinate = max(float(np.abs(part.vertices[part.faces]).max()) for part in parts)
    if max_coordinate > LIMITS.max_coordinate:
        allowed = f"up to {LIMITS.max_coordinate:g}"
        raise ValueError(f"it has a corner at {max_coordinate:g}; allowed: {allowed}")
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])[:-1]
    faces = np.concatenate([p.faces + at for p, at in zip(parts, starts, strict=True)])
    mesh = trimesh.Trimesh(np.concatenate([p.vertices for p in parts]), faces, process=False)
    mesh.merge_vertices()
    colours = None
    if any(part.colours is not None for part in parts):
        blank_colours = (np.full((len(p.faces), 3), np.nan) for p in parts)
        part_colours = (
            n if p.colours is None else p.colours for p, n in zip(parts, blank_colours, strict=True)
        )
        colours = reduced(np.concatenate(list(part_colours)))
    faces = np.array(mesh.faces)
    # A triangle with two corners at one place has no area.
    has_area = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
    if not has_area.any():
        raise ValueError(_NO_TRIANGLES)
    mesh.update_faces(has_area)
    return mesh, None if colours is None else colours[has_area]
