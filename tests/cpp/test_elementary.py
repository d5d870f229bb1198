"""Elementary functions, on doubles and on lanes, compared with the C library on long doubles."""

from __future__ import annotations

import platform

import numpy as np
import pytest

from cpp.toolchain import compile_program, run_program

FUNCTIONS = ("sine", "cosine", "arctangent", "inverse root")


def errors_of(program, x: np.ndarray) -> np.ndarray:
    """(len(x), 9) eight errors in units in the last place, and 1 if all lanes agree, else 0."""
    printed = run_program(program, "\n".join(repr(float(v)) for v in x))
    return np.array([line.split() for line in printed.splitlines()], dtype=float)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="needs the long double of x86-64")
@pytest.mark.parametrize("flags", [("-O2", "-march=native"), ("-O1",)], ids=["native", "plain"])
def test_errors_are_below_two_units_in_the_last_place(flags, tmp_path):
    program = compile_program("elementary.cpp", tmp_path, *flags)
    rng = np.random.default_rng(0)
    moderate = np.concatenate(
        [
            rng.uniform(-1.0, 1.0, 5000),
            rng.uniform(-1e4, 1e4, 5000),
            np.arange(1, 400) * np.pi / 4,
            10.0 ** rng.uniform(-300.0, 4.0, 5000),
            np.tan([np.pi / 8, 3 * np.pi / 8]),
        ]
    )
    errors = errors_of(program, moderate)
    assert errors[:, 8].all()
    worst = dict(zip(FUNCTIONS * 2, errors[:, :8].max(axis=0), strict=False))
    print(worst)
    assert max(worst["sine"], worst["cosine"]) < 1.0
    assert max(worst["arctangent"], worst["inverse root"]) < 2.0
    # Up to 1e6 the third part of pi/2 is significant; beyond 1e6 the C library is called.
    large_angles = np.concatenate([rng.uniform(1e4, 1e6, 5000), [1e7, 1e22, -1e300]])
    assert errors_of(program, large_angles)[:, [0, 1, 4, 5]].max() < 1.5
    not_finite = errors_of(program, np.array([np.nan, np.inf]))
    assert np.all(not_finite[:, [0, 1, 4, 5]] == 0.0), (
        "sine or cosine of NaN or infinity is not NaN"
    )
