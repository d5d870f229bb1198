"""A glTF 2.0 document in one file: numbers in a buffer, everything else as JSON.

A buffer is a block of bytes, and an accessor describes an array of numbers in it. A sampler is an
array of times with an array of values, and a channel connects it with a node.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array

Node = dict[str, Any]

_COMPONENT_TYPES = {"float32": 5126, "uint16": 5123, "uint32": 5125, "uint8": 5121}
_ELEMENT_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_BUFFER_VIEWS: dict[str, dict[str, int]] = {
    "keys": {},
    "indices": {"target": 34963},
    "vectors": {"target": 34962, "byteStride": 12},
    "weights": {"target": 34962, "byteStride": 16},
    "joints": {"target": 34962, "byteStride": 4},
    "many joints": {"target": 34962, "byteStride": 8},
}
"""Parts of the buffer. Vertex attributes have one part for each stride."""


@dataclass
class Document:
    """Contents of a file.

    Attributes:
        content: the JSON object, without buffers.
    """

    content: dict[str, Any]
    _buffers: dict[str, bytearray] = field(
        default_factory=lambda: {v: bytearray() for v in _BUFFER_VIEWS}
    )
    _indices: dict[tuple[Any, ...], int] = field(default_factory=dict)
    _accessors: list[dict[str, Any]] = field(default_factory=list)

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Appends to one of the document's lists, such as ``nodes``; returns the index."""
        items: list[dict[str, Any]] = self.content.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def add_once(self, kind: str, item: dict[str, Any]) -> int:
        """The index of an item, which is added only if no equal item is there."""
        key = (kind, json.dumps(item, sort_keys=True))
        if key not in self._indices:
            self._indices[key] = self.add(kind, item)
        return self._indices[key]

    def add_accessor(self, view_name: str, values: NDArray[Any], bounds: bool = False) -> int:
        """Index of an accessor of values (n,) or (n, k); equal values share one.

        Args:
            view_name: part of the buffer; see ``_BUFFER_VIEWS``.
            values: the values, in the type to store.
            bounds: also store the smallest and the largest value of every component.
        """
        data = np.ascontiguousarray(values)
        key = (view_name, str(data.dtype), data.shape, data.tobytes(), bounds)
        if key not in self._indices:
            self._indices[key] = len(self._accessors)
            flat = data.reshape(len(data), -1)
            accessor: dict[str, Any] = {
                "bufferView": view_name,
                "byteOffset": len(self._buffers[view_name]),
                "componentType": _COMPONENT_TYPES[str(data.dtype)],
                "count": len(data),
                "type": _ELEMENT_TYPES[flat.shape[1]],
            }
            if bounds:
                accessor |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
            self._accessors.append(accessor)
            self._buffers[view_name] += _pad(data.tobytes(), b"\0")
        return self._indices[key]

    def save(self, path: Path) -> None:
        """Writes the document as a .glb file."""
        views: dict[str, int] = {}
        data, view_list = bytearray(), list[dict[str, int]]()
        for view_name, properties in _BUFFER_VIEWS.items():
            if self._buffers[view_name]:
                views[view_name] = len(view_list)
                view = {
                    "buffer": 0,
                    "byteOffset": len(data),
                    "byteLength": len(self._buffers[view_name]),
                }
                view_list.append(view | properties)
                data += self._buffers[view_name]
        accessors = [a | {"bufferView": views[a["bufferView"]]} for a in self._accessors]
        content = dict(self.content)
        if data:
            content |= {
                "accessors": accessors,
                "bufferViews": view_list,
                "buffers": [{"byteLength": len(data)}],
            }
        text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        chunks = [(b"JSON", _pad(text.encode(), b" "))]
        chunks += [(b"BIN\0", bytes(data))] if data else []
        body = b"".join(struct.pack("<I", len(c)) + kind + c for kind, c in chunks)
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


@dataclass
class Channels:
    """Samplers and channels of an animation."""

    document: Document
    samplers: list[dict[str, Any]] = field(default_factory=list)
    channels: list[dict[str, Any]] = field(default_factory=list)

    def add(self, node: int, path: str, t: Array, values: Array, interpolation: str) -> None:
        """Animates a property of a node.

        Args:
            node: index of the node.
            path: ``translation``, ``rotation`` or ``weights``.
            t: (K,) times of the keys [s].
            values: (n, k); for CUBICSPLINE three rows a key, for weights k = 1.
            interpolation: ``LINEAR`` or ``CUBICSPLINE``.
        """
        self.channels.append(
            {"sampler": len(self.samplers), "target": {"node": node, "path": path}}
        )
        self.samplers.append(
            {
                "input": self.document.add_accessor("keys", t.astype(np.float32), bounds=True),
                "output": self.document.add_accessor("keys", values.astype(np.float32)),
                "interpolation": interpolation,
            }
        )

    def finish(self, name: str) -> None:
        """Adds the animation to the document, if anything moves."""
        if self.channels:
            animation = {"name": name, "samplers": self.samplers, "channels": self.channels}
            self.document.add("animations", animation)


def xyzw(q: Array) -> Array:
    """Quaternions w, x, y, z in the order of glTF: x, y, z, w."""
    return np.roll(q, -1, axis=-1)


def with_transform(
    node: Node, r: Array, q: Array | None = None, scale: Array | None = None
) -> Node:
    """The node with position (3,), orientation (4,) and scale (3,); identities are left out."""
    if np.any(r):
        node["translation"] = _rounded_list(r)
    if q is not None and abs(q[0]) < 1.0:
        node["rotation"] = _rounded_list(xyzw(q))
    if scale is not None and np.any(scale != 1.0):
        node["scale"] = _rounded_list(scale)
    return node


def _rounded_list(values: Array) -> list[float]:
    return [float(f"{x:.9g}") for x in values]


def _pad(data: bytes, filler: bytes) -> bytes:
    return data + filler * (-len(data) % 4)
