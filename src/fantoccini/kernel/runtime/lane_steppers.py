"""Trajectories in lanes that are advanced piece by piece (``timestepping/lane_stepper.hpp``)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.runtime.batch import BatchLibrary
from fantoccini.kernel.runtime.functions import AnyArray, pointer
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.structures import UNLIMITED, structures


class LaneSteppers:
    """What n trajectories remember between pieces.

    Args:
        library: the puppet's lanes.
        n: trajectories.
        threads: that share the work.
        options: of the runs.
        winches: (n_strings, 3) as for :class:`fantoccini.kernel.runtime.Run`, of all.

    Raises:
        MemoryError: no memory for them.
    """

    def __init__(
        self, library: BatchLibrary, n: int, threads: int, options: RunOptions, winches: Array
    ):
        self._dll, self._n = library.dll, n
        self._dll.fan_steppers_new.restype = ctypes.c_void_p
        made = self._dll.fan_steppers_new(ctypes.c_longlong(n), ctypes.c_int(threads))
        if not made:
            raise MemoryError(f"no memory for {n} steppers")
        self._handle = ctypes.c_void_p(made)
        self._options = options
        self._winches = np.ascontiguousarray(np.minimum(winches, UNLIMITED), dtype=float)
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            if self._pool:
                self._pool.shutdown()
            self._dll.fan_steppers_free(self._handle)
            self._handle = ctypes.c_void_p()

    def advance(
        self, arrays: Mapping[str, AnyArray], duration: float, acc_K: Array, u_D: Array | None
    ) -> None:
        """Advances all trajectories that still run; those marked ``fresh`` begin anew first.

        Args:
            arrays: by the names of the contract's ``StepperArrays``; they are replaced in place.
            duration: of the piece; 0 only begins what is fresh [s].
            acc_K: (n or 1, n_vK) accelerations held over the piece.
            u_D: (n or 1, n_vD) forces held over the piece; None for none.
        """
        self.bound(arrays, duration, acc_K, u_D)()

    def bound(
        self, arrays: Mapping[str, AnyArray], duration: float, acc_K: Array, u_D: Array | None
    ) -> Callable[[], None]:
        """:meth:`advance` with these arrays, for many calls; contiguous ones may change between."""
        given = {"acc_K": acc_K, "u_D": u_D}
        held = {k: np.ascontiguousarray(x, dtype=float) for k, x in given.items() if x is not None}
        shared = {k: self._shared(x) for k, x in held.items()}
        shared.setdefault("u_D", structures["Shared"](None, 0))
        structure = structures["StepperArrays"](
            n=self._n,
            duration=duration,
            options=self._options.structure(),
            winches=pointer(self._winches),
            **shared,
            **{name: pointer(x) for name, x in arrays.items()},
        )
        return partial(self._advance, structure, [arrays, held])

    def _advance(self, structure: ctypes.Structure, kept: list[Any]) -> None:
        """``kept`` are the arrays that the structure points into."""
        self._dll.fan_steppers_begin(self._handle, ctypes.byref(structure))
        work = self._dll.fan_steppers_work
        if self._pool is None:
            work(self._handle, ctypes.c_int(0))
            return
        waiting = [
            self._pool.submit(work, self._handle, ctypes.c_int(i)) for i in range(self._threads)
        ]
        # The arrays must outlive the workers, Ctrl-C or not.
        try:
            wait(waiting)
        finally:
            wait(waiting)

    def _shared(self, values: Array) -> Any:
        stride = 0 if len(values) == 1 else values.shape[1]
        return structures["Shared"](pointer(values), stride)
