"""The structures shared with the compiled library, for ctypes and NumPy."""

from __future__ import annotations

import ctypes
import re
from typing import Any, ClassVar

import numpy as np

from fantoccini.base import N_COEF, Array, ConfigK, Times, VecD, VecK
from fantoccini.kernel.contract import STRUCTURES, Structure
from fantoccini.kernel.runtime.functions import pointer, whole
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import Input, pieces

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
            value = whole(name, value, kind)
        _set(self, name, value)


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


class HeldInput:
    """An input of one piece with constant accelerations and forces.

    It can be filled again and again, as live control does, and its arrays stay where they are:
    asking an array for its address takes longer than filling it.

    Attributes:
        structure: for compiled code; it and its arrays live as long as this object.

    Args:
        table: of the coordinates.
    """

    def __init__(self, table: CoordinateTable):
        self._table, self._places = table, table.places_K
        self._breaks, self._base = np.zeros(2), np.zeros((1, table.n_qK))
        self._coef = np.zeros((1, table.n_vK, N_COEF))
        self._force = np.zeros((1, table.n_vD, N_COEF))
        self._u_D = pointer(self._force)
        self.structure = structures["InputArrays"](
            n_segments=1,
            breaks=pointer(self._breaks),
            coef=pointer(self._coef),
            base=pointer(self._base),
        )

    def fill(
        self, t: float, t_end: float, q_K: ConfigK, v_K: VecK, acc_K: VecK, u_D: VecD | None = None
    ) -> None:
        """The piece from t to t_end [s] that begins at a configuration with a velocity.

        Args:
            t, t_end: [s].
            q_K, v_K: (n_qK,), (n_vK,) at t.
            acc_K: (n_vK,) of scalars, and of the rotation vectors.
            u_D: (n_vD,) user forces; none by default.
        """
        coef, (q_places, v_places) = self._coef[0], self._places
        self._breaks[0], self._breaks[1] = t, t_end
        self._base[0] = q_K
        coef[v_places, 0] = q_K[q_places]
        coef[:, 1] = v_K
        np.multiply(acc_K, 0.5, out=coef[:, 2])
        if u_D is not None:
            self._force[0, :, 0] = u_D
        self.structure.force = None if u_D is None else self._u_D

    def evaluate(self, t: Times) -> ConfigK:
        """(n, n_qK) at times (n,) of the piece [s]."""
        i = np.zeros(len(t), dtype=int)
        return pieces.evaluate(self._table, self._coef[i], self._base[i], t - self._breaks[0])[0]


def input_arrays(inputs: Input | HeldInput) -> tuple[ctypes.Structure, list[Array]]:
    """The structure, and the arrays that must live as long as it is read."""
    if isinstance(inputs, HeldInput):
        return inputs.structure, []
    given = {name: getattr(inputs, name) for name in ("breaks", "coef", "base", "force")}
    held = {n: np.ascontiguousarray(a, dtype=float) for n, a in given.items() if a is not None}
    addresses = {name: pointer(a) for name, a in held.items()}
    return structures["InputArrays"](n_segments=len(inputs.coef), **addresses), [*held.values()]
