"""The hanging poses that a search found, with descriptions of the bounds that limit them.

In a hanging pose, a puppet is at rest for given driven coordinates q_K: ends and lengths of its
strings. q_D are its dynamic coordinates. A taut string pulls, a slack one does not.
"""

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

_MIN_PRICE_SHARE = 0.01
"""Smallest price (multiplier) of a bound that is described, relative to the largest."""
_MIN_TENSION_SHARE = 1e-6
"""Minimum tension, relative to the weight, to count as taut."""
_MAX_RATE_ROUNDING = 1e-9
"""Largest |dq_D/dq_K| that counts as rounding: the driven coordinates do not move q_D."""


_STATUS_OF_END = {
    ReachEnd.REACHED: AnswerStatus.REACHED,
    ReachEnd.NEAREST: AnswerStatus.OUT_OF_REACH,
    ReachEnd.STALLED: AnswerStatus.UNSURE,
    ReachEnd.TIPS: AnswerStatus.TIPS,
}


@dataclass(frozen=True, eq=False)
class ReachProblem:
    """The problem of a search for hanging poses.

    Attributes:
        marionette: the puppet.
        start: start of the search.
        names: names of the targets: points of bodies, or orientations.
        places: (n, n_targets, 3) required positions [m] or rotation vectors [rad].
        moving_mask: (n_targets, n_vD + n_vK) bool, the velocities that move each target.
        low, high: (n_vK + n_p,) bounds of the driven coordinates and the parameters.
        tension_low, tension_high: (n_rows,) bounds of the tensions of strings that are taut and
            of the forces of joint limits that are reached [N or N m].
        joint_low, joint_high: (n_vD,) bounds of scalar dynamic coordinates.
    """

    marionette: Marionette
    start: State
    names: tuple[Any, ...]
    places: Array
    moving_mask: MaskRows
    low: Array
    high: Array
    tension_low: Array
    tension_high: Array
    joint_low: Array
    joint_high: Array


@dataclass(frozen=True, eq=False)
class ReachedPose(Answer):
    """The hanging pose nearest to the required places, reached or not.

    ``bool(pose)`` is whether it reaches them.

    Attributes:
        status: outcome of the search.
        state: the pose, at rest, of the puppet with ``parameters``.
        distance: norm of the remaining distances of all targets [m or rad].
        distances: target -> its remaining distance [m or rad].
        parameters: values of the parameters that were chosen.
        tension: string -> tension [N].
        taut: strings that pull.
        immovable: dynamic coordinates that the driven ones cannot move from this pose, to first
            order.
        limits: descriptions of the bounds that keep it from its places; empty if it reaches them.
    """

    status: AnswerStatus
    state: State
    distance: float
    distances: dict[str, float]
    parameters: dict[str, float]
    tension: dict[str, float]
    taut: tuple[str, ...]
    immovable: tuple[str, ...]
    limits: tuple[str, ...]

    def summary(self) -> str:
        """Description of the pose, in lines."""
        if self:
            return f"reached, hanging on {', '.join(self.taut)}"
        lines = [f"{self.status.name}: {self.status.message}"]
        lines += [
            f"{name} comes no nearer than {length_text(distance)}"
            for name, distance in self.distances.items()
        ]
        return "\n".join([*lines, *self.limits])


