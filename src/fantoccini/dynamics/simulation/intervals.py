"""Derivatives of an event-driven run over the intervals of its inputs.

Over interval i, in which driven coordinates have constant accelerations,

    z_{i+1} = A_i z_i + B_i dacc_K + C_i dp,   z = (dq_D, dv_D, dq_K, dv_K)

with the saltation matrices of the events in it.

z is a change of the state: of dynamic coordinates and velocities (D), then of driven ones (K: ends
and lengths of strings); acc_K are the driven accelerations and p the parameters. A saltation matrix
maps changes before an event to those after it; breaks are the ends of intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import N_COEF, Array, InputError, Mistake, check_positive, shifted
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.input_piece import (
    InputPiece,
    InputVariation,
    one_piece,
    powers_of_time,
)
from fantoccini.dynamics.simulation.run_changes import RunChanges, check_differentiable
from fantoccini.dynamics.simulation.saltation import Passage
from fantoccini.dynamics.simulation.variation import Variation
from fantoccini.motion import Input, Trajectory

_SAME_TIME = 1e-9
"""Distance of times that count as equal [s]."""


@dataclass(frozen=True, eq=False)
class IntervalDerivatives:
    """Derivatives over N intervals.

    A change at a start that would stretch or slacken taut rows is replaced by the nearest one that
    does not, in the metric of M_DD.

    Attributes:
        A: (N, n_z, n_z) derivatives by (dq_D, dv_D, dq_K, dv_K) at the start.
        B: (N, n_z, n_vK) derivatives by the accelerations.
        C: (N, n_z, n_p) derivatives by the parameters.
        passages: catches, impacts and stops of contact points in every interval.
    """

    A: Array
    B: Array
    C: Array
    passages: tuple[tuple[Passage, ...], ...]

    @property
    def differentiable(self) -> bool:
        """Whether the derivatives exist; see :class:`fantoccini.dynamics.RunSensitivity`."""
        return all(passage.differentiable for passages in self.passages for passage in passages)


def interval_derivatives(
    marionette: Marionette,
    run: Trajectory,
    inputs: Input,
    *,
    rtol: float = 1e-10,
    atol: float = 1e-10,
) -> IntervalDerivatives:
    """Derivatives A_i, B_i, C_i over the intervals between breaks of inputs, through events.

    Args:
        marionette: the puppet, without driven rotations.
        run: event-driven run with samples at all breaks, as by default.
        inputs: bound inputs of the run, of constant accelerations (``Input.segments``).
        rtol, atol: tolerances of the integration of state and derivatives.

    Raises:
        InputError: accelerations are not constant, rotations are driven, or the run has no
            sample at a break.
        StateError: there is no derivative; see :func:`fantoccini.dynamics.sensitivity`.
    """
    check_positive(rtol=rtol, atol=atol)
    table = marionette.coordinates
    n, k, n_p = table.n_vD, table.n_vK, len(marionette.p)
    sample_at_break = np.searchsorted(run.t, inputs.breaks + _SAME_TIME, side="right") - 1
    _check(marionette, run, inputs, run.t[np.maximum(sample_at_break, 0)])
    check_differentiable(run)
    changes = _IntervalChanges(marionette, inputs)
    changes_along = RunChanges(run, changes, Variation(marionette, rtol, atol))
    N = len(sample_at_break) - 1
    A, B, C = (np.zeros((N, 2 * (n + k), m)) for m in (2 * (n + k), k, n_p))
    passages = []
    for i, T in enumerate(np.diff(inputs.breaks)):
        first = len(changes_along.passages)
        *_, (_, Z) = changes_along.samples(
            np.zeros(0), int(sample_at_break[i]), int(sample_at_break[i + 1])
        )
        by_z, C[i, : 2 * n], by_K, B[i, : 2 * n] = np.split(
            Z, [2 * n, 2 * n + n_p, 2 * n + n_p + 2 * k], axis=1
        )
        A[i, : 2 * n] = np.concatenate([by_z, by_K], axis=1)
        A[i, 2 * n :, 2 * n :] = np.kron([[1.0, T], [0.0, 1.0]], np.eye(k))
        B[i, 2 * n :] = np.kron([[0.5 * T * T], [T]], np.eye(k))
        passages.append(tuple(changes_along.passages[first:]))
    return IntervalDerivatives(A, B, C, tuple(passages))


def _check(marionette: Marionette, run: Trajectory, inputs: Input, sample_times: Array) -> None:
    """Raises InputError unless accelerations are constant and samples are at their breaks."""
    table, mistakes = marionette.coordinates, list[Mistake]()
    for name in table.rotations:
        text = "turns; only scalar coordinates may be driven"
        mistakes.append(Mistake("inputs", None, name, text))
    for q, v in table.scalars_K:
        if np.any(inputs.coef[:, v, 3:]):
            text = "has an acceleration that is not constant between the breaks"
            mistakes.append(Mistake("inputs", None, table.q_K[q], text))
    missing = inputs.breaks[~(np.abs(sample_times - inputs.breaks) <= _SAME_TIME)]
    if len(missing):
        text = f"break at {missing[0]:g} s, where the run has no sample"
        mistakes.append(Mistake("inputs", None, "", text))
    if mistakes:
        raise InputError(mistakes)


class _IntervalChanges:
    """Changes of the inputs that restart at every break: by q_K and v_K there, and by acc_K.

    Attributes:
        inputs: inputs of the run.
        breaks: breaks of the inputs [s].
        columns: number of columns of variations.
    """

    def __init__(self, marionette: Marionette, inputs: Input):
        table = marionette.coordinates
        self.inputs, self.breaks = inputs, inputs.breaks
        k, n_p, first = table.n_vK, len(marionette.p), 2 * table.n_vD
        self.columns = first + n_p + 3 * k
        self._variation = InputVariation.zeros(marionette, self.columns)
        self._variation.p[:, first : first + n_p] = np.eye(n_p)
        self._unit_coef = np.zeros((3, k, k, N_COEF))
        for power, size in enumerate((1.0, 1.0, 0.5)):
            self._unit_coef[power, :, :, power] = size * np.eye(k)

    def piece(self, start: float, end: float) -> InputPiece:
        """Piece between two times with no break between them [s]."""
        i = np.searchsorted(self.breaks, 0.5 * (start + end), side="right") - 1
        k, n = self._unit_coef.shape[1], len(self._variation.u_D)
        delay = np.full(3 * k, start - self.breaks[i])
        coef = shifted(self._unit_coef.reshape(3 * k, k, N_COEF), delay)
        powers = powers_of_time(coef, np.zeros((3 * k, n, N_COEF)), end - start)
        piece = one_piece(self.inputs, start, end)
        return InputPiece(self._variation, piece, powers, start, end)
