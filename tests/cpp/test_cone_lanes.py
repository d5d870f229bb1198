"""Contacts of a bundle of lanes solved together keep the law, and no lane minds another."""

from __future__ import annotations

import pytest

from cpp.toolchain import SANITIZE, compile_program, numbers, run_program


@pytest.mark.parametrize(
    "flags",
    [("-O1", "-march=native", *SANITIZE), ("-O2", "-march=native")],
    ids=("checked", "fast"),
)
def test_what_lanes_solve_obeys_the_law_whatever_their_neighbours(flags, tmp_path):
    """Random problems with redundant contacts, rows at their bounds and contacts without friction;
    the law by the scalar solver's own measure."""
    program = compile_program("cone_lanes.cpp", tmp_path, *flags)
    found = numbers(run_program(program, ""))
    assert found["share_solved"] > 0.8
    assert found["residual"] <= 1e-10
    assert found["bits_apart"] == 0
    assert found["unclean"] == 0
    assert found["slid"] > 500
