"""Separate tests of parts of the runtime: corrections and feedback."""

from __future__ import annotations

import pytest

from cpp.toolchain import SANITIZE, compile_program, numbers, run_program
from fantoccini import Status


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")
    return numbers(run_program(compile_program("parts.cpp", folder, "-O1", *SANITIZE), ""))


def test_the_last_round_of_a_correction_counts(found):
    assert found["rounds12"] == Status.RUNNING
    assert found["rounds13"] == Status.PROJECTION_FAILED


def test_a_feedback_without_reach_is_finite(found):
    """0/0 made the driven accelerations NaN at the equilibrium."""
    assert found["at_equilibrium"] == pytest.approx(-0.1)
    assert found["off_it"] == pytest.approx(-0.1), "positions count for nothing"
