"""COLLADA files (.dae), read by pycollada and converted to metres with z up."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, MissingLibraryError
from fantoccini.model.meshes.colours import Texture, linked_image, srgb
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles
from fantoccini.model.meshes.part import Y_UP, Count, Part, ignored_properties

_UP = {
    "Z_UP": np.eye(3),
    "Y_UP": Y_UP,
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}


def read_collada(content: bytes, beside: LinkedFiles, name: str) -> list[Part]:
    """The parts of a file, z up [m].

    Images outside the file's folder are left out: their paths are often those of another machine.

    Args:
        content: content of the file.
        beside: reader of its images.
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
    unsafe = any(mark in content for mark in (b"<!DOCTYPE", b"<!ENTITY", b"\0"))
    if unsafe or content[:2] == b"PK":
        raise ValueError("allowed: plain XML in UTF-8, without a document type")
    try:
        document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeUnsupportedError])
    except collada.common.DaeError as reason:
        raise ValueError(f"it is broken: {str(reason)[:120]}") from reason
    about = document.assetInfo
    to_metres = np.eye(4)
    unit = 1.0 if about.unitmeter is None else float(about.unitmeter)
    to_metres[:3, :3] = unit * _UP[about.upaxis]
    if document.scene is None:
        raise ValueError("it has no scene")
    if sum(_nodes(node, {}) for node in document.scene.nodes) > LIMITS.max_nodes:
        raise ValueError(f"it has more than {LIMITS.max_nodes} nodes")
    return list(_parts(document, to_metres, beside))


def _nodes(node: Any, known: dict[int, int]) -> int:
    """Number of nodes in a tree, with every instance counted.

    ``known`` caches the numbers by node.
    """
    node = getattr(node, "node", node)
    if id(node) not in known:
        children = getattr(node, "children", None) or []
        known[id(node)] = 1 + sum(_nodes(child, known) for child in children)
    return known[id(node)]


def _parts(document: Any, to_metres: Array, beside: LinkedFiles) -> Iterator[Part]:
    count, images = Count(), dict[str, np.ndarray | None]()
    for geometry in document.scene.objects("geometry"):
        mirrored = np.linalg.det(geometry.matrix[:3, :3]) < 0.0
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
            colours = _colours(primitive, faces, beside, images)
            faces = faces[:, ::-1] if mirrored else faces
            yield Part.placed(to_metres, vertices, faces, colours, _lost(primitive.material))


def _lost(material: Any) -> frozenset[str]:
    effect = getattr(material, "effect", None)
    if effect is None:
        return frozenset()
    look, clear, share = effect.diffuse or effect.emission, effect.transparent, effect.transparency
    transparent = hasattr(clear, "sampler")
    if clear is not None and not transparent:
        share = share if isinstance(share, int | float) else 1.0
        if effect.opaque_mode == "RGB_ZERO":
            transparent = share * max(clear[:3], default=0.0) > 0.0
        else:
            transparent = share * (clear[3] if len(clear) > 3 else 1.0) < 1.0
    return ignored_properties(hasattr(look, "sampler"), transparent)


def _colours(
    primitive: Any, faces: Indices, beside: LinkedFiles, images: dict[str, np.ndarray | None]
) -> Array | None:
    """sRGB of triangles: the diffuse colour, or the emission of a material without one."""
    effect = getattr(primitive.material, "effect", None)
    look = getattr(effect, "diffuse", None) or getattr(effect, "emission", None)
    if look is None:
        return None
    if not hasattr(look, "sampler"):
        return np.tile(np.clip(np.array(look[:3], dtype=float), 0.0, 1.0), (len(faces), 1))
    path = look.sampler.surface.image.path
    if path not in images:
        images[path] = linked_image(path, beside)
    pixels = images[path]
    if pixels is None or not primitive.texcoordset:
        return None
    uv = np.asarray(primitive.texcoordset[0], dtype=float)[:, :2]
    uv = uv[np.asarray(primitive.texcoord_indexset[0], dtype=int)] * [1.0, -1.0] + [0.0, 1.0]
    return srgb(Texture(pixels).over(uv))
