"""Scene files, and files that are a scene or a puppet."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fantoccini.base import PuppetError
from fantoccini.base.documents import Located, described_schema, read_file, read_located, validate
from fantoccini.model.puppet import WORDS, Puppet
from fantoccini.model.scene.assembly import assembled
from fantoccini.model.scene.schema import Scene, is_scene


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file, or a scene file, whose scene it assembles.

    Args:
        path: of a YAML file.

    Raises:
        PuppetError: with every mistake, each with its file and line.
    """
    return _made(read_file(path, PuppetError))


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet or a scene from a text.

    Args:
        text: YAML.
        name: what messages call the text.
        folder: where mesh and puppet files are looked for; by default the current folder.

    Raises:
        PuppetError: with every mistake, each with its file and line.
    """
    return _made(read_located(text, name, folder, PuppetError))


def json_schema() -> dict[str, Any]:
    """JSON Schema of scene files, for editors."""
    return described_schema(Scene, "fantoccini scene")


def _made(located: Located) -> Puppet:
    if is_scene(located):
        return assembled(validate(Scene, located, PuppetError, WORDS))
    return validate(Puppet, located, PuppetError, WORDS)
