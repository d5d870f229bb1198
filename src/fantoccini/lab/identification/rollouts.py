"""Rollouts of all segments at once, with derivatives with respect to first states and unknowns.

A record is cut into segments. Each is simulated by time-stepping from its own first state, all of
them in lanes:

    x_k+1 = f(x_k, q_K(t_k), p),      Z_k+1 = f_x Z_k + [0, f_p, f_qK]

Z has the derivatives of (dq_D, v_D) by the segment's first state, by unknown parameters and by
unknown offsets of driven coordinates.
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
from fantoccini.kernel.runtime import LaneHistory, LaneRecord, LaneSteppers
from fantoccini.motion import Input

MAX_STEPS_PER_BLOCK = 1500
"""Largest number of steps that are linearised together; bounds the memory."""
MIN_SEGMENTS_PER_THREAD = 24
"""Smallest number of segments per thread: three full vectors of lanes."""


@dataclass(frozen=True, eq=False)
class DrivenSteps:
    """Driven coordinates over the steps of S segments.

    Attributes:
        q_K, v_K: (n + 1, S, ...) at the nodes.
        acc_K: (n, S, n_vK) accelerations that lead from one q_K to the next.
        u_D: (n, S, n_vD) user forces in the middle of the steps; None without forces.
        dt: length of the steps [s].
    """

    q_K: Array
    v_K: Array
    acc_K: Array
    u_D: Array | None
    dt: float

    @classmethod
    def of(
        cls, marionette: Marionette, inputs: Input, starts: Array, n: int, dt: float
    ) -> DrivenSteps:
        """n steps from each of S times [s].

        Args:
            marionette: the puppet.
            inputs: inputs of all driven coordinates.
            starts: (S,) start times [s].
            n: number of steps.
            dt: length of the steps [s].
        """
        t, table = starts + dt * np.arange(n + 1)[:, None], marionette.coordinates
        q_K, v_K, _ = inputs.evaluate(t)
        move = tangent.between(table.scalars_K, table.quaternions_K, q_K[:-1], q_K[1:], table.n_vK)
        force = None if inputs.force is None else inputs.evaluate_force(t[:-1] + 0.5 * dt)
        return cls(q_K, v_K, 2.0 * (move / dt - v_K[:-1]) / dt, force, dt)

    def with_offsets(self, marionette: Marionette, offsets: Array) -> DrivenSteps:
        """The steps with offsets (n_vK,) added to scalar coordinates."""
        if not np.any(offsets):
            return self
        q_K = self.q_K.copy()
        for q, v in marionette.coordinates.scalars_K:
            q_K[..., q] += offsets[v]
        return replace(self, q_K=q_K)

    @property
    def first(self) -> DrivenSteps:
        """The first step."""
        force = None if self.u_D is None else self.u_D[:1]
        return DrivenSteps(self.q_K[:2], self.v_K[:2], self.acc_K[:1], force, self.dt)

    def subset(self, s: slice | Indices) -> DrivenSteps:
        """The steps of chosen segments."""
        force = None if self.u_D is None else self.u_D[:, s]
        return DrivenSteps(self.q_K[:, s], self.v_K[:, s], self.acc_K[:, s], force, self.dt)


@dataclass(frozen=True, eq=False)
class Rollouts:
    """S rollouts of n steps.

    Attributes:
        q_D, v_D: (n + 1, S, ...) states.
        tension: (n, S, n_rows) of the steps [N or N m].
        arrived: whether all rollouts reached their ends.
    """

    q_D: Array
    v_D: Array
    tension: Array
    arrived: bool


def roll_out(
    marionette: Marionette, driven: DrivenSteps, q_D: Array, v_D: Array, p: Array, threads: int = 1
) -> Rollouts:
    """Rollouts from S states (S, ...) with parameters p (n_p,).

    A step depends on its state alone, as in :func:`fantoccini.linearise_steps`.
    """
    parts = _segment_slices(len(q_D), threads)
    with ThreadPoolExecutor(len(parts)) as pool:
        rollouts = list(
            pool.map(
                lambda part: _roll_out_part(
                    marionette, driven.subset(part), q_D[part], v_D[part], p
                ),
                parts,
            )
        )
    if len(rollouts) == 1:
        return rollouts[0]
    q, v, tension = (
        np.concatenate([getattr(rollout, name) for rollout in rollouts], axis=1)
        for name in ("q_D", "v_D", "tension")
    )
    return Rollouts(q, v, tension, all(rollout.arrived for rollout in rollouts))


def _segment_slices(S: int, threads: int) -> list[slice]:
    """S segments divided among threads, each with enough of them."""
    n = max(1, min(threads, S // MIN_SEGMENTS_PER_THREAD))
    ends = [S * i // n for i in range(n + 1)]
    return [slice(a, b) for a, b in pairwise(ends)]


def _roll_out_part(
    marionette: Marionette, driven: DrivenSteps, q_D: Array, v_D: Array, p: Array
) -> Rollouts:
    n, S = driven.acc_K.shape[:2]
    record = LaneRecord(S, marionette.libraries.lanes.sizes)
    record.begin(q_D=q_D, v_D=v_D, p=p)
    options = marionette.run_options(dt=driven.dt, extrapolate=False)
    acc = np.zeros((S, marionette.coordinates.n_vK))
    force = None if driven.u_D is None else np.zeros((S, marionette.coordinates.n_vD))
    steppers = LaneSteppers(marionette.libraries.lanes, record, 1, options, marionette.winches)
    advance = steppers.bound(driven.dt, acc, force)
    history = LaneHistory(record, n + 1, ("q_D", "v_D", "tension", "status"))
    history.keep(0)
    for k in range(n):
        record.begin(q_K=driven.q_K[k], v_K=driven.v_K[k])
        acc[:] = driven.acc_K[k]
        if force is not None and driven.u_D is not None:
            force[:] = driven.u_D[k]
        advance()
        history.keep(k + 1)
    parts = history.parts
    arrived = np.all(np.isin(parts["status"][1:], ARRIVED)) and np.all(np.isfinite(record.q_D))
    return Rollouts(parts["q_D"], parts["v_D"], parts["tension"][1:], bool(arrived))


@dataclass(frozen=True, eq=False)
class RolloutDerivatives:
    """Derivatives by first states, and by P parameters and offsets.

    Attributes:
        end: (S, 2 n_vD, 2 n_vD + P) of the segments' last states.
        between: (N, n_vD, 2 n_vD + P) of q_D at the samples.
        pull: (N, n_rows, 2 n_vD + P) of the tensions of their steps; None if not requested.
    """

    end: Array
    between: Array
    pull: Array | None


def differentiate(
    marionette: Marionette,
    driven: DrivenSteps,
    rollouts: Rollouts,
    p: Array,
    of_p: Sequence[int],
    of_K: Sequence[int],
    begin: Array,
    samples: tuple[Indices, Indices, Array],
    *,
    pull: bool,
    threads: int,
) -> RolloutDerivatives:
    """Derivatives of rollouts by their first states, parameters and offsets.

    Args:
        marionette: the puppet.
        driven, rollouts: inputs and states of the rollouts.
        p: (n_p,) parameters.
        of_p, of_K: indices of the unknown parameters in p, and of the unknown offsets in v_K.
        begin: (S, 2 n_vD, 2 n_vD + P) the same derivatives of the first states.
        samples: (N,) step and segment of every sample, and its position within the step, 0 to 1.
        pull: whether to differentiate tensions, too.
        threads: number of threads.
    """
    n, S = driven.acc_K.shape[:2]
    n_v, n_k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    steps, segments, fraction = samples
    width = 2 * n_v + len(of_p) + len(of_K)
    columns = [2 * n_v + 3 * n_k + i for i in of_p] + [2 * n_v + k for k in of_K]
    Z = begin.copy()
    between = np.empty((len(steps), n_v, width))
    tension_derivatives = np.empty((len(steps), marionette.tree.n_rows, width)) if pull else None
    samples_of_step = {}
    for part in _segment_slices(S, threads):
        in_part = np.flatnonzero((segments >= part.start) & (segments < part.stop))
        order = in_part[np.argsort(steps[in_part], kind="stable")]
        first = np.searchsorted(steps[order], np.arange(n + 1))
        samples_of_step[part.start, part.stop] = [order[a:b] for a, b in pairwise(first)]
    block = max(
        b for b in range(1, n + 1) if n % b == 0 and (b == 1 or b * S <= MAX_STEPS_PER_BLOCK)
    )

    def propagate(part: tuple[int, int], k: int, lin: StepLinearisations) -> None:
        """Propagates a part's derivatives over the steps of the block that begins with k."""
        own = slice(*part)
        for j in range(block):
            rows = slice(j * S + part[0], j * S + part[1])
            samples_now = samples_of_step[part][k + j]
            weight = fraction[samples_now, None, None]
            between[samples_now] = (1.0 - weight) * Z[segments[samples_now], :n_v]
            if (
                tension_derivatives is not None
                and lin.tension_partials is not None
                and len(samples_now)
            ):
                derivative = lin.tension_partials[j * S + segments[samples_now]]
                tension_derivatives[samples_now] = (
                    derivative[..., : 2 * n_v] @ Z[segments[samples_now]]
                )
                tension_derivatives[samples_now, :, 2 * n_v :] += derivative[..., columns]
            Z[own] = lin.motion[rows, :, : 2 * n_v] @ Z[own]
            Z[own, :, 2 * n_v :] += lin.motion[rows][..., columns]
            between[samples_now] += weight * Z[segments[samples_now], :n_v]

    work = None
    with ThreadPoolExecutor(len(samples_of_step)) as pool:
        for k in range(0, n, block):
            steps_of_block = slice(k, k + block)
            q_D, v_D, q_K, v_K, acc_K = (
                x[steps_of_block].reshape(block * S, -1)
                for x in (rollouts.q_D, rollouts.v_D, driven.q_K, driven.v_K, driven.acc_K)
            )
            force = (
                None if driven.u_D is None else driven.u_D[steps_of_block].reshape(block * S, -1)
            )
            motion = q_D, v_D, q_K, v_K
            inputs = StepInputs.from_arrays(marionette, motion, acc_K, force, p, driven.dt)
            options = StepOptions(tension_partials=pull, threads=threads)
            lin = linearise_steps(marionette, inputs, options, work)
            work = lin.motion
            for task in [pool.submit(propagate, part, k, lin) for part in samples_of_step]:
                task.result()
    return RolloutDerivatives(Z, between, tension_derivatives)
