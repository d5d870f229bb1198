"""The linearisation of time steps, compiled, with the active sets that the steps find.

With rate = dq_K/dt and mean = dv_K/dt over the step, damping and drag F implicit, and the rows in
Lambda > 0 (``cpp/fantoccini/timestepping/step.hpp``):

    (M + dt F) (v+ - v) + dt (c(q, v, q_K, rate) + M_DK mean - u_D) + A_D^T Lambda = 0
    A_D v+ + A_K rate + min(h/dt, recovery speed) = 0,      q+ = q moved by dt v+

with contacts in their modes (``contact_rows``), are differentiated with M, A and c at the step's
start. It is the first step of a stepper: later in a run c takes its velocity products half a step
ahead, extrapolated from earlier steps, which are not part of a state. That changes dv+ by dt^2/2
times the products' derivatives.

q_D are dynamic and q_K driven coordinates (ends and lengths of strings), v_D and v_K their
velocities, acc_K driven accelerations. Lambda are the impulses of rows, that is, strings and
limits. A winch changes the length of a string; slip is the length that it lets out at its largest
tension.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, TypedDict

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, ShortRepr, StateError, Status, check_positive
from fantoccini.dynamics.compiled import CompiledPuppet, refuse_contact, vectors
from fantoccini.dynamics.derivatives.driven_step import DrivenStep
from fantoccini.dynamics.derivatives.variational_partials import (
    VariationalPartials,
    variational_partials,
)
from fantoccini.kernel.contract import StepEdge
from fantoccini.kernel.runtime import (
    LaneRecord,
    LaneSteppers,
    RunOptions,
    StepTouches,
    default_threads,
    step_touches,
)
from fantoccini.model.tree import CoordinateTable

MIN_SHORTENING = 1e-9
"""Relative difference of a step's velocity and its equations' if the velocity was scaled down."""
SLIPPING_RATIO = 1.0 - 1e-9
"""Share of a string's largest tension from which it counts as slipping."""


@dataclass(frozen=True, eq=False, repr=False)
class StepLinearisations(ShortRepr):
    """n time steps and their derivatives, as in :class:`StepLinearisation`.

    Attributes:
        q_D, v_D, q_K, v_K: (n, ...) dynamic (D) and driven (kinematic, K) configurations and
            velocities after the steps.
        tension: (n, n_rows) impulses over dt [N or N m].
        active: (n, n_rows) bool, strings and limits held in the steps.
        motion: (n, 2 n_vD, m) derivatives of (dq_D, v_D) after the step by q_D, v_D, q_K, v_K,
            acc_K, u_D if requested, and p: the rows of A, B, B_u and B_p of the dynamic
            coordinates.
        tension_partials: (n, n_rows, m) derivatives of ``tension``, if requested; 0 for rows not
            held.
        settled: (n,) bool, steps that were not stopped or scaled down, and whose contacts have
            derivatives; the derivatives of others are those of the equations, not of the step.
        edges: (n,) for each step, in which ways a contact is on the edge between two modes, as
            bits; see :meth:`edges_of`.
        n_contacts: (n,) number of points that push.
        dt: length of the steps [s].
        coordinates: names and places of the coordinates.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    tension: Array
    active: MaskRows
    motion: Array
    tension_partials: Array | None
    settled: MaskRows
    edges: Indices
    n_contacts: Indices
    dt: float
    coordinates: CoordinateTable
    _driven: tuple[DrivenStep, ...]

    def __len__(self) -> int:
        return len(self.q_D)

    @property
    def differentiable(self) -> MaskRows:
        """Mask (n,) of steps with derivatives towards all sides: no contact is between modes."""
        return self.settled & (self.edges == 0)

    def edges_of(self, i: int) -> tuple[str, ...]:
        """Descriptions of the ``edges`` of step i; derivatives are one-sided there."""
        return StepEdge.meanings(int(self.edges[i]))

    @cached_property
    def A(self) -> Array:
        """Derivatives (n, n_z, n_z) of z = (dq_D, dv_D, dq_K, dv_K) after the steps by z before."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        A = np.zeros((len(self), 2 * (n + k), 2 * (n + k)))
        A[:, : 2 * n] = self.motion[..., : 2 * (n + k)]
        A[:, 2 * n :, 2 * n :] = self.driven[..., : 2 * k]
        return A

    @cached_property
    def B(self) -> Array:
        """Derivatives (n, n_z, n_vK) of z after the step by the driven accelerations."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        B = np.zeros((len(self), 2 * (n + k), k))
        B[:, : 2 * n] = self.motion[..., 2 * (n + k) : 2 * n + 3 * k]
        B[:, 2 * n :] = self.driven[..., 2 * k :]
        return B

    @cached_property
    def driven(self) -> Array:
        """Derivatives (n or 1, 2 n_vK, 3 n_vK) of (dq_K, dv_K) after the steps by q_K, v_K, acc."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        steps = self._driven or (DrivenStep((), np.zeros(k), np.zeros(k), self.dt),)
        return np.array([step.end_derivatives(n, 0)[:, 2 * n : 2 * n + 3 * k] for step in steps])


