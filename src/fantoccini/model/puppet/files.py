"""Reads puppet files, and gives the schema that editors use."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from fantoccini.base import PuppetError
from fantoccini.base.documents import described_schema, read_file, read_located, validate
from fantoccini.model.puppet.schema import Puppet
from fantoccini.model.puppet.words import WORDS


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file.

    Args:
        path: of a YAML file.

    Raises:
        PuppetError: with every mistake, each with its line.
    """
    return validate(Puppet, read_file(path, PuppetError), PuppetError, WORDS)


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet from a text.

    Args:
        text: YAML.
        name: of the text, for messages.
        folder: where mesh files are looked for; by default the current folder.

    Raises:
        PuppetError: with every mistake, each with its line.
    """
    located = read_located(text, name, folder, PuppetError)
    return validate(Puppet, located, PuppetError, WORDS)


def json_schema() -> dict[str, Any]:
    """JSON Schema of puppet files, for completion and checks in editors."""
    return described_schema(Puppet, "fantoccini puppet")
