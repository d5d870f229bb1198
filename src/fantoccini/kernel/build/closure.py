"""The source files that a module depends on, and a hash of their code.

The closure of a module is the module, the modules that it imports, and so on.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from fantoccini.kernel.build.significant import significant_python

ROOT = Path(__file__).resolve().parents[2]
_PACKAGE = ROOT.name


@cache
def code_fingerprint(*modules: str) -> str:
    """A hash of the code of modules and of all modules of fantoccini that they import.

    Comments and docstrings do not change it.

    Args:
        modules: full names of the modules.
    """
    digest = hashlib.sha256()
    for file in sorted(closure(modules)):
        code = significant_python(file.read_text(encoding="utf-8")).encode()
        digest.update(f"{file.relative_to(ROOT).as_posix()}\0{len(code)}\0".encode() + code)
    return digest.hexdigest()


def closure(modules: Iterable[str]) -> set[Path]:
    """The files of modules and of all modules of fantoccini that they import.

    A package counts as the modules that define the names imported from it; the other imports of its
    ``__init__`` do not count.
    """
    waiting: list[tuple[str, str | None]] = [(name, None) for name in modules]
    visited: set[tuple[str, str | None]] = set()
    files: set[Path] = set()
    while waiting:
        imported = waiting.pop()
        if imported in visited:
            continue
        visited.add(imported)
        module, name = imported
        if name and (file := file_of(f"{module}.{name}")):  # a submodule
            module, name = f"{module}.{name}", None
        elif (file := file_of(module)) is None:
            continue
        imports = imports_of(file)
        defining = [source for source, binds in imports if binds == name]
        if defining and file.name == "__init__.py":
            waiting += defining
        else:  # a module, or a package that defines the name itself
            files.add(file)
            waiting += (source for source, _ in imports)
    return files


@cache
def file_of(module: str) -> Path | None:
    """The file of a module of fantoccini; None for other modules."""
    path = ROOT.joinpath(*module.split(".")[1:])
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if module.split(".")[0] == _PACKAGE and file.is_file():
            return file
    return None


@cache
def imports_of(file: Path) -> tuple[tuple[tuple[str, str | None], str], ...]:
    """((module, imported name), name to which it is bound) of every import.

    A regular expression finds the imports: parsing all files takes a second.
    """
    imports: list[tuple[tuple[str, str | None], str]] = []
    stub = file.with_suffix(".pyi")  # exists for a package that imports its names lazily
    text = file.read_text(encoding="utf-8")
    if stub.is_file():
        text += "\n" + stub.read_text(encoding="utf-8")
    package = ".".join(file.parent.relative_to(ROOT.parent).parts)
    for match in _IMPORT.finditer(text):
        module, names = match["module"] or "", match["names"] or ""
        if module.startswith("."):
            module = f"{package}.{module[1:]}".rstrip(".")
        for words in (part.split() for part in re.sub(r"#.*|[()]", "", names).split(",")):
            if words and module:
                imports.append(((module, words[0]), words[-1]))
            elif words:
                imports.append(((words[0], None), words[-1]))
    return tuple(imports)


_IMPORT = re.compile(
    r"^[ ]*(?:from (?P<module>[\w.]+) )?import (?P<names>\([^)]*\)|[^\n(]*)", re.MULTILINE
)
