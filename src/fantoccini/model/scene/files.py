"""Scene files, and files that are a scene or a puppet.

A scene file places puppets, obstacles and free bodies.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fantoccini.base.documents import document_schema, parse_document, read_document
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene.assembly import assembled
from fantoccini.model.scene.schema import PUPPET_OR_SCENE, Scene


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file, or a scene file as one puppet.

    Args:
        path: path of a YAML file.

    Raises:
        PuppetError: every mistake, each with its file and line.
    """
    return _as_puppet(read_document(path, *PUPPET_OR_SCENE))


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet from a text, or a scene as one puppet.

    Args:
        text: YAML text.
        name: name of the text, for messages.
        folder: folder of mesh and puppet files; by default the current folder.

    Raises:
        PuppetError: every mistake, each with its file and line.
    """
    return _as_puppet(parse_document(text, *PUPPET_OR_SCENE, name=name, folder=folder))


def json_schema() -> dict[str, Any]:
    """JSON Schema of scene files, for editors."""
    return document_schema(Scene)


def _as_puppet(puppet_or_scene: Puppet | Scene) -> Puppet:
    return assembled(puppet_or_scene) if isinstance(puppet_or_scene, Scene) else puppet_or_scene
