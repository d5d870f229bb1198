"""Equilibria by descent: V is gone down by steps that know its curvature.

Letting a puppet go and stopping it where its kinetic energy peaks, as :mod:`.statics` does, takes
the steps of its stiffest spring, and the time of its slowest sway or creep. Here, in the
coordinates y in which M_DD is one, each step solves

    min  -w0 . y + 1/2 y . (|H| + mu) y    subject to  h + W^T y <= 0

with H the Hessian of V and |H| the same with the absolute values of its eigenvalues, so that a step
goes down at a saddle as well; mu grows where V did not fall and shrinks where it did.
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError
from fantoccini.marionette.analysis import effort, energies
from fantoccini.marionette.closed import CLOSED
from fantoccini.marionette.instant import Instant, instant_at
from fantoccini.marionette.model import Model
from fantoccini.marionette.projection import onto_rows, positioned, retract
from fantoccini.marionette.statics import (
    Equilibrium,
    in_step,
    newton,
    poles,
    pushed,
    slopes,
)
from fantoccini.motion import State, tangent

_ROUNDS = 3000
_MU = (1e2, 1e-3, 1e14)
"""mu at first, below which it is dropped, and at most [1/s^2]."""
_SOFTEST = 1e-3
"""Least curvature that steps are taken by [1/s^2]: gravity alone has none."""
_AFAR = 100.0
"""Move from which on a puppet has no equilibrium [rad or m]."""
_GROWS, _SHRINKS = 3.0, 0.2
"""How mu changes after a step that did not go down, and after one that did."""
_LONGEST = 0.1
"""Longest move of one round [rad or m]."""
_WITHIN = 0.25
"""Longest move of a stepper motor in one round, over the distance of its poles."""
_NEAR = 0.05
"""Rows that a step may reach, by h over their scale."""
_STILL = 1e-12
"""Moves below which a puppet rests [rad or m]."""
_LEVEL = 1e-15
"""Fall of V below which it is flat, over the puppet's weight [m]."""
_STALLS = 3
"""Moves on flat V that may leave the forces as large as they were."""
_ROUNDED = 1e-14
"""Rounding of V, a sum over all links and springs, relative to it."""
_UNSTABLE = 1e-9
"""Growth rate squared that counts as unstable, relative to the fastest oscillation's."""
_STEP = 1e-6
"""Step of the finite differences that give the Hessian [rad or m]."""
_BALANCED = 1e-6
"""Largest part of the forces that may be left at rest, over the puppet's weight."""
_REFINED = 1e-3
"""Largest move by which Newton's method refines an equilibrium, not finds another [rad or m]."""


def descended(model: Model, x: State) -> Equilibrium:
    """A local minimum of V subject to the rows, from a state that they do not forbid.

    Raises:
        StateError: V keeps falling, or the search came to a stand where forces do not balance.
    """
    found = _settled(model, x)
    moved = in_step(model, found.x)
    if moved is not found.x:
        found = _settled(model, positioned(model, moved)[0])
    finer = newton(model, found.x)
    if finer is None or np.max(np.abs(finer.x.q_D - found.x.q_D)) > _REFINED:
        return found
    return finer


