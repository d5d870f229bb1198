"""Quadratic programs of stages, solved by compiled code (``search/stage_program.hpp``).

A stage is an interval of a motion with its inputs, and a row a condition on a number of it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel import build
from fantoccini.kernel.contract import digest
from fantoccini.kernel.runtime.packing import new_arrays, packed

_MAIN = '#include "fantoccini/interface/stages.hpp"\n'


class StageOutcome(NamedTuple):
    """Result of the compiled solver.

    Attributes:
        u: (N, k) inputs.
        z: (N, n_z) states after them.
        costate: (N, n_z) multipliers of the dynamics.
        passed: (N, m) violations of the rows.
        force: (N, m) multipliers of the rows; at an upper bound they are positive.
        gain: (k, n_z) the best u_0 changes by gain z_0, with the last weights of the bounds.
        solved: whether the tolerance was reached.
        iterations: number of factorisations.
        primal, dual, gap: residuals of bounds and stationarity, and the mean product of slacks and
            multipliers.
    """

    u: Array
    z: Array
    costate: Array
    passed: Array
    force: Array
    gain: Array
    solved: bool
    iterations: int
    primal: float
    dual: float
    gap: float


class StagePrograms:
    """A solver that reuses its memory from program to program.

    Raises:
        BuildError: there is no compiler, or it failed.
        MemoryError: no memory for it.
    """

    def __init__(self) -> None:
        self._dll = stage_library()
        address = self._dll.fan_stage_solver_new()
        if not address:
            raise MemoryError("no memory for a program of stages")
        self._handle = ctypes.c_void_p(address)

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._dll.fan_stage_solver_free(self._handle)
            self._handle = ctypes.c_void_p()

    def solve(
        self,
        arrays: Mapping[str, Array],
        *,
        unit: float,
        unbounded: float,
        tolerance: float,
        barrier: float,
        iterations: int,
    ) -> StageOutcome:
        """The solution of a program.

        Args:
            arrays: arrays of the contract's ``StageProgramArrays``, by name.
            unit: unit of the cost.
            unbounded: magnitude above which a bound never binds.
            tolerance: tolerance of the residuals.
            barrier: smallest target of the products of slacks and multipliers.
            iterations: maximum number of iterations.

        Raises:
            MemoryError: no memory for it.
        """
        N, n_z, k = arrays["B"].shape
        m = arrays["C"].shape[1]
        sizes = {"N": N, "n_z": n_z, "k": k, "m": m}
        names = ("u", "z", "costate", "passed", "force", "gain")
        out: dict[str, Any] = new_arrays("StageProgramArrays", names, sizes)
        numbers: Any = packed(
            "StageProgramArrays",
            **sizes,
            unit=unit,
            unbounded=unbounded,
            tolerance=tolerance,
            barrier=barrier,
            most_iterations=iterations,
            **arrays,
            **out,
        )
        if self._dll.fan_stage_solve(self._handle, ctypes.byref(numbers)):
            raise MemoryError("no memory for a program of stages")
        finite = all(bool(np.all(np.isfinite(a))) for a in out.values())
        return StageOutcome(
            **out,
            solved=bool(numbers.solved) and finite,
            iterations=numbers.iterations,
            primal=numbers.primal,
            dual=numbers.dual,
            gap=numbers.gap,
        )


@cache
def stage_library() -> ctypes.CDLL:
    """The library, the same for all puppets; from the cache or built now."""
    key = build.fingerprint("programs of stages", str(digest()))
    source = build.Source({"main.cpp": _MAIN}, "main.cpp")
    folder = build.obtain(key, lambda: source)
    dll = ctypes.CDLL(str(folder / build.LIBRARY))
    dll.fan_stage_solver_new.restype = ctypes.c_void_p
    dll.fan_clamped_stages_new.restype = ctypes.c_void_p
    return dll
