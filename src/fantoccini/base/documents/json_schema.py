"""JSON Schema of the files that people write, for editors."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel


def described_schema(model: type[BaseModel], title: str) -> dict[str, Any]:
    """JSON Schema of a kind of file.

    Args:
        model: pydantic model of the file.
        title: title of the schema.
    """
    schema = model.model_json_schema(by_alias=True)
    for part in schema.get("$defs", {}).values():
        if "const" in part.get("properties", {}).get("type", {}):
            # `type` has a default in Python but must be given in a file.
            part["required"] = list(dict.fromkeys(["type", *part.get("required", [])]))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": title}
