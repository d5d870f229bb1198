"""Sequential quadratic programming with Gauss-Newton's Hessian.

Every iteration linearises all intervals and residuals, solves a program of stages for a step
(u, z), and goes along it until a filter accepts the pair

    theta = |e|_1 + |gap|_1,   phi = J + price of passed rows

with the gap x_N - end and what touches are off their places (Waechter and Biegler, Math. Program.
106, 2006): one of them must be better than in all iterations
before in which theta was reduced.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fantoccini.base import Array, OnProgress
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.iterations import Limits, SmallSteps, curved, improve
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.quadratic import StageProgram, StageSolution, StageSolver
from fantoccini.control.tasks import Nodes


class Shooting(Protocol):
    """How motions are made."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """The same ends with derivatives."""

    def moved(self, nodes: Nodes, z: Array, u: Array, c: Array) -> tuple[Nodes, Ends] | None:
        """The nodes after a step, and where they lead; None where there is no motion."""


@dataclass(frozen=True)
class SearchSettings:
    """Numbers of the search: damping, line search and filter."""

    damping: float = 3e-8
    """Least of the Hessian, in units of the cost."""
    first_damping: float = 3e-8
    damping_factor: float = 4.0
    poor: float = 0.25
    good: float = 0.75
    """Decrease relative to the prediction, between which the damping stays."""
    most_damping: float = 1e8
    decrease: float = 1e-4
    """Share of the predicted decrease that a step must reach."""
    halvings: int = 8
    corrections: int = 3
    """Of a whole step that is not accepted and passes rows."""
    price_factor: float = 4.0
    highest_price: float = 3e3
    """Of a unit of violation of a row, in units of the cost."""
    near: float = 10.0
    """Theta up to which it may be settled, relative to the tolerance."""
    calm: float = 3e-4
    """Damping up to which small steps mean that a motion is settled."""
    margin: float = 1e-5
    """Share of theta by which theta, or J, must be better."""
    powers: tuple[float, float] = (2.3, 1.1)
    """Of the predicted decrease, and of theta against which it is weighed."""
    closes: float = 0.5
    """Share of theta that a step may leave before the weight of the gap is raised."""
    most: float = 10.0
    """Largest theta, relative to 1 or to that of the start."""
    gap_share: float = 0.1
    """Gap of a program up to which its step is taken, of what that saves, or of the tolerance;
    a finer one leaves this share of it."""
    finest: float = 1e-13
    """Least tolerance of programs."""


SETTINGS = SearchSettings()
_LEAST = 1e-300
"""Decrease that is predicted at least: above 0."""


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
            self._most = SETTINGS.most * max(1.0, theta)
        if not (np.isfinite(now[1]) and now[0] <= self._most):
            return False
        margin = 1.0 - SETTINGS.margin
        if any(now[0] > margin * a and now[1] > b - SETTINGS.margin * a for a, b in self._pairs):
            return False
        rounding = 1e-13 * abs(phi)
        if falls < 0.0 and (-falls) ** SETTINGS.powers[0] > theta ** SETTINGS.powers[1]:
            return now[1] <= phi + SETTINGS.decrease * falls + rounding
        if now[0] <= margin * theta < theta or now[1] <= phi - SETTINGS.margin * theta:
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
        stationarity: of the last step d, the larger of |H d|, damping included, relative to the
            gradient, and the decrease of J that its slope promises, with the gap that its program
            was left with, relative to J; at most 1.
        defect: largest |e|.
        passed: largest violation of rows.
        iterations: made.
        force: (n_z + 3 T,) multipliers of the gap.
        damping: of the Hessian of the next step, in units of the cost.
        stalled, settled: whether no step helps any more, or hardly.
    """

    nodes: Nodes
    ends: Ends
    cost: float
    solution: StageSolution | None = None
    stationarity: float = np.inf
    defect: float = np.inf
    passed: float = np.inf
    iterations: int = 0
    force: Array | float = 0.0
    damping: float = SETTINGS.first_damping
    stalled: bool = False
    settled: bool = False

    @property
    def kkt(self) -> float:
        """The largest of the residuals."""
        return max(self.stationarity, self.defect, self.passed)


@dataclass(frozen=True, eq=False)
class _Step:
    """A step, and what it starts from.

    Attributes:
        z, u, c: changes of the states, the accelerations, and of the intervals and parameters.
        theta, phi: of the filter, at its start.
        falls: slope of phi along it.
        bend: its curvature in the program.
        merit: phi and what the gap costs, at its start.
        merit_falls: slope of the merit along it.
        force: multipliers of the gap, after it.
        passes: how far its program passes rows.
        program, solution: in which it was found.
        value: (N, m) rows at its start.
    """

    z: Array
    u: Array
    c: Array
    theta: float
    phi: float
    falls: float
    bend: float
    merit: float
    merit_falls: float
    force: Array | float
    passes: float
    program: StageProgram
    solution: StageSolution
    value: Array


