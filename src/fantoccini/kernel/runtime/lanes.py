"""Trajectories in lanes that are advanced piece by piece (``timestepping/lane_stepper.hpp``).

Lanes are trajectories that the vector unit of the processor advances together; a record is the
arrays of their states. acc_K are the driven accelerations, and slip is the length that a winch has
let out. In names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.contract import LANE
from fantoccini.kernel.runtime.batch import BatchLibrary
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.packing import new_arrays, packed, repacked
from fantoccini.kernel.runtime.structures import UNLIMITED

_NAMES = tuple(field.name for field in LANE)


class LaneRecord:
    """The arrays of n trajectories advanced together, by the names of the contract's ``LANE``.

    They keep their addresses while the record lives; values are replaced in place.

    Attributes:
        fresh: (n,) trajectories that restart from the arrays; cleared when they have.
        p: (n, n_p) parameters.
        q_D, v_D, q_K, v_K, slip: (n, ...) states.
        tension: (n, n_rows) forces of strings and limits [N or N m].
        taut: (n, n_rows).
        energy_terms: (n, 5) the contract's ``SUMS``, since each began [J].
        energy: (n, 2) kinetic and potential energy [J].
        violation: (n,) largest violation since each began [m, rad or 1].
        advanced: (n,) duration by which each was advanced in the last piece [s].
        status: (n,) :class:`Status` numbers.
        attribution: (n, n_rows + n_watched) shares of rows and drives in its cause, 0 to 1.

    Args:
        n: number of trajectories.
        sizes: the puppet's sizes.
    """

    fresh: MaskRows
    p: Array
    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    slip: Array
    tension: Array
    taut: MaskRows
    energy_terms: Array
    energy: Array
    violation: Array
    advanced: Array
    status: NDArray[np.int32]
    attribution: Array

    def __init__(self, n: int, sizes: Mapping[str, int]):
        for name, array in new_arrays("StepperArrays", _NAMES, sizes, n=n).items():
            setattr(self, name, array)

    def __len__(self) -> int:
        return len(self.fresh)

    def begin(self, **parts: Array) -> None:
        """Restarts all trajectories: parts of their states by name, (n, width) or (width,)."""
        for name, values in parts.items():
            getattr(self, name)[:] = values
        self.fresh[:] = True


class LaneHistory:
    """Parts of a record at m moments.

    Args:
        record: record of n trajectories.
        m: number of moments.
        names: names of the parts.

    Attributes:
        parts: name -> (m, n, ...).
    """

    def __init__(self, record: LaneRecord, m: int, names: Iterable[str]):
        self._now = {name: getattr(record, name) for name in names}
        self.parts: dict[str, Any] = {
            name: np.zeros((m, *current.shape), dtype=current.dtype)
            for name, current in self._now.items()
        }

    def keep(self, i: int) -> None:
        """Stores the present record as moment i."""
        for name, current in self._now.items():
            self.parts[name][i] = current


class LaneSteppers:
    """Advances the trajectories of a record by time-stepping.

    Args:
        library: the puppet's lanes.
        record: the trajectories' record.
        threads: number of threads.
        options: options of the runs.
        winches: (n_strings, 3) as for :class:`fantoccini.kernel.runtime.Run`, of all.

    Raises:
        MemoryError: no memory for them.
    """

    def __init__(
        self,
        library: BatchLibrary,
        record: LaneRecord,
        threads: int,
        options: RunOptions,
        winches: Array,
    ):
        self._dll, n = library.dll, len(record)
        self._pool: ThreadPoolExecutor | None = None  # an interrupt may call __del__ from here on
        self._threads = threads = max(1, min(threads, -(-n // library.width)))
        self._dll.fan_steppers_new.restype = ctypes.c_void_p
        address = self._dll.fan_steppers_new(ctypes.c_longlong(n), ctypes.c_int(threads))
        if not address:
            raise MemoryError(f"no memory for {n} steppers")
        self._handle = ctypes.c_void_p(address)
        self._arrays = packed(
            "StepperArrays",
            n=n,
            options=options.structure(),
            winches=np.minimum(winches, UNLIMITED),
            **{name: getattr(record, name) for name in _NAMES},
        )
        if threads > 1:
            self._pool = ThreadPoolExecutor(threads)

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            if self._pool:
                self._pool.shutdown(wait=False)  # busy workers would keep this object alive
            self._dll.fan_steppers_free(self._handle)
            self._handle = ctypes.c_void_p()

    def checkpoint(self) -> bytes:
        """The state of all trajectories beyond the record's arrays, for :meth:`restore`."""
        buffer = ctypes.create_string_buffer(self._memory(None, None))
        self._memory(buffer, None)
        return buffer.raw

    def restore(self, checkpoint: bytes) -> None:
        """Continues as the steppers of a checkpoint, of the same library and number, did.

        Raises:
            ValueError: checkpoint of another size.
        """
        size = self._memory(None, None)
        if len(checkpoint) != size:
            raise ValueError(f"the checkpoint has {len(checkpoint)} bytes; these take {size}")
        self._memory(None, checkpoint)

    def _memory(self, out: Any, source: bytes | None) -> int:
        call = self._dll.fan_steppers_memory
        call.restype = ctypes.c_longlong
        return int(call(self._handle, out, source))

    def advance(self, duration: float, acc_K: Array, u_D: Array | None) -> None:
        """Advances all trajectories that still run; those marked ``fresh`` restart first.

        Args:
            duration: length of the piece; 0 only restarts fresh trajectories [s].
            acc_K: (n or 1, n_vK) constant accelerations over the piece.
            u_D: (n or 1, n_vD) constant forces over the piece; None for none.
        """
        self.bound(duration, acc_K, u_D)()

    def bound(self, duration: float, acc_K: Array, u_D: Array | None) -> Callable[[], None]:
        """:meth:`advance` bound to arrays; contiguous ones may change between calls."""
        structure = repacked(self._arrays, duration=duration, acc_K=acc_K, u_D=u_D)
        return partial(self._advance, structure)

    def _advance(self, structure: ctypes.Structure) -> None:
        self._dll.fan_steppers_begin(self._handle, ctypes.byref(structure))
        if self._pool is None:
            self._work(structure, 0)
            return
        pending: list[Future[None]] = []
        try:
            for i in range(self._threads):
                pending.append(self._pool.submit(self._work, structure, i))
        finally:
            wait(pending)

    def _work(self, structure: ctypes.Structure, worker: int) -> None:
        """One worker's share; its arguments keep the arrays alive if Ctrl-C ends the wait."""
        self._dll.fan_steppers_work(self._handle, ctypes.c_int(worker))
