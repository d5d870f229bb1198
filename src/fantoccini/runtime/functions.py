"""Generated functions in a shared library, evaluated over whole arrays."""

from __future__ import annotations

import ctypes
import math
import operator
from itertools import accumulate
from pathlib import Path

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import BuildError

Signatures = dict[str, tuple[tuple[int, ...], tuple[int, ...]]]
"""Name of a function -> widths of its arguments and of its results."""


class Functions:
    """The generated functions of a shared library.

    Attributes:
        handle: the loaded library.
        signatures: widths of the functions' arguments and results.

    Args:
        path: the shared library.
        signatures: see above; a library that has to be asked for its sizes sets them later.

    Raises:
        BuildError: it cannot be loaded.
    """

    def __init__(self, path: Path, signatures: Signatures | None = None):
        self.handle = opened(path, "puppet")
        self.signatures = signatures or {}

    def evaluate(self, name: str, arguments: list[Array]) -> list[Array]:
        """A generated function over arrays.

        Args:
            name: of the function.
            arguments: (..., n_i) each; leading axes broadcast against one another.

        Returns:
            Outputs (..., width) with the broadcast leading axes.

        Raises:
            ValueError: an argument has another width than the function takes.
        """
        takes, widths = self.signatures[name]
        arguments = [np.ascontiguousarray(a, dtype=float) for a in arguments]
        found = tuple(a.shape[-1] for a in arguments)
        if found != takes:
            raise ValueError(f"{name} takes arguments of widths {takes}; found {found}")
        lead = () if all(a.ndim == 1 for a in arguments) else np.broadcast_shapes(
            *(a.shape[:-1] for a in arguments)
        )
        rows, strides = [], []
        for a in arguments:
            if a.ndim > 1 and a.shape[:-1] != lead:
                a = np.ascontiguousarray(np.broadcast_to(a, (*lead, a.shape[-1])))
            rows.append(a)
            strides.append(a.shape[-1] if a.ndim > 1 else 0)
        # All results lie in one block: to ask every array where it lies takes longer than a row.
        n = math.prod(lead)
        ends = [n * end for end in accumulate(widths, initial=0)]
        block = np.zeros(ends[-1])
        first = _address(block)
        status = getattr(self.handle, f"fan_map_{name}")(
            ctypes.c_longlong(n),
            (ctypes.c_void_p * len(rows))(*[_address(a) for a in rows]),
            (ctypes.c_longlong * len(rows))(*strides),
            (ctypes.c_void_p * len(widths))(*[first + block.itemsize * at for at in ends[:-1]]),
            (ctypes.c_longlong * len(widths))(*widths),
        )
        if status != 0:
            raise BuildError(f"the generated function {name} returned {status}")
        return [
            block[at:end].reshape(*lead, width)
            for at, end, width in zip(ends, ends[1:], widths, strict=False)
        ]


def opened(path: Path, what: str) -> ctypes.CDLL:
    """A shared library.

    Args:
        path: of the file.
        what: it holds, in words.

    Raises:
        BuildError: it cannot be loaded.
    """
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise BuildError(f"the compiled {what} {path} cannot be loaded: {error}") from error


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Where an array's numbers lie. ``ctypes.data_as`` does the same at ten times the cost."""
    return ctypes.c_void_p(_address(array))


def whole(name: str, value: int, kind: type = ctypes.c_int, least: int | None = None) -> int:
    """A whole number that fits the C integer it becomes; ctypes would wrap it round in silence.

    Args:
        name: of the number, for messages.
        value: the number.
        kind: the C integer, signed.
        least: the smallest value allowed; the integer's own when not given.

    Raises:
        ValueError: it is not a whole number, or it does not fit.
    """
    most = 2 ** (8 * ctypes.sizeof(kind) - 1) - 1
    least = -most - 1 if least is None else least
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        raise ValueError(f"{name} is {value!r}; it must be a whole number from {least} to {most}")
    return number


class Numbers:
    """Of a C structure, first among its bases: its integers are checked against their widths."""

    def __setattr__(self, name: str, value: object) -> None:
        kind = next((kind for field, kind in self._fields_ if field == name), None)
        if kind in (ctypes.c_int, ctypes.c_longlong):
            value = whole(name, value, kind)
        super().__setattr__(name, value)


def _address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]
