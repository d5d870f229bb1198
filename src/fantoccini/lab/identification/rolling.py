"""Many short rollouts at once, and how their ends and samples change with what is not known.

A record is cut into segments. Each is simulated by time-stepping from a state of its own, all of
them in lanes:

    x_k+1 = f(x_k, q_K(t_k), p),      Z_k+1 = f_x Z_k + [0, f_p, f_qK]

Z has the derivatives of (dq_D, v_D) by the segment's first state, by the parameters that are
looked for, and by constant offsets of driven coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fantoccini.base import ARRIVED, Array, Indices, tangent
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.derivatives import (
    StepInputs,
    StepLinearisations,
    StepOptions,
    linearise_steps,
)
from fantoccini.kernel.runtime import LaneRecord, LaneSteppers
from fantoccini.motion import Input

_STEPS_AT_ONCE = 1500
"""Steps that are linearised together, which bounds the memory."""
_LEAST_PART = 24
"""Segments of one thread, at least: three full lanes."""


@dataclass(frozen=True, eq=False)
class Driven:
    """The driven coordinates over the steps of S segments.

    Attributes:
        q_K, v_K: (n + 1, S, ...) at the nodes.
        acc_K: (n, S, n_vK) that lead from one q_K to the next.
        u_D: (n, S, n_vD) user forces in the middle of the steps; None for none.
        dt: length of the steps [s].
    """

    q_K: Array
    v_K: Array
    acc_K: Array
    u_D: Array | None
    dt: float

    @classmethod
    def of(cls, marionette: Marionette, inputs: Input, starts: Array, n: int, dt: float) -> Driven:
        """n steps from each of S times [s].

        Args:
            marionette: the puppet.
            inputs: that name all driven coordinates.
            starts: (S,).
            n: steps.
            dt: their length [s].
        """
        t, table = starts + dt * np.arange(n + 1)[:, None], marionette.coordinates
        q_K, v_K, _ = inputs.evaluate(t)
        move = tangent.between(table.scalars_K, table.quaternions_K, q_K[:-1], q_K[1:], table.n_vK)
        force = None if inputs.force is None else inputs.evaluate_force(t[:-1] + 0.5 * dt)
        return cls(q_K, v_K, 2.0 * (move / dt - v_K[:-1]) / dt, force, dt)

    def moved(self, marionette: Marionette, offsets: Array) -> Driven:
        """Those with (n_vK,) added to scalar coordinates."""
        if not np.any(offsets):
            return self
        q_K = self.q_K.copy()
        for q, v in marionette.coordinates.scalars_K:
            q_K[..., q] += offsets[v]
        return replace(self, q_K=q_K)

    @property
    def first(self) -> Driven:
        """Those of the first step."""
        force = None if self.u_D is None else self.u_D[:1]
        return Driven(self.q_K[:2], self.v_K[:2], self.acc_K[:1], force, self.dt)

    def some(self, s: slice | Indices) -> Driven:
        """Those of some segments."""
        force = None if self.u_D is None else self.u_D[:, s]
        return Driven(self.q_K[:, s], self.v_K[:, s], self.acc_K[:, s], force, self.dt)


@dataclass(frozen=True, eq=False)
class Rolled:
    """S rollouts of n steps.

    Attributes:
        q_D, v_D: (n + 1, S, ...) states.
        tension: (n, S, n_rows) of the steps [N or N m].
        arrived: whether all reached their ends.
    """

    q_D: Array
    v_D: Array
    tension: Array
    arrived: bool


def roll(
    marionette: Marionette, driven: Driven, q_D: Array, v_D: Array, p: Array, threads: int = 1
) -> Rolled:
    """Rollouts from S states (S, ...) at parameters p (n_p,).

    Every step depends on its state alone, as those of :func:`fantoccini.linearise_steps` do.
    """
    parts = _parts(len(q_D), threads)
    with ThreadPoolExecutor(len(parts)) as pool:
        found = list(
            pool.map(lambda own: _roll(marionette, driven.some(own), q_D[own], v_D[own], p), parts)
        )
    if len(found) == 1:
        return found[0]
    q, v, tension = (
        np.concatenate([getattr(one, name) for one in found], axis=1)
        for name in ("q_D", "v_D", "tension")
    )
    return Rolled(q, v, tension, all(one.arrived for one in found))


def _parts(S: int, threads: int) -> list[slice]:
    """S segments in parts, one for each thread that is worth it."""
    n = max(1, min(threads, S // _LEAST_PART))
    ends = [S * i // n for i in range(n + 1)]
    return [slice(a, b) for a, b in pairwise(ends)]


def _roll(marionette: Marionette, driven: Driven, q_D: Array, v_D: Array, p: Array) -> Rolled:
    n, S = driven.acc_K.shape[:2]
    record = LaneRecord(S, marionette.libraries.lanes.sizes)
    record.begin(q_D=q_D, v_D=v_D, p=p)
    options = marionette.run_options(dt=driven.dt, extrapolate=False)
    acc = np.zeros((S, marionette.coordinates.n_vK))
    force = None if driven.u_D is None else np.zeros((S, marionette.coordinates.n_vD))
    steppers = LaneSteppers(marionette.libraries.lanes, record, 1, options, marionette.winches)
    advance = steppers.bound(driven.dt, acc, force)
    out = Rolled(
        np.empty((n + 1, *q_D.shape)),
        np.empty((n + 1, *v_D.shape)),
        np.empty((n, *record.tension.shape)),
        True,
    )
    out.q_D[0], out.v_D[0] = q_D, v_D
    status = np.empty((n, S), dtype=np.int32)
    for k in range(n):
        record.begin(q_K=driven.q_K[k], v_K=driven.v_K[k])
        acc[:] = driven.acc_K[k]
        if force is not None and driven.u_D is not None:
            force[:] = driven.u_D[k]
        advance()
        out.q_D[k + 1], out.v_D[k + 1], out.tension[k] = record.q_D, record.v_D, record.tension
        status[k] = record.status
    whole = bool(np.all(np.isin(status, ARRIVED)) and np.all(np.isfinite(out.q_D[-1])))
    return Rolled(out.q_D, out.v_D, out.tension, whole)


@dataclass(frozen=True, eq=False)
class Sensed:
    """Derivatives by the first states and by P parameters and offsets.

    Attributes:
        end: (S, 2 n_vD, 2 n_vD + P) of the ends of the segments.
        between: (N, n_vD, 2 n_vD + P) of q_D at the samples.
        pull: (N, n_rows, 2 n_vD + P) of the tensions of their steps; None where not asked for.
    """

    end: Array
    between: Array
    pull: Array | None


def sense(
    marionette: Marionette,
    driven: Driven,
    rolled: Rolled,
    p: Array,
    of_p: Sequence[int],
    of_K: Sequence[int],
    begin: Array,
    samples: tuple[Indices, Indices, Array],
    *,
    pull: bool,
    threads: int,
) -> Sensed:
    """How rollouts change with their first states, with parameters and with offsets.

    Args:
        marionette: the puppet.
        driven, rolled: the rollouts.
        p: (n_p,).
        of_p, of_K: places of the parameters in p, and of the offsets among v_K.
        begin: (S, 2 n_vD, 2 n_vD + P) the same derivatives of the first states.
        samples: (N,) step and segment of every sample, and the part of the step before it.
        pull: also of the tensions.
        threads: that share the work.
    """
    n, S = driven.acc_K.shape[:2]
    n_v, n_k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    steps, segments, share = samples
    width = 2 * n_v + len(of_p) + len(of_K)
    columns = [2 * n_v + 3 * n_k + i for i in of_p] + [2 * n_v + k for k in of_K]
    Z = begin.copy()
    between = np.empty((len(steps), n_v, width))
    pulled = np.empty((len(steps), marionette.tree.n_rows, width)) if pull else None
    of_step = {}
    for own in _parts(S, threads):
        mine = np.flatnonzero((segments >= own.start) & (segments < own.stop))
        order = mine[np.argsort(steps[mine], kind="stable")]
        first = np.searchsorted(steps[order], np.arange(n + 1))
        of_step[own.start, own.stop] = [order[a:b] for a, b in pairwise(first)]
    block = max(b for b in range(1, n + 1) if n % b == 0 and (b == 1 or b * S <= _STEPS_AT_ONCE))

    def carry(own: tuple[int, int], k: int, lin: StepLinearisations) -> None:
        """Carries derivatives of some segments over the steps of a block that begins with k."""
        mine = slice(*own)
        for j in range(block):
            here, now = slice(j * S + own[0], j * S + own[1]), of_step[own][k + j]
            part = share[now, None, None]
            between[now] = (1.0 - part) * Z[segments[now], :n_v]
            if pulled is not None and lin.pull is not None and len(now):
                by = lin.pull[j * S + segments[now]]
                pulled[now] = by[..., : 2 * n_v] @ Z[segments[now]]
                pulled[now, :, 2 * n_v :] += by[..., columns]
            Z[mine] = lin.motion[here, :, : 2 * n_v] @ Z[mine]
            Z[mine, :, 2 * n_v :] += lin.motion[here][..., columns]
            between[now] += part * Z[segments[now], :n_v]

    room = None
    with ThreadPoolExecutor(len(of_step)) as pool:
        for k in range(0, n, block):
            some = slice(k, k + block)
            q_D, v_D, q_K, v_K, acc_K = (
                x[some].reshape(block * S, -1)
                for x in (rolled.q_D, rolled.v_D, driven.q_K, driven.v_K, driven.acc_K)
            )
            force = None if driven.u_D is None else driven.u_D[some].reshape(block * S, -1)
            motion = q_D, v_D, q_K, v_K
            given = StepInputs.of(marionette, motion, acc_K, force, p, driven.dt)
            lin = linearise_steps(marionette, given, StepOptions(pull=pull, threads=threads), room)
            room = lin.motion
            for done in [pool.submit(carry, own, k, lin) for own in of_step]:
                done.result()
    return Sensed(Z, between, pulled)
