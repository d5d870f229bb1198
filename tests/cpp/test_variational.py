"""Lanes: a variational run at width 8 equals eight independent scalar ones."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from cpp.toolchain import SANITIZE, compile_program, equations, numbers, run_program
from fantoccini import puppets
from fantoccini.kernel.build import runtime_folder
from fantoccini.kernel.codegen import generate

pytestmark = pytest.mark.slow

WIDTH, STEPS, DT = 8, 40, 0.1
QUIET = ("-Wno-maybe-uninitialized", "-Wno-uninitialized")
"""g++ 12 warns about its own AVX-512 header."""


def words(puppet) -> str:
    """Bobs that swing, fly and are caught, each in a lane of its own."""
    words = [STEPS, DT]
    for lane in range(WIDTH):
        words += [0.0, -1.0 + 0.05 * lane, 7.5 - 0.8 * lane, -2.0 * (lane % 3)]
    return "\n".join(repr(float(x)) for x in [*words, *puppet.p])


def write_files(name: str, folder: Path) -> None:
    for file, text in generate(equations(name), "variational").files.items():
        (folder / file).write_text(text, encoding="utf-8")


def test_a_lane_equals_a_scalar_run_with_any_neighbours(tmp_path):
    """The fast bobs have halved steps; with the sanitizers."""
    write_files("string_pendulum", tmp_path)
    flags = ("-O1", "-march=native", *QUIET, *SANITIZE)
    program = compile_program("variational.cpp", tmp_path, *flags)
    counts = numbers(run_program(program, words(puppets.string_pendulum())))
    assert counts["numbers_left_out"] == 0
    assert counts["changes"] >= 8, "strings fall slack and catch"
    assert counts["halved"] >= 8, "while others go on in whole steps"
    assert counts["stopped"] == 0 and counts["modes_apart"] == 0
    assert counts["apart"] < 1e-10, "whole runs, so that rounding has grown"
    assert counts["bits_apart"] == 0
    assert np.isfinite(counts["apart"])


def test_a_node_without_solution_stops_its_lane(tmp_path):
    """Pivoting gets a single round, too few at a catch; once this was not reported."""
    write_files("string_pendulum", tmp_path)
    shutil.copytree(runtime_folder() / "fantoccini", tmp_path / "fantoccini")
    header = tmp_path / "fantoccini" / "solvers" / "complementarity.hpp"
    text = header.read_text(encoding="utf-8")
    assert text.count("return 50 + 4 * n;") == 1
    header.write_text(text.replace("return 50 + 4 * n;", "return 1;"), encoding="utf-8")
    program = compile_program("variational.cpp", tmp_path, "-O1", "-march=native", *QUIET)
    counts = numbers(run_program(program, words(puppets.string_pendulum())))
    assert counts["stopped"] > 0 and counts["modes_apart"] == 0
