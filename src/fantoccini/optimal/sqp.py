"""Sequential quadratic programming with Gauss-Newton's Hessian.

Every iteration linearises all intervals and residuals, solves a program of stages for a step
(u, z), and goes along it until a filter accepts the pair

    theta = |e|_1 + |x_N - end|_1,   phi = J + price of passed rows

(Waechter and Biegler, Math. Program. 106, 2006): one of them must be better than in all iterations
before in which theta was reduced.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fantoccini.arrays import Array
from fantoccini.optimal.dynamics import Ends, LinearEnds
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.objective import END_WEIGHT, Objective
from fantoccini.optimal.quadratic import StageSolution, StageSolver


class Shooting(Protocol):
    """How motions are made."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """The same ends with derivatives."""

    def moved(self, nodes: Nodes, z: Array, u: Array, longer: float) -> tuple[Nodes, Ends] | None:
        """The nodes after a step, and where they lead; None where there is no motion."""


@dataclass(frozen=True)
class Numbers:
    """Of the method."""

    damping: float = 1e-6
    """Of the Hessian at first, relative to 1."""
    damping_factor: float = 10.0
    most_damping: float = 1e8
    decrease: float = 1e-4
    """Share of the predicted decrease that a step must reach."""
    halvings: int = 8
    margin: float = 1e-5
    """Share of theta by which theta, or J, must be better."""
    power: float = 1.1
    """Of theta, against which the predicted decrease is weighed."""
    most: float = 10.0
    """Largest theta, relative to 1 or to that of the start."""


NUMBERS = Numbers()


class Filter:
    """Pairs (theta, phi) that no later iterate may be worse than in both."""

    def __init__(self) -> None:
        self._pairs: list[tuple[float, float]] = []
        self._most = 0.0

    def accepts(self, before: tuple[float, float], now: tuple[float, float], falls: float) -> bool:
        """Whether a step may be taken; it is noted where it reduces theta.

        Args:
            before, now: (theta, phi) at its start and its end.
            falls: predicted change of phi.
        """
        theta, phi = before
        if not self._most:
            self._most = NUMBERS.most * max(1.0, theta)
        if not (np.isfinite(now[1]) and now[0] <= self._most):
            return False
        margin = 1.0 - NUMBERS.margin
        if any(now[0] > margin * a and now[1] > b - NUMBERS.margin * a for a, b in self._pairs):
            return False
        rounding = 1e-13 * abs(phi)
        if falls < 0.0 and (-falls) ** NUMBERS.power > theta**NUMBERS.power:
            return now[1] <= phi + NUMBERS.decrease * falls + rounding
        if now[0] <= margin * theta or now[1] <= phi - NUMBERS.margin * theta:
            self._pairs.append(before)
            return True
        return theta == 0.0 and now[0] == 0.0 and now[1] <= phi + rounding


@dataclass(eq=False)
class Iterate:
    """A motion, and how far it is from optimal.

    Attributes:
        nodes: of the motion.
        ends: where its intervals lead.
        cost: J.
        solution: the last step, with its multipliers.
        stationarity: largest |H d| of the last step, relative to 1 or the largest gradient.
        defect: largest |e|.
        passed: largest violation of rows.
        iterations: made.
    """

    nodes: Nodes
    ends: Ends
    cost: float
    solution: StageSolution | None = None
    linear: LinearEnds | None = None
    stationarity: float = np.inf
    defect: float = np.inf
    passed: float = np.inf
    iterations: int = 0
    force: Array | float = 0.0
    damping: float = NUMBERS.damping
    stalled: bool = False

    @property
    def kkt(self) -> float:
        """The largest of the residuals."""
        return max(self.stationarity, self.defect, self.passed)


def improve(
    start: Iterate,
    shooting: Shooting,
    objective: Objective,
    solver: StageSolver,
    *,
    tolerance: float,
    iterations: int,
    until: float = np.inf,
    progress: Callable[[Iterate], None] | None = None,
) -> Iterate:
    """Iterates until the KKT residual is below a tolerance, or there is no more progress.

    Args:
        start: first motion.
        shooting: makes motions.
        objective: cost and bounds.
        solver: of the programs.
        tolerance: of the KKT residual.
        iterations: at most.
        until: time of ``time.perf_counter`` at which it ends.
        progress: called after every iteration.
    """
    at, filtered = start, Filter()
    for _ in range(iterations):
        linear = shooting.linearise(at.nodes, at.ends)
        program = objective.program(at.nodes, linear, at.damping, at.force)
        gap = objective.end_gap(at.nodes)
        solution = solver.solve(program)
        if not solution.solved:
            at.damping *= NUMBERS.damping_factor
            at.iterations += 1
            if at.damping > NUMBERS.most_damping:
                at.stalled = True
                return at
            continue
        step = np.concatenate([solution.u, solution.z[1:]], axis=1)
        z, u, longer = objective.widened(solution)
        of_end = (END_WEIGHT * gap + at.force) * (objective.task.end is not None)
        slope = float(np.sum(program.g * step) + of_end @ z[-1])
        curved = np.einsum("nij,nj->ni", program.H, step)
        curved[1:, : solution.u.shape[1]] += np.einsum("nij,ni->nj", program.cross[1:], step[:-1])
        curved[:-1] += np.einsum("nij,nj->ni", program.cross[1:], solution.u[1:])
        size = max(1.0, float(np.max(np.abs(program.g))))
        at.stationarity = float(np.max(np.abs(curved))) / size
        away = np.abs(gap)
        at.defect = float(max(np.max(np.abs(linear.e)), np.max(away, initial=0.0)))
        violation = objective.rows.violation(at.nodes, linear)
        at.passed = float(np.max(violation, initial=0.0))
        at.solution, at.linear = solution, linear
        if at.kkt <= tolerance:
            return at
        theta = float(np.sum(np.abs(linear.e)) + np.sum(away))
        value = at.cost + objective.price * float(np.sum(violation))
        falls = slope - objective.price * float(np.sum(violation) - np.sum(solution.passed))
        found = None
        # Multipliers of the end, as the program's solution has them.
        force = at.force + END_WEIGHT * (gap - z[-1]) * (objective.task.end is not None)
        for halving in range(NUMBERS.halvings):
            alpha = 0.5**halving
            made = shooting.moved(at.nodes, alpha * z, alpha * u, alpha * longer)
            if made is None:
                continue
            nodes, ends = made
            cost = objective.cost(nodes, ends)
            now = cost + objective.price * float(np.sum(objective.rows.violation(nodes, ends)))
            left = float(np.sum(np.abs(ends.e)) + np.sum(np.abs(objective.end_gap(nodes))))
            if objective.rows.n_slack(ends) > objective.rows.n_slack(at.ends):
                continue  # what is slack has no derivative by which it would be pulled taut again
            if filtered.accepts((theta, value), (left, now), alpha * falls):
                found = Iterate(
                    nodes,
                    ends,
                    cost,
                    solution,
                    linear,
                    at.stationarity,
                    at.defect,
                    at.passed,
                    at.iterations + 1,
                    force,
                    _damping(at.damping, halving),
                )
                break
        if found is None:
            at.damping *= NUMBERS.damping_factor**2
            at.iterations += 1
            if at.damping > NUMBERS.most_damping:
                at.stalled = True
                return at
        else:
            at = found
        if progress is not None:
            progress(at)
        if time.perf_counter() > until:
            break
    return at


def _damping(damping: float, halvings: int) -> float:
    """The damping after a step that was halved so often."""
    if halvings == 0:
        return max(damping / NUMBERS.damping_factor, NUMBERS.damping)
    return damping if halvings == 1 else damping * NUMBERS.damping_factor
