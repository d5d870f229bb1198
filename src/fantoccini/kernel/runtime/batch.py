"""Many trajectories at once, on any number of threads (``cpp/fantoccini/runs/batch.hpp``).

Lanes are trajectories that the vector unit of the processor advances together. D stands for dynamic
coordinates, K for driven ones; a winch changes the length of a string. Breaks are the times at
which the pieces of an input meet. At a catch, a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

import ctypes
import os
import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, OnProgress, Progress, Status
from fantoccini.kernel.contract import PARTS
from fantoccini.kernel.runtime.functions import Loaded, pointer
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.packing import new_arrays, packed
from fantoccini.kernel.runtime.structures import UNLIMITED

_ENDS = (
    "status",
    "reached",
    "violation",
    "catches",
    "releases",
    "attribution",
    "end_q_D",
    "end_v_D",
)
"""Results written at the end of a trajectory."""
_POLL_INTERVAL = 0.05
"""Interval between checks of the progress and of Ctrl-C [s]."""


class BatchLibrary:
    """A library that advances many trajectories.

    Attributes:
        width: number of trajectories advanced together, in lanes.
        sizes: the puppet's sizes.
        key: name of its folder in the cache; unique to puppet, compiler and version.

    Args:
        loaded: a library of lanes, or the puppet's own, which advances one trajectory at a time.
    """

    def __init__(self, loaded: Loaded):
        self.dll, self.width, self.sizes = loaded.dll, loaded.width, loaded.sizes
        self.key = loaded.path.parent.name
        self.dll.fan_batch_new.restype = ctypes.c_void_p
        self.dll.fan_batch_done.restype = ctypes.c_double
        for name in ("free", "stop", "done", "work"):
            getattr(self.dll, f"fan_batch_{name}").argtypes = [ctypes.c_void_p]


@dataclass(frozen=True, eq=False)
class Batch:
    """Starts and results of n trajectories with T samples each.

    Starts and inputs are (n, ...), or (1, ...) if all trajectories share them.

    Attributes:
        library: advances the trajectories.
        n: number of trajectories.
        t, t_end: start and end of all [s].
        q_D, v_D, slip: the start states.
        breaks, coef, base, force: the bound inputs; ``force`` may be None.
        p: (n or 1, n_p) parameters.
        winches: (n_strings, 3) as for :class:`fantoccini.kernel.runtime.Run`.
        options: options of the runs.
        times: (T,) times of the samples: read by event-driven runs, written by fixed steps [s].
        parts: name of a part -> (n, T, width), written up to a trajectory's end.
        status, reached, violation: (n,) status and time of each end [s], largest violation (of
            fixed steps).
        catches, releases: (n,) numbers of these events.
        attribution: (n, n_rows + n_watched) share of rows and drives in the status' cause, 0 to 1.
        end_q_D, end_v_D: (n, ...) the configuration and velocities reached.
    """

    library: BatchLibrary
    n: int
    t: float
    t_end: float
    q_D: Array
    v_D: Array
    slip: Array
    breaks: Array
    coef: Array
    base: Array
    force: Array | None
    p: Array
    winches: Array
    options: RunOptions
    times: Array
    parts: dict[str, Array]
    status: NDArray[np.int32] = field(init=False)
    reached: Array = field(init=False)
    violation: Array = field(init=False)
    catches: NDArray[np.int64] = field(init=False)
    releases: NDArray[np.int64] = field(init=False)
    attribution: Array = field(init=False)
    end_q_D: Array = field(init=False)
    end_v_D: Array = field(init=False)

    def __post_init__(self) -> None:
        results = new_arrays("BatchArrays", _ENDS, self.library.sizes, n=self.n)
        for name in ("reached", "end_q_D", "end_v_D"):
            results[name].fill(np.nan)
        results["status"].fill(Status.STOPPED)
        for name, array in results.items():
            object.__setattr__(self, name, array)

    def run(self, threads: int, progress: OnProgress | None = None) -> None:
        """Simulates all trajectories. Ctrl-C stops the threads and is raised again.

        Args:
            threads: number of threads.
            progress: progress callback, with the number of completed trajectories.

        Raises:
            MemoryError: no memory for the batch.
        """
        arrays = self._arrays()
        library = self.library
        pool = library.dll.fan_batch_new(ctypes.byref(arrays))
        if not pool:
            raise MemoryError("no memory for a batch")
        return_codes: list[int] = []

        def work() -> None:
            return_codes.append(library.dll.fan_batch_work(pool))

        workers = [threading.Thread(target=work, daemon=True) for _ in range(threads)]
        try:
            for worker in workers:
                worker.start()
            working = True
            while working:
                for worker in workers:
                    worker.join(_POLL_INTERVAL / threads)
                working = any(worker.is_alive() for worker in workers)
                if progress:
                    progress(Progress(done=library.dll.fan_batch_done(pool), total=self.n))
        finally:
            library.dll.fan_batch_stop(pool)
            for worker in workers:
                if worker.ident is not None:
                    worker.join()
            library.dll.fan_batch_free(pool)
        if all(return_codes):
            raise MemoryError("no memory for the workers of a batch")

    def _arrays(self) -> ctypes.Structure:
        shared = ("q_D", "v_D", "slip", "breaks", "coef", "base", "force", "p")
        arrays: Any = packed(
            "BatchArrays",
            n=self.n,
            t=self.t,
            t_end=self.t_end,
            n_segments=self.coef.shape[1],
            winches=np.minimum(self.winches, UNLIMITED),
            options=self.options.structure(),
            save_every=self.options.save_every,
            save_at=self.times,
            n_samples=len(self.times),
            **{name: getattr(self, name) for name in (*shared, *_ENDS)},
        )
        for i, part in enumerate(PARTS):
            if part.name in self.parts:
                arrays.parts[i] = pointer(self.parts[part.name])
        return arrays


def default_threads() -> int:
    """Number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
