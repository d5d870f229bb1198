"""Part (b): with exact tracking the full model's puppet moves as the mixed model's.

The mixed model gives the force that its inputs need, M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda
(its ``effort``); a drive of inertia J needs J acc_K more. These forces, as functions of time and
without feedback, move the full model's drives. The remaining difference is the integrators' error,
until velocities jump: at a catch the mixed model's v_K is continuous, while a drive takes part of
the impulse, in proportion to 1/J.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from benchmarks.section_vi.deviation import Deviation, deviation
from benchmarks.section_vi.mechanism import Mechanism
from benchmarks.section_vi.reference import IMPACTS, Reference

from fantoccini.base.arrays import Array
from fantoccini.base.errors import SimulationError
from fantoccini.dynamics.compiled import Event, Method, MethodName, as_method
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import EventKind, EventRecord, Input, Trajectory

METHODS: tuple[MethodName, ...] = ("event", "timestepping", "variational")
RTOL = (1e-6, 1e-8, 1e-10, 1e-12)
"""Tolerances of the event-driven runs that are compared."""
STEPS = (0.004, 0.002, 0.001)
"""Steps of the other methods [s], shortened so that one ends at the middle of the motion, where
the forces have a kink."""
RATIOS = (1.0, 10.0, 100.0, 1e3, 1e4)
"""Mass of a drive at catches, relative to the puppet's."""
_PIECE = 0.004
"""Duration of a quintic piece of the forces [s]."""
_NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(6)[0]
"""Interpolation nodes of a piece, 0 to 1."""
_AFTER = 0.5
"""Duration of the compared motion after a catch, relative to sqrt(l/g)."""
_SAMPLES = 200
"""Times at which two motions are compared."""
_SAME_TIME = 1e-12
"""Samples closer than this are those before and after one event [s]."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The full model compared with the mixed one, both by the same method.

    Attributes:
        method: method of both.
        setting: tolerance, or step [s].
        deviation: deviation of the full model.
    """

    method: str
    setting: float
    deviation: Deviation


@dataclass(frozen=True)
class SharedCatch:
    """A catch in the full model compared with the same one in the mixed model.

    Attributes:
        ratio: mass of a drive, relative to the puppet's.
        string: string that catches.
        impulse, mixed_impulse: impulses in the full and the mixed model [N s].
        jump: |dv_D - dv_D,mixed| / |dv_D,mixed|, dv_D the jump of the puppet's velocity, in the
            metric of M_DD.
        after: largest difference of the puppet's configuration a while later [m or rad].
    """

    ratio: float
    string: str
    impulse: float
    mixed_impulse: float
    jump: float
    after: float


def tracking_forces(
    mechanism: Mechanism, full: Marionette, reference: Reference, ratio: float
) -> Input:
    """The forces of exact tracking, u_M = effort + J acc_K, as quintic pieces in time.

    Args:
        mechanism: the puppet.
        full: it on drives without control.
        reference: motion of the mixed model.
        ratio: mass of a drive, relative to the puppet's.
    """
    start, end = reference.x0.t, float(reference.run.t[-1])
    breaks = [e.t for e in reference.run.events] + reference.inputs.breaks.tolist()
    edges = np.unique(np.clip([start, *breaks, end], start, end))
    edges = edges[np.append(True, np.diff(edges) > 1e-9)]
    cuts = [np.linspace(a, b, int(np.ceil((b - a) / _PIECE)) + 1)[:-1] for a, b in pairwise(edges)]
    times = np.append(np.concatenate(cuts), end)
    width = np.diff(times)
    nodes = (times[:-1, None] + width[:, None] * _NODES).ravel()
    run = simulate(
        mechanism.mixed,
        reference.x0,
        reference.inputs,
        end,
        method=Event(rtol=1e-12, atol=1e-12),
        save_at=nodes,
    )
    assert run.effort is not None
    at = np.searchsorted(run.t, nodes - _SAME_TIME)
    needed = run.effort.values[at] + mechanism.inertia(ratio) * run.acc_K[at]
    powers = np.vander(_NODES, 6, increasing=True)
    coef = np.linalg.solve(powers, needed.reshape(len(width), 6, -1))
    coef = coef / width[:, None, None] ** np.arange(6)[:, None]
    table, own = full.coordinates, mechanism.mixed.coordinates.v_K
    force = np.zeros((len(width), table.n_vD, 6))
    force[:, [table.v_D.index(name) for name in own]] = np.swapaxes(coef, 1, 2)
    hold = Input.hold(full)
    n = len(width)
    return replace(
        hold,
        breaks=times,
        coef=np.tile(hold.coef[:1], (n, 1, 1)),
        base=np.tile(hold.base[:1], (n, 1)),
        force=force,
    )


