"""Random performances: a start state and inputs for any puppet, from a seed.

A fifth of them are impossible: ends pulled far apart, lengths far too short.
"""

from __future__ import annotations

import functools
import zlib
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.equilibrium.projection import retract
from properties import puppets

N_START_STATES = 24
"""Number of start states for each puppet."""

INPUT_KINDS = {"nothing": 0.1, "moderate": 0.4, "wild": 0.3, "impossible": 0.2}
"""Kinds of inputs, and their probabilities."""

_MOVE_SIZES = {"nothing": 0.0, "moderate": 0.15, "wild": 0.5, "impossible": 2.0}
"""Size of the inputs' moves within one performance [m or rad]."""

_MIN_LENGTH_FACTORS = {"nothing": 1.0, "moderate": 0.6, "wild": 0.3, "impossible": 0.05}
"""Smallest part of its first length to which a string is shortened."""


@dataclass(frozen=True, eq=False)
class Performance:
    """Arguments of one run.

    Attributes:
        marionette: the puppet.
        x0: start state.
        inputs: motion of its driven coordinates, and forces in some.
        t_end: end of the run [s].
        start: hanging, moved or thrown.
        input_kind: nothing, moderate, wild or impossible.
    """

    marionette: fan.Marionette
    x0: fan.State
    inputs: fan.Input
    t_end: float
    start: str
    input_kind: str


def draw_performance(name: str, seed: int) -> Performance:
    """The performance of a puppet and seed.

    Args:
        name: name of the puppet, in `puppets.ALL`.
        seed: the same seed gives the same performance.
    """
    puppet = puppets.load(name)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    start_kind = str(rng.choice(["hanging", "moved", "thrown"], p=[0.2, 0.3, 0.5]))
    input_kind = str(rng.choice(list(INPUT_KINDS), p=list(INPUT_KINDS.values())))
    t_end = float(rng.uniform(0.1, 0.25))
    x0 = start_states(name)[0 if start_kind == "hanging" else int(rng.integers(1, N_START_STATES))]
    breaks, coef = _draw_moves(rng, puppet, x0, t_end, input_kind)
    if start_kind == "thrown":
        x0 = x0.replace(v_D=rng.uniform(0.3, 3.0) * rng.normal(size=len(x0.v_D)))
    x0 = with_velocity(puppet, x0, coef[0, :, 1])
    # Velocities that the strings forbid at once are removed: the inputs begin at rest.
    coef[:, :, :2] -= _ramp_coefficients(coef[0, :, 1] - x0.v_K, breaks)
    return Performance(
        puppet, x0, _input(rng, puppet, x0, breaks, coef), t_end, start_kind, input_kind
    )


@functools.cache
def start_states(name: str) -> tuple[fan.State, ...]:
    """Start states of a puppet, at rest: the first hangs, the others are moved from it.

    Strings with driven lengths get some slack in most of the moved ones, so that they catch soon
    after.
    """
    puppet = puppets.load(name)
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    try:
        states = [puppet.rest()]
    except fan.errors.StateError:
        # Not every puppet hangs stably below its strings: such a puppet starts from its pose.
        states = [puppet.project(puppet.state())]
    while len(states) < N_START_STATES:
        try:
            states.append(_draw_moved_state(rng, puppet, states[0]))
        except fan.errors.StateError:
            # No state fits these ends: move it elsewhere.
            continue
    return tuple(states)


def _draw_moved_state(rng: np.random.Generator, puppet: fan.Marionette, x: fan.State) -> fan.State:
    """A state at rest near another one, on strings that fit."""
    move = rng.uniform(0.02, 0.5) * rng.normal(size=len(x.v_D))
    q_K = np.array(x.q_K)
    for q, _ in puppet.coordinates.scalars_K:
        if not puppet.coordinates.q_K[q].endswith(".length"):
            q_K[q] += 0.05 * rng.normal()
    moved = x.replace(q_D=retract(puppet, x.q_D, move), q_K=q_K)
    h = puppet.constraint(moved)
    slack = rng.choice([0.0, 0.003, 0.03, 0.1])
    for row, string in enumerate(puppet.tree.strings):
        if string.length_index is not None:
            q_K[string.length_index[0]] += h[row] + slack * rng.uniform()
    return puppet.project(moved.replace(q_K=np.maximum(q_K, _min_driven_values(puppet))))


def _min_driven_values(puppet: fan.Marionette) -> np.ndarray:
    """(n_qK,) least values of the driven coordinates: a length is positive."""
    names = puppet.coordinates.q_K
    return np.array([0.05 if n.endswith(".length") else -np.inf for n in names])


