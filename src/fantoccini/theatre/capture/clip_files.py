"""Files of captured motion, and the bundled ones by their names."""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.base import FileError, Mistake, did_you_mean

_FOLDER = Path(__file__).parent / "clips"


def clip_names() -> tuple[str, ...]:
    """Names of the bundled clips, from the CMU database; see ``capture/clips/NOTICE``."""
    return tuple(sorted(p.stem for p in _FOLDER.glob("*.bvh")))


def bundled_clip_path(name: str) -> Path:
    """Path of a bundled clip."""
    return _FOLDER / f"{name}.bvh"


def clip_path(path: str | os.PathLike[str]) -> Path:
    """Path of a clip: an existing path, or that of a bundled clip with this name.

    Raises:
        FileError: there is no such file or name.
    """
    path, name = Path(path), os.fspath(path)
    try:
        if path.exists():
            return path
    except (OSError, ValueError):
        return path  # reading it reports the error
    if name in clip_names():
        return bundled_clip_path(name)
    hint = f", and no bundled clip of this name{did_you_mean(name, clip_names())}"
    raise FileError(
        [Mistake(name, None, "", f"cannot be read: no such file{'' if path.suffix else hint}")]
    )
