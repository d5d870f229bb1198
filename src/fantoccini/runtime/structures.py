"""The structures shared with the compiled library, for ctypes and NumPy."""

from __future__ import annotations

import ctypes
import re
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import STRUCTURES, Structure
from fantoccini.motion import Input
from fantoccini.runtime.functions import pointer, whole

UNLIMITED = 1e300
"""A bound that never binds, for compiled code."""

_INTEGERS = (ctypes.c_int, ctypes.c_longlong)
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
        if kind is not None:
            value = whole(name, value, kind)
        super().__setattr__(name, value)


def _made() -> dict[str, type[ctypes.Structure]]:
    """The ctypes classes of all structures, by name."""
    made: dict[str, type[ctypes.Structure]] = {}
    for structure in STRUCTURES:
        fields = [(field.name, _type(field.type, made)) for field in structure.fields]
        made[structure.name] = type(structure.name, (Numbers,), {"_fields_": fields})
    return made


def _type(text: str, made: dict[str, type[ctypes.Structure]]) -> Any:
    """The ctypes class of a field's C++ type."""
    if match := re.fullmatch(r"(.+)\[(\d+)\]", text):
        return _type(match[1], made) * int(match[2])
    if match := re.fullmatch(r"(.+?)\((.*)\)", text):
        arguments = (_type(argument, made) for argument in match[2].split(","))
        return ctypes.CFUNCTYPE(_type(match[1], made), *arguments)
    if text.endswith("*"):
        return ctypes.c_void_p
    return _NUMBERS.get(text) or made[text]


structures: dict[str, type[ctypes.Structure]] = _made()
"""ctypes classes by name."""


def dtype_of(structure: Structure) -> np.dtype[np.void]:
    """The NumPy dtype of a structure of numbers and arrays of them."""
    found = ((f.name, _type(f.type, structures)) for f in structure.fields)
    return np.dtype(list(found), align=True)


class InputPieces(NamedTuple):
    """The numbers of an :class:`Input`, which are known to be right.

    Attributes:
        breaks, coef, base, force: as those of the input.
    """

    breaks: Array
    coef: Array
    base: Array
    force: Array | None = None


def input_arrays(inputs: Input | InputPieces) -> tuple[ctypes.Structure, list[Array]]:
    """The structure, and the arrays that must live as long as it is read."""
    given = {name: getattr(inputs, name) for name in ("breaks", "coef", "base", "force")}
    held = {n: np.ascontiguousarray(a, dtype=float) for n, a in given.items() if a is not None}
    addresses = {name: pointer(a) for name, a in held.items()}
    return structures["InputArrays"](n_segments=len(inputs.coef), **addresses), [*held.values()]
