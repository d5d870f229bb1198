"""The inputs over one smooth stretch, and what they are differentiated by."""

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
"""Parts of a stretch, at which changes are sampled: Chebyshev's."""

_LAGRANGE = [(np.delete(_SAMPLED, i), s - np.delete(_SAMPLED, i)) for i, s in enumerate(_SAMPLED)]
"""The other samples, and how far each is from them: Lagrange's polynomials."""


@dataclass(frozen=True, eq=False)
class Outside:
    """What is changed beside the state, at one time: a column for each change.

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
    def none(cls, marionette: Marionette, m: int) -> Outside:
        """No change, for m columns."""
        t = marionette.coordinates
        sizes = (t.n_vK, t.n_vK, t.n_vK, t.n_vD, len(marionette.p))
        return cls(*(np.zeros((size, m)) for size in sizes))


class Driving:
    """The inputs over one smooth stretch and the changes towards other inputs.

    Args:
        marionette: the puppet.
        inputs: bound inputs.
        toward: bound inputs; a change goes from ``inputs`` towards each.
        along: derivatives of the inputs, each a change by itself.
        start, end: of the stretch, within which no input has a break [s].
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
        self._own = _piece(inputs, start, end)
        first = 2 * marionette.coordinates.n_vD + len(marionette.p)
        self._outside = Outside.none(marionette, first + len(toward) + len(along))
        self._outside.p[:, first - len(marionette.p) : first] = np.eye(len(marionette.p))
        self._first, self._others = first, [_piece(other, start, end) for other in toward]
        self._along = along
        self._sampled = self._samples() if toward or along else ()

    def at(self, t: float) -> tuple[Array, Array, Array, Array]:
        """q_K, v_K, acc_K and u_D at a time of the stretch [s]."""
        return self._own(min(max(t, self.start), self.end))

    def outside(self, t: float) -> Outside:
        """The changes at a time of the stretch [s], good until the next call.

        Columns: by the state at the start, where nothing outside changes, by the parameters,
        towards the other inputs, along the derivatives.
        """
        out = self._outside
        if self._sampled:
            s = (min(max(t, self.start), self.end) - self.start) / (self.end - self.start)
            weights = np.array([np.prod((s - rest) / scale) for rest, scale in _LAGRANGE])
            for change, samples in zip(
                (out.q_K, out.v_K, out.acc_K, out.u_D), self._sampled, strict=True
            ):
                change[:, self._first :] = np.tensordot(weights, samples, axes=1)
        return out

    def _samples(self) -> tuple[Array, ...]:
        """Changes of q_K, v_K, acc_K, u_D at some times, (6, n, changes): they are polynomials of
        the fifth degree, so that these say all."""
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


def _piece(
    inputs: Input, start: float, end: float
) -> Callable[[float | Array], tuple[Array, ...]]:
    """times (...) -> (q_K, v_K, acc_K, u_D) on the polynomials that hold between two times."""
    middle = 0.5 * (start + end)
    if not inputs.start <= middle <= inputs.end:
        q_K, v_K, acc_K = inputs.evaluate(min(max(middle, inputs.start), inputs.end))
        still = q_K, 0.0 * v_K, 0.0 * acc_K, np.zeros(inputs.coordinates.n_vD)
        return lambda t: tuple(np.broadcast_to(a, (*np.shape(t), len(a))) for a in still)
    i = min(int(np.searchsorted(inputs.breaks, middle, "right")) - 1, len(inputs.coef) - 1)
    force = None if inputs.force is None else inputs.force[i : i + 1]
    piece = dataclasses.replace(
        inputs,
        breaks=inputs.breaks[i : i + 2],
        coef=inputs.coef[i : i + 1],
        base=inputs.base[i : i + 1],
        force=force,
    )

    def at(t: float | Array) -> tuple[Array, ...]:
        t = np.clip(t, piece.start, piece.end)
        return *piece.evaluate(t), piece.evaluate_force(t)

    return at
