"""Files that a mesh file names: buffers, materials, images, in its folder or below."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from fantoccini.model.meshes.limits import LIMITS


class Beside:
    """Reads the files that a mesh file names.

    Args:
        path: of the mesh file.
        root: folder that no file may lie outside of, also not by a link.

    Attributes:
        found: content of each file that was looked for, by its name relative to the mesh file's
            folder; None where there is none.
    """

    def __init__(self, path: Path, root: Path):
        self._folder, self._root = path.parent, root
        self.found: dict[str, bytes | None] = {}

    def read(self, name: str) -> bytes:
        """The content of a file, by its name as a URI has it.

        Raises:
            ValueError: the name leads out of the folder, or the file cannot be read.
        """
        plain = unquote(name)
        path = PurePosixPath(plain)
        allowed = plain.isprintable() and "\\" not in plain and ":" not in plain
        if not allowed or len(plain) > 255 or path.is_absolute() or ".." in path.parts:
            raise ValueError(f"it names {_shown(name)}; allowed: files in its folder or below")
        kept = path.as_posix()
        if kept not in self.found:
            self.found[kept] = self._content(path)
        content = self.found[kept]
        if content is None:
            raise ValueError(f"it names {_shown(name)}, which is not there")
        if sum(len(c) for c in self.found.values() if c is not None) > LIMITS.max_bytes:
            most = LIMITS.max_bytes / 1e6
            raise ValueError(f"the files that it names are larger than {most:.0f} MB together")
        return content

    def peek(self, name: str) -> bytes | None:
        """The content of a file that was read before, by its name in ``found``, if it is there."""
        try:
            return self._content(PurePosixPath(name))
        except ValueError:
            return None

    def _content(self, path: PurePosixPath) -> bytes | None:
        try:
            place = Path(os.path.realpath(self._folder / path))
            if not place.is_relative_to(os.path.realpath(self._root)):
                name = _shown(path.as_posix())
                raise ValueError(f"it names {name}, which leads out of the folder")
            if not place.is_file():
                return None
            if place.stat().st_size > LIMITS.max_bytes:
                most = LIMITS.max_bytes / 1e6
                raise ValueError(f"{_shown(path.as_posix())} is larger than {most:.0f} MB")
            return place.read_bytes()
        except OSError:
            return None


def _shown(name: str) -> str:
    """A name in quotes, cut."""
    return repr(name if len(name) <= 60 else f"{name[:57]}...")
