"""Rollouts of all segments at once, with derivatives with respect to first states and unknowns.

A record is cut into segments. Each is simulated by time-stepping from its own first state, all of
them in lanes:

    x_k+1 = f(x_k, q_K(t_k), p),      Z_k+1 = f_x Z_k + [0, f_p, f_qK]

Z has the derivatives of (dq_D, v_D) by the segment's first state, by unknown parameters and by
unknown offsets of driven coordinates.

A rollout is the simulation of a segment. q_D and v_D are dynamic coordinates and velocities, q_K
the driven coordinates (ends and lengths of strings), and p the parameters. Lanes are runs that the
vector unit of the processor advances together.
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
    def from_inputs(
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
    def first_step(self) -> DrivenSteps:
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
    chunks = _segment_slices(len(q_D), threads)
    with ThreadPoolExecutor(len(chunks)) as pool:
        rollouts = list(
            pool.map(
                lambda chunk: _roll_out_chunk(
                    marionette, driven.subset(chunk), q_D[chunk], v_D[chunk], p
                ),
                chunks,
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
    return [slice(start, stop) for start, stop in pairwise(ends)]


def _roll_out_chunk(
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
    arrays = history.parts
    arrived = np.all(np.isin(arrays["status"][1:], ARRIVED)) and np.all(np.isfinite(record.q_D))
    return Rollouts(arrays["q_D"], arrays["v_D"], arrays["tension"][1:], bool(arrived))


@dataclass(frozen=True, eq=False)
class RolloutDerivatives:
    """Derivatives by first states, and by P parameters and offsets.

    Attributes:
        end: (S, 2 n_vD, 2 n_vD + P) of the segments' last states.
        at_samples: (N, n_vD, 2 n_vD + P) of q_D at the samples.
        tension: (N, n_rows, 2 n_vD + P) of the tensions of their steps; None if not requested.
    """

    end: Array
    at_samples: Array
    tension: Array | None


def differentiate(
    marionette: Marionette,
    driven: DrivenSteps,
    rollouts: Rollouts,
    p: Array,
    parameter_indices: Sequence[int],
    offset_indices: Sequence[int],
    start_derivatives: Array,
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
        parameter_indices, offset_indices: indices of the unknown parameters in p, and of the
            unknown offsets in v_K.
        start_derivatives: (S, 2 n_vD, 2 n_vD + P) the same derivatives of the first states.
        samples: (N,) step and segment of every sample, and its position within the step, 0 to 1.
        pull: whether to differentiate tensions, too.
        threads: number of threads.
    """
    n, S = driven.acc_K.shape[:2]
    n_v, n_k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    steps, segments, fraction = samples
    width = 2 * n_v + len(parameter_indices) + len(offset_indices)
    columns = [2 * n_v + 3 * n_k + i for i in parameter_indices] + [
        2 * n_v + k for k in offset_indices
    ]
    Z = start_derivatives.copy()
    q_derivatives = np.empty((len(steps), n_v, width))
    tension_derivatives = np.empty((len(steps), marionette.tree.n_rows, width)) if pull else None
    samples_of_step = {}
    for chunk in _segment_slices(S, threads):
        in_chunk = np.flatnonzero((segments >= chunk.start) & (segments < chunk.stop))
        order = in_chunk[np.argsort(steps[in_chunk], kind="stable")]
        first = np.searchsorted(steps[order], np.arange(n + 1))
        samples_of_step[chunk.start, chunk.stop] = [
            order[start:stop] for start, stop in pairwise(first)
        ]
    block_size = max(
        b for b in range(1, n + 1) if n % b == 0 and (b == 1 or b * S <= MAX_STEPS_PER_BLOCK)
    )

    def propagate(chunk: tuple[int, int], k: int, linearisation: StepLinearisations) -> None:
        """Propagates a part's derivatives over the steps of the block that begins with k."""
        segment_rows = slice(*chunk)
        for j in range(block_size):
            rows = slice(j * S + chunk[0], j * S + chunk[1])
            samples_now = samples_of_step[chunk][k + j]
            weight = fraction[samples_now, None, None]
            q_derivatives[samples_now] = (1.0 - weight) * Z[segments[samples_now], :n_v]
            if (
                tension_derivatives is not None
                and linearisation.tension_partials is not None
                and len(samples_now)
            ):
                derivative = linearisation.tension_partials[j * S + segments[samples_now]]
                tension_derivatives[samples_now] = (
                    derivative[..., : 2 * n_v] @ Z[segments[samples_now]]
                )
                tension_derivatives[samples_now, :, 2 * n_v :] += derivative[..., columns]
            Z[segment_rows] = linearisation.motion[rows, :, : 2 * n_v] @ Z[segment_rows]
            Z[segment_rows, :, 2 * n_v :] += linearisation.motion[rows][..., columns]
            q_derivatives[samples_now] += weight * Z[segments[samples_now], :n_v]

    memory = None
    with ThreadPoolExecutor(len(samples_of_step)) as pool:
        for k in range(0, n, block_size):
            steps_of_block = slice(k, k + block_size)
            q_D, v_D, q_K, v_K, acc_K = (
                x[steps_of_block].reshape(block_size * S, -1)
                for x in (rollouts.q_D, rollouts.v_D, driven.q_K, driven.v_K, driven.acc_K)
            )
            force = (
                None
                if driven.u_D is None
                else driven.u_D[steps_of_block].reshape(block_size * S, -1)
            )
            motion = q_D, v_D, q_K, v_K
            inputs = StepInputs.from_arrays(marionette, motion, acc_K, force, p, driven.dt)
            options = StepOptions(tension_partials=pull, threads=threads)
            linearisation = linearise_steps(marionette, inputs, options, memory)
            memory = linearisation.motion
            for task in [
                pool.submit(propagate, chunk, k, linearisation) for chunk in samples_of_step
            ]:
                task.result()
    return RolloutDerivatives(Z, q_derivatives, tension_derivatives)
