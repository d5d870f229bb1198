"""Rollouts of the time-stepper, and gradients of their costs: the discrete adjoint.

Steps are x_k+1 = f(x_k, a_k, u_k, p). The adjoint l_k is the derivative of the cost C with respect
to x_k, including its effect on all later states:

    l_k = partial C / partial x_k + (df/dx)^T l_k+1,   dC/da_k = (df/da)^T l_k+1

The Jacobians of f are never formed: each step needs one solution with the transposed matrix of its
own equations (``derivatives/rollout_gradient.hpp``). The derivatives hold for contact points
with a force that stick or slide as in the run, as in
:mod:`fantoccini.dynamics.derivatives.step_partials`.

A rollout is a run of n steps. x_k is the state before step k, a_k are the driven accelerations in
it, u_k user forces, and p parameters. q_D and q_K are dynamic and driven coordinates. A winch
changes the length of a string. A node is a state from which a time step begins.
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
        q_D, v_D, q_K, v_K: (n_vD,) and (n_vK,) derivatives with respect to the dynamic (D) and
            driven (kinematic, K) start coordinates, with tangent vectors for q.
        acc_K: (n, n_vK) derivatives with respect to the driven accelerations.
        u_D: (n, n_vD) derivatives with respect to the user's forces.
        p: (n_p,) derivatives with respect to the parameters.
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

    Attributes:
        q_D, v_D, q_K, v_K: (n + 1, ...) states at the nodes.
        tension: (n, n_rows) mean tensions of strings and forces of limits in each step, the impulse
            divided by dt [N or N m].
        active: (n, n_rows) bool, the strings that are taut and limits that are reached in each
            step.
        dt: length of the steps [s].
        status: ``DONE``, or the reason of the stop.
        steps: number n of steps taken; fewer than requested if the run stopped (``throw=False``).
        n_contacts: (n,) number of contact points that push in each step.
        n_sliding: (n,) number of them that slide.
        edges: (n,) for each step, in which ways a contact is on the edge between two modes, such
            as sticking and sliding, as bits; see :meth:`edges_of`. :meth:`gradient` adds those that
            it detects.
        start: time of the first node [s].
        coordinates: names and indices of the coordinates.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    tension: Array
    active: MaskRows
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
    def differentiable(self) -> MaskRows:
        """Mask (n,) of the steps without a contact on the edge between two modes."""
        return np.asarray(self.edges == 0)

    def edges_of(self, i: int) -> tuple[str, ...]:
        """Descriptions of the ``edges`` of step i; derivatives are one-sided there."""
        return StepEdge.meanings(int(self.edges[i]))

    def gradient(
        self,
        q_D: Array | None = None,
        v_D: Array | None = None,
        q_K: Array | None = None,
        v_K: Array | None = None,
        tension: Array | None = None,
    ) -> RolloutGradient:
        """Gradient of a cost, from its derivatives with respect to all states and tensions.

        The gradient is exact for changes that keep the taut strings and reached limits of each
        step, and the modes of its contacts (open, sticking or sliding). In steps that are not
        :attr:`differentiable` it is one-sided. If the cost depends on acc_K, u_D or p directly, add
        its partial derivatives.

        Args:
            q_D, v_D, q_K, v_K: (n + 1, n_vD) or (n + 1, n_vK) partial derivatives of the cost with
                respect to the states, with tangent vectors for q; 0 by default.
            tension: (n, n_rows) partial derivatives with respect to the tensions; 0 by default.
                Redundant strings have no unique tensions: the first ones carry the load; with
                contacts, all of them, with least norm.

        Raises:
            StateError: the rollout was stopped, the velocities of a step were scaled down, a winch
                slipped, a step with contact has no derivative, or an array has another shape.
        """
        self._check_finished()
        n, n_vD, n_vK = len(self.tension), self.coordinates.n_vD, self.coordinates.n_vK
        l_q, l_v = _checked_copy(n + 1, n_vD, q_D=q_D), _checked_copy(n + 1, n_vD, v_D=v_D)
        l_qK, l_vK = _checked_copy(n + 1, n_vK, q_K=q_K), _checked_copy(n + 1, n_vK, v_K=v_K)
        by_tension = None
        if tension is not None:
            by_tension = _checked_copy(n, self.tension.shape[1], tension=tension)
        self._check_derivatives_exist()
        result = self._run.gradient(self.active, l_q, l_v, by_tension)
        self._check_derivatives_exist()  # the gradient may have detected further edges
        l_qK[:n] += result["g_qK"]
        has_rotations = self.coordinates.quaternions_K
        back_propagate = self._through_rotations if has_rotations else self._through_scalars
        by_qK, by_vK, by_acc = back_propagate(l_qK, l_vK, result["g_rate"], result["g_mean"])
        return RolloutGradient(
            result["g_q"], result["g_v"], by_qK, by_vK, by_acc, result["g_u"], result["g_p"]
        )

    def _check_finished(self) -> None:
        if self.status is not Status.DONE:
            raise StateError(f"the rollout was stopped, it has no gradient: {self.status.message}")
        numbers = self._run.numbers
        if numbers.shortened < len(self.tension):
            raise StateError(
                f"the time-stepper scaled the velocities of step {numbers.shortened} down, so that "
                "the rollout has no gradient"
            )
        if numbers.slip > 0.0:
            raise StateError("a winch slipped: gradients do not include slips")

    def _check_derivatives_exist(self) -> None:
        """Raises StateError if a step has no derivative, because of a contact."""
        if self.edges.max(initial=0) < StepEdge.LAW_CHANGED:
            return
        i = int(np.flatnonzero(self.edges >= StepEdge.LAW_CHANGED.value)[-1])
        reason = StepEdge.meanings(int(self.edges[i]) & -StepEdge.LAW_CHANGED.value)
        raise StateError(
            f"step {i}, at {self.start + i * self.dt:.6g} s, has no derivative, and so the rollout "
            f"no gradient: {self._pairs[self._run.touches['pairs'][i]]}: {'; '.join(reason)}"
        )

    def _through_scalars(
        self, l_q: Array, l_v: Array, rate: Array, mean: Array
    ) -> tuple[Array, Array, Array]:
        """Derivatives by the scalar q_K and v_K at the start, and by acc_K of all steps.

            q+ = q + dt rate,   rate = v + dt/2 acc,   v+ = v + dt acc,   mean = acc

        Args:
            l_q, l_v: (n + 1, n_vK) derivatives by q_K and v_K at the nodes.
            rate, mean: (n, n_vK) derivatives by the mean velocity and acceleration of each step.
        """
        dt = self.dt
        q = np.cumsum(l_q[::-1], axis=0)[::-1]
        l_v = l_v.copy()
        l_v[:-1] += rate + dt * q[1:]
        v = np.cumsum(l_v[::-1], axis=0)[::-1]
        return q[0], v[0], mean + 0.5 * dt * rate + 0.5 * dt * dt * q[1:] + dt * v[1:]

    def _through_rotations(
        self, l_q: Array, l_v: Array, rate: Array, mean: Array
    ) -> tuple[Array, Array, Array]:
        """The result of :meth:`_through_scalars` with driven rotations, step by step."""
        k = l_q.shape[1]
        q, v, acc = l_q[-1], l_v[-1], np.zeros_like(rate)
        for i in range(len(rate))[::-1]:
            step = self._driven[i]
            state_jacobian, mean_jacobian = step.end_derivatives(0, 0), step.mean_by(slice(0, k))
            adjoint = np.concatenate([q, v]) @ state_jacobian
            q = l_q[i] + adjoint[:k]
            v = l_v[i] + adjoint[k : 2 * k] + rate[i] + mean[i] @ mean_jacobian[0]
            acc[i] = adjoint[2 * k : 3 * k] + 0.5 * self.dt * rate[i] + mean[i] @ mean_jacobian[1]
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
        raise StateError("x0 has slipped winches; a rollout needs a state without slip")
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
        active=held_rows(marionette, tension),
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
    """Driven coordinates at the nodes, means in the steps; the steps, if rotations are driven."""
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
        rotations = rotation.exp(dt * rate[:, v : v + 3])
        for i in range(n):
            q_K[i + 1, q : q + 4] = rotation.multiply(q_K[i, q : q + 4], rotations[i])
    for q, v in t.scalars_K:
        q_K[1:, q] += dt * np.cumsum(rate[:, v])
    return {"q_K": q_K, "v_K": v_K, "rate": rate, "mean": mean}, tuple(driven)


def _checked_copy(n: int, width: int, **named_array: Array | None) -> Array:
    """Copy (n, width) of an array, or zeros."""
    ((name, values),) = named_array.items()
    if values is None:
        return np.zeros((n, width))
    result = vectors(name, values, width)
    if result.shape != (n, width):
        raise StateError(f"{name} has the shape {result.shape}; it must be ({n}, {width})")
    return result.copy()
