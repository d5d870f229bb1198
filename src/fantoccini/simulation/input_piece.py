"""The inputs over one smooth piece of a run, and their variations."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, InputDerivative
from fantoccini.motion.polynomial import N_COEF

_SAMPLED = 0.5 - 0.5 * np.cos(np.pi * (np.arange(N_COEF) + 0.5) / N_COEF)
"""Chebyshev nodes of a piece, at which variations are sampled."""
_POWERS = np.linalg.inv(np.vander(_SAMPLED, increasing=True))
"""From values at the nodes to coefficients of the powers of the time over the whole."""


Inputs = tuple[Array, Array, Array, Array]
"""q_K, v_K, acc_K and u_D."""


@dataclass(frozen=True, eq=False)
class InputVariation:
    """Changes of inputs and parameters at one time, a column for each.

    Attributes:
        q_K: (n_vK, m) tangent vectors of the driven configuration.
        v_K, acc_K: (n_vK, m).
        u_D: (n_vD, m).
        p: (n_p, m).
    """

    q_K: Array
    v_K: Array
    acc_K: Array
    u_D: Array
    p: Array

    @classmethod
    def none(cls, marionette: Marionette, m: int) -> InputVariation:
        """No change, for m columns."""
        t = marionette.coordinates
        sizes = (t.n_vK, t.n_vK, t.n_vK, t.n_vD, len(marionette.p))
        return cls(*(np.zeros((size, m)) for size in sizes))


class InputPiece:
    """The inputs over one smooth piece, and the changes towards other inputs.

    Args:
        marionette: the puppet.
        inputs: bound inputs.
        toward: bound inputs; a change goes from ``inputs`` towards each.
        along: derivatives of the inputs, each a change by itself.
        start, end: of the piece, within which no input has a break [s].
    """

    def __init__(
        self,
        marionette: Marionette,
        inputs: Input,
        toward: Sequence[Input],
        along: Sequence[InputDerivative],
        start: float,
        end: float,
    ):
        self.start, self.end = start, end
        table = marionette.coordinates
        self._places = table.scalars_K
        self.inputs = _piece(inputs, start, end)
        first = 2 * table.n_vD + len(marionette.p)
        self._variation = InputVariation.none(marionette, first + len(toward) + len(along))
        self._variation.p[:, first - len(marionette.p) : first] = np.eye(len(marionette.p))
        self._first, self._others = first, [_piece(other, start, end) for other in toward]
        self._along = along
        self.powers = self._in_powers()

    def at(self, t: float | Array) -> Inputs:
        """q_K, v_K, acc_K and u_D at times (...) of the piece [s]."""
        return _values(self.inputs, np.clip(t, self.start, self.end))

    def variation(self, t: float) -> InputVariation:
        """The changes at a time of the piece [s], valid until the next call.

        Columns: by the state at the start (all 0), by the parameters, towards the other inputs,
        along the derivatives.
        """
        out, n = self._variation, len(self._variation.q_K)
        s = (min(max(t, self.start), self.end) - self.start) / (self.end - self.start)
        found = np.tensordot(s ** np.arange(N_COEF), self.powers, axes=1)
        parts = (out.q_K, out.v_K, out.acc_K, out.u_D)
        for change, values in zip(parts, np.split(found, [n, 2 * n, 3 * n]), strict=True):
            change[:, self._first :] = values
        return out

    def _in_powers(self) -> Array:
        """(6, 3 n_vK + n_vD, changes) changes of q_K, v_K, acc_K and u_D along the inputs.

        They are polynomials of the fifth degree in the time since the start over the whole.
        """
        times = self.start + _SAMPLED * (self.end - self.start)
        own = self.at(times)
        apart = [
            [a - mine for a, mine in zip(_values(other, times), own, strict=True)]
            for other in self._others
        ]
        for change in apart:
            q_K = np.zeros_like(change[1])
            for at, v in self._places:
                q_K[:, v] = change[0][:, at]
            change[0] = q_K
        apart += [[*one.evaluate(times), np.zeros_like(own[3])] for one in self._along]
        samples = [np.concatenate(change, axis=1) for change in apart]
        width = 3 * len(self._variation.q_K) + len(self._variation.u_D)
        stacked = np.stack(samples, axis=-1) if samples else np.zeros((N_COEF, width, 0))
        return np.tensordot(_POWERS, stacked, axes=1)


def _values(inputs: Input, t: float | Array) -> Inputs:
    return *inputs.evaluate(t), inputs.evaluate_force(t)


def _piece(inputs: Input, start: float, end: float) -> Input:
    """The one piece of inputs between two times; where they have ended, one that holds."""
    middle = 0.5 * (start + end)
    if not inputs.start <= middle <= inputs.end:
        q_K = inputs.evaluate(min(max(middle, inputs.start), inputs.end))[0]
        coef = np.zeros((1, inputs.coordinates.n_vK, N_COEF))
        for q, v in inputs.coordinates.scalars_K:
            coef[0, v, 0] = q_K[q]
        breaks = np.array([start, end])
        return dataclasses.replace(
            inputs, breaks=breaks, coef=coef, base=q_K[None], force=None
        )
    i = min(int(np.searchsorted(inputs.breaks, middle, "right")) - 1, len(inputs.coef) - 1)
    return dataclasses.replace(
        inputs,
        breaks=inputs.breaks[i : i + 2],
        coef=inputs.coef[i : i + 1],
        base=inputs.base[i : i + 1],
        force=None if inputs.force is None else inputs.force[i : i + 1],
    )
