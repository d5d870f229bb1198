"""The cache of compiled libraries: ``<cache>/<key[:2]>/<key>/``.

A library is built in a temporary folder and renamed, so that a killed build leaves no folder with
an entry's name. With a lock, a second process waits for the first one instead of compiling the same
library. Without locks both compile, and the entry is that of the first to finish.

An entry is the folder of one library, and its key a hash of everything that can change it.
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
    open_lock,
    private_folder,
    reason_for_distrust,
    reason_for_distrust_of_entry,
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
"""Patterns of the folders of killed and failed builds -> age at which they are removed [s]."""

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
        progress: called with the name of each stage.
        rebuild: compile even if the library exists, because it cannot be loaded.

    Raises:
        BuildError: no compiler, a compiler that failed, or no writable folder.
    """
    if not _KEY.fullmatch(key):
        raise ValueError(f"{key!r} is not a key")
    report = progress or (lambda progress: None)

    @functools.cache
    def derive_once() -> Source:
        report(Progress("deriving the equations of motion"))
        return produce()

    try:
        return _obtain_in(cache_folder(), key, derive_once, flags, report, rebuild)
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
        return _obtain_in(other_folder, key, derive_once, flags, report, rebuild)
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
    root: Path,
    key: str,
    produce: Callable[[], Source],
    flags: Flags,
    report: OnProgress,
    rebuild: bool,
) -> Path:
    """:func:`obtain` in one cache folder; raises UnusableError if the folder cannot be used."""
    entry = root / key[:2] / key
    if reason := reason_for_distrust(root) or reason_for_distrust(entry.parent):
        raise UnusableError(reason)
    if not rebuild and _is_usable(entry):
        return entry
    _make_parent(root, entry.parent)
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
        source = produce()
        source_flags = flags(source) if callable(flags) else flags
        _compile(root, entry, source, source_flags, report, replace=rebuild and not waited)
    return entry


def _is_usable(entry: Path) -> bool:
    """Whether an entry is complete and trusted; warns of one that other users can change."""
    if reason := reason_for_distrust_of_entry(entry, READ):
        warnings.warn(f"{reason}; the puppet is compiled again", RuntimeWarning, stacklevel=2)
        return False
    return is_whole(entry)


def _make_parent(root: Path, parent: Path) -> None:
    """Creates the parent folder of an entry."""
    with _write_errors(root):
        # One after the other: mkdir applies the mode only to the last folder.
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        parent.mkdir(mode=0o700, exist_ok=True)
    if reason := reason_for_distrust(root) or reason_for_distrust(parent):
        raise UnusableError(reason)


@dataclass(frozen=True)
class _MissingObject:
    """An object file, shared by several libraries, that the cache does not have yet.

    Attributes:
        entry: its folder in the cache.
        folder: temporary folder in which it is compiled.
        command: compiler command.
    """

    entry: Path
    folder: Path
    command: list[str]


def _compile(
    root: Path,
    entry: Path,
    source: Source,
    flags: tuple[str, ...],
    report: OnProgress,
    replace: bool,
) -> None:
    """Compiles a source in a temporary folder, which then becomes the entry.

    Args:
        root: the cache folder.
        entry: folder of the entry.
        source: source files of the library.
        flags: compiler flags beyond the standard ones.
        report: progress callback.
        replace: whether to replace a complete entry, and the object files that it is linked from.
    """
    compiler = find_compiler()
    with contextlib.ExitStack() as stack:
        with _write_errors(root):
            folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        try:
            objects = source.shared_objects()
            compile_commands, link_command = command_lines(
                compiler, source, flags, runtime_folder(), tuple(objects)
            )
            with _write_errors(root):
                write_source(folder, source)
            shared = {
                name: _shared_object(root, object_source, flags, replace, folder / name, stack)
                for name, object_source in objects.items()
            }
            missing = {name: item for name, item in shared.items() if item is not None}
            report(Progress(f"compiling with {compiler.version}"))
            for unit in source.shared_units:
                if f"{Path(unit).name}.o" in missing:
                    report(
                        Progress(f"compiling with {compiler.version} ({unit}, once per machine)")
                    )
            if notice := first_build_notice(compiler):
                # Logged, so that callers without a progress callback see it too.
                _LOGGER.warning(notice)
            with _write_errors(root):
                commands = [(item.command, item.folder) for item in missing.values()]
                run_compilers([*commands, *((command, folder) for command in compile_commands)])
                for name, item in missing.items():
                    shutil.copy(item.folder / LIBRARY, folder / name)
                    seal(item.folder, [item.command])
                    _move_to_entry(item.folder, item.entry, replace)
                run_compiler(link_command, folder)
                for name in [*objects, *(command[-1] for command in compile_commands)]:
                    (folder / name).unlink()
                object_commands = [item.command for item in missing.values()]
                seal(folder, [*object_commands, *compile_commands, link_command])
                _move_to_entry(folder, entry, replace)
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
) -> _MissingObject | None:
    """Copies an object file from the cache; returns what to compile if it is not there.

    Its key is its whole source. If two processes compile the same one, the first to finish wins.
    """
    key = fingerprint(json.dumps(source.files, sort_keys=True), "", (*flags, "-c"))
    entry = root / key[:2] / key
    if not replace and not reason_for_distrust(entry.parent) and _is_usable(entry):
        # Another process may clear the cache at any time.
        with _write_errors(root), contextlib.suppress(FileNotFoundError):
            shutil.copy(entry / LIBRARY, to)
            return None
    _make_parent(root, entry.parent)
    with _write_errors(root):
        folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        write_source(folder, source)
    command = object_command(find_compiler(), source.main, flags, runtime_folder(), LIBRARY)
    return _MissingObject(entry, folder, command)


def _move_to_entry(folder: Path, entry: Path, replace: bool) -> None:
    """Renames a finished folder to its entry, unless another process was first."""
    for _ in range(3):
        try:
            folder.rename(entry)
            return
        except OSError:
            if not entry.exists():
                raise
        if not replace and not reason_for_distrust_of_entry(entry, READ) and is_whole(entry):
            shutil.rmtree(folder, ignore_errors=True)
            return
        # A folder cannot be renamed onto a non-empty one, so the old entry is moved away first.
        temporary = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        with contextlib.suppress(FileNotFoundError):
            entry.rename(temporary / "old")
        shutil.rmtree(temporary, ignore_errors=True)
    raise OSError(f"{entry} cannot be replaced")


@contextlib.contextmanager
def _write_errors(root: Path) -> Iterator[None]:
    """Context in which an OSError becomes an UnusableError of the cache folder."""
    try:
        yield
    except OSError as error:
        reason = str(error) if isinstance(error, DiskError) else (error.strerror or str(error))
        raise UnusableError(f"{root} cannot be written: {reason}") from error


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
        with _write_errors(root):
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
