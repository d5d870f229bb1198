"""Sequential quadratic programming that brings a rollout to its goal.

A step x of velocities dV = basis x is the solution of::

    min |r + J x|^2 / 2 + smooth |D (V + dV)|^2 + w.s
    c + C x + s >= 0,  s >= 0,  |V + dV| <= speed,  |d(V + dV)| <= T acceleration,  |x| <= trust

where D takes differences of accelerations. A line search over all step lengths at once, in lanes,
selects the one with the least merit.

V are the velocities of the driven coordinates at the ends of segments, r the residual of the goal
with the Jacobian J, c the constraints with the Jacobian C, and s their violations. D takes
differences over the time T of a segment. Lanes are runs that the vector unit of the processor
advances together.
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

    length_ratio: float = 0.65
    """Ratio of successive step lengths in the line search."""
    n_lengths: int = 8
    """Number of step lengths in the line search."""
    first_trust: float = 0.2
    """Largest change of a velocity in the first step [m/s or rad/s]."""
    max_trust: float = 0.5
    """Largest change of a velocity in any step [m/s or rad/s]."""
    max_iterations: int = 15
    """Largest number of quadratic programs."""
    end_duration: float = 1.2
    """Duration of the varied part, if only the end of a rollout is varied [s]."""
    smoothness_weight: float = 1e-5
    """Weight of differences of accelerations [s^2]."""
    step_weight: float = 1e-6
    """Weight of the step itself, which makes the program strictly convex."""
    penalty_weight: float = 1.0
    """Weight of violated constraints relative to the goal residual; a smaller one is not exact."""
    min_residual: float = 1e-3
    """Lower bound of the goal residual in the penalty."""
    unbounded: float = 1e20
    """Value for a missing bound."""
    max_ratio: float = 0.8
    """Largest merit relative to that three iterations earlier; above it the search ends."""
    feasibility: float = 1e-9
    """Primal tolerance of the solver."""


_TOLERANCES = _Tolerances()
_LENGTHS = _TOLERANCES.length_ratio ** np.arange(_TOLERANCES.n_lengths)


@dataclass(eq=False)
class Approach:
    """A candidate, and the end of the search for one that passes a test.

    Attributes:
        candidate: the last candidate; None if the first could not be simulated.
        arrives: whether it passes the test.
        timed_out: whether the time limit ended the search.
        iterations, stalled, settled: see :class:`fantoccini.control.optimal.Improvable`.
    """

    candidate: Candidates | None
    arrives: bool = False
    timed_out: bool = False
    iterations: int = 0
    stalled: bool = False

    @property
    def settled(self) -> bool:
        """Whether no further step is needed."""
        return self.arrives

    @property
    def kkt(self) -> float:
        """Infinity: only the test counts."""
        return np.inf


def approach(
    shooting: Shooting,
    V: Array,
    has_arrived: Callable[[Candidates], bool],
    deadline: float,
    end_only: bool,
) -> Approach:
    """The first candidate near the given velocities that passes a test, or the last of all.

    Args:
        shooting: simulates candidates.
        V: (m, n_vK) initial velocities.
        has_arrived: the test.
        deadline: time at which to stop, by ``time.perf_counter``.
        end_only: whether only the last segments are varied, after the last catch: earlier changes
            have strongly nonlinear effects, or change which strings are caught.
    """
    if time.perf_counter() > deadline:
        return Approach(None, timed_out=True)
    first = shooting.candidates(shooting.within(V)[None])
    if not np.isfinite(first.merit[0]):
        return Approach(None)
    descent = _Descent(shooting, first, has_arrived, deadline, end_only)
    return improve(descent, Limits(0.0, 0.0, _TOLERANCES.max_iterations))


class _Descent:
    """Steps of :func:`approach`, with the same arguments."""

    def __init__(
        self,
        shooting: Shooting,
        first: Candidates,
        has_arrived: Callable[[Candidates], bool],
        deadline: float,
        end_only: bool,
    ):
        self.best = Approach(first)
        self._shooting = shooting
        self._has_arrived = has_arrived
        self._deadline = deadline
        self._end_only = end_only
        self._trust, self._merits = _TOLERANCES.first_trust, list[float]()

    def step(self) -> tuple[Derivatives, Array] | None:
        """The step of the quadratic program; None at the end of the search."""
        best, shooting = self.best, self._shooting
        candidate = best.candidate
        assert candidate is not None
        if self._has_arrived(candidate):
            best.arrives = True
            return None
        merits = self._merits
        merits.append(candidate.merit[0])
        best.stalled = len(merits) > 3 and bool(merits[-1] > _TOLERANCES.max_ratio * merits[-4])
        if not best.stalled and time.perf_counter() > self._deadline:
            best.stalled = best.timed_out = True
        if best.stalled:
            return None
        n_end_segments = round(_TOLERANCES.end_duration / shooting.segment)
        first_segment = (
            max(int(candidate.first_calm_segment[0]), len(candidate) - n_end_segments)
            if self._end_only
            else 0
        )
        derivatives = shooting.derivatives(candidate, min(first_segment, len(candidate) - 1))
        return derivatives, step(shooting, candidate, derivatives, self._trust)

    def try_step(self, step: tuple[Derivatives, Array]) -> Approach | None:
        """The candidate of least merit along the step; None if no length improves it."""
        best, shooting, (derivatives, x) = self.best, self._shooting, step
        candidate = best.candidate
        assert candidate is not None
        trials = np.stack(
            [
                shooting.with_step(candidate.V[0], derivatives.basis, step_length * x)
                for step_length in _LENGTHS
            ]
        )
        next_candidate = shooting.candidates(shooting.within(trials)).best
        if not next_candidate.merit[0] < candidate.merit[0]:
            return None
        max_change = float(np.max(np.abs(next_candidate.V - candidate.V)))
        self._trust = min(_TOLERANCES.max_trust, max(2.0 * max_change, 0.1 * self._trust))
        return Approach(next_candidate, iterations=best.iterations)

    def prepare_next(self, step: tuple[Derivatives, Array] | None, is_accepted: bool) -> None:
        """Ends the search if no step is accepted."""
        self.best.stalled = not is_accepted


def step(
    shooting: Shooting, candidate: Candidates, derivatives: Derivatives, trust: float
) -> Array:
    """(n_x,) the step of the quadratic program at a candidate."""
    bounds, V = shooting.problem.rollouts.bounds, candidate.V[0][:, shooting.movable]
    m, n_m = V.shape
    n_x, n_s = derivatives.residual.shape[1], candidate.constraints.shape[2]
    identity = np.eye(n_m)
    velocity_by_x = np.kron(derivatives.basis, identity)
    start_velocity = np.broadcast_to(shooting.problem.root.v_K[0, shooting.movable], (1, n_m))
    D = np.diff(velocity_by_x.reshape(m, n_m, n_x), axis=0, prepend=0.0)
    dV = np.diff(V, axis=0, prepend=start_velocity)
    jerk, jerk_V = np.diff(D, axis=0).reshape((m - 1) * n_m, n_x), np.diff(dV, axis=0).ravel()
    residual = candidate.residual[0]
    H, g = np.zeros((n_x + n_s, n_x + n_s)), np.zeros(n_x + n_s)
    H[:n_x, :n_x] = (
        derivatives.residual.T @ derivatives.residual
        + _TOLERANCES.smoothness_weight * jerk.T @ jerk
    )
    H[np.arange(n_x + n_s), np.arange(n_x + n_s)] += _TOLERANCES.step_weight
    g[:n_x] = derivatives.residual.T @ residual + _TOLERANCES.smoothness_weight * jerk.T @ jerk_V
    g[n_x:] = _TOLERANCES.penalty_weight * max(
        float(np.linalg.norm(residual)), _TOLERANCES.min_residual
    )
    # Bounds out of reach of the step are left out.
    speed, max_change = bounds.speed[shooting.movable], shooting.segment * bounds.acceleration
    max_change = max_change[shooting.movable]
    near_speed_bound = np.ravel(np.abs(V) + trust > speed)
    near_acceleration_bound = np.ravel(np.abs(dV) + 2.0 * trust > max_change)
    near_constraints, k = derivatives.near_violations, len(derivatives.near_violations)
    slack_columns = np.zeros((k, n_s))
    slack_columns[np.arange(k), near_constraints[:, 1]] = 1.0
    bounded_rows = np.concatenate(
        [velocity_by_x[near_speed_bound], D.reshape(m * n_m, n_x)[near_acceleration_bound]]
    )
    A = np.zeros((len(bounded_rows) + k, n_x + n_s))
    A[: len(bounded_rows), :n_x] = bounded_rows
    A[len(bounded_rows) :, :n_x] = derivatives.constraints
    A[len(bounded_rows) :, n_x:] = slack_columns
    speed_bounds = [(np.tile(speed, m) - s * V.ravel())[near_speed_bound] for s in (1.0, -1.0)]
    acceleration_bounds = [
        (np.tile(max_change, m) - s * dV.ravel())[near_acceleration_bound] for s in (1.0, -1.0)
    ]
    row_high = np.concatenate(
        [speed_bounds[0], acceleration_bounds[0], np.full(k, _TOLERANCES.unbounded)]
    )
    row_low = np.concatenate(
        [
            -speed_bounds[1],
            -acceleration_bounds[1],
            -candidate.constraints[0, near_constraints[:, 0], near_constraints[:, 1]],
        ]
    )
    x_high = np.concatenate([np.full(n_x, trust), np.full(n_s, _TOLERANCES.unbounded)])
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
    x_low = np.concatenate([-np.full(n_x, trust), np.zeros(n_s)])
    solution = program(h=H, g=g, a=A, lba=row_low, uba=row_high, lbx=x_low, ubx=x_high)
    x = np.asarray(solution["x"]).ravel()[:n_x]
    return np.where(np.isfinite(x), x, 0.0)
