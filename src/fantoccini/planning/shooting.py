"""What comes of a plan's inputs as a whole, what that lacks, and how it answers small changes.

The velocities V of the driven coordinates at the ends of segments decide a motion, and::

    r(V)        what its end lacks of the goal,
    c(V) >= 0   what clearances, limits and the tensions of strings that pull have to spare,
                look by look
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.planning.goals import States, flattened
from fantoccini.planning.problem import Problem

_CHANGE = 1e-5
"""Of a velocity, to see what comes of it [m/s or rad/s]."""

_CLEAR = 0.002
"""Clearance beyond the margin that is wished for [m]."""

_LIMIT = 0.02
"""Distance from limits that is wished for [rad or m]."""

_PULL = 0.02
"""Tension beside the puppet's weight that is wished for."""

_SOME = 1e-3
"""Tension beside the weight from which on a string is to pull."""

_TENSION = 0.3
"""What a tension of the puppet's weight counts."""

_NEAR = 0.05
"""Constraints that have more to spare are left out."""

_BROKEN = 1e-6
"""By which a constraint is missed that is told as broken [m, rad or part of the weight]."""

_STAYS = 0.005
"""How far inputs may be from where the puppet hangs at the goal [m]."""

_AWAY = 0.3
"""Weight of that beside what the goal lacks."""

_UNKNOWNS = 60
"""That are varied at once, at most: more take too long."""

