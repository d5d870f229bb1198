"""Files to which a mesh file refers: buffers, materials, images, in its folder or below.

A material gives triangles their colour.
"""

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
        decoded = unquote(name)
        path = PurePosixPath(decoded)
        is_allowed = decoded.isprintable() and "\\" not in decoded and ":" not in decoded
        if not is_allowed or len(decoded) > 255 or path.is_absolute() or ".." in path.parts:
            raise ValueError(f"it names {_quoted(name)}; allowed: files in its folder or below")
        relative = path.as_posix()
        if relative not in self.contents:
            self.contents[relative] = self._content(path)
        content = self.contents[relative]
        if content is None:
            raise ValueError(f"it names {_quoted(name)}, which does not exist")
        if sum(len(c) for c in self.contents.values() if c is not None) > LIMITS.max_bytes:
            limit = f"{LIMITS.max_bytes / 1e6:.0f} MB"
            raise ValueError(f"the files that it names have more than {limit} in total")
        return content

    def current(self, name: str) -> bytes | None:
        """The present content of a file, by its name in ``contents``; None if it cannot be read."""
        try:
            return self._content(PurePosixPath(name))
        except ValueError:
            return None

    def _content(self, path: PurePosixPath) -> bytes | None:
        try:
            real_path = Path(os.path.realpath(self._folder / path))
            if not real_path.is_relative_to(os.path.realpath(self._root)):
                name = _quoted(path.as_posix())
                raise ValueError(f"it names {name}, which leads out of the folder")
            if not real_path.is_file():
                same_name = [
                    p
                    for p in real_path.parent.iterdir()
                    if p.name.lower() == real_path.name.lower()
                ]
                if len(same_name) != 1 or same_name[0].is_symlink() or not same_name[0].is_file():
                    return None
                real_path = same_name[0]
            if real_path.stat().st_size > LIMITS.max_bytes:
                limit = f"{LIMITS.max_bytes / 1e6:.0f} MB"
                raise ValueError(f"{_quoted(path.as_posix())} is larger than {limit}")
            return real_path.read_bytes()
        except OSError:
            return None


def _quoted(name: str) -> str:
    """A name in quotes, shortened to 60 characters."""
    return repr(name if len(name) <= 60 else f"{name[:57]}...")