@dataclass(frozen=True, eq=False)
class ReachedPoses:
    """Hanging poses nearest to the required places of n problems.

    ``bool(poses)`` is whether all reach their places. D stands for the dynamic coordinates, K for
    the driven (kinematic) ones.

    Attributes:
        problem: the problem of the search.
    """

    problem: ReachProblem
    _result: Reached

    def __bool__(self) -> bool:
        return all(self._result.status == ReachEnd.REACHED)

    def __len__(self) -> int:
        return len(self._result.status)

    def __iter__(self) -> Iterator[ReachedPose]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return (
            f"<ReachedPoses: {int(self.reached.sum())} of {len(self)} reached, at most "
            f"{length_text(float(self.distance.max()))} away>"
        )

    @property
    def start_is_lost(self) -> bool:
        """Whether the search could not begin: the puppet does not hang in its start pose."""
        return bool(np.any(self._result.status == ReachEnd.LOST))

    @property
    def reached(self) -> Mask:
        """(n,) bool, the poses that reach their places."""
        return self._result.status == ReachEnd.REACHED

    @property
    def status(self) -> tuple[AnswerStatus, ...]:
        """Outcome of the search for each pose."""
        return tuple(_STATUS_OF_END[ReachEnd(code)] for code in self._result.status.tolist())

    @property
    def offsets(self) -> Array:
        """(n, n_targets, 3) offsets of targets from their places, 0 in free axes [m or rad]."""
        return self._result.left

    @cached_property
    def distance(self) -> Array:
        """(n,) norms of the offsets of all targets [m or rad]."""
        return np.sqrt(np.sum(np.square(self._result.left), axis=(1, 2)))

    @property
    def q_D(self) -> Array:
        """(n, n_qD) dynamic coordinates of the poses."""
        return self._result.q_D

    @property
    def q_K(self) -> Array:
        """(n, n_qK) driven coordinates of the poses."""
        return self._result.q_K

    @property
    def p(self) -> Array:
        """(n, n_p) parameters of the puppet."""
        return self._result.p

    @property
    def tension(self) -> Array:
        """(n, n_rows) tensions of strings, forces of limits [N or N m]."""
        return self._result.tension

    @property
    def iterations(self) -> NDArray[np.int32]:
        """(n,) numbers of iterations of the search."""
        return self._result.iterations

    @property
    def jacobian(self) -> Array:
        """(n, n_vD, n_vK) dq_D/dq_K of each pose."""
        n_K = self.problem.marionette.coordinates.n_vK
        return self._result.by[:, :n_K].swapaxes(1, 2)

    def __getitem__(self, i: int) -> ReachedPose:
        problem, result = self.problem, self._result
        marionette, table = problem.marionette, problem.marionette.coordinates
        state = problem.start.replace(
            q_D=result.q_D[i], q_K=result.q_K[i], taut=result.held[i].astype(bool)
        )
        names = [s.name for s in marionette.tree.strings]
        is_moved = np.max(np.abs(self.jacobian[i]), axis=1, initial=0.0) > _MAX_RATE_ROUNDING
        target_labels = target_names(problem.names)
        free_parameters = {
            name: float(result.p[i, j])
            for name, j in marionette.parameter_index.items()
            if problem.low[table.n_vK + j] < problem.high[table.n_vK + j]
        }
        distances = np.linalg.norm(result.left[i], axis=1)
        min_tension = _MIN_TENSION_SHARE * (marionette.weight or 1.0)
        return ReachedPose(
            self.status[i],
            state,
            float(self.distance[i]),
            dict(zip(target_labels, distances.tolist(), strict=True)),
            free_parameters,
            dict(zip(names, result.tension[i].tolist(), strict=False)),
            tuple(
                s
                for s, tension in zip(names, result.tension[i], strict=False)
                if tension > min_tension
            ),
            tuple(v for v, can_move in zip(table.v_D, is_moved, strict=True) if not can_move),
            () if self.reached[i] else tuple(self._limits(i)),
        )

    def _limits(self, i: int) -> list[str]:
        """Descriptions of the bounds that keep a pose from its places, the most effective first."""
        problem, result = self.problem, self._result
        marionette = problem.marionette
        table, rows = marionette.coordinates, marionette.tree.row_names
        n_chosen = len(problem.low)  # driven coordinates and parameters
        price = result.price[i].copy()
        is_taut = result.held[i].astype(bool)
        price_effect = np.abs(price)
        price_effect[n_chosen : n_chosen + len(rows)][is_taut] *= marionette.weight or 1.0
        descriptions = []
        for index in np.argsort(-price_effect, kind="stable"):
            if (
                not price_effect[index] > _MIN_PRICE_SHARE * price_effect.max()
                or price_effect[index] == 0.0
            ):
                break
            is_upper = price[index] > 0.0
            if index < n_chosen:
                names = [*table.v_K, *marionette.parameter_index]
                descriptions.append(
                    self._bound_text(
                        names[index], (problem.high if is_upper else problem.low)[index], is_upper
                    )
                )
            elif index < n_chosen + len(rows):
                j = int(index) - n_chosen
                descriptions.append(_row_bound_text(problem, j, bool(is_taut[j]), is_upper))
            else:
                v = int(index) - n_chosen - len(rows)
                bound = (problem.joint_high if is_upper else problem.joint_low)[v]
                descriptions.append(self._bound_text(table.v_D[v], bound, is_upper))
        if self.status[i] is AnswerStatus.TIPS:
            descriptions = ["the puppet would tip over if it came nearer"]
        descriptions += self._limits_of_targets(is_taut)
        if not descriptions:
            descriptions = [
                f"no driven coordinate moves {target_name(target)} any further along "
                f"({_direction(-offset)})"
                for target, offset in zip(problem.names, result.left[i], strict=True)
                if np.linalg.norm(offset) > 0.0
            ]
        return descriptions

    def _limits_of_targets(self, is_taut: MaskRows) -> list[str]:
        """Descriptions of the joint limits that are reached, of joints that move a target."""
        tree = self.problem.marionette.tree
        moves_target, names = np.any(self.problem.moving_mask, axis=0), tree.row_names
        n = len(tree.strings)
        return [
            f"the joint's limit {names[n + i]} is met"
            for i, limit in enumerate(tree.limits)
            if is_taut[n + i] and moves_target[tree.links[limit.link].v.start]
        ]

    def _bound_text(self, name: str, bound: float, is_upper: bool) -> str:
        """Description of the bound of a coordinate or parameter that would have to be exceeded."""
        string_names = {
            s.driven_length[1]: s.name
            for s in self.problem.marionette.tree.strings
            if s.driven_length
        }
        v_K = self.problem.marionette.coordinates.v_K
        if name in v_K and (v := list(v_K).index(name)) in string_names:
            comparison = "longer" if is_upper else "shorter"
            return f"the string {string_names[v]} would have to be {comparison} than {bound:.4g} m"
        return f"{name} would have to be {'above' if is_upper else 'below'} {bound:.4g}"


