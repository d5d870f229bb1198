"""Repair: states brought onto what strings and limits allow, by the smallest move.

Three searches, each on the rows' linearisation h + A dq at the configuration reached so far, with
every row one-sided anew in every round: a row that had to be brought back is free to open later.

1. Onto the rows: min |dq|_M with h + A dq <= 0. Where no dq satisfies the rows together, the sum of
   squares of what is left of them is smallest.
2. Where that comes to a stand, from seeded pushes of growing size off the given configuration: a
   straight limb that is pulled along itself has no slope by which to give way.
3. Along the rows towards the given configuration q_0: min |q + dq - q_0|_M with h + A dq <= 0,
   ended by Newton's method on M (q - q_0) + A^T y = 0 and h = 0 of the rows with y > 0.
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError
from fantoccini.marionette.closed import CLOSED, closed_rows, known_mode
from fantoccini.marionette.dynamics import with_mode
from fantoccini.marionette.instant import Instant, instant_at
from fantoccini.marionette.model import Model
from fantoccini.marionette.tighten import tightened
from fantoccini.motion import State, tangent

_ROUNDS = 100
_LONGEST = 0.3
"""Longest move of one round [rad or m]."""
_NEAR = 0.5
"""Rows that a move may reach, by h over their scale."""
_MET = 1e-14
"""|h| of a row that is met to rounding, over its scale."""
_STILL = 1e-15
"""Moves below which a search has come to its end [rad or m]."""
_FIRM = 1e8
"""How dear what is left of rows is beside moves, where rows contradict one another [1/m^2]."""
_HALVINGS = 6
_FALLS = 0.999
"""What a move leaves of the rows' excess at most; they are met in few rounds, or not at all."""
_ARRIVED = 1e-12
"""Moves below which a state is the nearest [rad or m]."""
_ALMOST = 1e-4
"""Moves below which rows that push are let go [rad or m]."""
_FARTHER = 0.01
"""Relative growth of a distance that its metric, M_DD at the end of the way, may make."""
_APPROACHES = 15
"""Rounds towards the nearest state before Newton's method takes over."""
_NEWTON_ROUNDS = 20
_STEP = 1e-6
"""Step of the finite differences that give Newton's matrix [rad or m]."""
_PUSHES = (0.03, 0.1, 0.1, 0.3, 0.3, 1.0, 1.0)
"""Largest parts of pushes off a configuration that gives no way [rad or m]."""
_SEED = 17


def retract(model: Model, q_D: Array, move: Array) -> Array:
    """q_D moved by tangent vectors: scalars add, quaternions turn.

    Args:
        model: whose coordinates they are.
        q_D: (n_qD,).
        move: (..., n_vD).

    Returns:
        (..., n_qD).
    """
    table = model.coordinates
    return tangent.moved(table.scalars_D, table.quaternions_D, q_D, move)


def project(model: Model, x: State) -> State:
    """The nearest state, in the metric of M_DD, that no string or limit forbids.

    Positions first (q_K stays): M (q - q_0) + A_D^T y = 0 with h <= 0, y >= 0 and y . h = 0, or,
    where the search for that does not settle, a state near by with h <= 0. Then velocities:
    hdot <= 0 on the rows that are closed. Rows that are taut in the state's mode are brought to
    h = 0 and hdot = 0, as far as they do not contradict one another.

    Raises:
        StateError: no such state was found; what is left of each row is told.
    """
    taut = closed_rows(model, x, instant_at(model, x)).held & known_mode(model, x)
    found, left = positioned(model, x)
    if left:
        raise StateError(
            f"no state of the puppet was found that fits these string ends and lengths: {left}. "
            f"Tried: moves onto the strings and limits, from there and from {len(_PUSHES)} places "
            "nearby"
        )
    found = tightened(model, found, taut)
    instant = instant_at(model, found)
    scale = model.row_scales(found.q_D, found.q_K)
    # Strings on winches that slip give way instead.
    firm = (np.abs(instant.h) <= CLOSED * scale) & ~np.isfinite(model.upper)
    wires = model.two_sided
    rows = np.flatnonzero(firm | wires)
    answer = instant.complementarity(rows, instant.hdot[rows], wires | found.taut)
    if not answer.solved:
        answer = instant.complementarity(rows, instant.hdot[rows], wires)
    if not answer.solved:
        names = ", ".join(model.rows_of(rows, answer.ray))
        raise StateError(f"no velocity of the puppet fits these driven velocities: {names}")
    v_D = found.v_D - instant.back(instant.W[:, rows] @ answer.x)
    return with_mode(model, found.replace(v_D=v_D, taut=found.taut))


