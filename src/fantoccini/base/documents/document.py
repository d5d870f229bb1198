'''One way to read the files that users write: a subclass of :class:`Document` for each kind.

The fields of the subclass are the keys of the file::

    class StandFile(Document):
        """A stand."""

        kind: ClassVar = Kind("stand", "a stand has the keys `stand` and `axes`", STANDS)

        stand: Name
        """The stand's name."""
        axes: Annotated[dict[Name, AxisFile], entries(1)]
        """Name -> axis."""
        zero: dict[str, Angle] = Field(default_factory=dict)
        """Coordinate -> value; `30 deg` has a unit."""

        @model_validator(mode="after")
        def _known(self) -> StandFile:
            known = {name for axis in self.axes.values() for name in axis.moves}
            raise_if_any(unknown_names(self.zero, known, "no axis moves {}", ("zero",)))
            return self

    stand = read_document("stage.yaml", StandFile)  # or the name of a bundled stand
    stand = parse_document(text, StandFile)
    document_schema(StandFile)  # JSON Schema for editors

A check of a value raises ``validation_error(text)``; one of a part or of the whole file lists
mistakes at keys below it with ``raise_if_any``. An error lists every mistake as ``file:line:
key.path: found, allowed, nearest name``. Checks that need more than the file (a compiled puppet,
other files) come after it: :class:`Mistakes` runs them with ``document.located``, which has the
lines and the folder.
'''

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from pathlib import Path as FilePath
from typing import Any, ClassVar, NamedTuple, TypeVar

from pydantic import GetCoreSchemaHandler, PrivateAttr, ValidationError
from pydantic_core import core_schema

from fantoccini.base import FileError, Mistake, did_you_mean
from fantoccini.base.documents.json_schema import described_schema
from fantoccini.base.documents.located import (
    NO_WORDS,
    Finding,
    Located,
    Words,
    findings,
    read_file,
    read_located,
)
from fantoccini.base.documents.values import Model

DocumentT = TypeVar("DocumentT", bound="Document")

_KEYS_NAMED_AFTER_KIND = "scene gesture score play problem task mapping stand record"
KEYS = {"bodies": "puppet", "coordinates": "inputs"} | {
    k: k for k in _KEYS_NAMED_AFTER_KIND.split()
}
"""Key at the top of a file that identifies its kind -> the kind."""


class Kind(NamedTuple):
    """A kind of file.

    Attributes:
        name: one of the values of :data:`KEYS`.
        needs: keys that such a file has, as the end of the message "this is a puppet file; ...".
        folder: folder of bundled files, which are read by their names; None if there are none.
        error: class of the error that lists the mistakes.
        words: names that other programs use, for hints.
    """

    name: str
    needs: str
    folder: FilePath | None = None
    error: type[FileError] = FileError
    words: Words = NO_WORDS

    @property
    def key(self) -> str:
        """Key at the top of the file that identifies its kind."""
        return next(key for key, kind in KEYS.items() if kind == self.name)

    @property
    def bundled(self) -> tuple[str, ...]:
        """Names of the bundled files."""
        files = () if self.folder is None else self.folder.glob("*.yaml")
        return tuple(sorted(path.stem for path in files))

    def missing(self, name: str, names: Collection[str], *other_kinds: str) -> FileError:
        """The error of a missing file, with the nearest of the bundled names as a hint.

        Args:
            name: name of the file.
            names: names of the bundled files of all possible kinds.
            other_kinds: names of other possible kinds with bundled files.
        """
        kinds = " or ".join((self.name, *other_kinds))
        text = f"found nothing here; a {kinds} file is needed, or the name of a bundled {kinds}"
        return self.error([Mistake(name, None, "", text + did_you_mean(name, names))])


class Document(Model):
    """Base of the models of files that users write. ``==`` ignores their location."""

    kind: ClassVar[Kind]
    """Kind of file."""

    _located: Located = PrivateAttr(default_factory=Located)

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        # A wrapping check of this class would run inside those of subclasses.
        return core_schema.with_info_wrap_validator_function(cls._all_mistakes, handler(source))

    @classmethod
    def _all_mistakes(cls, data: Any, handler: Any, info: core_schema.ValidationInfo) -> Any:
        """The document; one error of its kind lists all mistakes, in Python as in files."""
        located = info.context if isinstance(info.context, Located) else Located()
        try:
            document = handler(data)
        except ValidationError as error:
            mistakes = findings(cls, data, error, cls.kind.words)
            raise located.error(mistakes, cls.kind.error) from None
        if located.mistakes:
            raise located.error((), cls.kind.error)
        return document

    @property
    def located(self) -> Located:
        """File, folder, and line of every key."""
        return self._located

    def raise_if_any(self, findings: Iterable[Finding]) -> None:
        """Raises this kind of file's error if there are mistakes."""
        if mistakes := tuple(findings):
            raise self._located.error(mistakes, self.kind.error)

    def model_post_init(self, context: Any, /) -> None:
        """Stores its location."""
        if isinstance(context, Located):
            self._located = context


def read_document(path: str | os.PathLike[str], *kinds: type[DocumentT]) -> DocumentT:
    """Reads a file.

    Args:
        path: path of a YAML file, or the name of a bundled file of one of the kinds.
        kinds: possible kinds of the file.

    Raises:
        FileError: lists every mistake and its location; the class is that of the first kind.
    """
    kind, name = kinds[0].kind, os.fspath(path)
    folders = {stem: model.kind.folder for model in kinds[::-1] for stem in model.kind.bundled}
    if name in folders and not os.path.isfile(name):
        path = FilePath(folders[name] or "", f"{name}.yaml")
    elif kind.folder is not None and not os.path.exists(name):
        other_kinds = [model.kind.name for model in kinds[1:] if model.kind.folder is not None]
        raise kind.missing(name, folders, *other_kinds)
    return _validated(read_file(path, kind.error), kinds)


def parse_document(
    text: str | bytes,
    *kinds: type[DocumentT],
    name: str = "<string>",
    folder: FilePath | None = None,
) -> DocumentT:
    """Reads a text.

    Args:
        text: YAML.
        kinds: possible kinds of the document.
        name: name of the text, for messages.
        folder: base of relative paths; the current folder by default.

    Raises:
        FileError: see :func:`read_document`.
    """
    return _validated(read_located(text, name, folder, kinds[0].kind.error), kinds)


def document_schema(model: type[Document]) -> dict[str, Any]:
    """JSON Schema of a kind of file, for completion and checks in editors."""
    return described_schema(model, f"fantoccini {model.kind.name}")


def _validated(located: Located, kinds: tuple[type[DocumentT], ...]) -> DocumentT:
    """The document, of the kind that its keys identify."""
    data = located.data if isinstance(located.data, dict) else {}
    # The last kind wins: a scene with a stray `bodies` is a scene.
    model = next((model for model in reversed(kinds) if model.kind.key in data), None)
    other_kind = next((kind for key, kind in KEYS.items() if key in data), None)
    if model is None and other_kind is not None:
        text = f"this is a {other_kind} file; {kinds[0].kind.needs}"
        raise located.error([((), text)], kinds[0].kind.error)
    return (model or kinds[0]).model_validate(located.data, context=located)