def compare(
    mechanism: Mechanism,
    full: Marionette,
    reference: Reference,
    methods: tuple[MethodName, ...] = METHODS,
) -> tuple[list[Comparison], list[str]]:
    """Both models up to the first catch, at several tolerances and steps.

    Args:
        mechanism: the puppet.
        full: it on drives without control, as heavy as the puppet.
        reference: motion of the mixed model.
        methods: methods of both.

    Returns:
        The comparisons, and the runs that stopped, in words.
    """
    inputs = tracking_forces(mechanism, full, reference, 1.0)
    x_full = mechanism.full_state(full, reference.x0)
    comparisons, stopped = [], []
    half, end = 0.5 * reference.inputs.duration, reference.first_impact
    settings: list[tuple[Method, float]] = []
    for name in methods:
        if name == "event":
            settings += [(Event(rtol=r, atol=r), r) for r in RTOL]
        else:
            steps = [half / np.ceil(half / dt) for dt in STEPS]
            settings += [(as_method(name, dt=dt), dt) for dt in steps]
    for method, setting in settings:
        by_events = isinstance(method, Event)
        if not by_events and end - reference.x0.t < 4 * setting:
            continue
        save_at = np.linspace(reference.x0.t, end, _SAMPLES)[1:-1] if by_events else None
        try:
            mixed, other = (
                simulate(puppet, x, driven, end, method=method, save_at=save_at)
                for puppet, x, driven in (
                    (mechanism.mixed, reference.x0, reference.inputs),
                    (full, x_full, inputs),
                )
            )
        except SimulationError as error:
            stopped.append(f"{method.name} at {setting:.3g}: {error}")
            continue
        apart = deviation(mechanism, mixed, other, _SAMPLES)
        comparisons.append(Comparison(method.name, setting, apart))
    return comparisons, stopped


def shared_catches(
    mechanism: Mechanism, full: Marionette, reference: Reference
) -> list[SharedCatch]:
    """The first catch of a string that reaches a drive, with increasingly heavy drives.

    Args:
        mechanism: the puppet.
        full: it on drives without control.
        reference: motion of the mixed model, with a catch.
    """
    first = _first_catch(mechanism, reference)
    end = min(reference.inputs.end, first.t + _AFTER * mechanism.time_scale)
    method = Event(rtol=1e-11, atol=1e-11)
    mixed = simulate(mechanism.mixed, reference.x0, reference.inputs, end, method=method)
    catches = []
    for ratio in RATIOS:
        heavy = mechanism.with_drives(full, ratio)
        inputs = tracking_forces(mechanism, heavy, replace(reference, run=mixed), ratio)
        x = mechanism.full_state(heavy, reference.x0)
        other = simulate(heavy, x, inputs, end, method=method)
        catches.append(_shared_catch(mechanism, heavy, ratio, first, mixed, other))
    return catches


def _first_catch(mechanism: Mechanism, reference: Reference) -> EventRecord:
    """The first catch of a string whose length or end moves; else the first impact."""
    impacts = [e for e in reference.run.events if e.kind in IMPACTS]
    reaches = np.any(mechanism.mixed.A_K(reference.x0) != 0.0, axis=1)
    names = {n for n, r in zip(mechanism.mixed.tree.row_names, reaches, strict=True) if r}
    catches = [e for e in impacts if e.kind is EventKind.CATCH and e.name in names]
    return (catches or impacts)[0]


def _shared_catch(
    mechanism: Mechanism,
    full: Marionette,
    ratio: float,
    first: EventRecord,
    mixed: Trajectory,
    other: Trajectory,
) -> SharedCatch:
    name = first.name
    first = next(e for e in mixed.events if e.kind in IMPACTS and e.name == name)
    same = next((e for e in other.events if e.kind in IMPACTS and e.name == name), None)
    if same is None:
        return SharedCatch(ratio, name, 0.0, first.impulse, np.nan, np.nan)
    own = [full.coordinates.v_D.index(n) for n in mechanism.mixed.coordinates.v_D]
    there, here = _jump(other, same.t)[own], _jump(mixed, first.t)
    M = mechanism.mixed.mass_matrix(mixed.at(first.t))
    size = np.sqrt([j @ M @ j for j in (there - here, here)])
    after = deviation(mechanism, mixed, other, _SAMPLES).max_puppet
    jump = float(size[0] / size[1])
    return SharedCatch(ratio, name, same.impulse, first.impulse, jump, after)


def _jump(run: Trajectory, t: float) -> Array:
    """(n_vD,) jump of the velocities at an event."""
    at = np.flatnonzero(np.abs(run.t - t) < _SAME_TIME)
    return run.v_D[at[-1]] - run.v_D[at[0]]
