"""The formats, by ending: a new one is one line of the table, and a function that writes it."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from fantoccini.animation.scene import AnimatedScene

Writer: TypeAlias = "Callable[[AnimatedScene, Path], None]"

MAX_FPS = 1000.0
"""Keys per second, at most."""


class Format(NamedTuple):
    """How files of an ending are written.

    Attributes:
        module: of this package; its function ``write`` takes the scene and the path. Imported when
            it is first needed.
        fps: keys per second where none are given; None for keys where the motion needs them.
    """

    module: str
    fps: float | None

    @property
    def write(self) -> Writer:
        """Writes a scene to a path."""
        writer: Writer = import_module(f"fantoccini.animation.{self.module}").write
        return writer


FORMATS = {
    ".glb": Format("glb", None),
    ".usda": Format("usd", 60.0),
    ".usdc": Format("usd", 60.0),
}

ENDINGS = tuple(FORMATS)


def format_of(path: Path, fps: float | None) -> tuple[Format, float | None]:
    """The format of a path's ending, and its keys per second.

    Raises:
        ValueError: an unknown ending, or a rate that is not possible.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        found = f"ends in {path.suffix!r}" if path.suffix else "has no ending"
        raise ValueError(f"{path} {found}; an animation ends in {', '.join(ENDINGS)}")
    if fps is not None and not (math.isfinite(fps) and 0.0 < fps <= MAX_FPS):
        raise ValueError(f"fps is {fps:g}; it must be positive and at most {MAX_FPS:g}")
    found_format = FORMATS[ending]
    return found_format, found_format.fps if fps is None else fps
