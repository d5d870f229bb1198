"""What a search for hanging poses found, and in words what keeps them from their places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, Mask, MaskRows
from fantoccini.control.tasks import Answer, AnswerStatus
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.contract import ReachEnd
from fantoccini.kernel.runtime import Reached
from fantoccini.motion import State

_SHARE = 0.01
"""Part of the largest price from which a bound is named."""
_TAUT = 1e-6
"""Tension from which a string pulls, relative to the weight."""
_MOVES = 1e-9
"""Change of a dynamic coordinate by a unit of the driven ones that is rounding."""


_STATUS = {
    ReachEnd.REACHED: AnswerStatus.REACHED,
    ReachEnd.NEAREST: AnswerStatus.OUT_OF_REACH,
    ReachEnd.STALLED: AnswerStatus.UNSURE,
    ReachEnd.TIPS: AnswerStatus.TIPS,
}


@dataclass(frozen=True, eq=False)
class ReachProblem:
    """What was asked for.

    Attributes:
        marionette: the puppet.
        start: where the search began.
        names: of the targets.
        places: (n, n_targets, 3) [m or rad].
        moves: (n_targets, n_vD + n_vK) bool, the velocities that move each target.
        low, high: (n_vK + n_p,) bounds of what is chosen.
        tension_low, tension_high: (n_rows,) of rows that pull [N or N m].
        joint_low, joint_high: (n_vD,) of scalars.
    """

    marionette: Marionette
    start: State
    names: tuple[Any, ...]
    places: Array
    moves: MaskRows
    low: Array
    high: Array
    tension_low: Array
    tension_high: Array
    joint_low: Array
    joint_high: Array


@dataclass(frozen=True, eq=False)
class ReachedPose(Answer):
    """The hanging pose nearest to some places. True where it is there.

    Attributes:
        status: how near it comes.
        state: the pose, at rest; of the puppet with ``parameters``.
        distance: what is left, over all targets [m or rad].
        distances: target -> what is left of it.
        parameters: the values of those that were chosen.
        tension: string -> tension [N].
        taut: strings that pull.
        still: dynamic velocities that no driven coordinate changes there, at first order.
        limits: what keeps it from its places, in words; empty where it is there.
    """

    status: AnswerStatus
    state: State
    distance: float
    distances: dict[str, float]
    parameters: dict[str, float]
    tension: dict[str, float]
    taut: tuple[str, ...]
    still: tuple[str, ...]
    limits: tuple[str, ...]

    def summary(self) -> str:
        """What was found, in lines."""
        if self:
            return f"reached, hanging on {', '.join(self.taut)}"
        lines = [f"{self.status.name}: {self.status.message}"]
        lines += [
            f"{name} comes no nearer than {length(left)}" for name, left in self.distances.items()
        ]
        return "\n".join([*lines, *self.limits])


@dataclass(frozen=True, eq=False)
class ReachedPoses:
    """Hanging poses nearest to places, one for each. True where all are reached.

    Attributes:
        problem: what was asked for.
    """

    problem: ReachProblem
    _found: Reached

    def __bool__(self) -> bool:
        return all(self._found.status == ReachEnd.REACHED)

    def __len__(self) -> int:
        return len(self._found.status)

    def __iter__(self) -> Iterator[ReachedPose]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return (
            f"<ReachedPoses: {int(self.reached.sum())} of {len(self)} reached, at most "
            f"{length(float(self.distance.max()))} away>"
        )

    @property
    def is_lost(self) -> bool:
        """Whether the puppet did not hang at the start."""
        return bool(np.any(self._found.status == ReachEnd.LOST))

    @property
    def reached(self) -> Mask:
        """(n,) bool, the poses that are at their places."""
        return self._found.status == ReachEnd.REACHED

    @property
    def status(self) -> tuple[AnswerStatus, ...]:
        """How near each pose comes."""
        return tuple(_STATUS[ReachEnd(code)] for code in self._found.status.tolist())

    @property
    def left(self) -> Array:
        """(n, n_targets, 3) from the places to where the points are; 0 where free [m or rad]."""
        return self._found.left

    @cached_property
    def distance(self) -> Array:
        """(n,) length of what is left, over all targets [m or rad]."""
        return np.sqrt(np.sum(np.square(self._found.left), axis=(1, 2)))

    @property
    def q_D(self) -> Array:
        """(n, n_qD) the poses."""
        return self._found.q_D

    @property
    def q_K(self) -> Array:
        """(n, n_qK) the driven coordinates with which they hang."""
        return self._found.q_K

    @property
    def p(self) -> Array:
        """(n, n_p) parameters of the puppet."""
        return self._found.p

    @property
    def tension(self) -> Array:
        """(n, n_rows) tensions of strings, forces of limits [N or N m]."""
        return self._found.tension

    @property
    def iterations(self) -> NDArray[np.int32]:
        """(n,) steps of the search."""
        return self._found.iterations

    @property
    def by_K(self) -> Array:
        """(n, n_vD, n_vK) dq_D/dq_K: how each pose follows the driven coordinates."""
        n_K = self.problem.marionette.coordinates.n_vK
        return self._found.by[:, :n_K].swapaxes(1, 2)

    def __getitem__(self, i: int) -> ReachedPose:
        problem, found = self.problem, self._found
        marionette, table = problem.marionette, problem.marionette.coordinates
        state = problem.start.replace(
            q_D=found.q_D[i], q_K=found.q_K[i], taut=found.held[i].astype(bool)
        )
        names = [s.name for s in marionette.tree.strings]
        moves = np.max(np.abs(self.by_K[i]), axis=1, initial=0.0) > _MOVES
        shown = target_names(problem.names)
        chosen = {
            name: float(found.p[i, j])
            for name, j in marionette.parameter_index.items()
            if problem.low[table.n_vK + j] < problem.high[table.n_vK + j]
        }
        left = np.linalg.norm(found.left[i], axis=1)
        least = _TAUT * (marionette.weight or 1.0)
        return ReachedPose(
            self.status[i],
            state,
            float(self.distance[i]),
            dict(zip(shown, left.tolist(), strict=True)),
            chosen,
            dict(zip(names, found.tension[i].tolist(), strict=False)),
            tuple(s for s, pull in zip(names, found.tension[i], strict=False) if pull > least),
            tuple(v for v, m in zip(table.v_D, moves, strict=True) if not m),
            () if self.reached[i] else tuple(self._limits(i)),
        )

    def _limits(self, i: int) -> list[str]:
        """What keeps a pose from its places, the firmest first."""
        problem, found = self.problem, self._found
        marionette = problem.marionette
        table, rows = marionette.coordinates, marionette.tree.row_names
        n_u = len(problem.low)
        price = found.price[i].copy()
        pulls = found.held[i].astype(bool)
        size = np.abs(price)
        size[n_u : n_u + len(rows)][pulls] *= marionette.weight or 1.0
        texts = []
        for c in np.argsort(-size, kind="stable"):
            if not size[c] > _SHARE * size.max() or size[c] == 0.0:
                break
            high = price[c] > 0.0
            if c < n_u:
                names = [*table.v_K, *marionette.parameter_index]
                texts.append(
                    self._beyond(names[c], (problem.high if high else problem.low)[c], high)
                )
            elif c < n_u + len(rows):
                j = int(c) - n_u
                texts.append(_of_row(problem, j, bool(pulls[j]), high))
            else:
                v = int(c) - n_u - len(rows)
                bound = (problem.joint_high if high else problem.joint_low)[v]
                texts.append(self._beyond(table.v_D[v], bound, high))
        if self.status[i] is AnswerStatus.TIPS:
            texts = ["any nearer, the puppet would tip over"]
        texts += self._rests_on(pulls)
        if not texts:
            texts = [
                f"nothing that is driven moves {target_name(what)} any further along "
                f"({_direction(-left)})"
                for what, left in zip(problem.names, found.left[i], strict=True)
                if np.linalg.norm(left) > 0.0
            ]
        return texts

    def _rests_on(self, pulls: MaskRows) -> list[str]:
        """The limits that carry what is to be somewhere."""
        tree = self.problem.marionette.tree
        moved, names, n = np.any(self.problem.moves, axis=0), tree.row_names, len(tree.strings)
        return [
            f"the joint's limit {names[n + i]} is met"
            for i, limit in enumerate(tree.limits)
            if pulls[n + i] and moved[tree.links[limit.link].v.start]
        ]

    def _beyond(self, name: str, bound: float, high: bool) -> str:
        lengths = {
            s.driven_length[1]: s.name
            for s in self.problem.marionette.tree.strings
            if s.driven_length
        }
        v_K = self.problem.marionette.coordinates.v_K
        if name in v_K and (v := list(v_K).index(name)) in lengths:
            more = "longer" if high else "shorter"
            return f"the string {lengths[v]} would have to be {more} than {bound:.4g} m"
        return f"{name} would have to be {'above' if high else 'below'} {bound:.4g}"


def _of_row(problem: ReachProblem, j: int, pulls: bool, high: bool) -> str:
    """In words, what the bound of a row forbids."""
    marionette = problem.marionette
    name, is_string = marionette.tree.row_names[j], j < len(marionette.tree.strings)
    if not pulls:
        return f"the string {name} comes taut" if is_string else f"the joint's limit {name} is met"
    if high:
        return (
            f"the string {name} would have to pull with more than {problem.tension_high[j]:.3g} N"
        )
    if not is_string:
        return f"the limb would leave its limit {name}"
    if problem.tension_low[j] > 0.0:
        return f"the string {name} would pull with less than {problem.tension_low[j]:.3g} N"
    return f"the string {name} would have to push"


def target_name(what: Any) -> str:
    """The name of a target."""
    return str(what[0]) if isinstance(what, tuple) else str(what)


def target_names(targets: Sequence[Any]) -> list[str]:
    """Names of targets, no two alike: several points of a body have their place with them."""
    names = [target_name(what) for what in targets]
    return [
        f"{name} at ({', '.join(f'{x:g}' for x in what[1])})"
        if names.count(name) > 1 and isinstance(what, tuple)
        else name
        for name, what in zip(names, targets, strict=True)
    ]


def length(metres: float) -> str:
    """A length in words."""
    return f"{1e3 * metres:.3g} mm" if metres < 1.0 else f"{metres:.3g} m"


def _direction(x: Array) -> str:
    """A direction in words, without negative zeros."""
    return ", ".join(f"{c:.2f}" for c in np.round(x / np.linalg.norm(x), 2) + 0.0)
