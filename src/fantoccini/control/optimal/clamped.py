"""Steps of sequential quadratic programming in real time.

    min over u  of the program of :class:`Objective` along a motion,
    with accelerations, speeds and positions of the driven coordinates within their bounds

The compiled method is ``search/stage_clamped.hpp``. Its motions keep the bounds after every
factorisation, so that it can end after any of them.

u are the accelerations acc_K of the driven coordinates, the ends and lengths of strings; n_vK is
the number of driven velocities. In names, D stands for dynamic coordinates, which move by the
equations of motion. A node is a time at which the inputs may change, with its state; an interval
leads to the next node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.quadratic import StageSolver
from fantoccini.control.tasks import Nodes
from fantoccini.dynamics.derivatives import StepInputs, StepOptions, linearise_steps
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import AnyArray, ClampedOutcome, ClampedStages

_MIN_BARRIER, _INTERIOR_POINT_FACTORISATIONS = 1e-5, 15
"""Limits of the interior point method: barrier in units of the cost, and factorisations."""
_MAX_MULTIPLICATIONS = 4.8e7
"""Multiplications allowed for a program: about 7 ms."""
MIN_FACTORISATIONS, MAX_FACTORISATIONS = 1.5, 20.0
"""Smallest and largest number of whole factorisations of a program."""


@dataclass(frozen=True, eq=False)
class IntervalDerivatives:
    """Derivatives of a motion for the program of a step.

    Attributes:
        tension: (N, n_rows) tensions just after the nodes.
        tension_partials: (N, n_rows, n_z + n_vK or more) derivatives of the tensions, if requested.
        driven: (N or 1, 2 n_vK, 3 n_vK) derivatives of the driven coordinates over the intervals.
    """

    tension: Array
    tension_partials: Array | None
    driven: Array


class ClampedSteps:
    """Steps of a puppet within bounds, one program after another in the same memory.

    Tasks with bounds of jerk are solved by the interior point method, whose work is less strictly
    limited: a motion that is built stage by stage cannot keep these bounds.

    Args:
        marionette: the puppet.
        dt: longest time step of derivatives [s].
        threads: number of threads for derivatives.
    """

    def __init__(self, marionette: Marionette, dt: float, threads: int | None) -> None:
        self._marionette, self._steps = marionette, TimeSteps(marionette, dt, threads)
        self._threads = threads
        self._memory: Array | None = None
        self._stages, self._solver = ClampedStages(), StageSolver(1e-6)

    def linearise(self, nodes: Nodes, with_tension: bool) -> IntervalDerivatives:
        """Derivatives of the intervals; those of the dynamic part are kept for :meth:`solve`.

        Args:
            nodes: the motion.
            with_tension: whether to compute derivatives of tensions.
        """
        k = self._marionette.coordinates.n_vK
        m, dt = self._steps.split(nodes.interval)
        x = (nodes.q_D[:-1], nodes.v_D[:-1], nodes.q_K[:-1], nodes.v_K[:-1])
        driven = np.eye(2 * k, 3 * k)[None]
        for j in range(m):
            inputs = StepInputs.from_arrays(self._marionette, x, nodes.acc_K, dt=dt)
            options = StepOptions(tension_partials=with_tension and j == 0, threads=self._threads)
            step = linearise_steps(self._marionette, inputs, options, self._memory)
            self._memory = step.motion
            self._stages.add_step(step.motion, driven, k, j == 0)
            if j == 0:
                tension, pull = step.tension, step.tension_partials
            step_driven = step.driven
            driven = step_driven[..., : 2 * k] @ driven
            driven[..., 2 * k :] += step_driven[..., 2 * k :]
            x = (step.q_D, step.v_D, step.q_K, step.v_K)
        return IntervalDerivatives(tension, pull, driven)

    def solve(
        self,
        objective: Objective,
        nodes: Nodes,
        interval_derivatives: IntervalDerivatives,
        damping: float,
        shift: int,
    ) -> ClampedOutcome:
        """The best changes of the accelerations so far.

        Args:
            objective: cost and bounds.
            nodes: the motion, as last linearised.
            interval_derivatives: derivatives from :meth:`linearise`.
            damping: damping of the Hessian, in units of the cost.
            shift: number of intervals by which the horizon moved since the last program; -1 for
                another motion.
        """
        N, k, h = len(nodes), nodes.table.n_vK, nodes.interval
        stage_multiplications = (nodes.n_z + k) ** 2 * (nodes.n_z - 2 * k)
        max_stages = min(
            max(_MAX_MULTIPLICATIONS / stage_multiplications, MIN_FACTORISATIONS * N),
            MAX_FACTORISATIONS * N,
        )
        J, diagonal, g = objective.gauss_newton_terms(nodes)
        tension_residuals = list(objective.tension_residuals(nodes, interval_derivatives.tension))
        C = np.zeros((N, len(tension_residuals), nodes.n_z + k))
        W = np.zeros((N, len(tension_residuals)))
        for i, (row, weights, r) in enumerate(tension_residuals):
            assert interval_derivatives.tension_partials is not None
            derivatives = interval_derivatives.tension_partials[:, row, : nodes.n_z + k]
            C[:, i], W[:, i] = derivatives, weights
            g[:, :k] += (weights * r)[:, None] * derivatives[:, nodes.n_z :]
            g[:-1, k:] += (weights * r)[1:, None] * derivatives[1:, : nodes.n_z]
        if not objective.unit:
            objective.set_unit_from_gradient(g, diagonal)
        diagonal += damping * objective.unit
        bounds = objective.limits(h)
        if np.any(np.isfinite(bounds.jump)):
            return self._solve_by_interior_point(objective, nodes, damping)
        n = nodes.n_z - 2 * k
        numbers = nodes.scalars
        scalars = {
            "N": N,
            "n_d": n,
            "n_inputs": k,
            "k": len(bounds.inputs),
            "n_squares": J.shape[1],
            "n_pulls": len(tension_residuals),
            "n_joints": len(bounds.joint_indices),
            "jerk": objective.task.smooth.jerk / h,
            "h": h,
            "price": objective.price,
            "unit": objective.unit,
            "shift": shift,
            "most_stages": round(max_stages),
        }
        arrays: dict[str, AnyArray] = {
            "inputs": bounds.inputs.astype(np.int32),
            "squares": J,
            "diagonal": diagonal,
            "g": g,
            "pulls": C,
            "pull_weight": W,
            "acc": nodes.acc_K,
            "q": numbers[:, n : n + k],
            "v": numbers[:, n + k :],
            "most": bounds.acceleration,
            "last_most": np.minimum(bounds.acceleration, bounds.jump),
            "speed": bounds.speed,
            "low": bounds.low,
            "high": bounds.high,
            "joint_places": bounds.joint_indices.astype(np.int32),
            "joint": numbers[1:, bounds.joint_indices],
            "joint_low": bounds.joint_low,
            "joint_high": bounds.joint_high,
        }
        return self._stages.solve(scalars, arrays, interval_derivatives.driven)

    def _solve_by_interior_point(
        self, objective: Objective, nodes: Nodes, damping: float
    ) -> ClampedOutcome:
        linear = self._steps.linearise(nodes)
        linear.e[:] = 0.0
        program = objective.program(nodes, linear, damping * objective.unit, 0.0)
        solution = self._solver.solve(
            program,
            objective.unit,
            barrier=_MIN_BARRIER,
            max_iterations=_INTERIOR_POINT_FACTORISATIONS,
        )
        u = objective.expanded(solution)[1]
        n = solution.iterations
        return ClampedOutcome(u, np.nan, n, n * len(nodes), solution.solved)
