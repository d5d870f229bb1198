"""Files to which a mesh file refers: buffers, materials, images, in its folder or below."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from fantoccini.model.meshes.limits import LIMITS


class LinkedFiles:
    """Reads the files to which a mesh file refers.

    Args:
        path: path of the mesh file.
        root: folder that must contain all files, with links resolved.

    Attributes:
        contents: name of a requested file, relative to the mesh file's folder -> its content; None
            if it does not exist.
    """

    def __init__(self, path: Path, root: Path):
        self._folder, self._root = path.parent, root
        self.contents: dict[str, bytes | None] = {}

    def read(self, name: str) -> bytes:
        """The content of a file, by its name in a URI; upper and lower case may differ.

        Raises:
            ValueError: the file lies outside the folder, or cannot be read.
        """
        plain = unquote(name)
        path = PurePosixPath(plain)
        allowed = plain.isprintable() and "\\" not in plain and ":" not in plain
        if not allowed or len(plain) > 255 or path.is_absolute() or ".." in path.parts:
            raise ValueError(f"it names {_shown(name)}; allowed: files in its folder or below")
        relative = path.as_posix()
        if relative not in self.contents:
            self.contents[relative] = self._content(path)
        content = self.contents[relative]
        if content is None:
            raise ValueError(f"it names {_shown(name)}, which does not exist")
        if sum(len(c) for c in self.contents.values() if c is not None) > LIMITS.max_bytes:
            limit = f"{LIMITS.max_bytes / 1e6:.0f} MB"
            raise ValueError(f"the files that it names have more than {limit} in total")
        return content

    def peek(self, name: str) -> bytes | None:
        """The present content of a file, by its name in ``contents``; None if it cannot be read."""
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
                alike = [p for p in place.parent.iterdir() if p.name.lower() == place.name.lower()]
                if len(alike) != 1 or alike[0].is_symlink() or not alike[0].is_file():
                    return None
                place = alike[0]
            if place.stat().st_size > LIMITS.max_bytes:
                limit = f"{LIMITS.max_bytes / 1e6:.0f} MB"
                raise ValueError(f"{_shown(path.as_posix())} is larger than {limit}")
            return place.read_bytes()
        except OSError:
            return None


def _shown(name: str) -> str:
    """A name in quotes, shortened to 60 characters."""
    return repr(name if len(name) <= 60 else f"{name[:57]}...")
