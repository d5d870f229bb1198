"""Loaded libraries of a puppet, and their functions over whole arrays.

The contract declares the functions that Python and C++ share, with the shapes of their arguments
and results. An array may have further leading axes, over which a function is evaluated.
"""

from __future__ import annotations

import ctypes
import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, BuildError, StateError
from fantoccini.kernel.contract import FUNCTIONS, SIZES, Quantity, digest

AnyArray = NDArray[Any]


class Loaded:
    """A loaded library of a puppet.

    Attributes:
        path: the shared library's file.
        dll: the shared library.
        sizes: the puppet's sizes, by the names of :mod:`fantoccini.kernel.contract`.
        width: number of trajectories or configurations evaluated together.

    Args:
        path: see above.
        sizes: sizes of the puppet's tree (``Tree.sizes``).

    Raises:
        BuildError: it cannot be loaded, or was compiled for another puppet or contract.
    """

    def __init__(self, path: Path, sizes: Mapping[str, int]):
        self.path = path
        try:
            self.dll = ctypes.CDLL(str(path))
            identity = self.dll.fan_identity
        except (OSError, AttributeError) as error:
            raise BuildError(f"the compiled puppet {path} cannot be loaded: {error}") from error
        identity_numbers = (ctypes.c_longlong * (2 + len(SIZES)))()
        identity(identity_numbers)
        self.width = identity_numbers[1]
        self.sizes = dict(zip(SIZES, identity_numbers[2:], strict=True))
        wrong = [f"{n} = {self.sizes[n]}, not {m}" for n, m in sizes.items() if self.sizes[n] != m]
        if identity_numbers[0] != digest():
            wrong = ["it was made by another version of fantoccini"]
        if wrong:
            raise BuildError(
                f"the compiled puppet {path} is not this one's: {', '.join(wrong)}; delete the "
                "file, so that it is compiled again"
            )


class Functions(Loaded):
    """A library whose generated functions can be called over whole arrays."""

    def __init__(self, path: Path, sizes: Mapping[str, int]):
        super().__init__(path, sizes)
        self._signatures: dict[str, _Signature] = {}

    def evaluate(self, name: str, /, **arguments: Array | float) -> SimpleNamespace:
        """The results of a generated function by name, (..., *shape).

        Args:
            name: name of the function.
            arguments: arrays (..., *shape) by name, contract's shapes; leading axes broadcast.

        Raises:
            StateError: an argument is missing, is not the function's, or has another shape.
        """
        signature = self._signatures.get(name)
        if signature is None:
            signature = self._signatures[name] = _Signature(self, name)
        flat_arguments = signature.in_order(arguments)
        lead = flat_arguments[0].shape[:-1]
        if any(a.shape[:-1] != lead for a in flat_arguments):
            lead = signature.leading_axes(flat_arguments)
            flat_arguments = [
                a
                if a.ndim == 1 or a.shape[:-1] == lead
                else np.ascontiguousarray(np.broadcast_to(a, (*lead, a.shape[-1])))
                for a in flat_arguments
            ]
        # All results share one block: asking every array for its address takes longer than a call.
        n = math.prod(lead)
        block = np.zeros(n * signature.offsets[-1])
        first = _address(block)
        status = signature.call(
            n,
            signature.pointers_in(*[_address(a) for a in flat_arguments]),
            signature.strides_in(*[a.shape[-1] if a.ndim > 1 else 0 for a in flat_arguments]),
            signature.pointers_out(
                *[first + block.itemsize * n * offset for offset in signature.offsets[:-1]]
            ),
            signature.strides_out,
        )
        if status != 0:
            raise BuildError(f"the generated function {name} returned {status}")
        return signature.by_name(block, n, lead)

    def at(self, name: str, values: Mapping[str, Array | float]) -> dict[str, Array]:
        """The results (..., *shape) of a function, by their names.

        Args:
            name: name of the function.
            values: its arguments by name; others are ignored.
        """
        arguments = {a.name: values[a.name] for a in FUNCTIONS[name].arguments}
        return vars(self.evaluate(name, **arguments))