class Search:
    """Improves a motion step by step.

    Args:
        start: first motion.
        shooting: makes motions.
        objective: cost and bounds.
        limits: when it ends.
    """

    def __init__(self, start: Iterate, shooting: Shooting, objective: Objective, limits: Limits):
        self.best = start
        self._shooting, self.objective, self._limits = shooting, objective, limits
        self._solver, self._filter, self._small_steps = StageSolver(), Filter(), SmallSteps()

    def run(self, progress: OnProgress | None = None) -> Iterate:
        """The best motion that is found; see :func:`improve`."""
        return improve(self, self._limits, progress)

    def learn(self, step: _Step | None, taken: bool) -> None:
        """Raises the damping where no step was taken.

        Where even the program passes rows, their price is too low, or they contradict.
        """
        at, objective = self.best, self.objective
        if not taken:
            at.damping *= SETTINGS.damping_factor**2
        at.stalled = at.damping > min(self._limits.damping, SETTINGS.most_damping)
        dear = objective.price >= SETTINGS.highest_price * objective.unit
        if at.stalled or step is None or step.passes <= self._limits.tolerance or dear:
            return
        objective.price *= SETTINGS.price_factor
        self._filter, self._small_steps = Filter(), SmallSteps()

    def step(self) -> _Step | None:
        """A step from the best motion, whose residuals are noted; None where none was found."""
        at, objective = self.best, self.objective
        if len(objective.touches):
            at.nodes = objective.touches.marked(at.nodes)
        linear = self._shooting.linearise(at.nodes, at.ends)
        if not objective.unit:
            objective.take_unit(at.nodes, linear)
        damping = objective.unit * at.damping
        program = objective.program(at.nodes, linear, damping, at.force)
        size = max(float(np.max(np.abs(program.g))), _LEAST)
        solution = self._solver.solve(program, min(size, objective.unit))
        if not solution.solved:
            return None
        u, z = solution.u, solution.z[1:]
        step = np.concatenate([u, z], axis=1)
        bent = curved(program, solution)
        bend = float(np.sum(step * bent))
        gap, violation = objective.gap(at.nodes), objective.rows.violation(at.nodes, linear)
        at.defect = float(max(np.max(np.abs(linear.e)), np.max(np.abs(gap))))
        at.passed = float(np.max(violation, initial=0.0))
        at.solution = solution
        z, u, c = objective.widened(solution)
        weight, (closed, force) = objective.end_weight, objective.closed(at.nodes, z, c, at.force)
        price = objective.price
        rows_fall = price * float(np.sum(violation) - np.sum(solution.passed))
        merit_falls = float(np.sum(program.g * step)) - rows_fall
        falls = merit_falls + float((weight * gap + at.force) @ closed)
        # The first part is the gradient of the Lagrangian with the step's multipliers, damping
        # included. A step that ends short of a bound, as the interior point method does, may
        # save nothing although the bound is not reached: so what it left counts with the second.
        # Not a residual: the weight of the end only shifts multipliers, which the gradient uses.
        if objective.task.goal is not None:
            at_end = solution.u.shape[1] + np.arange(len(objective.kept[1]))
            bent[-1, at_end] -= objective.end_weight * step[-1, at_end]
        bends = float(np.max(np.abs(bent))) / size
        saves = -min(falls, 0.0) / max(abs(at.cost), _LEAST)
        left = solution.gap / max(abs(at.cost), _LEAST)
        most = SETTINGS.gap_share * max(saves, self._limits.tolerance)
        finer = self._solver.tolerance
        if left > most and finer > SETTINGS.finest:
            finer *= SETTINGS.gap_share * most / left
            self._solver = StageSolver(max(finer, SETTINGS.finest))
            return self.step()
        at.stationarity = max(min(bends, 1.0), min(saves + left, 1.0))
        return _Step(
            z,
            u,
            c,
            theta=float(np.sum(np.abs(linear.e)) + np.sum(np.abs(gap))),
            phi=(phi := at.cost + price * float(np.sum(violation))),
            falls=falls,
            bend=bend,
            merit=phi + _of_gap(gap, weight, at.force),
            merit_falls=merit_falls,
            force=force,
            passes=float(np.max(solution.passed, initial=0.0)),
            program=program,
            solution=solution,
            value=objective.rows.values(at.nodes, linear)[0],
        )

    def along(self, step: _Step) -> Iterate | None:
        """The motion as far along a step as the filter accepts it."""
        at, objective = self.best, self.objective
        for alpha, (nodes, ends) in self._trials(step):
            if objective.rows.n_slack(ends) > objective.rows.n_slack(at.ends):
                continue  # what is slack has no derivative by which it would be pulled taut again
            cost = objective.cost(nodes, ends)
            phi = cost + objective.price * float(np.sum(objective.rows.violation(nodes, ends)))
            gap = objective.gap(nodes)
            theta = float(np.sum(np.abs(ends.e)) + np.sum(np.abs(gap)))
            if not self._filter.accepts((step.theta, step.phi), (theta, phi), alpha * step.falls):
                continue
            merit = phi + _of_gap(gap, objective.end_weight, at.force)
            predicted = max(-alpha * (step.merit_falls + 0.5 * alpha * step.bend), _LEAST)
            limits = self._limits
            little = limits.cost_tolerance * abs(step.phi)
            is_small = abs(step.phi - phi) <= little and at.damping <= SETTINGS.calm
            is_small = is_small and step.theta <= SETTINGS.near * limits.tolerance
            # A step that was cut saves little anyway: what it promised must have been little.
            is_small = is_small and (alpha == 1.0 or abs(step.falls) <= little)
            settled = self._small_steps.settle(is_small)
            if theta > SETTINGS.closes * step.theta > limits.tolerance:
                objective.stiffen_end()
            return replace(
                at,
                nodes=nodes,
                ends=ends,
                cost=cost,
                force=step.force,
                damping=_damping(at.damping, alpha, (step.merit - merit) / predicted),
                settled=settled,
            )
        return None

    def _trials(self, step: _Step) -> Iterator[tuple[float, tuple[Nodes, Ends]]]:
        """How far along a step, and the motion there: all of it, corrected, then ever less."""
        at, moved = self.best, self._shooting.moved
        for halving in range(SETTINGS.halvings):
            alpha = 0.5**halving
            made = moved(at.nodes, alpha * step.z, alpha * step.u, alpha * step.c)
            if made is not None:
                yield alpha, made
            corrections = SETTINGS.corrections if halving == 0 else 0
            solution = step.solution
            for _ in range(corrections):
                if made is None or not np.any(self.objective.rows.violation(*made)):
                    break
                value = self.objective.rows.values(*made)[0]
                solution = self._corrected(step, solution, value)
                if not solution.solved:
                    break
                made = moved(at.nodes, *self.objective.widened(solution))
                if made is not None:
                    yield alpha, made

    def _corrected(self, step: _Step, solution: StageSolution, value: Array) -> StageSolution:
        """A step whose rows bend as they do along another one.

        The second-order correction (Fletcher, Practical Methods of Optimization, 1987): a step
        along curved bounds passes them, and would be cut ever shorter.

        Args:
            step: of which the program is.
            solution: the other step.
            value: (N, m) rows at its end.
        """
        u, z, C, s = solution.u, solution.z, step.program.C, step.program.H.shape[1]
        before = np.concatenate([np.concatenate([np.zeros_like(u[:1]), u[:-1]]), z[:-1]], axis=1)
        after = np.concatenate([u, z[1:]], axis=1)
        bent = value - step.value - np.einsum("nmj,nj->nm", C[..., :s], before)
        bent -= np.einsum("nmj,nj->nm", C[..., s:], after)
        low, high = step.program.row_low - bent, step.program.row_high - bent
        program = replace(step.program, row_low=low, row_high=high)
        size = max(float(np.max(np.abs(program.g))), _LEAST)
        return self._solver.solve(program, min(size, self.objective.unit))


def merit(objective: Objective, at: Iterate, force: Array | float) -> float:
    """J of an iterate plus the cost of its gap and violated rows, by the gap's multipliers."""
    passed = objective.price * float(np.sum(objective.rows.violation(at.nodes, at.ends)))
    return at.cost + passed + _of_gap(objective.gap(at.nodes), objective.end_weight, force)


def _of_gap(gap: Array, weight: float, force: Array | float) -> float:
    """What the gap costs: weight/2 |gap|^2 + force . gap."""
    return float(np.sum(0.5 * weight * np.square(gap) + force * gap))


def _damping(damping: float, alpha: float, gain: float) -> float:
    """The damping after a step.

    Args:
        damping: before.
        alpha: how far the step went.
        gain: decrease of the merit relative to what was predicted.
    """
    if alpha < 1.0 or gain < SETTINGS.poor:
        return damping * SETTINGS.damping_factor
    if gain > SETTINGS.good:
        return max(damping / SETTINGS.damping_factor, SETTINGS.damping)
    return damping
