"""One step of an outside integrator: detection of guards that turn positive in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import OdeSolver
from scipy.optimize import brentq, minimize_scalar

from fantoccini.arrays import Array
from fantoccini.runtime import ExternalRun

_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(11) / 10)
"""Where guards are evaluated, shares of the step; closer together near its ends."""


@dataclass(frozen=True)
class Detection:
    """How closely guards are examined."""

    near: float = 0.1
    """Distance below zero, relative to its rise, of a peak between nodes that is examined."""
    peak_time: float = 1e-6  # Accuracy of the time of a peak, relative to the step
    root_time: float = 1e-15  # Accuracy of the time of a root, absolute [s] and relative: rounding
    difference: float = 1e-4
    """Step of the finite difference for a guard's rate, relative to the step."""


DETECTION = Detection()


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the flow with a fixed active set, and its guards.

    Attributes:
        run: whose step it is.
        y0, y1: (n_y,) at its ends, with the taut rows at h = 0 and hdot = 0.
        dense: time [s] -> y (n_y,) between them, to the integrator's tolerance.
        times: (n,) where guards were evaluated, including both ends [s].
        guards: (n, n_guards) by row and drive, positive where the active set no longer holds.
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
        times = run.t + _NODES * (solver.t - run.t)
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
        """Where the guard of a row turns positive and back between two nodes."""
        before, at, after = guards[:-2], guards[1:-1], guards[2:]
        bent = 2.0 * at - before - after
        tops = np.flatnonzero((at <= 0.0) & (at >= before) & (at >= after) & (bent > 0.0))
        found = []
        for k in tops:
            # The height of a parabola through the three, and more, since the nodes are uneven.
            rise = (after[k] - before[k]) ** 2 / (4.0 * bent[k])
            if at[k] + rise < -DETECTION.near * (at[k] - min(before[k], after[k])):
                continue
            best = minimize_scalar(
                lambda t: -self.guard(row, t),
                bounds=(self.times[k], self.times[k + 2]),
                method="bounded",
                options={"xatol": DETECTION.peak_time * (self.times[-1] - self.times[0])},
            )
            if best.fun < 0.0:
                found.append(float(best.x))
        return found

    def root(self, row: int, t: float) -> float:
        """When the guard of a row first turns positive on the dense output, at the latest ``t``."""
        nodes = np.flatnonzero((self.guards[:, row] > 0.0) & (self.times <= t))
        nodes = nodes[nodes > 0]
        hi = min(t, self.times[nodes[0]]) if len(nodes) else t
        lo = self.times[np.searchsorted(self.times, hi) - 1]
        if not self.guard(row, lo) < 0.0 < self.guard(row, hi):
            return hi
        tolerance = {"xtol": DETECTION.root_time, "rtol": DETECTION.root_time}
        return float(brentq(lambda at: self.guard(row, at), lo, hi, **tolerance))

    def slope(self, row: int, t: float) -> float:
        """The rate of a row's guard on the dense output [1/s]."""
        apart = DETECTION.difference * (self.times[-1] - self.times[0])
        lo, hi = max(t - apart, self.times[0]), min(t + apart, self.times[-1])
        return (self.guard(row, hi) - self.guard(row, lo)) / (hi - lo)
