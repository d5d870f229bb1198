"""npz files with JSON text in ``about``: written whole, and read safely if damaged or hostile.

Nothing is unpickled. An array's size is checked in the file's table and the array's header before
the array is expanded. Every mistake raises one located error.

An npz file is a zip archive of NumPy arrays. Pickles, which may run code when they are read, are
refused.
"""

from __future__ import annotations

import json
import lzma
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base.arrays import Array
from fantoccini.base.errors import FantocciniError, FileError, Mistake
from fantoccini.base.files import replacing

MAX_BYTES = 256_000_000
"""Largest total size of a file's arrays [bytes], unless the file itself is large."""
MAX_GROWTH = 20
"""Largest total size of a file's arrays, relative to the file; recorded data compress tenfold."""
ABOUT = "about"
"""Entry with JSON text that describes the arrays."""

UNREADABLE = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    FantocciniError,
    lzma.LZMAError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Errors that a damaged or foreign npz file causes, in NumPy or in code that uses its arrays."""

_SUFFIX = ".npy"
_HEADERS: dict[tuple[int, int], Callable[[IO[bytes]], tuple[tuple[int, ...], bool, Any]]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_DTYPE_KINDS = "biufcSU"
"""Kinds of arrays that are plain numbers, flags or texts."""


def write(
    path: str | Path,
    arrays: Mapping[str, NDArray[Any]],
    about: Mapping[str, Any],
    compressed: bool = False,
) -> None:
    """Writes an npz file, whole or not at all.

    Args:
        path: path of the file.
        arrays: array of each name.
        about: description of the arrays, stored as JSON.
        compressed: whether to compress; the file is smaller, and written more slowly.
    """
    about_bytes = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    entries: dict[str, Any] = {**arrays, ABOUT: about_bytes}
    with replacing(path) as temporary, temporary.open("wb") as file:
        (np.savez_compressed if compressed else np.savez)(file, **entries)


def packed(prefix: str, contents: Mapping[str, bytes]) -> dict[str, Array]:
    """Contents of files as arrays; each array is called ``prefix`` + the file's name."""
    return {prefix + name: np.frombuffer(data, dtype=np.uint8) for name, data in contents.items()}


def unpacked(prefix: str, arrays: Mapping[str, Array]) -> dict[str, bytes]:
    """The inverse of :func:`packed`: contents of files, by name."""
    return {
        name.removeprefix(prefix): array.tobytes()
        for name, array in arrays.items()
        if name.startswith(prefix)
    }


def read(
    path: str | Path,
    array_name: str | None = None,
    max_bytes: int | None = None,
    error: type[FileError] = FileError,
) -> dict[str, Array]:
    """The arrays of an npz file, by name.

    Args:
        path: path of the file.
        array_name: name of the single array to read; all by default.
        max_bytes: largest total size of the arrays [bytes]; from :data:`MAX_BYTES` by default.
        error: class of the error.

    Raises:
        FileError: (or ``error``) the file is missing, damaged, not an npz file of plain arrays, or
            its arrays are too large.
    """
    path = Path(path)

    def file_error(entry: str, text: str) -> FileError:
        return error([Mistake(str(path), None, entry, text)])

    try:
        size = path.stat().st_size
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            names = [item.filename for item in entries]
            check_names(names, file_error)
            n_bytes, n_allowed = (
                sum(x.file_size for x in entries),
                max(MAX_BYTES, MAX_GROWTH * size),
            )
            if max_bytes is not None:
                n_allowed = max_bytes
            if n_bytes > n_allowed:
                raise file_error(
                    "",
                    f"its arrays need {n_bytes / 1e6:,.0f} MB; allowed for this file: "
                    f"{n_allowed / 1e6:,.0f} MB",
                )
            arrays = {}
            for item in entries:
                name = item.filename.removesuffix(_SUFFIX)
                if array_name not in (None, name):
                    continue
                try:
                    with archive.open(item) as file:
                        arrays[name] = _array(file, item.file_size)
                except UNREADABLE as reason:
                    raise file_error(name, f"is not a plain array: {_text_of(reason)}") from None
            return arrays
    except FileNotFoundError:
        raise file_error("", "there is no such file") from None
    except FileError:
        raise
    except UNREADABLE as reason:
        raise file_error("", f"is not an npz file of plain arrays: {_text_of(reason)}") from None


@contextmanager
def opened(
    path: str | Path, formats: str | tuple[str, ...], noun: str
) -> Iterator[tuple[dict[str, Array], dict[str, Any]]]:
    """The :func:`contents` of a file; errors of the block become located errors."""
    arrays_and_about = contents(path, formats, noun)
    with unreadable_as(path, noun):
        yield arrays_and_about


