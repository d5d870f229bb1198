"""Rollouts of a plan's inputs, with goal residuals, constraints and derivatives.

The velocities V of the driven coordinates at the ends of segments define a rollout with::

    r(V)        goal residual at its end,
    c(V) >= 0   clearances, distances from limits and tensions of taut strings, at every check

A driven coordinate is the end or length of a string, or a driven joint. A segment is a piece of
motion with constant driven accelerations acc_K; q_D, q_K and v_D, v_K are the dynamic and driven
coordinates and velocities. A node is a state at the end of a segment.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import StateArrays, flattened


@dataclass(frozen=True)
class _Tolerances:
    """Targets, weights and tolerances of shooting."""

    difference: float = 1e-5
    """Step of a velocity in finite differences [m/s or rad/s]."""
    spare_clearance: float = 0.002
    """Clearance to aim for in addition to the margin [m]."""
    spare_limit_distance: float = 0.02
    """Distance from limits to aim for [rad or m]."""
    target_tension: float = 0.02
    """Tension to aim for, relative to the weight."""
    min_tension: float = 1e-3
    """Minimum tension at the start, relative to the weight, to count as taut."""
    tension_weight: float = 0.3
    """Weight of tensions relative to the puppet's weight, as a constraint [m]."""
    max_near_value: float = 0.05
    """Largest value of the constraints that programs include."""
    max_violation: float = 1e-6
    """Largest violation of a constraint that is not reported."""
    compliance: float = 1e-9
    """Compliance of strings, relative to the trace of G, which allows redundant strings."""
    max_displacement: float = 0.005
    """Largest distance of inputs from the equilibrium at the goal for a puppet that stays [m]."""
    displacement_weight: float = 0.3
    """Weight of that distance relative to the goal residual."""
    max_unknowns: int = 60
    """Largest number of unknowns varied at once, with a rollout for each."""
    min_unknowns: int = 6
    """Smallest number of unknowns for each driven coordinate."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Candidates:
    """n rollouts of m segments.

    Attributes:
        V: (n, m, n_vK) velocities at the ends of segments.
        nodes: (n, n_checks + 1) states at the checks.
        residual: (n, n_r) goal residuals.
        constraints: (n, n_checks, n_c) values of c; negative if violated.
        distance: (n,) distances of the ends from the goal.
        first_calm_segment: (n,) first segment after the last catch.
        merit: (n,) |residual| + the worst violation of every constraint.
    """

    V: Array
    nodes: StateArrays
    residual: Array
    constraints: Array
    distance: Array
    first_calm_segment: Indices
    merit: Array

    def __len__(self) -> int:
        """Number of segments."""
        return self.V.shape[1]

    @property
    def best(self) -> Candidates:
        """The candidate with the least merit."""
        return self[int(np.argmin(self.merit))]

    def __getitem__(self, i: int) -> Candidates:
        """A single candidate, as an array of one."""
        rows = slice(i, i + 1)
        return Candidates(
            self.V[rows],
            self.nodes[rows],
            self.residual[rows],
            self.constraints[rows],
            self.distance[rows],
            self.first_calm_segment[rows],
            self.merit[rows],
        )


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of a candidate with respect to x, for changes dV = basis x of its velocities.

    Attributes:
        basis: (m, n_b) basis for the velocity of every coordinate that moves.
        residual: (n_r, n_b n_moves) derivatives of the goal residual.
        near_violations: (k, 2) checks and indices of the constraints that are nearly violated.
        constraints: (k, n_b n_moves) derivatives of those.
    """

    basis: Array
    residual: Array
    near_violations: Indices
    constraints: Array


