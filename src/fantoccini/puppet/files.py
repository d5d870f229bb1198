"""Reads puppet files, and gives the schema that editors use."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from fantoccini.errors import PuppetError
from fantoccini.puppet.located import read_file, read_located, validate
from fantoccini.puppet.schema import Puppet

_BUNDLED = Path(__file__).parent.parent / "puppets"


def bundled(name: str) -> Path | None:
    """The file of a bundled puppet or scene, or None."""
    files = [*_BUNDLED.glob("*.yaml"), *(_BUNDLED / "scenes").glob("*.yaml")]
    return {path.stem: path for path in files}.get(name)


def load(path: str | os.PathLike[str]) -> Puppet:
    """Reads a puppet file.

    Args:
        path: of a YAML file.

    Raises:
        PuppetError: with every mistake, each with its line.
    """
    return validate(Puppet, read_file(path, PuppetError), PuppetError)


def loads(text: str | bytes, name: str = "<string>", folder: Path | None = None) -> Puppet:
    """Reads a puppet from a text.

    Args:
        text: YAML.
        name: of the text, for messages.
        folder: where mesh files are looked for; by default the current folder.

    Raises:
        PuppetError: with every mistake, each with its line.
    """
    return validate(Puppet, read_located(text, name, folder, PuppetError), PuppetError)


def json_schema() -> dict[str, Any]:
    """JSON Schema of puppet files, for completion and checks in editors."""
    return described_schema(Puppet, "fantoccini puppet")


def described_schema(model: type[BaseModel], title: str) -> dict[str, Any]:
    """JSON Schema of a kind of file.

    Args:
        model: of the file.
        title: of the schema.
    """
    schema = model.model_json_schema(by_alias=True)
    for part in schema["$defs"].values():
        if "const" in part.get("properties", {}).get("type", {}):
            # A file always names the shape.
            part["required"] = list(dict.fromkeys(["type", *part.get("required", [])]))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": title,
    }
