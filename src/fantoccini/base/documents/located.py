"""Text -> validated model, with the line of every mistake; independent of puppets.

Every mistake reads ``file:line: key.path: what was found, what is allowed, nearest valid name``,
and all mistakes of a file are collected before an error is raised.

Plain data are dicts, lists, numbers and texts; a model is a class of pydantic.
"""

from __future__ import annotations

import copy
import math
import os
import re
import reprlib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath, PurePosixPath
from typing import Any, NamedTuple, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from fantoccini.base import FileError, Mistake, StateError, did_you_mean
from fantoccini.base.documents.limits import LIMITS
from fantoccini.base.documents.yaml_text import Path, Unreadable, read_text

Finding = tuple[Path, str]
"""Path of keys and indices, and message."""

ModelT = TypeVar("ModelT", bound=BaseModel)


def _no_advice(key: str, allowed: Collection[str]) -> str | None:
    return None


class Words(NamedTuple):
    """Synonyms from other programs, for hints in error messages.

    Attributes:
        own: another program's name -> the name in our files.
        advice: unknown key, allowed keys -> a helpful sentence, or None.
    """

    own: Mapping[str, str] = {}
    advice: Callable[[str, Collection[str]], str | None] = _no_advice


NO_WORDS = Words()


@dataclass(frozen=True)
class Located:
    """Plain data and its location. All compare equal: documents do not differ by location.

    Attributes:
        data: dicts, lists and scalars.
        file: the file's name as the user gave it.
        folder: base of relative paths in the file.
        lines: path of keys and indices -> 1-based line; empty for data built in Python.
        mistakes: mistakes found while reading that left the rest readable.
    """

    data: Any = field(default=None, compare=False)
    file: str = field(default="<python>", compare=False)
    folder: FilePath = field(default_factory=FilePath.cwd, compare=False)
    lines: dict[Path, int] = field(default_factory=dict, compare=False)
    mistakes: tuple[Mistake, ...] = field(default=(), compare=False)

    def line(self, path: Path) -> int | None:
        """Line of a path, or of the innermost parent that has one."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path)

    def file_in_folder(self, name: str) -> FilePath | None:
        """A file in this one's folder or below it; None if it does not exist."""
        path = PurePosixPath(name)
        is_plain_name = (
            name.isprintable() and "\\" not in name and ":" not in name and len(name) < 256
        )
        if not is_plain_name or not path.parts or path.is_absolute() or ".." in path.parts:
            return None
        file = (self.folder / path).resolve()
        is_inside = file.is_relative_to(self.folder.resolve()) and os.path.isfile(file)
        return file if is_inside else None

    def required(self, name: str) -> FilePath:
        """A file in this one's folder or below it.

        Raises:
            StateError: there is none.
        """
        file = self.file_in_folder(name)
        if file is None:
            raise StateError(f"found {shown(name)}: no file in this one's folder")
        return file

    def problem(self, path: Path, message: str) -> Mistake:
        """A mistake at a path."""
        return Mistake(self.file, self.line(path), key_path(path), message)

    def error(self, findings: Iterable[Finding], error: type[FileError]) -> FileError:
        """All mistakes in file order, including those of reading."""
        mistakes = [*self.mistakes, *(self.problem(p, m) for p, m in findings)]
        mistakes = sorted(dict.fromkeys(mistakes), key=lambda p: p.line or 0)
        n_unlisted = len(mistakes) - LIMITS.max_mistakes
        if n_unlisted > 0:
            summary = Mistake(self.file, None, "", f"and {n_unlisted} more")
            mistakes = [*mistakes[: LIMITS.max_mistakes], summary]
        return error(mistakes)


@dataclass(frozen=True)
class Origin:
    """Location of an object in files. All origins compare equal, so that equal objects do.

    Attributes:
        file: the file's name as the user gave it.
        folder: base of relative paths in the file.
        lines: name -> 1-based line.
        files: name -> file, for names in other files.
    """

    file: str = field(default="<python>", compare=False)
    folder: FilePath = field(default_factory=FilePath.cwd, compare=False)
    lines: dict[str, int] = field(default_factory=dict, compare=False)
    files: dict[str, str] = field(default_factory=dict, compare=False)


