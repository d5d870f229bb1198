"""A rod in a plane on two strings, slack and taut in all combinations, in NumPy and SciPy.

The equations are Newton's for (x, z, beta), written by hand. The rule for a single string does not
suffice for two: the strings that pull, and those that share an impulse, are found by trying all
subsets of the closed rows,

    tau >= 0,     hddot <= 0,   tau . hddot = 0,
    Lambda >= 0,  hdot+ <= 0,   Lambda . hdot+ = 0.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853

from .arm2d_events import ARMED, Run, root


@dataclass(frozen=True)
class Rod:
    """Parameters of the rod, its strings' upper ends, and the motion of their lengths.

    Attributes:
        mass: [kg].
        inertia: moment of inertia about the middle [kg m^2].
        arms: (2,) places of the strings along the rod, from its middle [m].
        gravity: [m/s^2].
        tops: (2, 2) x and z of the upper ends [m].
        breaks: (n + 1,) [s].
        lengths: (n, 2, 6) coefficients of the strings' lengths [m], in ascending powers of the time
            since the start of the piece.
    """

    mass: float
    inertia: float
    arms: np.ndarray
    gravity: float
    tops: np.ndarray
    breaks: np.ndarray
    lengths: np.ndarray

    @property
    def M(self) -> np.ndarray:
        """Diagonal of the mass matrix (3,)."""
        return np.array([self.mass, self.mass, self.inertia])

    def rows(self, piece: int, t: float, y: np.ndarray):
        """h (2,), hdot (2,), A_D (2, 3), and hddot without accelerations of the rod (2,)."""
        k = np.arange(6)
        s = (t - self.breaks[piece]) ** k
        c = self.lengths[piece]
        length, rate, acc = c @ s, (c * k)[:, 1:] @ s[:5], (c * k * (k - 1))[:, 2:] @ s[:4]
        (x, z, beta), (dx, dz, w) = y[:3], y[3:]
        u = np.array([np.cos(beta), np.sin(beta)])
        n = np.array([-u[1], u[0]])
        d = np.array([x, z]) + self.arms[:, None] * u - self.tops
        v = np.array([dx, dz]) + self.arms[:, None] * w * n
        distance = np.linalg.norm(d, axis=1)
        e = d / distance[:, None]
        along = np.sum(e * v, axis=1)
        A = np.column_stack([e, self.arms * (e @ n)])
        gamma = (np.sum(v * v, axis=1) - along**2) / distance - self.arms * w**2 * (e @ u) - acc
        return distance - length, along - rate, A, gamma

    def solve(self, piece: int, t: float, y: np.ndarray, taut: tuple[bool, ...]):
        """Accelerations (3,), tensions (2,), hddot (2,), h (2,), hdot (2,) in a mode."""
        h, hdot, A, gamma = self.rows(piece, t, y)
        free = np.array([0.0, -self.gravity, 0.0])
        on = np.flatnonzero(taut)
        tension = np.zeros(2)
        if len(on):
            G = A[on] / self.M @ A[on].T
            tension[on] = np.linalg.solve(G, gamma[on] + A[on] @ free)
        acc = free - (A.T @ tension) / self.M
        return acc, tension, gamma + A @ acc, h, hdot

    def mode(self, piece: int, t: float, y: np.ndarray, candidates) -> tuple[bool, ...]:
        """For each string, whether it pulls; only candidates may."""
        for taut in itertools.product((True, False), repeat=2):
            if any(
                on and not is_candidate for on, is_candidate in zip(taut, candidates, strict=True)
            ):
                continue
            _, tension, hddot, _, _ = self.solve(piece, t, y, taut)
            off = [
                is_candidate and not on for on, is_candidate in zip(taut, candidates, strict=True)
            ]
            if tension.min() >= 0 and np.all(hddot[off] <= 0):
                return taut
        raise AssertionError("no mode")

    def impulse(self, piece: int, t: float, y: np.ndarray, closed) -> np.ndarray:
        """Impulses (2,) over the closed rows."""
        _, hdot, A, _ = self.rows(piece, t, y)
        G = A / self.M @ A.T
        for struck in itertools.product((True, False), repeat=2):
            if any(
                on and not is_candidate for on, is_candidate in zip(struck, closed, strict=True)
            ):
                continue
            on, impulses = np.flatnonzero(struck), np.zeros(2)
            if len(on):
                impulses[on] = np.linalg.solve(G[np.ix_(on, on)], hdot[on])
            after = hdot - G @ impulses
            off = [
                is_candidate and not hit for hit, is_candidate in zip(struck, closed, strict=True)
            ]
            if impulses.min() >= 0 and np.all(after[off] <= 1e-13):
                return impulses
        raise AssertionError("no impulse")


def simulate(rod: Rod, q, v, t_end: float, *, tolerance: float = 1e-13) -> Run:
    """Event-driven motion; an event is (t, kind, string, impulse, state after).

    Args:
        rod: numbers of the rod.
        q, v: (3,) configuration and velocity at the start, with both strings slack.
        t_end: [s].
        tolerance: relative tolerance of DOP853; the absolute one is a tenth of it.
    """
    run = Run()
    t, y, piece = 0.0, np.concatenate([q, v]).astype(float), 0
    taut = (False, False)
    assert rod.rows(0, t, y)[0].max() < ARMED

    def integrator(t0, y0, stop, piece, taut):
        def rhs(t, y):
            return np.concatenate([y[3:], rod.solve(piece, t, y, taut)[0]])

        return DOP853(rhs, t0, y0, stop, rtol=tolerance, atol=tolerance / 10)

    def state(t0, y0, t1, piece, taut):
        s = integrator(t0, y0, t1, piece, taut)
        while t1 != t0 and s.status == "running":
            s.step()
        return s.y

    def guards(t, y, piece, taut):
        _, tension, _, h, _ = rod.solve(piece, t, y, taut)
        return np.where(taut, -tension, h)

    while t < t_end:
        stop = min(t_end, rod.breaks[piece + 1])
        armed = np.array(taut) | (rod.rows(piece, t, y)[0] < ARMED)
        s, event = integrator(t, y, stop, piece, taut), None
        while s.status == "running" and event is None:
            y = s.y
            s.step()
            dense, event = s.dense_output(), None
            grid = np.linspace(s.t_old, s.t, 9)
            values = [guards(g, dense(g), piece, taut) for g in grid]
            for (a, b), (ga, gb) in zip(
                itertools.pairwise(grid), itertools.pairwise(values), strict=True
            ):
                hit = [
                    (
                        root(
                            lambda t, r=r, s=s, y=y, taut=taut, piece=piece: guards(
                                t, state(s.t_old, y, t, piece, taut), piece, taut
                            )[r],
                            a,
                            b,
                        ),
                        r,
                    )
                    for r in range(2)
                    if armed[r] and ga[r] <= 0 < gb[r]
                ]
                if hit:
                    event = min(hit)
                    break
                armed |= gb < ARMED
        if event is None:
            t, y = s.t, s.y
            if t < t_end:
                piece += 1
                taut = rod.mode(piece, t, y, taut)
            continue
        t, row = event
        y = state(s.t_old, y, t, piece, taut)
        if taut[row]:
            still_taut = tuple(on and r != row for r, on in enumerate(taut))
            taut = rod.mode(piece, t, y, still_taut)
            run.events.append((t, "release", row, 0.0, y.copy()))
        else:
            closed = tuple(on or r == row for r, on in enumerate(taut))
            impulses, before = rod.impulse(piece, t, y, closed), taut
            _, _, A, _ = rod.rows(piece, t, y)
            y = np.concatenate([y[:3], y[3:] - A.T @ impulses / rod.M])
            held = tuple(bool(c and x > 0) for c, x in zip(closed, impulses, strict=True))
            taut = rod.mode(piece, t, y, held)
            run.events.append((t, "catch", row, impulses[row], y.copy()))
            for r in range(2):
                if before[r] and not taut[r]:
                    run.events.append((t, "release", r, 0.0, y.copy()))
    run.t, run.state = t, y
    return run
