"""Candidates brought to their goal by sequential quadratic programming.

A step x of velocities dV = basis x is the solution of::

    min |r + J x|^2 / 2 + smooth |D (V + dV)|^2 + w.s
    c + C x + s >= 0,  s >= 0,  |V + dV| <= speed,  |d(V + dV)| <= T acceleration,  |x| <= trust

with D the changes of the accelerations. As much of it is made as brings the way nearest to where
nothing is lacking; all parts of the step are tried side by side, in lanes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.arrays import Array
from fantoccini.planning.shooting import Candidates, Derivatives, Shooting

_PARTS = 0.65 ** np.arange(8)
"""Of a step, that are tried."""

_TRUST = 0.2
"""Largest change of a velocity at first [m/s or rad/s]."""

_MOST = 0.5
"""And later."""

_ITERATIONS = 15

_LATE = 1.2
"""Seconds that are varied late."""

_SMOOTH = 1e-5
"""Weight of changes of accelerations [s^2]."""

_SMALL = 1e-6
"""Weight of the step itself."""

_PENALTY = 1.0
"""Of broken constraints beside what the goal lacks; less would leave them broken."""

_LEAST = 1e-3
"""A goal that lacks less is no reason to break constraints."""

_FREE = 1e20
"""A bound that is none."""

_SLOW = 0.8
"""Part of the merit that may be left three iterations later, before a way is given up."""


@dataclass(frozen=True, eq=False)
class Approach:
    """What :func:`brought` made of a way.

    Attributes:
        way: the last one; None where the first could not be made.
        arrives: whether it is where it is to be.
        late: whether the time ended before that.
    """

    way: Candidates | None
    arrives: bool = False
    late: bool = False


def brought(
    shooting: Shooting, V: Array, there: Callable[[Candidates], bool], until: float, late: bool
) -> Approach:
    """The way near this one that is where it is to be, or that comes nearest.

    Args:
        shooting: makes ways.
        V: (m, n_vK) velocities to begin with.
        there: whether a way is.
        until: the time at which it is given up, as of ``time.perf_counter``.
        late: whether only the last segments are varied, when nothing is caught any more: earlier
            changes bend too much on their way, or are answered by leaps.
    """
    if time.perf_counter() > until:
        return Approach(None, late=True)
    way = shooting.ways(shooting.within(V)[None])
    if not np.isfinite(way.merit[0]):
        return Approach(None)
    trust, merits = _TRUST, []
    for _ in range(_ITERATIONS):
        if there(way):
            return Approach(way, arrives=True)
        merits.append(way.merit[0])
        if len(merits) > 3 and merits[-1] > _SLOW * merits[-4]:
            break
        if time.perf_counter() > until:
            return Approach(way, late=True)
        first = max(int(way.calm[0]), len(way) - round(_LATE / shooting.segment)) if late else 0
        slopes = shooting.slopes(way, min(first, len(way) - 1))
        x = step(shooting, way, slopes, trust)
        tried = np.stack([shooting.changed(way.V[0], slopes.basis, p * x) for p in _PARTS])
        better = shooting.ways(shooting.within(tried)).best
        if not better.merit[0] < way.merit[0]:
            break
        size = float(np.max(np.abs(better.V - way.V)))
        trust, way = min(_MOST, max(2.0 * size, 0.1 * trust)), better
    return Approach(way)


def step(shooting: Shooting, way: Candidates, slopes: Derivatives, trust: float) -> Array:
    """(n_x,) the step of the quadratic program."""
    bounds, V = shooting.problem.rollouts.bounds, way.V[0][:, shooting.moves]
    m, n_m = V.shape
    n_x, n_s = slopes.lacks.shape[1], way.spare.shape[2]
    every = np.eye(n_m)
    changes = np.kron(slopes.basis, every)
    before = np.broadcast_to(shooting.problem.root.v_K[0, shooting.moves], (1, n_m))
    D = np.diff(changes.reshape(m, n_m, n_x), axis=0, prepend=0.0)
    dV = np.diff(V, axis=0, prepend=before)
    jerk, jerk_V = np.diff(D, axis=0).reshape((m - 1) * n_m, n_x), np.diff(dV, axis=0).ravel()
    lacks = way.lacks[0]
    H, g = np.zeros((n_x + n_s, n_x + n_s)), np.zeros(n_x + n_s)
    H[:n_x, :n_x] = slopes.lacks.T @ slopes.lacks + _SMOOTH * jerk.T @ jerk
    H[np.arange(n_x + n_s), np.arange(n_x + n_s)] += _SMALL
    g[:n_x] = slopes.lacks.T @ lacks + _SMOOTH * jerk.T @ jerk_V
    g[n_x:] = _PENALTY * max(float(np.linalg.norm(lacks)), _LEAST)
    # Only what the step can reach is bounded.
    speed, most = bounds.speed[shooting.moves], shooting.segment * bounds.acceleration
    most = most[shooting.moves]
    fast = np.ravel(np.abs(V) + trust > speed)
    sharp = np.ravel(np.abs(dV) + 2.0 * trust > most)
    near, k = slopes.near, len(slopes.near)
    give = np.zeros((k, n_s))
    give[np.arange(k), near[:, 1]] = 1.0
    rows = [changes[fast], D.reshape(m * n_m, n_x)[sharp]]
    A = np.zeros((sum(map(len, rows)) + k, n_x + n_s))
    A[: len(A) - k, :n_x] = np.concatenate(rows)
    A[len(A) - k :, :n_x], A[len(A) - k :, n_x:] = slopes.spare, give
    room = [(np.tile(speed, m) - s * V.ravel())[fast] for s in (1.0, -1.0)]
    turn = [(np.tile(most, m) - s * dV.ravel())[sharp] for s in (1.0, -1.0)]
    high = np.concatenate([room[0], turn[0], np.full(k, _FREE)])
    low = np.concatenate([-room[1], -turn[1], -way.spare[0, near[:, 0], near[:, 1]]])
    reach = np.concatenate([np.full(n_x, trust), np.full(n_s, _FREE)])
    program = ca.conic(
        "step", "daqp", {"h": ca.Sparsity.dense(*H.shape), "a": ca.Sparsity.dense(*A.shape)},
        {"error_on_fail": False, "print_time": False, "daqp": {"primal_tol": 1e-9}},
    )  # fmt: skip
    lowest = np.concatenate([-np.full(n_x, trust), np.zeros(n_s)])
    found = program(h=H, g=g, a=A, lba=low, uba=high, lbx=lowest, ubx=reach)
    x = np.asarray(found["x"]).ravel()[:n_x]
    return np.where(np.isfinite(x), x, 0.0)
