"""Arrays that take seconds to compute, cached as ``<cache>/<key[:2]>/<key>.npz``."""

from __future__ import annotations

import contextlib
import os
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fantoccini.base import Array, replacing
from fantoccini.kernel.build.folders import cache_folder, distrust, distrust_entry


def kept_arrays(key: str, make: Callable[[], Sequence[Array]]) -> list[Array]:
    """The arrays of a key: from the cache, or computed and cached.

    They are computed if the file is damaged or others can write it, and if the cache folder cannot
    be used.

    Args:
        key: hash of everything that can change the arrays, in hexadecimal.
        make: function that computes them.
    """
    root = cache_folder()
    group = root / key[:2]
    file = group / f"{key}.npz"
    if distrust(root) or distrust(group):
        return list(make())
    arrays = None if distrust_entry(group, [file.name]) else _read(file)
    if arrays is None:
        arrays = list(make())
        with contextlib.suppress(OSError):  # disk full or no permission: computed again next time
            _write(root, file, arrays)
    return arrays


def _read(file: Path) -> list[Array] | None:
    try:
        with np.load(file, allow_pickle=False) as held:
            return [held[f"arr_{i}"] for i in range(len(held.files))]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _write(root: Path, file: Path, arrays: Sequence[Array]) -> None:
    # One by one: mkdir applies the mode only to the last folder.
    root.mkdir(mode=0o700, parents=True, exist_ok=True)
    file.parent.mkdir(mode=0o700, exist_ok=True)
    if distrust(root) or distrust_entry(file.parent, []):
        return
    with replacing(file) as part:
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as stream:
            np.savez(stream, *arrays)