@dataclass(frozen=True)
class StepOptions:
    """Options of linearised time steps.

    Attributes:
        forces: whether to differentiate by the user's forces, too.
        tension_partials: whether to differentiate the tensions, too.
        threads: number of threads; by default all processors.
        method: ``"timestepping"``, or ``"variational"`` for steps of that method, in which no
            driven joint turns.

    Raises:
        StateError: there is no such method.
    """

    forces: bool = False
    tension_partials: bool = False
    threads: int | None = None
    method: Literal["timestepping", "variational"] = "timestepping"

    def __post_init__(self) -> None:
        if self.method not in ("timestepping", "variational"):
            text = f"method is {self.method!r}; it must be 'timestepping' or 'variational'"
            raise StateError(text)


class StepKeywords(TypedDict, total=False):
    """The fields of :class:`StepOptions` as keyword arguments."""

    forces: bool
    tension_partials: bool
    threads: int | None
    method: Literal["timestepping", "variational"]


def linearise_steps(
    marionette: CompiledPuppet,
    inputs: StepInputs,
    options: StepOptions | None = None,
    buffer: Array | None = None,
) -> StepLinearisations:
    """One time step from each of n states; see :meth:`Marionette.linearise_steps`.

    Args:
        marionette: the puppet.
        inputs: inputs of the steps.
        options: options; see :class:`StepOptions`.
        buffer: ``motion`` of an earlier call, overwritten if it has the right size.
    """
    options = options or StepOptions()
    if options.method == "timestepping":
        return linearised(marionette, inputs, options, buffer=buffer).steps
    refuse_contact(marionette, "the method variational")
    partials = variational_partials(
        marionette, inputs.x, inputs.acc_K, inputs.u_D, inputs.p, inputs.dt, _threads(options)
    )
    return _variational(marionette, partials, inputs, options)


def _threads(options: StepOptions) -> int:
    return default_threads() if options.threads is None else options.threads


class StepInputs(NamedTuple):
    """Inputs of n time steps.

    Attributes:
        x: q_D, v_D, q_K and v_K before the steps, (n, ...) each.
        slip: (n, n_strings) slip of the winches before the steps [m].
        acc_K: (1 or n, n_vK) driven accelerations.
        u_D: (1 or n, n_vD) user forces; None for none.
        p: (1 or n, n_p) parameters.
        dt: length of the steps [s].
        driven: driven coordinates over every step; empty without driven rotations.
    """

    x: dict[str, Array]
    slip: Array
    acc_K: Array
    u_D: Array | None
    p: Array
    dt: float
    driven: tuple[DrivenStep, ...]

    @classmethod
    def from_arrays(
        cls,
        marionette: CompiledPuppet,
        motion: tuple[Array, Array, Array, Array],
        acc_K: Array | None = None,
        u_D: Array | None = None,
        p: Array | None = None,
        dt: float = 0.002,
        slip: Array | None = None,
    ) -> StepInputs:
        """Inputs from states with ``motion`` q_D, v_D, q_K and v_K, (n, ...) or (...,) each."""
        check_positive(dt=dt)
        t = marionette.coordinates
        widths = {"q_D": t.n_qD, "v_D": t.n_vD, "q_K": t.n_qK, "v_K": t.n_vK}
        named_arrays = zip(widths.items(), motion, strict=True)
        starts = {name: np.atleast_2d(vectors(name, a, width)) for (name, width), a in named_arrays}
        acc = np.zeros((1, t.n_vK)) if acc_K is None else vectors("acc_K", acc_K, t.n_vK)
        acc = np.atleast_2d(acc)
        force = None if u_D is None else np.atleast_2d(vectors("u_D", u_D, t.n_vD))
        values = (
            marionette.p[None] if p is None else np.atleast_2d(vectors("p", p, len(marionette.p)))
        )
        n = max(map(len, (*starts.values(), acc, values, () if force is None else force)))
        x = {name: _repeated_rows(a, n) for name, a in starts.items()}
        zeros = np.zeros((n, len(marionette.tree.strings)))
        slips = zeros if slip is None or not len(slip) else zeros + slip
        driven = _driven_steps(marionette, x["v_K"], acc, dt)
        return cls(x, slips, acc, force, values, dt, driven)

    @property
    def mean_rates(self) -> dict[str, Array]:
        """Means over the steps (n, n_vK): ``rate`` of dq_K/dt, and ``mean`` of dv_K/dt."""
        if self.driven:
            return {
                k: np.array([getattr(step, k) for step in self.driven]) for k in ("rate", "mean")
            }
        v_K, acc = self.x["v_K"], self.acc_K
        return {"rate": v_K + 0.5 * self.dt * acc, "mean": _repeated_rows(acc, len(v_K))}


