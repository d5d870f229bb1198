"""The cache of compiled libraries: ``<cache>/<key[:2]>/<key>/``.

A library is built in a temporary folder and renamed, so that a killed build leaves no folder with
an entry's name. With a lock, a second process waits for the first instead of compiling the same
library; without locks both compile, and the first to rename wins.
"""

from __future__ import annotations

import contextlib
import functools
import json
import logging
import os
import re
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
    object_command,
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
from fantoccini.kernel.build.kept import PIECES, RESULTS
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
    rebuild: bool = False,
) -> Path:
    """The folder with a key's library: ``model.so``, ``info.json`` and the sources.

    Args:
        key: see :func:`fantoccini.kernel.build.fingerprint`.
        produce: derives the source; called at most once, and only if needed.
        flags: compiler flags beyond the standard ones, or a function that chooses them.
        progress: called with a few words on each stage.
        rebuild: compile even if the library exists, because it cannot be loaded.

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
        return _obtain_in(place, key, derive_once, flags, tell, rebuild)
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
        return _obtain_in(refuge, key, derive_once, flags, tell, rebuild)
    except UnusableError as error:
        raise BuildError(f"there is no place for the compiled puppet: {trouble}; {error}") from None


def clear() -> int:
    """Removes all libraries and results from the cache folder; returns the number of libraries.

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
        arrays = [*PIECES.files(), *RESULTS.files()]
        for file in [*root.glob(f"{_GROUP}/*.lock"), *arrays]:
            if _KEY.fullmatch(file.stem):
                file.unlink()
        for group in [*root.glob(_GROUP), *RESULTS.folder.glob(_GROUP), RESULTS.folder]:
            # A folder with other files in it stays.
            with contextlib.suppress(OSError):
                group.rmdir()
    except OSError as error:
        raise BuildError(f"the cache cannot be cleared: {error}") from error
    return len(libraries)


def contents() -> dict[str, tuple[int, int]]:
    """Kind of entry -> number and total size [bytes] of those in the cache folder."""
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
    rebuild: bool,
) -> Path:
    """:func:`obtain` in one cache folder; raises UnusableError if the folder cannot be used."""
    entry = root / key[:2] / key
    if trouble := distrust(root) or distrust(entry.parent):
        raise UnusableError(trouble)
    if not rebuild and _is_usable(entry):
        return entry
    _make_group(root, entry.parent)
    with _lock(entry.parent / f"{key}.lock", root, tell) as waited:
        # Another process may have made it in the meantime.
        if (waited or not rebuild) and not distrust_entry(entry, READ) and is_whole(entry):
            return entry
        for folder in _leftovers(root, age=1.0):
            shutil.rmtree(folder, ignore_errors=True)
        source = produce()
        chosen = flags(source) if callable(flags) else flags
        _make(root, entry, source, chosen, tell, replace=rebuild and not waited)
    return entry


def _is_usable(entry: Path) -> bool:
    """Whether an entry is complete and can be trusted; warns of one that others can write to."""
    if trouble := distrust_entry(entry, READ):
        warnings.warn(f"{trouble}; the puppet is compiled again", RuntimeWarning, stacklevel=2)
        return False
    return is_whole(entry)


def _make_group(root: Path, group: Path) -> None:
    """Makes the folder that holds an entry."""
    with _writing(root):
        # One by one: mkdir applies the mode only to the last folder.
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        group.mkdir(mode=0o700, exist_ok=True)
    if trouble := distrust(root) or distrust(group):
        raise UnusableError(trouble)


@dataclass(frozen=True)
class _Object:
    """An object file that several libraries share and that the cache does not have yet.

    Attributes:
        entry: its folder in the cache.
        folder: folder in which it is made.
        command: compiler command that makes it.
    """

    entry: Path
    folder: Path
    command: list[str]


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
        replace: also replace a complete entry, and the object files it is linked from.
    """
    compiler = find_compiler()
    with contextlib.ExitStack() as stack:
        with _writing(root):
            folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        try:
            objects = source.shared_objects()
            parts, whole = command_lines(compiler, source, flags, runtime_folder(), tuple(objects))
            with _writing(root):
                write_source(folder, source)
            shared = {
                name: _shared_object(root, part, flags, replace, folder / name, stack)
                for name, part in objects.items()
            }
            missing = {name: part for name, part in shared.items() if part is not None}
            tell(Progress(f"compiling with {compiler.version}"))
            for unit in source.shared_units:
                if f"{Path(unit).name}.o" in missing:
                    tell(Progress(f"compiling with {compiler.version} ({unit}, once per machine)"))
            if notice := first_build_notice(compiler):
                # Logged, so that callers without a progress callback see it too.
                _LOGGER.warning(notice)
            with _writing(root):
                commands = [(part.command, part.folder) for part in missing.values()]
                run_compilers([*commands, *((command, folder) for command in parts)])
                for name, part in missing.items():
                    shutil.copy(part.folder / LIBRARY, folder / name)
                    seal(part.folder, [part.command])
                    _settle(part.folder, part.entry, replace)
                run_compiler(whole, folder)
                for name in [*objects, *(command[-1] for command in parts)]:
                    (folder / name).unlink()
                seal(folder, [*(part.command for part in missing.values()), *parts, whole])
                _settle(folder, entry, replace)
        except BuildError as error:
            # The sources are kept for the user, until the same puppet fails again.
            sources = entry.parent / f"failed-{entry.name}"
            shutil.rmtree(sources, ignore_errors=True)
            try:
                folder.rename(sources)
            except OSError:
                sources = folder
            raise BuildError(f"{error}\nthe sources are in {sources}") from None
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise


def _shared_object(
    root: Path,
    source: Source,
    flags: tuple[str, ...],
    replace: bool,
    to: Path,
    stack: contextlib.ExitStack,
) -> _Object | None:
    """Copies an object file from the cache, or returns how to make it.

    Its key is its whole source. Two processes may compile the same; the first to rename wins.
    """
    key = fingerprint(json.dumps(source.files, sort_keys=True), "", (*flags, "-c"))
    entry = root / key[:2] / key
    if not replace and not distrust(entry.parent) and _is_usable(entry):
        # Another process may clear the cache at any time.
        with _writing(root), contextlib.suppress(FileNotFoundError):
            shutil.copy(entry / LIBRARY, to)
            return None
    _make_group(root, entry.parent)
    with _writing(root):
        folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        write_source(folder, source)
    command = object_command(find_compiler(), source.main, flags, runtime_folder(), LIBRARY)
    return _Object(entry, folder, command)


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
