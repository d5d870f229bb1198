"""Formats by ending. A new format needs a line in the table and a function that writes it.

A key is a value at a time, between which players interpolate.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from fantoccini.base import MissingLibraryError

if TYPE_CHECKING:
    from fantoccini.output.animation.scene import AnimatedScene

Writer: TypeAlias = "Callable[[AnimatedScene, Path], None]"

MAX_FPS = 1000.0
"""Largest number of keys per second."""


class Library(NamedTuple):
    """Library that a format needs.

    Attributes:
        module: module that it provides.
        name: name of its package.
        extra: extra of this package that installs it.
    """

    module: str
    name: str
    extra: str


class Format(NamedTuple):
    """Format of the files with one ending.

    Attributes:
        module: module of this package, imported when it is needed; its function ``write`` takes
            the scene and the path.
        fps: default of keys per second; None for keys at the times that the motion requires.
        library: library that it needs.
    """

    module: str
    fps: float | None
    library: Library | None = None

    @property
    def writer(self) -> Writer:
        """The function that writes a scene to a path."""
        writer: Writer = import_module(f"fantoccini.output.animation.{self.module}").write
        return writer


_USD = Format("usd", 60.0, Library("pxr", "usd-core", "usd"))

FORMATS = {
    ".glb": Format("glb", None),
    ".usda": _USD,
    ".usdc": _USD,
    ".bvh": Format("bvh", 60.0),
    ".csv": Format("table", None),
    ".mcap": Format("foxglove", 60.0, Library("mcap_protobuf", "mcap-protobuf-support", "mcap")),
}

SUFFIXES = tuple(FORMATS)


def format_of(path: Path, fps: float | None) -> tuple[Format, float | None]:
    """Format of a path, by its ending, and its keys per second.

    Raises:
        ValueError: the ending is unknown, or the rate is out of range.
        MissingLibraryError: the format's library is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        problem = f"ends in {path.suffix!r}" if path.suffix else "has no ending"
        raise ValueError(f"{path} {problem}; an animation ends in {', '.join(SUFFIXES)}")
    if fps is not None and not 0.0 < fps <= MAX_FPS:
        raise ValueError(f"fps is {fps!s:.12}; it must be positive and at most {MAX_FPS:g}")
    file_format = FORMATS[suffix]
    if file_format.library is not None and find_spec(file_format.library.module) is None:
        raise MissingLibraryError(f"a file that ends in {suffix}", *file_format.library[1:])
    return file_format, file_format.fps if fps is None else fps
