"""COLLADA files (.dae), read by pycollada and converted to metres with z up.

A node places geometry in the scene; an instance is one use of it.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, MissingLibraryError
from fantoccini.model.meshes.colours import Texture, linked_image, srgb
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles
from fantoccini.model.meshes.part import Y_UP, Part, TriangleCount, ignored_properties

_TO_Z_UP = {
    "Z_UP": np.eye(3),
    "Y_UP": Y_UP,
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}


def read_collada(content: bytes, linked_files: LinkedFiles, name: str) -> list[Part]:
    """The parts of a file, z up [m].

    Images outside the file's folder are left out: their paths are often those of another machine.

    Args:
        content: content of the file.
        linked_files: reader of its images.
        name: name of the file, for messages.

    Raises:
        ValueError: the file is broken.
        MissingLibraryError: pycollada is not installed.
    """
    try:
        import collada
    except ImportError:
        raise MissingLibraryError(f"the mesh {name}", "pycollada", "dae") from None
    # Entities may include other files, or expand to gigabytes.
    is_unsafe = any(mark in content for mark in (b"<!DOCTYPE", b"<!ENTITY", b"\0"))
    if is_unsafe or content[:2] == b"PK":
        raise ValueError("allowed: plain XML in UTF-8, without a document type")
    try:
        document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeUnsupportedError])
    except collada.common.DaeError as reason:
        raise ValueError(f"it is broken: {str(reason)[:120]}") from reason
    asset = document.assetInfo
    to_metres = np.eye(4)
    unit = 1.0 if asset.unitmeter is None else float(asset.unitmeter)
    to_metres[:3, :3] = unit * _TO_Z_UP[asset.upaxis]
    if document.scene is None:
        raise ValueError("it has no scene")
    if sum(_nodes(node, {}) for node in document.scene.nodes) > LIMITS.max_nodes:
        raise ValueError(f"it has more than {LIMITS.max_nodes} nodes")
    return list(_parts(document, to_metres, linked_files))


def _nodes(node: Any, count_by_id: dict[int, int]) -> int:
    """Number of nodes in a tree, with every instance counted.

    ``count_by_id`` caches the numbers by node.
    """
    node = getattr(node, "node", node)
    if id(node) not in count_by_id:
        children = getattr(node, "children", None) or []
        count_by_id[id(node)] = 1 + sum(_nodes(child, count_by_id) for child in children)
    return count_by_id[id(node)]


def _parts(document: Any, to_metres: Array, linked_files: LinkedFiles) -> Iterator[Part]:
    count, images = TriangleCount(), dict[str, np.ndarray | None]()
    for geometry in document.scene.objects("geometry"):
        is_mirrored = np.linalg.det(geometry.matrix[:3, :3]) < 0.0
        for primitive in geometry.primitives():
            if hasattr(primitive, "triangleset"):
                primitive = primitive.triangleset()
            if not hasattr(primitive, "normal_index") or primitive.vertex_index is None:
                continue
            faces = np.asarray(primitive.vertex_index, dtype=int)
            if faces.ndim != 2 or faces.shape[1] != 3:
                continue
            count.add(len(faces))
            vertices = np.asarray(primitive.vertex, dtype=float)
            colours = _colours(primitive, faces, linked_files, images)
            faces = faces[:, ::-1] if is_mirrored else faces
            yield Part.transformed_by(
                to_metres, vertices, faces, colours, _ignored_of(primitive.material)
            )


def _ignored_of(material: Any) -> frozenset[str]:
    effect = getattr(material, "effect", None)
    if effect is None:
        return frozenset()
    diffuse, transparency, opacity_factor = (
        effect.diffuse or effect.emission,
        effect.transparent,
        effect.transparency,
    )
    is_transparent = hasattr(transparency, "sampler")
    if transparency is not None and not is_transparent:
        opacity_factor = opacity_factor if isinstance(opacity_factor, int | float) else 1.0
        if effect.opaque_mode == "RGB_ZERO":
            is_transparent = opacity_factor * max(transparency[:3], default=0.0) > 0.0
        else:
            is_transparent = (
                opacity_factor * (transparency[3] if len(transparency) > 3 else 1.0) < 1.0
            )
    return ignored_properties(hasattr(diffuse, "sampler"), is_transparent)


def _colours(
    primitive: Any, faces: Indices, linked_files: LinkedFiles, images: dict[str, np.ndarray | None]
) -> Array | None:
    """sRGB of triangles: the diffuse colour, or the emission of a material without one."""
    effect = getattr(primitive.material, "effect", None)
    diffuse = getattr(effect, "diffuse", None) or getattr(effect, "emission", None)
    if diffuse is None:
        return None
    if not hasattr(diffuse, "sampler"):
        return np.tile(np.clip(np.array(diffuse[:3], dtype=float), 0.0, 1.0), (len(faces), 1))
    path = diffuse.sampler.surface.image.path
    if path not in images:
        images[path] = linked_image(path, linked_files)
    pixels = images[path]
    if pixels is None or not primitive.texcoordset:
        return None
    uv = np.asarray(primitive.texcoordset[0], dtype=float)[:, :2]
    uv = uv[np.asarray(primitive.texcoord_indexset[0], dtype=int)] * [1.0, -1.0] + [0.0, 1.0]
    return srgb(Texture(pixels).average_over(uv))
