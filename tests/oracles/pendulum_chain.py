"""A point mass thrown up on its string repeatedly, in closed form.

Launched from the bottom with v0^2 = k g L and k slightly above 2, the mass leaves its circle just
above the middle, is caught just below it on the same side, swings through the bottom and repeats
this on the other side. The catch reduces k by 2 loss / (m g L), about 64 s^3 with s = (k - 2)/3, so
that the throws never end. Circle arcs are Jacobi's elliptic functions, flights parabolas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ellipj

from .string_pendulum import Flight, flight, time_on_circle


@dataclass(frozen=True)
class Throw:
    """Motion from the bottom through release, flight and catch to the bottom.

    Attributes:
        begin, end: times at the bottom [s].
        side: 1 when the mass moves towards +x at the beginning, else -1.
        k: v^2 / (g L) at the beginning.
        k_after: v^2 / (g L) at the end.
        flight: times from the beginning, places for side = 1.
    """

    begin: float
    end: float
    side: int
    k: float
    k_after: float
    flight: Flight


@dataclass(frozen=True)
class Chain:
    """Successive throws; the mass starts at the bottom towards +x.

    Attributes:
        length: length of the string [m].
        mass: mass [kg].
        gravity: gravitational acceleration [m/s^2].
        throws: throws in order of time.
    """

    length: float
    mass: float
    gravity: float
    throws: tuple[Throw, ...]

    @classmethod
    def until(
        cls, t_end: float, k: float, length: float, mass: float, gravity: float = 9.81
    ) -> Chain:
        """Throws that cover the time from 0 to ``t_end``.

        Args:
            t_end: [s].
            k: v0^2 / (g L) at the start, between 2 and about 2.6.
            length: length of the string [m].
            mass: [kg].
            gravity: [m/s^2].
        """
        throws, begin, side = [], 0.0, 1
        while begin < t_end:
            f = flight(k, length, mass, gravity)
            alpha = np.pi / 2.0 - 3.0 * f.psi
            k_after = f.after**2 / (gravity * length) + 4.0 * np.sin(alpha / 2.0) ** 2
            if f.after >= 0.0 or alpha <= 0.0:
                raise ValueError(f"the mass is not caught on its way down at k = {k}")
            end = begin + f.t_catch + time_on_circle(k_after, alpha, length, gravity)
            throws.append(Throw(begin, end, side, k, float(k_after), f))
            begin, side, k = end, -side, float(k_after)
        return cls(length, mass, gravity, tuple(throws))

    def events(self, t_end: float) -> list[tuple[float, str, float]]:
        """(time [s], "release" or "catch", impulse [N s]) up to ``t_end``."""
        events = []
        for throw in self.throws:
            events.append((throw.begin + throw.flight.t_release, "release", 0.0))
            events.append((throw.begin + throw.flight.t_catch, "catch", throw.flight.impulse))
        return [event for event in events if event[0] <= t_end]

    def state(self, t: float) -> np.ndarray:
        """(x, z, vx, vz) at a time [m], [m/s]."""
        throw = next(w for w in self.throws if t <= w.end)
        since, f = t - throw.begin, throw.flight
        if since <= f.t_release:
            state = self._on_circle(throw.k, since)
        elif since <= f.t_catch:
            fall, s = np.array([0.0, -self.gravity]), since - f.t_release
            x = f.x_release + f.v_release * s + fall * s * s / 2.0
            state = np.concatenate([x, f.v_release + fall * s])
        else:
            # The way down is the reversed way up.
            state = self._on_circle(throw.k_after, throw.end - t) * [1.0, 1.0, -1.0, -1.0]
        return state * [throw.side, 1.0, throw.side, 1.0]

    def _on_circle(self, k: float, t: float) -> np.ndarray:
        """State a time after the bottom, moving towards +x, k < 4."""
        sn = ellipj(t * np.sqrt(self.gravity / self.length), k / 4.0)[0]
        half = np.arcsin(np.sqrt(k) / 2.0 * sn)
        alpha = 2.0 * half
        speed = np.sqrt(self.gravity * self.length * (k - 4.0 * np.sin(half) ** 2))
        out = np.array([np.sin(alpha), -np.cos(alpha)])
        return np.concatenate([self.length * out, speed * np.array([-out[1], out[0]])])
