"""The build of an entry: objects that libraries share, the library's own units, and linking."""

from __future__ import annotations

import contextlib
import json
import logging
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from fantoccini.base import BuildError, OnProgress, Progress
from fantoccini.kernel.build.compiler import (
    Compiler,
    Compilers,
    DiskError,
    command_lines,
    find_compiler,
    first_build_notice,
    object_command,
    run_compiler,
)
from fantoccini.kernel.build.entry import LIBRARY, READ, Source, is_whole, seal, write_source
from fantoccini.kernel.build.folders import (
    UnusableError,
    reason_for_distrust,
    reason_for_distrust_of_entry,
)
from fantoccini.kernel.build.key import fingerprint, runtime_folder

Flags = Callable[[Source], tuple[str, ...]] | tuple[str, ...]

_LOGGER = logging.getLogger(__name__)


class Derivation(NamedTuple):
    """The source of a library, in two steps.

    Attributes:
        early: the shared objects that are known first: object file -> its source.
        whole: the whole source, derived while the early objects are compiled.
    """

    early: Callable[[], dict[str, Source]]
    whole: Callable[[], Source]


def build_entry(
    root: Path, entry: Path, derivation: Derivation, flags: Flags, report: OnProgress, replace: bool
) -> None:
    """Compiles a source in a temporary folder, which then becomes the entry.

    Args:
        root: the cache folder.
        entry: folder of the entry.
        derivation: source of the library.
        flags: compiler flags beyond the standard ones, or a function that chooses them.
        report: progress callback.
        replace: whether to replace a complete entry, and the object files that it is linked from.
    """
    with contextlib.ExitStack() as stack:
        with write_errors(root):
            folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
        try:
            with Compilers() as compilers:
                objects = _SharedObjects(root, folder, flags, replace, compilers, stack)
                commands = _compile(derivation, objects, report)
            with write_errors(root):
                seal(folder, commands)
                move_to_entry(folder, entry, replace)
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


def _compile(
    derivation: Derivation, objects: _SharedObjects, report: OnProgress
) -> list[list[str]]:
    """Compiles and links a library in the folder of the objects; returns the commands."""
    compiler, folder = find_compiler(), objects.to
    if notice := first_build_notice(compiler):
        # Logged, so that callers without a progress callback see it too.
        _LOGGER.warning(notice)
    objects.begin(derivation.early())
    source = derivation.whole()
    object_sources = source.shared_objects()
    compile_commands, link_command = command_lines(
        compiler, source, _chosen(objects.flags, source), runtime_folder(), tuple(object_sources)
    )
    with write_errors(objects.root):
        write_source(folder, source)
    objects.begin(object_sources)
    _report_compilers(compiler, source, objects, report)
    with write_errors(objects.root):
        for command in compile_commands:
            objects.compilers.start(command, folder)
        objects.compilers.wait()
        object_commands = objects.store()
        run_compiler(link_command, folder)
        for name in [*object_sources, *(command[-1] for command in compile_commands)]:
            (folder / name).unlink()
    return [*object_commands, *compile_commands, link_command]


def _report_compilers(
    compiler: Compiler, source: Source, objects: _SharedObjects, report: OnProgress
) -> None:
    """Reports that compilers run, and what is compiled once per machine."""
    report(Progress(f"compiling with {compiler.version}"))
    for unit in source.shared_units:
        if f"{Path(unit).name}.o" in objects.missing:
            report(Progress(f"compiling with {compiler.version} ({unit}, once per machine)"))


def _chosen(flags: Flags, source: Source) -> tuple[str, ...]:
    return flags(source) if callable(flags) else flags


class _MissingObject(NamedTuple):
    """An object file, shared by several libraries, that the cache does not have yet.

    Attributes:
        entry: its folder in the cache.
        folder: temporary folder in which it is compiled.
        command: compiler command.
    """

    entry: Path
    folder: Path
    command: list[str]


@dataclass(frozen=True)
class _SharedObjects:
    """The object files that a library shares with others: copied from the cache, or compiled.

    Attributes:
        root: the cache folder.
        to: folder of the library's build.
        flags: see :func:`build_entry`.
        replace: whether to compile objects that the cache has.
        compilers: compilers that run at the same time.
        stack: removes temporary folders.
        sources: source of every object begun so far, by the name of its file.
        missing: the objects that are compiled, by the name of their file.
    """

    root: Path
    to: Path
    flags: Flags
    replace: bool
    compilers: Compilers
    stack: contextlib.ExitStack
    sources: dict[str, tuple[Source, tuple[str, ...]]] = field(default_factory=dict)
    missing: dict[str, _MissingObject] = field(default_factory=dict)

    def begin(self, sources: dict[str, Source]) -> None:
        """Copies or begins to compile the objects that have not been begun."""
        for name, source in sources.items():
            flags = _chosen(self.flags, source)
            if self.sources.get(name) != (source, flags):
                self.sources[name] = source, flags
                self.missing.pop(name, None)
                self._begin(name, source, flags)

    def _begin(self, name: str, source: Source, flags: tuple[str, ...]) -> None:
        """The key of an object is its whole source."""
        key = fingerprint(json.dumps(source.files, sort_keys=True), "", (*flags, "-c"))
        entry = self.root / key[:2] / key
        if not self.replace and not reason_for_distrust(entry.parent) and is_usable(entry):
            # Another process may clear the cache at any time.
            with write_errors(self.root), contextlib.suppress(FileNotFoundError):
                shutil.copy(entry / LIBRARY, self.to / name)
                return
        make_parent(self.root, entry.parent)
        with write_errors(self.root):
            folder = Path(tempfile.mkdtemp(prefix="tmp-", dir=entry.parent))
            self.stack.callback(shutil.rmtree, folder, ignore_errors=True)
            write_source(folder, source)
        command = object_command(find_compiler(), source.main, flags, runtime_folder(), LIBRARY)
        self.missing[name] = _MissingObject(entry, folder, command)
        self.compilers.start(command, folder)

    def store(self) -> list[list[str]]:
        """Copies the compiled objects and moves them to the cache; returns their commands.

        If two processes compile the same one, the first to finish wins.
        """
        for name, item in self.missing.items():
            shutil.copy(item.folder / LIBRARY, self.to / name)
            seal(item.folder, [item.command])
            move_to_entry(item.folder, item.entry, self.replace)
        return [item.command for item in self.missing.values()]


def is_usable(entry: Path) -> bool:
    """Whether an entry is complete and trusted; warns of one that other users can change."""
    if reason := reason_for_distrust_of_entry(entry, READ):
        warnings.warn(f"{reason}; the puppet is compiled again", RuntimeWarning, stacklevel=2)
        return False
    return is_whole(entry)


def make_parent(root: Path, parent: Path) -> None:
    """Creates the parent folder of an entry."""
    with write_errors(root):
        # One after the other: mkdir applies the mode only to the last folder.
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        parent.mkdir(mode=0o700, exist_ok=True)
    if reason := reason_for_distrust(root) or reason_for_distrust(parent):
        raise UnusableError(reason)


def move_to_entry(folder: Path, entry: Path, replace: bool) -> None:
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
def write_errors(root: Path) -> Iterator[None]:
    """Context in which an OSError becomes an UnusableError of the cache folder."""
    try:
        yield
    except OSError as error:
        reason = str(error) if isinstance(error, DiskError) else (error.strerror or str(error))
        raise UnusableError(f"{root} cannot be written: {reason}") from error
