"""Derivatives of many time steps at once, compiled: what optimal control asks for at every node.

The equations are those of :mod:`fantoccini.dynamics.derivatives.step_linearisation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError, Status, check_positive
from fantoccini.dynamics.compiled import CompiledPuppet, refuse_contact, vectors
from fantoccini.dynamics.derivatives.step_linearisation import AT_CAP, SHORTENED, DrivenStep
from fantoccini.dynamics.derivatives.variational_partials import (
    VariationalPartials,
    variational_partials,
)
from fantoccini.kernel.contract import StepEdge
from fantoccini.kernel.runtime import (
    AnyArray,
    LaneSteppers,
    RunOptions,
    StepTouches,
    default_threads,
    step_touches,
)
from fantoccini.model.tree import CoordinateTable


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
        return tuple(edge.meaning for edge in StepEdge if self.edges[i] & edge)

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


def linearise_steps(
    marionette: CompiledPuppet,
    q_D: Array,
    v_D: Array,
    q_K: Array,
    v_K: Array,
    acc_K: Array | None = None,
    u_D: Array | None = None,
    *,
    p: Array | None = None,
    dt: float = 0.002,
    forces: bool = False,
    pull: bool = False,
    threads: int | None = None,
    method: str = "timestepping",
    room: Array | None = None,
) -> StepLinearisations:
    """One time step from each of n states; see :meth:`Marionette.linearise_steps`.

    ``room``, the ``motion`` of an earlier call, is written over where it has the right size.
    """
    check_positive(dt=dt)
    if method not in ("timestepping", "variational"):
        raise StateError(f"method is {method!r}; it must be 'timestepping' or 'variational'")
    table = marionette.coordinates
    widths = {"q_D": table.n_qD, "v_D": table.n_vD, "q_K": table.n_qK, "v_K": table.n_vK}
    given = zip(widths.items(), (q_D, v_D, q_K, v_K), strict=True)
    starts = {name: np.atleast_2d(vectors(name, a, n)) for (name, n), a in given}
    acc = np.zeros((1, table.n_vK)) if acc_K is None else vectors("acc_K", acc_K, table.n_vK)
    acc = np.atleast_2d(acc)
    force = None if u_D is None else np.atleast_2d(vectors("u_D", u_D, table.n_vD))
    values = marionette.p[None] if p is None else np.atleast_2d(vectors("p", p, len(marionette.p)))
    n = max(*map(len, starts.values()), len(acc), len(values), 1 if force is None else len(force))
    x = {name: _rows(a, n) for name, a in starts.items()}
    threads = default_threads() if threads is None else threads
    options = marionette.run_options(dt=dt, extrapolate=False)
    driven = _driven_steps(marionette, x["v_K"], acc, dt)
    along = {"rate": x["v_K"] + 0.5 * dt * acc, "mean": _rows(acc, n)}
    if table.quaternions_K:
        along = {k: np.array([getattr(one, k) for one in driven]) for k in along}
    if method == "variational":
        refuse_contact(marionette, "the method variational")
        discrete = variational_partials(marionette, x, acc, force, values, dt, threads)
        return _variational(marionette, discrete, driven, forces, pull, dt)
    made: _Lanes | StepTouches
    if options.contacts is None:
        own = _rows(values, n)
        touches, made = None, _Lanes.of(marionette, options, x, acc, force, own, threads)
    else:
        touches = made = step_touches(
            marionette.library,
            options,
            marionette.winches,
            marionette.reference_force,
            x | along,
            acc,
            force,
            values,
            threads,
        )
    tension = made.tension
    upper = np.minimum(marionette.upper, marionette.tension_cap)
    held = marionette.two_sided | ((tension > 0.0) & (tension < AT_CAP * upper))
    found = marionette.libraries.step_derivatives.find(
        {name: x[name] for name in ("q_D", "v_D", "q_K")} | {"tension": tension} | along,
        held,
        values,
        force,
        dt=dt,
        recovery_speed=options.recovery_speed,
        forces=forces,
        pull=pull,
        threads=threads,
        touches=touches,
        room=room,
    )
    _chain_rotations(marionette, driven, found.motion)
    if found.pull is not None:
        _chain_rotations(marionette, driven, found.pull)
    meant = x["v_D"] + dt * found.acc_D
    size = 1.0 + np.abs(made.v_D).max(axis=1, initial=0.0)
    apart = np.abs(meant - made.v_D).max(axis=1, initial=0.0)
    none = np.zeros(n, dtype=np.int32)
    edges, n_points = (none, none) if touches is None else (touches.edges, touches.n_points)
    ended = (made.status == Status.DONE.value) & (apart <= SHORTENED * size)
    return StepLinearisations(
        **{name: getattr(made, name) for name in widths},
        tension=tension,
        held=held,
        motion=found.motion,
        pull=found.pull,
        settled=ended & (edges < StepEdge.LEAVES_LAW.value),
        edges=edges,
        n_contacts=n_points,
        dt=dt,
        coordinates=table,
        _driven=driven,
    )


class _Lanes(NamedTuple):
    """n steps of a puppet without contact, made in lanes."""

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    tension: Array
    status: AnyArray

    @classmethod
    def of(
        cls,
        marionette: CompiledPuppet,
        options: RunOptions,
        x: Mapping[str, Array],
        acc_K: Array,
        u_D: Array | None,
        p: Array,
        threads: int,
    ) -> _Lanes:
        n, tree = len(p), marionette.tree
        made: dict[str, AnyArray] = {name: np.array(a, order="C") for name, a in x.items()} | {
            "fresh": np.ones(n, dtype=np.uint8),
            "p": np.ascontiguousarray(p),
            "slip": np.zeros((n, len(tree.strings))),
            "tension": np.zeros((n, tree.n_rows)),
            "taut": np.zeros((n, tree.n_rows), dtype=np.bool_),
            "books": np.zeros((n, 5)),
            "violation": np.zeros(n),
            "advanced": np.zeros(n),
            "status": np.zeros(n, dtype=np.int32),
            "blame": np.zeros((n, len(tree.blamable))),
        }
        lanes = marionette.libraries.lanes
        workers = max(1, min(threads, -(-n // lanes.width)))
        steppers = LaneSteppers(lanes, n, workers, options, marionette.winches)
        steppers.advance(made, options.dt, acc_K, u_D)
        return cls(*(made[name] for name in cls._fields))


def _variational(
    marionette: CompiledPuppet,
    found: VariationalPartials,
    driven: tuple[DrivenStep, ...],
    forces: bool,
    pull: bool,
    dt: float,
) -> StepLinearisations:
    """The results of variational steps."""
    t = marionette.coordinates
    kept = np.ones(found.motion.shape[-1], dtype=bool)
    if not forces:
        first = 2 * t.n_vD + 3 * t.n_vK
        kept[first : first + t.n_vD] = False
    slips = np.any(found.tension >= AT_CAP * marionette.upper, axis=1)
    none = np.zeros(len(found.solved), dtype=np.int32)
    return StepLinearisations(
        **found.end,
        tension=found.tension,
        held=found.held,
        motion=found.motion[..., kept],
        pull=found.pull[..., kept] if pull else None,
        settled=found.solved & ~slips,
        edges=none,
        n_contacts=none,
        dt=dt,
        coordinates=t,
        _driven=driven,
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
