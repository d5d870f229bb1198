"""The formats, by ending: a new one is one line of the table, and a function that writes it."""

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
"""Keys per second, at most."""


class Library(NamedTuple):
    """A library that one format needs.

    Attributes:
        module: that it brings.
        name: of the package.
        extra: of ours, that installs it.
    """

    module: str
    name: str
    extra: str


class Format(NamedTuple):
    """How files of an ending are written.

    Attributes:
        module: of this package; its function ``write`` takes the scene and the path. Imported when
            it is first needed.
        fps: keys per second where none are given; None for keys where the motion needs or has them.
        library: that it needs.
    """

    module: str
    fps: float | None
    library: Library | None = None

    @property
    def write(self) -> Writer:
        """Writes a scene to a path."""
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

ENDINGS = tuple(FORMATS)


def format_of(path: Path, fps: float | None) -> tuple[Format, float | None]:
    """The format of a path's ending, and its keys per second.

    Raises:
        ValueError: an unknown ending, or a rate that is not possible.
        MissingLibraryError: the format's library is not installed.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        found = f"ends in {path.suffix!r}" if path.suffix else "has no ending"
        raise ValueError(f"{path} {found}; an animation ends in {', '.join(ENDINGS)}")
    if fps is not None and not 0.0 < fps <= MAX_FPS:
        raise ValueError(f"fps is {fps!s:.12}; it must be positive and at most {MAX_FPS:g}")
    form = FORMATS[ending]
    if form.library is not None and find_spec(form.library.module) is None:
        raise MissingLibraryError(f"a file that ends in {ending}", *form.library[1:])
    return form, form.fps if fps is None else fps
