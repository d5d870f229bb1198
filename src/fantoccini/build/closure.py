"""Which source files shape something: a module, and all that it imports of this package."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGE = _ROOT.name


@cache
def code_fingerprint(*modules: str) -> str:
    """A hash of the source of some modules and of all that they import within fantoccini.

    What a package's ``__init__`` imports counts where it is one of the names that are asked of it.

    Args:
        modules: their full names.
    """
    files = closure(modules)
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(f"{file.relative_to(_ROOT).as_posix()}\0".encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def closure(modules: Iterable[str]) -> set[Path]:
    """The files of some modules and of all that they import within fantoccini."""
    waiting, seen, files = [(name, None) for name in modules], set(), set()
    while waiting:
        wanted = waiting.pop()
        if wanted in seen:
            continue
        seen.add(wanted)
        module, name = wanted
        if name and (file := _file(f"{module}.{name}")):  # a submodule
            module, name = f"{module}.{name}", None
        elif (file := _file(module)) is None:
            continue
        of_package = file.name == "__init__.py"
        if not of_package:
            files.add(file)
        waiting += (
            found
            for found, binds in _imports(file)
            if not of_package or name is None or binds == name
        )
    return files


@cache
def _file(module: str) -> Path | None:
    path = _ROOT.joinpath(*module.split(".")[1:])
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if module.split(".")[0] == _PACKAGE and file.is_file():
            return file
    return None


@cache
def _imports(file: Path) -> tuple[tuple[tuple[str, str | None], str], ...]:
    """((module, name asked of it), name that it is bound to) of every import, wherever it stands.

    Found as text: to parse all files takes a second.
    """
    found: list[tuple[tuple[str, str | None], str]] = []
    for match in _IMPORT.finditer(file.read_text(encoding="utf-8")):
        module, names = match["module"] or "", match["names"] or ""
        for words in (part.split() for part in re.sub(r"#.*|[()]", "", names).split(",")):
            if words and module:
                found.append(((module, words[0]), words[-1]))
            elif words:
                found.append(((words[0], None), words[-1]))
    return tuple(found)


_IMPORT = re.compile(
    r"^[ ]*(?:from (?P<module>[\w.]+) )?import (?P<names>\([^)]*\)|[^\n(]*)", re.MULTILINE
)
