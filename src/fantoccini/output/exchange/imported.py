"""Result of an import: a puppet file, and a report of changes and omissions.

A model is the description of bodies and joints in files of another program.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from fantoccini.base import ExchangeError, Mistake, replacing

MAX_NAME_LENGTH = 64
"""Largest length of a name [characters]."""


@dataclass(frozen=True)
class ImportNote:
    """Difference between a model and its puppet.

    Attributes:
        file: file of the model, as the user gave it.
        line: 1-based line; None if unknown.
        kind: kind of the element, as in the file: ``actuator``, ``tendon``.
        name: name of the element; empty if it has none.
        message: description of the difference.
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
        """Kind and name of the element."""
        return f"{self.kind} {self.name}".rstrip()


@dataclass(frozen=True)
class ImportedPuppet:
    """A model as a puppet.

    Attributes:
        text: text of the puppet file.
        report: differences from the model.
        meshes: path relative to the puppet file -> content.
        joints: names of the puppet's joints, in the model's order: MuJoCo's for MJCF, that of the
            file without fixed joints for URDF.
        sources: files that were read.
    """

    text: str
    report: tuple[ImportNote, ...]
    meshes: Mapping[str, bytes]
    joints: tuple[str, ...]
    sources: tuple[Path, ...] = ()

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Writes the puppet file, and its meshes into a folder beside it.

        The folder is named after the puppet file: ``arm_meshes`` beside ``arm.yaml``. Each file
        appears only when complete, the puppet file last.

        Args:
            path: path of the puppet file.
            force: overwrite existing files, except those that were read.

        Raises:
            ExchangeError: a file exists already, or is part of the model.
            FileNotFoundError: the folder of the puppet file does not exist.
        """
        puppet_path = Path(path)
        folder, text = f"{valid_name(puppet_path.stem) or 'puppet'}_meshes", self.text
        files = dict[Path, bytes]()
        for name, content in self.meshes.items():
            new_name = f"{folder}/{PurePosixPath(name).name}"
            text = text.replace(f'file: "{name}"', f'file: "{new_name}"')
            files[puppet_path.parent / new_name] = content
        files[puppet_path] = text.encode()
        if not os.path.isdir(puppet_path.parent):
            raise FileNotFoundError(
                f"{puppet_path} cannot be written: there is no folder {puppet_path.parent}"
            )
        mistakes = [
            Mistake(str(f), None, "", reason)
            for f in files
            if (reason := self._why_protected(f, force))
        ]
        mesh_folder = puppet_path.parent / folder
        if self.meshes and mesh_folder.exists() and not mesh_folder.is_dir():
            reason = "is a file; the meshes need a folder of this name"
            mistakes.insert(0, Mistake(str(mesh_folder), None, "", reason))
        if mistakes:
            raise ExchangeError(mistakes)
        for file, content in files.items():
            file.parent.mkdir(exist_ok=True)
            with replacing(file) as temporary:
                temporary.write_bytes(content)

    def _why_protected(self, file: Path, force: bool) -> str:
        """Reason not to overwrite a file; empty if it may be written."""
        if not file.exists():
            return ""
        if any(source.exists() and file.samefile(source) for source in self.sources):
            return "is part of the model; give the puppet another name"
        return "" if force else "exists already; replace it with force=True (--force)"


def valid_name(name: str) -> str:
    """Nearest valid name of a part of a puppet; empty if there is none."""
    candidate = re.sub(r"[^A-Za-z0-9_-]+", "_", name)
    if candidate and not re.match(r"[A-Za-z_]", candidate):
        candidate = f"_{candidate}"
    return "" if not candidate.strip("_-") else candidate[:MAX_NAME_LENGTH]
