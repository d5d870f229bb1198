"""The planar arm on its string, slack and taut, integrated by SciPy's DOP853 (Eqs. 10-15).

The multiplier here has the sign of Eq. 10; the tension is -lambda. At a release the tension of the
taut mode falls through 0; at a catch h rises through 0. The state at an event is integrated from
the last step before it, with a secant search for the time, not interpolated.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853

from .arm2d_sympy import Arm, model

ARMED = -1e-9
"""h [m] below which a slack string may catch again."""


@dataclass(frozen=True)
class Polynomials:
    """q_K(t) in pieces.

    Attributes:
        breaks: (n + 1,) [s].
        coef: (n, 2, 6) ascending powers of t - breaks[i]; rows x and L.
    """

    breaks: np.ndarray
    coef: np.ndarray

    def at(self, piece: int, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q_K, v_K, acc_K, each (2,)."""
        c, k = self.coef[piece], np.arange(6)
        s = (t - self.breaks[piece]) ** k
        return c @ s, (c * k)[:, 1:] @ s[:5], (c * k * (k - 1))[:, 2:] @ s[:4]


def waypoints(knots_x, knots_L) -> Polynomials:
    """Quintic pieces at rest at every knot; knots are [(t, value), ...] on the same times."""
    breaks = np.array([t for t, _ in knots_x], float)
    coef = np.zeros((len(breaks) - 1, 2, 6))
    for row, knots in enumerate((knots_x, knots_L)):
        for i, ((t0, a), (t1, b)) in enumerate(itertools.pairwise(knots)):
            d, dt = b - a, t1 - t0
            coef[i, row] = [a, 0, 0, 10 * d / dt**3, -15 * d / dt**4, 6 * d / dt**5]
    return Polynomials(breaks, coef)


@dataclass
class Run:
    """Events, end state and samples of a run.

    Attributes:
        events: (t, "catch" | "release", impulse [N s], state after (4,)).
        t, state: end time and (theta, v) there.
        samples: (t, state (4,), tension [N]) after every step of the integrator.
    """

    events: list = field(default_factory=list)
    t: float = 0.0
    state: np.ndarray | None = None
    samples: list = field(default_factory=list)


@dataclass(frozen=True)
class Mode:
    """The arm in one mode on one piece of the input.

    Attributes:
        numbers: numbers of the arm.
        drive: the inputs.
        piece: index of the piece.
        taut: whether the string pulls.
        tolerance: relative tolerance of DOP853; the absolute one is a tenth of it.
    """

    numbers: tuple[float, ...]
    drive: Polynomials
    piece: int
    taut: bool
    tolerance: float

    def solve(self, t: float, y: np.ndarray) -> dict[str, object]:
        """Eqs. 10 and 11 as if taut, and the slack acceleration."""
        q_K, v_K, acc_K = self.drive.at(self.piece, t)
        r = model()["stacked"](y[:2], y[2:], q_K, v_K, self.numbers)
        M, bias, h, A_D, A_K, Adot_v = r[:4].reshape(2, 2), r[4:6], r[6], r[7:9], r[9:11], r[11]
        free, pull = np.linalg.solve(M, -bias), np.linalg.solve(M, A_D)
        lam = -(A_D @ free + Adot_v + A_K @ acc_K) / (A_D @ pull)
        hdot = A_D @ y[2:] + A_K @ v_K
        return {
            "free": free,
            "taut": free + pull * lam,
            "tension": -lam,
            "h": h,
            "hdot": hdot,
            "catch": -hdot / (A_D @ pull),
            "pull": pull,
        }

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        """d/dt (theta, v)."""
        return np.concatenate([y[2:], self.solve(t, y)["taut" if self.taut else "free"]])

    def integrator(self, t: float, y: np.ndarray, stop: float) -> DOP853:
        """DOP853 from a state to a time."""
        return DOP853(self.rhs, t, y, stop, rtol=self.tolerance, atol=self.tolerance / 10)

    def state(self, t0: float, y0: np.ndarray, t: float) -> np.ndarray:
        """The state at a nearby time, integrated."""
        if t == t0:
            return y0
        s = self.integrator(t0, y0, t)
        while s.status == "running":
            s.step()
        return s.y

    def guard(self, t: float, y: np.ndarray) -> float:
        """Function that rises through 0 at the next event."""
        solution = self.solve(t, y)
        return -solution["tension"] if self.taut else solution["h"]

    def next_event(self, s: DOP853, armed: bool) -> tuple[float | None, bool]:
        """Time of an event within the integrator's last step, and whether a catch is armed."""
        dense = s.dense_output()
        t0, y0 = s.t_old, dense(s.t_old)
        grid = np.linspace(s.t_old, s.t, 9)
        values = [self.guard(t, dense(t)) for t in grid]
        for (a, b), (ga, gb) in zip(
            itertools.pairwise(grid), itertools.pairwise(values), strict=True
        ):
            if not armed:
                armed = gb < ARMED
            elif ga <= 0 < gb:
                return root(lambda t: self.guard(t, self.state(t0, y0, t)), a, b), armed
        return None, armed


def simulate(
    arm: Arm, q_D, v_D, drive: Polynomials, t_end: float, *, tolerance: float = 1e-13
) -> Run:
    """Event-driven motion from a state with h <= 0.

    Args:
        arm: the numbers.
        q_D, v_D: (2,) start.
        drive: the inputs, C^1.
        t_end: [s].
        tolerance: relative, of DOP853.
    """
    run = Run()
    t, y, piece = float(drive.breaks[0]), np.concatenate([q_D, v_D]).astype(float), 0

    def mode(taut: bool) -> Mode:
        return Mode(arm.numbers(), drive, piece, taut, tolerance)

    start = mode(True).solve(t, y)
    taut = abs(start["h"]) < 1e-9 and abs(start["hdot"]) < 1e-7 and start["tension"] > 0
    while t < t_end:
        now, stop = mode(taut), min(t_end, drive.breaks[piece + 1])
        armed = taut or now.solve(t, y)["h"] < ARMED
        s, event = now.integrator(t, y, stop), None
        while s.status == "running" and event is None:
            y = s.y
            s.step()
            event, armed = now.next_event(s, armed)
            if event is None:
                tension = now.solve(s.t, s.y)["tension"] if taut else 0.0
                run.samples.append((s.t, s.y.copy(), tension))
        if event is None:
            t, y = s.t, s.y
            if t < t_end:
                piece += 1
                taut = taut and mode(True).solve(t, y)["tension"] > 0
        elif taut:
            t, y, taut = event, now.state(s.t_old, y, event), False
            run.events.append((t, "release", 0.0, y.copy()))
        else:
            t, y = event, now.state(s.t_old, y, event)
            solution = now.solve(t, y)
            y = np.concatenate([y[:2], y[2:] + solution["pull"] * solution["catch"]])  # Eqs. 14, 15
            taut = now.solve(t, y)["tension"] > 0
            run.events.append((t, "catch", -solution["catch"], y.copy()))
    run.t, run.state = t, y
    return run


def root(function: Callable[[float], float], a: float, b: float) -> float:
    """Root of an increasing crossing between a and b, to rounding, by secants."""
    fa, fb = function(a), function(b)
    for _ in range(60):
        if fb == fa or abs(b - a) < 4e-16 * max(1.0, abs(b)):
            break
        c = b - fb * (b - a) / (fb - fa)
        if not np.isfinite(c) or c == b:
            break
        a, fa, b, fb = b, fb, c, function(c)
    return b
