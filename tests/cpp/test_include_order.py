"""C++ headers include only from their own folder and from earlier ones in ``ORDER``."""

from __future__ import annotations

import re
import subprocess
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from cpp.toolchain import gcc
from fantoccini.kernel.build import runtime_folder

ROOT = runtime_folder() / "fantoccini"
ORDER = (
    "math",
    "contract.hpp",  # generated: structures shared with Python
    "solvers",  # complementarity, active sets, cones; independent of the puppet
    "model",
    "collision",
    "contact",
    "runs",
    "event",
    "timestepping",
    "variational",
    "derivatives",
    "search",
    "interface",
)
WITHOUT_MODEL = [folder for folder in ORDER if folder != "interface"]
"""Folders whose headers compile alone; those of ``interface`` need ``fan::Model`` defined first."""


def headers(folder: str) -> list[Path]:
    """The headers of an entry of ``ORDER``."""
    place = ROOT / folder
    return sorted(place.rglob("*.hpp")) if place.is_dir() else [place]


def name_of(header: Path) -> str:
    return header.relative_to(ROOT).as_posix()


def includes(header: Path) -> list[str]:
    """The names between quotes that a header includes."""
    return re.findall(r'^#include "([^"]+)"', header.read_text(encoding="utf-8"), re.MULTILINE)


def test_every_header_is_in_a_folder_of_the_order():
    in_order = {header for folder in ORDER for header in headers(folder)}
    assert in_order == set(ROOT.rglob("*.hpp"))


def test_includes_are_relative_to_the_root_and_exist():
    wrong = [
        f"{name_of(header)} includes {name}"
        for header in ROOT.rglob("*.hpp")
        for name in includes(header)
        if not (name.startswith("fantoccini/") and (ROOT.parent / name).is_file())
    ]
    assert wrong == []


def test_a_folder_includes_only_from_itself_and_those_before_it():
    wrong = []
    for place, folder in enumerate(ORDER):
        allowed = ORDER[: place + 1]
        for header in headers(folder):
            wrong += [
                f"{name_of(header)} includes {name}"
                for name in includes(header)
                if name.split("/")[1] not in allowed
            ]
    assert wrong == []


def test_headers_have_no_include_cycle():
    graph = {h: {ROOT.parent / name for name in includes(h)} for h in ROOT.rglob("*.hpp")}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = " <- ".join(name_of(header) for header in error.args[1])
        pytest.fail(f"these headers include one another: {circle}")


@pytest.mark.slow
@pytest.mark.parametrize("folder", WITHOUT_MODEL)
def test_a_header_includes_what_it_needs(folder, tmp_path):
    """Each header compiles alone."""
    failed = []
    for header in headers(folder):
        source = tmp_path / "alone.cpp"
        source.write_text(f'#include "fantoccini/{name_of(header)}"\n', encoding="ascii")
        command = [gcc(), "-std=c++17", "-fsyntax-only", "-I", str(runtime_folder()), str(source)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            failed.append(f"{name_of(header)}: {done.stderr[:500]}")
    assert failed == []
