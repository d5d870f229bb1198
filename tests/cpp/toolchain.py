"""Compilation of this folder's programs with the shipped headers and a generated model."""

from __future__ import annotations

import functools
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from fantoccini import puppets
from fantoccini.kernel.build import runtime_folder
from fantoccini.kernel.codegen import generate
from fantoccini.kernel.equations import Equations, derive
from fantoccini.model.puppet import load
from fantoccini.model.tree import grow

HERE = Path(__file__).parent
WARNINGS = (
    "-Wall",
    "-Wextra",
    "-Werror",
    "-Wno-error=maybe-uninitialized",  # differs from one compiler version to the next
    "-Wno-unused-parameter",  # CasADi's functions do not use all their arguments
)

SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")


@functools.cache
def gcc() -> str:
    """g++ >= 11, or skip: lanes of doubles need its standard library."""
    program = shutil.which("g++")
    if program is None:
        pytest.skip("no g++ on the path")
    answer = subprocess.run([program, "-dumpfullversion"], capture_output=True, text=True)
    version = re.match(r"\d+", answer.stdout)
    if version is None or int(version[0]) < 11:
        pytest.skip(f"g++ is {answer.stdout.strip() or 'something else'}; 11 or later is needed")
    return program


@functools.cache
def equations(name: str) -> Equations:
    """The equations of a bundled puppet."""
    return derive(grow(load(puppets.path(name))))


def write_model(name: str, folder: Path) -> None:
    """Write the generated files of a bundled puppet."""
    for file, text in generate(equations(name)).files.items():
        (folder / file).write_text(text, encoding="utf-8")


def compile_program(source: str, folder: Path, *flags: str) -> Path:
    """A program of this folder, compiled into `folder`, which contains its model."""
    program = folder / Path(source).stem
    command = [
        gcc(),
        "-std=c++17",
        *WARNINGS,
        *flags,
        "-I",
        str(folder),
        "-I",
        str(HERE),
        "-I",
        str(runtime_folder()),
        str(HERE / source),
        "-o",
        str(program),
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:6000]
    return program


def run_program(program: Path, words: str) -> str:
    """Output of a program for the input `words`; it must succeed and print nothing on stderr."""
    done = subprocess.run([program], input=words, capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    assert done.returncode == 0
    return done.stdout


def numbers(text: str) -> dict[str, float]:
    """Numbers by name, from lines of a name and a number."""
    return {line.split()[0]: float(line.split()[1]) for line in text.splitlines()}
