"""Inputs for compiled code.

An input gives the driven coordinates q_K (ends and lengths of strings) by polynomials with
coefficients `coef` between the times `breaks`; v_K and acc_K are their velocities and
accelerations. In names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from fantoccini.base import N_COEF, ConfigK, Times, VecD, VecK
from fantoccini.kernel.runtime.functions import pointer
from fantoccini.kernel.runtime.packing import packed
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import Input, pieces


class HeldInput:
    """An input of one piece with constant accelerations and forces.

    Live control fills it repeatedly. Its arrays keep their addresses, because asking an array for
    its address takes longer than filling it.

    Attributes:
        structure: for compiled code; it and its arrays live as long as this object.

    Args:
        table: the coordinates.
    """

    def __init__(self, table: CoordinateTable):
        self._table, self._places = table, table.scalar_indices_K
        self._breaks, self._base = np.zeros(2), np.zeros((1, table.n_qK))
        self._coef = np.zeros((1, table.n_vK, N_COEF))
        self._force = np.zeros((1, table.n_vD, N_COEF))
        self._u_D = pointer(self._force)
        self.structure: Any = packed(
            "InputArrays", n_segments=1, breaks=self._breaks, coef=self._coef, base=self._base
        )

    def fill(
        self, t: float, t_end: float, q_K: ConfigK, v_K: VecK, acc_K: VecK, u_D: VecD | None = None
    ) -> None:
        """The piece from t to t_end [s] that begins at a configuration with a velocity.

        Args:
            t, t_end: [s].
            q_K, v_K: (n_qK,), (n_vK,) at t.
            acc_K: (n_vK,) of scalars, and of the rotation vectors.
            u_D: (n_vD,) user forces; none by default.
        """
        coef, (q_places, v_places) = self._coef[0], self._places
        self._breaks[0], self._breaks[1] = t, t_end
        self._base[0] = q_K
        coef[v_places, 0] = q_K[q_places]
        coef[:, 1] = v_K
        np.multiply(acc_K, 0.5, out=coef[:, 2])
        if u_D is not None:
            self._force[0, :, 0] = u_D
        self.structure.force = None if u_D is None else self._u_D

    def evaluate(self, t: Times) -> ConfigK:
        """(n, n_qK) at times (n,) of the piece [s]."""
        i = np.zeros(len(t), dtype=int)
        return pieces.evaluate(self._table, self._coef[i], self._base[i], t - self._breaks[0])[0]


def input_arrays(inputs: Input | HeldInput) -> ctypes.Structure:
    """The structure, which keeps its arrays alive."""
    if isinstance(inputs, HeldInput):
        return inputs.structure
    arrays = {name: getattr(inputs, name) for name in ("breaks", "coef", "base", "force")}
    return packed("InputArrays", n_segments=len(inputs.coef), **arrays)