def contents(
    path: str | Path, formats: str | tuple[str, ...], noun: str
) -> tuple[dict[str, Array], dict[str, Any]]:
    """The arrays of an npz file, and the values in its ``about``.

    Args:
        path: path of the file.
        formats: allowed ``format`` in ``about``, or several.
        noun: noun for such files in messages.

    Raises:
        FileError: the file cannot be read (see :func:`read`), or its format is not allowed.
    """
    arrays = read(path)
    try:
        about = about_of(arrays)
        forms = (formats,) if isinstance(formats, str) else formats
        if about["format"] not in forms:
            reads = " and ".join(map(repr, forms))
            raise ValueError(f"has the format {about['format']!r}; this version reads {reads}")
    except UNREADABLE as reason:
        raise _cannot_read(path, noun, reason, ABOUT) from None
    del arrays[ABOUT]
    return arrays, about


def about_of(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Values in the entry ``about``; raises one of ``UNREADABLE`` if it is missing or damaged."""
    if ABOUT not in arrays:
        raise ValueError("it is missing")
    about = json.loads(arrays[ABOUT].tobytes())
    if not isinstance(about, dict):
        raise ValueError(f"found {type(about).__name__}; needed: names and values")
    return about


@contextmanager
def unreadable_as(path: str | Path, noun: str) -> Iterator[None]:
    """Turns errors of the block into one located error: the file is not ``noun``."""
    try:
        yield
    except FileError as reason:
        if all(mistake.file == str(path) for mistake in reason.mistakes):
            raise
        raise _cannot_read(path, noun, reason) from reason
    except UNREADABLE as reason:
        raise _cannot_read(path, noun, reason) from reason


def checked(
    arrays: Mapping[str, Array], name: str, shape: tuple[int | None, ...], kind: str = "f"
) -> Array:
    """An array of a file, after a check of its shape and kind.

    Args:
        arrays: arrays of the file.
        name: name of the array.
        shape: required shape; None for any length.
        kind: ``f`` for numbers, ``b`` for flags, ``i`` for whole numbers.

    Raises:
        ValueError: the array is missing, or its shape or kind is different.
    """
    if name not in arrays:
        raise ValueError(f"{name} is missing")
    array = arrays[name]
    fits = len(array.shape) == len(shape) and all(
        n in (None, m) for n, m in zip(shape, array.shape, strict=True)
    )
    dtype = np.dtype({"f": np.float64, "b": np.bool_, "i": np.int64}[kind])
    if array.dtype != dtype or not fits:
        size = tuple("any" if n is None else n for n in shape)
        raise ValueError(
            f"{name} is {array.dtype} of the shape {array.shape}; it must be {dtype} of the shape "
            f"({', '.join(map(str, size))})"
        )
    return array


def finite(arrays: Mapping[str, Array], name: str, shape: tuple[int | None, ...]) -> Array:
    """:func:`checked` for numbers that must be finite."""
    values = checked(arrays, name, shape)
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} contains a number that is not finite")
    return values


def texts(value: Any, name: str) -> tuple[str, ...]:
    """A list of strings; raises ValueError for anything else."""
    if not isinstance(value, list) or not all(isinstance(x, str) for x in value):
        raise ValueError(f"{name} is {value!r:.60}; it must be a list of texts")
    return tuple(value)


def text(value: Any, name: str) -> str:
    """A string; raises ValueError for anything else."""
    if not isinstance(value, str):
        raise ValueError(f"{name} is {value!r:.60}; it must be a text")
    return value


def _cannot_read(path: str | Path, noun: str, reason: BaseException, entry: str = "") -> FileError:
    message = f"is not {noun} that this version can read: {_text_of(reason)}"
    return FileError([Mistake(str(path), None, entry, message)])


def _text_of(reason: BaseException) -> str:
    return str(reason) or type(reason).__name__


def check_names(names: list[str], file_error: Callable[[str, str], FileError]) -> None:
    """Raises ``file_error(name, message)`` if an entry is not an array or exists twice."""
    seen = set()
    for name in names:
        if not name.endswith(_SUFFIX):
            raise file_error(name, f"is no array; arrays are called NAME{_SUFFIX}")
        if name in seen:
            raise file_error(name.removesuffix(_SUFFIX), "exists twice")
        seen.add(name)


def _array(file: IO[bytes], size: int) -> Array:
    """The array of an entry of ``size`` bytes, which must agree with its header."""
    version = np.lib.format.read_magic(file)
    if version not in _HEADERS:
        allowed = ", ".join(map(str, _HEADERS))
        raise ValueError(f"has a header of version {version}; allowed: {allowed}")
    shape, fortran, dtype = _HEADERS[version](file)
    if dtype.kind not in _DTYPE_KINDS or dtype.hasobject:
        raise ValueError(f"holds {dtype}; allowed: numbers, flags and texts")
    need, left = math.prod(shape) * dtype.itemsize, size - file.tell()
    if need != left or any(n < 0 for n in shape):
        raise ValueError(f"its header says {shape} of {dtype}, {need} bytes; found {left}")
    data = bytearray(file.read())
    if len(data) != need:
        raise ValueError(f"its header says {need} bytes; found {len(data)}")
    flat = np.frombuffer(data, dtype=dtype) if need else np.zeros(math.prod(shape), dtype)
    return flat.reshape(shape, order="F" if fortran else "C")
