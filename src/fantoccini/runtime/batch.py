"""Many trajectories at once: the Python side of ``cpp/fantoccini/batch.hpp``.

A batch is a pool of trajectories that any number of threads work on; the interpreter's lock is
released while they do.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import PARTS
from fantoccini.runtime.functions import Loaded, pointer
from fantoccini.runtime.structures import UNLIMITED, RunOptions, structures

_LOOK_SECONDS = 0.05
"""How often the batch is looked at for progress and Ctrl-C."""


_Shared, _BatchArrays = structures["Shared"], structures["BatchArrays"]


class BatchLibrary:
    """A library that advances many trajectories.

    Attributes:
        width: trajectories that are advanced together, in lanes.

    Args:
        source: what makes the runs: a library of lanes, or the puppet's own, one at a time.
    """

    def __init__(self, source: Loaded):
        self.handle, self.width = source.handle, source.width
        self.handle.fan_batch_new.restype = ctypes.c_void_p
        self.handle.fan_batch_done.restype = ctypes.c_double
        for name in ("free", "stop", "done", "work"):
            getattr(self.handle, f"fan_batch_{name}").argtypes = [ctypes.c_void_p]


@dataclass(frozen=True, eq=False)
class Batch:
    """What a batch begins with and where its results go. n trajectories, T rows each.

    What begins a trajectory has (n, ...) or, where all share it, (1, ...).

    Attributes:
        n: trajectories.
        t, t_end: begin and end of all [s].
        q_D, v_D, slip: the start states.
        breaks, coef, base, force: the inputs, bound; ``force`` may be None.
        p: (n_p,) parameters.
        winches: (n_strings, 3) as of :class:`fantoccini.runtime.Run`.
        options: numbers that steer the runs.
        times: (T,) of the rows; the event-driven ones take them, the fixed steps make them [s].
        parts: name of a part -> (n, T, width), written where a trajectory gets that far.
        status, reached, violation: (n,) how each ended, when [s], worst violation (of
            fixed steps).
        catches, releases: (n,).
        blame: (n, n_rows + n_watched) rows and drives that are to blame for the status, 0 to 1.
        end_q_D, end_v_D: (n, ...) the configuration and velocities reached.
    """

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
    status: Array
    reached: Array
    violation: Array
    catches: Array
    releases: Array
    blame: Array
    end_q_D: Array
    end_v_D: Array

    def run(
        self, library: BatchLibrary, threads: int, look: Callable[[float], None] | None = None
    ) -> None:
        """Works the batch off. Ctrl-C stops the workers and is raised again.

        Args:
            library: what advances the trajectories.
            threads: workers.
            look: told now and then how much is done, 0 to 1.
        """
        arrays, kept = self._arrays()
        pool = library.handle.fan_batch_new(ctypes.byref(arrays))
        if not pool:
            raise MemoryError("no memory for a batch")
        failed: list[int] = []

        def work() -> None:
            failed.append(library.handle.fan_batch_work(pool))

        workers = [threading.Thread(target=work, daemon=True) for _ in range(threads)]
        try:
            for worker in workers:
                worker.start()
            working = True
            while working:
                for worker in workers:
                    worker.join(_LOOK_SECONDS / threads)
                working = any(worker.is_alive() for worker in workers)
                if look:
                    look(library.handle.fan_batch_done(pool) / self.n)
        finally:
            library.handle.fan_batch_stop(pool)
            for worker in workers:
                if worker.ident is not None:
                    worker.join()
            library.handle.fan_batch_free(pool)
            del kept
        if all(failed):
            raise MemoryError("no memory for the workers of a batch")

    def _arrays(self) -> tuple[_BatchArrays, list[Array]]:
        """The structure, and the arrays that must live as long as it is read."""
        kept: list[Array] = []

        def held(a: Array) -> ctypes.c_void_p:
            kept.append(np.ascontiguousarray(a, dtype=float))
            return pointer(kept[-1])

        def shared(a: Array | None) -> _Shared:
            if a is None:
                return _Shared(None, 0)
            first = held(a)
            return _Shared(first, 0 if len(a) == 1 else int(np.prod(a.shape[1:])))

        arrays = _BatchArrays(
            n=self.n, t=self.t, t_end=self.t_end,
            q_D=shared(self.q_D), v_D=shared(self.v_D), slip=shared(self.slip),
            n_segments=self.coef.shape[1],
            breaks=shared(self.breaks), coef=shared(self.coef), base=shared(self.base),
            force=shared(self.force),
            p=held(self.p), winches=held(np.minimum(self.winches, UNLIMITED)),
            options=self.options.structure(),
            save_every=self.options.save_every,
            save_at=held(self.times), n_rows=len(self.times),
            **{
                name: pointer(getattr(self, name))
                for name in (
                    "status", "reached", "violation", "catches", "releases", "blame", "end_q_D",
                    "end_v_D",
                )
            },
        )  # fmt: skip
        for i, part in enumerate(PARTS):
            if part.name in self.parts:
                arrays.parts[i] = pointer(self.parts[part.name])
        return arrays, kept


def default_threads() -> int:
    """The processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1
