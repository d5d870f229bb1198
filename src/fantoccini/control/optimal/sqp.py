"""Sequential quadratic programming with Gauss-Newton's Hessian.

Every iteration differentiates all intervals and residuals, solves a program of stages for a step
(u, z), and shortens it until a filter accepts the pair

    theta = |e|_1 + |gap|_1,   phi = J + price of violated rows

The gap consists of x_N - end and the offsets of touching points from their places. The filter
(Waechter and Biegler, Math. Program. 106, 2006) requires that theta or phi is smaller than in all
earlier iterations in which theta was reduced.

e are the errors by which the states at nodes miss the ends of the intervals before them, and J is
the cost. A row is a condition on a number of the motion, such as a tension.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fantoccini.base import Array, OnProgress
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
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
from fantoccini.control.optimal.quadratic import StageProgram, StageSolution, StageSolver
from fantoccini.control.tasks import Nodes


class Shooting(Protocol):
    """The simulation of motions and their derivatives."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """The same ends with derivatives."""

    def after_step(self, nodes: Nodes, z: Array, u: Array, c: Array) -> tuple[Nodes, Ends] | None:
        """The nodes after a step, and the ends of their intervals; None if there is no motion."""


@dataclass(frozen=True)
class SearchSettings:
    """Parameters of the search: damping, line search and filter."""

    min_damping: float = 3e-8
    """Smallest damping of the Hessian, in units of the cost."""
    first_damping: float = 3e-8
    damping_factor: float = 4.0
    max_damping: float = 1e8
    max_halvings: int = 8
    max_corrections: int = 3
    """Largest number of corrections of a full step that is rejected and violates rows."""
    price_factor: float = 4.0
    max_price: float = 3e3
    """Largest price of a unit of violation of a row, in units of the cost."""
    max_settled_theta: float = 10.0
    """Largest theta of a settled motion, relative to the tolerance."""
    max_settled_damping: float = 3e-4
    """Largest damping at which small steps count as settled, in units of the cost."""
    theta_margin: float = 1e-5
    """Share of theta by which theta or phi must decrease."""
    exponents: tuple[float, float] = (2.3, 1.1)
    """Exponents of the predicted decrease, and of theta, in their comparison."""
    max_gap_ratio: float = 0.5
    """Ratio of theta after and before a step above which the weight of the gap is raised."""
    max_theta: float = 10.0
    """Largest theta, relative to max(1, theta at the start)."""
    gap_share: float = 0.1
    """Largest duality gap of a program, relative to the predicted decrease or the tolerance; with a
    larger one the program is solved again, aiming at this share of that gap."""
    min_tolerance: float = 1e-13
    """Smallest tolerance of programs."""


SETTINGS = SearchSettings()
_MIN_DIVISOR = 1e-300
"""Lower bound of sizes and predicted decreases, to keep them above 0."""


class Filter:
    """Pairs (theta, phi); no later iterate may be worse than one of them in both."""

    def __init__(self) -> None:
        self._pairs: list[tuple[float, float]] = []
        self._max_theta = 0.0

    def accepts(
        self, before: tuple[float, float], after: tuple[float, float], phi_change: float
    ) -> bool:
        """Whether a step is accepted; the filter stores its start if theta must decrease.

        Args:
            before, after: (theta, phi) at the start and the end of the step.
            phi_change: predicted change of phi.
        """
        theta, phi = before
        if not self._max_theta:
            self._max_theta = SETTINGS.max_theta * max(1.0, theta)
        if not (np.isfinite(after[1]) and after[0] <= self._max_theta):
            return False
        margin = 1.0 - SETTINGS.theta_margin
        if any(
            after[0] > margin * theta_i and after[1] > phi_i - SETTINGS.theta_margin * theta_i
            for theta_i, phi_i in self._pairs
        ):
            return False
        rounding = 1e-13 * abs(phi)
        if (
            phi_change < 0.0
            and (-phi_change) ** SETTINGS.exponents[0] > theta ** SETTINGS.exponents[1]
        ):
            return after[1] <= phi + MIN_DECREASE_RATIO * phi_change + rounding
        if after[0] <= margin * theta < theta or after[1] <= phi - SETTINGS.theta_margin * theta:
            self._pairs.append(before)
            return True
        return theta == 0.0 and after[0] == 0.0 and after[1] <= phi + rounding


@dataclass(eq=False)
class Iterate:
    """A motion, with its residuals of optimality.

    Attributes:
        nodes: nodes of the motion.
        ends: ends of its intervals.
        cost: J.
        solution: the last step, with its multipliers.
        stationarity: for the last step d, the larger of |H d|, damping included, relative to the
            gradient, and of the decrease of J predicted by its slope, with the remaining gap of its
            program, relative to J; at most 1.
        defect: largest |e|.
        violation: largest violation of rows.
        iterations: number of iterations.
        force: (n_z + 3 T,) multipliers of the gap.
        damping: damping of the Hessian for the next step, in units of the cost.
        stalled, settled: whether steps no longer improve the motion, or hardly.
    """

    nodes: Nodes
    ends: Ends
    cost: float
    solution: StageSolution | None = None
    stationarity: float = np.inf
    defect: float = np.inf
    violation: float = np.inf
    iterations: int = 0
    force: Array | float = 0.0
    damping: float = SETTINGS.first_damping
    stalled: bool = False
    settled: bool = False

    @property
    def kkt(self) -> float:
        """The largest of the residuals."""
        return max(self.stationarity, self.defect, self.violation)


@dataclass(frozen=True, eq=False)
class _Step:
    """A step, with the values at its start.

    Attributes:
        z, u, c: changes of the states, the accelerations, and of the intervals and parameters.
        theta, phi: pair of the filter at its start.
        phi_slope: slope of phi along it.
        curvature: curvature of its program along it.
        merit: phi plus the cost of the gap, at its start.
        merit_slope: slope of the merit along it.
        force: multipliers of the gap after it.
        predicted_violation: largest violation of rows in its program.
        program, solution: the program and its solution.
        value: (N, m) values of the rows at its start.
    """

    z: Array
    u: Array
    c: Array
    theta: float
    phi: float
    phi_slope: float
    curvature: float
    merit: float
    merit_slope: float
    force: Array | float
    predicted_violation: float
    program: StageProgram
    solution: StageSolution
    value: Array


class Search:
    """A search that improves a motion step by step.

    Args:
        start: first motion.
        shooting: simulates motions.
        objective: cost and bounds.
        limits: conditions for the end.
    """

    def __init__(self, start: Iterate, shooting: Shooting, objective: Objective, limits: Limits):
        self.best = start
        self._shooting, self.objective, self._limits = shooting, objective, limits
        self._solver, self._filter, self._small_steps = StageSolver(), Filter(), SmallSteps()

    def run(self, progress: OnProgress | None = None) -> Iterate:
        """The best motion of the search; see :func:`improve`."""
        return improve(self, self._limits, progress)

    def prepare_next(self, step: _Step | None, is_accepted: bool) -> None:
        """Raises the damping after a rejected step, and the price of violated rows.

        If even the program violates rows, their price is too low or they are contradictory.
        """
        best, objective = self.best, self.objective
        if not is_accepted:
            best.damping *= SETTINGS.damping_factor**2
        best.stalled = best.damping > min(self._limits.damping, SETTINGS.max_damping)
        price_is_highest = objective.price >= SETTINGS.max_price * objective.unit
        if (
            best.stalled
            or step is None
            or step.predicted_violation <= self._limits.tolerance
            or price_is_highest
        ):
            return
        objective.price *= SETTINGS.price_factor
        self._filter, self._small_steps = Filter(), SmallSteps()

    def step(self) -> _Step | None:
        """A step from the best motion, None without one; updates the motion's residuals."""
        best, objective = self.best, self.objective
        if len(objective.touches):
            best.nodes = objective.touches.with_moments(best.nodes)
        linear = self._shooting.linearise(best.nodes, best.ends)
        if not objective.unit:
            objective.set_unit(best.nodes, linear)
        damping = objective.unit * best.damping
        program = objective.program(best.nodes, linear, damping, best.force)
        gradient_size = max(float(np.max(np.abs(program.g))), _MIN_DIVISOR)
        solution = self._solver.solve(program, min(gradient_size, objective.unit))
        if not solution.solved:
            return None
        u, z = solution.u, solution.z[1:]
        step = np.concatenate([u, z], axis=1)
        Hd = hessian_product(program, solution)
        curvature = float(np.sum(step * Hd))
        gap, violation = objective.gap(best.nodes), objective.rows.violation(best.nodes, linear)
        best.defect = float(max(np.max(np.abs(linear.e)), np.max(np.abs(gap))))
        best.violation = float(np.max(violation, initial=0.0))
        best.solution = solution
        z, u, c = objective.expanded(solution)
        weight = objective.end_weight
        gap_change, force = objective.gap_change(best.nodes, z, c, best.force)
        price = objective.price
        violation_decrease = price * float(np.sum(violation) - np.sum(solution.violation))
        merit_slope = float(np.sum(program.g * step)) - violation_decrease
        phi_slope = merit_slope + float((weight * gap + best.force) @ gap_change)
        # The first part is the gradient of the Lagrangian with the step's multipliers, damping
        # included. A step that ends short of a bound, as in the interior point method, may predict
        # no decrease although the bound is not reached: so its remaining gap counts as well.
        # The weight of the end is no residual: it only shifts multipliers of the gradient.
        at_end = solution.u.shape[1] + objective.end_indices
        Hd[-1, at_end] -= objective.end_weight * step[-1, at_end]
        gradient_change = float(np.max(np.abs(Hd))) / gradient_size
        predicted_decrease = -min(phi_slope, 0.0) / max(abs(best.cost), _MIN_DIVISOR)
        duality_gap = solution.gap / max(abs(best.cost), _MIN_DIVISOR)
        max_duality_gap = SETTINGS.gap_share * max(predicted_decrease, self._limits.tolerance)
        finer_tolerance = self._solver.tolerance
        if duality_gap > max_duality_gap and finer_tolerance > SETTINGS.min_tolerance:
            finer_tolerance *= SETTINGS.gap_share * max_duality_gap / duality_gap
            self._solver = StageSolver(max(finer_tolerance, SETTINGS.min_tolerance))
            return self.step()
        best.stationarity = max(
            min(gradient_change, 1.0), min(predicted_decrease + duality_gap, 1.0)
        )
        return _Step(
            z,
            u,
            c,
            theta=float(np.sum(np.abs(linear.e)) + np.sum(np.abs(gap))),
            phi=(phi := best.cost + price * float(np.sum(violation))),
            phi_slope=phi_slope,
            curvature=curvature,
            merit=phi + _gap_cost(gap, weight, best.force),
            merit_slope=merit_slope,
            force=force,
            predicted_violation=float(np.max(solution.violation, initial=0.0)),
            program=program,
            solution=solution,
            value=objective.rows.values(best.nodes, linear)[0],
        )

    def try_step(self, step: _Step) -> Iterate | None:
        """The motion after the largest accepted part of a step; None if all are rejected."""
        best, objective = self.best, self.objective
        for alpha, (nodes, ends) in self._trial_motions(step):
            if objective.rows.n_slack(ends) > objective.rows.n_slack(best.ends):
                continue  # a slack string has no derivative that would pull it taut again
            cost = objective.cost(nodes, ends)
            phi = cost + objective.price * float(np.sum(objective.rows.violation(nodes, ends)))
            gap = objective.gap(nodes)
            theta = float(np.sum(np.abs(ends.e)) + np.sum(np.abs(gap)))
            if not self._filter.accepts(
                (step.theta, step.phi), (theta, phi), alpha * step.phi_slope
            ):
                continue
            merit = phi + _gap_cost(gap, objective.end_weight, best.force)
            predicted_decrease = max(
                -alpha * (step.merit_slope + 0.5 * alpha * step.curvature), _MIN_DIVISOR
            )
            limits = self._limits
            small_decrease = limits.cost_tolerance * abs(step.phi)
            is_small = (
                abs(step.phi - phi) <= small_decrease
                and best.damping <= SETTINGS.max_settled_damping
            )
            is_small = is_small and step.theta <= SETTINGS.max_settled_theta * limits.tolerance
            # A shortened step decreases little in any case: its prediction must also be small.
            is_small = is_small and (alpha == 1.0 or abs(step.phi_slope) <= small_decrease)
            settled = self._small_steps.record(is_small)
            if theta > SETTINGS.max_gap_ratio * step.theta > limits.tolerance:
                objective.raise_end_weight()
            return replace(
                best,
                nodes=nodes,
                ends=ends,
                cost=cost,
                force=step.force,
                damping=_next_damping(
                    best.damping, alpha, (step.merit - merit) / predicted_decrease
                ),
                settled=settled,
            )
        return None

    def _trial_motions(self, step: _Step) -> Iterator[tuple[float, tuple[Nodes, Ends]]]:
        """Shares of a step and their motions: the full step, its corrections, then halves."""
        best, after_step = self.best, self._shooting.after_step
        for halving in range(SETTINGS.max_halvings):
            alpha = 0.5**halving
            nodes_and_ends = after_step(best.nodes, alpha * step.z, alpha * step.u, alpha * step.c)
            if nodes_and_ends is not None:
                yield alpha, nodes_and_ends
            corrections = SETTINGS.max_corrections if halving == 0 else 0
            solution = step.solution
            for _ in range(corrections):
                if nodes_and_ends is None or not np.any(
                    self.objective.rows.violation(*nodes_and_ends)
                ):
                    break
                value = self.objective.rows.values(*nodes_and_ends)[0]
                solution = self._second_order_correction(step, solution, value)
                if not solution.solved:
                    break
                nodes_and_ends = after_step(best.nodes, *self.objective.expanded(solution))
                if nodes_and_ends is not None:
                    yield alpha, nodes_and_ends

    def _second_order_correction(
        self, step: _Step, solution: StageSolution, value: Array
    ) -> StageSolution:
        """A step with the curvature of the rows taken from another step.

        It is the second-order correction (Fletcher, Practical Methods of Optimization, 1987): a
        step along curved bounds violates them, and would be halved again and again.

        Args:
            step: the step with the program.
            solution: the other step.
            value: (N, m) values of the rows at its end.
        """
        u, z, C, s = solution.u, solution.z, step.program.C, step.program.H.shape[1]
        previous = np.concatenate([np.concatenate([np.zeros_like(u[:1]), u[:-1]]), z[:-1]], axis=1)
        current = np.concatenate([u, z[1:]], axis=1)
        nonlinearity = value - step.value - np.einsum("nmj,nj->nm", C[..., :s], previous)
        nonlinearity -= np.einsum("nmj,nj->nm", C[..., s:], current)
        low, high = (step.program.row_low - nonlinearity, step.program.row_high - nonlinearity)
        program = replace(step.program, row_low=low, row_high=high)
        gradient_size = max(float(np.max(np.abs(program.g))), _MIN_DIVISOR)
        return self._solver.solve(program, min(gradient_size, self.objective.unit))


def merit(objective: Objective, iterate: Iterate, force: Array | float) -> float:
    """J of an iterate plus the cost of its gap and violated rows, with the gap's multipliers."""
    violation = objective.price * float(
        np.sum(objective.rows.violation(iterate.nodes, iterate.ends))
    )
    return (
        iterate.cost
        + violation
        + _gap_cost(objective.gap(iterate.nodes), objective.end_weight, force)
    )


def _gap_cost(gap: Array, weight: float, force: Array | float) -> float:
    """The cost of the gap: weight/2 |gap|^2 + force . gap."""
    return float(np.sum(0.5 * weight * np.square(gap) + force * gap))


def _next_damping(damping: float, alpha: float, decrease_ratio: float) -> float:
    """The damping after a step.

    Args:
        damping: damping before the step.
        alpha: length of the step, relative to the full one.
        decrease_ratio: decrease of the merit relative to the prediction.
    """
    if alpha < 1.0 or decrease_ratio < POOR_DECREASE_RATIO:
        return damping * SETTINGS.damping_factor
    if decrease_ratio > GOOD_DECREASE_RATIO:
        return max(damping / SETTINGS.damping_factor, SETTINGS.min_damping)
    return damping
