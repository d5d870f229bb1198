"""Sequential quadratic programming in a trust region, for runs with catches and impacts.

    phi = J + price (|x_N - end| + |violations of rows|),   |du_j| <= radius max_j

with |a| = sum of |a_i| + a_i^2 / 2, as for elastic rows in stage programs (Fletcher, Practical
Methods of Optimization, 14.5). A step is corrected a few times by the error of its run at the end:
the same program is solved again with

    z_N = z_N + end - x_N(run),

so that larger steps keep near the curved set of motions that meet the end.

J is the cost, du_j the change of input j, and x_N the last state. A row is a condition on a number
of the motion, and the gap its error at the end. A node is a time at which the inputs may change,
with its state; an interval leads to the next node.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, OnProgress, SimulationError, StateError
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.hybrid import HybridRuns
from fantoccini.control.optimal.iterations import (
    GOOD_DECREASE_RATIO,
    MIN_DECREASE_RATIO,
    POOR_DECREASE_RATIO,
    Limits,
    SmallSteps,
    hessian_product,
    improve,
)
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram, StageSolution, StageSolver
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import DrivenConditions, Nodes


@dataclass(frozen=True)
class TrustRegionSettings:
    """Settings of the trust-region search."""

    first_radius: float = 0.07
    """First radius of the trust region, relative to the largest accelerations."""
    min_radius: float = 1e-9
    radius_decrease: float = 0.4
    radius_increase: float = 2.0
    """Factors on the radius after a poor and a good step."""
    max_corrections: int = 3
    """Largest number of corrections of a step."""
    first_price: float = 10.0
    """Initial price of a unit of error at the end, relative to the unit of the cost."""
    max_price: float = 1e3
    price_factor: float = 2.0
    price_margin: float = 3.0
    """Smallest price after a decrease, relative to the largest multiplier of the end."""
    price_decrease_error: float = 1e-3
    """Largest error at the end at which the price may decrease [m, rad and their rates]."""
    min_price: float = 1e-3
    damping: float = 1e-8
    """Damping of the Hessian, relative to the unit of the cost."""
    max_far_iterations: int = 40
    """Number of iterations after which the search stops if the motion is still far."""
    min_far_error: float = 1e-2
    """Error at the end, or violation of bounds, above which a motion counts as far."""


SETTINGS = TrustRegionSettings()
_MIN_DIVISOR = 1e-300


@dataclass(frozen=True, eq=False)
class _Step:
    """A step with the predictions of its program.

    Attributes:
        linear: derivatives that its program uses.
        solution: solution of the program.
        phi_decrease: predicted decrease of phi.
        size: largest |du_j| / max_j.
        remaining_violation: remaining error at the end and violation of rows in the program.
        stationarity: see :class:`fantoccini.control.optimal.sqp.Iterate`.
    """

    linear: LinearEnds
    solution: StageSolution
    phi_decrease: float
    size: float
    remaining_violation: float
    stationarity: float


class TrustRegionSearch:
    """A search that improves a motion in which strings go slack and become taut.

    Args:
        start: first motion.
        runs: simulates motions, with exact derivatives.
        objective: cost and bounds.
        limits: conditions for the end.
    """

    def __init__(self, start: Iterate, runs: HybridRuns, objective: Objective, limits: Limits):
        self.best = start
        self._runs, self._objective, self._limits = runs, objective, limits
        # The end is a set of elastic rows here, not a part of the objective.
        self._relaxed = Objective(replace(objective.task, end=None))
        self._u, self._z = objective.program_indices
        self._max_acceleration = DrivenConditions.from_task(objective.task).scale[self._u]
        self._solver, self._radius = StageSolver(), SETTINGS.first_radius
        self._small_steps, self._decrease_ratio = SmallSteps(), -np.inf
        self._linear: LinearEnds | None = None

    def run(self, progress: OnProgress | None = None) -> Iterate:
        """The best motion of the search; see :func:`improve`."""
        return improve(self, self._limits, progress)

    def _linearise(self) -> LinearEnds | None:
        """Derivatives of the best motion; None if one of its events has none."""
        best, relaxed = self.best, self._relaxed
        try:
            linear = self._runs.linearise(best.nodes, best.ends)
        except (SimulationError, StateError):
            return None
        if not relaxed.unit:
            relaxed.set_unit(best.nodes, linear)
            self._objective.unit = relaxed.unit
            relaxed.price = SETTINGS.first_price * relaxed.unit
        return linear

    def _gap(self, nodes: Nodes) -> Array:
        return self._objective.end_gap(nodes)[self._z]

    def _elastic_violation(self, nodes: Nodes, ends: Ends) -> float:
        rows = self._objective.rows.violation(nodes, ends)
        return _elastic_sum(self._gap(nodes)) + _elastic_sum(rows)

    def _merit(self, cost: float, nodes: Nodes, ends: Ends) -> float:
        return cost + self._relaxed.price * self._elastic_violation(nodes, ends)

    def step(self) -> _Step | None:
        """Next step from the best motion, or None; updates the motion's residuals."""
        best, objective = self.best, self._objective
        if self._linear is None:
            self._linear = self._linearise()
        if (linear := self._linear) is None:
            best.stalled = True
            return None
        gap = self._gap(best.nodes)
        program = self._program(linear, gap)
        gradient_size = max(float(np.max(np.abs(program.g))), _MIN_DIVISOR)
        solution = self._solver.solve(program, min(gradient_size, self._relaxed.unit))
        if not solution.solved:
            best.stalled = True
            return None
        Hd = hessian_product(program, solution)
        step = np.concatenate([solution.u, solution.z[1:]], axis=1)
        remaining_violation = _elastic_sum(solution.violation)
        slope, price = float(np.sum(program.g * step)), self._relaxed.price
        violation_decrease = price * (
            self._elastic_violation(best.nodes, best.ends) - remaining_violation
        )
        phi_decrease = violation_decrease - slope - 0.5 * float(np.sum(step * Hd))
        best.defect = float(np.max(np.abs(gap), initial=0.0))
        best.violation = float(np.max(objective.rows.violation(best.nodes, best.ends), initial=0.0))
        best.solution = solution
        relative_size = float(
            np.max(np.abs(solution.u[:, : len(self._u)]) / self._max_acceleration)
        )
        # A step that the trust region bounds says nothing about the size of the gradient.
        gradient_change = float(np.max(np.abs(Hd))) / gradient_size
        predicted_decrease = max(violation_decrease - slope, 0.0) / max(
            abs(best.cost), _MIN_DIVISOR
        )
        is_inside = relative_size < 0.9 * self._radius
        best.stationarity = (
            max(min(gradient_change, 1.0), min(predicted_decrease, 1.0)) if is_inside else 1.0
        )
        return _Step(
            linear, solution, phi_decrease, relative_size, remaining_violation, best.stationarity
        )

    def _program(self, linear: LinearEnds, gap: Array) -> StageProgram:
        """The program of a step within the trust region that moves the end by ``gap``."""
        best, relaxed, n_u = self.best, self._relaxed, len(self._u)
        program = relaxed.program(best.nodes, linear, SETTINGS.damping * relaxed.unit, 0.0)
        N, n_z, k = program.B.shape
        radius = self._radius * self._max_acceleration
        low, high = program.low.copy(), program.high.copy()
        low[:, :n_u] = np.maximum(low[:, :n_u], -radius)
        high[:, :n_u] = np.minimum(high[:, :n_u], radius)
        required = self._objective.end_indices
        if self._objective.task.end is None:
            required = required[:0]
        m = len(required)
        C, unbounded = np.zeros((N, m, 2 * (k + n_z))), np.full((N, m), UNBOUNDED)
        C[-1, np.arange(m), n_z + 2 * k + required] = 1.0
        row_low, row_high = -unbounded, unbounded
        row_low[-1] = row_high[-1] = gap[required]
        return replace(
            program,
            low=low,
            high=high,
            C=np.concatenate([program.C, C], axis=1),
            row_low=np.concatenate([program.row_low, row_low], axis=1),
            row_high=np.concatenate([program.row_high, row_high], axis=1),
            elastic=np.concatenate([program.elastic, np.full((N, m), relaxed.price)], axis=1),
        )

    def try_step(self, step: _Step) -> Iterate | None:
        """The motion after a step and its corrections; None if the step is rejected."""
        best, objective = self.best, self._objective
        merit_before = self._merit(best.cost, best.nodes, best.ends)
        solution, best_motion, best_ratio = step.solution, None, -np.inf
        for correction in range(1 + SETTINGS.max_corrections):
            if correction:
                # Error at the end, relative to this step.
                end_change = solution.z[-1, : len(self._z)]
                gap = (
                    end_change + self._gap(best_motion[0])
                    if best_motion is not None
                    else end_change
                )
                solution = self._solver.solve(self._program(step.linear, gap), self._relaxed.unit)
            if not solution.solved:
                break
            nodes_and_ends = self._runs.after_step(best.nodes, *objective.expanded(solution))
            if nodes_and_ends is None:
                break
            cost = objective.cost(*nodes_and_ends)
            decrease_ratio = (merit_before - self._merit(cost, *nodes_and_ends)) / max(
                step.phi_decrease, _MIN_DIVISOR
            )
            if not decrease_ratio > best_ratio:
                break
            best_ratio, best_motion, best_cost = decrease_ratio, nodes_and_ends, cost
            if best_ratio >= GOOD_DECREASE_RATIO or objective.task.end is None:
                break
        self._decrease_ratio = best_ratio
        if best_motion is None or best_ratio <= MIN_DECREASE_RATIO:
            return None
        limits = self._limits
        is_small = best_ratio * step.phi_decrease <= limits.cost_tolerance * abs(merit_before)
        is_small = is_small and step.size < 0.9 * self._radius
        is_small = is_small and self._elastic_violation(best.nodes, best.ends) <= limits.tolerance
        settled = self._small_steps.record(is_small)
        return replace(
            best, nodes=best_motion[0], ends=best_motion[1], cost=best_cost, settled=settled
        )

    def prepare_next(self, step: _Step | None, is_accepted: bool) -> None:
        """Sets the radius and the price for the next step."""
        assert step is not None  # or it was stalled before
        best, decrease_ratio = self.best, self._decrease_ratio
        if is_accepted:
            self._linear = None
        is_inside = step.size < 0.9 * self._radius
        unit, price = self._relaxed.unit, self._relaxed.price
        if is_inside and step.remaining_violation > 0.1 * self._limits.tolerance:
            price = min(price * SETTINGS.price_factor, SETTINGS.max_price * unit)
        if decrease_ratio < POOR_DECREASE_RATIO:
            self._radius = SETTINGS.radius_decrease * min(step.size, self._radius)
        elif decrease_ratio > GOOD_DECREASE_RATIO and not is_inside:
            self._radius *= SETTINGS.radius_increase
        is_near = (
            float(np.max(np.abs(self._gap(self.best.nodes)), initial=0.0))
            < SETTINGS.price_decrease_error
        )
        if is_accepted and is_near:
            min_price = SETTINGS.price_margin * float(np.max(np.abs(step.solution.costate[-1])))
            price = min(price, max(min_price, SETTINGS.min_price * unit))
        self._relaxed.price = price
        gives_up = (
            best.iterations >= SETTINGS.max_far_iterations
            and max(best.defect, best.violation) > SETTINGS.min_far_error
        )
        best.stalled = gives_up or self._radius < SETTINGS.min_radius


def _elastic_sum(violations: Array) -> float:
    """Measure of violations, as in stage programs: sum of |a| + a^2 / 2."""
    return float(np.sum(np.abs(violations)) + 0.5 * np.sum(np.square(violations)))
