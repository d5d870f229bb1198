"""YAML text with other numbers or another section, and plain data as YAML text."""

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

    root = YAML(typ="safe", pure=True).compose(text)
    new_texts = {path: f"{number:.7g}" for path, number in numbers.items()}
    edits = {_edit(root, path, new_texts, text) for path in new_texts}
    for start, end, new_text in sorted(edits, reverse=True):
        text = text[:start] + new_text + text[end:]
    return text


def with_section(text: str, key: str, section: str) -> str:
    """The text with another value of a key at its top, and otherwise unchanged, with all comments.

    The section replaces the key's lines; without the key it is added at the end.

    Args:
        text: YAML in block style.
        key: the key.
        section: YAML in block style, the key with its value.

    Raises:
        StateError: the text is written in braces.
    """
    from ruamel.yaml import YAML

    root = YAML(typ="safe", pure=True).compose(text)
    if root.flow_style:
        raise StateError(f"the file is written in braces, so that {key} cannot be added to it")
    for name, value in root.value:
        if name.value == key:
            start, end = name.start_mark.index, _end(name, value)
            tail = text[end:].removeprefix(text[end:].partition("\n")[0] + "\n")
            return text[:start] + section + tail
    body, end_marker, after_marker = text, "", ""
    if (end := text.rfind("\n...")) >= 0 and not text[end + 4 :].strip():
        body, end_marker, after_marker = text[: end + 1], "...", text[end + 4 :]
    gap = "" if body.endswith("\n") else "\n"
    return f"{body}{gap}{section}{end_marker}{after_marker}"


def yaml_of(data: Any) -> str:
    """YAML text of plain data, also readable as YAML 1.1."""
    from ruamel.yaml import YAML

    writer, stream = YAML(typ="safe", pure=True), io.StringIO()
    writer.default_flow_style, writer.width = None, 10_000
    writer.dump(data, stream)
    return stream.getvalue()


def _edit(node: Any, path: Path, new_texts: Mapping[Path, str], text: str) -> tuple[int, int, str]:
    """Start and end of the text that changes, and the new text."""
    for i, key in enumerate(path):
        child = _child(node, key)
        if child is None:
            siblings = {other: x for other, x in new_texts.items() if other[:-1] == path[:-1]}
            entries = ", ".join(f"{other[-1]}: {x}" for other, x in siblings.items())
            is_last = i == len(path) - 1
            return _entry_edit(
                node, f"{key}: {new_texts[path]}" if is_last else f"{key}: {{{entries}}}"
            )
        node = child
    if isinstance(node.value, list):
        node = _child(node, "value")
    start, end = node.start_mark.index, node.end_mark.index
    try:
        float(text[start:end])
    except ValueError:
        dotted_path = ".".join(map(str, path))
        raise StateError(
            f"{dotted_path} in line {node.start_mark.line + 1} is written as "
            f"{text[start:end]!r:.40}, which other numbers share; write the number out"
        ) from None
    return start, end, new_texts[path]


def _end(*nodes: Any) -> int:
    """End of the last scalar or brace of nodes; comments after it are not included."""
    ends = [0]
    stack = list(nodes)
    while stack:
        node = stack.pop()
        if isinstance(node.value, str) or node.flow_style:
            ends.append(node.end_mark.index)
        else:
            stack += [part for x in node.value for part in (x if isinstance(x, tuple) else (x,))]
    return max(ends)


def _child(node: Any, key: str | int) -> Any | None:
    if isinstance(key, int):
        return node.value[key]
    return next((value for name, value in node.value if name.value == key), None)


def _entry_edit(node: Any, entry: str) -> tuple[int, int, str]:
    """A key that a mapping lacks, before its second key or its only one."""
    if not node.value:
        return node.start_mark.index + 1, node.start_mark.index + 1, entry
    position = node.value[min(1, len(node.value) - 1)][0].start_mark
    separator = ", " if node.flow_style else "\n" + " " * node.value[0][0].start_mark.column
    return position.index, position.index, entry + separator