def _row_bound_text(problem: ReachProblem, j: int, is_active: bool, is_upper: bool) -> str:
    """Description of why string or joint limit j keeps a pose from its places."""
    marionette = problem.marionette
    name, is_string = marionette.tree.row_names[j], j < len(marionette.tree.strings)
    if not is_active:
        if is_string:
            return f"the string {name} is at its full length"
        return f"the joint's limit {name} is met"
    if is_upper:
        return (
            f"the string {name} would have to pull with more than {problem.tension_high[j]:.3g} N"
        )
    if not is_string:
        return f"the joint would have to be pulled against its limit {name}"
    if problem.tension_low[j] > 0.0:
        return f"the string {name} would pull with less than {problem.tension_low[j]:.3g} N"
    return f"the string {name} would have to push"


def target_name(target: Any) -> str:
    """Name of a target, which is a name or (name, position)."""
    return str(target[0]) if isinstance(target, tuple) else str(target)


def target_names(targets: Sequence[Any]) -> list[str]:
    """Distinct names of targets; those of several points of a body end with their positions."""
    names = [target_name(target) for target in targets]
    return [
        f"{name} at ({', '.join(f'{x:g}' for x in target[1])})"
        if names.count(name) > 1 and isinstance(target, tuple)
        else name
        for name, target in zip(names, targets, strict=True)
    ]


def length_text(metres: float) -> str:
    """A length in mm or m, as text."""
    return f"{1e3 * metres:.3g} mm" if metres < 1.0 else f"{metres:.3g} m"


def _direction(x: Array) -> str:
    """Unit vector along x as text, without negative zeros."""
    return ", ".join(f"{index:.2f}" for index in np.round(x / np.linalg.norm(x), 2) + 0.0)
