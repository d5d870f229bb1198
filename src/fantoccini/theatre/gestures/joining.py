"""Motions in a row, joined by their states: position and velocity are continuous."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, MaskRows, Times, VecK, polynomial
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.transitions import transition

_MAX_REST_RATE = 1e-9
"""Rate below which a line counts as at rest [m/s or rad/s]."""


class Motion(NamedTuple):
    """Arrays of a gesture; see :class:`Gesture`."""

    breaks: Times
    coef: Array
    named: MaskRows
    travel: VecK


@dataclass(frozen=True, eq=False)
class Line:
    """Motions in a row, as an immutable value: adding a motion returns another line.

    Attributes:
        bounds: (2, n_vK) bounds of speeds and accelerations of transitions.
        d, rate: (n_vK,) offsets and rates at its end.
        carried: (n_vK,) origin from which the next motion's offsets count.
        named: (n_vK,) bool, whether a coordinate moves.
        breaks, coef: breaks and coefficients of its motions, in order.
    """

    bounds: Array
    d: VecK
    rate: VecK
    carried: VecK
    named: MaskRows
    breaks: tuple[Times, ...] = (np.zeros(1),)
    coef: tuple[Array, ...] = ()

    @classmethod
    def empty(
        cls,
        bounds: Array,
        d: VecK | None = None,
        rate: VecK | None = None,
        carried: VecK | None = None,
    ) -> Line:
        """Line without motions, with offsets and rates at time 0; zero by default."""
        n = bounds.shape[1]
        d, rate, carried = (np.zeros(n) if x is None else x for x in (d, rate, carried))
        return cls(bounds, d, rate, carried, np.zeros(n, dtype=bool))

    @property
    def end(self) -> float:
        """Duration so far [s]."""
        return float(self.breaks[-1][-1])

    @property
    def motion(self) -> Motion:
        """All motions as one."""
        return Motion(
            np.concatenate(self.breaks), np.concatenate(self.coef), self.named, self.carried
        )

    def lead_time(self, motion: Motion) -> float:
        """Duration of the transition to the start of a motion [s]."""
        lead, _ = self._lead(motion)
        return 0.0 if lead is None else lead[0]

    def add(self, motion: Motion, begin: float = -np.inf) -> Continued:
        """The line with a motion that begins at a time [s], or as soon after as bounds allow."""
        line, (lead, arrived) = self, self._lead(motion)
        if begin - (0.0 if lead is None else lead[0]) > line.end:
            if line._moves:
                line = line.stopped()
                lead, arrived = line._lead(motion)
            line = line.held(begin - (0.0 if lead is None else lead[0]))
        line = line._with_lead(lead)
        start, origin = line.end, np.where(motion.named, self.carried, arrived)
        coef = np.array(motion.coef)
        coef[:, :, 0] += origin
        last, rate = piecewise.at(motion.breaks, motion.coef, motion.breaks[-1])
        line = replace(
            line._with_pieces(start + motion.breaks[1:], coef),
            d=origin + last,
            rate=rate,
            carried=line.carried + motion.travel,
            named=line.named | motion.named,
        )
        return Continued(line, start, 0.0 if lead is None else lead[0])

    def stopped(self) -> Line:
        """The line with all coordinates brought to rest at its end."""
        zero = np.zeros(len(self.d))
        target = np.full(len(self.d), np.nan)
        lead, arrived = transition(self.d, self.rate, target, zero, self.bounds)
        return replace(self._with_lead(lead), d=arrived, rate=zero)

    def rested(self) -> Line:
        """The line, stopped if it is not at rest."""
        return self.stopped() if self._moves else self

    def held(self, until: float) -> Line:
        """The line held at its last offsets, at rest, until a time [s]."""
        if until <= self.end:
            return self
        still = np.zeros((1, len(self.d), polynomial.N_COEF))
        still[0, :, 0] = self.d
        return self._with_pieces(np.array([until]), still)

    def after(self, t: float) -> tuple[Times, Array]:
        """Breaks and coefficients of the motions that end after a time [s], of which it has one."""
        k = next(k for k, own in enumerate(self.breaks) if own[-1] > t)
        first = self.breaks[k - 1][-1:]
        return np.concatenate([first, *self.breaks[k:]]), np.concatenate(self.coef[k - 1 :])

    @property
    def _moves(self) -> bool:
        return bool(np.any(np.abs(self.rate) > _MAX_REST_RATE))

    def _lead(self, motion: Motion) -> tuple[tuple[float, Array] | None, Array]:
        """Transition to the start of a motion, as :func:`transition` returns it."""
        first, rate = piecewise.at(motion.breaks, motion.coef, 0.0)
        target = np.where(motion.named, self.carried + first, np.nan)
        return transition(self.d, self.rate, target, np.where(motion.named, rate, 0.0), self.bounds)

    def _with_lead(self, lead: tuple[float, Array] | None) -> Line:
        if lead is None:
            return self
        return self._with_pieces(np.array([self.end + lead[0]]), lead[1][None])

    def _with_pieces(self, breaks: Times, coef: Array) -> Line:
        return replace(self, breaks=(*self.breaks, breaks), coef=(*self.coef, coef))


class Continued(NamedTuple):
    """Line to which a motion has been added.

    Attributes:
        line: line with the motion.
        start: beginning of the motion [s].
        lead: duration of the transition to its start [s].
    """

    line: Line
    start: float
    lead: float
