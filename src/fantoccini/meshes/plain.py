"""STL, PLY and OBJ by trimesh, as their files have them: neither unit nor upward axis is known."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.meshes.beside import Beside
from fantoccini.meshes.colours import Texture, image_beside, srgb
from fantoccini.meshes.part import Count, Part, lost


class _Materials:
    """Gives trimesh the material file of an OBJ, but no images: it would open them unmeasured.

    Attributes:
        images: names of images by the names of materials.
        transparent: names of materials.
    """

    def __init__(self, beside: Beside):
        self.beside = beside
        self.images: dict[str, str] = {}
        self.transparent: set[str] = set()

    def get(self, name: str) -> bytes:
        """The content of a file; FileNotFoundError where it is missing or not allowed."""
        try:
            if not name.lower().endswith(".mtl"):
                raise ValueError("an image")
            content = self.beside.read(name.removeprefix("./"))
        except ValueError:
            raise FileNotFoundError(name) from None
        text = content.decode("utf-8", "replace")
        self.images |= _images_of(text)
        self.transparent |= _transparent_of(text)
        return content

    __getitem__ = get


def _images_of(text: str) -> dict[str, str]:
    """Names of images in a material file, without the options before them."""
    return {
        material: rest.split()[-1] if rest.startswith("-") else rest
        for material, key, rest in _lines_of(text)
        if key == "map_kd" and rest
    }


def _transparent_of(text: str) -> set[str]:
    """Names of the materials in a material file that let light through."""
    opaque = {"d": 1.0, "tr": 0.0}
    return {
        material
        for material, key, rest in _lines_of(text)
        if key == "map_d" or (key in opaque and _last(rest, opaque[key]) != opaque[key])
    }


def _lines_of(text: str) -> Iterator[tuple[str, str, str]]:
    """Material, key and the rest of each line."""
    material = ""
    for line in text.splitlines():
        key, _, rest = line.strip().partition(" ")
        if key.lower() == "newmtl":
            material = " ".join(rest.split())
        yield material, key.lower(), rest.strip()


def _last(text: str, default: float) -> float:
    try:
        return float(text.split()[-1])
    except (ValueError, IndexError):
        return default


def read_plain(content: bytes, beside: Beside, kind: str) -> list[Part]:
    """The parts of a file.

    Args:
        content: of the file.
        beside: reads materials and images of an OBJ; those that are not there are left out.
        kind: stl, ply or obj.

    Raises:
        ValueError: the file is no mesh.
    """
    import trimesh

    materials = _Materials(beside)
    options = {"resolver": materials} if kind == "obj" else {}
    try:
        found = trimesh.load(io.BytesIO(content), file_type=kind, **options)
    except Exception as reason:  # trimesh's readers raise whatever their parsing meets
        raise ValueError(f"{type(reason).__name__} in its reader") from reason
    meshes = found.dump() if isinstance(found, trimesh.Scene) else [found]
    count, parts = Count(), []
    for mesh in meshes:
        if isinstance(mesh, trimesh.Trimesh):
            count.add(len(mesh.faces))
            vertices, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
            parts.append(Part(vertices, faces, _colours(mesh, materials), _lost(mesh, materials)))
    return parts


def _lost(mesh: Any, materials: _Materials) -> frozenset[str]:
    look = mesh.visual
    if look.kind in ("face", "vertex"):
        return lost(False, bool(np.any(np.asarray(look.face_colors)[:, 3] < 255)))
    if look.kind != "texture":
        return frozenset()
    name = str(look.material.name)
    return lost(name in materials.images, name in materials.transparent)


def _colours(mesh: Any, materials: _Materials) -> Array | None:
    """sRGB: colours of faces or corners, or a material's image, or its diffuse colour."""
    look = mesh.visual
    if look.kind in ("face", "vertex"):
        return np.array(look.face_colors, dtype=float)[:, :3] / 255.0
    if look.kind != "texture":
        return None
    name = materials.images.get(str(look.material.name))
    pixels = None if name is None or look.uv is None else image_beside(name, materials.beside)
    if pixels is not None:
        uv = np.array(look.uv, dtype=float)[mesh.faces] * [1.0, -1.0] + [0.0, 1.0]
        return srgb(Texture(pixels).over(uv))
    diffuse = np.array(look.material.kwargs.get("kd", []), dtype=float)
    if diffuse.shape != (3,):
        return None
    return np.tile(np.clip(diffuse, 0.0, 1.0), (len(mesh.faces), 1))
