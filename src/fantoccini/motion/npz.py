"""Reading npz files that may be damaged, of another make, or meant to do harm.

Nothing is unpickled. What an array needs is known from the file's own table and the array's header
before any of it is expanded; every mistake is one located error.
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

from fantoccini.arrays import Array
from fantoccini.errors import FantocciniError, FileError, Problem

MAX_BYTES = 256_000_000
"""Size that the arrays of a file may have together [bytes]; those of a larger file
:data:`MAX_GROWTH` times its own."""
MAX_GROWTH = 20
"""Times its own size that a file's arrays may need; measured numbers shrink to a tenth at best."""
ABOUT = "about"
"""Entry with JSON text that says what the arrays are."""

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
"""What Python, NumPy and what is made of an npz file raise where it is not one, or is damaged."""

_ENDING = ".npy"
_HEADERS: dict[tuple[int, int], Callable[[IO[bytes]], tuple[tuple[int, ...], bool, Any]]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_KINDS = "biufcSU"
"""Kinds of arrays that are plain numbers, flags or texts."""


def read(
    path: str | Path,
    only: str | None = None,
    most: int | None = None,
    error: type[FileError] = FileError,
) -> dict[str, Array]:
    """The arrays of an npz file, by name.

    Args:
        path: of the file.
        only: the one that is wanted; all when not given.
        most: size that they may have together [bytes]; see :data:`MAX_BYTES`.
        error: what is raised.

    Raises:
        FileError: or ``error``; there is no such file, it is no npz file of plain arrays, or is
            damaged, or its arrays are too large: which entry, what was found, what is allowed.
    """
    path = Path(path)

    def wrong(entry: str, text: str) -> FileError:
        return error([Problem(str(path), None, entry, text)])

    try:
        size = path.stat().st_size
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            names = [item.filename for item in entries]
            _check_names(names, wrong)
            need, allowed = sum(x.file_size for x in entries), max(MAX_BYTES, MAX_GROWTH * size)
            if most is not None:
                allowed = most
            if need > allowed:
                raise wrong(
                    "", f"its arrays need {need / 1e6:,.0f} MB; the most that is read of this file "
                    f"is {allowed / 1e6:,.0f} MB"
                )  # fmt: skip
            found = {}
            for item in entries:
                name = item.filename.removesuffix(_ENDING)
                if only not in (None, name):
                    continue
                try:
                    with archive.open(item) as file:
                        found[name] = _array(file, item.file_size)
                except UNREADABLE as trouble:
                    raise wrong(name, f"is not a plain array: {_said(trouble)}") from None
            return found
    except FileNotFoundError:
        raise wrong("", "there is no such file") from None
    except FileError:
        raise
    except UNREADABLE as trouble:
        raise wrong("", f"is not an npz file of plain arrays: {_said(trouble)}") from None


def contents(path: str | Path, form: str, what: str) -> tuple[dict[str, Array], dict[str, Any]]:
    """The arrays of an npz file without ``about``, and what that says.

    Args:
        path: the file.
        form: the ``format`` that ``about`` must have.
        what: such files are called.

    Raises:
        FileError: as of :func:`read`, or it has another format.
    """
    arrays = read(path)
    try:
        about = about_of(arrays)
        if about["format"] != form:
            raise ValueError(f"has the format {about['format']!r}; this version reads {form!r}")
    except UNREADABLE as trouble:
        text = f"is not {what} that this version can read: {_said(trouble)}"
        raise FileError([Problem(str(path), None, ABOUT, text)]) from None
    del arrays[ABOUT]
    return arrays, about


def about_of(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """What the ``about`` of a file's arrays says; one of ``UNREADABLE`` where it is not there."""
    if ABOUT not in arrays:
        raise ValueError("it is missing")
    about = json.loads(arrays[ABOUT].tobytes())
    if not isinstance(about, dict):
        raise ValueError(f"found {type(about).__name__}; needed: names and values")
    return about


@contextmanager
def understanding(path: str | Path, what: str) -> Iterator[None]:
    """Turns what is raised in the block into a located error: the file is not ``what``."""
    try:
        yield
    except FileError as trouble:
        if all(problem.file == str(path) for problem in trouble.problems):
            raise
        raise _not_what(path, what, trouble) from trouble
    except UNREADABLE as trouble:
        raise _not_what(path, what, trouble) from trouble


def checked(
    arrays: Mapping[str, Array], name: str, shape: tuple[int | None, ...], kind: str = "f"
) -> Array:
    """An array of a file, of the shape and kind that it must have.

    Args:
        arrays: of the file.
        name: of the array.
        shape: None for any length.
        kind: ``f`` for finite or infinite numbers, ``b`` for flags, ``i`` for whole numbers.

    Raises:
        ValueError: it is missing, or another one.
    """
    if name not in arrays:
        raise ValueError(f"{name} is missing")
    found = arrays[name]
    fits = len(found.shape) == len(shape) and all(
        n in (None, m) for n, m in zip(shape, found.shape, strict=True)
    )
    wanted = np.dtype({"f": np.float64, "b": np.bool_, "i": np.int64}[kind])
    if found.dtype != wanted or not fits:
        size = tuple("any" if n is None else n for n in shape)
        raise ValueError(
            f"{name} is {found.dtype} of the shape {found.shape}; it must be {wanted} of the shape "
            f"({', '.join(map(str, size))})"
        )
    return found


def finite(arrays: Mapping[str, Array], name: str, shape: tuple[int | None, ...]) -> Array:
    """The same of numbers that must be finite."""
    found = checked(arrays, name, shape)
    if not np.all(np.isfinite(found)):
        raise ValueError(f"{name} holds what is no finite number")
    return found


def texts(value: Any, name: str) -> tuple[str, ...]:
    """A list of texts.

    Raises:
        ValueError: it is something else.
    """
    if not isinstance(value, list) or not all(isinstance(x, str) for x in value):
        raise ValueError(f"{name} is {value!r:.60}; it must be a list of texts")
    return tuple(value)


def _not_what(path: str | Path, what: str, trouble: BaseException) -> FileError:
    text = f"is not {what} that this version can read: {_said(trouble)}"
    return FileError([Problem(str(path), None, "", text)])


def _said(trouble: BaseException) -> str:
    return str(trouble) or type(trouble).__name__


def _check_names(names: list[str], wrong: Callable[[str, str], FileError]) -> None:
    seen = set()
    for name in names:
        if not name.endswith(_ENDING):
            raise wrong(name, f"is no array; arrays are called NAME{_ENDING}")
        if name in seen:
            raise wrong(name.removesuffix(_ENDING), "is there twice")
        seen.add(name)


def _array(file: IO[bytes], size: int) -> Array:
    """The array of an entry of ``size`` bytes; its header must agree with that."""
    version = np.lib.format.read_magic(file)
    if version not in _HEADERS:
        allowed = ", ".join(map(str, _HEADERS))
        raise ValueError(f"has a header of version {version}; allowed: {allowed}")
    shape, fortran, dtype = _HEADERS[version](file)
    if dtype.kind not in _KINDS or dtype.hasobject:
        raise ValueError(f"holds {dtype}; allowed: numbers, flags and texts")
    need, left = math.prod(shape) * dtype.itemsize, size - file.tell()
    if need != left or any(n < 0 for n in shape):
        raise ValueError(f"its header says {shape} of {dtype}, {need} bytes; found {left}")
    data = bytearray(file.read())
    if len(data) != need:
        raise ValueError(f"its header says {need} bytes; found {len(data)}")
    flat = np.frombuffer(data, dtype=dtype) if need else np.zeros(math.prod(shape), dtype)
    return flat.reshape(shape, order="F" if fortran else "C")