def with_velocity(puppet: fan.Marionette, x: fan.State, v_K: np.ndarray) -> fan.State:
    """The state with the nearest velocity that opens no closed row, and with inputs at v_K.

    If the inputs themselves would open one, such as two ends that separate at once, they are at
    rest.
    """
    if not (np.any(x.v_D) or np.any(v_K)):
        return x
    for v_K_candidate in (v_K, np.zeros_like(v_K)):
        candidate = x.replace(v_K=v_K_candidate)
        evaluation = Evaluation.at_state(puppet, candidate)
        scale = puppet.row_scales(candidate.q_D, candidate.q_K)
        rows = np.flatnonzero((evaluation.h >= -1e-9 * scale) | puppet.two_sided)
        solution = evaluation.complementarity(rows, evaluation.hdot[rows], puppet.two_sided)
        if solution.solved:
            return candidate.replace(
                v_D=candidate.v_D - evaluation.solve_factor(evaluation.W[:, rows] @ solution.x)
            )
    return x.replace(v_D=np.zeros_like(x.v_D), v_K=np.zeros_like(v_K))


def _draw_moves(
    rng: np.random.Generator, puppet: fan.Marionette, x0: fan.State, t_end: float, input_kind: str
) -> tuple[np.ndarray, np.ndarray]:
    """Motion of the driven coordinates, relative to their start.

    The pieces have constant accelerations, or are minimum-jerk moves between waypoints.

    Returns:
        breaks (n + 1,) [s], coef (n, n_vK, 6) [m or rad, s]; they begin at 0 and are C^1.
    """
    table = puppet.coordinates
    n, n_vK = int(rng.integers(1, 4)), table.n_vK
    pieces = rng.uniform(0.3, 1.0, n)
    breaks = np.r_[0.0, np.cumsum(pieces)] * (t_end / np.sum(pieces))
    breaks[-1] = t_end
    s = np.diff(breaks)[:, None]
    coef = np.zeros((n, n_vK, 6))
    if rng.random() < 0.5:
        acc = rng.normal(size=(n, n_vK)) / t_end**2
        v_0 = rng.normal(size=n_vK) / t_end if rng.random() < 0.4 else np.zeros(n_vK)
        v = np.concatenate([[v_0], v_0 + np.cumsum(acc * s, axis=0)])[:-1]
        coef[:, :, 1], coef[:, :, 2] = v, 0.5 * acc
        move = v * s + 0.5 * acc * s**2
    else:
        move = rng.normal(size=(n, n_vK))
        coef[:, :, 3:] = move[..., None] * np.array([10.0, -15.0, 6.0]) / s[..., None] ** [3, 4, 5]
    coef[1:, :, 0] = np.cumsum(move, axis=0)[:-1]
    # Not all coordinates move in every performance.
    coef *= (_MOVE_SIZES[input_kind] * rng.uniform(0.2, 1.0) * (rng.random(n_vK) < 0.7))[:, None]
    # Lengths stay positive: a move that shortens a string too far is scaled down as a whole.
    x = np.linspace(0.0, 1.0, 17) * s
    places = (coef[:, :, None] * x[:, None, :, None] ** np.arange(6)).sum(axis=-1)
    lowest = np.min(places, axis=(0, 2), initial=0.0)
    for q, v in table.scalars_K:
        max_shortening = (1.0 - _MIN_LENGTH_FACTORS[input_kind]) * x0.q_K[q]
        if table.q_K[q].endswith(".length") and -lowest[v] > max_shortening:
            coef[:, v] *= max_shortening / -lowest[v]
    return breaks, coef


def _ramp_coefficients(v_K: np.ndarray, breaks: np.ndarray) -> np.ndarray:
    """(n, n_vK, 2) the first two powers of v_K t on every piece."""
    return np.stack([np.outer(breaks[:-1], v_K), np.tile(v_K, (len(breaks) - 1, 1))], axis=-1)


def _input(
    rng: np.random.Generator,
    puppet: fan.Marionette,
    x0: fan.State,
    breaks: np.ndarray,
    coef: np.ndarray,
) -> fan.Input:
    """The input that starts from the start state's values, in some cases with forces."""
    table = puppet.coordinates
    base = np.tile(x0.q_K, (len(coef), 1))
    for q, v in table.scalars_K:
        coef[:, v, 0] += x0.q_K[q]
        base[:, q] = coef[:, v, 0]
    force = None
    if rng.random() < 0.1:
        force = np.zeros((len(coef), table.n_vD, 6))
        force[:, :, 0] = 0.3 * puppet.weight * rng.normal(size=(len(coef), table.n_vD))
    return fan.Input(table, breaks, coef, base, np.ones(table.n_vK, dtype=bool), force)
