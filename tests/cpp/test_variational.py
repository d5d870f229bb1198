"""Lanes: a variational run at width 8 is eight scalar ones, none minding the others."""

from __future__ import annotations

import numpy as np

from cpp.toolchain import SANITIZE, compile_program, equations, numbers, run_program
from fantoccini import puppets
from fantoccini.codegen import generate

WIDTH, STEPS, DT = 8, 40, 0.1
QUIET = ("-Wno-maybe-uninitialized", "-Wno-uninitialized")
"""g++ 12 warns about its own AVX-512 header."""


def test_a_lane_is_a_scalar_run_whatever_its_neighbours(tmp_path):
    """Bobs that swing, fly and are caught, each in a lane of its own, the fast ones in halved
    steps; under the sanitizers."""
    name = "string_pendulum"
    files = generate(equations(name), "variational").files
    for file, text in files.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    flags = ("-O1", "-march=native", *QUIET, *SANITIZE)
    program = compile_program("variational.cpp", tmp_path, *flags)
    puppet = puppets.string_pendulum()
    words = [STEPS, DT]
    for lane in range(WIDTH):
        words += [0.0, -1.0 + 0.05 * lane, 7.5 - 0.8 * lane, -2.0 * (lane % 3)]
    words += list(puppet.p)
    found = numbers(run_program(program, "\n".join(repr(float(x)) for x in words)))
    assert found["numbers_left_out"] == 0
    assert found["changes"] >= 8, "strings fall slack and catch"
    assert found["halved"] >= 8, "while others go on in whole steps"
    assert found["stopped"] == 0 and found["modes_apart"] == 0
    assert found["apart"] < 1e-10, "whole runs, so that rounding has grown"
    assert found["bits_apart"] == 0
    assert np.isfinite(found["apart"])