def _settled(model: Model, x: State) -> Equilibrium:
    """A local minimum of V subject to the rows, from a state that they do not forbid."""
    wires, scale = model.two_sided, model.row_scales(x.q_D, x.q_K)
    size_of_forces = model.weight / np.sqrt(model.mass)
    mu, V, start = _MU[0], energies(model, x)[1], x.q_D
    longest = np.full(len(x.v_D), _LONGEST)
    for row, pole in poles(model):
        longest[row.v] = np.minimum(longest[row.v], _WITHIN * pole)
    rows, tension, left, stalled = np.zeros(0, dtype=int), np.zeros(0), np.inf, 0
    for _ in range(_ROUNDS):
        at = instant_at(model, x)
        near = np.flatnonzero((at.h > -_NEAR * scale) | wires)
        curvature, modes = _curvature(at, _slope(model, Equilibrium(x, rows, tension)))
        while True:
            softened = modes / np.sqrt(np.maximum(np.abs(curvature) + mu, _SOFTEST))
            W = softened.T @ at.W[:, near]
            force = softened.T @ at.w0
            found = model.library.complementarity(W, at.h[near] + W.T @ force, wires[near])
            y = softened @ (force - W @ found.x)
            move = at.back(y)
            size = float(np.max(np.abs(move), initial=0.0))
            move = move / max(1.0, float(np.max(np.abs(move) / longest, initial=0.0)))
            other, worst = onto_rows(model, x.replace(q_D=retract(model, x.q_D, move)))
            V_other = energies(model, other)[1]
            fell = V - V_other + _motors_work(model, x, other)
            flat = abs(fell) <= _LEVEL * model.weight + _ROUNDED * abs(V)
            if (worst <= CLOSED and (fell > 0.0 or flat)) or mu > _MU[2]:
                break
            mu = max(_GROWS * mu, 1e-3)
        pulls = found.x != 0.0
        rows, tension = near[pulls], found.x[pulls]
        left, before = float(np.linalg.norm(at.w0 - at.W[:, rows] @ tension)), left
        # Where V is flat to rounding the forces still tell how far it is; a move along a valley may
        # leave those across it as large as they were, once.
        stalled = stalled + 1 if flat and left > 0.5 * before else 0
        if size < _STILL or stalled > _STALLS or mu > _MU[2]:
            push = _unstable(at, rows, curvature, modes)
            lower = None if push is None else pushed(model, x, push)
            if lower is None and left > _BALANCED * size_of_forces:
                raise StateError(
                    "going down, the search came to a stand with forces of "
                    f"{left / size_of_forces:.2g} of the puppet's weight left over; let it begin "
                    "nearer to where the puppet hangs, or simulate with damping until it rests"
                )
            if lower is None:
                return Equilibrium(other if size < _STILL else x, rows, tension)
            other = lower
            V_other = energies(model, other)[1]
        if np.max(np.abs(other.q_D - start), initial=0.0) > _AFAR:
            break
        x, V, mu = other, V_other, (mu * _SHRINKS if mu > _MU[1] and not flat else 0.0)
    raise StateError(
        "going down, the potential energy keeps falling. Is every free body held by a string, a "
        "limit or a joint to the world?"
    )


def _motors_work(model: Model, x: State, other: State) -> float:
    """What the drives' motors do between two states [J], by Simpson's rule: they are not in V."""
    rows = [row for row in model.tree.drives if row.command is not None]
    if not rows:
        return 0.0
    table, n = model.coordinates, len(x.v_D)
    places = table.scalars_D, table.quaternions_D
    move = tangent.between(*places, x.q_D, other.q_D, n)
    q_D = tangent.moved(*places, x.q_D, np.array([[0.0], [0.5], [1.0]]) * move)
    k, strings = len(x.v_K), len(model.tree.strings)
    still = np.zeros((3, n)), np.tile(x.q_K, (3, 1)), np.zeros((3, k))
    force = effort(model, q_D, *still, still[0], still[2], np.zeros((3, strings)))
    mean = (force[0] + 4.0 * force[1] + force[2]) / 6.0
    work = 0.0
    for row in rows:
        own = move[row.v]
        work += float(mean[row.command[1] :][: len(own)] @ own)
    return work


def _slope(model: Model, at: Equilibrium) -> Array:
    """Derivative (n_vD, n_vD) of w0 - W tau by a small move."""
    if len(at.rows):
        return slopes(model, at)[0]
    x, n = at.x, len(at.x.v_D)
    moved = retract(model, x.q_D, np.concatenate([np.eye(n), -np.eye(n)]) * _STEP)
    w0 = model.library.evaluate(
        "dynamics", q_D=moved, v_D=x.v_D, q_K=x.q_K, v_K=x.v_K, acc_K=np.zeros_like(x.v_K),
        u_D=np.zeros(n), p=model.p,
    ).w0  # fmt: skip
    return (w0[:n] - w0[n:]).T / (2 * _STEP)


def _curvature(at: Instant, slope: Array) -> tuple[Array, Array]:
    """Eigenvalues [1/s^2] and vectors of V's Hessian where M_DD is one."""
    H = -slope @ at.back(np.eye(len(slope))).T
    return np.linalg.eigh(0.5 * (H + H.T))


def _unstable(at: Instant, rows: Array, curvature: Array, modes: Array) -> Array | None:
    """A push (n_vD,) along which V falls while the rows hold; None at a minimum."""
    W = at.W[:, rows]
    free = np.eye(len(modes)) - W @ np.linalg.pinv(W) if len(rows) else np.eye(len(modes))
    values, vectors = np.linalg.eigh(free @ (modes * curvature) @ modes.T @ free)
    if values[0] > -_UNSTABLE * max(1.0, float(np.max(np.abs(values)))):
        return None
    push = at.back(free @ vectors[:, 0])
    return push / np.max(np.abs(push))
