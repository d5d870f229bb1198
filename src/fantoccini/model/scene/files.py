"""Scene files, and files that are a scene or a puppet."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fantoccini.base.documents import document_schema, parse_document, read_document
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene.assembly import assembled
from fantoccini.model.scene.schema import PUPPET_OR_SCENE, Scene


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file, or a scene file, whose scene it assembles.

    Args:
        path: of a YAML file.

    Raises:
        PuppetError: with every mistake, each with its file and line.
    """
    return _puppet(read_document(path, *PUPPET_OR_SCENE))


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet or a scene from a text.

    Args:
        text: YAML.
        name: what messages call the text.
        folder: where mesh and puppet files are looked for; by default the current folder.

    Raises:
        PuppetError: with every mistake, each with its file and line.
    """
    return _puppet(parse_document(text, *PUPPET_OR_SCENE, name=name, folder=folder))


def json_schema() -> dict[str, Any]:
    """JSON Schema of scene files, for editors."""
    return document_schema(Scene)


def _puppet(read: Puppet | Scene) -> Puppet:
    return assembled(read) if isinstance(read, Scene) else read
