"""Reads puppet files, and gives the schema that editors use."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fantoccini.base.documents import document_schema, parse_document, read_document
from fantoccini.model.puppet.schema import Puppet


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file.

    Args:
        path: of a YAML file.

    Raises:
        PuppetError: with every mistake, each with its line.
    """
    return read_document(path, Puppet)


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet from a text.

    Args:
        text: YAML.
        name: of the text, for messages.
        folder: where mesh files are looked for; by default the current folder.

    Raises:
        PuppetError: with every mistake, each with its line.
    """
    return parse_document(text, Puppet, name=name, folder=folder)


def json_schema() -> dict[str, Any]:
    """JSON Schema of puppet files, for completion and checks in editors."""
    return document_schema(Puppet)
