"""A point mass on a string: swing up, slack, flight and catch in closed form.

The mass starts at the bottom of the circle of radius L with v0^2 = k g L, 2 < k < 5, moving
towards increasing polar angle (counter-clockwise in the x-z plane, measured from +x towards +z).
The tension m v^2/L - m g sin(phi) ends where sin(psi) = (k - 2)/3 with v^2 = g L sin(psi); there
the parabola osculates the circle, so the four common points of the two conics have polar angles
that sum to a multiple of a full turn, three of them at psi: the string is taut again at -3 psi.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ellipkinc


@dataclass(frozen=True)
class Flight:
    """One swing, flight and catch.

    Attributes:
        psi: polar angle at the release [rad].
        t_release, t_catch: [s], from the start at the bottom.
        x_release, v_release: (2,) place and velocity (x, z) at the release [m], [m/s].
        x_catch: (2,) place at the catch [m].
        v_before, v_after: (2,) velocity on both sides of the catch [m/s].
        impulse: impulse of the catch [N s].
        loss: energy lost in the catch [J].
        after: speed along growing polar angle after the catch [m/s].
    """

    psi: float
    t_release: float
    t_catch: float
    x_release: np.ndarray
    v_release: np.ndarray
    x_catch: np.ndarray
    v_before: np.ndarray
    v_after: np.ndarray
    impulse: float
    loss: float
    after: float


def time_on_circle(k: float, alpha: float, length: float, gravity: float) -> float:
    """Time from the bottom to the angle alpha from the bottom.

    With v^2 = g L (k - 4 sin(alpha/2)^2), and sin(beta) = 2/sqrt(k) sin(alpha/2), the time is
    sqrt(L/g) F(beta | k/4) for k < 4 and 2 sqrt(L/(k g)) F(alpha/2 | 4/k) for k >= 4.
    """
    if k < 4.0:
        beta = np.arcsin(2.0 / np.sqrt(k) * np.sin(alpha / 2.0))
        return float(np.sqrt(length / gravity) * ellipkinc(beta, k / 4.0))
    return float(2.0 * np.sqrt(length / (k * gravity)) * ellipkinc(alpha / 2.0, 4.0 / k))


def flight(k: float, length: float, mass: float, gravity: float) -> Flight:
    """The release, the flight and the catch.

    Args:
        k: v0^2 / (g L), between 2 and 5.
        length: length of the string [m].
        mass: [kg].
        gravity: [m/s^2].
    """
    if not 2.0 < k < 5.0:
        raise ValueError(f"the string goes slack above the middle only for 2 < k < 5, not {k}")
    psi = float(np.arcsin((k - 2.0) / 3.0))
    s, c = np.sin(psi), np.cos(psi)
    v = np.sqrt(gravity * length * s)
    t_release = time_on_circle(k, psi + np.pi / 2.0, length, gravity)
    t_catch = t_release + 4.0 * c * np.sqrt(length * s / gravity)
    outward = 8.0 * v * s * c**3
    after = -v * (2.0 * np.cos(2.0 * psi) + np.cos(4.0 * psi))
    return Flight(
        psi=psi,
        t_release=t_release,
        t_catch=t_catch,
        x_release=length * np.array([c, s]),
        v_release=v * np.array([-s, c]),
        x_catch=length * np.array([np.cos(3.0 * psi), -np.sin(3.0 * psi)]),
        v_before=v * np.array([-s, -3.0 * c]),
        v_after=after * np.array([np.sin(3.0 * psi), np.cos(3.0 * psi)]),
        impulse=float(mass * outward),
        loss=float(mass * outward**2 / 2.0),
        after=float(after),
    )
