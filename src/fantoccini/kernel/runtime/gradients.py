"""Gradients of costs of rollouts (``cpp/fantoccini/derivatives/rollout_gradient.hpp``)."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.runtime.functions import AnyArray, Loaded, pointer
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.structures import UNLIMITED, structures

_TOUCHES = ("n_points", "n_sliding", "edges", "pairs")


class GradientLibrary(Loaded):
    """A puppet's library of gradients of rollouts."""

    def __init__(self, path: Path, sizes: Mapping[str, int]):
        super().__init__(path, sizes)
        self.dll.fan_gradient_new.restype = ctypes.c_void_p


class GradientRun:
    """One rollout, which is made at once, and then gradients of its cost.

    Args:
        library: of the puppet.
        options: of the steps.
        winches: (n_strings, 3).
        reference_force: a weight [N].
        inputs: q_K and v_K (n + 1, ...) by node, rate and mean (n, n_vK) over the steps.
        u_D: (1 or n, n_vD) user forces; None for none.
        q_D, v_D: (n_qD,), (n_vD,) at the start.
        p: (n_p,) parameters.

    Attributes:
        arrays: by the names of the contract's ``GradientArrays``.
        touches: those of them about contact; zeros without.
        numbers: the structure itself.

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
        made = library.dll.fan_gradient_new()
        if not made:
            raise MemoryError("no memory for a rollout")
        self._dll, self._handle = library.dll, ctypes.c_void_p(made)
        self._sizes, self._n, self._options = library.sizes, len(inputs["rate"]), options
        n, self._reference_force = self._n, reference_force
        self.arrays: dict[str, AnyArray] = {
            "winches": np.minimum(winches, UNLIMITED),
            "p": np.array(p, dtype=float),
            **inputs,
            "q_D": np.zeros((n + 1, library.sizes["n_qD"])),
            "v_D": np.zeros((n + 1, library.sizes["n_vD"])),
            "acc_D": np.zeros((n, library.sizes["n_vD"])),
            "tension": np.zeros((n, library.sizes["n_rows"])),
            "ahead": np.zeros((n, 2)),
        }
        self.touches = {name: np.zeros(n, dtype=np.int32) for name in _TOUCHES}
        if library.sizes["n_contacts"]:
            self.arrays |= self.touches
        self.arrays["q_D"][0], self.arrays["v_D"][0] = q_D, v_D
        self._force = None if u_D is None else np.ascontiguousarray(u_D, dtype=float)
        self.numbers = self._structure({})
        self._dll.fan_gradient_roll(self._handle, ctypes.byref(self.numbers))

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._dll.fan_gradient_free(self._handle)
            self._handle = ctypes.c_void_p()

    def gradient(
        self, held: MaskRows, l_q: Array, l_v: Array, l_tension: Array | None
    ) -> dict[str, Array]:
        """The results of a sweep by the names of the contract's ``GradientArrays``.

        Args:
            held: (n, n_rows) rows that the steps hold.
            l_q, l_v: (n + 1, n_vD) the cost's derivatives by tangents of q_D and by v_D.
            l_tension: (n, n_rows) those by the tensions; None for none.
        """
        n, sizes = self._n, self._sizes
        shapes: dict[str, tuple[int, ...]] = {
            "g_q": (sizes["n_vD"],),
            "g_v": (sizes["n_vD"],),
            "g_p": (sizes["n_p"],),
            "g_qK": (n, sizes["n_vK"]),
            "g_rate": (n, sizes["n_vK"]),
            "g_mean": (n, sizes["n_vK"]),
            "g_u": (n, sizes["n_vD"]),
        }
        out: dict[str, Array] = {name: np.zeros(shape) for name, shape in shapes.items()}
        given: dict[str, AnyArray] = {
            "held": np.ascontiguousarray(held, dtype=np.uint8),
            "l_q": np.ascontiguousarray(l_q, dtype=float),
            "l_v": np.ascontiguousarray(l_v, dtype=float),
        }
        if l_tension is not None:
            given["l_tension"] = np.ascontiguousarray(l_tension, dtype=float)
        self._dll.fan_gradient_sweep(self._handle, ctypes.byref(self._structure(given | out)))
        return out

    def _structure(self, more: Mapping[str, AnyArray]) -> ctypes.Structure:
        force: Any = structures["Shared"](None, 0)
        if self._force is not None:
            stride = 0 if len(self._force) == 1 else self._force.shape[1]
            force = structures["Shared"](pointer(self._force), stride)
        arrays = {name: pointer(a) for name, a in (self.arrays | dict(more)).items()}
        return structures["GradientArrays"](
            n=self._n,
            options=self._options.structure(),
            u_D=force,
            reference_force=self._reference_force,
            **arrays,
        )
