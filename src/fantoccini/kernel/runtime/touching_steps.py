"""First time steps with contact from many states (``derivatives/step_touches.hpp``)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.contract import STRUCTURES, StepEdge
from fantoccini.kernel.runtime.compiled import Library
from fantoccini.kernel.runtime.functions import AnyArray, pointer
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.structures import UNLIMITED, dtype_of, structures

STEP_CONTACT = dtype_of(next(s for s in STRUCTURES if s.name == "StepContact"))
"""A point that pushes in a step."""
_ROOM = 16
"""Points of a node that are expected at most; where more push, all are looked for again."""


class StepTouches(NamedTuple):
    """n steps and what touches in them.

    Attributes:
        q_D, v_D, q_K, v_K, slip: (n, ...) after the steps.
        tension: (n, n_rows) impulses over dt [N or N m].
        taut: (n, n_rows).
        status: (n,) of the steps.
        delay: (n,) how long the steps move on before what springs back touches [s].
        edges: (n,) bits of ``StepEdge``.
        pair_edges: (n, pairs) those of every pair; of points that push and of open ones.
        n_points: (n,) points that push.
        points: (n, room) ``STEP_CONTACT``.
        screws: (n, n_vD + n_vK, 6) at the start, or where what springs back touches.
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
        library: of a puppet with contact.
        options: of the steps; ``contacts`` are what may touch.
        winches: (n_strings, 3).
        reference_force: a weight [N].
        starts: q_D, v_D, q_K, v_K, slip, rate (dq_K/dt over the step) and mean (dv_K/dt), (n, ...)
            each.
        acc_K: (1 or n, n_vK).
        u_D: (1 or n, n_vD) user forces; None for none.
        p: (1 or n, n_p).
        threads: that share the work.
    """
    n, sizes = len(starts["q_D"]), library.sizes
    n_pairs = 0 if options.contacts is None else len(options.contacts.pairs)
    n_screws = sizes["n_vD"] + sizes["n_vK"]
    room = min(_ROOM, sizes["n_contacts"])
    kept: list[AnyArray] = []

    def address(a: Array) -> ctypes.c_void_p:
        kept.append(np.ascontiguousarray(a, dtype=float))
        return pointer(kept[-1])

    given: dict[str, Any] = {name: address(a) for name, a in starts.items() if name != "slip"}
    given |= {"acc_K": shared(acc_K, address), "u_D": shared(u_D, address)}
    given |= {"p": shared(p, address), "winches": address(np.minimum(winches, UNLIMITED))}
    while True:
        q_D, v_D, q_K, v_K, tension = (
            np.empty((n, sizes[size])) for size in ("n_qD", "n_vD", "n_qK", "n_vK", "n_rows")
        )
        slip, taut = starts["slip"].copy(), np.empty((n, sizes["n_rows"]), dtype=np.bool_)
        delay = np.empty(n)
        status, edges, n_points = (np.empty(n, dtype=np.int32) for _ in range(3))
        pair_edges = np.zeros((n, n_pairs), dtype=np.int32)
        points = np.zeros((n, room), dtype=STEP_CONTACT)
        screws = np.empty((n, n_screws, 6))
        by_p = np.empty((n, sizes["n_links"] + n_screws, 6, sizes["n_p"]))
        out = StepTouches(
            q_D,
            v_D,
            q_K,
            v_K,
            slip,
            tension,
            taut,
            status,
            delay,
            edges,
            pair_edges,
            n_points,
            points,
            screws,
            by_p,
        )
        results = {
            f"{name}_next" if name in ("q_D", "v_D", "q_K", "v_K") else name: pointer(a)
            for name, a in out._asdict().items()
        }
        arrays = structures["TouchingStepArrays"](
            options=options.structure(),
            reference_force=reference_force,
            room=room,
            n_pairs=n_pairs,
            **given,
            **results,
        )
        in_parts(library.dll.fan_step_touches, arrays, n, threads)
        if room == sizes["n_contacts"] or not np.any(out.edges & StepEdge.CROWDED):
            return out
        room = sizes["n_contacts"]


def shared(a: Array | None, address: Callable[[Array], ctypes.c_void_p]) -> ctypes.Structure:
    """(1 or n, width) numbers of every node."""
    if a is None:
        return structures["Shared"](None, 0)
    return structures["Shared"](address(a), 0 if len(a) == 1 else a.shape[1])


_LEAST = 4
"""Nodes that are worth a thread."""


def in_parts(call: Any, arrays: ctypes.Structure, n: int, threads: int) -> None:
    """Calls compiled code for the nodes [0, n) in some threads.

    Args:
        call: (arrays, first, last) -> 1 where there was no memory.
        arrays: of all nodes.
        n: how many.
        threads: that share the work.

    Raises:
        MemoryError: there was none.
    """
    workers = max(1, min(threads, n // _LEAST))
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
