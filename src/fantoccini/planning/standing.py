"""Stances: how a puppet stands near a goal, its strings and what it stands on together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows
from fantoccini.errors import StateError
from fantoccini.marionette import Marionette
from fantoccini.marionette.settling import settled
from fantoccini.motion import State
from fantoccini.planning.balance import balanced, best_support
from fantoccini.planning.goals import Goal
from fantoccini.planning.rollouts import Rollouts
from fantoccini.planning.state_arrays import StateArrays
from fantoccini.planning.touches import Touches, carried
from fantoccini.simulation import simulate


@dataclass(frozen=True)
class _Tolerances:
    """How a stance is searched for."""

    lowered: tuple[float, ...] = (0.0, 0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03)
    """How far the strings let the puppet down from where its feet just touch [m]."""
    spare: float = 1.25
    """Share of the weight that is aimed for, relative to the one that is asked for."""
    weighed: float = 0.2
    """How long a puppet at rest is watched to weigh what it stands on [s]."""
    difference: float = 1e-6
    """Step of finite differences [m or rad]."""
    min_tension: float = 1e-6
    """Tension, relative to the weight, from which on a string carries."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Stance:
    """How a puppet stands.

    Attributes:
        state: at rest, with contact; None where no stance was found.
        share: part of the weight that the touches carry.
        note: what the stance lacks, in words; empty where nothing.
    """

    state: State | None
    share: float
    note: str


def stance(goal: Goal, start: State, rollouts: Rollouts, touches: Touches) -> Stance:
    """A rest with contact near a goal.

    The puppet hangs where its feet just touch, as near to the goal as it can, and is let down on
    its strings by more and more until it comes to rest on its feet with the share of its weight on
    them that is asked for.

    Args:
        goal: that asks for a stance.
        start: where the plan begins.
        rollouts, touches: of the problem.

    Returns:
        The first stance that is at the goal; otherwise the one with the largest share.
    """
    marionette, bounds = rollouts.marionette, rollouts.bounds
    q_D, q_K, _ = balanced(marionette, goal, start, bounds.moves)
    way = _lower(marionette, q_D, q_K, bounds.moves)
    wanted = min(1.0, _TOLERANCES.spare * (goal.share or 0.0))
    best, nearest = Stance(None, 0.0, ""), np.inf
    for down in _TOLERANCES.lowered:
        lowered = q_K + down * way
        if not np.all((lowered >= bounds.low) & (lowered <= bounds.high)):
            continue
        try:
            found = settled(marionette.model, start.replace(q_D=q_D, q_K=lowered))
        except StateError:
            continue
        if not np.all(touches.gaps(found.q_D, found.q_K) < _TOLERANCES.difference):
            continue
        share, distance = _share(marionette, found), _distance(goal, found)
        nearest = min(nearest, distance)
        if share >= wanted and distance <= rollouts.stop_distance:
            return Stance(found, share, "")
        if share > best.share:
            best = Stance(found, share, "")
    feet = ", ".join(f"{a} on {b}" for a, b in touches.asked)
    if best.state is None:
        return Stance(None, 0.0, f"no rest was found with {feet}")
    if best.share < (goal.share or 0.0):
        note = f"{feet}: the largest share of the weight that was found is {best.share:.2f}"
        return Stance(best.state, best.share, note)
    note = f"the nearest stance that was found is {nearest:.3g} from the goal"
    return Stance(best.state, best.share, note)


def _distance(goal: Goal, x: State) -> float:
    return float(goal.distance(StateArrays.of(x))[0])


def _share(marionette: Marionette, x: State) -> float:
    """The part of the weight that rests on what a puppet touches."""
    run = simulate(
        marionette, x.replace(t=0.0), t_end=_TOLERANCES.weighed, method="timestepping", throw=False
    )
    return carried(marionette, run)


def _lower(marionette: Marionette, q_D: ConfigD, q_K: ConfigK, moves: MaskRows) -> Array:
    """(n_qK,) the least change of the driven coordinates that gives every string that carries 1 m
    more, dh/dq_K change = -1; the puppet sinks by that much."""
    table, step = marionette.coordinates, _TOLERANCES.difference
    places = [(q, v) for q, v in table.scalars_K if moves[v]]
    _, tension, _ = best_support(marionette, q_D[None], q_K[None])
    pulls = np.flatnonzero(tension[0] > _TOLERANCES.min_tension * marionette.weight)
    every = np.tile(q_K, (len(places) + 1, 1))
    for row, (q, _) in enumerate(places):
        every[row + 1, q] += step
    at = np.tile(q_D, (len(every), 1))
    h = marionette.model.library.evaluate("rows", q_D=at, q_K=every, p=marionette.p).h[:, pulls]
    slopes = (h[1:] - h[0]).T / step
    way = np.zeros(len(q_K))
    way[[q for q, _ in places]] = np.linalg.pinv(slopes) @ -np.ones(len(pulls))
    return way
