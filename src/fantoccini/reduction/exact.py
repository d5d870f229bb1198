"""Part (b): with exact tracking the full model's puppet moves as the mixed model's.

The mixed model gives the force that its inputs need, M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda
(its ``effort``); a drive of inertia J needs J acc_K more. These forces, as functions of time and
without any control, move the full model's drives. What differs then is the integrators' error,
until velocities jump: at a catch the mixed model's v_K is continuous, while a drive takes its part
of the blow, which goes with 1/J.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import SimulationError
from fantoccini.marionette import Event, Marionette, as_method
from fantoccini.motion import EventKind, EventRecord, Input, Trajectory
from fantoccini.reduction.mechanism import Mechanism
from fantoccini.reduction.motions import IMPACTS, Motion
from fantoccini.simulation import simulate

METHODS = ("event", "timestepping", "variational")
RTOL = (1e-6, 1e-8, 1e-10, 1e-12)
"""Tolerances of the event-driven runs that are compared."""
STEPS = (0.004, 0.002, 0.001)
"""Steps of the other methods [s], shortened so that the middle of the motion is at one's end: there
the forces have a kink."""
RATIOS = (1.0, 10.0, 100.0, 1e3, 1e4)
"""Mass of a drive over that of the puppet, at catches."""
_PIECE = 0.004
"""Duration of a quintic piece of the forces [s]."""
_NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(6)[0]
"""Where in a piece the forces are taken."""
_AFTER = 0.5
"""How long a motion is followed after a catch, over sqrt(l/g)."""


@dataclass(frozen=True, eq=False)
class Compared:
    """The full model beside the mixed one, both by the same method.

    Attributes:
        method: of both.
        step: tolerance, or step [s].
        t: (T,) times [s].
        puppet, mechanism: (T,) largest difference of a coordinate of the puppet, of the drives
            [m or rad].
    """

    method: str
    step: float
    t: Array
    puppet: Array
    mechanism: Array

    @property
    def worst(self) -> tuple[float, float]:
        """Largest differences of the puppet and of the mechanism."""
        return float(np.max(self.puppet)), float(np.max(self.mechanism))


@dataclass(frozen=True)
class Caught:
    """A catch in the full model beside the same one in the mixed model.

    Attributes:
        ratio: mass of a drive over that of the puppet.
        string: what catches.
        impulse, mixed_impulse: of it [N s].
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


def forces(mechanism: Mechanism, full: Marionette, motion: Motion, ratio: float) -> Input:
    """The forces of exact tracking, u_M = effort + J acc_K, as quintic pieces in time.

    Args:
        mechanism: the puppet.
        full: it on drives without control.
        motion: of the mixed model.
        ratio: mass of a drive over that of the puppet.
    """
    start, end = motion.x0.t, float(motion.run.t[-1])
    smooth = [e.t for e in motion.run.events] + motion.inputs.breaks.tolist()
    edges = np.unique(np.clip([start, *smooth, end], start, end))
    edges = edges[np.append(True, np.diff(edges) > 1e-9)]
    cuts = [
        np.linspace(a, b, int(np.ceil((b - a) / _PIECE)) + 1)[:-1]
        for a, b in pairwise(edges)
    ]
    breaks = np.append(np.concatenate(cuts), end)
    width = np.diff(breaks)
    times = (breaks[:-1, None] + width[:, None] * _NODES).ravel()
    run = simulate(
        mechanism.mixed,
        motion.x0,
        motion.inputs,
        end,
        method=Event(rtol=1e-12, atol=1e-12),
        save_at=times,
    )
    at = np.searchsorted(run.t, times - 1e-12)
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
        hold, breaks=breaks, coef=np.tile(hold.coef[:1], (n, 1, 1)),
        base=np.tile(hold.base[:1], (n, 1)), force=force,
    )  # fmt: skip


