"""YAML text -> plain data and the line of every key, from the parser's events.

Working on events keeps the reader iterative (no recursion, however deep the file) and lets it
refuse features that puppet files never need: tags, merge keys, keys that are not scalars,
several documents, and aliases that multiply.
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
_WORDS: dict[str, Any] = {w: None for w in ("", "~", "null", "Null", "NULL")}
_WORDS |= {w: True for w in ("true", "True", "TRUE")}
_WORDS |= {w: False for w in ("false", "False", "FALSE")}
_WORDS |= {s + w: math.inf for s in ("", "+") for w in (".inf", ".Inf", ".INF")}
_WORDS |= {"-" + w: -math.inf for w in (".inf", ".Inf", ".INF")}
_WORDS |= {w: math.nan for w in (".nan", ".NaN", ".NAN")}


class Unreadable(Exception):
    """The text cannot be read beyond this point."""

    def __init__(self, line: int | None, path: Path, message: str):
        self.line, self.path, self.message = line, path, message
        super().__init__(line, path, message)

    def __str__(self) -> str:
        return self.message


@dataclass
class Text:
    """The content of a text.

    Attributes:
        data: dicts, lists, strings, numbers, booleans and None.
        lines: path of keys and indices -> 1-based line; the empty path is the first line.
        mistakes: (path, line, message) of mistakes that leave the rest readable.
    """

    data: Any = None
    lines: dict[Path, int] = field(default_factory=dict)
    mistakes: list[tuple[Path, int, str]] = field(default_factory=list)


@dataclass
class _Open:
    """A mapping or list that is still being read."""

    value: Any
    path: Path
    anchor: str | None
    size: int = 1
    key: str | None = None
    skip: bool = False


def read_text(text: str) -> Text:
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
            reader.take(event)
    except YAMLError as error:
        raise _syntax(error, text, reader) from None
    return reader.text


class _Reader:
    """Builds data from events, with an explicit stack."""

    def __init__(self, source: str) -> None:
        self.source_lines = source.splitlines()
        self.text = Text()
        self.stack: list[_Open] = []
        self.anchors: dict[str, tuple[Any, int]] = {}
        self.values = self.copies = 0
        self.documents = 0

    def take(self, event: Any) -> None:
        line = event.start_mark.line + 1
        match type(event).__name__:
            case "DocumentStartEvent":
                self.documents += 1
                if self.documents > 1:
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
            self.key(event.value, line)
            return
        value = _plain(event.value) if event.implicit[0] and not event.style else event.value
        path = self.place(line)
        is_empty = value is None and not event.value
        if is_empty and (colour := self.hidden_colour(self.text.lines[path])):
            self.text.mistakes.append((path, self.text.lines[path], colour))
        self.remember(event.anchor, value, 1)
        self.put(value, path, 1)

    def hidden_colour(self, line: int) -> str:
        """A mistake if a value of a line is a comment that looks like a colour; otherwise empty."""
        match = _COLOUR_COMMENT.search("".join(self.source_lines[line - 1 : line]))
        return f'found no value: # begins a comment; write "{match[1]}"' if match else ""

    def alias(self, event: Any, line: int) -> None:
        if self.expects_key():
            raise Unreadable(line, self.here(), "an alias cannot be a key")
        if event.anchor not in self.anchors:
            text = f"the alias *{event.anchor[:60]} has no finished anchor before it"
            raise Unreadable(line, self.here(), text)
        value, size = self.anchors[event.anchor]
        self.copies += size
        if self.copies > LIMITS.max_alias_values:
            message = f"aliases repeat more than {LIMITS.max_alias_values} values; write them out"
            raise Unreadable(line, self.here(), message)
        self.put(value, self.place(line), size)

    def open(self, event: Any, value: dict[str, Any] | list[Any], line: int) -> None:
        self.refuse_tag(event, line)
        if self.expects_key():
            raise Unreadable(line, self.here(), "a key must be a word, not a mapping or a list")
        if len(self.stack) >= LIMITS.max_depth:
            raise Unreadable(line, (), f"nested deeper than {LIMITS.max_depth} levels")
        self.stack.append(_Open(value, self.place(line), event.anchor))

    def close(self) -> None:
        done = self.stack.pop()
        self.remember(done.anchor, done.value, done.size)
        self.put(done.value, done.path, done.size)

    def key(self, key: str, line: int) -> None:
        top = self.stack[-1]
        path = (*top.path, key)
        top.key, top.skip = key, key in top.value
        if top.skip:
            first = self.text.lines[path]
            self.text.mistakes.append(
                (path, line, f"the key is given twice; the first is in line {first}")
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

    def here(self) -> Path:
        """Path of the next value, or of the open mapping."""
        if not self.stack:
            return ()
        top = self.stack[-1]
        if isinstance(top.value, list):
            return (*top.path, len(top.value))
        return top.path if top.key is None else (*top.path, top.key)

    def place(self, line: int) -> Path:
        path = self.here()
        self.values += 1
        if self.values > LIMITS.max_values:
            raise Unreadable(
                line, path, f"more than {LIMITS.max_values} values, which is the limit"
            )
        self.text.lines.setdefault(path, line)
        return path

    def put(self, value: Any, path: Path, size: int) -> None:
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

    def remember(self, anchor: str | None, value: Any, size: int) -> None:
        if anchor:
            self.anchors[anchor] = (value, size)

    def refuse_tag(self, event: Any, line: int) -> None:
        if event.tag is not None:
            self.text.mistakes.append(
                (self.here(), line, f"found the tag {str(event.tag)[:60]!r}; tags are not read")
            )


def _plain(text: str) -> Any:
    """Value of an unquoted scalar in YAML 1.2's core schema (decimal numbers only)."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text) and len(text) < 16:
        return int(text)
    if _REAL.fullmatch(text):
        return float(text)
    return text


def _syntax(error: Any, text: str, reader: _Reader) -> Unreadable:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is not None:
        for line in (mark.line + 1, mark.line):
            if colour := reader.hidden_colour(line):
                return Unreadable(line, reader.here(), colour)
        what = getattr(error, "problem", None) or getattr(error, "context", None) or "not YAML"
        if "'\\t'" in what:
            what = "found a tab; YAML is indented with spaces"
        return Unreadable(mark.line + 1, reader.here(), f"not YAML: {what}")
    position = getattr(error, "position", None)
    if isinstance(position, int):
        character = text[position : position + 1]
        return Unreadable(
            text.count("\n", 0, position) + 1, (), f"the character {character!r} is not allowed"
        )
    return Unreadable(None, reader.here(), f"not YAML: {str(error).splitlines()[0][:200]}")
