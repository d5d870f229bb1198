"""Guidance of a problem's rollouts: equilibria at the goal, and feedback laws towards them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import ConfigD, ConfigK, StateError
from fantoccini.control.problems.balance import balanced
from fantoccini.control.problems.lqr_laws import lqr_laws, servo
from fantoccini.control.problems.pushing import Push
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.problems.standing import stance
from fantoccini.control.tasks import Goal, StateArrays, Touches
from fantoccini.kernel.runtime import LqrLaw
from fantoccini.motion import State


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances for the equilibrium at the goal and the choice of a feedback law."""

    trial_segments: int = 20
    """Number of segments after which feedback laws are compared."""
    trial_lead_time: float = 0.6
    """Lead time of their references in that comparison [s]."""
    max_unbalanced: float = 1e-6
    """Largest residual force in equilibrium, relative to the puppet's weight."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Guidance:
    """Feedback laws of rollouts.

    Attributes:
        laws: the laws; empty if the driven coordinates cannot reach the target.
        equilibrium: whether the first law leads to rest at the goal with the required clearance.
        note: description of anything missing at the goal; empty if nothing is.
    """

    laws: list[LqrLaw]
    equilibrium: bool
    note: str = ""


def guidance(
    goal: Goal, start: State, rollouts: Rollouts, touches: Touches, push: Push | None
) -> Guidance:
    """The feedback laws for a problem's rollouts.

    Args:
        goal, start, rollouts, touches: parts of the problem.
        push: push of a prop, if the goal is a place of one.
    """
    if push is not None:
        return _pushing(push, start, rollouts)
    if goal.share is not None:
        return _standing(goal, start, rollouts, touches)
    return _hanging(goal, start, rollouts, touches)


def _standing(goal: Goal, start: State, rollouts: Rollouts, touches: Touches) -> Guidance:
    """A law that drives the inputs to the stance of the puppet."""
    result = stance(goal, start, rollouts, touches)
    if result.state is None:
        return Guidance([], False, result.note)
    law = _servo(rollouts, result.state.q_D, result.state.q_K)
    return Guidance([law], not result.note, result.note)


def _pushing(push: Push, start: State, rollouts: Rollouts) -> Guidance:
    """Laws that drive the pusher to its position at the prop's goal, or behind the prop."""
    laws = []
    for goal in push.waypoints:
        q_D, q_K, residual_force = balanced(rollouts.marionette, goal, start, rollouts.bounds.moves)
        if _in_range(rollouts, q_K) and residual_force <= _max_residual_force(rollouts):
            laws.append(_servo(rollouts, q_D, q_K))
    note = "" if laws else f"{push.pusher} cannot hang where it would push {push.prop}"
    return Guidance(laws, False, note)


def _hanging(goal: Goal, start: State, rollouts: Rollouts, touches: Touches) -> Guidance:
    """A law that drives the puppet to the hanging equilibrium nearest to the goal."""
    marionette, bounds = rollouts.marionette, rollouts.bounds
    q_D, q_K, residual_force = balanced(marionette, goal, start, bounds.moves)
    if goal.q_K is not None:
        q_K = np.where(bounds.moves, goal.q_K, start.q_K)
    # `balanced` does not solve for lengths wound by a drive.
    wound = any(string.wound_length for string in marionette.tree.strings)
    if wound or residual_force > _max_residual_force(rollouts) or goal.q_K is not None:
        try:
            equilibrium = marionette.rest(start.replace(q_D=q_D, q_K=q_K))
        except StateError:
            return Guidance([], False)
        q_D, q_K = equilibrium.q_D, equilibrium.q_K
    if not _in_range(rollouts, q_K):
        return Guidance([], False)
    without_contact = replace(rollouts.run_options, contacts=None)
    rollouts.laws = lqr_laws(marionette, q_D, q_K, bounds.moves, without_contact, rollouts.options)
    if touches.expected:
        rollouts.laws.append(_servo(rollouts, q_D, q_K))
    chosen = _best_of(rollouts, start)
    at_rest = start.replace(q_D=q_D, q_K=q_K, v_D=0.0 * start.v_D, v_K=0.0 * start.v_K)
    at_goal = goal.distance(StateArrays.of(at_rest))[0] <= rollouts.stop_distance
    clear = rollouts.clearance.at(q_D, q_K) >= rollouts.margin
    return Guidance([chosen], bool(at_goal and clear))


def _servo(rollouts: Rollouts, q_D: ConfigD, q_K: ConfigK) -> LqrLaw:
    moves, segment = rollouts.bounds.moves, rollouts.options.segment
    return servo(rollouts.marionette, q_D, q_K, moves, segment)


def _in_range(rollouts: Rollouts, q_K: ConfigK) -> bool:
    """Whether the driven coordinates are within their ranges."""
    return bool(np.all((q_K >= rollouts.bounds.low) & (q_K <= rollouts.bounds.high)))


def _max_residual_force(rollouts: Rollouts) -> float:
    return _TOLERANCES.max_unbalanced * rollouts.marionette.weight


def _best_of(rollouts: Rollouts, start: State) -> LqrLaw:
    """The feedback law that comes nearest to the goal from the start, ignoring obstacles."""
    n, segments = len(rollouts.laws), _TOLERANCES.trial_segments
    law_index, zeros = np.arange(n), np.zeros(n, dtype=int)
    segments_run = rollouts.with_tolerance(tolerance=-1.0, free=True).simulate(
        StateArrays.of(start),
        zeros,
        np.zeros((n, segments, rollouts.marionette.coordinates.n_vK)),
        n_given=zeros,
        law=law_index,
        lead_time=np.full(n, _TOLERANCES.trial_lead_time),
    )
    late_distances = np.where(segments_run.n_checks > 0, segments_run.distance, np.inf)[
        :, segments // 2 :
    ]
    return rollouts.laws[int(np.argmin(np.mean(late_distances, axis=1)))]
