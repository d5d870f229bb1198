"""Arrays of numbers in a glTF document.

glTF is a format of scenes. An accessor describes an array in a block of bytes: its place, type and
length.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.model.meshes.limits import LIMITS

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def check_natural(value: object, name: str) -> int:
    """The value, if it is a whole number of at least 0.

    Raises:
        ValueError: it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"{name} is {str(value)[:40]}; needed: a whole number of at least 0")
    return value


class Accessors:
    """Reads arrays of numbers.

    Args:
        header: JSON of the document.
        buffers: contents of its buffers.
    """

    def __init__(self, header: dict[str, Any], buffers: list[bytes]):
        self.header, self.buffers = header, buffers
        self._floats: dict[int, Array] = {}
        self._elements_left = (
            6 * LIMITS.max_triangles
        )  # elements of arrays that may still be cached

    def count(self, index: int) -> int:
        """Number of elements of an array, without reading it."""
        return _element_count(self.header["accessors"][check_natural(index, "an accessor")])

    def numbers(self, index: int, *widths: int) -> Array:
        """(n, width) floats, in one of ``widths``. Normalised integers are 0 to 1 or -1 to 1."""
        accessor = self.header["accessors"][check_natural(index, "an accessor")]
        if index not in self._floats:
            self._elements_left -= _element_count(accessor)
            if self._elements_left < 0:
                raise ValueError("its accessors have too many elements in total")
            values = self._values(accessor)
            out = values.astype(float)
            if accessor.get("normalized") and values.dtype.kind in "iu":
                out = np.maximum(out / np.iinfo(values.dtype).max, -1.0)
            out.setflags(write=False)
            self._floats[index] = out
        floats = self._floats[index]
        if floats.shape[1] not in widths:
            allowed = " or ".join(name for name, width in _WIDTHS.items() if width in widths)
            text = f"its accessor {index} is {str(accessor['type'])[:9]}; allowed here: {allowed}"
            raise ValueError(text)
        return floats

    def whole_numbers(self, index: int) -> Indices:
        """(n,) whole numbers."""
        values = self._values(self.header["accessors"][check_natural(index, "an accessor")])
        if values.dtype.kind != "u" or values.shape[1] != 1:
            raise ValueError(f"its accessor {index} has no indices")
        return values[:, 0].astype(np.int64)

    def view(self, index: int) -> tuple[bytes, int | None]:
        """The bytes of a view, and its stride, if it has one."""
        view_entry = self.header["bufferViews"][check_natural(index, "a view of a buffer")]
        buffer = self.buffers[check_natural(view_entry["buffer"], "a buffer")]
        start = check_natural(view_entry.get("byteOffset", 0), "an offset")
        end = start + check_natural(view_entry["byteLength"], "a length")
        if end > len(buffer):
            raise ValueError(f"its bufferView {index} reaches beyond its buffer")
        return buffer[start:end], view_entry.get("byteStride")

    def _values(self, accessor: dict[str, Any]) -> np.ndarray:
        """(n, width) numbers of the file's type."""
        kind, width = np.dtype(_DTYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        count = _element_count(accessor)
        if "bufferView" in accessor:
            values = self._strided(accessor, kind, width, count)
        else:
            values = np.zeros((count, width), dtype=kind)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            n = check_natural(sparse["count"], "the count of an accessor")
            indices = self._strided(sparse["indices"], None, 1, min(n, count))[:, 0]
            values = values.copy()
            values[indices.astype(int)] = self._strided(sparse["values"], kind, width, len(indices))
        return values

    def _strided(
        self, source: dict[str, Any], kind: np.dtype[Any] | None, width: int, count: int
    ) -> np.ndarray:
        kind = np.dtype(_DTYPES[source["componentType"]]) if kind is None else kind
        data, stride = self.view(source["bufferView"])
        start, row_bytes = (
            check_natural(source.get("byteOffset", 0), "an offset"),
            width * kind.itemsize,
        )
        stride = row_bytes if stride is None else check_natural(stride, "a byteStride")
        if count and (stride < row_bytes or start + (count - 1) * stride + row_bytes > len(data)):
            raise ValueError(f"an accessor reaches beyond its bufferView {source['bufferView']}")
        if not count:
            return np.zeros((0, width), dtype=kind)
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))


def _element_count(accessor: dict[str, Any]) -> int:
    """Number of elements of an accessor."""
    count = check_natural(accessor["count"], "the count of an accessor")
    if count > 3 * LIMITS.max_triangles:
        raise ValueError(f"it has an accessor of {count} elements")
    return count
