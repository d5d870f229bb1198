"""Guidance of a problem's rollouts: equilibria at the goal, and feedback laws towards them.

q_D are the dynamic coordinates and q_K the driven ones, the ends and lengths of strings. A stance
is a state of rest in which the floor carries a part of the weight. A rollout is a simulation within
the search.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import ConfigD, ConfigK, StateError
from fantoccini.control.problems.balance import nearest_equilibrium
from fantoccini.control.problems.lqr_laws import lqr_laws, servo
from fantoccini.control.problems.pushing import Push
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.problems.standing import stance
from fantoccini.control.tasks import Goal, StateArrays, TouchRules
from fantoccini.kernel.runtime import LqrLaw
from fantoccini.motion import State


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances for the equilibrium at the goal and the choice of a feedback law."""

    trial_segments: int = 20
    """Number of segments after which feedback laws are compared."""
    trial_lead_time: float = 0.6
    """Lead time of their references in that comparison [s]."""
    max_relative_residual: float = 1e-6
    """Largest residual force in equilibrium, relative to the puppet's weight."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Guidance:
    """Feedback laws of rollouts.

    Attributes:
        laws: the laws; empty if the driven coordinates cannot reach the target.
        rests_at_goal: whether the first law leads to rest at the goal with the required clearance.
        note: description of anything missing at the goal; empty if nothing is.
    """

    laws: list[LqrLaw]
    rests_at_goal: bool
    note: str = ""


def guidance(
    goal: Goal, start: State, rollouts: Rollouts, touches: TouchRules, push: Push | None
) -> Guidance:
    """The feedback laws for a problem's rollouts.

    Args:
        goal, start, rollouts, touches: parts of the problem.
        push: push of a prop, if the goal is a place of one.
    """
    if push is not None:
        return _pushing_guidance(push, start, rollouts)
    if goal.share is not None:
        return _standing_guidance(goal, start, rollouts, touches)
    return _hanging_guidance(goal, start, rollouts, touches)


def _standing_guidance(
    goal: Goal, start: State, rollouts: Rollouts, touches: TouchRules
) -> Guidance:
    """A law that drives the inputs to the stance of the puppet."""
    result = stance(goal, start, rollouts, touches)
    if result.state is None:
        return Guidance([], False, result.note)
    law = _servo(rollouts, result.state.q_D, result.state.q_K)
    return Guidance([law], not result.note, result.note)


def _pushing_guidance(push: Push, start: State, rollouts: Rollouts) -> Guidance:
    """Laws that drive the pusher to its position at the prop's goal, or behind the prop."""
    laws = []
    for goal in push.waypoints:
        q_D, q_K, residual_force = nearest_equilibrium(
            rollouts.marionette, goal, start, rollouts.bounds.movable
        )
        if _in_range(rollouts, q_K) and residual_force <= _max_residual_force(rollouts):
            laws.append(_servo(rollouts, q_D, q_K))
    note = "" if laws else f"{push.pusher} cannot hang where it would push {push.prop}"
    return Guidance(laws, False, note)


def _hanging_guidance(
    goal: Goal, start: State, rollouts: Rollouts, touches: TouchRules
) -> Guidance:
    """A law that drives the puppet to the hanging equilibrium nearest to the goal."""
    marionette, bounds = rollouts.marionette, rollouts.bounds
    q_D, q_K, residual_force = nearest_equilibrium(marionette, goal, start, bounds.movable)
    if goal.q_K is not None:
        q_K = np.where(bounds.movable, goal.q_K, start.q_K)
    # `nearest_equilibrium` does not solve for lengths wound by a drive.
    has_wound_strings = any(string.wound_length for string in marionette.tree.strings)
    if has_wound_strings or residual_force > _max_residual_force(rollouts) or goal.q_K is not None:
        try:
            equilibrium = marionette.rest(start.replace(q_D=q_D, q_K=q_K))
        except StateError:
            return Guidance([], False)
        q_D, q_K = equilibrium.q_D, equilibrium.q_K
    if not _in_range(rollouts, q_K):
        return Guidance([], False)
    without_contact = replace(rollouts.run_options, contacts=None)
    rollouts.laws = lqr_laws(
        marionette, q_D, q_K, bounds.movable, without_contact, rollouts.options
    )
    if touches.expected:
        rollouts.laws.append(_servo(rollouts, q_D, q_K))
    best_law = _best_law(rollouts, start)
    at_rest = start.replace(q_D=q_D, q_K=q_K, v_D=0.0 * start.v_D, v_K=0.0 * start.v_K)
    at_goal = goal.distance(StateArrays.of(at_rest))[0] <= rollouts.stop_distance
    is_clear = rollouts.clearance.at(q_D, q_K) >= rollouts.margin
    return Guidance([best_law], bool(at_goal and is_clear))


def _servo(rollouts: Rollouts, q_D: ConfigD, q_K: ConfigK) -> LqrLaw:
    movable, segment = rollouts.bounds.movable, rollouts.options.segment
    return servo(rollouts.marionette, q_D, q_K, movable, segment)


def _in_range(rollouts: Rollouts, q_K: ConfigK) -> bool:
    """Whether the driven coordinates are within their ranges."""
    return bool(np.all((q_K >= rollouts.bounds.low) & (q_K <= rollouts.bounds.high)))


def _max_residual_force(rollouts: Rollouts) -> float:
    return _TOLERANCES.max_relative_residual * rollouts.marionette.weight


def _best_law(rollouts: Rollouts, start: State) -> LqrLaw:
    """The feedback law that comes nearest to the goal from the start, ignoring obstacles."""
    n, n_segments = len(rollouts.laws), _TOLERANCES.trial_segments
    law_index, zeros = np.arange(n), np.zeros(n, dtype=int)
    result = rollouts.with_tolerance(tolerance=-1.0, unbounded=True).simulate(
        StateArrays.of(start),
        zeros,
        np.zeros((n, n_segments, rollouts.marionette.coordinates.n_vK)),
        n_prescribed=zeros,
        law=law_index,
        lead_time=np.full(n, _TOLERANCES.trial_lead_time),
    )
    second_half = np.where(result.n_checks > 0, result.distance, np.inf)[:, n_segments // 2 :]
    return rollouts.laws[int(np.argmin(np.mean(second_half, axis=1)))]
