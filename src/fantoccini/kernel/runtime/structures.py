"""The structures shared with the compiled library, for ctypes and NumPy.

A structure has the memory layout of C; the contract declares its fields.
"""

from __future__ import annotations

import ctypes
import re
from functools import cache
from typing import Any, ClassVar

import numpy as np

from fantoccini.kernel.contract import STRUCTURES
from fantoccini.kernel.runtime.functions import checked_integer

UNLIMITED = 1e300
"""A bound that never binds, for compiled code."""

_FITS_ALL = 2**31 - 1
"""The largest number that fits every integer of a structure."""
_INTEGERS = (ctypes.c_int, ctypes.c_longlong)
_set = ctypes.Structure.__setattr__
_NUMBERS = {"int": ctypes.c_int, "long long": ctypes.c_longlong, "double": ctypes.c_double}


class Numbers(ctypes.Structure):
    """A C structure that refuses integers too large for their fields."""

    _integers: ClassVar[dict[str, Any]] = {}

    def __init_subclass__(cls, **kwargs: Any):
        super().__init_subclass__(**kwargs)
        fields = cls.__dict__.get("_fields_", ())
        cls._integers = {name: kind for name, kind, *_ in fields if kind in _INTEGERS}

    def __setattr__(self, name: str, value: Any) -> None:
        kind = self._integers.get(name)
        if kind is not None and (value.__class__ is not int or not 0 <= value <= _FITS_ALL):
            value = checked_integer(name, value, kind)
        _set(self, name, value)


def _made() -> dict[str, type[ctypes.Structure]]:
    """The ctypes classes of all structures, by name."""
    classes: dict[str, type[ctypes.Structure]] = {}
    for structure in STRUCTURES:
        fields = [(field.name, _type(field.type, classes)) for field in structure.fields]
        classes[structure.name] = type(structure.name, (Numbers,), {"_fields_": fields})
    return classes


def _type(text: str, classes: dict[str, type[ctypes.Structure]]) -> Any:
    if match := re.fullmatch(r"(.+)\[(\d+)\]", text):
        return _type(match[1], classes) * int(match[2])
    if match := re.fullmatch(r"(.+?)\((.*)\)", text):
        arguments = (_type(argument, classes) for argument in match[2].split(","))
        return ctypes.CFUNCTYPE(_type(match[1], classes), *arguments)
    if text.endswith("*"):
        return ctypes.c_void_p
    return _NUMBERS.get(text) or classes[text]


structures: dict[str, type[ctypes.Structure]] = _made()
"""ctypes classes by name."""


def type_of(text: str) -> Any:
    """The ctypes class of a field's C++ type."""
    return _type(text, structures)


@cache
def dtype_of(name: str) -> np.dtype[np.void]:
    """The NumPy dtype of a structure of numbers and arrays of them."""
    (structure,) = (s for s in STRUCTURES if s.name == name)
    return np.dtype([(f.name, type_of(f.type)) for f in structure.fields], align=True)