class Linearised(NamedTuple):
    """Time steps with their linearisations and additional results.

    Attributes:
        steps: the linearisations.
        record: record of the steps, of a puppet without or with contact.
        shortened: (n,) bool, steps whose velocities the time-stepper scaled down.
        shares: (n, 3 capacity, m) derivatives of the contacts' multipliers, if requested.
        moved: (n, n_vD + n_vK, m) derivatives of the configuration at which rebounding contacts
            touch, if requested, for steps with such contacts.
    """

    steps: StepLinearisations
    record: LaneRecord | StepTouches
    shortened: MaskRows
    shares: Array | None
    moved: Array | None


def linearised(
    marionette: CompiledPuppet,
    inputs: StepInputs,
    options: StepOptions,
    *,
    shares: bool = False,
    buffer: Array | None = None,
) -> Linearised:
    """Time steps of the time-stepper and their derivatives; see :func:`linearise_steps`."""
    x, mean_rates, dt, threads = inputs.x, inputs.mean_rates, inputs.dt, _threads(options)
    run_options = marionette.run_options(dt=dt, extrapolate=False)
    end_record: LaneRecord | StepTouches
    if run_options.contacts is None:
        touches, end_record = None, _time_steps(marionette, run_options, inputs, threads)
    else:
        touches = end_record = step_touches(
            marionette.library,
            run_options,
            marionette.winches,
            marionette.reference_force,
            x | mean_rates | {"slip": inputs.slip},
            inputs.acc_K,
            inputs.u_D,
            inputs.p,
            threads,
        )
    tension = end_record.tension
    held = held_rows(marionette, tension)
    derivatives = marionette.libraries.step_derivatives.find(
        {name: x[name] for name in ("q_D", "v_D", "q_K")}
        | {"slip": inputs.slip, "tension": tension}
        | mean_rates,
        held,
        # Beyond the puppet's cap of tensions, a winch's largest tension is never reached.
        np.where(marionette.max_forces <= marionette.tension_cap, marionette.cap_parameters, -1),
        inputs.p,
        inputs.u_D,
        dt=dt,
        recovery_speed=run_options.recovery_speed,
        forces=options.forces,
        pull=options.tension_partials,
        shares=shares,
        threads=threads,
        touches=touches,
        motion_out=buffer,
    )
    for columns in (derivatives.motion, derivatives.pull, derivatives.shares, derivatives.moved):
        if columns is not None:
            _chain_rotations(marionette, inputs.driven, columns)
    expected_v_D = x["v_D"] + dt * derivatives.acc_D
    speed_scale = 1.0 + np.abs(end_record.v_D).max(axis=1, initial=0.0)
    is_shortened = ~(
        np.abs(expected_v_D - end_record.v_D).max(axis=1, initial=0.0)
        <= MIN_SHORTENING * speed_scale
    )
    zeros = np.zeros(len(held), dtype=np.int32)
    edges, n_points = (zeros, zeros) if touches is None else (touches.edges, touches.n_points)
    is_done = (end_record.status == Status.DONE.value) & ~is_shortened
    steps = StepLinearisations(
        q_D=end_record.q_D,
        v_D=end_record.v_D,
        q_K=end_record.q_K,
        v_K=end_record.v_K,
        tension=tension,
        active=held,
        motion=derivatives.motion,
        tension_partials=derivatives.pull,
        settled=is_done & (edges < StepEdge.LAW_CHANGED.value),
        edges=edges,
        n_contacts=n_points,
        dt=dt,
        coordinates=marionette.coordinates,
        _driven=inputs.driven,
    )
    return Linearised(steps, end_record, is_shortened, derivatives.shares, derivatives.moved)


