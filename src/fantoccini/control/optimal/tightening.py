"""Sequential quadratic programming in a trust region, through the events of event-driven runs.

    phi = J + price (|x_N - end| + passed rows),   |du_j| <= radius most_j

with |a| = sum of |a_i| + a_i^2 / 2, which programs of stages have as the price of their elastic
rows (Fletcher, Practical Methods of Optimization, 14.5). A step is corrected by what the run shows
it to miss at the end: up to some times the same program is solved with

    z_N = z_N + end - x_N(run),

which follows the curved set of motions that meet the end much farther than its tangent does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, OnProgress, SimulationError, StateError
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.hybrid import HybridRuns
from fantoccini.control.optimal.iterations import Limits, SmallSteps, curved, improve
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram, StageSolution, StageSolver
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import Driven, Nodes


@dataclass(frozen=True)
class TighteningSettings:
    """Numbers of the search."""

    radius: float = 0.07
    """Of the trust region at the start, relative to the largest accelerations."""
    least_radius: float = 1e-9
    shorter: float = 0.4
    longer: float = 2.0
    """By which factors the radius changes."""
    taken: float = 1e-4
    poor: float = 0.25
    good: float = 0.75
    """Decrease relative to the prediction, from which a step is taken, and between which the radius
    stays."""
    corrections: int = 3
    """Of a step, at most."""
    price: float = 10.0
    """Of a unit of what is left at the end, in units of the cost, at the start."""
    highest_price: float = 1e3
    price_factor: float = 2.0
    spare: float = 3.0
    """Price relative to the largest multiplier of the end, where it falls again."""
    near: float = 1e-3
    """What may be left at the end where the price falls [m, rad and their rates]."""
    least_price: float = 1e-3
    damping: float = 1e-8
    """Of the Hessian, in units of the cost."""
    patience: int = 40
    """Iterations after which a motion that is still far from its end is given up."""
    far: float = 1e-2
    """What is left at the end, or passed of bounds, from which it is far."""


SETTINGS = TighteningSettings()
_LEAST = 1e-300


@dataclass(frozen=True, eq=False)
class _Step:
    """A step and what its program predicts.

    Attributes:
        linear: what its program is of.
        solution: of the program.
        falls: predicted decrease of phi.
        size: largest |du_j| / most_j.
        left: what the program leaves at the end and of passed rows.
        stationarity: see :class:`fantoccini.control.optimal.sqp.Iterate`.
    """

    linear: LinearEnds
    solution: StageSolution
    falls: float
    size: float
    left: float
    stationarity: float


class Tightening:
    """Improves a motion step by step, whatever its strings do on the way.

    Args:
        start: first motion.
        runs: makes motions, with exact derivatives.
        objective: cost and bounds.
        limits: when it ends.
    """

    def __init__(self, start: Iterate, runs: HybridRuns, objective: Objective, limits: Limits):
        self.best = start
        self._runs, self._objective, self._limits = runs, objective, limits
        self._free = Objective(replace(objective.task, end=None))  # the end is made of rows here
        self._u, self._z = objective.kept
        self._most = Driven.of(objective.task).scale[self._u]
        self._solver, self._radius = StageSolver(), SETTINGS.radius
        self._small_steps, self._gain = SmallSteps(), -np.inf
        self._linear: LinearEnds | None = None

    def run(self, progress: OnProgress | None = None) -> Iterate:
        """The best motion that is found; see :func:`improve`."""
        return improve(self, self._limits, progress)

    def _linearised(self) -> LinearEnds | None:
        """The best motion with derivatives; None where a catch has none."""
        at, free = self.best, self._free
        try:
            linear = self._runs.linearise(at.nodes, at.ends)
        except (SimulationError, StateError):
            return None
        if not free.unit:
            free.take_unit(at.nodes, linear)
            self._objective.unit = free.unit
            free.price = SETTINGS.price * free.unit
        return linear

    def _gap(self, nodes: Nodes) -> Array:
        return self._objective.end_gap(nodes)[self._z]

    def _left(self, nodes: Nodes, ends: Ends) -> float:
        rows = self._objective.rows.violation(nodes, ends)
        return _elastic(self._gap(nodes)) + _elastic(rows)

    def _merit(self, cost: float, nodes: Nodes, ends: Ends) -> float:
        return cost + self._free.price * self._left(nodes, ends)

    def step(self) -> _Step | None:
        """A step from the best motion, whose residuals are noted; None where there is none."""
        at, objective = self.best, self._objective
        if self._linear is None:
            self._linear = self._linearised()
        if (linear := self._linear) is None:
            at.stalled = True
            return None
        gap = self._gap(at.nodes)
        program = self._program(linear, gap)
        size = max(float(np.max(np.abs(program.g))), _LEAST)
        solution = self._solver.solve(program, min(size, self._free.unit))
        if not solution.solved:
            at.stalled = True
            return None
        bent = curved(program, solution)
        step = np.concatenate([solution.u, solution.z[1:]], axis=1)
        left = _elastic(solution.passed)
        slope, price = float(np.sum(program.g * step)), self._free.price
        saved = price * (self._left(at.nodes, at.ends) - left)
        falls = saved - slope - 0.5 * float(np.sum(step * bent))
        at.defect = float(np.max(np.abs(gap), initial=0.0))
        at.passed = float(np.max(objective.rows.violation(at.nodes, at.ends), initial=0.0))
        at.solution = solution
        longest = float(np.max(np.abs(solution.u[:, : len(self._u)]) / self._most))
        # A step that ends at the trust region says nothing of the gradient.
        bends = float(np.max(np.abs(bent))) / size
        saves = max(saved - slope, 0.0) / max(abs(at.cost), _LEAST)
        inside = longest < 0.9 * self._radius
        at.stationarity = max(min(bends, 1.0), min(saves, 1.0)) if inside else 1.0
        return _Step(linear, solution, falls, longest, left, at.stationarity)

    def _program(self, linear: LinearEnds, gap: Array) -> StageProgram:
        """The program of a step within the trust region, that moves the end by ``gap``."""
        at, free, n_u = self.best, self._free, len(self._u)
        made = free.program(at.nodes, linear, SETTINGS.damping * free.unit, 0.0)
        N, n_z, k = made.B.shape
        radius = self._radius * self._most
        low, high = made.low.copy(), made.high.copy()
        low[:, :n_u] = np.maximum(low[:, :n_u], -radius)
        high[:, :n_u] = np.minimum(high[:, :n_u], radius)
        m = len(gap) if self._objective.task.end is not None else 0
        C, ends = np.zeros((N, m, 2 * (k + n_z))), np.full((N, m), UNBOUNDED)
        C[-1, np.arange(m), n_z + 2 * k + np.arange(m)] = 1.0
        row_low, row_high = -ends, ends
        row_low[-1] = row_high[-1] = gap[:m]
        return replace(
            made,
            low=low,
            high=high,
            C=np.concatenate([made.C, C], axis=1),
            row_low=np.concatenate([made.row_low, row_low], axis=1),
            row_high=np.concatenate([made.row_high, row_high], axis=1),
            elastic=np.concatenate([made.elastic, np.full((N, m), free.price)], axis=1),
        )

    def along(self, step: _Step) -> Iterate | None:
        """The motion after a step, corrected; None where it is not taken."""
        at, objective = self.best, self._objective
        before = self._merit(at.cost, at.nodes, at.ends)
        solution, found, best = step.solution, None, -np.inf
        for correction in range(1 + SETTINGS.corrections):
            if correction:
                # What the end misses, seen from this step.
                last = solution.z[-1, : len(self._z)]
                gap = last + self._gap(found[0]) if found is not None else last
                solution = self._solver.solve(self._program(step.linear, gap), self._free.unit)
            if not solution.solved:
                break
            made = self._runs.moved(at.nodes, *objective.widened(solution))
            if made is None:
                break
            cost = objective.cost(*made)
            gain = (before - self._merit(cost, *made)) / max(step.falls, _LEAST)
            if not gain > best:
                break
            best, found, J = gain, made, cost
            if best >= SETTINGS.good or objective.task.end is None:
                break
        self._gain = best
        if found is None or best <= SETTINGS.taken:
            return None
        limits = self._limits
        is_small = best * step.falls <= limits.cost_tolerance * abs(before)
        is_small = is_small and step.size < 0.9 * self._radius
        is_small = is_small and self._left(at.nodes, at.ends) <= limits.tolerance
        settled = self._small_steps.settle(is_small)
        return replace(at, nodes=found[0], ends=found[1], cost=J, settled=settled)

    def learn(self, step: _Step | None, taken: bool) -> None:
        """The radius and the price of the next step."""
        assert step is not None  # or it was stalled before
        at, gain = self.best, self._gain
        if taken:
            self._linear = None
        inside = step.size < 0.9 * self._radius
        unit, price = self._free.unit, self._free.price
        if inside and step.left > 0.1 * self._limits.tolerance:
            price = min(price * SETTINGS.price_factor, SETTINGS.highest_price * unit)
        if gain < SETTINGS.poor:
            self._radius = SETTINGS.shorter * min(step.size, self._radius)
        elif gain > SETTINGS.good and not inside:
            self._radius *= SETTINGS.longer
        near = float(np.max(np.abs(self._gap(self.best.nodes)), initial=0.0)) < SETTINGS.near
        if taken and near:
            needed = SETTINGS.spare * float(np.max(np.abs(step.solution.costate[-1])))
            price = min(price, max(needed, SETTINGS.least_price * unit))
        self._free.price = price
        gives_up = at.iterations >= SETTINGS.patience and max(at.defect, at.passed) > SETTINGS.far
        at.stalled = gives_up or self._radius < SETTINGS.least_radius


def _elastic(a: Array) -> float:
    """What is passed, as programs count it: |a| + a^2 / 2."""
    return float(np.sum(np.abs(a)) + 0.5 * np.sum(np.square(a)))