class _Signature:
    """A function of a library with the shapes of its arguments and results."""

    def __init__(self, library: Loaded, name: str):
        function, sizes = FUNCTIONS[name], library.sizes
        self.name = name
        self.arguments = [_Shaped.of(q, sizes) for q in function.arguments]
        self.results = [_Shaped.of(q, sizes) for q in function.results]
        self.call = getattr(library.dll, f"fan_map_{name}")
        self.call.argtypes = [ctypes.c_longlong, *[ctypes.c_void_p] * 4]
        n_in, n_out = len(self.arguments), len(self.results)
        self.pointers_in, self.strides_in = ctypes.c_void_p * n_in, ctypes.c_longlong * n_in
        self.pointers_out = ctypes.c_void_p * n_out
        widths = [q.width for q in self.results]
        self.strides_out = (ctypes.c_longlong * n_out)(*widths)
        self.offsets = list(accumulate(widths, initial=0))

    def in_order(self, arguments: dict[str, Array | float]) -> list[Array]:
        """The arguments in the order of the function, contiguous and flat (..., width)."""
        try:
            flat_arguments = [q.flat(arguments[q.name]) for q in self.arguments]
        except (KeyError, _ShapeError):
            flat_arguments = []
        if len(arguments) != len(flat_arguments):
            signature_text = ", ".join(f"{q.name} {q.shape}" for q in self.arguments)
            passed = ", ".join(f"{key} {np.shape(a)}" for key, a in arguments.items())
            raise StateError(
                f"{self.name} needs {signature_text}, optionally with leading axes; found {passed}"
            )
        return flat_arguments

    def leading_axes(self, flat_arguments: list[Array]) -> tuple[int, ...]:
        """Common leading axes of flat arguments."""
        leads = [array.shape[:-1] for array in flat_arguments]
        try:
            return np.broadcast_shapes(*leads)
        except ValueError:
            pairs = zip(self.arguments, leads, strict=True)
            text = ", ".join(f"{q.name} {lead}" for q, lead in pairs if lead)
            raise StateError(
                f"{self.name}: leading axes cannot be broadcast together; found {text}"
            ) from None

    def by_name(self, block: Array, n: int, lead: tuple[int, ...]) -> SimpleNamespace:
        """The results by name."""
        results = SimpleNamespace()
        for q, start, end in zip(self.results, self.offsets, self.offsets[1:], strict=False):
            values = block[n * start : n * end].reshape((*lead, *q.stored))
            setattr(results, q.name, values.swapaxes(-1, -2) if len(q.stored) == 2 else values)
        return results


class _ShapeError(ValueError):
    """An argument does not have the contract's shape."""


@dataclass(frozen=True)
class _Shaped:
    """An argument or a result: its shape, and the shape in which it is stored."""

    name: str
    shape: tuple[int, ...]
    stored: tuple[int, ...]
    width: int

    @classmethod
    def of(cls, quantity: Quantity, sizes: Mapping[str, int]) -> _Shaped:
        shape = quantity.dimensions(sizes)
        return cls(quantity.name, shape, shape[::-1], math.prod(shape))

    def flat(self, value: Array | float) -> Array:
        """A value (..., *shape) as (..., width) numbers; matrices are stored column by column."""
        a, n = np.asarray(value, dtype=float, order="C"), len(self.shape)
        if a.shape[a.ndim - n :] != self.shape:
            raise _ShapeError
        if n == 1:
            return a
        if n == 2:
            a = a.swapaxes(-1, -2)
        return np.ascontiguousarray(a.reshape((*a.shape[: a.ndim - n], self.width)))


def pointer(array: AnyArray) -> ctypes.c_void_p:
    """The address of an array's numbers, at a tenth of the cost of ``ctypes.data_as``."""
    return ctypes.c_void_p(_address(array))


def checked_integer(
    name: str,
    value: Any,
    kind: type[ctypes.c_int] | type[ctypes.c_longlong] = ctypes.c_int,
    minimum: int | None = None,
) -> int:
    """A whole number that fits its C integer; ctypes would silently wrap it.

    Args:
        name: name of the number, for messages.
        value: the number.
        kind: the C integer, signed.
        minimum: smallest allowed value; that of the integer by default.

    Raises:
        ValueError: it is not a whole number, or it does not fit.
    """
    maximum = 2 ** (8 * ctypes.sizeof(kind) - 1) - 1
    minimum = -maximum - 1 if minimum is None else minimum
    try:
        number: int | None = operator.index(value)
    except TypeError:
        number = None
    if number is None or not minimum <= number <= maximum:
        raise ValueError(
            f"{name} is {value!r}; it must be a whole number from {minimum} to {maximum}"
        )
    return number


def _address(array: AnyArray) -> int:
    address: int = array.__array_interface__["data"][0]
    return address