_FEWEST = 6
"""Of a driven coordinate."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Rollouts of the same duration, side by side.

    Attributes:
        V: (n, m, n_vK) velocities at the ends of segments.
        nodes: (n, looks + 1) states from look to look.
        lacks: (n, n_r) of the goal.
        spare: (n, looks, n_c) of constraints; negative where they are broken.
        distance: (n,) of the end from the goal.
        calm: (n,) the segment from which on nothing is caught.
        merit: (n,) |lacks| + the worst of every constraint; 0 where nothing is wrong.
    """

    V: Array
    nodes: States
    lacks: Array
    spare: Array
    distance: Array
    calm: Array
    merit: Array

    def __len__(self) -> int:
        """Segments."""
        return self.V.shape[1]

    @property
    def best(self) -> Candidates:
        """The one with the least merit."""
        return self[int(np.argmin(self.merit))]

    def __getitem__(self, i: int) -> Candidates:
        """One of them."""
        one = slice(i, i + 1)
        return Candidates(
            self.V[one], self.nodes[one], self.lacks[one], self.spare[one], self.distance[one],
            self.calm[one], self.merit[one],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Derivatives:
    """How a way answers changes x of its velocities, dV = basis x.

    Attributes:
        basis: (m, n_b) of every coordinate that moves.
        lacks: (n_r, n_b n_moves).
        near: (k, 2) looks and numbers of the constraints that matter.
        spare: (k, n_b n_moves) their slopes.
    """

    basis: Array
    lacks: Array
    near: Array
    spare: Array


class Shooting:
    """Makes ways of a problem.

    Attributes:
        problem: what was planned.
        looks: of a segment.
        moves: (n_m,) driven velocities that may be varied.

    Args:
        problem: see above.
    """

    def __init__(self, problem: Problem):
        rollouts, self.looks = problem.rollouts, problem.rollouts.options.looks
        self.problem, self.moves = problem, np.flatnonzero(rollouts.bounds.moves)
        self._free = rollouts.where(tolerance=-1.0, free=True)
        table = problem.marionette.coordinates
        self._reached = [q for q, v in table.scalars_K if v in self.moves]
        self._pulls = np.zeros(0, dtype=int)
        root = problem.root
        still = np.zeros((1, root.v_K.shape[1]))
        if not rollouts.options.slack:
            self._pulls = np.arange(len(problem.marionette.tree.strings))
            tension = self._forces(root, still)[1][0]
            wires = [s.wire for s in problem.marionette.tree.strings]
            self._pulls = np.flatnonzero((tension > _SOME) & ~np.array(wires, dtype=bool))
        wished = self._kinds(rollouts.options.margin + _CLEAR, _LIMIT, _TENSION * _PULL)
        self._allowed = self._kinds(rollouts.options.margin, 0.0, 0.0)
        # What the start itself lacks cannot be wished for, only what must be.
        lacking = self._measured(root, still)[0] < wished
        self._wished = np.where(lacking, self._allowed, wished)

    @property
    def segment(self) -> float:
        """Duration of a segment [s]."""
        return self.looks * self.problem.rollouts.options.interval

    def accelerations(self, V: Array) -> Array:
        """(..., m, n_vK) of velocities (..., m, n_vK) at the ends of segments."""
        first = np.broadcast_to(self.problem.root.v_K, (*V.shape[:-2], 1, V.shape[-1]))
        return np.diff(np.concatenate([first, V], axis=-2), axis=-2) / self.segment

    def velocities(self, acceleration: Array) -> Array:
        """(m, n_vK) at the ends of segments."""
        return self.problem.root.v_K + self.segment * np.cumsum(acceleration, axis=0)

    def within(self, V: Array) -> Array:
        """Velocities (..., m, n_vK), followed as the bounds allow."""
        bounds, made = self.problem.rollouts.bounds, np.empty_like(V)
        most = self.segment * bounds.acceleration
        v = np.broadcast_to(self.problem.root.v_K[0], V[..., 0, :].shape)
        wanted = np.clip(V, -bounds.speed, bounds.speed)
        for k in range(V.shape[-2]):
            v = made[..., k, :] = v + np.clip(wanted[..., k, :] - v, -most, most)
        return made

    def ways(self, V: Array) -> Candidates:
        """What comes of velocities (n, m, n_vK), of which bounds and obstacles end none."""
        n, looks = len(V), self.looks
        acc_K = np.repeat(self.accelerations(V), looks, axis=1)
        made = self._free.simulate(self.problem.root, np.zeros(n, int), acc_K, looks=1)
        nodes = States(
            *(
                np.concatenate([np.repeat(first[None], n, axis=0), a], axis=1)
                for first, a in zip(
                    self.problem.root.parts.values(), made.states.values(), strict=True
                )
            )
        )
        lacks = self._lacking(nodes[:, -1])
        spare = (self._measured(nodes[:, 1:].flat, flattened(acc_K)) - self._wished).reshape(
            n, acc_K.shape[1], -1
        )
        worst = np.max(np.maximum(-spare, 0.0), axis=1)
        merit = np.linalg.norm(lacks, axis=1) + np.sum(worst, axis=1)
        merit = np.where((made.looks[:, -1] > 0) & np.isfinite(merit), merit, np.inf)
        caught = (made.catches > 0) * np.arange(1, acc_K.shape[1] + 1)
        calm = -(-np.max(caught, axis=1) // looks)
        return Candidates(V, nodes, lacks, spare, made.distance[:, -1], calm, merit)

    def slopes(self, way: Candidates, first: int = 0) -> Derivatives:
        """By differences, of the one way: every unknown is changed by itself.

        Args:
            way: the way.
            first: segment that is varied.
        """
        nodes, looks = way.nodes[0], self.looks
        m, n_K = way.V.shape[1:]
        basis = self._basis(m, first)
        n_b, n_m = basis.shape[1], len(self.moves)
        V = np.zeros((n_b, n_m, m, n_K))
        for j, k in enumerate(self.moves):
            V[:, j, :, k] = _CHANGE * basis.T
        V = V.reshape(n_b * n_m, m, n_K)
        # What is changed from a segment on begins there.
        begin = np.repeat(np.argmax(basis > 0.0, axis=0), n_m) * looks
        dacc = np.diff(V, axis=1, prepend=0.0) / self.segment
        acc_K = np.repeat(self.accelerations(way.V)[0] + dacc, looks, axis=1)
        last = acc_K.shape[1] - 1
        ahead = np.minimum(begin[:, None] + np.arange(last + 1), last)
        each = np.arange(len(begin))
        acc_K = acc_K[each[:, None], ahead]
        again = self._free.simulate(nodes, begin, acc_K, n_segments=last + 1 - begin, looks=1)
        there = States(*again.states.values())
        lacks = (self._lacking(there[each, last - begin]) - way.lacks).T / _CHANGE
        # What could not be made again says nothing.
        lacks[:, ~np.isfinite(lacks).all(axis=0)] = 0.0
        near = _nearest(way.spare[0], looks)
        at = np.unique(near[:, 0])
        which, when = np.nonzero(at >= begin[:, None])
        off = at[when] - begin[which]
        change = np.zeros((len(begin), len(at), way.spare.shape[2]))
        if len(which):
            spare = self._measured(there[which, off], acc_K[which, off]) - self._wished
            change[which, when] = (spare - way.spare[0, at[when]]) / _CHANGE
        change[~np.isfinite(change)] = 0.0
        slopes = change[:, np.searchsorted(at, near[:, 0]), near[:, 1]].T
        return Derivatives(basis, lacks, near, slopes)

    def led(self, V: Array, more: int) -> Array:
        """V (m, n_vK), and then led to the goal for some segments; standing still without a law."""
        m, n_K = V.shape
        whole = np.zeros((1, m + more, n_K))
        whole[0, :m] = self.accelerations(V)
        if not self._free.funnels:
            return self.within(np.concatenate([V, np.zeros((more, n_K))]))
        made = self._free.simulate(self.problem.root, np.zeros(1, int), whole, n_given=np.array([m]))
        return self.velocities(made.acc_K[0])

    def changed(self, V: Array, basis: Array, x: Array) -> Array:
        """V (m, n_vK) + basis x."""
        made = V.copy()
        made[:, self.moves] += basis @ x.reshape(basis.shape[1], len(self.moves))
        return made

    def _basis(self, m: int, first: int) -> Array:
        """(m, n_b) hats over the ends of segments; one each where there are not too many."""
        n_b = min(m - first, max(_FEWEST, _UNKNOWNS // max(1, len(self.moves))))
        ends, made = np.arange(m - first), np.zeros((m, n_b))
        at = np.linspace(0.0, m - first - 1, n_b)
        made[first:] = np.stack([np.interp(ends, at, one) for one in np.eye(n_b)], axis=1)
        return made

    def broken(self, way: Candidates) -> tuple[str, ...]:
        """What a way breaks, of ``clearance``, ``limits`` and ``tension``."""
        kinds = self._kinds("clearance", "limits", "tension")
        worst = np.min(way.spare[0] + self._wished - self._allowed, axis=0)
        return tuple(dict.fromkeys(kinds[worst < -_BROKEN].tolist()))

    def stays(self, way: Candidates) -> bool:
        """Whether the puppet stays at the end of a way, where inputs are to end at rest."""
        return bool(np.linalg.norm(self._leaving(way.nodes[:, -1])) <= _STAYS)

    def _lacking(self, rows: States) -> Array:
        """(n, n_r) what states lack of the goal and its speeds, and of staying there."""
        goal, numbers = self.problem.goal, self.problem.goal.numbers
        speeds = (
            numbers.speed_weight * (rows.v_D - numbers.v_D),
            numbers.driven_weight * (rows.v_K - numbers.v_K),
        )
        return np.concatenate([goal.residuals(rows), *speeds, self._leaving(rows)], axis=1)

    def _leaving(self, rows: States) -> Array:
        """(n, n_l) how far inputs that are to end at rest are from where the puppet hangs."""
        problem = self.problem
        if not (problem.equilibrium and problem.goal.numbers.driven_weight):
            return np.zeros((len(rows.q_K), 0))
        return _AWAY * (rows.q_K - problem.rollouts.funnels[0].q_K)[:, self._reached]

    def _measured(self, rows: States, acc_K: Array) -> Array:
        """(n, n_c) clearances, distances from limits, and tensions."""
        rollouts = self.problem.rollouts
        limits, tension = self._forces(rows, acc_K)
        parts = [-limits, _TENSION * tension]
        if not rollouts.clearance.measures_nothing:
            clear = rollouts.clearance.at(rows.q_D, rows.q_K, threads=rollouts.options.threads)
            parts.insert(0, clear[:, None])
        return np.concatenate(parts, axis=1)

    def _kinds(self, clear: object, limit: object, tension: object) -> Array:
        """(n_c,) a number or name for every constraint, by its kind."""
        nothing = self.problem.rollouts.clearance.measures_nothing
        n_limits = len(self.problem.marionette.tree.limits)
        counts = [0 if nothing else 1, n_limits, len(self._pulls)]
        return np.repeat([clear, limit, tension], counts)

    def _forces(self, rows: States, acc_K: Array) -> tuple[Array, Array]:
        """h of limits (n, n_limits), and tensions of strings that pull beside the weight.

        G tau = hddot without tension, over the strings that pull as if nothing else held.
        """
        marionette, n = self.problem.marionette, len(acc_K)
        found = marionette.model.library.evaluate(
            "dynamics", q_D=rows.q_D, v_D=rows.v_D, q_K=rows.q_K, v_K=rows.v_K, acc_K=acc_K,
            u_D=np.zeros_like(rows.v_D), p=marionette.p,
        )  # fmt: skip
        pulls = self._pulls
        if not len(pulls):
            return found.h_limit, np.zeros((n, 0))
        G = found.G[:, pulls[:, None], pulls]
        G = G + 1e-9 * np.trace(G, axis1=1, axis2=2)[:, None, None] * np.eye(len(pulls))
        tension = np.linalg.solve(G, (found.gamma + found.a0)[:, pulls, None])[..., 0]
        return found.h_limit, tension / marionette.weight


def _nearest(spare: Array, looks: int) -> Array:
    """(k, 2) looks and numbers of constraints (n, n_c) that matter: the worst look of a segment."""
    by_segment = spare.reshape(len(spare) // looks, looks, spare.shape[1])
    segment, which = np.nonzero(np.min(by_segment, axis=1) < _NEAR)
    worst = np.argmin(by_segment, axis=1)[segment, which]
    return np.stack([segment * looks + worst, which], axis=1)