class Shooting:
    """Simulations of candidates for plans of a problem.

    Attributes:
        problem: the planning problem.
        n_checks: number of checks in a segment.
        movable: (n_m,) indices of driven velocities that may be varied.

    Args:
        problem: see above.
    """

    def __init__(self, problem: Problem):
        rollouts, self.n_checks = problem.rollouts, problem.rollouts.options.n_checks
        self.problem, self.movable = problem, np.flatnonzero(rollouts.bounds.movable)
        self._unbounded_rollouts = rollouts.with_tolerance(tolerance=-1.0, unbounded=True)
        table = problem.marionette.coordinates
        self._driven = [q for q, v in table.scalars_K if v in self.movable]
        self._taut: Indices = np.zeros(0, dtype=int)
        root, margin, tolerances = problem.root, rollouts.margin, _TOLERANCES
        zeros = np.zeros((1, root.v_K.shape[1]))
        if not rollouts.slack:
            self._taut = np.arange(len(problem.marionette.tree.strings))
            tension = self._forces(root, zeros)[1][0]
            is_wire = [s.wire for s in problem.marionette.tree.strings]
            self._taut = np.flatnonzero(
                (tension > tolerances.min_tension) & ~np.array(is_wire, dtype=bool)
            )
        target_values = (
            margin + tolerances.spare_clearance,
            tolerances.spare_limit_distance,
            tolerances.tension_weight * tolerances.target_tension,
        )
        values_to_reach = self._for_each_constraint(*target_values)
        self._required = self._for_each_constraint(margin, 0.0, 0.0)
        # If the start misses the aim, only the requirement counts.
        below_aim = self._constraint_values(root, zeros)[0] < values_to_reach
        self._targets = np.where(below_aim, self._required, values_to_reach)

    @property
    def segment(self) -> float:
        """Duration of a segment [s]."""
        return self.n_checks * self.problem.rollouts.options.interval

    def accelerations(self, V: Array) -> Array:
        """(..., m, n_vK) accelerations from velocities at the ends of segments."""
        start = np.broadcast_to(self.problem.root.v_K, (*V.shape[:-2], 1, V.shape[-1]))
        return np.diff(np.concatenate([start, V], axis=-2), axis=-2) / self.segment

    def velocities(self, acceleration: Array) -> Array:
        """(m, n_vK) velocities at the ends of segments from accelerations."""
        return self.problem.root.v_K + self.segment * np.cumsum(acceleration, axis=0)

    def within(self, V: Array) -> Array:
        """(..., m, n_vK) velocities clipped to the bounds."""
        bounds, velocities = self.problem.rollouts.bounds, np.empty_like(V)
        max_change = self.segment * bounds.acceleration
        v = np.broadcast_to(self.problem.root.v_K[0], V[..., 0, :].shape)
        target = np.clip(V, -bounds.speed, bounds.speed)
        for k in range(V.shape[-2]):
            v = velocities[..., k, :] = v + np.clip(target[..., k, :] - v, -max_change, max_change)
        return velocities

    def candidates(self, V: Array) -> Candidates:
        """Rollouts of velocities (n, m, n_vK), not stopped by bounds and obstacles."""
        n, n_checks = len(V), self.n_checks
        acc_K = np.repeat(self.accelerations(V), n_checks, axis=1)
        segments = self._unbounded_rollouts.simulate(
            self.problem.root, np.zeros(n, int), acc_K, n_checks=1
        )
        start = self.problem.root.parts
        nodes = StateArrays(
            **{
                name: np.concatenate([np.repeat(start[name][None], n, axis=0), array], axis=1)
                for name, array in segments.states.items()
            }
        )
        residual = self._residual(nodes[:, -1])
        constraints = (
            self._constraint_values(nodes[:, 1:].flat, flattened(acc_K)) - self._targets
        ).reshape(n, acc_K.shape[1], -1)
        worst = np.max(np.maximum(-constraints, 0.0), axis=1)
        merit = np.linalg.norm(residual, axis=1) + np.sum(worst, axis=1)
        merit = np.where((segments.n_checks[:, -1] > 0) & np.isfinite(merit), merit, np.inf)
        catch_check = (segments.catches > 0) * np.arange(1, acc_K.shape[1] + 1)
        first_calm_segment = -(-np.max(catch_check, axis=1) // n_checks)
        return Candidates(
            V, nodes, residual, constraints, segments.distance[:, -1], first_calm_segment, merit
        )

    def derivatives(self, candidate: Candidates, first_segment: int = 0) -> Derivatives:
        """Derivatives of a single candidate, by forward differences.

        Args:
            candidate: the candidate.
            first_segment: index of the first segment that is varied.
        """
        nodes, n_checks = candidate.nodes[0], self.n_checks
        m, n_K = candidate.V.shape[1:]
        basis = self._basis(m, first_segment)
        n_b, n_m = basis.shape[1], len(self.movable)
        velocity_changes = np.zeros((n_b, n_m, m, n_K))
        for j, k in enumerate(self.movable):
            velocity_changes[:, j, :, k] = _TOLERANCES.difference * basis.T
        dV = velocity_changes.reshape(n_b * n_m, m, n_K)
        # A rollout begins at the first segment that changes.
        first_check = np.repeat(np.argmax(basis > 0.0, axis=0), n_m) * n_checks
        dacc = np.diff(dV, axis=1, prepend=0.0) / self.segment
        acc_K = np.repeat(self.accelerations(candidate.V)[0] + dacc, n_checks, axis=1)
        last = acc_K.shape[1] - 1
        columns = np.minimum(first_check[:, None] + np.arange(last + 1), last)
        rows = np.arange(len(first_check))
        acc_K = acc_K[rows[:, None], columns]
        segments = self._unbounded_rollouts.simulate(
            nodes, first_check, acc_K, n_segments=last + 1 - first_check, n_checks=1
        )
        states = StateArrays(**segments.states)
        residual = (
            self._residual(states[rows, last - first_check]) - candidate.residual
        ).T / _TOLERANCES.difference
        # Rollouts that failed are left out.
        residual[:, ~np.isfinite(residual).all(axis=0)] = 0.0
        near_violations = _nearest(candidate.constraints[0], n_checks)
        checks_near = np.unique(near_violations[:, 0])
        rollout, check_index = np.nonzero(checks_near >= first_check[:, None])
        offset = checks_near[check_index] - first_check[rollout]
        change = np.zeros((len(first_check), len(checks_near), candidate.constraints.shape[2]))
        if len(rollout):
            values = (
                self._constraint_values(states[rollout, offset], acc_K[rollout, offset])
                - self._targets
            )
            difference = values - candidate.constraints[0, checks_near[check_index]]
            change[rollout, check_index] = difference / _TOLERANCES.difference
        change[~np.isfinite(change)] = 0.0
        constraints = change[
            :, np.searchsorted(checks_near, near_violations[:, 0]), near_violations[:, 1]
        ].T
        return Derivatives(basis, residual, near_violations, constraints)

    def extended(self, V: Array, n_extra: int) -> Array:
        """V (m, n_vK) with more segments, led to the goal by a law, or at rest without one."""
        m, n_K = V.shape
        accelerations = np.zeros((1, m + n_extra, n_K))
        accelerations[0, :m] = self.accelerations(V)
        if not self._unbounded_rollouts.laws:
            return self.within(np.concatenate([V, np.zeros((n_extra, n_K))]))
        start, n_given = np.zeros(1, int), np.array([m])
        segments = self._unbounded_rollouts.simulate(
            self.problem.root, start, accelerations, n_prescribed=n_given
        )
        return self.velocities(segments.acc_K[0])

    def with_step(self, V: Array, basis: Array, x: Array) -> Array:
        """The velocities V + basis x (m, n_vK)."""
        V_changed = V.copy()
        V_changed[:, self.movable] += basis @ x.reshape(basis.shape[1], len(self.movable))
        return V_changed

    def _basis(self, m: int, first_segment: int) -> Array:
        """(m, n_b) hat functions over the ends of segments; one for each if there are few."""
        per_coordinate = _TOLERANCES.max_unknowns // max(1, len(self.movable))
        n_b = min(m - first_segment, max(_TOLERANCES.min_unknowns, per_coordinate))
        ends, basis = np.arange(m - first_segment), np.zeros((m, n_b))
        knots = np.linspace(0.0, m - first_segment - 1, n_b)
        basis[first_segment:] = np.stack(
            [np.interp(ends, knots, hat) for hat in np.eye(n_b)], axis=1
        )
        return basis

    def violated_constraints(self, candidate: Candidates) -> tuple[str, ...]:
        """The kinds of constraints that a candidate violates."""
        kinds = self._for_each_constraint("clearance", "limits", "tension")
        worst = np.min(candidate.constraints[0] + self._targets - self._required, axis=0)
        return tuple(dict.fromkeys(kinds[worst < -_TOLERANCES.max_violation].tolist()))

    def stays_at_goal(self, candidate: Candidates) -> bool:
        """Whether the puppet stays at a candidate's end, if its inputs must end at rest."""
        displacement = np.linalg.norm(self._displacement(candidate.nodes[:, -1]))
        return bool(displacement <= _TOLERANCES.max_displacement)

    def _residual(self, states: StateArrays) -> Array:
        """(n, n_r) residuals of the goal, its velocities and the inputs' equilibrium."""
        goal, numbers = self.problem.goal, self.problem.goal.numbers
        speeds = (
            numbers.speed_weight * (states.v_D - numbers.v_D),
            numbers.driven_weight * (states.v_K - numbers.v_K),
        )
        parts = [goal.residuals(states), *speeds, self._displacement(states)]
        return np.concatenate(parts, axis=1)

    def _displacement(self, states: StateArrays) -> Array:
        """(n, n_l) weighted distance of inputs from the equilibrium, if they must end at rest."""
        problem = self.problem
        if not (problem.rests_at_goal and problem.goal.numbers.driven_weight):
            return np.zeros((len(states.q_K), 0))
        displacement = states.q_K - problem.rollouts.laws[0].q_K
        return _TOLERANCES.displacement_weight * displacement[:, self._driven]

    def _constraint_values(self, states: StateArrays, acc_K: Array) -> Array:
        """(n, n_c) clearances, distances from limits, and weighted tensions."""
        rollouts = self.problem.rollouts
        limits, tension = self._forces(states, acc_K)
        parts = [-limits, _TOLERANCES.tension_weight * tension]
        if not rollouts.clearance.measures_nothing:
            threads = rollouts.options.threads
            clearance = rollouts.clearance.at(states.q_D, states.q_K, threads=threads)
            parts.insert(0, clearance[:, None])
        return np.concatenate(parts, axis=1)

    def _for_each_constraint(self, clearance: object, limit: object, tension: object) -> Any:
        """(n_c,) a number or name for every constraint, by its kind."""
        no_clearance = self.problem.rollouts.clearance.measures_nothing
        n_limits = len(self.problem.marionette.tree.limits)
        counts = [0 if no_clearance else 1, n_limits, len(self._taut)]
        return np.repeat([clearance, limit, tension], counts)

    def _forces(self, states: StateArrays, acc_K: Array) -> tuple[Array, Array]:
        """The h of limits (n, n_limits), and tensions of taut strings relative to the weight.

        They satisfy G tau = hddot without tension, over these strings, ignoring other forces.
        """
        marionette, n = self.problem.marionette, len(acc_K)
        values = marionette.library.evaluate(
            "dynamics",
            q_D=states.q_D,
            v_D=states.v_D,
            q_K=states.q_K,
            v_K=states.v_K,
            acc_K=acc_K,
            u_D=np.zeros_like(states.v_D),
            p=marionette.p,
        )
        taut = self._taut
        if not len(taut):
            return values.h_limit, np.zeros((n, 0))
        G = values.G[:, taut[:, None], taut]
        trace = np.trace(G, axis1=1, axis2=2)[:, None, None]
        G = G + _TOLERANCES.compliance * trace * np.eye(len(taut))
        tension = np.linalg.solve(G, (values.gamma + values.a0)[:, taut, None])[..., 0]
        return values.h_limit, tension / marionette.weight


def _nearest(constraints: Array, n_checks: int) -> Indices:
    """(k, 2) checks and indices of constraints near violation, from (n, n_c) values.

    They are the worst check of each segment.
    """
    by_segment = constraints.reshape(len(constraints) // n_checks, n_checks, constraints.shape[1])
    segment, constraint = np.nonzero(np.min(by_segment, axis=1) < _TOLERANCES.max_near_value)
    worst = np.argmin(by_segment, axis=1)[segment, constraint]
    return np.stack([segment * n_checks + worst, constraint], axis=1)
