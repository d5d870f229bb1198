"""Rollouts of a plan's inputs as a whole, their goal residuals and constraints, and derivatives.

The velocities V of the driven coordinates at the ends of segments define a rollout with::

    r(V)        goal residual at its end,
    c(V) >= 0   clearances, distances from limits and tensions of taut strings, at every look
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
    """Wishes, weights and tolerances of shooting."""

    difference: float = 1e-5
    """Step of a velocity in finite differences [m/s or rad/s]."""
    clearance: float = 0.002
    """Clearance aimed for beyond the margin [m]."""
    limit: float = 0.02
    """Distance aimed for from limits [rad or m]."""
    tension: float = 0.02
    """Tension aimed for, relative to the weight."""
    min_tension: float = 1e-3
    """Minimum tension at the start, relative to the weight, to count as taut."""
    tension_weight: float = 0.3
    """Weight of tensions relative to the puppet's weight, as a constraint [m]."""
    near: float = 0.05
    """Constraints with more to spare are left out."""
    violation: float = 1e-6
    """Violation from which a constraint is reported as broken."""
    compliance: float = 1e-9
    """Compliance of strings, relative to the trace of G, so that they may be redundant."""
    max_displacement: float = 0.005
    """Distance of inputs from the equilibrium at the goal within which a puppet stays [m]."""
    displacement_weight: float = 0.3
    """Weight of that distance relative to the goal residual."""
    max_unknowns: int = 60
    """Unknowns that are varied at once, since each takes a rollout."""
    min_unknowns: int = 6
    """Unknowns of each driven coordinate, whatever their number."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Candidates:
    """n rollouts of m segments.

    Attributes:
        V: (n, m, n_vK) velocities at the ends of segments.
        nodes: (n, looks + 1) states at the looks.
        residual: (n, n_r) of the goal.
        constraints: (n, looks, n_c) c; negative where violated.
        distance: (n,) of the end from the goal.
        calm: (n,) first segment after the last catch.
        merit: (n,) |residual| + the worst violation of every constraint.
    """

    V: Array
    nodes: StateArrays
    residual: Array
    constraints: Array
    distance: Array
    calm: Indices
    merit: Array

    def __len__(self) -> int:
        """Segments."""
        return self.V.shape[1]

    @property
    def best(self) -> Candidates:
        """The candidate with the least merit."""
        return self[int(np.argmin(self.merit))]

    def __getitem__(self, i: int) -> Candidates:
        """One candidate."""
        one = slice(i, i + 1)
        return Candidates(
            self.V[one],
            self.nodes[one],
            self.residual[one],
            self.constraints[one],
            self.distance[one],
            self.calm[one],
            self.merit[one],
        )


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives of a candidate by x, where its velocities change by dV = basis x.

    Attributes:
        basis: (m, n_b) of every coordinate that moves.
        residual: (n_r, n_b n_moves).
        near: (k, 2) looks and numbers of the constraints that are nearly violated.
        constraints: (k, n_b n_moves) derivatives of those.
    """

    basis: Array
    residual: Array
    near: Indices
    constraints: Array


