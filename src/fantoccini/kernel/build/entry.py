"""An entry of the cache: a folder with a library, its sources and a checksum.

    <key>/model.so       the shared library
    <key>/info.json      facts from the generator
    <key>/complete.json  size and SHA-256 of the library, written last
    <key>/...            the sources

An entry is written under a temporary name and renamed: a folder with an entry's name is complete or
was damaged afterwards, which ``complete.json`` reveals.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

LIBRARY = "model.so"
INFO = "info.json"
COMPLETE = "complete.json"
READ = (LIBRARY, INFO, COMPLETE)
"""Files of an entry that are read; the sources are for inspection."""

_FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True)
class Source:
    """The source of a library.

    Attributes:
        files: plain file name -> text.
        main: file to compile; it may include the others.
        units: further files to compile and link, all with ``FAN_APART`` defined.
        pieces: files that only the units include where ``FAN_APART`` is defined.
        info: facts to keep as ``info.json``.
        shared_units: runtime headers, without the suffix, that are compiled once per machine and
            linked to the library.

    Raises:
        ValueError: a name that is no plain file name, or names a file that is not there.
    """

    files: dict[str, str]
    main: str
    info: dict[str, Any] = field(default_factory=dict)
    units: tuple[str, ...] = ()
    pieces: tuple[str, ...] = ()
    shared_units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.files:
            if not _FILE_NAME.fullmatch(name) or name in READ:
                raise ValueError(f"{name!r} cannot be the name of a source file")
        if self.main not in self.files:
            raise ValueError(f"the main file {self.main!r} is not among the files")
        if missing := [name for name in self.units if name not in self.files]:
            raise ValueError(f"the unit {missing[0]!r} is not among the files")

    def shared_objects(self) -> dict[str, Source]:
        """Object file -> its source, for the object files that several libraries share.

        These are the shared units, and the main file where there are units: it is the same for
        puppets that differ in nothing but numbers.
        """
        own_files = {*self.units, *self.pieces}
        files = {name: text for name, text in self.files.items() if name not in own_files}
        objects = early_objects(files, self.main, self.shared_units)
        if not self.units:
            del objects[_object_name(self.main)]
        return objects


def early_objects(
    files: dict[str, str], main: str, shared_units: Iterable[str]
) -> dict[str, Source]:
    """Object file -> its source, for a main file and the runtime headers linked to it.

    Args:
        files: the main file, and the files that it includes where ``FAN_APART`` is defined.
        main: name of the main file.
        shared_units: see :class:`Source`.
    """
    headers = {
        _object_name(unit): Source({"unit.cpp": f'#include "fantoccini/{unit}.hpp"\n'}, "unit.cpp")
        for unit in shared_units
    }
    return {_object_name(main): Source(files, main)} | headers


def _object_name(file: str) -> str:
    return f"{Path(file).stem}.o"


def write_source(folder: Path, source: Source) -> None:
    """Writes the sources and ``info.json`` into a folder."""
    for name, text in source.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / INFO).write_text(json.dumps(source.info, indent=1), encoding="utf-8")


def seal(folder: Path, commands: list[list[str]]) -> None:
    """Writes ``complete.json``, after the library has reached the disk.

    Args:
        folder: the entry under its temporary name.
        commands: commands that compiled the library, for information.
    """
    with open(folder / LIBRARY, "rb+") as library:
        content = library.read()
        os.fsync(library.fileno())
    complete = {
        "size": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
        "commands": commands,
    }
    with open(folder / COMPLETE, "w", encoding="utf-8") as out:
        json.dump(complete, out, indent=1)
        out.flush()
        os.fsync(out.fileno())
    for name in READ:
        # The umask may let others write.
        (folder / name).chmod(0o700 if name == LIBRARY else 0o600)


def is_whole(folder: Path) -> bool:
    """Whether a folder is an entry with an undamaged library.

    The hash is always compared: it takes a millisecond, and loading a damaged library may crash the
    process.
    """
    try:
        complete = json.loads((folder / COMPLETE).read_text(encoding="utf-8"))
        library = folder / LIBRARY
        if library.stat().st_size != complete["size"] or not (folder / INFO).is_file():
            return False
        return hashlib.sha256(library.read_bytes()).hexdigest() == complete["sha256"]
    except (OSError, ValueError, TypeError, KeyError):
        return False
