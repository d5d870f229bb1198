"""Hanging poses nearest to places (``cpp/fantoccini/search/reach.hpp``)."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.runtime.functions import AnyArray, Loaded
from fantoccini.kernel.runtime.packing import new_arrays, packed
from fantoccini.kernel.runtime.structures import UNLIMITED

MAX_TARGETS = 64
"""Points and coordinates with a place in one pose (``max_targets`` in search/reach.hpp)."""


_OUT = {name: f"out_{name}" for name in ("q_D", "q_K", "p", "tension", "held")}
"""Results whose names in the contract differ from ours."""


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
        n, n_targets = places.shape[:2]
        results = {_OUT.get(name, name): name for name in Reached._fields}
        made = new_arrays("ReachArrays", results, self.sizes, n=n, n_targets=n_targets)
        given: dict[str, AnyArray] = {"places": places, **arrays}
        for name, a in given.items():
            given[name] = np.clip(a, -UNLIMITED, UNLIMITED) if a.dtype.kind == "f" else a
        numbers = packed(
            "ReachArrays",
            n=n,
            n_targets=n_targets,
            weight=weight,
            tolerance=tolerance,
            max_iterations=max_iterations,
            once=once,
            **given,
            **made,
        )
        if self.dll.fan_reach(ctypes.byref(numbers)):
            raise MemoryError("no memory for hanging poses")
        return Reached(**{results[name]: a for name, a in made.items()})
