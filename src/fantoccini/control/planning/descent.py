"""Sequential quadratic programming that brings a rollout to its goal.

A step x of velocities dV = basis x is the solution of::

    min |r + J x|^2 / 2 + smooth |D (V + dV)|^2 + w.s
    c + C x + s >= 0,  s >= 0,  |V + dV| <= speed,  |d(V + dV)| <= T acceleration,  |x| <= trust

with D the changes of the accelerations. A line search, with all step lengths at once in lanes,
takes the part of the step with the least merit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.base import Array
from fantoccini.control.optimal import Limits, improve
from fantoccini.control.planning.shooting import Candidates, Derivatives, Shooting


@dataclass(frozen=True)
class _Tolerances:
    """Weights and tolerances of the quadratic programs and their iteration."""

    shrink: float = 0.65
    """Ratio of a step length to the one before it in the line search."""
    lengths: int = 8
    """Step lengths in the line search."""
    first_trust: float = 0.2
    """Largest change of a velocity in the first step [m/s or rad/s]."""
    max_trust: float = 0.5
    """Largest change in any step [m/s or rad/s]."""
    max_iterations: int = 15
    """Quadratic programs."""
    late: float = 1.2
    """Time before the end that is varied where only the end is [s]."""
    smooth: float = 1e-5
    """Weight of changes of accelerations [s^2]."""
    step: float = 1e-6
    """Weight of the step itself, which makes the program strictly convex."""
    penalty: float = 1.0
    """Weight of violated constraints relative to the goal residual; less would leave them so."""
    min_residual: float = 1e-3
    """Goal residual to which the penalty is at least proportional."""
    unbounded: float = 1e20
    """Bound that stands for none."""
    max_ratio: float = 0.8
    """Merit three iterations later, relative, above which a candidate is abandoned."""
    feasibility: float = 1e-9
    """Primal tolerance of the solver."""


_TOLERANCES = _Tolerances()
_LENGTHS = _TOLERANCES.shrink ** np.arange(_TOLERANCES.lengths)


@dataclass(eq=False)
class Approach:
    """A candidate, and how the search for one that passes a test ended.

    Attributes:
        candidate: the last one; None where the first could not be simulated.
        arrives: whether it passes the test.
        late: whether the time ended before that.
        iterations, stalled, settled: see :class:`fantoccini.control.optimal.Improvable`.
    """

    candidate: Candidates | None
    arrives: bool = False
    late: bool = False
    iterations: int = 0
    stalled: bool = False

    @property
    def settled(self) -> bool:
        """Whether no step is needed."""
        return self.arrives

    @property
    def kkt(self) -> float:
        """Infinite: what counts is the test."""
        return np.inf


def approach(
    shooting: Shooting, V: Array, there: Callable[[Candidates], bool], until: float, late: bool
) -> Approach:
    """A candidate near the given one that passes a test, or the last of the descent.

    Args:
        shooting: simulates candidates.
        V: (m, n_vK) initial velocities.
        there: the test.
        until: time at which to stop, as of ``time.perf_counter``.
        late: whether only the last segments are varied, after the last catch: earlier changes have
            too nonlinear an effect, or change which strings are caught.
    """
    if time.perf_counter() > until:
        return Approach(None, late=True)
    first = shooting.candidates(shooting.within(V)[None])
    if not np.isfinite(first.merit[0]):
        return Approach(None)
    descent = _Descent(shooting, first, there, until, late)
    return improve(descent, Limits(0.0, 0.0, _TOLERANCES.max_iterations))


class _Descent:
    """Steps of :func:`approach`, whose arguments are its own."""

    def __init__(
        self,
        shooting: Shooting,
        first: Candidates,
        there: Callable[[Candidates], bool],
        until: float,
        late: bool,
    ):
        self.best = Approach(first)
        self._shooting, self._there, self._until, self._late = shooting, there, until, late
        self._trust, self._merits = _TOLERANCES.first_trust, list[float]()

    def step(self) -> tuple[Derivatives, Array] | None:
        """The step of the quadratic program; None where the search ends."""
        at, shooting = self.best, self._shooting
        now = at.candidate
        assert now is not None
        if self._there(now):
            at.arrives = True
            return None
        merits = self._merits
        merits.append(now.merit[0])
        at.stalled = len(merits) > 3 and bool(merits[-1] > _TOLERANCES.max_ratio * merits[-4])
        if not at.stalled and time.perf_counter() > self._until:
            at.stalled = at.late = True
        if at.stalled:
            return None
        last = round(_TOLERANCES.late / shooting.segment)
        first = max(int(now.calm[0]), len(now) - last) if self._late else 0
        by = shooting.derivatives(now, min(first, len(now) - 1))
        return by, step(shooting, now, by, self._trust)

    def along(self, step: tuple[Derivatives, Array]) -> Approach | None:
        """The part of the step with the least merit; None where none has less."""
        at, shooting, (by, x) = self.best, self._shooting, step
        now = at.candidate
        assert now is not None
        tried = np.stack([shooting.changed(now.V[0], by.basis, part * x) for part in _LENGTHS])
        better = shooting.candidates(shooting.within(tried)).best
        if not better.merit[0] < now.merit[0]:
            return None
        size = float(np.max(np.abs(better.V - now.V)))
        self._trust = min(_TOLERANCES.max_trust, max(2.0 * size, 0.1 * self._trust))
        return Approach(better, iterations=at.iterations)

    def learn(self, step: tuple[Derivatives, Array] | None, taken: bool) -> None:
        """The search ends where no step is taken."""
        self.best.stalled = not taken


def step(shooting: Shooting, now: Candidates, by: Derivatives, trust: float) -> Array:
    """(n_x,) the step of the quadratic program at a candidate."""
    bounds, V = shooting.problem.rollouts.bounds, now.V[0][:, shooting.moves]
    m, n_m = V.shape
    n_x, n_s = by.residual.shape[1], now.constraints.shape[2]
    every = np.eye(n_m)
    changes = np.kron(by.basis, every)
    before = np.broadcast_to(shooting.problem.root.v_K[0, shooting.moves], (1, n_m))
    D = np.diff(changes.reshape(m, n_m, n_x), axis=0, prepend=0.0)
    dV = np.diff(V, axis=0, prepend=before)
    jerk, jerk_V = np.diff(D, axis=0).reshape((m - 1) * n_m, n_x), np.diff(dV, axis=0).ravel()
    residual = now.residual[0]
    H, g = np.zeros((n_x + n_s, n_x + n_s)), np.zeros(n_x + n_s)
    H[:n_x, :n_x] = by.residual.T @ by.residual + _TOLERANCES.smooth * jerk.T @ jerk
    H[np.arange(n_x + n_s), np.arange(n_x + n_s)] += _TOLERANCES.step
    g[:n_x] = by.residual.T @ residual + _TOLERANCES.smooth * jerk.T @ jerk_V
    g[n_x:] = _TOLERANCES.penalty * max(float(np.linalg.norm(residual)), _TOLERANCES.min_residual)
    # Bounds that the step cannot reach are left out.
    speed, most = bounds.speed[shooting.moves], shooting.segment * bounds.acceleration
    most = most[shooting.moves]
    fast = np.ravel(np.abs(V) + trust > speed)
    sharp = np.ravel(np.abs(dV) + 2.0 * trust > most)
    near, k = by.near, len(by.near)
    give = np.zeros((k, n_s))
    give[np.arange(k), near[:, 1]] = 1.0
    bounded = np.concatenate([changes[fast], D.reshape(m * n_m, n_x)[sharp]])
    A = np.zeros((len(bounded) + k, n_x + n_s))
    A[: len(bounded), :n_x] = bounded
    A[len(bounded) :, :n_x], A[len(bounded) :, n_x:] = by.constraints, give
    room = [(np.tile(speed, m) - s * V.ravel())[fast] for s in (1.0, -1.0)]
    turn = [(np.tile(most, m) - s * dV.ravel())[sharp] for s in (1.0, -1.0)]
    high = np.concatenate([room[0], turn[0], np.full(k, _TOLERANCES.unbounded)])
    low = np.concatenate([-room[1], -turn[1], -now.constraints[0, near[:, 0], near[:, 1]]])
    reach = np.concatenate([np.full(n_x, trust), np.full(n_s, _TOLERANCES.unbounded)])
    program = ca.conic(
        "step",
        "daqp",
        {"h": ca.Sparsity.dense(*H.shape), "a": ca.Sparsity.dense(*A.shape)},
        {
            "error_on_fail": False,
            "print_time": False,
            "daqp": {"primal_tol": _TOLERANCES.feasibility},
        },
    )
    lowest = np.concatenate([-np.full(n_x, trust), np.zeros(n_s)])
    found = program(h=H, g=g, a=A, lba=low, uba=high, lbx=lowest, ubx=reach)
    x = np.asarray(found["x"]).ravel()[:n_x]
    return np.where(np.isfinite(x), x, 0.0)
