"""Motions in a row, joined by their states: position and velocity are continuous.

A motion consists of polynomials with coefficients `coef` between the times `breaks`, for each of
the n_vK driven velocities. A transition leads from the end of a motion to the start of the next.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, MaskRows, Times, VecK, polynomial
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.transitions import transition

_MAX_REST_RATE = 1e-9
"""Rate below which a sequence counts as at rest [m/s or rad/s]."""


class Motion(NamedTuple):
    """Arrays of a gesture; see :class:`Gesture`."""

    breaks: Times
    coef: Array
    named: MaskRows
    travel: VecK


@dataclass(frozen=True, eq=False)
class MotionSequence:
    """Motions in a row, as an immutable value: adding a motion returns another sequence.

    Attributes:
        bounds: (2, n_vK) bounds of speeds and accelerations of transitions.
        d, rate: (n_vK,) offsets and rates at its end.
        origin: (n_vK,) origin from which the next motion's offsets count.
        named: (n_vK,) bool, whether a coordinate moves.
        breaks, coef: breaks and coefficients of its motions, in order.
    """

    bounds: Array
    d: VecK
    rate: VecK
    origin: VecK
    named: MaskRows
    breaks: tuple[Times, ...] = (np.zeros(1),)
    coef: tuple[Array, ...] = ()

    @classmethod
    def empty(
        cls,
        bounds: Array,
        d: VecK | None = None,
        rate: VecK | None = None,
        origin: VecK | None = None,
    ) -> MotionSequence:
        """Sequence without motions, with offsets and rates at time 0; zero by default."""
        n = bounds.shape[1]
        d, rate, origin = (np.zeros(n) if x is None else x for x in (d, rate, origin))
        return cls(bounds, d, rate, origin, np.zeros(n, dtype=bool))

    @property
    def end(self) -> float:
        """Duration so far [s]."""
        return float(self.breaks[-1][-1])

    @property
    def motion(self) -> Motion:
        """All motions as one."""
        return Motion(
            np.concatenate(self.breaks), np.concatenate(self.coef), self.named, self.origin
        )

    def lead_time(self, motion: Motion) -> float:
        """Duration of the transition to the start of a motion [s]."""
        lead, _ = self._transition_to(motion)
        return 0.0 if lead is None else lead[0]

    def add(self, motion: Motion, begin: float = -np.inf) -> AddedMotion:
        """Sequence with a motion that begins at a time [s], or as soon after as bounds allow."""
        sequence, (lead, transition_end) = self, self._transition_to(motion)
        if begin - (0.0 if lead is None else lead[0]) > sequence.end:
            if sequence._is_moving:
                sequence = sequence.stopped()
                lead, transition_end = sequence._transition_to(motion)
            sequence = sequence.held_until(begin - (0.0 if lead is None else lead[0]))
        sequence = sequence._with_transition(lead)
        start, origin = sequence.end, np.where(motion.named, self.origin, transition_end)
        coef = np.array(motion.coef)
        coef[:, :, 0] += origin
        end_offsets, rate = piecewise.evaluate(motion.breaks, motion.coef, motion.breaks[-1])
        sequence = replace(
            sequence._with_pieces(start + motion.breaks[1:], coef),
            d=origin + end_offsets,
            rate=rate,
            origin=sequence.origin + motion.travel,
            named=sequence.named | motion.named,
        )
        return AddedMotion(sequence, start, 0.0 if lead is None else lead[0])

    def stopped(self) -> MotionSequence:
        """The sequence with all coordinates brought to rest at its end."""
        zero = np.zeros(len(self.d))
        target = np.full(len(self.d), np.nan)
        lead, arrived = transition(self.d, self.rate, target, zero, self.bounds)
        return replace(self._with_transition(lead), d=arrived, rate=zero)

    def stopped_if_moving(self) -> MotionSequence:
        """The sequence, stopped if it is not at rest."""
        return self.stopped() if self._is_moving else self

    def held_until(self, t: float) -> MotionSequence:
        """The sequence held at its last offsets, at rest, until a time [s]."""
        if t <= self.end:
            return self
        rest_coef = np.zeros((1, len(self.d), polynomial.N_COEF))
        rest_coef[0, :, 0] = self.d
        return self._with_pieces(np.array([t]), rest_coef)

    def pieces_after(self, t: float) -> tuple[Times, Array]:
        """Breaks and coefficients of the motions that end after a time [s], of which it has one."""
        k = next(k for k, breaks in enumerate(self.breaks) if breaks[-1] > t)
        start = self.breaks[k - 1][-1:]
        return np.concatenate([start, *self.breaks[k:]]), np.concatenate(self.coef[k - 1 :])

    @property
    def _is_moving(self) -> bool:
        return bool(np.any(np.abs(self.rate) > _MAX_REST_RATE))

    def _transition_to(self, motion: Motion) -> tuple[tuple[float, Array] | None, Array]:
        """Transition to the start of a motion, as :func:`transition` returns it."""
        start_offsets, rate = piecewise.evaluate(motion.breaks, motion.coef, 0.0)
        target = np.where(motion.named, self.origin + start_offsets, np.nan)
        return transition(self.d, self.rate, target, np.where(motion.named, rate, 0.0), self.bounds)

    def _with_transition(self, lead: tuple[float, Array] | None) -> MotionSequence:
        if lead is None:
            return self
        return self._with_pieces(np.array([self.end + lead[0]]), lead[1][None])

    def _with_pieces(self, breaks: Times, coef: Array) -> MotionSequence:
        return replace(self, breaks=(*self.breaks, breaks), coef=(*self.coef, coef))


class AddedMotion(NamedTuple):
    """Sequence to which a motion has been added.

    Attributes:
        sequence: sequence with the motion.
        start: beginning of the motion [s].
        lead: duration of the transition to its start [s].
    """

    sequence: MotionSequence
    start: float
    lead: float
