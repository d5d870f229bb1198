"""First time steps with contact from many states (``derivatives/step_touches.hpp``).

q_D and q_K are the dynamic and driven coordinates, v and acc their velocities and accelerations;
slip is the length that a winch has let out. A node is a state from which a time step begins.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.contract import StepEdge
from fantoccini.kernel.runtime.compiled import Library
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.packing import new_arrays, packed
from fantoccini.kernel.runtime.structures import UNLIMITED, dtype_of

STEP_CONTACT = dtype_of("StepContact")
"""A point that pushes in a step."""
_NEXT = {name: f"{name}_next" for name in ("q_D", "v_D", "q_K", "v_K")}
"""Results whose names in the contract differ from those in ``StepTouches``."""
_ROOM = 16
"""Expected number of points of a node; if more push, the search is repeated with all."""


class StepTouches(NamedTuple):
    """n steps and their contacts.

    Attributes:
        q_D, v_D, q_K, v_K, slip: (n, ...) after the steps.
        tension: (n, n_rows) impulses over dt [N or N m].
        taut: (n, n_rows) taut rows.
        status: (n,) statuses of the steps.
        delay: (n,) time until the first touch that rebounds [s].
        edges: (n,) bits of ``StepEdge``.
        pair_edges: (n, pairs) the same for every pair, for points that push and open ones.
        n_points: (n,) numbers of points that push.
        points: (n, capacity) ``STEP_CONTACT``.
        screws: (n, n_vD + n_vK, 6) at the start, or at the touch that rebounds.
        by_p: (n, n_links + n_vD + n_vK, 6, n_p) changes of poses and screws by the parameters.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    slip: Array
    tension: Array
    taut: MaskRows
    status: NDArray[np.int32]
    delay: Array
    edges: NDArray[np.int32]
    pair_edges: NDArray[np.int32]
    n_points: NDArray[np.int32]
    points: NDArray[np.void]
    screws: Array
    by_p: Array


def step_touches(
    library: Library,
    options: RunOptions,
    winches: Array,
    reference_force: float,
    starts: Mapping[str, Array],
    acc_K: Array,
    u_D: Array | None,
    p: Array,
    threads: int,
) -> StepTouches:
    """The first step of length ``options.dt`` from each of n states.

    Args:
        library: library of a puppet with contact.
        options: options of the steps; ``contacts`` are the solids that may touch.
        winches: (n_strings, 3).
        reference_force: a typical weight [N].
        starts: q_D, v_D, q_K, v_K, slip, rate (dq_K/dt over the step) and mean (dv_K/dt), (n, ...)
            each.
        acc_K: (1 or n, n_vK) accelerations.
        u_D: (1 or n, n_vD) user forces; None for none.
        p: (1 or n, n_p) parameters.
        threads: number of threads.
    """
    n, sizes = len(starts["q_D"]), library.sizes
    n_pairs = 0 if options.contacts is None else len(options.contacts.pairs)
    capacity = min(_ROOM, sizes["n_contacts"])
    arguments = {name: a for name, a in starts.items() if name != "slip"}
    arguments["winches"] = np.minimum(winches, UNLIMITED)
    results = {_NEXT.get(name, name): name for name in StepTouches._fields}
    while True:
        out_arrays: dict[str, Any] = new_arrays(
            "TouchingStepArrays", results, sizes, n=n, capacity=capacity, n_pairs=n_pairs
        )
        out_arrays["slip"][:] = starts["slip"]
        arrays = packed(
            "TouchingStepArrays",
            options=options.structure(),
            reference_force=reference_force,
            capacity=capacity,
            n_pairs=n_pairs,
            acc_K=acc_K,
            u_D=u_D,
            p=p,
            **arguments,
            **out_arrays,
        )
        in_parts(library.dll.fan_step_touches, arrays, n, threads)
        out = StepTouches(**{results[name]: a for name, a in out_arrays.items()})
        if capacity == sizes["n_contacts"] or not np.any(out.edges & StepEdge.TOO_MANY_POINTS):
            return out
        capacity = sizes["n_contacts"]


_NODES_PER_THREAD = 4
"""Number of nodes for which a thread pays."""


def in_parts(call: Any, arrays: ctypes.Structure, n: int, threads: int) -> None:
    """Calls compiled code for the nodes [0, n) in several threads.

    Args:
        call: (arrays, first, last) -> 1 if memory was exhausted.
        arrays: arrays of all nodes.
        n: number of nodes.
        threads: number of threads.

    Raises:
        MemoryError: no memory for the derivatives.
    """
    workers = max(1, min(threads, n // _NODES_PER_THREAD))
    parts = list(pairwise(n * i // workers for i in range(workers + 1)))

    def work(ends: tuple[int, int]) -> int:
        first, last = (ctypes.c_longlong(end) for end in ends)
        return int(call(ctypes.byref(arrays), first, last))

    if workers == 1:
        failed = [work(parts[0])]
    else:
        with ThreadPoolExecutor(workers) as pool:
            failed = list(pool.map(work, parts))
    if any(failed):
        raise MemoryError("no memory for the derivatives of time steps")
