"""YAML text -> plain data and the line of every key, from the parser's events.

Reading events needs no recursion, however deep the file. It also allows to refuse features that
puppet files never need: tags, merge keys, keys that are not scalars, several documents, and aliases
that repeat too many values.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any

from fantoccini.base.documents.limits import LIMITS

Path = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?[0-9]+")
_REAL = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_COLOUR_COMMENT = re.compile(r":\s+(#(?:[0-9a-fA-F]{3}){1,2})\b")
_CONSTANTS: dict[str, Any] = {w: None for w in ("", "~", "null", "Null", "NULL")}
_CONSTANTS |= {w: True for w in ("true", "True", "TRUE")}
_CONSTANTS |= {w: False for w in ("false", "False", "FALSE")}
_CONSTANTS |= {s + w: math.inf for s in ("", "+") for w in (".inf", ".Inf", ".INF")}
_CONSTANTS |= {"-" + w: -math.inf for w in (".inf", ".Inf", ".INF")}
_CONSTANTS |= {w: math.nan for w in (".nan", ".NaN", ".NAN")}


class Unreadable(Exception):
    """The text cannot be read beyond this point."""

    def __init__(self, line: int | None, path: Path, message: str):
        self.line, self.path, self.message = line, path, message
        super().__init__(line, path, message)

    def __str__(self) -> str:
        return self.message


@dataclass
class ParsedText:
    """Data and lines of a YAML text.

    Attributes:
        data: dicts, lists, strings, numbers, booleans and None.
        lines: path of keys and indices -> 1-based line; the empty path is the first line.
        mistakes: (path, line, message) of mistakes after which reading continued.
    """

    data: Any = None
    lines: dict[Path, int] = field(default_factory=dict)
    mistakes: list[tuple[Path, int, str]] = field(default_factory=list)


@dataclass
class _OpenNode:
    """A mapping or list that is still being read.

    Attributes:
        value: its contents so far.
        path: its path in the file.
        anchor: its anchor, or None.
        size: number of values in it.
        key: key whose value comes next, in a mapping.
        skip: whether to ignore that value.
    """

    value: Any
    path: Path
    anchor: str | None
    size: int = 1
    key: str | None = None
    skip: bool = False


def read_text(text: str) -> ParsedText:
    """Reads YAML 1.2 (core schema).

    Args:
        text: the whole file.

    Raises:
        Unreadable: the text cannot be read any further.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    reader = _Reader(text)
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            reader.read_event(event)
    except YAMLError as error:
        raise _syntax_error(error, text, reader) from None
    return reader.text


