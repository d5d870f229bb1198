"""The cache of compiled libraries: ``<cache>/<key[:2]>/<key>/``.

A library is built in a temporary folder and renamed, so that a killed build leaves no folder with
an entry's name. With a lock, a second process waits for the first instead of compiling the same
library; without locks both compile, and the first to rename wins.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import re
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

from fantoccini.base import BuildError, OnProgress, Progress
from fantoccini.kernel.build.compiler import (
    COMPILE_SECONDS,
    DiskError,
    command_lines,
    default_flags,
    find_compiler,
    first_build_notice,
    run_compiler,
    run_compilers,
)
from fantoccini.kernel.build.entry import LIBRARY, READ, Source, is_whole, seal, write_source
from fantoccini.kernel.build.folders import (
    UnusableError,
    cache_folder,
    distrust,
    distrust_entry,
    open_lock,
    private_folder,
)
from fantoccini.kernel.build.key import fingerprint, runtime_folder

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

Flags = Callable[[Source], tuple[str, ...]] | tuple[str, ...]

LOCK_SECONDS = COMPILE_SECONDS + 60.0
"""Time to wait for another process that compiles the same library [s]."""

_LOGGER = logging.getLogger(__name__)

_LIFETIMES = {"tmp-*": 3600.0, "failed-*": 7 * 86400.0}
"""Folders of killed and failed builds, and the age at which they are removed [s]."""

_KEY = re.compile(r"[0-9a-f]{16,128}")
_GROUP = "[0-9a-f][0-9a-f]"


def obtain(
    key: str,
    produce: Callable[[], Source],
    *,
    flags: Flags = default_flags,
    progress: OnProgress | None = None,
    afresh: bool = False,
) -> Path:
    """The folder with a key's library: ``model.so``, ``info.json`` and the sources.

    Args:
        key: see :func:`fantoccini.kernel.build.fingerprint`.
        produce: derives the source; called at most once, and only if needed.
        flags: compiler flags beyond the standard ones, or a function that chooses them.
        progress: called with a few words on each stage.
        afresh: compile even if the library exists, because it cannot be loaded.

    Raises:
        BuildError: no compiler, a compiler that failed, or no writable folder.
    """
    if not _KEY.fullmatch(key):
        raise ValueError(f"{key!r} is not a key")
    tell = progress or (lambda progress: None)

    @functools.cache
    def derive_once() -> Source:
        tell(Progress("deriving the equations of motion"))
        return produce()

    place = cache_folder()
    try:
        return _obtain_in(place, key, derive_once, flags, tell, afresh)
    except UnusableError as error:
        trouble = error
    try:
        refuge = private_folder()
        warnings.warn(
            f"the cache folder is not used: {trouble}; compiled puppets go to {refuge} "
            f"(the environment variable FANTOCCINI_CACHE names another folder)",
            RuntimeWarning,
            stacklevel=2,
        )
        return _obtain_in(refuge, key, derive_once, flags, tell, afresh)
    except UnusableError as error:
        raise BuildError(f"there is no place for the compiled puppet: {trouble}; {error}") from None


def clear() -> int:
    """Removes all libraries and arrays from the cache folder; returns the number of libraries.

    Raises:
        BuildError: the folder is another user's, or something in it cannot be removed.
    """
    root = cache_folder()
    if trouble := distrust(root):
        raise BuildError(f"the cache is not cleared: {trouble}")
    libraries = entries(root)
    try:
        for folder in [*libraries, *_leftovers(root)]:
            shutil.rmtree(folder)
        for kind in ("lock", "npz"):
            for file in root.glob(f"{_GROUP}/*.{kind}"):
                if _KEY.fullmatch(file.stem):
                    file.unlink()
        for group in root.glob(_GROUP):
            # A folder with other files in it stays.
            with contextlib.suppress(OSError):
                group.rmdir()
    except OSError as error:
        raise BuildError(f"the cache cannot be cleared: {error}") from error
    return len(libraries)


def entries(root: Path) -> list[Path]:
    """The folders of all entries below a cache folder."""
    return [e for e in root.glob(f"{_GROUP}/*") if _KEY.fullmatch(e.name)]


def _leftovers(root: Path, age: float = 0.0) -> list[Path]:
    """Folders of killed and failed builds, at least ``age`` lifetimes old."""
    now = time.time()
    folders = []
    for pattern, lifetime in _LIFETIMES.items():
        for folder in root.glob(f"{_GROUP}/{pattern}"):
            with contextlib.suppress(OSError):
                if now - folder.stat().st_mtime >= age * lifetime:
                    folders.append(folder)
    return folders


def _obtain_in(
    root: Path,
    key: str,
    produce: Callable[[], Source],
    flags: Flags,
    tell: OnProgress,
    afresh: bool,
) -> Path:
    """:func:`obtain` in one cache folder; raises UnusableError if the folder cannot be used."""
    group = root / key[:2]
    entry = group / key
    if trouble := distrust(root) or distrust(group):
        raise UnusableError(trouble)
    if trouble := distrust_entry(entry, READ):
        warnings.warn(f"{trouble}; the puppet is compiled again", RuntimeWarning, stacklevel=2)
        afresh = True
    if not afresh and is_whole(entry):
        return entry
    with _writing(root):
        # One by one: mkdir applies the mode only to the last folder.
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        group.mkdir(mode=0o700, exist_ok=True)
    if trouble := distrust(root) or distrust(group):
        raise UnusableError(trouble)
    with _lock(group / f"{key}.lock", root, tell) as waited:
        # Another process may have built it in the meantime.
        if (waited or not afresh) and not distrust_entry(entry, READ) and is_whole(entry):
            return entry
        for folder in _leftovers(root, age=1.0):
            shutil.rmtree(folder, ignore_errors=True)
        source = produce()
        chosen = flags(source) if callable(flags) else flags
        _make(root, entry, source, chosen, tell, replace=afresh and not waited)
    return entry


def _make(
    root: Path, entry: Path, source: Source, flags: tuple[str, ...], tell: OnProgress, replace: bool
) -> None:
    """Compiles a source under a temporary name and moves it to the entry's place.

    Args:
        root: the cache folder.
        entry: folder of the entry.
        source: source files of the library.
        flags: compiler flags beyond the standard ones.
        tell: progress callback.
        replace: whether to replace a complete entry.
    """
    compiler = find_compiler()
    shared = {
        f"{Path(name).name}.o": _shared_object(root, name, flags, tell, afresh=replace)
        for name in source.shared_units
    }
    with _writing(root):
        folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
    try:
        parts, whole = command_lines(compiler, source, flags, runtime_folder(), tuple(shared))
        with _writing(root):
            write_source(folder, source)
            for name, file in shared.items():
                shutil.copy(file, folder / name)
        tell(Progress(f"compiling with {compiler.version}"))
        if notice := first_build_notice(compiler):
            # Logged, so that callers without a progress callback see it too.
            _LOGGER.warning(notice)
        with _writing(root):
            run_compilers(parts, folder)
            run_compiler(whole, folder)
            for name in [*shared, *(command[-1] for command in parts)]:
                (folder / name).unlink()
            seal(folder, [*parts, whole])
            _settle(folder, entry, replace)
    except BuildError as error:
        # The sources are kept for the user, until the same puppet fails again.
        failed = entry.parent / f"failed-{entry.name}"
        shutil.rmtree(failed, ignore_errors=True)
        try:
            folder.rename(failed)
        except OSError:
            failed = folder
        raise BuildError(f"{error}\nthe sources are in {failed}") from None
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _shared_object(
    root: Path, name: str, flags: tuple[str, ...], tell: OnProgress, afresh: bool
) -> Path:
    """Compiles a shared runtime unit once per machine and flags; the path of its object file.

    It is cached like a library; with ``-c`` the cached file is an object file.
    """
    text = f'#include "fantoccini/{name}.hpp"\n'
    source, flags = Source({"unit.cpp": text}, "unit.cpp"), (*flags, "-c")
    key = fingerprint(text, "", flags)

    def report(progress: Progress) -> None:
        tell(Progress(f"{progress.what} ({name}, once per machine)"))

    _obtain_in(root, key, lambda: source, flags, report, afresh)
    return root / key[:2] / key / LIBRARY


def _settle(folder: Path, entry: Path, replace: bool) -> None:
    """Gives a finished folder its entry's name, unless another process was first."""
    for _ in range(3):
        try:
            folder.rename(entry)
            return
        except OSError:
            if not entry.exists():
                raise
        if not replace and not distrust_entry(entry, READ) and is_whole(entry):
            shutil.rmtree(folder, ignore_errors=True)
            return
        # Move the old entry aside: a folder cannot be renamed onto a non-empty one.
        aside = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        with contextlib.suppress(FileNotFoundError):
            entry.rename(aside / "old")
        shutil.rmtree(aside, ignore_errors=True)
    raise OSError(f"{entry} cannot be replaced")


@contextlib.contextmanager
def _writing(root: Path) -> Iterator[None]:
    """Raises UnusableError if the block cannot write below a cache folder."""
    try:
        yield
    except OSError as error:
        reason = str(error) if isinstance(error, DiskError) else (error.strerror or str(error))
        raise UnusableError(f"{root} cannot be written: {reason}") from error


@contextlib.contextmanager
def _lock(file: Path, root: Path, tell: OnProgress) -> Iterator[bool]:
    """Holds a key's lock; yields whether another process held it first.

    Continues without it after ``LOCK_SECONDS`` and on file systems without locks: two builds of one
    key are wasteful but harmless.
    """
    if fcntl is None:
        yield False
        return
    with contextlib.ExitStack() as stack:
        with _writing(root):
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
                    tell(Progress("waiting for another process that compiles the same puppet"))
                waited = True
                time.sleep(0.05)
            except OSError:
                break
        yield waited
