"""What an import gives: a puppet file, and a report of what it changed or left out."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fantoccini.errors import ExchangeError, Mistake
from fantoccini.files import replacing


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
    """

    text: str
    report: tuple[ImportNote, ...]
    meshes: Mapping[str, bytes]
    joints: tuple[str, ...]

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Writes the puppet file, and its meshes into a folder beside it.

        Each file appears complete or not at all, the puppet file last.

        Args:
            path: of the puppet file.
            force: write over files that exist.

        Raises:
            ExchangeError: a file exists already.
            FileNotFoundError: the folder does not exist.
        """
        place = Path(path)
        files = {place.parent / name: content for name, content in self.meshes.items()}
        files[place] = self.text.encode()
        if not place.parent.is_dir():
            raise FileNotFoundError(f"{place} cannot be written: there is no folder {place.parent}")
        if not force:
            text = "exists already; give another name, or allow to replace it"
            known = [Mistake(str(f), None, "", text) for f in files if f.exists()]
            if known:
                raise ExchangeError(known)
        for file, content in files.items():
            file.parent.mkdir(exist_ok=True)
            with replacing(file) as temporary:
                temporary.write_bytes(content)