def held_rows(marionette: CompiledPuppet, tension: Array) -> MaskRows:
    """Mask (..., n_rows) of the rows held by steps with these tensions (..., n_rows)."""
    upper = np.minimum(marionette.max_forces, marionette.tension_cap)
    return marionette.two_sided | ((tension > 0.0) & (tension < SLIPPING_RATIO * upper))


def _time_steps(
    marionette: CompiledPuppet, options: RunOptions, inputs: StepInputs, threads: int
) -> LaneRecord:
    """Record of the steps of a puppet without contact."""
    library = marionette.libraries.lanes
    record = LaneRecord(len(inputs.x["q_D"]), library.sizes)
    record.begin(**inputs.x, slip=inputs.slip, p=inputs.p)
    steppers = LaneSteppers(library, record, threads, options, marionette.winches)
    steppers.advance(inputs.dt, inputs.acc_K, inputs.u_D)
    return record


def _variational(
    marionette: CompiledPuppet,
    derivatives: VariationalPartials,
    inputs: StepInputs,
    options: StepOptions,
) -> StepLinearisations:
    """Linearisations of variational steps."""
    t = marionette.coordinates
    is_selected = np.ones(derivatives.motion.shape[-1], dtype=bool)
    if not options.forces:
        first = 2 * t.n_vD + 3 * t.n_vK
        is_selected[first : first + t.n_vD] = False
    is_slipping = np.any(derivatives.tension >= SLIPPING_RATIO * marionette.max_forces, axis=1)
    zeros = np.zeros(len(derivatives.solved), dtype=np.int32)
    return StepLinearisations(
        **derivatives.end,
        tension=derivatives.tension,
        active=derivatives.held,
        motion=derivatives.motion[..., is_selected],
        tension_partials=derivatives.pull[..., is_selected] if options.tension_partials else None,
        settled=derivatives.solved & ~is_slipping,
        edges=zeros,
        n_contacts=zeros,
        dt=inputs.dt,
        coordinates=t,
        _driven=inputs.driven,
    )


def _repeated_rows(values: Array, n: int) -> Array:
    """Array (n, ...) of n rows, or of one repeated row."""
    return values if len(values) == n else np.broadcast_to(values, (n, values.shape[1]))


def _driven_steps(
    marionette: CompiledPuppet, v_K: Array, acc_K: Array, dt: float
) -> tuple[DrivenStep, ...]:
    """Driven coordinates over every step; empty without driven rotations."""
    quaternions = marionette.coordinates.quaternions_K
    if not quaternions:
        return ()
    accelerations = np.broadcast_to(acc_K, v_K.shape)
    return tuple(DrivenStep(quaternions, v, a, dt) for v, a in zip(v_K, accelerations, strict=True))


def _chain_rotations(
    marionette: CompiledPuppet, driven: tuple[DrivenStep, ...], columns: Array
) -> None:
    """Changes derivatives by rate and mean of driven rotations to those by v_K, acc_K, in place."""
    t = marionette.coordinates
    n, k = t.n_vD, t.n_vK
    for _, v in t.quaternions_K:
        by_v = slice(2 * n + k + v, 2 * n + k + v + 3)
        by_acc = slice(by_v.start + k, by_v.stop + k)
        for step, step_columns in zip(driven, columns, strict=True):
            rate, mean = step_columns[:, by_v].copy(), step_columns[:, by_acc].copy()
            mean_by_v, mean_by_acc = step.mean_by(slice(v, v + 3))
            step_columns[:, by_v] = rate + mean @ mean_by_v
            step_columns[:, by_acc] = 0.5 * step.dt * rate + mean @ mean_by_acc
