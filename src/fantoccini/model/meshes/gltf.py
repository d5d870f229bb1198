"""glTF 2.0 (.glb, .gltf): nodes, triangles, base colours. y up becomes z up, as in Blender.

Cameras, lights, animations, skins and morph targets are ignored. Files are not trusted: every index
and length is checked before memory is allocated.

A node places geometry in the scene; a part is the triangles of one material.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, rotation
from fantoccini.model.meshes.accessors import Accessors, check_natural
from fantoccini.model.meshes.colours import Texture, image, srgb
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles
from fantoccini.model.meshes.part import Y_UP, Part, TriangleCount, ignored_properties

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


def read_gltf(content: bytes, linked_files: LinkedFiles) -> list[Part]:
    """The parts of a file, z up [m].

    Args:
        content: content of the .glb or .gltf file.
        linked_files: reader of the files to which it refers.

    Raises:
        ValueError: the file is broken, refers to a file that may not be read, or requires an
            unsupported extension.
    """
    text, chunk = _json_and_chunk(content)
    header = json.loads(text)
    if not isinstance(header, dict):
        raise ValueError("it is not a glTF file")
    version = str(header.get("asset", {}).get("version"))
    if not version.startswith("2."):
        raise ValueError(f"it is glTF {version[:20]}; allowed: 2.0")
    required = header.get("extensionsRequired", [])
    unknown = sorted(name for name in required if not name.startswith(_SUPPORTED))
    if unknown:
        reason = f"it needs the extensions {', '.join(unknown)[:99]}"
        raise ValueError(f"{reason}; export it without them, for example without compression")
    return _Reader(header, chunk, linked_files).parts()


def _json_and_chunk(content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and, for a .glb file, its binary chunk."""
    if content[:4] != b"glTF":
        return content, None
    chunks, start = dict[int, bytes](), 12
    while start + 8 <= len(content):
        length, kind = struct.unpack_from("<II", content, start)
        if start + 8 + length > len(content):
            raise ValueError("it ends in the middle of a chunk")
        chunks.setdefault(kind, content[start + 8 : start + 8 + length])
        start += 8 + length
    if 0x4E4F534A not in chunks:
        raise ValueError("it has no chunk of JSON")
    return chunks[0x4E4F534A], chunks.get(0x004E4942)


_Primitive = tuple[Array, Indices, Array | None, frozenset[str]]
"""Vertices, faces, colours, and the ignored properties of the material."""


