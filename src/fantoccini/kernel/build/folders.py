"""The cache folder, and checks that it can be trusted.

Loading a library runs its code: folders and files that another user can write are not used.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import shutil
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path

import platformdirs


class UnusableError(Exception):
    """A cache folder cannot be written or trusted; the message is the reason."""


def cache_folder() -> Path:
    """The folder in the environment variable FANTOCCINI_CACHE, or the user's cache folder."""
    chosen = os.environ.get("FANTOCCINI_CACHE", "").strip()
    if chosen:
        return Path(chosen).expanduser().absolute()
    return platformdirs.user_cache_path("fantoccini")


def reason_for_distrust(folder: Path) -> str:
    """Reason why a folder cannot be trusted; empty if it can, or does not exist.

    Links are followed: a user may have the cache on another disk.
    """
    try:
        status = folder.stat()
    except OSError:
        return ""
    if not stat.S_ISDIR(status.st_mode):
        return f"{folder} is not a folder"
    return _writable_by_others(folder, status)


def reason_for_distrust_of_entry(entry: Path, files: Iterable[str]) -> str:
    """Reason why an entry of the cache cannot be trusted; empty if it can, or does not exist.

    Links are not allowed: they may lead to folders that others can write.

    Args:
        entry: folder of the entry.
        files: names of the files in it that are read.
    """
    for path, is_kind, expected in (
        (entry, stat.S_ISDIR, "folder"),
        *((entry / name, stat.S_ISREG, "file") for name in files),
    ):
        try:
            status = path.lstat()
        except OSError:
            continue
        if not is_kind(status.st_mode):
            return f"{path} is not a {expected}"
        if trouble := _writable_by_others(path, status):
            return trouble
    return ""


def open_lock(path: Path) -> int:
    """A descriptor of a lock file, which is created if it is missing.

    Raises:
        OSError: the file cannot be opened, or is a link, a pipe or another user's.
    """
    if path.is_symlink():
        raise OSError(f"{path} is a link")
    # Neither wait for a pipe nor follow a link that appeared in the meantime.
    safely = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | safely, 0o600)
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode) or status.st_uid not in (0, os.geteuid()):
        os.close(descriptor)
        raise OSError(f"{path} is not a file of this user")
    return descriptor


def _writable_by_others(path: Path, status: os.stat_result) -> str:
    """Reason why another user may write a file or folder; empty if no other user may."""
    if not hasattr(os, "geteuid"):
        return ""
    if status.st_uid not in (0, os.geteuid()):
        return f"{path} belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{path} can be written by other users (chmod go-w makes it usable)"
    return ""


def private_folder() -> Path:
    """A folder for this user only, in the system's folder for temporary files.

    Its name is fixed, so that the next process uses the same folder. If a file or another user's
    folder has that name, this process uses a new folder and removes it at exit.

    Raises:
        UnusableError: the temporary folder cannot be written either.
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
    """Whether a path is a folder, not a link, that only this user can access."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    if not hasattr(os, "geteuid"):
        return True
    return status.st_uid == os.geteuid() and stat.S_IMODE(status.st_mode) & 0o077 == 0


@functools.cache
def _own_folder(parent: str) -> Path:
    """A new folder with mode 0700 for the life of this process."""
    folder = Path(tempfile.mkdtemp(prefix="fantoccini-", dir=parent))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