def positioned(model: Model, x: State) -> tuple[State, str]:
    """The state with its configuration brought onto the rows, and what is left of them in words.

    Returns:
        The state, its velocities as they were; and "" where every row is met, to CLOSED.
    """
    found, worst = onto_rows(model, x)
    best, least = found, worst
    rng = np.random.default_rng(_SEED)
    for size in _PUSHES:
        if worst <= CLOSED:
            break
        push = rng.uniform(-size, size, len(x.v_D))
        found, worst = onto_rows(model, x.replace(q_D=retract(model, x.q_D, push)))
        if worst < least:
            best, least = found, worst
    if worst > CLOSED:
        return best, overstepped(model, best)
    if found is not x:
        found = _nearest(model, found, x)
    return found, ""


def overstepped(model: Model, x: State) -> str:
    """The rows that a state breaks and by how much, in words; "" where there are none."""
    h, scale = instant_at(model, x).h, model.row_scales(x.q_D, x.q_K)
    strings, said = len(model.tree.strings), []
    for i in np.flatnonzero(_excess(model, h) > CLOSED * scale):
        if i >= strings:
            text = f"is passed by {h[i]:.3g}"
        elif h[i] > 0.0:
            text = f"is too short by {1e3 * h[i]:.3g} mm"
        else:
            text = f"is too long by {-1e3 * h[i]:.3g} mm, and a wire"
        said.append(f"{model.tree.row_names[i]} {text}")
    return ", ".join(said)


def _excess(model: Model, h: Array) -> Array:
    """How far rows are overstepped (n_rows,), 0 where they hold."""
    return np.where(model.two_sided, np.abs(h), np.maximum(h, 0.0))


def onto_rows(model: Model, x: State) -> tuple[State, float]:
    """The nearest configuration that the rows' slopes lead to, and the largest excess over scale.

    Damped by halving: the excess falls from round to round. The state itself where it breaks none.
    """
    scale, wires = model.row_scales(x.q_D, x.q_K), model.two_sided
    instant = instant_at(model, x)
    excess = _excess(model, instant.h) / scale
    for _ in range(_ROUNDS):
        if np.max(excess, initial=0.0) <= _MET:
            break
        rows = np.flatnonzero((instant.h > -_NEAR * scale) | wires)
        move = instant.back(_shortest(model, instant, rows))
        size = float(np.max(np.abs(move), initial=0.0))
        if not _STILL < size < np.inf:
            break
        part = min(1.0, _LONGEST / size)
        for _ in range(_HALVINGS):
            other = x.replace(q_D=retract(model, x.q_D, part * move))
            there = instant_at(model, other)
            over = _excess(model, there.h) / scale
            if np.linalg.norm(over) < _FALLS * np.linalg.norm(excess):
                break
            part *= 0.5
        else:
            break
        x, instant, excess = other, there, over
    return x, float(np.max(excess, initial=0.0))


def _shortest(model: Model, instant: Instant, rows: Array) -> Array:
    """The shortest y with h + W^T y <= 0, or the one that leaves least of the rows."""
    W, h, wires = instant.W[:, rows], instant.h[rows], model.two_sided[rows]
    found = instant.complementarity(rows, h, model.two_sided)
    if found.solved:
        return -W @ found.x
    # min |y|^2 + k |s|^2 with h + W^T y <= s: the same with 1/k on the diagonal of W^T W.
    from scipy.optimize import lsq_linear  # slow to import, and only contradictions need it

    tall = np.vstack([W, np.eye(len(rows)) * np.sqrt(np.trace(W.T @ W) / (_FIRM * len(rows)))])
    # x of min |tall x|^2 / 2 - h . x, completed to a square.
    target = np.linalg.lstsq(tall.T, h, rcond=None)[0]
    lower = np.where(wires, -np.inf, 0.0)
    return -W @ lsq_linear(tall, target, (lower, np.inf), method="bvls").x