class _Reader:
    """Reads one file.

    Args:
        header: JSON of the file.
        chunk: binary chunk of a .glb file.
        linked_files: reader of the files to which it refers.
    """

    def __init__(self, header: dict[str, Any], chunk: bytes | None, linked_files: LinkedFiles):
        self.header, self.chunk, self.linked_files = header, chunk, linked_files
        buffers = [self._buffer(k, b) for k, b in enumerate(header.get("buffers", []))]
        self.accessors = Accessors(header, buffers)
        self._images: dict[int, np.ndarray] = {}
        self._meshes: dict[int, list[_Primitive]] = {}
        self._count = TriangleCount()

    def parts(self) -> list[Part]:
        """The parts of all nodes of the scene."""
        to_z_up = np.eye(4)
        to_z_up[:3, :3] = Y_UP
        nodes, visited = self.header.get("nodes", []), set[int]()
        parts: list[Part] = []
        pending = [(k, to_z_up) for k in reversed(self._root_nodes(nodes))]
        while pending:
            k, parent_matrix = pending.pop()
            if check_natural(k, "a node") in visited:
                raise ValueError(f"its node {k} has two parents")
            if len(visited) > LIMITS.max_nodes:
                raise ValueError(f"it has more than {LIMITS.max_nodes} nodes")
            visited.add(k)
            matrix = parent_matrix @ _pose(nodes[k])
            pending += [(child, matrix) for child in reversed(nodes[k].get("children", []))]
            if "mesh" in nodes[k]:
                for primitive in self._primitives_of(check_natural(nodes[k]["mesh"], "a mesh")):
                    parts.append(Part.transformed_by(matrix, *primitive))
        return parts

    def _root_nodes(self, nodes: list[Any]) -> list[int]:
        scenes = self.header.get("scenes", [])
        if scenes:
            return list(
                scenes[check_natural(self.header.get("scene", 0), "a scene")].get("nodes", [])
            )
        children = {child for node in nodes for child in node.get("children", [])}
        return [k for k in range(len(nodes)) if k not in children]

    def _primitives_of(self, index: int) -> list[_Primitive]:
        """The triangle primitives of a mesh; counts their triangles."""
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
        faces = _faces(corners, check_natural(primitive.get("mode", _TRIANGLES), "a mode"))
        if len(faces) and int(faces.max()) >= len(vertices):
            raise ValueError("a triangle has a corner that does not exist")
        colours = self._colours(primitive, attributes, faces)
        used_vertices, new_indices = np.unique(
            faces, return_inverse=True
        )  # primitives may share vertices
        return (
            vertices[used_vertices],
            new_indices.reshape(-1, 3),
            colours,
            self._ignored(primitive),
        )

    def _ignored(self, primitive: dict[str, Any]) -> frozenset[str]:
        """The properties of a primitive's material that are ignored."""
        if "material" not in primitive:
            return frozenset()
        material = self.header["materials"][check_natural(primitive["material"], "a material")]
        is_textured = "baseColorTexture" in material.get("pbrMetallicRoughness", {})
        return ignored_properties(is_textured, material.get("alphaMode", "OPAQUE") != "OPAQUE")

    def _colours(
        self, primitive: dict[str, Any], attributes: dict[str, Any], faces: Indices
    ) -> Array | None:
        """(m, 3) sRGB of triangles: base colour x vertex colours x texture, in linear RGB."""
        if "material" not in primitive and "COLOR_0" not in attributes:
            return None
        colours = np.ones((len(faces), 3))
        if "COLOR_0" in attributes:
            corners = self.accessors.numbers(attributes["COLOR_0"], 3, 4)[:, :3]
            colours *= corners[faces].mean(axis=1)
        if "material" in primitive:
            material = self.header["materials"][check_natural(primitive["material"], "a material")]
            base = material.get("pbrMetallicRoughness", {})
            colours *= np.array(base.get("baseColorFactor", [1.0] * 4), dtype=float)[:3]
            if "baseColorTexture" in base:
                colours *= self._texture(base["baseColorTexture"], attributes, faces)
        return srgb(colours)

    def _texture(self, entry: dict[str, Any], attributes: dict[str, Any], faces: Indices) -> Array:
        """(m, 3) linear RGB of triangles in a texture."""
        transform = entry.get("extensions", {}).get("KHR_texture_transform", {})
        texture_set = transform.get("texCoord", entry.get("texCoord", 0))
        name = f"TEXCOORD_{check_natural(texture_set, 'a texCoord')}"
        if name not in attributes:
            return np.ones((len(faces), 3))
        uv = self.accessors.numbers(attributes[name], 2) * transform.get("scale", [1.0, 1.0])
        angle = transform.get("rotation", 0.0)
        c, s = np.cos(angle), np.sin(angle)
        uv = uv @ np.array([[c, -s], [s, c]]) + transform.get("offset", [0.0, 0.0])
        texture = self.header["textures"][check_natural(entry["index"], "a texture")]
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        source = check_natural(webp.get("source", texture.get("source")), "the source of a texture")
        sampler: dict[str, Any] = {}
        if "sampler" in texture:
            sampler = self.header["samplers"][check_natural(texture["sampler"], "a sampler")]
        repeats = sampler.get("wrapS") != _CLAMP_TO_EDGE, sampler.get("wrapT") != _CLAMP_TO_EDGE
        return Texture(self._image(source), repeats).average_over(uv[faces])

    def _image(self, index: int) -> np.ndarray:
        if index not in self._images:
            entry = self.header["images"][index]
            if "uri" in entry:
                content = self._uri_content(entry["uri"])
            else:
                content = self.accessors.view(entry["bufferView"])[0]
            name = entry.get("name") or str(entry.get("uri", index))[:40]
            self._images = {index: image(content, repr(name))}
        return self._images[index]

    def _buffer(self, index: int, entry: dict[str, Any]) -> bytes:
        if "uri" in entry:
            content = self._uri_content(entry["uri"])
        elif index == 0 and self.chunk is not None:
            content = self.chunk
        else:
            raise ValueError(f"its buffer {index} has no content")
        length = check_natural(entry["byteLength"], "the length of a buffer")
        if length > len(content):
            text = f"its buffer {index} has {len(content)} bytes instead of {length}"
            raise ValueError(text)
        return content[:length]

    def _uri_content(self, uri: str) -> bytes:
        """The content of a data URI, or of a file in this one's folder."""
        if not uri.startswith("data:"):
            return self.linked_files.read(uri)
        kind, comma, text = uri.partition(",")
        if not comma or not kind.endswith(";base64"):
            raise ValueError("it has a data URI that is not base64")
        try:
            return base64.b64decode(text, validate=True)
        except binascii.Error:
            raise ValueError("it has a data URI that is not base64") from None


def _faces(corners: Indices, mode: int) -> Indices:
    """(m, 3) triangles of a list, strip or fan; a strip has every second triangle reversed."""
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
