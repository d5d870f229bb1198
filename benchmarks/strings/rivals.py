"""Two classical ways to keep a string's length, on the point mass: springs and stabilisation.

Penalty: the string is a spring with a critical damper that acts while it is too long,

    tension = max(0, k h + 2 sqrt(k m) hdot)  where h > 0

Baumgarte: the tension makes the length obey hddot + 2 a hdot + a^2 h = 0 while it is too long,

    tension = m (hddot of the free mass + 2 a hdot + a^2 h)  where h >= 0

clipped at 0 or not. With an impulse, the radial speed is removed at the step in which the length is
reached, and the string then holds until its tension falls to 0. All are stepped by RK4; lanes of
different settings run side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base.arrays import Array

PENALTY = "penalty"
CLIPPED = "Baumgarte"
UNCLIPPED = "Baumgarte, not clipped"
IMPULSE = "Baumgarte with impulse"
METHODS = (PENALTY, CLIPPED, UNCLIPPED, IMPULSE)

STAGES = 4
"""Evaluations of the model per step."""


@dataclass(frozen=True)
class Ends:
    """Results of lanes.

    Attributes:
        state: (n, 4) x, z, vx, vz at the end; NaN if it diverged [m], [m/s].
        stretch: (n,) largest extension of the string beyond its length [m].
        lowest: (n,) lowest tension [N].
    """

    state: Array
    stretch: Array
    lowest: Array


@dataclass(frozen=True)
class Lanes:
    """Point masses on strings from (0, 0).

    Attributes:
        method: (n,) one of METHODS.
        setting: (n,) stiffness k [N/m] of a penalty, rate a [1/s] of a stabilisation.
        length: [m].
        mass: [kg].
        gravity: [m/s^2].
    """

    method: Array
    setting: Array
    length: float
    mass: float
    gravity: float

    def run(self, start: Array, t_end: float, dt: float) -> Ends:
        """Steps all lanes from one state.

        Args:
            start: (4,) x, z, vx, vz, on the circle.
            t_end: [s], a multiple of ``dt``.
            dt: [s].
        """
        n = len(self.setting)
        y, held = np.tile(np.asarray(start, float), (n, 1)), np.ones(n, dtype=bool)
        stretch, lowest = np.zeros(n), np.zeros(n)
        impulse = self.method == IMPULSE
        with np.errstate(all="ignore"):
            for _ in range(round(t_end / dt)):
                k1, pull = self._rate(y, held)
                np.fmin(lowest, pull, out=lowest)
                held &= pull > 0.0
                k2, _ = self._rate(y + dt / 2 * k1, held)
                k3, _ = self._rate(y + dt / 2 * k2, held)
                k4, _ = self._rate(y + dt * k3, held)
                y = y + dt / 6 * (k1 + 2 * (k2 + k3) + k4)
                r = np.sqrt(y[:, 0] ** 2 + y[:, 1] ** 2)
                h = r - self.length
                hdot = (y[:, 0] * y[:, 2] + y[:, 1] * y[:, 3]) / r
                caught = impulse & ~held & (h >= 0.0) & (hdot > 0.0)
                y[:, 2:] -= np.where(caught, hdot / r, 0.0)[:, None] * y[:, :2]
                held |= caught
                np.fmax(stretch, h, out=stretch)
            lost = ~(np.abs(y).max(axis=1) < 1e3)
        y[lost], stretch[lost], lowest[lost] = np.nan, np.nan, np.nan
        return Ends(y, stretch, lowest)

    def _rate(self, y: Array, held: Array) -> tuple[Array, Array]:
        """(n, 4) rates of the states, and (n,) tensions."""
        x, v = y[:, :2], y[:, 2:]
        r = np.sqrt(x[:, 0] ** 2 + x[:, 1] ** 2)
        h, hdot = r - self.length, (x[:, 0] * v[:, 0] + x[:, 1] * v[:, 1]) / r
        square = v[:, 0] ** 2 + v[:, 1] ** 2
        free = (square - hdot**2) / r - self.gravity * x[:, 1] / r
        a = self.setting
        spring = a * h + 2.0 * np.sqrt(a * self.mass) * hdot
        stabilised = self.mass * (free + 2.0 * a * hdot + a**2 * h)
        pull = np.where(self.method == PENALTY, spring, stabilised)
        acts = np.where(self.method == IMPULSE, held, h >= 0.0)
        pull = np.where(acts & ((pull > 0.0) | (self.method == UNCLIPPED)), pull, 0.0)
        rate = np.empty_like(y)
        rate[:, :2] = v
        rate[:, 2:] = -(pull / (self.mass * r))[:, None] * x
        rate[:, 3] -= self.gravity
        return rate, pull
