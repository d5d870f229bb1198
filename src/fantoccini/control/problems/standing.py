"""Stances: how a puppet stands near a goal, its strings and what it stands on together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, ConfigD, ConfigK, MaskRows, StateError, Status
from fantoccini.control.problems.balance import balanced, best_support
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.tasks import Goal, StateArrays, Touches, carried
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory


@dataclass(frozen=True)
class _Tolerances:
    """How a stance is searched for."""

    lowered: tuple[float, ...] = (0.0, 0.001, 0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03)
    """How far the strings let the puppet down from where its feet just touch [m]."""
    spare: float = 1.25
    """Share of the weight that is aimed for, relative to the one that is asked for."""
    above: float = 0.01
    """Height above that place from which the puppet is let down [m]."""
    lowering: float = 1.0
    """How long it is let down [s]."""
    settling: float = 1.5
    """How long it then has to come to rest [s]."""
    dt: float = 0.002
    """Step of these runs [s]."""
    closed: float = 1e-5
    """Gap up to which feet stand on what is below them [m]."""
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
    raised = q_K - _TOLERANCES.above * way
    try:
        above = marionette.rest(start.replace(q_D=q_D, q_K=raised))
    except StateError as error:
        return Stance(None, 0.0, f"no rest was found above the stance: {error}")
    for down in _TOLERANCES.lowered:
        lowered = q_K + down * way
        if not np.all((lowered >= bounds.low) & (lowered <= bounds.high)):
            continue
        run = _let_down(marionette, above, lowered)
        found, share = run.state(-1), carried(marionette, run)
        found = found.replace(v_D=np.zeros_like(found.v_D), v_K=np.zeros_like(found.v_K))
        rests = np.all(touches.gaps(found.q_D, found.q_K) < _TOLERANCES.closed)
        if run.status is not Status.DONE or not rests:
            continue
        distance = float(goal.distance(StateArrays.of(found))[0])
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


def _let_down(marionette: Marionette, x: State, q_K: ConfigK) -> Trajectory:
    """A puppet is let down from a state to driven coordinates (n_qK,), and comes to rest there."""
    half, last = 0.5 * _TOLERANCES.lowering, _TOLERANCES.settling
    table, acceleration = marionette.coordinates, np.zeros((3, marionette.coordinates.n_vK))
    for q, v in table.scalars_K:
        acceleration[:2, v] = np.array([1.0, -1.0]) * (q_K[q] - x.q_K[q]) / half**2
    times = np.array([0.0, half, 2.0 * half, 2.0 * half + last])
    inputs = Input.segments(marionette, times, x.q_K, np.zeros(table.n_vK), acceleration)
    method = TimeStepping(dt=_TOLERANCES.dt)
    return simulate(marionette, x.replace(t=0.0), inputs, method=method, throw=False)


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
    h = marionette.library.evaluate("rows", q_D=at, q_K=every, p=marionette.p).h[:, pulls]
    slopes = (h[1:] - h[0]).T / step
    way = np.zeros(len(q_K))
    way[[q for q, _ in places]] = np.linalg.pinv(slopes) @ -np.ones(len(pulls))
    return way
