"""Rollouts of the time-stepper, and gradients of their costs: the discrete adjoint.

With the cost C of the states and tensions, steps x_k+1 = f(x_k, a_k, u_k, p) and l_k the derivative
of C by x_k through all later steps:

    l_k = dC/dx_k at fixed steps + (df/dx)^T l_k+1,   dC/da_k = (df/da)^T l_k+1

No derivative df is formed: every step takes one product with the transposed matrix of its own
equations (``derivatives/rollout_gradient.hpp``). Contact points that push are held in their
modes beside the strings and limits, as in
:mod:`fantoccini.dynamics.derivatives.step_partials`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from fantoccini.base import (
    Array,
    Indices,
    MaskRows,
    ShortRepr,
    SimulationError,
    StateError,
    Status,
    check_positive,
    rotation,
)
from fantoccini.dynamics.compiled import CompiledPuppet, vector, vectors
from fantoccini.dynamics.derivatives.driven_step import DrivenStep
from fantoccini.dynamics.derivatives.step_partials import held_rows
from fantoccini.kernel.contract import StepEdge
from fantoccini.kernel.runtime import GradientRun
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State, pair_name


@dataclass(frozen=True, eq=False, repr=False)
class RolloutGradient(ShortRepr):
    """The gradient of a scalar cost of a rollout.

    Attributes:
        q_D, v_D, q_K, v_K: derivatives by the start state, with tangent vectors for q.
        acc_K: (n, n_vK) derivatives by the driven accelerations.
        u_D: (n, n_vD) derivatives by the user's forces.
        p: (n_p,) derivatives by the parameters.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    acc_K: Array
    u_D: Array
    p: Array


