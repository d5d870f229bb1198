"""Creation of the arrays of the contract's structures, and packing for compiled code.

A structure has the memory layout of C; the contract declares its fields.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fantoccini.kernel.contract import STRUCTURES, Field
from fantoccini.kernel.runtime.functions import AnyArray, pointer
from fantoccini.kernel.runtime.structures import dtype_of, structures, type_of

_DTYPES: dict[str, Any] = {
    "unsigned char": np.dtype(np.bool_),
    "int": np.dtype(np.int32),
    "long long": np.dtype(np.int64),
    "double": np.dtype(np.float64),
}
"""NumPy types of numbers in arrays, by their C++ types."""


def new_arrays(
    structure: str, names: Iterable[str], sizes: Mapping[str, int], **extra_sizes: int
) -> dict[str, AnyArray]:
    """Arrays of zeros that a structure points to, by name, with the contract's shapes and types.

    Args:
        structure: its name.
        names: names of its fields.
        sizes: the puppet's sizes.
        extra_sizes: other sizes in the shapes, such as ``n``.
    """
    lengths = {**sizes, **extra_sizes}
    fields = {name: _fields(structure)[name] for name in names}
    return {
        name: np.zeros([_size(axis, lengths) for axis in field.shape], dtype=field.dtype)
        for name, field in fields.items()
    }


def packed(structure: str, /, **values: Any) -> Any:
    """A structure with numbers and arrays; its arrays live as long as it does.

    Args:
        structure: its name.
        values: values by field. Arrays that compiled code only reads are made contiguous and of
            the contract's type; others must be so. Arrays of a ``Shared`` are (n, ...), or
            (1, ...) if shared by all. None and missing fields are null pointers.

    Raises:
        ValueError: an array that compiled code writes has another type or is not contiguous.
            contiguous.
    """
    out: Any = structures[structure]()
    out.kept = []
    _fill(out, values)
    return out


def repacked(out: Any, /, **values: Any) -> Any:
    """A copy of a structure with other numbers and arrays; as :func:`packed`, in less time."""
    copy: Any = type(out).from_buffer_copy(out)
    copy.kept = [out]
    _fill(copy, values)
    return copy


def _fill(out: Any, values: Mapping[str, Any]) -> None:
    fields, owned = _fields(type(out).__name__), out.kept
    for name, value in values.items():
        if value is None:
            continue
        field = fields[name]
        if isinstance(value, np.ndarray):
            if field.is_shared:
                value = np.ascontiguousarray(value, dtype=float)
                owned.append(value)
                stride = 0 if len(value) == 1 else math.prod(value.shape[1:])
                value = structures["Shared"](pointer(value), stride)
            else:
                value = field.numbers(value)
                owned.append(value)
                value = pointer(value) if field.is_pointer else field.type(*value)
        elif isinstance(value, _STRUCTURED):
            owned.append(value)
            value = ctypes.addressof(value) if field.is_pointer else value
        setattr(out, name, value)


_STRUCTURED = (ctypes.Structure, ctypes.Array)


@dataclass(frozen=True)
class _Packed:
    """Packing of a field; ``number`` is the C++ type that a pointer points to."""

    name: str
    shape: tuple[str, ...]
    type: Any
    number: str
    is_pointer: bool
    is_read: bool
    is_shared: bool

    @classmethod
    def of(cls, field: Field) -> _Packed:
        return cls(
            field.name,
            field.shape,
            type_of(field.type),
            field.type.removeprefix("const ").rstrip("*"),
            field.type.endswith("*"),
            field.type.startswith("const "),
            field.type == "Shared",
        )

    @property
    def dtype(self) -> Any:
        """NumPy type of an array's numbers."""
        return _DTYPES.get(self.number) or dtype_of(self.number)

    def numbers(self, value: AnyArray) -> AnyArray:
        """The array, or a copy that compiled code can read."""
        if not self.is_pointer:
            return value
        if self.is_read:
            return np.ascontiguousarray(value, dtype=self.dtype)
        if value.dtype != self.dtype or not value.flags.c_contiguous:
            raise ValueError(
                f"compiled code writes to {self.name}: it must be contiguous, of {self.dtype}"
            )
        return value


@cache
def _fields(structure: str) -> dict[str, _Packed]:
    (declaration,) = (s for s in STRUCTURES if s.name == structure)
    return {field.name: _Packed.of(field) for field in declaration.fields}


def _size(axis: str, lengths: Mapping[str, int]) -> int:
    """The length of an axis, such as ``2 n_vD + 3 k``."""
    total = 0
    for term in axis.split("+"):
        product = 1
        for factor in term.split():
            product *= int(factor) if factor.isdigit() else lengths[factor]
        total += product
    return total