class Shooting:
    """Simulates candidates for plans of a problem.

    Attributes:
        problem: that is planned.
        looks: of a segment.
        moves: (n_m,) indices of driven velocities that may be varied.

    Args:
        problem: see above.
    """

    def __init__(self, problem: Problem):
        rollouts, self.looks = problem.rollouts, problem.rollouts.options.looks
        self.problem, self.moves = problem, np.flatnonzero(rollouts.bounds.moves)
        self._free = rollouts.where(tolerance=-1.0, free=True)
        table = problem.marionette.coordinates
        self._driven = [q for q, v in table.scalars_K if v in self.moves]
        self._taut: Indices = np.zeros(0, dtype=int)
        root, margin, tol = problem.root, rollouts.margin, _TOLERANCES
        still = np.zeros((1, root.v_K.shape[1]))
        if not rollouts.slack:
            self._taut = np.arange(len(problem.marionette.tree.strings))
            tension = self._forces(root, still)[1][0]
            wires = [s.wire for s in problem.marionette.tree.strings]
            self._taut = np.flatnonzero((tension > tol.min_tension) & ~np.array(wires, dtype=bool))
        aims = (margin + tol.clearance, tol.limit, tol.tension_weight * tol.tension)
        aimed = self._by_kind(*aims)
        self._required = self._by_kind(margin, 0.0, 0.0)
        # Where the start misses the aim, only the requirement counts.
        missed = self._measured(root, still)[0] < aimed
        self._aimed = np.where(missed, self._required, aimed)

    @property
    def segment(self) -> float:
        """Duration of a segment [s]."""
        return self.looks * self.problem.rollouts.options.interval

    def accelerations(self, V: Array) -> Array:
        """(..., m, n_vK) accelerations from velocities at the ends of segments."""
        first = np.broadcast_to(self.problem.root.v_K, (*V.shape[:-2], 1, V.shape[-1]))
        return np.diff(np.concatenate([first, V], axis=-2), axis=-2) / self.segment

    def velocities(self, acceleration: Array) -> Array:
        """(m, n_vK) velocities at the ends of segments from accelerations."""
        return self.problem.root.v_K + self.segment * np.cumsum(acceleration, axis=0)

    def within(self, V: Array) -> Array:
        """(..., m, n_vK) velocities that follow given ones within the bounds."""
        bounds, made = self.problem.rollouts.bounds, np.empty_like(V)
        most = self.segment * bounds.acceleration
        v = np.broadcast_to(self.problem.root.v_K[0], V[..., 0, :].shape)
        wanted = np.clip(V, -bounds.speed, bounds.speed)
        for k in range(V.shape[-2]):
            v = made[..., k, :] = v + np.clip(wanted[..., k, :] - v, -most, most)
        return made

    def candidates(self, V: Array) -> Candidates:
        """Rollouts of velocities (n, m, n_vK); bounds and obstacles do not stop them."""
        n, looks = len(V), self.looks
        acc_K = np.repeat(self.accelerations(V), looks, axis=1)
        made = self._free.simulate(self.problem.root, np.zeros(n, int), acc_K, looks=1)
        first = self.problem.root.parts
        nodes = StateArrays(
            **{
                name: np.concatenate([np.repeat(first[name][None], n, axis=0), a], axis=1)
                for name, a in made.states.items()
            }
        )
        residual = self._residual(nodes[:, -1])
        constraints = (self._measured(nodes[:, 1:].flat, flattened(acc_K)) - self._aimed).reshape(
            n, acc_K.shape[1], -1
        )
        worst = np.max(np.maximum(-constraints, 0.0), axis=1)
        merit = np.linalg.norm(residual, axis=1) + np.sum(worst, axis=1)
        merit = np.where((made.looks[:, -1] > 0) & np.isfinite(merit), merit, np.inf)
        caught = (made.catches > 0) * np.arange(1, acc_K.shape[1] + 1)
        calm = -(-np.max(caught, axis=1) // looks)
        return Candidates(V, nodes, residual, constraints, made.distance[:, -1], calm, merit)

    def derivatives(self, candidate: Candidates, first: int = 0) -> Derivatives:
        """Derivatives of one candidate, by forward differences.

        Args:
            candidate: the candidate.
            first: first segment that is varied.
        """
        nodes, looks = candidate.nodes[0], self.looks
        m, n_K = candidate.V.shape[1:]
        basis = self._basis(m, first)
        n_b, n_m = basis.shape[1], len(self.moves)
        changes = np.zeros((n_b, n_m, m, n_K))
        for j, k in enumerate(self.moves):
            changes[:, j, :, k] = _TOLERANCES.difference * basis.T
        dV = changes.reshape(n_b * n_m, m, n_K)
        # A rollout begins at the first segment that changes.
        begin = np.repeat(np.argmax(basis > 0.0, axis=0), n_m) * looks
        dacc = np.diff(dV, axis=1, prepend=0.0) / self.segment
        acc_K = np.repeat(self.accelerations(candidate.V)[0] + dacc, looks, axis=1)
        last = acc_K.shape[1] - 1
        ahead = np.minimum(begin[:, None] + np.arange(last + 1), last)
        each = np.arange(len(begin))
        acc_K = acc_K[each[:, None], ahead]
        again = self._free.simulate(nodes, begin, acc_K, n_segments=last + 1 - begin, looks=1)
        there = StateArrays(**again.states)
        residual = (
            self._residual(there[each, last - begin]) - candidate.residual
        ).T / _TOLERANCES.difference
        # Rollouts that failed are left out.
        residual[:, ~np.isfinite(residual).all(axis=0)] = 0.0
        near = _nearest(candidate.constraints[0], looks)
        at = np.unique(near[:, 0])
        which, when = np.nonzero(at >= begin[:, None])
        off = at[when] - begin[which]
        change = np.zeros((len(begin), len(at), candidate.constraints.shape[2]))
        if len(which):
            found = self._measured(there[which, off], acc_K[which, off]) - self._aimed
            difference = found - candidate.constraints[0, at[when]]
            change[which, when] = difference / _TOLERANCES.difference
        change[~np.isfinite(change)] = 0.0
        constraints = change[:, np.searchsorted(at, near[:, 0]), near[:, 1]].T
        return Derivatives(basis, residual, near, constraints)

    def continued(self, V: Array, more: int) -> Array:
        """V (m, n_vK) with more segments, led to the goal by a funnel, or at rest without one."""
        m, n_K = V.shape
        whole = np.zeros((1, m + more, n_K))
        whole[0, :m] = self.accelerations(V)
        if not self._free.funnels:
            return self.within(np.concatenate([V, np.zeros((more, n_K))]))
        start, n_given = np.zeros(1, int), np.array([m])
        made = self._free.simulate(self.problem.root, start, whole, n_given=n_given)
        return self.velocities(made.acc_K[0])

    def changed(self, V: Array, basis: Array, x: Array) -> Array:
        """V (m, n_vK) + basis x."""
        made = V.copy()
        made[:, self.moves] += basis @ x.reshape(basis.shape[1], len(self.moves))
        return made

    def _basis(self, m: int, first: int) -> Array:
        """(m, n_b) hat functions over the ends of segments; one for each if there are few."""
        wanted = _TOLERANCES.max_unknowns // max(1, len(self.moves))
        n_b = min(m - first, max(_TOLERANCES.min_unknowns, wanted))
        ends, made = np.arange(m - first), np.zeros((m, n_b))
        at = np.linspace(0.0, m - first - 1, n_b)
        made[first:] = np.stack([np.interp(ends, at, one) for one in np.eye(n_b)], axis=1)
        return made

    def broken(self, candidate: Candidates) -> tuple[str, ...]:
        """The kinds of constraints that a candidate violates."""
        kinds = self._by_kind("clearance", "limits", "tension")
        worst = np.min(candidate.constraints[0] + self._aimed - self._required, axis=0)
        return tuple(dict.fromkeys(kinds[worst < -_TOLERANCES.violation].tolist()))

    def stays(self, candidate: Candidates) -> bool:
        """Whether the puppet stays at a candidate's end, where inputs are to end at rest."""
        displacement = np.linalg.norm(self._displacement(candidate.nodes[:, -1]))
        return bool(displacement <= _TOLERANCES.max_displacement)

    def _residual(self, states: StateArrays) -> Array:
        """(n, n_r) residuals of the goal, of its velocities, and of staying there."""
        goal, numbers = self.problem.goal, self.problem.goal.numbers
        speeds = (
            numbers.speed_weight * (states.v_D - numbers.v_D),
            numbers.driven_weight * (states.v_K - numbers.v_K),
        )
        parts = [goal.residuals(states), *speeds, self._displacement(states)]
        return np.concatenate(parts, axis=1)

    def _displacement(self, states: StateArrays) -> Array:
        """(n, n_l) weighted distance of inputs from the equilibrium, where they end at rest."""
        problem = self.problem
        if not (problem.equilibrium and problem.goal.numbers.driven_weight):
            return np.zeros((len(states.q_K), 0))
        away = states.q_K - problem.rollouts.funnels[0].q_K
        return _TOLERANCES.displacement_weight * away[:, self._driven]

    def _measured(self, states: StateArrays, acc_K: Array) -> Array:
        """(n, n_c) clearances, distances from limits, and weighted tensions."""
        rollouts = self.problem.rollouts
        limits, tension = self._forces(states, acc_K)
        parts = [-limits, _TOLERANCES.tension_weight * tension]
        if not rollouts.clearance.measures_nothing:
            threads = rollouts.options.threads
            clear = rollouts.clearance.at(states.q_D, states.q_K, threads=threads)
            parts.insert(0, clear[:, None])
        return np.concatenate(parts, axis=1)

    def _by_kind(self, clearance: object, limit: object, tension: object) -> Any:
        """(n_c,) a number or name for every constraint, by its kind."""
        nothing = self.problem.rollouts.clearance.measures_nothing
        n_limits = len(self.problem.marionette.tree.limits)
        counts = [0 if nothing else 1, n_limits, len(self._taut)]
        return np.repeat([clearance, limit, tension], counts)

    def _forces(self, states: StateArrays, acc_K: Array) -> tuple[Array, Array]:
        """h of limits (n, n_limits), and tensions of taut strings relative to the weight.

        G tau = hddot without tension, over these strings, as if nothing else held.
        """
        marionette, n = self.problem.marionette, len(acc_K)
        found = marionette.library.evaluate(
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
            return found.h_limit, np.zeros((n, 0))
        G = found.G[:, taut[:, None], taut]
        trace = np.trace(G, axis1=1, axis2=2)[:, None, None]
        G = G + _TOLERANCES.compliance * trace * np.eye(len(taut))
        tension = np.linalg.solve(G, (found.gamma + found.a0)[:, taut, None])[..., 0]
        return found.h_limit, tension / marionette.weight


def _nearest(constraints: Array, looks: int) -> Indices:
    """(k, 2) looks and numbers of constraints (n, n_c) near violation: the worst look of each
    segment."""
    by_segment = constraints.reshape(len(constraints) // looks, looks, constraints.shape[1])
    segment, which = np.nonzero(np.min(by_segment, axis=1) < _TOLERANCES.near)
    worst = np.argmin(by_segment, axis=1)[segment, which]
    return np.stack([segment * looks + worst, which], axis=1)