def read_file(path: str | os.PathLike[str], error: type[FileError] = FileError) -> Located:
    """Reads a YAML file.

    Args:
        path: path of the file.
        error: exception class to raise.
    """
    name = os.fspath(path)
    try:
        file_path = FilePath(name)
        if not file_path.is_file():
            kind = (
                "a folder"
                if file_path.is_dir()
                else "nothing"
                if not file_path.exists()
                else "no file"
            )
            raise error([Mistake(name, None, "", f"found {kind} here; a YAML file is needed")])
        with file_path.open("rb") as stream:
            content = stream.read(LIMITS.max_file_bytes + 1)
        folder = file_path.resolve().parent
    except (OSError, ValueError) as reason:
        text = getattr(reason, "strerror", None) or str(reason)
        raise error([Mistake(name, None, "", f"cannot be read: {text}")]) from None
    return read_located(content, name, folder, error)


def read_located(
    text: str | bytes, file: str, folder: FilePath | None = None, error: type[FileError] = FileError
) -> Located:
    """Reads YAML text.

    Args:
        text: the file's content.
        file: its name, for messages.
        folder: base of relative paths in the file; the current folder by default.
        error: class of the error for an unreadable text.
    """

    def file_error(line: int | None, path: Path, message: str) -> FileError:
        return error([Mistake(file, line, key_path(path), message)])

    if len(text) > LIMITS.max_file_bytes:
        raise file_error(
            None, (), f"larger than {LIMITS.max_file_bytes / 1e6:g} MB, which is the limit"
        )
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8-sig")
        except UnicodeDecodeError as reason:
            line = reason.object.count(b"\n", 0, reason.start) + 1
            byte = reason.object[reason.start]
            raise file_error(
                line, (), f"found the byte 0x{byte:02x}; the file must be UTF-8"
            ) from None
    try:
        parsed = read_text(text)
    except Unreadable as reason:
        raise file_error(reason.line, reason.path, reason.message) from None
    if parsed.data is None:
        raise file_error(1, (), "the file is empty")
    mistakes = tuple(Mistake(file, line, key_path(p), m) for p, line, m in parsed.mistakes)
    return Located(parsed.data, file, folder or FilePath.cwd(), parsed.lines, mistakes)


def has_key(path: str | os.PathLike[str], key: str) -> bool:
    """Whether a file is YAML with a key at its top, such as ``score`` or ``play``."""
    if not os.fspath(path).lower().endswith((".yaml", ".yml")):
        return False
    try:
        data = read_file(path).data
    except (FileError, OSError):
        return False
    return isinstance(data, dict) and key in data


def validate(
    model: type[ModelT],
    located: Located,
    error: type[FileError] = FileError,
    words: Words = NO_WORDS,
) -> ModelT:
    """The model's instance for located data; all mistakes in one error.

    Args:
        model: a pydantic model; ``located`` is its validation context.
        located: result of ``read_located``.
        error: class of the error.
        words: hints for words of other programs.
    """
    try:
        instance = model.model_validate(located.data, context=located)
    except ValidationError as reason:
        raise located.error(findings(model, located.data, reason, words), error) from None
    if located.mistakes:
        raise located.error((), error)
    return instance


def findings(
    model: type[BaseModel], data: Any, error: ValidationError, words: Words = NO_WORDS
) -> list[Finding]:
    """Pydantic's errors as findings.

    Args:
        model: the model.
        data: plain data that was validated.
        error: raised by pydantic.
        words: hints for words of other programs.
    """
    located_messages = []
    for k, item in enumerate(error.errors(include_url=False)):
        path, leaf = data_path(data, item["loc"], item["type"])
        if item["type"] in ("union_tag_invalid", "union_tag_not_found"):
            path = (*path, item["ctx"]["discriminator"].strip("'"))
        # Hints are slow, and only these mistakes are shown.
        hints = words if k < LIMITS.max_mistakes else None
        located_messages.append((path, _message_of(model, item, leaf, hints)))
    return located_messages


def mended(data: Any, error: ValidationError) -> Any | None:
    """A copy of plain data with numbers out of range replaced by allowed ones.

    Args:
        data: plain data.
        error: raised by pydantic on validation of the data.

    Returns:
        None if no mistake comes with a replacement.
    """
    mended_data = None
    for item in error.errors(include_url=False):
        allowed_value = item.get("ctx", {}).get("instead")
        path, _ = data_path(data, item["loc"], item["type"])
        if allowed_value is None or not path:
            continue
        mended_data = copy.deepcopy(data) if mended_data is None else mended_data
        container = mended_data
        for part in path[:-1]:
            container = container[part]
        if isinstance(container[path[-1]], dict):
            container, path = container[path[-1]], ("value",)
        container[path[-1]] = allowed_value
    return mended_data


