"""The cache of compiled libraries: ``<cache>/<key[:2]>/<key>/``.

A library is built in a temporary folder and renamed, so that a killed build leaves no folder with
an entry's name. With a lock, a second process waits for the first one instead of compiling the same
library. Without locks both compile, and the entry is that of the first to finish.

An entry is the folder of one library, and its key a hash of everything that can change it.
"""

from __future__ import annotations

import contextlib
import functools
import os
import re
import shutil
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

from fantoccini.base import BuildError, OnProgress, Progress
from fantoccini.kernel.build.building import (
    Derivation,
    Flags,
    build_entry,
    is_usable,
    make_parent,
    write_errors,
)
from fantoccini.kernel.build.compiler import COMPILE_SECONDS, default_flags
from fantoccini.kernel.build.entry import READ, Source, is_whole
from fantoccini.kernel.build.folders import (
    UnusableError,
    cache_folder,
    open_lock,
    private_folder,
    reason_for_distrust,
    reason_for_distrust_of_entry,
)
from fantoccini.kernel.build.kept import PIECES, RESULTS

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

LOCK_SECONDS = COMPILE_SECONDS + 60.0
"""Time to wait for another process that compiles the same library [s]."""

_LIFETIMES = {"tmp-*": 3600.0, "failed-*": 7 * 86400.0}
"""Patterns of the folders of killed and failed builds -> age at which they are removed [s]."""

_KEY = re.compile(r"[0-9a-f]{16,128}")
_GROUP = "[0-9a-f][0-9a-f]"


def obtain(
    key: str,
    produce: Callable[[], Source],
    *,
    early: Callable[[], dict[str, Source]] | None = None,
    flags: Flags = default_flags,
    progress: OnProgress | None = None,
    rebuild: bool = False,
) -> Path:
    """The folder with a key's library: ``model.so``, ``info.json`` and the sources.

    Args:
        key: see :func:`fantoccini.kernel.build.fingerprint`.
        produce: derives the source; called at most once, and only if needed.
        early: the source's ``shared_objects()``, as far as they are known before ``produce`` is
            called; they are compiled while it runs.
        flags: compiler flags beyond the standard ones, or a function that chooses them.
        progress: called with the name of each stage.
        rebuild: compile even if the library exists, because it cannot be loaded.

    Raises:
        BuildError: no compiler, a compiler that failed, or no writable folder.
    """
    if not _KEY.fullmatch(key):
        raise ValueError(f"{key!r} is not a key")
    report = progress or (lambda progress: None)

    @functools.cache
    def early_once() -> dict[str, Source]:
        report(Progress("deriving the equations of motion"))
        return early() if early else {}

    derivation = Derivation(early_once, functools.cache(produce))
    try:
        return _obtain_in(cache_folder(), key, derivation, flags, report, rebuild)
    except UnusableError as error:
        reason = error
    try:
        other_folder = private_folder()
        warnings.warn(
            f"the cache folder is not used: {reason}; compiled puppets are in {other_folder} "
            f"(the environment variable FANTOCCINI_CACHE names another folder)",
            RuntimeWarning,
            stacklevel=2,
        )
        return _obtain_in(other_folder, key, derivation, flags, report, rebuild)
    except UnusableError as error:
        raise BuildError(f"no folder can store the compiled puppet: {reason}; {error}") from None


def clear() -> int:
    """Removes all libraries and results from the cache folder; returns the number of libraries.

    Raises:
        BuildError: the folder is another user's, or something in it cannot be removed.
    """
    root = cache_folder()
    if reason := reason_for_distrust(root):
        raise BuildError(f"the cache is not cleared: {reason}")
    libraries = entries(root)
    try:
        for folder in [*libraries, *_leftovers(root)]:
            shutil.rmtree(folder)
        array_files = [*PIECES.files(), *RESULTS.files()]
        for file in [*root.glob(f"{_GROUP}/*.lock"), *array_files]:
            if _KEY.fullmatch(file.stem):
                file.unlink()
        for group in [*root.glob(_GROUP), *RESULTS.folder.glob(_GROUP), RESULTS.folder]:
            # A folder with other files remains.
            with contextlib.suppress(OSError):
                group.rmdir()
    except OSError as error:
        raise BuildError(f"the cache cannot be cleared: {error}") from error
    return len(libraries)


def contents() -> dict[str, tuple[int, int]]:
    """Number and total size [bytes] of the entries in the cache folder, by kind."""
    libraries = [[*entry.iterdir()] for entry in entries(cache_folder())]
    kinds = {
        "compiled libraries": libraries,
        "meshes in convex pieces": [[file] for file in PIECES.files()],
        "results of plays": [[file] for file in RESULTS.files()],
    }
    return {
        kind: (len(files), sum(file.stat().st_size for entry in files for file in entry))
        for kind, files in kinds.items()
    }


def entries(root: Path) -> list[Path]:
    """The folders of all entries below a cache folder."""
    return [e for e in root.glob(f"{_GROUP}/*") if _KEY.fullmatch(e.name)]


def _leftovers(root: Path, age: float = 0.0) -> list[Path]:
    """Folders of killed and failed builds; ``age`` is the smallest age, in lifetimes."""
    now = time.time()
    folders = []
    for pattern, lifetime in _LIFETIMES.items():
        for folder in root.glob(f"{_GROUP}/{pattern}"):
            with contextlib.suppress(OSError):
                if now - folder.stat().st_mtime >= age * lifetime:
                    folders.append(folder)
    return folders


def _obtain_in(
    root: Path, key: str, derivation: Derivation, flags: Flags, report: OnProgress, rebuild: bool
) -> Path:
    """:func:`obtain` in one cache folder; raises UnusableError if the folder cannot be used."""
    entry = root / key[:2] / key
    if reason := reason_for_distrust(root) or reason_for_distrust(entry.parent):
        raise UnusableError(reason)
    if not rebuild and is_usable(entry):
        return entry
    make_parent(root, entry.parent)
    with _lock(entry.parent / f"{key}.lock", root, report) as waited:
        # Another process may have compiled it in the meantime.
        if (
            (waited or not rebuild)
            and not reason_for_distrust_of_entry(entry, READ)
            and is_whole(entry)
        ):
            return entry
        for folder in _leftovers(root, age=1.0):
            shutil.rmtree(folder, ignore_errors=True)
        build_entry(root, entry, derivation, flags, report, replace=rebuild and not waited)
    return entry


@contextlib.contextmanager
def _lock(file: Path, root: Path, report: OnProgress) -> Iterator[bool]:
    """Context that holds a key's lock; its value is whether another process held it first.

    It continues without the lock after ``LOCK_SECONDS`` and on file systems without locks: two
    builds of one key are wasteful but harmless.
    """
    if fcntl is None:
        yield False
        return
    with contextlib.ExitStack() as stack:
        with write_errors(root):
            descriptor = open_lock(file)
        stack.callback(os.close, descriptor)  # which releases the lock
        waited = False
        deadline = time.monotonic() + LOCK_SECONDS
        while time.monotonic() < deadline:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if not waited:
                    report(Progress("waiting for another process that compiles the same puppet"))
                waited = True
                time.sleep(0.05)
            except OSError:
                break
        yield waited