@dataclass(frozen=True, eq=False, repr=False)
class Rollout(ShortRepr):
    """n time steps from a state, with nodes 0 to n.

    n is the number of steps requested or, with ``throw=False``, the number taken, ``steps``.

    Attributes:
        q_D, v_D, q_K, v_K: (n + 1, ...) states at the nodes.
        tension: (n, n_rows) impulse of every step over dt [N or N m].
        held: (n, n_rows) bool, strings and limits held in the steps.
        dt: length of the steps [s].
        status: ``DONE``, or the reason of the stop.
        steps: number of steps taken.
        n_contacts: (n,) number of contact points that push in the steps.
        n_sliding: (n,) number of them that slide.
        edges: (n,) edges of the steps between two modes, as bits; see :meth:`edges_of`. Edges that
            only a gradient finds appear here and in ``sharp`` after its call.
        start: time of the first node [s].
        coordinates: names and places of the coordinates.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    tension: Array
    held: MaskRows
    dt: float
    status: Status
    steps: int
    n_contacts: Indices
    n_sliding: Indices
    edges: Indices
    start: float
    coordinates: CoordinateTable
    _run: GradientRun
    _driven: tuple[DrivenStep, ...]
    _pairs: tuple[str, ...]

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a Rollout cannot be pickled or copied: its gradient needs the steps that the compiled "
            "library keeps; store q_D, v_D, q_K and v_K, or make it again with marionette.rollout"
        )

    @property
    def sharp(self) -> MaskRows:
        """Mask (n,) of the steps that are not between two modes of contact."""
        return np.asarray(self.edges == 0)

    def edges_of(self, i: int) -> tuple[str, ...]:
        """Edges of step i between two modes; its derivatives are those of the modes taken."""
        return StepEdge.meanings(int(self.edges[i]))

    def gradient(
        self,
        q_D: Array | None = None,
        v_D: Array | None = None,
        q_K: Array | None = None,
        v_K: Array | None = None,
        tension: Array | None = None,
    ) -> RolloutGradient:
        """Gradient of a cost, from its derivatives by the states and tensions of all nodes.

        It is exact where the steps are smooth: while the active set of each is constant, and every
        contact stays open, sticks or slides. In steps that are not :attr:`sharp` it is the one of
        the modes taken, towards one side. The direct derivatives of a cost by acc_K, u_D and p are
        to be added.

        Args:
            q_D, v_D, q_K, v_K: (n + 1, n_vD) or (n + 1, n_vK) derivatives of the cost by the
                states, with tangent vectors for q; 0 by default.
            tension: (n, n_rows) derivatives by the tensions; 0 by default. Of dependent rows, the
                first ones carry the load; with contacts, all of them, with least norm.

        Raises:
            StateError: the rollout was stopped, a step was cut short, a winch slipped, a step with
                contact has no derivative, or an array has another shape.
        """
        self._check()
        n, t = len(self.tension), self.coordinates
        l_q, l_v = _checked_copy(n + 1, t.n_vD, q_D=q_D), _checked_copy(n + 1, t.n_vD, v_D=v_D)
        l_qK, l_vK = _checked_copy(n + 1, t.n_vK, q_K=q_K), _checked_copy(n + 1, t.n_vK, v_K=v_K)
        pull = None
        if tension is not None:
            pull = _checked_copy(n, self.tension.shape[1], tension=tension)
        self._refuse_edges()
        result = self._run.gradient(self.held, l_q, l_v, pull)
        self._refuse_edges()
        l_qK[:n] += result["g_qK"]
        by_inputs = self._turning if t.quaternions_K else self._summed
        by_qK, by_vK, by_acc = by_inputs(l_qK, l_vK, result["g_rate"], result["g_mean"])
        return RolloutGradient(
            result["g_q"], result["g_v"], by_qK, by_vK, by_acc, result["g_u"], result["g_p"]
        )

    def _check(self) -> None:
        if self.status is not Status.DONE:
            raise StateError(f"the rollout was stopped, it has no gradient: {self.status.message}")
        numbers = self._run.numbers
        if numbers.shortened < len(self.tension):
            raise StateError(
                f"step {numbers.shortened} was cut short: the time-stepper scaled its velocities "
                "down, so that the rollout has no gradient"
            )
        if numbers.slip > 0.0:
            raise StateError("a winch slipped: gradients do not include slips")

    def _refuse_edges(self) -> None:
        """Raises StateError if contact leaves a step without derivative."""
        if self.edges.max(initial=0) < StepEdge.LAW_CHANGED:
            return
        i = int(np.flatnonzero(self.edges >= StepEdge.LAW_CHANGED.value)[-1])
        why = StepEdge.meanings(int(self.edges[i]) & -StepEdge.LAW_CHANGED.value)
        raise StateError(
            f"step {i}, at {self.start + i * self.dt:.6g} s, has no derivative, and so the rollout "
            f"no gradient: {self._pairs[self._run.touches['pairs'][i]]}: {'; '.join(why)}"
        )

    def _summed(
        self, l_q: Array, l_v: Array, rate: Array, mean: Array
    ) -> tuple[Array, Array, Array]:
        """Derivatives by scalar q_K, v_K and acc_K from those by nodes, rates and means.

        q+ = q + dt rate,   rate = v + dt/2 acc,   v+ = v + dt acc,   mean = acc
        """
        dt = self.dt
        q = np.cumsum(l_q[::-1], axis=0)[::-1]
        l_v = l_v.copy()
        l_v[:-1] += rate + dt * q[1:]
        v = np.cumsum(l_v[::-1], axis=0)[::-1]
        return q[0], v[0], mean + 0.5 * dt * rate + 0.5 * dt * dt * q[1:] + dt * v[1:]

    def _turning(
        self, l_q: Array, l_v: Array, rate: Array, mean: Array
    ) -> tuple[Array, Array, Array]:
        """The result of :meth:`_summed` for driven rotations, step by step."""
        k = l_q.shape[1]
        q, v, acc = l_q[-1], l_v[-1], np.zeros_like(rate)
        for i in range(len(rate))[::-1]:
            step = self._driven[i]
            of_state, mean_by = step.state(0, 0), step.mean_by(slice(0, k))
            back = np.concatenate([q, v]) @ of_state
            q = l_q[i] + back[:k]
            v = l_v[i] + back[k : 2 * k] + rate[i] + mean[i] @ mean_by[0]
            acc[i] = back[2 * k : 3 * k] + 0.5 * self.dt * rate[i] + mean[i] @ mean_by[1]
        return q, v, acc


def rollout(
    marionette: CompiledPuppet,
    x0: State,
    acc_K: Array,
    u_D: Array | None = None,
    *,
    p: Array | None = None,
    dt: float = 0.002,
    extrapolate: bool = True,
    throw: bool = True,
) -> Rollout:
    """Time steps with their gradients; see :meth:`Marionette.rollout`."""
    check_positive(dt=dt)
    marionette.check_state(x0)
    t = marionette.coordinates
    acc = vectors("acc_K", acc_K, t.n_vK)
    if acc.ndim != 2:
        raise StateError(
            f"acc_K has the shape {acc.shape}; it must be (n, {t.n_vK}), a row for each step: "
            "np.tile(acc_K, (n, 1)) repeats one"
        )
    n = len(acc)
    force = None if u_D is None else np.atleast_2d(vectors("u_D", u_D, t.n_vD))
    if force is not None and (force.ndim != 2 or len(force) not in (1, n)):
        raise StateError(f"u_D has {len(force)} rows; it must have 1 or {n}, as acc_K")
    values = marionette.p if p is None else vector("p", p, len(marionette.p))
    if np.any(x0.slip):
        raise StateError("a rollout begins with winches that have not slipped")
    inputs, driven = _inputs(t, x0, acc, dt)
    options = marionette.run_options(dt=dt, extrapolate=extrapolate)
    pairs = () if marionette.contacts is None else marionette.contacts.names
    run = GradientRun(
        marionette.libraries.gradients,
        options,
        marionette.winches,
        marionette.reference_force,
        inputs,
        force,
        x0.q_D,
        x0.v_D,
        values,
    )
    status, n_done = Status(run.numbers.status), run.numbers.n_steps
    if throw and status is not Status.DONE:
        raise SimulationError(
            status,
            f"at step {n_done} of {n}, t = {x0.t + n_done * dt:.6g} s; throw=False keeps the "
            "steps before it",
        )
    tension = run.arrays["tension"][:n_done]
    return Rollout(
        **{name: run.arrays[name][: n_done + 1] for name in ("q_D", "v_D", "q_K", "v_K")},
        tension=tension,
        held=held_rows(marionette, tension),
        dt=dt,
        status=status,
        steps=n_done,
        n_contacts=run.touches["n_points"][:n_done],
        n_sliding=run.touches["n_sliding"][:n_done],
        edges=run.touches["edges"][:n_done],
        start=x0.t,
        coordinates=t,
        _run=run,
        _driven=driven,
        _pairs=tuple(pair_name(pair) for pair in pairs),
    )


def _inputs(
    t: CoordinateTable, x0: State, acc: Array, dt: float
) -> tuple[dict[str, Array], tuple[DrivenStep, ...]]:
    """Driven coordinates by node and step; and each step, if driven rotations exist."""
    n = len(acc)
    q_K, v_K = (np.repeat(a[None], n + 1, axis=0) for a in (x0.q_K, x0.v_K))
    v_K[1:] += dt * np.cumsum(acc, axis=0)
    rate, mean = v_K[:-1] + 0.5 * dt * acc, acc.copy()
    driven = []
    if t.quaternions_K:
        for i in range(n):
            step = DrivenStep(t.quaternions_K, v_K[i], acc[i], dt)
            rate[i], mean[i] = step.rate, step.mean
            v_K[i + 1] = v_K[i] + dt * step.mean
            driven.append(step)
    for q, v in t.quaternions_K:
        turns = rotation.exp(dt * rate[:, v : v + 3])
        for i in range(n):
            q_K[i + 1, q : q + 4] = rotation.multiply(q_K[i, q : q + 4], turns[i])
    for q, v in t.scalars_K:
        q_K[1:, q] += dt * np.cumsum(rate[:, v])
    return {"q_K": q_K, "v_K": v_K, "rate": rate, "mean": mean}, tuple(driven)


def _checked_copy(n: int, width: int, **named: Array | None) -> Array:
    """Copy (n, width) of an array, or zeros."""
    ((name, values),) = named.items()
    if values is None:
        return np.zeros((n, width))
    result = vectors(name, values, width)
    if result.shape != (n, width):
        raise StateError(f"{name} has the shape {result.shape}; it must be ({n}, {width})")
    return result.copy()