def compared(
    mechanism: Mechanism, full: Marionette, motion: Motion, methods: tuple[str, ...] = METHODS
) -> tuple[list[Compared], list[str]]:
    """Both models up to the first catch, at several tolerances and steps.

    Args:
        mechanism: the puppet.
        full: it on drives without control, as heavy as the puppet.
        motion: of the mixed model.
        methods: of both.

    Returns:
        The comparisons, and what could not be run, in words.
    """
    inputs = forces(mechanism, full, motion, 1.0)
    x_full = mechanism.state(full, motion.x0)
    found, stopped = [], []
    settings = [("event", {"rtol": r, "atol": r}, r) for r in RTOL if "event" in methods]
    half, end = 0.5 * motion.inputs.duration, motion.ends
    steps = [half / np.ceil(half / dt) for dt in STEPS]
    settings += [(m, {"dt": dt}, dt) for m in methods if m != "event" for dt in steps]
    for method, options, step in settings:
        save_at = np.linspace(motion.x0.t, end, 200)[1:-1] if method == "event" else None
        if method != "event" and end - motion.x0.t < 4 * step:
            continue
        chosen = as_method(method, **options)
        try:
            mixed, other = (
                simulate(puppet, x, moves, end, method=chosen, save_at=save_at)
                for puppet, x, moves in (
                    (mechanism.mixed, motion.x0, motion.inputs), (full, x_full, inputs)
                )
            )  # fmt: skip
        except SimulationError as error:
            stopped.append(f"{method} at {step:.3g}: {error}")
            continue
        found.append(Compared(method, step, *_apart(mechanism, mixed, other)))
    return found, stopped


def caught(mechanism: Mechanism, full: Marionette, motion: Motion) -> list[Caught]:
    """The first catch of a string that reaches a drive, with drives of more and more inertia.

    Args:
        mechanism: the puppet.
        full: it on drives without control.
        motion: of the mixed model, with a catch.
    """
    first = _first(mechanism, motion)
    end = min(motion.inputs.end, first.t + _AFTER * mechanism.pace)
    options = {"method": Event(rtol=1e-11, atol=1e-11)}
    mixed = simulate(mechanism.mixed, motion.x0, motion.inputs, end, **options)
    found = []
    for ratio in RATIOS:
        heavy = mechanism.tuned(full, ratio)
        inputs = forces(mechanism, heavy, replace(motion, run=mixed), ratio)
        x = mechanism.state(heavy, motion.x0)
        other = simulate(heavy, x, inputs, end, **options)
        found.append(_catch(mechanism, heavy, ratio, first.name, mixed, other))
    return found


def _first(mechanism: Mechanism, motion: Motion) -> EventRecord:
    """The first catch of a string whose length or end moves; else the first impact there is."""
    impacts = [e for e in motion.run.events if e.kind in IMPACTS]
    reaches = np.any(mechanism.mixed.A_K(motion.x0) != 0.0, axis=1)
    names = {n for n, r in zip(mechanism.mixed.tree.row_names, reaches, strict=True) if r}
    catches = [e for e in impacts if e.kind is EventKind.CATCH and e.name in names]
    return (catches or impacts)[0]


def _catch(
    mechanism: Mechanism,
    full: Marionette,
    ratio: float,
    name: str,
    mixed: Trajectory,
    other: Trajectory,
) -> Caught:
    first, same = (
        next((e for e in run.events if e.kind in IMPACTS and e.name == name), None)
        for run in (mixed, other)
    )
    if same is None:
        return Caught(ratio, first.name, 0.0, first.impulse, np.nan, np.nan)
    names = [full.coordinates.v_D.index(n) for n in mechanism.mixed.coordinates.v_D]
    jumps = []
    for run, event, own in ((mixed, first, slice(None)), (other, same, names)):
        rows = np.flatnonzero(np.abs(run.t - event.t) < 1e-12)
        jumps.append((run.v_D[rows[-1]] - run.v_D[rows[0]])[own])
    M = mechanism.mixed.mass_matrix(mixed.at(first.t))
    size = np.sqrt([j @ M @ j for j in (jumps[1] - jumps[0], jumps[0])])
    after = _apart(mechanism, mixed, other)[1]
    return Caught(
        ratio, first.name, same.impulse, first.impulse, float(size[0] / size[1]),
        float(np.max(after)),
    )  # fmt: skip


def _apart(
    mechanism: Mechanism, mixed: Trajectory, other: Trajectory
) -> tuple[Array, Array, Array]:
    """Times, and how far the two motions are apart: puppet and mechanism."""
    times = np.linspace(mixed.t[0], min(mixed.t[-1], other.t[-1]), 200)
    away = mechanism.away(mixed.resample(times), other.resample(times))
    return times, *(np.max(np.abs(part), axis=1, initial=0.0) for part in away)