def _nearest(model: Model, x: State, origin: State) -> State:
    """The state moved along the rows until it is nearest to another one.

    With mu > 0 moves are held back, min |q + dq - q_0|_M^2 + mu |dq|_M^2: bent rows make those of
    mu = 0 overshoot where the way is long. Newton's method then ends what goes on slowly.
    """
    wires, scale, mu = model.two_sided, model.row_scales(x.q_D, x.q_K), 0.0
    held = np.zeros(0, dtype=int), np.zeros(0)
    for _ in range(_APPROACHES):
        instant = instant_at(model, x)
        away = _away(model, instant, x, origin)
        rows = np.flatnonzero((instant.h > -_NEAR * scale) | wires)
        W, wanted = instant.W[:, rows], away / (1.0 + mu)
        found = instant.complementarity(rows, instant.h[rows] + W.T @ wanted, wires)
        move = instant.back(wanted - W @ found.x)
        size = float(np.max(np.abs(move), initial=0.0))
        if not found.solved or not _ARRIVED < size < np.inf:
            return x
        move *= min(1.0, _LONGEST / size)
        other, worst = onto_rows(model, x.replace(q_D=retract(model, x.q_D, move)))
        there = _away(model, instant_at(model, other), other, origin)
        if worst > CLOSED or np.linalg.norm(there) > (1.0 + _FARTHER) * np.linalg.norm(away):
            mu = max(4.0 * mu, 1.0)
            continue
        pulls = (found.x != 0.0) | wires[rows]
        held = rows[pulls], (1.0 + mu) * found.x[pulls]
        x, mu = other, (0.5 * mu if mu > 0.1 else 0.0)
    return _stationary(model, x, origin, *held) or x


def _stationary(
    model: Model, x: State, origin: State, rows: Array, pull: Array
) -> State | None:
    """The state near another with F away = W pull and h = 0 on some rows, by Newton's method.

    Rows that push are let go. None where it does not settle on a state that keeps all rows and is
    as near.
    """
    n, instant = model.coordinates.n_vD, instant_at(model, x)
    farthest = (1.0 + _FARTHER) * np.linalg.norm(_away(model, instant, x, origin))

    def left(x: State) -> Array:
        """(n + len(rows),) what the two equations lack."""
        at = instant_at(model, x)
        return np.append(_away(model, at, x, origin) - at.W[:, rows] @ pull, at.h[rows])

    for _ in range(_NEWTON_ROUNDS):
        moves = np.concatenate([np.eye(n), -np.eye(n)]) * _STEP
        around = [left(x.replace(q_D=q)) for q in retract(model, x.q_D, moves)]
        slope = (np.array(around[:n]) - np.array(around[n:])).T / (2 * _STEP)
        W = np.vstack([-instant_at(model, x).W[:, rows], np.zeros((len(rows), len(rows)))])
        step = np.linalg.lstsq(np.hstack([slope, W]), -left(x), rcond=1e-12)[0]
        size = float(np.max(np.abs(step[:n]), initial=0.0))
        if not size < _LONGEST:
            return None
        x = x.replace(q_D=retract(model, x.q_D, step[:n]))
        pull = pull + step[n:]
        pulls = (pull >= 0.0) | model.two_sided[rows]
        if size < _ARRIVED and np.all(pulls):
            break
        if size < _ALMOST:
            rows, pull = rows[pulls], pull[pulls]
    else:
        return None
    x, worst = onto_rows(model, x)
    distance = np.linalg.norm(_away(model, instant_at(model, x), x, origin))
    return None if worst > CLOSED or distance > farthest else x


def _away(model: Model, instant: Instant, x: State, origin: State) -> Array:
    """The move from a configuration to another one, in the coordinates in which M_DD is one."""
    table = model.coordinates
    places = table.scalars_D, table.quaternions_D
    F_inverse = instant.back(np.eye(table.n_vD)).T
    return np.linalg.solve(F_inverse, tangent.between(*places, x.q_D, origin.q_D, table.n_vD))
