"""Motions one after the other, joined by state: position and velocity never jump."""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, MaskRows, Times, VecK, polynomial
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.transitions import transition

STILL = 1e-9
"""Rate below which a line is at rest [m/s or rad/s]."""


class Motion(NamedTuple):
    """The arrays of a gesture: see there."""

    breaks: Times
    coef: Array
    named: MaskRows
    travel: VecK


class Line:
    """Motions that follow one another.

    Attributes:
        end: where it ends so far [s].
        d, rate: (n_vK,) offsets and rates there.
        carried: (n_vK,) the place from which the next one's offsets count.
        named: (n_vK,) bool, what moves.

    Args:
        most: (2, n_vK) bounds of speeds and accelerations of what leads over.
        d, rate: at time 0; nothing when not given.
    """

    def __init__(self, most: Array, d: VecK | None = None, rate: VecK | None = None):
        n = most.shape[1]
        self.end, self.most = 0.0, most
        self.d = np.zeros(n) if d is None else d
        self.rate = np.zeros(n) if rate is None else rate
        self.carried, self.named = np.zeros(n), np.zeros(n, dtype=bool)
        self._breaks, self._coef = [np.zeros(1)], list[Array]()

    def kept(self) -> Line:
        """The line as it is now: what is added to this one does not change it."""
        made = copy.copy(self)
        made._breaks, made._coef = list(self._breaks), list(self._coef)
        return made

    def lead_time(self, motion: Motion) -> float:
        """How long the way to the start of a motion takes [s]."""
        lead, _ = self._lead(motion)
        return 0.0 if lead is None else lead[0]

    def add(self, motion: Motion) -> float:
        """Goes on with a motion; returns when it begins [s]."""
        lead, arrived = self._lead(motion)
        self._go(lead)
        begun = self.end
        held = np.where(motion.named, self.carried, arrived)
        own = np.array(motion.coef)
        own[:, :, 0] += held
        self._append(begun + motion.breaks[1:], own)
        last, self.rate = piecewise.at(motion.breaks, motion.coef, motion.breaks[-1])
        self.d = held + last
        self.carried = self.carried + motion.travel
        self.named = self.named | motion.named
        return begun

    def stop(self) -> None:
        """Brings everything to rest."""
        lead, arrived = transition(
            self.d, self.rate, np.full(len(self.d), np.nan), np.zeros(len(self.d)), self.most
        )
        self._go(lead)
        self.d, self.rate = arrived, np.zeros(len(self.d))

    def rest(self) -> None:
        """Brings everything to rest that is not."""
        if np.any(np.abs(self.rate) > STILL):
            self.stop()

    def wait(self, motion: Motion, begin: float) -> float:
        """Stays where it is, so that a motion begins at a time or soon after; the way there [s]."""
        lead = self.lead_time(motion)
        if begin - lead > self.end:
            if np.any(np.abs(self.rate) > STILL):
                self.stop()
                lead = self.lead_time(motion)
            self.hold(begin - lead)
        return lead

    def hold(self, until: float) -> None:
        """Stays where it is, at rest, until a time [s]."""
        if until > self.end:
            still = np.zeros((1, len(self.d), polynomial.N_COEF))
            still[0, :, 0] = self.d
            self._append(np.array([until]), still)

    @property
    def motion(self) -> Motion:
        """All of it."""
        return Motion(
            np.concatenate(self._breaks), np.concatenate(self._coef), self.named, self.carried
        )

    def _lead(self, motion: Motion) -> tuple[tuple[float, Array] | None, Array]:
        first, rate = piecewise.at(motion.breaks, motion.coef, 0.0)
        target = np.where(motion.named, self.carried + first, np.nan)
        return transition(self.d, self.rate, target, np.where(motion.named, rate, 0.0), self.most)

    def _go(self, lead: tuple[float, Array] | None) -> None:
        if lead is not None:
            self._append(np.array([self.end + lead[0]]), lead[1][None])

    def _append(self, breaks: Times, coef: Array) -> None:
        self._breaks.append(breaks)
        self._coef.append(coef)
        self.end = float(breaks[-1])
