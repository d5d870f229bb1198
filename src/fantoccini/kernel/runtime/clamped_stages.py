"""Compiled quadratic programs of stages, for real time (``search/stage_clamped.hpp``).

A stage is an interval of a motion; n_vK is the number of driven velocities, those of ends and
lengths of strings.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.runtime.functions import AnyArray
from fantoccini.kernel.runtime.packing import packed
from fantoccini.kernel.runtime.stage_programs import stage_library


class ClampedOutcome(NamedTuple):
    """Result of the compiled solver.

    Attributes:
        u: (N, n_vK) changes of the accelerations.
        decrease: decrease of the program's cost.
        iterations: number of factorisations begun.
        stages: total number of factorised stages; N in a full factorisation.
        solved: whether the active bounds are the right ones.
    """

    u: Array
    decrease: float
    iterations: int
    stages: int
    solved: bool


class ClampedStages:
    """A solver that reuses its memory from program to program.

    Raises:
        BuildError: there is no compiler, or it failed.
        MemoryError: no memory for it.
    """

    def __init__(self) -> None:
        self._dll = stage_library()
        address = self._dll.fan_clamped_stages_new()
        if not address:
            raise MemoryError("no memory for a program of stages")
        self._handle = ctypes.c_void_p(address)

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._dll.fan_clamped_stages_free(self._handle)
            self._handle = ctypes.c_void_p()

    def add_step(self, motion: Array, driven: Array, k: int, is_first: bool) -> None:
        """Adds a time step to every interval of the next program.

        Args:
            motion: (N, n_d, columns) derivatives of the step, as from ``linearise_steps``.
            driven: (N or 1, 2 k, 3 k) derivatives of the driven coordinates before the step.
            k: number of driven velocities.
            is_first: whether it is an interval's first step.

        Raises:
            MemoryError: no memory for it.
        """
        N, n_d, columns = motion.shape
        arrays = packed(
            "StageStepArrays",
            N=N,
            n_d=n_d,
            k=k,
            columns=columns,
            is_first=int(is_first),
            motion=motion,
            driven=driven,
        )
        if self._dll.fan_clamped_stages_step(self._handle, ctypes.byref(arrays)):
            raise MemoryError("no memory for a program of stages")

    def solve(
        self, numbers: Mapping[str, float], arrays: Mapping[str, AnyArray], driven: Array
    ) -> ClampedOutcome:
        """The best motion found for the steps added since the first.

        Args:
            numbers, arrays: fields of the contract's ``StageClampArrays``, by name.
            driven: (N or 1, 2 n_vK, 3 n_vK) derivatives of the driven coordinates.

        Raises:
            MemoryError: no memory for it.
        """
        u = np.zeros(arrays["acc"].shape)
        program: Any = packed("StageClampArrays", **numbers, **arrays, driven=driven, u=u)
        if self._dll.fan_clamped_stages_solve(self._handle, ctypes.byref(program)):
            raise MemoryError("no memory for a program of stages")
        return ClampedOutcome(
            u, program.decrease, program.iterations, program.stages, bool(program.solved)
        )
