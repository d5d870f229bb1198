"""Checks of long runs take little memory beyond that of the run."""

from __future__ import annotations

import dataclasses
import tracemalloc

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.motion import Columns
from fantoccini.stand import check_stand

pytestmark = pytest.mark.medium
TIMES = 12


def repeat_run(run: fan.Trajectory, n: int) -> fan.Trajectory:
    """A run that ends where it begins, n times."""

    def again(values):
        return np.concatenate([values, *[values[1:]] * (n - 1)])

    changes = {}
    for field in dataclasses.fields(run):
        value = getattr(run, field.name)
        if isinstance(value, Columns):
            changes[field.name] = value.like(again(value.values))
        elif isinstance(value, np.ndarray) and field.name != "t":
            changes[field.name] = again(value)
    steps = np.diff(run.t)
    t = np.append(0.0, np.cumsum(np.concatenate([steps] * n)))
    return dataclasses.replace(run, t=t, **changes)


@pytest.fixture(scope="module")
def long_run(conduct):
    return repeat_run(conduct, TIMES)


def peak_memory(call):
    """Result of a call, and the largest memory that it takes [bytes]."""
    tracemalloc.start()
    try:
        result = call()
        return result, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_the_check_of_a_long_run_takes_little_memory(stand6, conduct, long_run):
    """Once 87 numbers a millisecond: 5.5 GB an hour with its run; now 27."""
    check, peak = peak_memory(lambda: check_stand("six_winches", long_run, stand6))
    assert len(check.axes) == 6 and long_run.duration == pytest.approx(60.0)
    assert peak < 40 * 8 * len(check.times)
    # The shorter run has the same margins: nothing is lost between the pieces.
    once = check_stand("six_winches", conduct, stand6)
    for limit, other in zip(check.limits, once.limits, strict=True):
        assert (limit.axis, limit.quantity) == (other.axis, other.quantity)
        assert limit.margin == pytest.approx(other.margin, abs=0.2)


def test_a_run_is_read_without_a_copy(long_run, tmp_path):
    path = tmp_path / "long.npz"
    long_run.save(path)
    run, peak = peak_memory(lambda: fan.Trajectory.load(path))
    assert peak < 1.3 * path.stat().st_size
    np.testing.assert_array_equal(run.q_D, long_run.q_D)
    with pytest.raises(ValueError, match="read-only"):
        run.q_D[0, 0] = 1.0
