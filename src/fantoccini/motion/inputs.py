"""Inputs of a batch: one for each run.

A batch is many runs over the same time. q_K are the driven coordinates, ends and lengths of
strings; breaks are the times at which pieces meet, and `coef` their coefficients. In names, D
stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import (
    Array,
    InputError,
    Mask,
    Mistake,
    UnknownNameError,
    check_not_negative,
    check_positive,
    frozen,
    polynomial,
    rotation,
)
from fantoccini.motion import binding, pieces, reading
from fantoccini.motion.input import Input
from fantoccini.motion.reading import Table

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable


@dataclass(frozen=True, eq=False)
class Inputs:
    """n :class:`Input` with equal numbers of pieces, as arrays with a leading axis.

    ``inputs[i]`` is the i-th input. An axis of length 1 is shared by all.

    Attributes:
        coordinates: names and indices of the coordinates.
        breaks: (n or 1, n_seg + 1) not decreasing [s]; the last pieces may have no duration.
        coef: (n, n_seg, n_vK, 6) ascending powers of the time since the piece began [m or rad, s].
        base: (n, n_seg, n_qK) configuration of reference [m, rad or 1].
        named: (n or 1, n_vK) whether a coordinate is named; the others hold still.
        force: (n, n_seg, n_vD, 6) generalised forces u_D [N or N m], or None.
        relative: whether the motion is relative to the start state.
    """

    coordinates: CoordinateTable
    breaks: Array
    coef: Array
    base: Array
    named: Mask
    force: Array | None = None
    relative: bool = False

    def __post_init__(self) -> None:
        for name in ("breaks", "coef", "base", "force"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "named", frozen(self.named, bool))
        known = np.where(self.named[:, None, :, None], self.coef, 0.0)
        for field, numbers in (("breaks", self.breaks), ("coef", known), ("force", self.force)):
            if numbers is not None and not np.all(np.isfinite(numbers)):
                text = "has a number that is not finite"
                raise InputError([Mistake("inputs", None, field, text)])

    def __len__(self) -> int:
        return len(self.coef)

    def __repr__(self) -> str:
        interval = f"{np.min(self.breaks):g} to {np.max(self.breaks):g} s"
        return f"<Inputs: {len(self)}, {interval}{', relative' if self.relative else ''}>"

    def __getitem__(self, i: int) -> Input:
        if self.relative:
            raise TypeError(
                "these inputs are relative to a start state; bind them to one first: "
                "inputs.bound(x0.q_K)[i]"
            )
        breaks = self.breaks[i if len(self.breaks) > 1 else 0]
        has_duration = np.diff(breaks) > 0
        force = None if self.force is None else self.force[i][has_duration]
        return Input(
            self.coordinates,
            np.append(breaks[:-1][has_duration], breaks[-1]),
            self.coef[i][has_duration],
            self.base[i][has_duration],
            self.named[i if len(self.named) > 1 else 0],
            force,
        )

    @classmethod
    def stack(cls, inputs: Sequence[Input]) -> Inputs:
        """Several inputs of one puppet. Shorter ones are held at their ends.

        Args:
            inputs: one or more inputs.

        Raises:
            ValueError: the list is empty, or its inputs are of different puppets.
        """
        binding.check_same_puppet([single.coordinates for single in inputs])
        table, n_pieces = inputs[0].coordinates, max(len(single.coef) for single in inputs)
        n, has_force = len(inputs), any(single.force is not None for single in inputs)
        # Shorter ones get pieces of duration 0 at their end.
        breaks = np.empty((n, n_pieces + 1))
        coef = np.empty((n, n_pieces, table.n_vK, polynomial.N_COEF))
        base = np.empty((n, n_pieces, table.n_qK))
        force = np.zeros((n, n_pieces, table.n_vD, polynomial.N_COEF))
        for i, single in enumerate(inputs):
            k = len(single.coef)
            breaks[i, : k + 1], breaks[i, k + 1 :] = single.breaks, single.end
            coef[i, :k], base[i, :k] = single.coef, single.base
            coef[i, k:], base[i, k:] = single.coef[-1], single.base[-1]
            if single.force is not None:
                force[i, :k] = single.force
        if np.all(breaks == breaks[0]):
            breaks = breaks[:1]
        named = np.stack([single.named for single in inputs])
        return cls(table, breaks, coef, base, named, force if has_force else None)

    @classmethod
    def random(
        cls,
        table: Table,
        n: int,
        seed: int = 0,
        *,
        t_end: float = 2.0,
        every: float = 0.25,
        reach: float = 0.05,
        turn: float = 0.3,
        only: Sequence[str] | None = None,
    ) -> Inputs:
        """Random smooth motions about the start state, for Monte-Carlo runs and training data.

        Every coordinate moves between waypoints by minimum-jerk moves. The waypoints are drawn
        uniformly within ``reach`` or ``turn`` of the start state; the last one is the start state.
        The same seed gives the same inputs; the first inputs do not depend on n.

        Args:
            table: coordinate table, or an object with ``.coordinates``.
            n: number of inputs.
            seed: seed of the random numbers.
            t_end: end of the motion [s].
            every: time between waypoints [s].
            reach: largest move of a position or length [m].
            turn: largest turn of an angle or rotation [rad].
            only: names of the coordinates that move; all by default.
        """
        table = reading.table_of(table)
        check_positive(n=n, t_end=t_end, every=every)
        check_not_negative(reach=reach, turn=turn)
        slices = pieces.channel_names(table)
        for name in only or ():
            if name not in slices:
                raise UnknownNameError("driven coordinate", name, slices)
        n_seg = max(1, round(t_end / every))
        breaks = np.linspace(0.0, t_end, n_seg + 1)
        units = {v_index.name: v_index.unit for v_index in table.rows}
        max_moves = np.full(table.n_vK, float(turn))
        for q_index, v_index in table.scalars_K:
            max_moves[v_index] = reach if units[table.q_K[q_index]] == "m" else turn
        for name, (_, v) in slices.items():
            if only is not None and name not in only:
                max_moves[v] = 0.0
        random_points = [
            np.random.default_rng([seed, i]).uniform(-1.0, 1.0, (n_seg + 1, table.n_vK))
            for i in range(n)
        ]
        points = np.stack(random_points) * max_moves
        points[:, [0, -1]] = 0.0
        coef = np.zeros((n, n_seg, table.n_vK, polynomial.N_COEF))
        base = np.zeros((n, n_seg, table.n_qK))
        move, h = np.diff(points, axis=1), t_end / n_seg
        for name, (q, v) in slices.items():
            if name in table.rotations:
                quaternions = rotation.exp(points[:, :, v])
                base[:, :, q] = quaternions[:, :-1]
                move[:, :, v] = rotation.between(quaternions[:, :-1], quaternions[:, 1:])
            else:
                base[:, :, q] = points[:, :-1, v]
                coef[:, :, v, 0] = points[:, :-1, v]
        coef[..., 3:] = move[..., None] * polynomial.MINIMUM_JERK[3:] / h ** np.arange(3, 6)
        return cls(table, breaks[None], coef, base, np.ones((1, table.n_vK), bool), relative=True)

    @property
    def start(self) -> float:
        """The latest first break [s]."""
        return float(np.max(self.breaks[:, 0]))

    @property
    def end(self) -> float:
        """The latest last break [s]."""
        return float(np.max(self.breaks[:, -1]))

    def shifted(self, dt: float) -> Inputs:
        """The same inputs, ``dt`` seconds later."""
        return dataclasses.replace(self, breaks=self.breaks + dt)

    def at_rest(self) -> Inputs:
        """The inputs with small velocities at their ends set to 0; see :meth:`Input.at_rest`."""
        ends = self.breaks[:, 0], self.breaks[:, -1]
        if not any(np.any(self.evaluate(t)[1]) for t in ends):
            return self
        return Inputs.stack([self[i].at_rest() for i in range(len(self))])

    def evaluate(self, t: float | Array) -> tuple[Array, Array, Array]:
        """q_K (n, n_qK), v_K (n, n_vK) and acc_K (n, n_vK) at a time [s], or at n times (n,)."""
        n, n_seg = self.coef.shape[:2]
        breaks = np.broadcast_to(self.breaks, (n, n_seg + 1))
        t = np.broadcast_to(np.asarray(t, dtype=float), n)[:, None]
        clipped_t = np.clip(t, breaks[:, :1], breaks[:, -1:])
        last = (np.diff(breaks) > 0).sum(axis=1) - 1
        i = np.clip((breaks <= clipped_t).sum(axis=1) - 1, 0, last)
        rows = np.arange(n)
        s = clipped_t[:, 0] - breaks[rows, i]
        coef, base = self.coef[rows, i], self.base[rows, i]
        q, v, acc = pieces.evaluate(self.coordinates, coef, base, s)
        outside = ((t < breaks[:, :1]) | (t > breaks[:, -1:]))[:, 0]
        v[outside], acc[outside] = 0.0, 0.0
        return q, v, acc

    def bound(self, q_K: Array, t: float | None = None, v_K: Array | None = None) -> Inputs:
        """The inputs for runs from start states: unnamed coordinates hold the states' values.

        Args:
            q_K: (n or 1, n_qK) driven configurations of the start states [m, rad or 1].
            t: time of the start [s]; by default the latest first break.
            v_K: (n or 1, n_vK) driven velocities of the start states; see :meth:`Input.bound`.

        Raises:
            InputError: a named coordinate differs from its start state.
        """
        q_K = np.atleast_2d(np.asarray(q_K, dtype=float))
        n_v = self.coordinates.n_vK
        v_K = None if v_K is None else np.atleast_2d(np.asarray(v_K, dtype=float))
        if len(q_K) > 1 and np.all(q_K == q_K[0]) and (v_K is None or np.all(v_K == v_K[0])):
            q_K, v_K = q_K[:1], None if v_K is None else v_K[:1]
        n = max(len(q_K), len(self))
        if self.relative:
            return self._added_to(q_K, n)
        coef = np.broadcast_to(self.coef, (n, *self.coef.shape[1:]))
        base = np.broadcast_to(self.base, (n, *self.base.shape[1:]))
        t = self.start if t is None else float(t)
        q_inputs, v_inputs, _ = self.evaluate(t)
        q_inputs = np.broadcast_to(q_inputs, (n, self.coordinates.n_qK))
        v_inputs = np.broadcast_to(v_inputs, (n, n_v))
        q_K = np.broadcast_to(q_K, (n, self.coordinates.n_qK))
        named = np.broadcast_to(self.named, (n, n_v))
        speeds = None if v_K is None else (v_inputs, np.broadcast_to(v_K, (n, n_v)))
        coef, base = binding.bound(
            self.coordinates, self.breaks, coef, base, named, q_inputs, q_K, t, speeds
        )
        return dataclasses.replace(self, coef=coef, base=base)

    def _added_to(self, q_K: Array, n: int) -> Inputs:
        """Relative motions added to start configurations (n or 1, n_qK)."""
        table = self.coordinates
        coef = np.array(np.broadcast_to(self.coef, (n, *self.coef.shape[1:])))
        base = np.array(np.broadcast_to(self.base, (n, *self.base.shape[1:])))
        for q, v in table.scalars_K:
            base[:, :, q] += q_K[:, None, q]
            coef[:, :, v, 0] += q_K[:, None, q]
        for q, _ in table.quaternions_K:
            q_slice = slice(q, q + 4)
            base[:, :, q_slice] = rotation.multiply(q_K[:, None, q_slice], base[:, :, q_slice])
        return dataclasses.replace(self, coef=coef, base=base, relative=False)
