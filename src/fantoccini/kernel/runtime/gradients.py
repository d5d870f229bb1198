"""Gradients of costs of rollouts (``cpp/fantoccini/derivatives/rollout_gradient.hpp``).

A rollout is a run of time steps. q_D and v_D are the dynamic coordinates and velocities; a winch
changes the length of a string. In names, K stands for driven coordinates: ends and lengths of
strings, driven joints.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.runtime.functions import AnyArray, Loaded
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.packing import new_arrays, packed
from fantoccini.kernel.runtime.structures import UNLIMITED

_TOUCHES = ("n_points", "n_sliding", "edges", "pairs")


class GradientLibrary(Loaded):
    """A puppet's library of gradients of rollouts."""

    def __init__(self, path: Path, sizes: Mapping[str, int]):
        super().__init__(path, sizes)
        self.dll.fan_gradient_new.restype = ctypes.c_void_p


class GradientRun:
    """A rollout, made on construction, and gradients of its cost.

    Args:
        library: the puppet's library.
        options: options of the steps.
        winches: (n_strings, 3).
        reference_force: a typical weight [N].
        inputs: q_K and v_K (n + 1, ...) by node, rate and mean (n, n_vK) over the steps.
        u_D: (1 or n, n_vD) user forces; None for none.
        q_D, v_D: (n_qD,), (n_vD,) at the start.
        p: (n_p,) parameters.

    Attributes:
        arrays: fields of the contract's ``GradientArrays``, by name.
        touches: the fields of contacts; zeros without contact.
        numbers: the structure.

    Raises:
        MemoryError: no memory for it.
    """

    def __init__(
        self,
        library: GradientLibrary,
        options: RunOptions,
        winches: Array,
        reference_force: float,
        inputs: Mapping[str, Array],
        u_D: Array | None,
        q_D: Array,
        v_D: Array,
        p: Array,
    ):
        address = library.dll.fan_gradient_new()
        if not address:
            raise MemoryError("no memory for a rollout")
        self._dll, self._handle = library.dll, ctypes.c_void_p(address)
        self._sizes, self._n, self._options = library.sizes, len(inputs["rate"]), options
        self._reference_force = reference_force
        self.arrays: dict[str, AnyArray] = {
            "winches": np.minimum(winches, UNLIMITED),
            "p": np.array(p, dtype=float),
            **inputs,
            **self._new("q_D", "v_D", "acc_D", "tension", "ahead"),
        }
        self.touches = self._new(*_TOUCHES)
        if library.sizes["n_contacts"]:
            self.arrays |= self.touches
        self.arrays["q_D"][0], self.arrays["v_D"][0] = q_D, v_D
        self._force = u_D
        self.numbers = self._structure({})
        self._dll.fan_gradient_roll(self._handle, ctypes.byref(self.numbers))

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._dll.fan_gradient_free(self._handle)
            self._handle = ctypes.c_void_p()

    def gradient(
        self, held: MaskRows, l_q: Array, l_v: Array, l_tension: Array | None
    ) -> dict[str, Array]:
        """The results of a sweep, by the names of the contract's ``GradientArrays``.

        Args:
            held: (n, n_rows) rows held in the steps.
            l_q, l_v: (n + 1, n_vD) the cost's derivatives by tangents of q_D and by v_D.
            l_tension: (n, n_rows) derivatives by the tensions; None for none.
        """
        out = self._new("g_q", "g_v", "g_p", "g_qK", "g_rate", "g_mean", "g_u")
        arguments = {"held": held, "l_q": l_q, "l_v": l_v, "l_tension": l_tension}
        self._dll.fan_gradient_sweep(self._handle, ctypes.byref(self._structure(arguments | out)))
        return out

    def _new(self, *names: str) -> dict[str, AnyArray]:
        return new_arrays("GradientArrays", names, self._sizes, n=self._n)

    def _structure(self, extra_arrays: Mapping[str, AnyArray | None]) -> Any:
        return packed(
            "GradientArrays",
            n=self._n,
            options=self._options.structure(),
            u_D=self._force,
            reference_force=self._reference_force,
            **self.arrays | dict(extra_arrays),
        )
