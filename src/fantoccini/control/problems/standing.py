"""Stances: rest near a goal on strings and supports together.

In a stance, supports such as the floor carry a part of the weight. q_D are the dynamic coordinates
and q_K the driven ones, the ends and lengths of strings. A taut string pulls, a slack one does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, ConfigD, ConfigK, MaskRows, StateError, Status
from fantoccini.control.problems.balance import best_support, nearest_equilibrium
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.tasks import Goal, StateArrays, TouchRules, carried_share
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory


@dataclass(frozen=True)
class _Tolerances:
    """Parameters of the search for a stance."""

    lowering_distances: tuple[float, ...] = (
        0.0,
        0.001,
        0.002,
        0.003,
        0.005,
        0.007,
        0.01,
        0.015,
        0.02,
        0.03,
    )
    """Distances by which the strings lower the puppet from first contact of its feet [m]."""
    weight_factor: float = 1.25
    """Share of the weight to aim for, relative to the required share."""
    start_height: float = 0.01
    """Height above first contact from which the puppet is lowered [m]."""
    lowering_time: float = 1.0
    """Duration of lowering [s]."""
    settling_time: float = 1.5
    """Time to come to rest afterwards [s]."""
    dt: float = 0.002
    """Time step of these runs [s]."""
    max_standing_gap: float = 1e-5
    """Largest gap of standing feet [m]."""
    difference: float = 1e-6
    """Step of finite differences [m or rad]."""
    min_tension: float = 1e-6
    """Minimum tension, relative to the weight, to count as taut."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class Stance:
    """A stance of a puppet.

    Attributes:
        state: state at rest, with contact; None if no stance was found.
        share: share of the weight that the touches carry.
        note: missing contact or share, in words; may be empty.
    """

    state: State | None
    share: float
    note: str


def stance(goal: Goal, start: State, rollouts: Rollouts, touches: TouchRules) -> Stance:
    """A state of rest with contact near a goal.

    The puppet hangs with its feet in first contact, as near to the goal as possible. Its strings
    then lower it farther and farther, until it comes to rest on its feet with the required share of
    its weight.

    Args:
        goal: goal with a stance.
        start: start of the plan.
        rollouts, touches: parts of the problem.

    Returns:
        The first stance at the goal; otherwise the one with the largest share.
    """
    marionette, bounds = rollouts.marionette, rollouts.bounds
    q_D, q_K, _ = nearest_equilibrium(marionette, goal, start, bounds.movable)
    sink_direction = _sink_direction(marionette, q_D, q_K, bounds.movable)
    target_share = min(1.0, _TOLERANCES.weight_factor * (goal.share or 0.0))
    best, nearest = Stance(None, 0.0, ""), np.inf
    raised_q_K = q_K - _TOLERANCES.start_height * sink_direction
    try:
        raised_state = marionette.rest(start.replace(q_D=q_D, q_K=raised_q_K))
    except StateError as error:
        return Stance(None, 0.0, f"no rest was found above the stance: {error}")
    for sink_distance in _TOLERANCES.lowering_distances:
        lowered_q_K = q_K + sink_distance * sink_direction
        if not np.all((lowered_q_K >= bounds.low) & (lowered_q_K <= bounds.high)):
            continue
        run = _lowering_run(marionette, raised_state, lowered_q_K)
        state, share = run.state(-1), carried_share(marionette, run)
        state = state.replace(v_D=np.zeros_like(state.v_D), v_K=np.zeros_like(state.v_K))
        touches_closed = np.all(touches.gaps(state.q_D, state.q_K) < _TOLERANCES.max_standing_gap)
        if run.status is not Status.DONE or not touches_closed:
            continue
        distance = float(goal.distance(StateArrays.of(state))[0])
        nearest = min(nearest, distance)
        if share >= target_share and distance <= rollouts.stop_distance:
            return Stance(state, share, "")
        if share > best.share:
            best = Stance(state, share, "")
    feet = ", ".join(f"{a} on {b}" for a, b in touches.required)
    if best.state is None:
        return Stance(None, 0.0, f"no rest was found with {feet}")
    if best.share < (goal.share or 0.0):
        note = f"{feet}: the largest share of the weight that was found is {best.share:.2f}"
        return Stance(best.state, best.share, note)
    note = f"the nearest stance that was found is {nearest:.3g} from the goal"
    return Stance(best.state, best.share, note)


def _lowering_run(marionette: Marionette, x: State, q_K: ConfigK) -> Trajectory:
    """A run in which a puppet is lowered to driven coordinates (n_qK,) and comes to rest."""
    half_time, rest_time = 0.5 * _TOLERANCES.lowering_time, _TOLERANCES.settling_time
    table, acceleration = marionette.coordinates, np.zeros((3, marionette.coordinates.n_vK))
    for q, v in table.scalars_K:
        acceleration[:2, v] = np.array([1.0, -1.0]) * (q_K[q] - x.q_K[q]) / half_time**2
    times = np.array([0.0, half_time, 2.0 * half_time, 2.0 * half_time + rest_time])
    inputs = Input.segments(marionette, times, x.q_K, np.zeros(table.n_vK), acceleration)
    method = TimeStepping(dt=_TOLERANCES.dt)
    return simulate(marionette, x.replace(t=0.0), inputs, method=method, throw=False)


def _sink_direction(marionette: Marionette, q_D: ConfigD, q_K: ConfigK, movable: MaskRows) -> Array:
    """(n_qK,) the least change of the driven coordinates that lengthens every taut string by 1 m.

    It solves dh/dq_K change = -1; the puppet sinks by that distance.
    """
    table, step = marionette.coordinates, _TOLERANCES.difference
    indices = [(q, v) for q, v in table.scalars_K if movable[v]]
    _, tension, _ = best_support(marionette, q_D[None], q_K[None])
    taut = np.flatnonzero(tension[0] > _TOLERANCES.min_tension * marionette.weight)
    changed_q_K = np.tile(q_K, (len(indices) + 1, 1))
    for row, (q, _) in enumerate(indices):
        changed_q_K[row + 1, q] += step
    q_D_rows = np.tile(q_D, (len(changed_q_K), 1))
    h = marionette.library.evaluate("rows", q_D=q_D_rows, q_K=changed_q_K, p=marionette.p).h[
        :, taut
    ]
    slopes = (h[1:] - h[0]).T / step
    change = np.zeros(len(q_K))
    change[[q for q, _ in indices]] = np.linalg.pinv(slopes) @ -np.ones(len(taut))
    return change
