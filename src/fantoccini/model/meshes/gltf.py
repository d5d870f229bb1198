"""glTF 2.0 (.glb, .gltf): nodes, triangles, base colours. y up becomes z up, as in Blender.

Cameras, lights, animations, skins and morph targets are left out. No file is trusted: every index
and length is checked before memory is allocated.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, rotation
from fantoccini.model.meshes.accessors import Accessors, whole
from fantoccini.model.meshes.colours import Texture, image, srgb
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles
from fantoccini.model.meshes.part import Y_UP, Count, Part, lost

_SUPPORTED = (
    "KHR_materials_",
    "KHR_lights_",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "EXT_texture_webp",
    "KHR_xmp",
)
"""Beginnings of the names of extensions that a file may require."""

_CLAMP_TO_EDGE = 33071
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_gltf(content: bytes, beside: LinkedFiles) -> list[Part]:
    """The parts of a file, z up [m].

    Args:
        content: content of the .glb or .gltf file.
        beside: reader of the files to which it refers.

    Raises:
        ValueError: the file is broken, refers to a file that may not be read, or requires an
            unsupported extension.
    """
    text, chunk = _unpacked(content)
    header = json.loads(text)
    if not isinstance(header, dict):
        raise ValueError("it is not a glTF file")
    version = str(header.get("asset", {}).get("version"))
    if not version.startswith("2."):
        raise ValueError(f"it is glTF {version[:20]}; allowed: 2.0")
    needed = header.get("extensionsRequired", [])
    unknown = sorted(name for name in needed if not name.startswith(_SUPPORTED))
    if unknown:
        raise ValueError(f"it needs {', '.join(unknown)[:99]}: export it without compression")
    return _Reader(header, chunk, beside).parts()


def _unpacked(content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and, for a .glb file, its binary chunk."""
    if content[:4] != b"glTF":
        return content, None
    chunks, at = dict[int, bytes](), 12
    while at + 8 <= len(content):
        length, kind = struct.unpack_from("<II", content, at)
        if at + 8 + length > len(content):
            raise ValueError("it ends in the middle of a chunk")
        chunks.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if 0x4E4F534A not in chunks:
        raise ValueError("it has no chunk of JSON")
    return chunks[0x4E4F534A], chunks.get(0x004E4942)


_Primitive = tuple[Array, Indices, Array | None, frozenset[str]]
"""Vertices, faces, colours, and properties of the material that are not kept."""