def key_path(path: Path) -> str:
    """``("bodies", 2, "joint")`` -> ``bodies[2].joint``; other keys are quoted and cut."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        elif re.fullmatch(r"[\w-]{1,64}(\.[\w-]{1,64})?", part, re.ASCII):
            text += f".{part}" if text else part
        else:
            text += f"[{shown(part)}]"
    return text


_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60


def shown(value: Any) -> str:
    """A value as text for a message: on one line and short."""
    if isinstance(value, BaseModel):
        return type(value).__name__
    if isinstance(value, float) and not math.isfinite(value):
        return {math.inf: "inf", -math.inf: "-inf"}.get(value, "nan")
    if isinstance(value, int) and value.bit_length() > 1000:
        # Python writes no more than 4300 digits.
        return f"a whole number of some {value.bit_length() * 3 // 10} digits"
    return (
        {None: "nothing", True: "true", False: "false"}.get(value, "")
        if (value is None or isinstance(value, bool))
        else _short.repr(value)
    )


def data_path(data: Any, loc: tuple[str | int, ...], kind: str = "fantoccini") -> tuple[Path, str]:
    """A location without parts that are not keys of the data, such as branches of a union."""
    path: list[str | int] = []
    for k, part in enumerate(loc):
        last = k == len(loc) - 1
        in_list = isinstance(data, list | tuple) and isinstance(part, int) and part < len(data)
        if in_list or (isinstance(data, dict) and part in data):
            data = data[part]
        elif not (last and kind in ("missing", "fantoccini") and _is_key(data, part)):
            continue
        path.append(part)
    return tuple(path), str(loc[-1]) if loc else ""


def _is_key(data: Any, part: Any) -> bool:
    """Whether the last part of a location is a key that is absent, not a branch of a union."""
    is_name = isinstance(part, str) and not part.startswith("<")
    return is_name and isinstance(data, dict) and data.get("type") != part


_NEEDED_BY_TYPE = {
    "model_type": "a mapping of keys and values",
    "dict_type": "a mapping of keys and values",
    "tuple_type": "a list",
    "list_type": "a list",
    "string_type": "a text",
    "bool_type": "true or false",
    "none_required": "nothing",
}


def _message_of(model: type[BaseModel], item: Any, leaf: str, words: Words | None) -> str:
    kind, input_text, context = item["type"], shown(item["input"]), item.get("ctx", {})
    if kind == "fantoccini":
        return item["msg"]
    if kind == "extra_forbidden":
        if words is None:
            return "this key is not known"
        keys = allowed_keys(model, item["loc"][:-1])
        return words.advice(leaf, keys) or f"this key is not known{did_you_mean(leaf[:64], keys)}"
    if kind in ("missing", "union_tag_not_found"):
        return "this key is missing"
    if kind == "literal_error" or kind == "union_tag_invalid":
        text = context.get("expected") or context["expected_tags"]
        names = re.findall(r"'([^']*)'", text)
        value = item["input"] if kind == "literal_error" else context["tag"]
        hint = "" if words is None else _synonym_hint(value, names, words)
        return f"found {shown(value)}; allowed: {', '.join(names)}{hint}"
    if kind in _NEEDED_BY_TYPE or kind.endswith("_type"):
        return f"found {input_text}; needed: {_NEEDED_BY_TYPE.get(kind, item['msg'])}"
    return f"found {input_text}: {item['msg']}"


def _synonym_hint(value: Any, names: list[str], words: Words) -> str:
    if not isinstance(value, str):
        return ""
    if (synonym := words.own.get(value.lower().replace("_", "-"))) in names:
        return f"; did you mean {synonym!r}?"
    hint = did_you_mean(value[:64], names)
    return hint if "did you mean" in hint else ""


def allowed_keys(model: type[BaseModel], loc: tuple[str | int, ...]) -> list[str]:
    """Keys allowed at a location of a model.

    Args:
        model: start of the location.
        loc: pydantic's location: keys, indices and names of union branches.
    """
    models = [model]
    for part in loc:
        if isinstance(part, int):
            continue
        fields = [f for m in models for k, f in _fields(m).items() if k == part]
        if fields:
            models = [m for f in fields for m in _models(f.annotation)]
        else:
            models = [m for m in models if part in tags_of(m)] or models
    return sorted({key for m in models for key in _fields(m)})


def _fields(model: type[BaseModel]) -> dict[str, Any]:
    return {f.alias or name: f for name, f in model.model_fields.items()}


def tags_of(model: type[BaseModel]) -> set[str]:
    """Values of ``type``, and the name of the branch of a union."""
    kind = model.model_fields.get("type")
    tags = get_args(kind.annotation) if kind else ()
    return {t for t in tags if isinstance(t, str)} | {f"<{model.__name__.lower()}>"}


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for a in get_args(annotation) for m in _models(a)]
