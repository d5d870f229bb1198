"""Where libraries are kept, and whether that place can be trusted.

Loading a library runs its code, so a folder that somebody else can write to is not used.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import shutil
import stat
import tempfile
from pathlib import Path

import platformdirs


class UnusableError(Exception):
    """A cache folder cannot be written or cannot be trusted; the message says which and why."""


def cache_folder() -> Path:
    """The user's cache folder, or what the environment variable FANTOCCINI_CACHE names."""
    chosen = os.environ.get("FANTOCCINI_CACHE", "").strip()
    if chosen:
        return Path(chosen).expanduser().absolute()
    return platformdirs.user_cache_path("fantoccini")


def distrust(folder: Path) -> str:
    """Why a folder cannot be trusted; empty where it can be, or does not exist yet."""
    if not hasattr(os, "geteuid"):
        return ""
    try:
        facts = folder.stat()
    except OSError:
        return ""
    if not stat.S_ISDIR(facts.st_mode):
        return f"{folder} is not a folder"
    if facts.st_uid not in (0, os.geteuid()):
        return f"{folder} belongs to another user"
    if facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{folder} can be written by other users (chmod go-w makes it usable)"
    return ""


def private_folder() -> Path:
    """A folder for this user alone, below the system's folder for temporary files.

    One name per user, so that the next process finds what this one compiled. Anybody may have
    put something under that name; then this process takes a new folder of its own and removes it
    at its end.

    Raises:
        UnusableError: nothing can be written there either.
    """
    user = os.geteuid() if hasattr(os, "geteuid") else "user"
    try:
        parent = tempfile.gettempdir()
        folder = Path(parent) / f"fantoccini-{user}"
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        return folder if _is_private(folder) else _own_folder(parent)
    except OSError as error:
        raise UnusableError(f"nor can a temporary folder be made: {error}") from error


def _is_private(folder: Path) -> bool:
    """Whether a path is a folder, not a link to one, that only this user can reach into."""
    facts = folder.lstat()
    if not stat.S_ISDIR(facts.st_mode):
        return False
    if not hasattr(os, "geteuid"):
        return True
    return facts.st_uid == os.geteuid() and stat.S_IMODE(facts.st_mode) & 0o077 == 0


@functools.cache
def _own_folder(parent: str) -> Path:
    """A new folder with mode 0700 for the life of this process."""
    folder = Path(tempfile.mkdtemp(prefix="fantoccini-", dir=parent))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
