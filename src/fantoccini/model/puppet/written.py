"""Places in a puppet's plain data, of any form: parameters, items of lists, texts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fantoccini.base.documents import Path


def parameters(data: Any) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Every ``{parameter: ..., value: ...}`` with its place, in file order."""
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
    """Whether a value is a number; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def items(data: Any, key: str) -> list[tuple[int, dict[str, Any]]]:
    """The mappings in a list under a key, with their places."""
    section = data.get(key) if isinstance(data, dict) else None
    if not isinstance(section, list):
        return []
    return [(i, item) for i, item in enumerate(section) if isinstance(item, dict)]


def word(item: Any, key: str) -> str | None:
    """The text under a key, or None."""
    value = item.get(key) if isinstance(item, dict) else None
    return value if isinstance(value, str) else None
