"""Hanging poses nearest to places (``cpp/fantoccini/search/reach.hpp``)."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.runtime.functions import AnyArray, Loaded, pointer
from fantoccini.kernel.runtime.structures import UNLIMITED, structures

MAX_TARGETS = 64
"""Points and coordinates with a place in one pose (``max_targets`` in search/reach.hpp)."""


class Reached(NamedTuple):
    """n poses; u = (v_K, p) of what may be chosen.

    Attributes:
        status: (n,) ``ReachEnd``.
        iterations: (n,).
        q_D, q_K, p, tension, held: (n, ...) the poses.
        left: (n, n_targets, 3) from the places to where the points are [m or rad].
        price: (n, n_vK + n_p + n_rows + n_vD) multipliers of bounds; above 0 at the high ones.
        by: (n, n_vK + n_p, n_vD) derivative of q_D by u.
        stable: (n,) whether V has a minimum there.
    """

    status: NDArray[np.int32]
    iterations: NDArray[np.int32]
    q_D: Array
    q_K: Array
    p: Array
    tension: Array
    held: MaskRows
    left: Array
    price: Array
    by: Array
    stable: MaskRows


class ReachLibrary(Loaded):
    """A puppet's library of hanging poses nearest to places."""

    def find(
        self,
        places: Array,
        arrays: Mapping[str, AnyArray],
        *,
        weight: float,
        tolerance: float,
        max_iterations: int,
        once: bool = False,
    ) -> Reached:
        """The poses nearest to n places of each target.

        Args:
            places: (n, n_targets, 3) NaN is free.
            arrays: the others that the contract's ``ReachArrays`` has, by name.
            weight: the size of forces [N].
            tolerance: of the distance [m or rad].
            max_iterations: of one pose.
            once: whether poses are looked for from the last one only.

        Raises:
            MemoryError: no memory.
        """
        n, n_targets, sizes = len(places), places.shape[1], self.sizes
        n_v, n_k, n_p, n_rows = (sizes[name] for name in ("n_vD", "n_vK", "n_p", "n_rows"))
        out = Reached(
            np.zeros(n, np.int32),
            np.zeros(n, np.int32),
            np.zeros((n, sizes["n_qD"])),
            np.zeros((n, sizes["n_qK"])),
            np.zeros((n, n_p)),
            np.zeros((n, n_rows)),
            np.zeros((n, n_rows), bool),
            np.zeros((n, n_targets, 3)),
            np.zeros((n, n_k + n_p + n_rows + n_v)),
            np.zeros((n, n_k + n_p, n_v)),
            np.zeros(n, bool),
        )
        given: dict[str, AnyArray] = {"places": places, **arrays}
        for name, a in given.items():
            kind = {"b": np.uint8, "i": np.int32}.get(a.dtype.kind, float)
            whole = np.ascontiguousarray(a, dtype=kind)
            given[name] = np.clip(whole, -UNLIMITED, UNLIMITED) if kind is float else whole
        results = {
            f"out_{name}" if name in ("q_D", "q_K", "p", "tension", "held") else name: a
            for name, a in out._asdict().items()
        }
        numbers = structures["ReachArrays"](
            n=n,
            n_targets=n_targets,
            weight=weight,
            tolerance=tolerance,
            max_iterations=max_iterations,
            once=once,
            **{name: pointer(a) for name, a in (given | results).items()},
        )
        if self.dll.fan_reach(ctypes.byref(numbers)):
            raise MemoryError("no memory for hanging poses")
        return out