class _Reader:
    """Builds data from events, with an explicit stack."""

    def __init__(self, source: str) -> None:
        self.source_lines = source.splitlines()
        self.text = ParsedText()
        self.stack: list[_OpenNode] = []
        self.anchors: dict[str, tuple[Any, int]] = {}
        self.n_values = self.n_alias_values = 0
        self.n_documents = 0

    def read_event(self, event: Any) -> None:
        line = event.start_mark.line + 1
        match type(event).__name__:
            case "DocumentStartEvent":
                self.n_documents += 1
                if self.n_documents > 1:
                    raise Unreadable(line, (), "a second document begins here; one is allowed")
                self.text.lines[()] = line
            case "ScalarEvent":
                self.scalar(event, line)
            case "AliasEvent":
                self.alias(event, line)
            case "MappingStartEvent":
                self.open(event, {}, line)
            case "SequenceStartEvent":
                self.open(event, [], line)
            case "MappingEndEvent" | "SequenceEndEvent":
                self.close()

    def scalar(self, event: Any, line: int) -> None:
        self.refuse_tag(event, line)
        if self.expects_key():
            self.add_key(event.value, line)
            return
        value = _scalar_value(event.value) if event.implicit[0] and not event.style else event.value
        path = self.new_path(line)
        is_empty = value is None and not event.value
        if is_empty and (colour := self.hidden_colour(self.text.lines[path])):
            self.text.mistakes.append((path, self.text.lines[path], colour))
        self.store_anchor(event.anchor, value, 1)
        self.add(value, path, 1)

    def hidden_colour(self, line: int) -> str:
        """Message if a line has an unquoted colour in place of a value; otherwise empty."""
        match = _COLOUR_COMMENT.search("".join(self.source_lines[line - 1 : line]))
        return f'found no value: # begins a comment; write "{match[1]}"' if match else ""

    def alias(self, event: Any, line: int) -> None:
        if self.expects_key():
            raise Unreadable(line, self.path(), "an alias cannot be a key")
        if event.anchor not in self.anchors:
            text = f"the alias *{event.anchor[:60]} needs an anchor before it, outside of its value"
            raise Unreadable(line, self.path(), text)
        value, size = self.anchors[event.anchor]
        self.n_alias_values += size
        if self.n_alias_values > LIMITS.max_alias_values:
            message = f"aliases repeat more than {LIMITS.max_alias_values} values; write them out"
            raise Unreadable(line, self.path(), message)
        self.add(value, self.new_path(line), size)

    def open(self, event: Any, value: dict[str, Any] | list[Any], line: int) -> None:
        self.refuse_tag(event, line)
        if self.expects_key():
            raise Unreadable(line, self.path(), "a key must be a word, not a mapping or a list")
        if len(self.stack) >= LIMITS.max_depth:
            raise Unreadable(line, (), f"nested deeper than {LIMITS.max_depth} levels")
        self.stack.append(_OpenNode(value, self.new_path(line), event.anchor))

    def close(self) -> None:
        node = self.stack.pop()
        self.store_anchor(node.anchor, node.value, node.size)
        self.add(node.value, node.path, node.size)

    def add_key(self, key: str, line: int) -> None:
        top = self.stack[-1]
        path = (*top.path, key)
        top.key, top.skip = key, key in top.value
        if top.skip:
            first_line = self.text.lines[path]
            self.text.mistakes.append(
                (path, line, f"the key is given twice; the first is in line {first_line}")
            )
        elif key == "<<":
            top.skip = True
            self.text.mistakes.append((path, line, "merge keys are not read; write the keys out"))
        else:
            self.text.lines[path] = line
            top.value[key] = None

    def expects_key(self) -> bool:
        return (
            bool(self.stack)
            and isinstance(self.stack[-1].value, dict)
            and (self.stack[-1].key is None)
        )

    def path(self) -> Path:
        """Path of the next value, or of the open mapping."""
        if not self.stack:
            return ()
        top = self.stack[-1]
        if isinstance(top.value, list):
            return (*top.path, len(top.value))
        return top.path if top.key is None else (*top.path, top.key)

    def new_path(self, line: int) -> Path:
        """Path of a value that begins on a line."""
        path = self.path()
        self.n_values += 1
        if self.n_values > LIMITS.max_values:
            raise Unreadable(
                line, path, f"more than {LIMITS.max_values} values, which is the limit"
            )
        self.text.lines.setdefault(path, line)
        return path

    def add(self, value: Any, path: Path, size: int) -> None:
        """Adds a finished value to the mapping or list that contains it."""
        if not self.stack:
            self.text.data = value
            return
        top = self.stack[-1]
        top.size += size
        if isinstance(top.value, list):
            top.value.append(value)
            return
        if not top.skip and top.key is not None:
            top.value[top.key] = value
        top.key, top.skip = None, False

    def store_anchor(self, anchor: str | None, value: Any, size: int) -> None:
        if anchor:
            self.anchors[anchor] = (value, size)

    def refuse_tag(self, event: Any, line: int) -> None:
        if event.tag is not None:
            self.text.mistakes.append(
                (self.path(), line, f"found the tag {str(event.tag)[:60]!r}; tags are not read")
            )


def _scalar_value(text: str) -> Any:
    """Value of an unquoted scalar in YAML 1.2's core schema (decimal numbers only)."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _INTEGER.fullmatch(text) and len(text) < 16:
        return int(text)
    if _REAL.fullmatch(text):
        return float(text)
    return text


def _syntax_error(error: Any, text: str, reader: _Reader) -> Unreadable:
    """The parser's error with line, path and message."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is not None:
        for line in (mark.line + 1, mark.line):
            if colour := reader.hidden_colour(line):
                return Unreadable(line, reader.path(), colour)
        reason = getattr(error, "problem", None) or getattr(error, "context", None) or "not YAML"
        if "'\\t'" in reason:
            reason = "found a tab; YAML is indented with spaces"
        return Unreadable(mark.line + 1, reader.path(), f"not YAML: {reason}")
    position = getattr(error, "position", None)
    if isinstance(position, int):
        character = text[position : position + 1]
        return Unreadable(
            text.count("\n", 0, position) + 1, (), f"the character {character!r} is not allowed"
        )
    return Unreadable(None, reader.path(), f"not YAML: {str(error).splitlines()[0][:200]}")
