"""A pendulum with a laterally moving pivot and a reeled taut string, as one scalar equation.

With the pivot at (X(t), 0), the length L(t) and the angle a from straight down,

    L a'' + 2 L' a' + g sin(a) + X'' cos(a) = 0
    tension = m (L a'^2 + g cos(a) - X'' sin(a) - L'')
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853

from .arm2d_events import Polynomials
from .mechanisms import hermite

PUPPET = """
puppet: reeling_pendulum
bodies:
  - name: bob
    joint: {type: translation, axes: [x, z]}
    mass: 0.3
strings:
  - name: line
    path: [{body: bob, at: [0, 0, 0]}, {driven: [x], at: [0, 0, 0]}]
    length: driven
pose: {line.length: 1.0}
"""
"""The same pendulum as a puppet."""


@dataclass(frozen=True)
class Reeling:
    """X = A sin(w t) and L = L0 + B sin(v t).

    Attributes:
        A, w: swing of the pivot [m], [rad/s].
        L0, B, v: middle and swing of the length [m], [rad/s].
        mass: [kg].
        gravity: [m/s^2].
        angle, rate: at the start [rad], [rad/s].
    """

    A: float = 0.1
    w: float = 4.0
    L0: float = 0.8
    B: float = 0.2
    v: float = 3.0
    mass: float = 0.3
    gravity: float = 9.81
    angle: float = 0.4
    rate: float = 0.0

    def at(self, t):
        """X and L with their first and second derivatives, each (2, ...)."""
        s, c = np.sin(self.w * t), np.cos(self.w * t)
        p, q = np.sin(self.v * t), np.cos(self.v * t)
        position = np.array([self.A * s, self.L0 + self.B * p])
        velocity = np.array([self.A * self.w * c, self.B * self.v * q])
        return position, velocity, np.array([-self.A * self.w**2 * s, -self.B * self.v**2 * p])

    def polynomials(self, t_end: float, pieces: int) -> Polynomials:
        """Quintic Hermite pieces of equal length through the sines."""
        breaks = np.linspace(0.0, t_end, pieces + 1)
        parts = zip(*self.at(breaks), strict=True)
        return Polynomials(breaks, np.stack([hermite(breaks, *part) for part in parts], axis=1))

    def solve(self, drive: Polynomials, times: np.ndarray, tolerance: float = 1e-13):
        """Motion and tension under the polynomials, integrated piece by piece.

        Args:
            drive: X and L.
            times: (n,) increasing, some of the drive's breaks, the first one 0 [s].
            tolerance: relative tolerance of DOP853; the absolute one is a tenth of it.

        Returns:
            (n, 4) x, z, vx, vz [m], [m/s], and (n,) tension [N], before each break.
        """
        y, states, tensions = np.array([self.angle, self.rate]), [], []
        for piece, (t0, t1) in enumerate(itertools.pairwise(drive.breaks)):
            if t0 in times:
                states.append(self._plane(drive, piece, t0, y))
                tensions.append(self._tension(drive, piece, t0, y))
            s = DOP853(
                lambda t, y, piece=piece: self._rhs(drive, piece, t, y),
                t0,
                y,
                t1,
                rtol=tolerance,
                atol=tolerance / 10.0,
            )
            while s.status == "running":
                s.step()
            y = s.y
        if drive.breaks[-1] in times:
            piece = len(drive.breaks) - 2
            states.append(self._plane(drive, piece, t1, y))
            tensions.append(self._tension(drive, piece, t1, y))
        return np.array(states), np.array(tensions)

    def _rhs(self, drive, piece, t, y):
        (_, L), (_, dL), (ddX, _) = drive.at(piece, t)
        force = 2.0 * dL * y[1] + self.gravity * np.sin(y[0]) + ddX * np.cos(y[0])
        return np.array([y[1], -force / L])

    def _tension(self, drive, piece, t, y) -> float:
        (_, L), _, (ddX, ddL) = drive.at(piece, t)
        inward = L * y[1] ** 2 + self.gravity * np.cos(y[0]) - ddX * np.sin(y[0]) - ddL
        return float(self.mass * inward)

    def _plane(self, drive, piece, t, y) -> np.ndarray:
        (X, L), (dX, dL), _ = drive.at(piece, t)
        out, along = np.array([np.sin(y[0]), -np.cos(y[0])]), np.array([np.cos(y[0]), np.sin(y[0])])
        v = np.array([dX, 0.0]) + dL * out + L * y[1] * along
        return np.concatenate([np.array([X, 0.0]) + L * out, v])