class _Reader:
    """Reads one file.

    Args:
        header: JSON of the file.
        chunk: binary chunk of a .glb file.
        beside: reader of the files to which it refers.
    """

    def __init__(self, header: dict[str, Any], chunk: bytes | None, beside: LinkedFiles):
        self.header, self.chunk, self.beside = header, chunk, beside
        buffers = [self._buffer(k, b) for k, b in enumerate(header.get("buffers", []))]
        self.accessors = Accessors(header, buffers)
        self._images: dict[int, np.ndarray] = {}
        self._meshes: dict[int, list[_Primitive]] = {}
        self._count = Count()

    def parts(self) -> list[Part]:
        """The parts of all nodes of the scene."""
        up = np.eye(4)
        up[:3, :3] = Y_UP
        nodes, seen = self.header.get("nodes", []), set[int]()
        parts: list[Part] = []
        waiting = [(k, up) for k in reversed(self._roots(nodes))]
        while waiting:
            k, above = waiting.pop()
            if whole(k, "a node") in seen:
                raise ValueError(f"its node {k} has two parents")
            if len(seen) > LIMITS.max_nodes:
                raise ValueError(f"it has more than {LIMITS.max_nodes} nodes")
            seen.add(k)
            matrix = above @ _pose(nodes[k])
            waiting += [(child, matrix) for child in reversed(nodes[k].get("children", []))]
            if "mesh" in nodes[k]:
                for primitive in self._mesh(whole(nodes[k]["mesh"], "a mesh")):
                    parts.append(Part.placed(matrix, *primitive))
        return parts

    def _roots(self, nodes: list[Any]) -> list[int]:
        scenes = self.header.get("scenes", [])
        if scenes:
            return list(scenes[whole(self.header.get("scene", 0), "a scene")].get("nodes", []))
        below = {child for node in nodes for child in node.get("children", [])}
        return [k for k in range(len(nodes)) if k not in below]

    def _mesh(self, index: int) -> list[_Primitive]:
        """The primitives of a mesh that have triangles; counts the triangles."""
        primitives = [
            p
            for p in self.header["meshes"][index]["primitives"]
            if p.get("mode", _TRIANGLES) >= _TRIANGLES
        ]
        for primitive in primitives:
            accessor = primitive.get("indices", primitive["attributes"]["POSITION"])
            corners = self.accessors.count(accessor)
            is_list = primitive.get("mode", _TRIANGLES) == _TRIANGLES
            self._count.add(corners // 3 if is_list else max(corners - 2, 0))
        if index not in self._meshes:
            self._meshes[index] = [self._primitive(p) for p in primitives]
        return self._meshes[index]

    def _primitive(self, primitive: dict[str, Any]) -> _Primitive:
        attributes = primitive["attributes"]
        vertices = self.accessors.numbers(attributes["POSITION"], 3)
        if "indices" in primitive:
            corners = self.accessors.whole_numbers(primitive["indices"])
        else:
            corners = np.arange(len(vertices))
        faces = _faces(corners, whole(primitive.get("mode", _TRIANGLES), "a mode"))
        if len(faces) and int(faces.max()) >= len(vertices):
            raise ValueError("a triangle has a corner that does not exist")
        colours = self._colours(primitive, attributes, faces)
        used, renumbered = np.unique(faces, return_inverse=True)  # primitives may share vertices
        return vertices[used], renumbered.reshape(-1, 3), colours, self._lost(primitive)

    def _lost(self, primitive: dict[str, Any]) -> frozenset[str]:
        if "material" not in primitive:
            return frozenset()
        material = self.header["materials"][whole(primitive["material"], "a material")]
        textured = "baseColorTexture" in material.get("pbrMetallicRoughness", {})
        return lost(textured, material.get("alphaMode", "OPAQUE") != "OPAQUE")

    def _colours(
        self, primitive: dict[str, Any], attributes: dict[str, Any], faces: Indices
    ) -> Array | None:
        """sRGB of triangles: base colour, vertex colours and texture, multiplied as linear RGB."""
        if "material" not in primitive and "COLOR_0" not in attributes:
            return None
        colours = np.ones((len(faces), 3))
        if "COLOR_0" in attributes:
            corners = self.accessors.numbers(attributes["COLOR_0"], 3, 4)[:, :3]
            colours *= corners[faces].mean(axis=1)
        if "material" in primitive:
            material = self.header["materials"][whole(primitive["material"], "a material")]
            look = material.get("pbrMetallicRoughness", {})
            colours *= np.array(look.get("baseColorFactor", [1.0] * 4), dtype=float)[:3]
            if "baseColorTexture" in look:
                colours *= self._texture(look["baseColorTexture"], attributes, faces)
        return srgb(colours)

    def _texture(self, about: dict[str, Any], attributes: dict[str, Any], faces: Indices) -> Array:
        moved = about.get("extensions", {}).get("KHR_texture_transform", {})
        name = f"TEXCOORD_{whole(moved.get('texCoord', about.get('texCoord', 0)), 'a texCoord')}"
        if name not in attributes:
            return np.ones((len(faces), 3))
        uv = self.accessors.numbers(attributes[name], 2) * moved.get("scale", [1.0, 1.0])
        c, s = np.cos(moved.get("rotation", 0.0)), np.sin(moved.get("rotation", 0.0))
        uv = uv @ np.array([[c, -s], [s, c]]) + moved.get("offset", [0.0, 0.0])
        texture = self.header["textures"][whole(about["index"], "a texture")]
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        source = whole(webp.get("source", texture.get("source")), "the source of a texture")
        sampler: dict[str, Any] = {}
        if "sampler" in texture:
            sampler = self.header["samplers"][whole(texture["sampler"], "a sampler")]
        repeats = sampler.get("wrapS") != _CLAMP_TO_EDGE, sampler.get("wrapT") != _CLAMP_TO_EDGE
        return Texture(self._image(source), repeats).over(uv[faces])

    def _image(self, index: int) -> np.ndarray:
        if index not in self._images:
            about = self.header["images"][index]
            if "uri" in about:
                content = self._linked(about["uri"])
            else:
                content = self.accessors.view(about["bufferView"])[0]
            name = about.get("name") or str(about.get("uri", index))[:40]
            self._images = {index: image(content, repr(name))}
        return self._images[index]

    def _buffer(self, index: int, about: dict[str, Any]) -> bytes:
        if "uri" in about:
            content = self._linked(about["uri"])
        elif index == 0 and self.chunk is not None:
            content = self.chunk
        else:
            raise ValueError(f"its buffer {index} has no content")
        length = whole(about["byteLength"], "the length of a buffer")
        if length > len(content):
            text = f"its buffer {index} has {len(content)} bytes; it says {length}"
            raise ValueError(text)
        return content[:length]

    def _linked(self, uri: str) -> bytes:
        """The content of a data URI, or of a file in this one's folder."""
        if not uri.startswith("data:"):
            return self.beside.read(uri)
        kind, comma, text = uri.partition(",")
        if not comma or not kind.endswith(";base64"):
            raise ValueError("it has a data URI that is not base64")
        try:
            return base64.b64decode(text, validate=True)
        except binascii.Error:
            raise ValueError("it has a data URI that is not base64") from None


def _faces(corners: Indices, mode: int) -> Indices:
    """(m, 3) triangles of a list, a strip or a fan; in a strip, every second one is reversed."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if mode not in (_STRIP, _FAN):
        raise ValueError(f"a primitive has the mode {mode}; allowed: 0 to 6")
    k = np.arange(max(len(corners) - 2, 0))
    if mode == _FAN:
        return corners[np.stack([np.zeros_like(k), k + 1, k + 2], axis=1)]
    odd = k % 2
    return corners[np.stack([k, k + 1 + odd, k + 2 - odd], axis=1)]


def _pose(node: dict[str, Any]) -> Array:
    """(4, 4) pose of a node in its parent: its matrix, or T R S."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    out = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", [0.0, 0.0, 0.0, 1.0]), dtype=float)
    if not x * x + y * y + z * z + w * w > 0.0:
        raise ValueError("a node has a rotation of zero")
    out[:3, :3] = rotation.matrix(rotation.normalised(np.array([w, x, y, z])))
    out[:3, :3] *= np.array(node.get("scale", [1.0, 1.0, 1.0]), dtype=float)
    out[:3, 3] = node.get("translation", [0.0, 0.0, 0.0])
    return out
