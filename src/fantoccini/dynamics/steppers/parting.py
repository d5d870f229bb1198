"""Small overlaps of solids at the start of a run, removed by the smallest move.

    min |dq|_M   with   gap + d(gap)/dq dq >= 0,   h + A_D dq <= 0

solved repeatedly, over all nearby contact points, strings and limits.

gap is the distance of two solids, h the gap of a string (path length minus string length), A_D its
derivatives by the dynamic coordinates q_D, and M the inertia matrix. In names, K stands for driven
coordinates: ends and lengths of strings, driven joints. A row is a string or a joint limit with its
gap h <= 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fantoccini.base import Array, nonnegative_least_squares
from fantoccini.dynamics.compiled import (
    ROW_TOLERANCES,
    CompiledPuppet,
    Evaluation,
    PairGeometry,
    Screws,
    retract,
)
from fantoccini.motion import State, States

MAX_OVERLAP = 1e-12
"""Largest overlap of solids that count as separate [m]."""
MAX_INFEASIBLE_RESIDUAL = 1e-10
"""Residual of the least squares below which the program has no solution."""
MAX_ROUNDS = 20
"""Maximum number of rounds; overlaps of flat faces take one."""


def separated(marionette: CompiledPuppet, x: State) -> State:
    """The state without small overlaps, such as those after a fixed step.

    Velocities are unchanged. If overlaps are deeper, or driven bodies prevent the move, the state
    is returned unchanged.
    """
    if marionette.contacts is None or not marionette.coordinates.n_vD:
        return x
    depth_of_deepest = _max_depth(marionette, x)
    if not ROW_TOLERANCES.touching < depth_of_deepest <= ROW_TOLERANCES.stepped_gap:
        return x
    moved_state = x
    for _ in range(MAX_ROUNDS):
        evaluation, rows = (
            Evaluation.at_state(marionette, moved_state),
            list(_rows(marionette, moved_state)),
        )
        W = evaluation.solve_factor_transposed(np.stack([row for row, _ in rows])).T
        depth, wires = np.array([depth for _, depth in rows]), marionette.two_sided
        move = _least_move(
            np.concatenate([W, evaluation.W, -evaluation.W[:, wires]], axis=1),
            np.concatenate([depth, evaluation.h, -evaluation.h[wires]]),
        )
        if move is None:
            return x
        moved_state = moved_state.replace(
            q_D=retract(marionette, moved_state.q_D, evaluation.solve_factor(move))
        )
        if _max_depth(marionette, moved_state) <= MAX_OVERLAP:
            return moved_state
    return x


def separated_starts(marionette: CompiledPuppet, states: States, p: Array) -> States:
    """States from :func:`separated`, for one state or many, at parameters (1 or n, n_p)."""
    if marionette.contacts is None or not marionette.coordinates.n_vD:
        return states
    gaps = np.concatenate(
        [
            marionette.library.gaps(
                marionette.contacts, states.q_D[states_of_p], states.q_K[states_of_p], p[k]
            )
            for k, states_of_p in enumerate(_lanes(len(states), len(p)))
        ]
    )
    touching = np.flatnonzero(np.min(gaps, axis=1) < -ROW_TOLERANCES.touching)
    if not len(touching):
        return states
    if len(states) == 1 and len(p) > 1:
        states = states.repeated(len(p))
    q_D = states.q_D.copy()
    for i in touching:
        x = State(
            float(states.t),
            states.q_D[i],
            states.v_D[i],
            states.q_K[i],
            states.v_K[i],
            states.taut[i],
            states.slip[i],
            marionette.coordinates,
        )
        q_D[i] = separated(marionette.with_p(p[i if len(p) > 1 else 0]), x).q_D
    return replace(states, q_D=q_D)


def _lanes(n_states: int, n_p: int) -> Iterator[slice]:
    """Slices of the states that share the same parameters."""
    for k in range(n_p):
        yield slice(None) if n_p == 1 else slice(0, 1) if n_states == 1 else slice(k, k + 1)


def _least_move(W: Array, b: Array) -> Array | None:
    """Vector z (n,) of least norm with W^T z + b <= 0; None without one.

    Least distance programming as non-negative least squares (Lawson and Hanson, *Solving Least
    Squares Problems*, 1974, chapter 23).
    """
    size = float(np.max(np.abs(b)))
    target = np.zeros(len(W) + 1)
    target[-1] = 1.0
    E = np.concatenate([-W, b[None] / size])
    remaining = E @ nonnegative_least_squares(E, target)[0] - target
    if not abs(remaining[-1]) > MAX_INFEASIBLE_RESIDUAL:
        return None
    return np.asarray(-remaining[:-1] / remaining[-1] * size)


def _max_depth(marionette: CompiledPuppet, x: State) -> float:
    """Depth of the deepest overlap [m]; -inf without pairs."""
    assert marionette.contacts is not None
    gaps = marionette.library.gaps(marionette.contacts, x.q_D, x.q_K, marionette.p)
    return -float(np.min(gaps, initial=np.inf))


def _rows(marionette: CompiledPuppet, x: State) -> Iterator[tuple[Array, float]]:
    """Derivative (n_vD,) of the closing speed by v_D and depth [m] of every nearby point."""
    assert marionette.contacts is not None
    screws = Screws(marionette, x)
    gaps = marionette.library.gaps(marionette.contacts, x.q_D, x.q_K, marionette.p)
    for k in np.flatnonzero(np.isfinite(gaps)):
        pair = PairGeometry(marionette, screws.poses, int(k))
        twist = screws.subspace(pair.links[0]) - screws.subspace(pair.links[1])
        for values in pair.points.values():
            gap, point, normal = float(values[0]), values[1:4], values[4:7]
            velocity_jacobian = twist[:3].T + np.cross(twist[3:].T, point)
            yield -velocity_jacobian @ normal, -gap
