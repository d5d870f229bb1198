"""Lookup in a puppet's plain data, which may be invalid: parameters, items of lists, texts.

Plain data are the dicts, lists, numbers and texts of a file.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fantoccini.base.documents import Path


def parameters(data: Any) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Path and data of every ``{parameter: ..., value: ...}``, in the order of the file."""
    stack: list[tuple[Path, Any]] = [((), data)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, dict):
            if isinstance(value.get("parameter"), str) and is_number(value.get("value")):
                yield path, value
            stack.extend(((*path, k), v) for k, v in reversed(value.items()))
        elif isinstance(value, list):
            stack.extend(((*path, k), v) for k, v in reversed(list(enumerate(value))))


def is_number(value: Any) -> bool:
    """Whether a value is a number; true and false are not numbers."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def items(data: Any, key: str) -> list[tuple[int, dict[str, Any]]]:
    """Indices and mappings of the list under a key; items of other types are left out."""
    section = data.get(key) if isinstance(data, dict) else None
    if not isinstance(section, list):
        return []
    return [(i, item) for i, item in enumerate(section) if isinstance(item, dict)]


def word(item: Any, key: str) -> str | None:
    """The text under a key; None if there is no text."""
    value = item.get(key) if isinstance(item, dict) else None
    return value if isinstance(value, str) else None
