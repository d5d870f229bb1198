"""Hanging poses nearest to places (``cpp/fantoccini/search/reach.hpp``).

In a hanging pose, a puppet is at rest for given driven coordinates q_K: ends and lengths of
strings. q_D are the dynamic coordinates.
"""

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
"""Largest number of points and coordinates with a place in one pose (``max_targets``)."""


_OUT = {name: f"out_{name}" for name in ("q_D", "q_K", "p", "tension", "held")}
"""Results whose names in the contract differ from those in ``Reached``."""


class Reached(NamedTuple):
    """n poses; u = (v_K, p) of the free variables.

    Attributes:
        status: (n,) ``ReachEnd``.
        iterations: (n,).
        q_D, q_K, p, tension, held: (n, ...) the poses.
        left: (n, n_targets, 3) vectors from the places to the points [m or rad].
        price: (n, n_vK + n_p + n_rows + n_vD) multipliers of bounds; positive at upper bounds.
        by: (n, n_vK + n_p, n_vD) derivative of q_D by u.
        stable: (n,) whether V has a minimum at the pose.
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
        single_pass: bool = False,
    ) -> Reached:
        """The poses nearest to n places of each target.

        Args:
            places: (n, n_targets, 3) NaN is free.
            arrays: the other arrays of the contract's ``ReachArrays``, by name.
            weight: typical force [N].
            tolerance: tolerance of the distance [m or rad].
            max_iterations: largest number of iterations for one pose.
            single_pass: whether each search starts only from the last pose.

        Raises:
            MemoryError: no memory for the poses.
        """
        n, n_targets = places.shape[:2]
        results = {_OUT.get(name, name): name for name in Reached._fields}
        out = new_arrays("ReachArrays", results, self.sizes, n=n, n_targets=n_targets)
        fields: dict[str, AnyArray] = {"places": places, **arrays}
        for name, a in fields.items():
            fields[name] = np.clip(a, -UNLIMITED, UNLIMITED) if a.dtype.kind == "f" else a
        numbers = packed(
            "ReachArrays",
            n=n,
            n_targets=n_targets,
            weight=weight,
            tolerance=tolerance,
            max_iterations=max_iterations,
            single_pass=single_pass,
            **fields,
            **out,
        )
        if self.dll.fan_reach(ctypes.byref(numbers)):
            raise MemoryError("no memory for hanging poses")
        return Reached(**{results[name]: a for name, a in out.items()})
