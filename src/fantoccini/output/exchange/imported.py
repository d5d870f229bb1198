"""What an import gives: a puppet file, and a report of what it changed or left out."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from fantoccini.base import ExchangeError, Mistake, replacing

MAX_NAME = 64
"""Characters of a name."""


@dataclass(frozen=True)
class ImportNote:
    """Something of a model that its puppet does not have, or has otherwise.

    Attributes:
        file: the model's file, as the user gave it.
        line: 1-based line; None where the reader of the file does not tell.
        kind: of the element, as the file calls it: ``actuator``, ``tendon``.
        name: of the element; empty where it has none.
        message: what became of it.
        part: name of the puppet's part that it concerns; empty for none.
    """

    file: str
    line: int | None
    kind: str
    name: str
    message: str
    part: str = ""

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.what}: {self.message}"

    @property
    def what(self) -> str:
        """Kind and name."""
        return f"{self.kind} {self.name}".rstrip()


@dataclass(frozen=True)
class Imported:
    """A model as a puppet.

    Attributes:
        text: puppet file.
        report: what the puppet does not have, or has otherwise.
        meshes: path beside the puppet file -> content.
        joints: names of the puppet's joints, in the order of the model's: MuJoCo's for MJCF, the
            file's without fixed joints for URDF.
        sources: files that were read.
    """

    text: str
    report: tuple[ImportNote, ...]
    meshes: Mapping[str, bytes]
    joints: tuple[str, ...]
    sources: tuple[Path, ...] = ()

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Writes the puppet file, and its meshes into a folder beside it.

        The folder is called after the puppet file: ``arm_meshes`` beside ``arm.yaml``. Each file
        appears complete or not at all, the puppet file last.

        Args:
            path: of the puppet file.
            force: write over files that exist, but for those that were read.

        Raises:
            ExchangeError: a file exists already, or is part of the model.
            FileNotFoundError: the folder does not exist.
        """
        place = Path(path)
        folder, text = f"{plain_name(place.stem) or 'puppet'}_meshes", self.text
        files = dict[Path, bytes]()
        for name, content in self.meshes.items():
            own = f"{folder}/{PurePosixPath(name).name}"
            text = text.replace(f'file: "{name}"', f'file: "{own}"')
            files[place.parent / own] = content
        files[place] = text.encode()
        if not os.path.isdir(place.parent):
            raise FileNotFoundError(f"{place} cannot be written: there is no folder {place.parent}")
        found = [Mistake(str(f), None, "", why) for f in files if (why := self._kept(f, force))]
        there = place.parent / folder
        if self.meshes and there.exists() and not there.is_dir():
            why = "is a file; the meshes need a folder of this name"
            found.insert(0, Mistake(str(there), None, "", why))
        if found:
            raise ExchangeError(found)
        for file, content in files.items():
            file.parent.mkdir(exist_ok=True)
            with replacing(file) as temporary:
                temporary.write_bytes(content)

    def _kept(self, file: Path, force: bool) -> str:
        """Why a file is not written over; empty where it may be."""
        if not file.exists():
            return ""
        if any(source.exists() and file.samefile(source) for source in self.sources):
            return "is part of the model; give the puppet another name"
        return "" if force else "exists already; replace it with force=True (--force)"


def plain_name(name: str) -> str:
    """The nearest name that a puppet's part can have; empty for none."""
    found = re.sub(r"[^A-Za-z0-9_-]+", "_", name)
    if found and not re.match(r"[A-Za-z_]", found):
        found = f"_{found}"
    return "" if not found.strip("_-") else found[:MAX_NAME]
