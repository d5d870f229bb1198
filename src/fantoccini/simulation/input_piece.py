"""The inputs over one smooth piece of a run, and their variations."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, InputDerivative
from fantoccini.motion.polynomial import N_COEF

_SAMPLED = 0.5 - 0.5 * np.cos(np.pi * (np.arange(N_COEF) + 0.5) / N_COEF)
"""Chebyshev nodes of a piece, at which variations are sampled."""
_LAGRANGE = [(np.delete(_SAMPLED, i), s - np.delete(_SAMPLED, i)) for i, s in enumerate(_SAMPLED)]
"""The other nodes, and the node's distances from them: Lagrange's polynomials."""


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
        self._places = marionette.coordinates.scalars_K
        self._own = _evaluator(inputs, start, end)
        first = 2 * marionette.coordinates.n_vD + len(marionette.p)
        self._variation = InputVariation.none(marionette, first + len(toward) + len(along))
        self._variation.p[:, first - len(marionette.p) : first] = np.eye(len(marionette.p))
        self._first, self._others = first, [_evaluator(other, start, end) for other in toward]
        self._along = along
        self._sampled: tuple[Array, ...] = self._samples() if toward or along else ()

    def at(self, t: float) -> Inputs:
        """q_K, v_K, acc_K and u_D at a time of the piece [s]."""
        return self._own(min(max(t, self.start), self.end))

    def variation(self, t: float) -> InputVariation:
        """The changes at a time of the piece [s], valid until the next call.

        Columns: by the state at the start (all 0), by the parameters, towards the other inputs,
        along the derivatives.
        """
        out = self._variation
        if self._sampled:
            s = (min(max(t, self.start), self.end) - self.start) / (self.end - self.start)
            weights = np.array([np.prod((s - rest) / scale) for rest, scale in _LAGRANGE])
            for change, samples in zip(
                (out.q_K, out.v_K, out.acc_K, out.u_D), self._sampled, strict=True
            ):
                change[:, self._first :] = np.tensordot(weights, samples, axes=1)
        return out

    def _samples(self) -> tuple[Array, ...]:
        """Changes of q_K, v_K, acc_K, u_D at the nodes, (6, n, changes), which determine them.

        They are polynomials of the fifth degree.
        """
        times = self.start + _SAMPLED * (self.end - self.start)
        own = self._own(times)
        apart = [
            [a - mine for a, mine in zip(other(times), own, strict=True)]
            for other in self._others
        ]
        for change in apart:
            q_K = np.zeros_like(change[1])
            for at, v in self._places:
                q_K[:, v] = change[0][:, at]
            change[0] = q_K
        apart += [[*one.evaluate(times), np.zeros_like(own[3])] for one in self._along]
        return tuple(np.stack(columns, axis=-1) for columns in zip(*apart, strict=True))


def _evaluator(
    inputs: Input, start: float, end: float
) -> Callable[[float | Array], Inputs]:
    """times (...) -> (q_K, v_K, acc_K, u_D) by the polynomials between two times."""
    middle = 0.5 * (start + end)
    if not inputs.start <= middle <= inputs.end:
        q_K, v_K, acc_K = inputs.evaluate(min(max(middle, inputs.start), inputs.end))
        u_D = np.zeros(inputs.coordinates.n_vD)

        def held(t: float | Array) -> Inputs:
            q, v, acc, u = (
                np.broadcast_to(a, (*np.shape(t), len(a)))
                for a in (q_K, 0.0 * v_K, 0.0 * acc_K, u_D)
            )
            return q, v, acc, u

        return held
    i = min(int(np.searchsorted(inputs.breaks, middle, "right")) - 1, len(inputs.coef) - 1)
    force = None if inputs.force is None else inputs.force[i : i + 1]
    piece = dataclasses.replace(
        inputs,
        breaks=inputs.breaks[i : i + 2],
        coef=inputs.coef[i : i + 1],
        base=inputs.base[i : i + 1],
        force=force,
    )

    def at(t: float | Array) -> Inputs:
        t = np.clip(t, piece.start, piece.end)
        return *piece.evaluate(t), piece.evaluate_force(t)

    return at
