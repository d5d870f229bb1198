"""The linearisation of time steps, compiled, with the active sets that the steps find.

With rate = dq_K/dt and mean = dv_K/dt over the step, damping and drag F implicit, and the rows in
Lambda > 0 (``cpp/fantoccini/timestepping/step.hpp``):

    (M + dt F) (v+ - v) + dt (c(q, v, q_K, rate) + M_DK mean - u_D) + A_D^T Lambda = 0
    A_D v+ + A_K rate + min(h/dt, recovery speed) = 0,      q+ = q moved by dt v+

with contacts in their modes beside the rows (``contact_rows``), are differentiated with M, A and c
at the step's start. It is the first step of a stepper: later in
a run c takes its velocity products half a step ahead, extrapolated from earlier steps, which are no
part of a state. That changes dv+ by dt^2/2 times the products' derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, TypedDict

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError, Status, check_positive
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

SHORTENED = 1e-9
"""Relative difference between the step's velocity and its equations' at which it was cut short."""
AT_CAP = 1.0 - 1e-9
"""Share of its largest tension from which a string counts as at its largest tension."""


@dataclass(frozen=True, eq=False)
class StepLinearisations:
    """n time steps and their derivatives, as those of :class:`StepLinearisation`.

    Attributes:
        q_D, v_D, q_K, v_K: (n, ...) the states after the steps.
        tension: (n, n_rows) impulses over dt [N or N m].
        held: (n, n_rows) bool, strings and limits held in the steps.
        motion: (n, 2 n_vD, m) derivatives of (dq_D, v_D) after the step by q_D, v_D, q_K, v_K,
            acc_K, u_D where asked for, and p: the rows of A, B, B_u and B_p that are not those of
            the driven coordinates.
        pull: (n, n_rows, m) derivatives of ``tension``, where asked for; 0 for rows not held.
        settled: (n,) bool, steps that were made and not cut short, and whose contacts have
            derivatives; the others' are those of the equations, not of the step.
        edges: (n,) what is between two modes of contact, as bits; see :meth:`edges_of`.
        n_contacts: (n,) points that push.
        dt: length of the steps [s].
        coordinates: names and places of the coordinates.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    tension: Array
    held: MaskRows
    motion: Array
    pull: Array | None
    settled: MaskRows
    edges: Indices
    n_contacts: Indices
    dt: float
    coordinates: CoordinateTable
    _driven: tuple[DrivenStep, ...]

    def __len__(self) -> int:
        return len(self.q_D)

    @property
    def sharp(self) -> MaskRows:
        """(n,) bool, whether the derivatives exist towards all sides: nothing is between modes."""
        return self.settled & (self.edges == 0)

    def edges_of(self, i: int) -> tuple[str, ...]:
        """What step i is on the edge of; its derivatives are those of the modes taken."""
        return StepEdge.meanings(int(self.edges[i]))

    @cached_property
    def A(self) -> Array:
        """(n, n_z, n_z): z = (dq_D, dv_D, dq_K, dv_K) after the step by that before it."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        A = np.zeros((len(self), 2 * (n + k), 2 * (n + k)))
        A[:, : 2 * n] = self.motion[..., : 2 * (n + k)]
        A[:, 2 * n :, 2 * n :] = self.driven[..., : 2 * k]
        return A

    @cached_property
    def B(self) -> Array:
        """(n, n_z, n_vK): by the driven accelerations."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        B = np.zeros((len(self), 2 * (n + k), k))
        B[:, : 2 * n] = self.motion[..., 2 * (n + k) : 2 * n + 3 * k]
        B[:, 2 * n :] = self.driven[..., 2 * k :]
        return B

    @cached_property
    def driven(self) -> Array:
        """(n or 1, 2 n_vK, 3 n_vK): (dq_K, dv_K) after the steps by q_K, v_K and acc_K."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        steps = self._driven or (DrivenStep((), np.zeros(k), np.zeros(k), self.dt),)
        return np.array([one.state(n, 0)[:, 2 * n : 2 * n + 3 * k] for one in steps])


@dataclass(frozen=True)
class StepOptions:
    """Options of linearised time steps.

    Attributes:
        forces: differentiate by the user's forces, too.
        pull: also the tensions' derivatives.
        threads: all processors when not given.
        method: ``"timestepping"``, or ``"variational"`` for steps of that method, in which no
            driven joint turns.

    Raises:
        StateError: an unknown method.
    """

    forces: bool = False
    pull: bool = False
    threads: int | None = None
    method: Literal["timestepping", "variational"] = "timestepping"

    def __post_init__(self) -> None:
        if self.method not in ("timestepping", "variational"):
            text = f"method is {self.method!r}; it must be 'timestepping' or 'variational'"
            raise StateError(text)


class StepKeywords(TypedDict, total=False):
    """The fields of :class:`StepOptions` as keyword arguments."""

    forces: bool
    pull: bool
    threads: int | None
    method: Literal["timestepping", "variational"]


def linearise_steps(
    marionette: CompiledPuppet,
    given: StepInputs,
    options: StepOptions | None = None,
    room: Array | None = None,
) -> StepLinearisations:
    """One time step from each of n states; see :meth:`Marionette.linearise_steps`.

    Args:
        marionette: the puppet.
        given: the steps.
        options: see :class:`StepOptions`.
        room: the ``motion`` of an earlier call, written over where it has the right size.
    """
    options = options or StepOptions()
    if options.method == "timestepping":
        return linearised(marionette, given, options, room=room).steps
    refuse_contact(marionette, "the method variational")
    made = variational_partials(
        marionette, given.x, given.acc_K, given.u_D, given.p, given.dt, _threads(options)
    )
    return _variational(marionette, made, given, options)


def _threads(options: StepOptions) -> int:
    return default_threads() if options.threads is None else options.threads


class StepInputs(NamedTuple):
    """n time steps to be made.

    Attributes:
        x: q_D, v_D, q_K and v_K, (n, ...) each, before the steps.
        slip: (n, n_strings) what the winches have let out by then [m].
        acc_K: (1 or n, n_vK) driven accelerations.
        u_D: (1 or n, n_vD) user forces; None for none.
        p: (1 or n, n_p) parameters.
        dt: length of the steps [s].
        driven: the driven coordinates over every step; none where nothing turns.
    """

    x: dict[str, Array]
    slip: Array
    acc_K: Array
    u_D: Array | None
    p: Array
    dt: float
    driven: tuple[DrivenStep, ...]

    @classmethod
    def of(
        cls,
        marionette: CompiledPuppet,
        motion: tuple[Array, Array, Array, Array],
        acc_K: Array | None = None,
        u_D: Array | None = None,
        p: Array | None = None,
        dt: float = 0.002,
        slip: Array | None = None,
    ) -> StepInputs:
        """From the states (n, ...) or (...,), of which q_D, v_D, q_K and v_K are ``motion``."""
        check_positive(dt=dt)
        t = marionette.coordinates
        widths = {"q_D": t.n_qD, "v_D": t.n_vD, "q_K": t.n_qK, "v_K": t.n_vK}
        given = zip(widths.items(), motion, strict=True)
        starts = {name: np.atleast_2d(vectors(name, a, width)) for (name, width), a in given}
        acc = np.zeros((1, t.n_vK)) if acc_K is None else vectors("acc_K", acc_K, t.n_vK)
        acc = np.atleast_2d(acc)
        force = None if u_D is None else np.atleast_2d(vectors("u_D", u_D, t.n_vD))
        values = (
            marionette.p[None] if p is None else np.atleast_2d(vectors("p", p, len(marionette.p)))
        )
        n = max(map(len, (*starts.values(), acc, values, () if force is None else force)))
        x = {name: _rows(a, n) for name, a in starts.items()}
        none = np.zeros((n, len(marionette.tree.strings)))
        slips = none if slip is None or not len(slip) else none + slip
        driven = _driven_steps(marionette, x["v_K"], acc, dt)
        return cls(x, slips, acc, force, values, dt, driven)

    @property
    def along(self) -> dict[str, Array]:
        """(n, n_vK) ``rate``, dq_K/dt over the steps, and ``mean``, dv_K/dt."""
        if self.driven:
            return {k: np.array([getattr(one, k) for one in self.driven]) for k in ("rate", "mean")}
        v_K, acc = self.x["v_K"], self.acc_K
        return {"rate": v_K + 0.5 * self.dt * acc, "mean": _rows(acc, len(v_K))}


class Linearised(NamedTuple):
    """Time steps with all that was found beside their linearisations.

    Attributes:
        steps: the linearisations.
        made: the steps: of puppets without contact, and with it.
        shortened: (n,) bool, steps that were cut short.
        shares: (n, 3 room, m) derivatives of the multipliers of what touches, if asked for.
        moved: (n, n_vD + n_vK, m) those of the configuration where what springs back touches,
            likewise, of steps in which something does.
    """

    steps: StepLinearisations
    made: LaneRecord | StepTouches
    shortened: MaskRows
    shares: Array | None
    moved: Array | None


def linearised(
    marionette: CompiledPuppet,
    given: StepInputs,
    options: StepOptions,
    *,
    shares: bool = False,
    room: Array | None = None,
) -> Linearised:
    """Time steps of the time-stepper and their derivatives; see :func:`linearise_steps`."""
    x, along, dt, threads = given.x, given.along, given.dt, _threads(options)
    stepping = marionette.run_options(dt=dt, extrapolate=False)
    made: LaneRecord | StepTouches
    if stepping.contacts is None:
        touches, made = None, _made(marionette, stepping, given, threads)
    else:
        touches = made = step_touches(
            marionette.library,
            stepping,
            marionette.winches,
            marionette.reference_force,
            x | along | {"slip": given.slip},
            given.acc_K,
            given.u_D,
            given.p,
            threads,
        )
    tension = made.tension
    held = held_rows(marionette, tension)
    found = marionette.libraries.step_derivatives.find(
        {name: x[name] for name in ("q_D", "v_D", "q_K")}
        | {"slip": given.slip, "tension": tension}
        | along,
        held,
        # Beyond the puppet's cap of tensions, a winch's largest tension is never reached.
        np.where(marionette.upper <= marionette.tension_cap, marionette.cap_parameters, -1),
        given.p,
        given.u_D,
        dt=dt,
        recovery_speed=stepping.recovery_speed,
        forces=options.forces,
        pull=options.pull,
        shares=shares,
        threads=threads,
        touches=touches,
        room=room,
    )
    for columns in (found.motion, found.pull, found.shares, found.moved):
        if columns is not None:
            _chain_rotations(marionette, given.driven, columns)
    meant = x["v_D"] + dt * found.acc_D
    size = 1.0 + np.abs(made.v_D).max(axis=1, initial=0.0)
    shortened = ~(np.abs(meant - made.v_D).max(axis=1, initial=0.0) <= SHORTENED * size)
    none = np.zeros(len(held), dtype=np.int32)
    edges, n_points = (none, none) if touches is None else (touches.edges, touches.n_points)
    ended = (made.status == Status.DONE.value) & ~shortened
    steps = StepLinearisations(
        q_D=made.q_D,
        v_D=made.v_D,
        q_K=made.q_K,
        v_K=made.v_K,
        tension=tension,
        held=held,
        motion=found.motion,
        pull=found.pull,
        settled=ended & (edges < StepEdge.LEAVES_LAW.value),
        edges=edges,
        n_contacts=n_points,
        dt=dt,
        coordinates=marionette.coordinates,
        _driven=given.driven,
    )
    return Linearised(steps, made, shortened, found.shares, found.moved)


def held_rows(marionette: CompiledPuppet, tension: Array) -> MaskRows:
    """(..., n_rows) bool, the rows that steps with these tensions (..., n_rows) hold."""
    upper = np.minimum(marionette.upper, marionette.tension_cap)
    return marionette.two_sided | ((tension > 0.0) & (tension < AT_CAP * upper))


def _made(
    marionette: CompiledPuppet, options: RunOptions, given: StepInputs, threads: int
) -> LaneRecord:
    """The steps of a puppet without contact."""
    library = marionette.libraries.lanes
    record = LaneRecord(len(given.x["q_D"]), library.sizes)
    record.begin(**given.x, slip=given.slip, p=given.p)
    steppers = LaneSteppers(library, record, threads, options, marionette.winches)
    steppers.advance(given.dt, given.acc_K, given.u_D)
    return record


def _variational(
    marionette: CompiledPuppet, found: VariationalPartials, given: StepInputs, options: StepOptions
) -> StepLinearisations:
    """The results of variational steps."""
    t = marionette.coordinates
    kept = np.ones(found.motion.shape[-1], dtype=bool)
    if not options.forces:
        first = 2 * t.n_vD + 3 * t.n_vK
        kept[first : first + t.n_vD] = False
    slips = np.any(found.tension >= AT_CAP * marionette.upper, axis=1)
    none = np.zeros(len(found.solved), dtype=np.int32)
    return StepLinearisations(
        **found.end,
        tension=found.tension,
        held=found.held,
        motion=found.motion[..., kept],
        pull=found.pull[..., kept] if options.pull else None,
        settled=found.solved & ~slips,
        edges=none,
        n_contacts=none,
        dt=given.dt,
        coordinates=t,
        _driven=given.driven,
    )


def _rows(rows: Array, n: int) -> Array:
    """(n, ...) of n rows, or of one."""
    return rows if len(rows) == n else np.broadcast_to(rows, (n, rows.shape[1]))


def _driven_steps(
    marionette: CompiledPuppet, v_K: Array, acc_K: Array, dt: float
) -> tuple[DrivenStep, ...]:
    """The driven coordinates over every step; none where nothing turns."""
    quaternions = marionette.coordinates.quaternions_K
    if not quaternions:
        return ()
    rows = np.broadcast_to(acc_K, v_K.shape)
    return tuple(DrivenStep(quaternions, v, a, dt) for v, a in zip(v_K, rows, strict=True))


def _chain_rotations(
    marionette: CompiledPuppet, driven: tuple[DrivenStep, ...], columns: Array
) -> None:
    """From derivatives by rate and mean of driven rotations to those by v_K and acc_K, in place."""
    t = marionette.coordinates
    n, k = t.n_vD, t.n_vK
    for _, v in t.quaternions_K:
        by_v = slice(2 * n + k + v, 2 * n + k + v + 3)
        by_acc = slice(by_v.start + k, by_v.stop + k)
        for one, part in zip(driven, columns, strict=True):
            rate, mean = part[:, by_v].copy(), part[:, by_acc].copy()
            mean_by_v, mean_by_acc = one.mean_by(slice(v, v + 3))
            part[:, by_v] = rate + mean @ mean_by_v
            part[:, by_acc] = 0.5 * one.dt * rate + mean @ mean_by_acc
