"""Lists of near pairs: they are valid for many steps, and contain all near pairs."""

from __future__ import annotations

import pytest

from cpp.toolchain import compile_program, run_program


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return compile_program("near_pairs.cpp", tmp_path_factory.mktemp("near"), "-O1")


@pytest.mark.parametrize(("speed", "turn"), [(1e-3, 0.0), (0.0, 0.02), (1e-3, 0.01), (4e-3, 0.05)])
def test_no_pair_is_missed_while_a_list_is_valid(program, speed, turn):
    n_lists, n_steps, n_near, missed = map(int, run_program(program, f"{speed} {turn}").split())
    assert missed == 0
    assert n_near > 100
    assert n_steps > 2 * n_lists


def test_links_that_are_too_fast_have_no_list(program):
    """A list is tried occasionally, and given up."""
    n_lists, n_steps, _, missed = map(int, run_program(program, "0.2 1.0").split())
    assert missed == 0
    assert n_steps <= n_lists < 1000
