"""One step of an outside integrator: where in it guards may turn positive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import OdeSolver
from scipy.optimize import brentq, minimize_scalar

from fantoccini.arrays import Array
from fantoccini.runtime import ExternalRun

_LOOKS = 0.5 - 0.5 * np.cos(np.pi * np.arange(11) / 10)
"""Where within a step guards are looked at, shares of the step; closer together near its ends."""
_NEAR = 0.1
"""How far below zero, over its rise, a peak between the looks is examined."""


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the frozen-mode flow, and its guards.

    Attributes:
        run: whose step it is.
        y0, y1: (n_y,) at its ends, with the taut rows at h = 0 and hdot = 0.
        dense: time [s] -> y (n_y,) between them, to the integrator's tolerance.
        times: (n,) where guards have been looked at, both ends among them [s].
        guards: (n, n_guards) by row and drive, positive where its mode no longer holds.
    """

    run: ExternalRun
    y0: Array
    y1: Array
    dense: Callable[[float], Array]
    times: Array
    guards: Array

    @classmethod
    def of(cls, run: ExternalRun, solver: OdeSolver, y1: Array) -> Step:
        """The step from the run's present state that a solver has just made.

        Args:
            run: at the start of the step.
            solver: at its end.
            y1: (n_y,) the solver's state with the taut rows at h = 0 and hdot = 0.
        """
        dense = solver.dense_output()
        times = run.t + _LOOKS * (solver.t - run.t)
        times[-1] = solver.t
        states = [run.y, *(dense(t) for t in times[1:-1]), y1]
        guards = np.array([run.guards(t, y)[0] for t, y in zip(times, states, strict=True)])
        return cls(run, run.y, y1, dense, times, guards)

    def guard(self, row: int, t: float) -> float:
        """The guard of a row on the dense output."""
        return float(self.run.guards(t, self.dense(t))[0][row])

    def suspects(self) -> list[float]:
        """Times at which a guard is positive on the dense output, the earliest first [s]."""
        found = []
        for row, guards in enumerate(self.guards.T):
            found += [float(t) for t in self.times[1:][guards[1:] > 0.0][:1]]
            found += self._peaks(row, guards)
        return sorted(found)

    def _peaks(self, row: int, guards: Array) -> list[float]:
        """Where the guard of a row comes and goes between two looks."""
        before, at, after = guards[:-2], guards[1:-1], guards[2:]
        bent = 2.0 * at - before - after
        tops = np.flatnonzero((at <= 0.0) & (at >= before) & (at >= after) & (bent > 0.0))
        found = []
        for k in tops:
            # As high as a parabola through the three could be, and more, the looks being uneven.
            rise = (after[k] - before[k]) ** 2 / (4.0 * bent[k])
            if at[k] + rise < -_NEAR * (at[k] - min(before[k], after[k])):
                continue
            best = minimize_scalar(
                lambda t: -self.guard(row, t),
                bounds=(self.times[k], self.times[k + 2]),
                method="bounded",
                options={"xatol": 1e-6 * (self.times[-1] - self.times[0])},
            )
            if best.fun < 0.0:
                found.append(float(best.x))
        return found

    def root(self, row: int, t: float) -> float:
        """When the guard of a row first turns positive on the dense output, at the latest ``t``."""
        looks = np.flatnonzero((self.guards[:, row] > 0.0) & (self.times <= t))
        looks = looks[looks > 0]
        hi = min(t, self.times[looks[0]]) if len(looks) else t
        lo = self.times[np.searchsorted(self.times, hi) - 1]
        if not self.guard(row, lo) < 0.0 < self.guard(row, hi):
            return hi
        return float(brentq(lambda at: self.guard(row, at), lo, hi, xtol=1e-15, rtol=1e-15))

    def slope(self, row: int, t: float) -> float:
        """The rate of a row's guard on the dense output [1/s]."""
        apart = 1e-4 * (self.times[-1] - self.times[0])
        lo, hi = max(t - apart, self.times[0]), min(t + apart, self.times[-1])
        return (self.guard(row, hi) - self.guard(row, lo)) / (hi - lo)
