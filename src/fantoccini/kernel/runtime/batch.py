"""Many trajectories at once, on any number of threads (``cpp/fantoccini/runs/batch.hpp``)."""

from __future__ import annotations

import ctypes
import os
import threading
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, OnProgress, Progress, Status
from fantoccini.kernel.contract import PARTS
from fantoccini.kernel.runtime.functions import Loaded, pointer
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.structures import UNLIMITED, structures

_POLL_INTERVAL = 0.05
"""Between looks at the progress and for Ctrl-C [s]."""


class BatchLibrary:
    """A library that advances many trajectories.

    Attributes:
        width: trajectories that are advanced together, in lanes.
        sizes: of the puppet.

    Args:
        loaded: a library of lanes, or the puppet's own, which advances one at a time.
    """

    def __init__(self, loaded: Loaded):
        self.dll, self.width, self.sizes = loaded.dll, loaded.width, loaded.sizes
        self.dll.fan_batch_new.restype = ctypes.c_void_p
        self.dll.fan_batch_done.restype = ctypes.c_double
        for name in ("free", "stop", "done", "work"):
            getattr(self.dll, f"fan_batch_{name}").argtypes = [ctypes.c_void_p]


@dataclass(frozen=True, eq=False)
class Batch:
    """Starts and results of n trajectories with T samples each.

    Starts and inputs are (n, ...), or (1, ...) where all trajectories share them.

    Attributes:
        library: advances the trajectories.
        n: trajectories.
        t, t_end: start and end of all [s].
        q_D, v_D, slip: the start states.
        breaks, coef, base, force: the bound inputs; ``force`` may be None.
        p: (n or 1, n_p) parameters.
        winches: (n_strings, 3) as for :class:`fantoccini.kernel.runtime.Run`.
        options: of the runs.
        times: (T,) of the samples: read by event-driven runs, written by fixed steps [s].
        parts: name of a part -> (n, T, width), written as far as a trajectory gets.
        status, reached, violation: (n,) how and when each ended [s], largest violation (of
            fixed steps).
        catches, releases: (n,).
        blame: (n, n_rows + n_watched) share of rows and drives in the blame for the status, 0 to 1.
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
    blame: Array = field(init=False)
    end_q_D: Array = field(init=False)
    end_v_D: Array = field(init=False)

    def __post_init__(self) -> None:
        n, sizes = self.n, self.library.sizes
        made = {
            "status": np.full(n, Status.STOPPED, dtype=np.int32),
            "reached": np.full(n, np.nan),
            "violation": np.zeros(n),
            "catches": np.zeros(n, dtype=np.int64),
            "releases": np.zeros(n, dtype=np.int64),
            "blame": np.zeros((n, sizes["n_rows"] + sizes["n_watched"])),
            "end_q_D": np.full((n, sizes["n_qD"]), np.nan),
            "end_v_D": np.full((n, sizes["n_vD"]), np.nan),
        }
        for name, array in made.items():
            object.__setattr__(self, name, array)

    def run(self, threads: int, progress: OnProgress | None = None) -> None:
        """Simulates all trajectories. Ctrl-C stops the threads and is raised again.

        Args:
            threads: that share the work.
            progress: called now and then with the trajectories that are done.

        Raises:
            MemoryError: no memory for the batch.
        """
        arrays, kept = self._arrays()
        library = self.library
        pool = library.dll.fan_batch_new(ctypes.byref(arrays))
        if not pool:
            raise MemoryError("no memory for a batch")
        failed: list[int] = []

        def work() -> None:
            failed.append(library.dll.fan_batch_work(pool))

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
            del kept
        if all(failed):
            raise MemoryError("no memory for the workers of a batch")

    def _arrays(self) -> tuple[ctypes.Structure, list[Array]]:
        """The structure, and the arrays that must live as long as it is read."""
        kept: list[Array] = []

        def held(a: Array) -> ctypes.c_void_p:
            kept.append(np.ascontiguousarray(a, dtype=float))
            return pointer(kept[-1])

        def shared(a: Array | None) -> ctypes.Structure:
            if a is None:
                return structures["Shared"](None, 0)
            stride = 0 if len(a) == 1 else int(np.prod(a.shape[1:]))
            return structures["Shared"](held(a), stride)

        arrays = structures["BatchArrays"](
            n=self.n,
            t=self.t,
            t_end=self.t_end,
            q_D=shared(self.q_D),
            v_D=shared(self.v_D),
            slip=shared(self.slip),
            n_segments=self.coef.shape[1],
            breaks=shared(self.breaks),
            coef=shared(self.coef),
            base=shared(self.base),
            force=shared(self.force),
            p=shared(self.p),
            winches=held(np.minimum(self.winches, UNLIMITED)),
            options=self.options.structure(),
            save_every=self.options.save_every,
            save_at=held(self.times),
            n_samples=len(self.times),
            **{
                name: pointer(getattr(self, name))
                for name in (
                    "status",
                    "reached",
                    "violation",
                    "catches",
                    "releases",
                    "blame",
                    "end_q_D",
                    "end_v_D",
                )
            },
        )
        for i, part in enumerate(PARTS):
            if part.name in self.parts:
                arrays.parts[i] = pointer(self.parts[part.name])
        return arrays, kept


def default_threads() -> int:
    """Number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
