"""Inputs over smooth pieces of a run, and their variations.

A variation is a small change. q_K are the driven coordinates (ends and lengths of strings), v_K and
acc_K their rates; breaks are the times at which pieces of an input meet, and `coef` the
coefficients of these polynomials. In names, D stands for dynamic coordinates, which move by the
equations of motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from fantoccini.base import N_COEF, Array, shifted
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, InputDerivative, Inputs, constants

_EXPONENTS = np.arange(N_COEF)


@dataclass(frozen=True, eq=False)
class InputVariation:
    """Changes of inputs and parameters at one time; each change is a column.

    Attributes:
        q_K: (n_vK, m) tangent vectors of the driven configuration.
        v_K, acc_K: (n_vK, m) changes of driven velocity and acceleration.
        u_D: (n_vD, m) changes of the user forces.
        p: (n_p, m) changes of the parameters.
    """

    q_K: Array
    v_K: Array
    acc_K: Array
    u_D: Array
    p: Array

    @classmethod
    def zeros(cls, marionette: Marionette, m: int) -> InputVariation:
        """Zero changes of m columns."""
        t = marionette.coordinates
        sizes = (t.n_vK, t.n_vK, t.n_vK, t.n_vD, len(marionette.p))
        return cls(*(np.zeros((size, m)) for size in sizes))

    def widened(self, n_extra: int) -> InputVariation:
        """The changes, with ``n_extra`` additional columns of zeros."""
        parts = (self.q_K, self.v_K, self.acc_K, self.u_D, self.p)
        widened = [np.zeros((len(part), part.shape[1] + n_extra)) for part in parts]
        for target, part in zip(widened, parts, strict=True):
            target[:, : part.shape[1]] = part
        return InputVariation(*widened)


class InputPiece:
    """Inputs over one smooth piece, and their changes.

    Attributes:
        start, end: start and end of the piece, in which no input has a break [s].
        inputs: inputs of this piece alone.
        powers: (6, 3 n_vK + n_vD, changes) changes of q_K, v_K, acc_K, u_D: coefficients of powers
            of (t - start)/(end - start).
    """

    def __init__(
        self, variation: InputVariation, inputs: Input, powers: Array, start: float, end: float
    ):
        self.start, self.end = start, end
        self.inputs, self.powers, self._variation = inputs, powers, variation

    def at(self, t: float) -> tuple[Array, Array, Array, Array]:
        """Values of q_K, v_K, acc_K and u_D at a time of the piece [s]."""
        t = min(max(t, self.start), self.end)
        return *self.inputs.evaluate(t), self.inputs.evaluate_force(t)

    def variation(self, t: float) -> InputVariation:
        """The changes at a time of the piece [s], valid until the next call.

        The columns are derivatives with respect to the start state (all 0) and parameters, towards
        the other inputs, and along the derivatives.
        """
        variation, n, m = self._variation, len(self._variation.q_K), self.powers.shape[2]
        if m:
            s = (min(max(t, self.start), self.end) - self.start) / (self.end - self.start)
            array = np.tensordot(s**_EXPONENTS, self.powers, axes=1)
            fields = (variation.q_K, variation.v_K, variation.acc_K, variation.u_D)
            for field, values in zip(fields, np.split(array, [n, 2 * n, 3 * n]), strict=True):
                field[:, -m:] = values
        return variation


class InputChanges:
    """Inputs of a run, and their changes.

    Args:
        marionette: the puppet.
        inputs: bound inputs.
        toward: other bound inputs; changes are from ``inputs`` towards each.
        along: derivatives of the inputs; each one is a change with its own column.

    Attributes:
        inputs: inputs of the run.
        breaks: breaks of all inputs and derivatives [s].
        columns: number of columns of variations.
    """

    def __init__(
        self,
        marionette: Marionette,
        inputs: Input,
        toward: Inputs | None,
        along: Sequence[InputDerivative],
    ):
        table, n_p = marionette.coordinates, len(marionette.p)
        self.inputs, self._inputs_as_batch = inputs, Inputs.stack([inputs])
        self._other_inputs = toward
        # Neighbouring derivatives with the same breaks are evaluated together.
        by_breaks = groupby(along, key=lambda item: item.breaks.tobytes())
        groups = [list(group) for _, group in by_breaks]
        self._derivative_groups = [
            (g[0].breaks[None], np.array([item.coef for item in g])) for g in groups
        ]
        breaks = [self._inputs_as_batch.breaks, *(array for array, _ in self._derivative_groups)]
        breaks += [] if toward is None else [toward.breaks]
        self.breaks = np.unique(np.concatenate([array.ravel() for array in breaks]))
        self._rotation_columns = np.setdiff1d(
            np.arange(table.n_vK), [v for _, v in table.scalars_K]
        )
        first_column = 2 * table.n_vD + n_p
        self.columns = first_column + (0 if toward is None else len(toward)) + len(along)
        self._variation = InputVariation.zeros(marionette, self.columns)
        self._variation.p[:, first_column - n_p : first_column] = np.eye(n_p)

    def piece(self, start: float, end: float) -> InputPiece:
        """Piece between two times [s]; there must be no break between them."""
        n_v, n = len(self._variation.v_K), len(self._variation.u_D)
        motion_coef, force_coef = [np.zeros((0, n_v, N_COEF))], [np.zeros((0, n, N_COEF))]
        if self._other_inputs is not None:
            own_powers, other_powers = (
                _powers_from_start(item, start, end)
                for item in (self._inputs_as_batch, self._other_inputs)
            )
            motion_coef.append(other_powers[0] - own_powers[0])
            motion_coef[-1][:, self._rotation_columns] = 0.0
            force_coef.append(
                np.broadcast_to(other_powers[1] - own_powers[1], (len(other_powers[0]), n, N_COEF))
            )
        for breaks, coef in self._derivative_groups:
            motion_coef.append(_shifted_to_start(breaks, coef, start, end))
            force_coef.append(np.zeros((len(coef), n, N_COEF)))
        powers = powers_of_time(
            np.concatenate(motion_coef), np.concatenate(force_coef), end - start
        )
        return InputPiece(self._variation, one_piece(self.inputs, start, end), powers, start, end)


def powers_of_time(motion_coef: Array, force_coef: Array, duration: float) -> Array:
    """Changes of q_K, v_K, acc_K and u_D, (6, 3 n_vK + n_vD, m), as in :class:`InputPiece`.

    Args:
        motion_coef: (m, n_vK, 6) changes of q_K as coefficients of powers of the time [s].
        force_coef: (m, n_vD, 6) changes of u_D.
        duration: duration of the piece [s].
    """
    q_K, u_D = motion_coef * duration**_EXPONENTS, force_coef * duration**_EXPONENTS
    v_K, acc_K = np.zeros_like(q_K), np.zeros_like(q_K)
    v_K[..., :-1] = q_K[..., 1:] * (_EXPONENTS[1:] / duration)
    acc_K[..., :-1] = v_K[..., 1:] * (_EXPONENTS[1:] / duration)
    return np.concatenate([q_K, v_K, acc_K, u_D], axis=1).transpose(2, 1, 0)


def _powers_from_start(inputs: Inputs, start: float, end: float) -> tuple[Array, Array]:
    """Polynomials of n inputs between two times, in powers of t - start: (n, n_vK or n_vD, 6).

    Without forces the second array is (1, n_vD, 6), of zeros.
    """
    motion_coef = _shifted_to_start(inputs.breaks, inputs.coef, start, end)
    if inputs.force is None:
        return motion_coef, np.zeros((1, inputs.coordinates.n_vD, N_COEF))
    force_coef = _shifted_to_start(inputs.breaks, inputs.force, start, end)
    middle = 0.5 * (start + end)
    force_coef[~((inputs.breaks[:, 0] <= middle) & (middle <= inputs.breaks[:, -1]))] = 0.0
    return motion_coef, force_coef


def _shifted_to_start(breaks: Array, coef: Array, start: float, end: float) -> Array:
    """Pieces of polynomials (n, n_seg, k, 6) between two times, in t - start: (n, k, 6).

    Before the first break and after the last one they are constant.
    """
    n, n_seg = coef.shape[:2]
    breaks = np.broadcast_to(breaks, (n, n_seg + 1))
    first, last, rows = breaks[:, 0], breaks[:, -1], np.arange(n)
    middle = 0.5 * (start + end)
    clipped = np.clip(middle, first, last)
    last_piece = (np.diff(breaks) > 0.0).sum(axis=1) - 1  # pieces at the end may have no duration
    i = np.minimum((breaks[:, :-1] <= clipped[:, None]).sum(axis=1) - 1, last_piece)
    is_outside = (middle < first) | (middle > last)
    time_in_piece = np.where(is_outside, clipped, start) - breaks[rows, i]
    shifted_coef = shifted(coef[rows, i], time_in_piece)
    shifted_coef[is_outside, :, 1:] = 0.0
    return shifted_coef


def one_piece(inputs: Input, start: float, end: float) -> Input:
    """Piece of inputs between two times; outside of the inputs, a constant piece."""
    middle = 0.5 * (start + end)
    if not inputs.start <= middle <= inputs.end:
        q_K = inputs.evaluate(min(max(middle, inputs.start), inputs.end))[0]
        coef, base = constants(inputs.coordinates, q_K)
        return dataclasses.replace(
            inputs, breaks=np.array([start, end]), coef=coef[None], base=base[None], force=None
        )
    i = min(int(np.searchsorted(inputs.breaks, middle, "right")) - 1, len(inputs.coef) - 1)
    return dataclasses.replace(
        inputs,
        breaks=inputs.breaks[i : i + 2],
        coef=inputs.coef[i : i + 1],
        base=inputs.base[i : i + 1],
        force=None if inputs.force is None else inputs.force[i : i + 1],
    )
