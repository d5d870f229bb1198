"""Reads puppet files, and exports their JSON Schema."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fantoccini.base.documents import document_schema, parse_document, read_document
from fantoccini.model.puppet.schema import Puppet


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file.

    Args:
        path: path of a YAML file.

    Raises:
        PuppetError: every mistake, each with its line.
    """
    return read_document(path, Puppet)


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet from a text.

    Args:
        text: YAML text.
        name: name of the text, for messages.
        folder: folder of mesh files; by default the current folder.

    Raises:
        PuppetError: every mistake, each with its line.
    """
    return parse_document(text, Puppet, name=name, folder=folder)


def json_schema() -> dict[str, Any]:
    """JSON Schema of puppet files, for completion and checks in editors."""
    return document_schema(Puppet)
