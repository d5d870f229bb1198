"""Where a problem's rollouts are led: equilibria at the goal, and the laws that lead there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import ConfigD, ConfigK, StateError
from fantoccini.control.problems.balance import balanced
from fantoccini.control.problems.funnels import funnels, servo
from fantoccini.control.problems.pushing import Push
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.problems.standing import stance
from fantoccini.control.tasks import Goal, StateArrays, Touches
from fantoccini.kernel.runtime import Funnel
from fantoccini.motion import State


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances for the equilibrium at the goal and the choice of a feedback law."""

    trial_segments: int = 20
    """Segments after which feedback laws are compared."""
    trial_lead_time: float = 0.6
    """Time by which their references run ahead in that comparison [s]."""
    max_unbalanced: float = 1e-6
    """Force left on a puppet in equilibrium, relative to its weight."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Guidance:
    """Laws that lead rollouts.

    Attributes:
        funnels: the laws; empty where the driven coordinates cannot be there.
        equilibrium: whether the first leads to rest at the goal, clear of what is kept off.
        note: what was not found at the goal, in words; empty where nothing is missing.
    """

    funnels: list[Funnel]
    equilibrium: bool
    note: str = ""


def guidance(
    goal: Goal, start: State, rollouts: Rollouts, touches: Touches, push: Push | None
) -> Guidance:
    """The laws that lead a problem's rollouts.

    Args:
        goal, start, rollouts, touches: of the problem.
        push: of a prop, where the goal is its place.
    """
    if push is not None:
        return _pushing(push, start, rollouts)
    if goal.share is not None:
        return _standing(goal, start, rollouts, touches)
    return _hanging(goal, start, rollouts, touches)


def _standing(goal: Goal, start: State, rollouts: Rollouts, touches: Touches) -> Guidance:
    """Leads the driven coordinates to where the puppet stands."""
    found = stance(goal, start, rollouts, touches)
    if found.state is None:
        return Guidance([], False, found.note)
    law = _servo(rollouts, found.state.q_D, found.state.q_K)
    return Guidance([law], not found.note, found.note)


def _pushing(push: Push, start: State, rollouts: Rollouts) -> Guidance:
    """Leads the pusher to where the prop is at the goal, or behind the prop at first."""
    found = []
    for goal in push.waypoints:
        q_D, q_K, left = balanced(rollouts.marionette, goal, start, rollouts.bounds.moves)
        if _within(rollouts, q_K) and left <= _max_left(rollouts):
            found.append(_servo(rollouts, q_D, q_K))
    note = "" if found else f"{push.pusher} cannot hang where it would push {push.prop}"
    return Guidance(found, False, note)


def _hanging(goal: Goal, start: State, rollouts: Rollouts, touches: Touches) -> Guidance:
    """Leads to the equilibrium on its strings that is nearest to the goal."""
    marionette, bounds = rollouts.marionette, rollouts.bounds
    q_D, q_K, left = balanced(marionette, goal, start, bounds.moves)
    if goal.q_K is not None:
        q_K = np.where(bounds.moves, goal.q_K, start.q_K)
    # Lengths wound by a drive are not solved for in `balanced`.
    wound = any(string.wound_length for string in marionette.tree.strings)
    if wound or left > _max_left(rollouts) or goal.q_K is not None:
        try:
            at = marionette.rest(start.replace(q_D=q_D, q_K=q_K))
        except StateError:
            return Guidance([], False)
        q_D, q_K = at.q_D, at.q_K
    if not _within(rollouts, q_K):
        return Guidance([], False)
    alone = replace(rollouts.run_options, contacts=None)
    rollouts.funnels = funnels(marionette, q_D, q_K, bounds.moves, alone, rollouts.options)
    if touches.expected:
        rollouts.funnels.append(_servo(rollouts, q_D, q_K))
    chosen = _best_of(rollouts, start)
    at_rest = start.replace(q_D=q_D, q_K=q_K, v_D=0.0 * start.v_D, v_K=0.0 * start.v_K)
    there = goal.distance(StateArrays.of(at_rest))[0] <= rollouts.stop_distance
    clear = rollouts.clearance.at(q_D, q_K) >= rollouts.margin
    return Guidance([chosen], bool(there and clear))


def _servo(rollouts: Rollouts, q_D: ConfigD, q_K: ConfigK) -> Funnel:
    moves, segment = rollouts.bounds.moves, rollouts.options.segment
    return servo(rollouts.marionette, q_D, q_K, moves, segment)


def _within(rollouts: Rollouts, q_K: ConfigK) -> bool:
    """Whether the driven coordinates can be there."""
    return bool(np.all((q_K >= rollouts.bounds.low) & (q_K <= rollouts.bounds.high)))


def _max_left(rollouts: Rollouts) -> float:
    return _TOLERANCES.max_unbalanced * rollouts.marionette.weight


def _best_of(rollouts: Rollouts, start: State) -> Funnel:
    """The feedback law that comes nearest to the goal from the start, without obstacles."""
    n, segments = len(rollouts.funnels), _TOLERANCES.trial_segments
    which, none = np.arange(n), np.zeros(n, dtype=int)
    made = rollouts.where(tolerance=-1.0, free=True).simulate(
        StateArrays.of(start),
        none,
        np.zeros((n, segments, rollouts.marionette.coordinates.n_vK)),
        n_given=none,
        funnel=which,
        lead_time=np.full(n, _TOLERANCES.trial_lead_time),
    )
    late = np.where(made.looks > 0, made.distance, np.inf)[:, segments // 2 :]
    return rollouts.funnels[int(np.argmin(np.mean(late, axis=1)))]
