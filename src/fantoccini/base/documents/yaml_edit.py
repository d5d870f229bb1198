"""YAML text with other numbers, and plain data as YAML text."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

from fantoccini.base import StateError
from fantoccini.base.documents.yaml_text import Path


def with_numbers(text: str, numbers: Mapping[Path, float]) -> str:
    """The text with other numbers at these paths, and otherwise unchanged, including comments.

    A key that its mapping lacks is added. A parameter's number is its ``value``.

    Args:
        text: YAML.
        numbers: path -> number.

    Raises:
        StateError: a number is written as an alias or with an anchor.
    """
    from ruamel.yaml import YAML

    top = YAML(typ="safe", pure=True).compose(text)
    new = {path: f"{number:.7g}" for path, number in numbers.items()}
    edits = {_edit(top, path, new, text) for path in new}
    for start, end, written in sorted(edits, reverse=True):
        text = text[:start] + written + text[end:]
    return text


def yaml_of(data: Any) -> str:
    """YAML text of plain data, also readable as YAML 1.1."""
    from ruamel.yaml import YAML

    yaml, out = YAML(typ="safe", pure=True), io.StringIO()
    yaml.default_flow_style, yaml.width = None, 10_000
    yaml.dump(data, out)
    return out.getvalue()


def _edit(node: Any, path: Path, new: Mapping[Path, str], text: str) -> tuple[int, int, str]:
    """Start and end of the text that changes, and the new text."""
    for i, key in enumerate(path):
        below = _below(node, key)
        if below is None:
            siblings = {other: x for other, x in new.items() if other[:-1] == path[:-1]}
            inner = ", ".join(f"{other[-1]}: {x}" for other, x in siblings.items())
            last = i == len(path) - 1
            return _added(node, f"{key}: {new[path]}" if last else f"{key}: {{{inner}}}")
        node = below
    if isinstance(node.value, list):
        node = _below(node, "value")
    start, end = node.start_mark.index, node.end_mark.index
    try:
        float(text[start:end])
    except ValueError:
        where = ".".join(map(str, path))
        raise StateError(
            f"{where} in line {node.start_mark.line + 1} is written as {text[start:end]!r:.40}, "
            "which other numbers share; write the number out"
        ) from None
    return start, end, new[path]


def _below(node: Any, key: str | int) -> Any | None:
    if isinstance(key, int):
        return node.value[key]
    return next((value for name, value in node.value if name.value == key), None)


def _added(node: Any, entry: str) -> tuple[int, int, str]:
    """A key that a mapping lacks, before its second key or its only one."""
    if not node.value:
        return node.start_mark.index + 1, node.start_mark.index + 1, entry
    mark = node.value[min(1, len(node.value) - 1)][0].start_mark
    gap = ", " if node.flow_style else "\n" + " " * node.value[0][0].start_mark.column
    return mark.index, mark.index, entry + gap
