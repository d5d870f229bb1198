"""Cache of results that take seconds to compute, as lists of arrays.

Convex pieces of meshes are in ``<cache>/<key[:2]>/<key>.npz``, other results in
``<cache>/results/<key[:2]>/<key>.npz``. Files are written under a temporary name and renamed;
nothing is pickled.

Pieces are convex parts of a mesh that is not convex. The key of a result is a hash of everything
that can change it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.base import Array, npz, replacing
from fantoccini.kernel.build.folders import (
    cache_folder,
    reason_for_distrust,
    reason_for_distrust_of_entry,
)


@dataclass(frozen=True)
class ArrayStore:
    """Lists of arrays by key, in the cache folder or a folder in it.

    Attributes:
        name: name of the folder in the cache folder; "" for the cache folder itself.
    """

    name: str

    @property
    def folder(self) -> Path:
        """Folder of the store."""
        return cache_folder() / self.name

    def read(self, key: str) -> list[Array] | None:
        """The arrays of a key; None if they are missing, damaged, or writable by other users."""
        file = self._file(key)
        if self._distrusted(file.parent) or reason_for_distrust_of_entry(file.parent, [file.name]):
            return None
        try:
            with np.load(file, allow_pickle=False) as archive:
                arrays = [archive[f"arr_{i}"] for i in range(len(archive.files))]
        except npz.UNREADABLE:
            return None
        with contextlib.suppress(OSError):  # a read-only folder
            os.utime(file)  # the files used least recently are removed first
        return arrays

    def write(self, key: str, arrays: Sequence[Array]) -> None:
        """Stores arrays; in a folder that cannot be used, nothing is stored."""
        file = self._file(key)
        if self._distrusted(file.parent):
            return
        with contextlib.suppress(OSError):  # disk full or no permission
            # One by one: mkdir applies the mode only to the last folder.
            for folder in (cache_folder(), self.folder, file.parent):
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if self._distrusted(file.parent) or reason_for_distrust_of_entry(file.parent, []):
                return
            with replacing(file) as temporary:
                descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
                with os.fdopen(descriptor, "wb") as stream:
                    np.savez(stream, *arrays)

    def files(self) -> list[Path]:
        """All files of the store."""
        return [*self.folder.glob("[0-9a-f][0-9a-f]/*.npz")]

    def trim(self, max_bytes: float) -> None:
        """Removes the files used least recently, so that the others take at most ``max_bytes``."""
        if reason_for_distrust(cache_folder()) or reason_for_distrust(self.folder):
            return
        sizes: list[tuple[float, int, Path]] = []
        for file in self.files():
            with contextlib.suppress(OSError):  # another process may remove it
                status = file.stat()
                sizes.append((status.st_mtime, status.st_size, file))
        total = 0
        for _, size, file in sorted(sizes, reverse=True):
            total += size
            if total > max_bytes:
                with contextlib.suppress(OSError):
                    file.unlink()

    def _file(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"

    def _distrusted(self, group: Path) -> bool:
        return any(map(reason_for_distrust, (cache_folder(), self.folder, group)))


PIECES = ArrayStore("")
RESULTS = ArrayStore("results")


def kept_arrays(key: str, make: Callable[[], Sequence[Array]]) -> list[Array]:
    """The arrays of a key: from the cache folder, or computed and stored there.

    Args:
        key: hash of everything that can change the arrays, in hexadecimal.
        make: function that computes them.
    """
    arrays = PIECES.read(key)
    if arrays is None:
        arrays = list(make())
        PIECES.write(key, arrays)
    return arrays
