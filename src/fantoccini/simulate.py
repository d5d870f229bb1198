"""simulate: a marionette, a start state and inputs -> Trajectory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import SimulationError, StateError, Status
from fantoccini.marionette import Marionette
from fantoccini.motion import Columns, Event, EventKind, Input, State, Trajectory
from fantoccini.motion.trajectory import LEDGER
from fantoccini.runtime import Run

_PIECE = 0.05
"""Simulated time between two calls of the progress function [s]."""

_KINDS = (EventKind.CATCH, EventKind.RELEASE, EventKind.ACCUMULATION, EventKind.BREAKPOINT)
_LIMIT_KINDS = {EventKind.CATCH: EventKind.LIMIT_ON, EventKind.RELEASE: EventKind.LIMIT_OFF}


def simulate(
    marionette: Marionette,
    x0: State,
    inputs: Input | None = None,
    t_end: float | None = None,
    *,
    method: Literal["event", "timestepping"] = "event",
    rtol: float = 1e-9,
    atol: float = 1e-9,
    max_step: float = 0.1,
    dt: float = 0.002,
    save_at: Array | None = None,
    save_every: int = 1,
    effort: bool = True,
    progress: Callable[[float], None] | None = None,
    throw: bool = True,
) -> Trajectory:
    """M_DD acc_D + M_DK acc_K + c = u_D + A_D^T lambda, with strings that only pull.

    Between events the taut strings hold (Eqs. 10-12); where one releases or snaps taut the run
    stops, the impulse acts (Eqs. 13-15) and the mode is chosen anew (Sec. IV).

    Args:
        marionette: the puppet.
        x0: where it starts; no string may be longer than its length.
        inputs: what the driven coordinates do; they hold still when not given. Times are absolute:
            the run starts at ``x0.t``.
        t_end: end of the run [s]; the end of the inputs when not given.
        method: ``event``: adaptive order 8 with located events. ``timestepping``: fixed step, for
            interaction, planning and batches.
        rtol, atol: tolerances of the event-driven integrator.
        max_step: its largest step [s].
        dt: step of the time-stepper [s].
        save_at: (n,) times to write, next to those of events (event-driven only) [s]; every step
            when not given.
        save_every: write every so many steps (time-stepping only).
        effort: compute the force on every driven coordinate.
        progress: called with the time reached, for a progress bar [s].
        throw: raise when the run stops before its end; otherwise the status tells.

    Returns:
        The trajectory.

    Raises:
        StateError: ``x0`` breaks a string or limit; ``marionette.project(x0)`` repairs it.
        InputError: the inputs do not start where ``x0`` is.
        SimulationError: the run stopped; the error carries the trajectory so far.
    """
    if method not in ("event", "timestepping"):
        raise ValueError(f"method is {method!r}; it must be 'event' or 'timestepping'")
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    t_end = inputs.end if t_end is None else float(t_end)
    if not np.isfinite(t_end) or not t_end > x0.t:
        raise ValueError(f"t_end is {t_end}; it must be later than the start at {x0.t}")
    for name, value in (("rtol", rtol), ("atol", atol), ("max_step", max_step), ("dt", dt)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value}; it must be positive")
    bound = inputs.bound(x0.q_K, x0.t)
    start = x0.replace(v_K=bound.evaluate(x0.t)[1])
    _check_velocity(marionette, x0, start)
    marionette.check_start(start)
    options = marionette.run_options(
        rtol=rtol, atol=atol, max_step=max_step, dt=dt, save_steps=save_at is None,
        save_every=save_every,
    )  # fmt: skip
    run = Run(
        marionette.library, method, options, x0.t, x0.q_D, x0.v_D, marionette.p, bound, save_at
    )
    rows, events = [], []
    status = _collect(run, x0.t, t_end, progress, rows, events)
    made = _trajectory(
        marionette, np.concatenate(rows), np.concatenate(events), status, method, effort
    )
    if status is not Status.DONE and throw:
        raise SimulationError(status, f"at t = {made.t[-1]:.6g} s", made)
    return made


def _check_velocity(marionette: Marionette, x0: State, start: State) -> None:
    apart = np.abs(start.v_K - x0.v_K)
    wrong = np.flatnonzero(apart > 1e-9 * np.maximum(1.0, np.abs(x0.v_K)))
    if len(wrong):
        names = [marionette.coordinates.v_K[i] for i in wrong]
        raise StateError(
            f"the velocity of {', '.join(names)} would jump at the start: the state has "
            f"{x0.v_K[wrong[0]]:.6g}, the inputs begin with {start.v_K[wrong[0]]:.6g}"
        )


def _collect(run: Run, t: float, t_end: float, progress, rows: list, events: list) -> Status:
    """Advances piece by piece; Ctrl-C keeps what was reached."""
    n = max(1, int(np.ceil((t_end - t) / _PIECE))) if progress else 1
    try:
        for target in np.linspace(t, t_end, n + 1)[1:]:
            for some_rows, some_events in run.advance(float(target)):
                rows.append(some_rows)
                events.append(some_events)
            if run.status is not Status.DONE:
                break
            if progress:
                progress(float(target))
    except KeyboardInterrupt:
        return Status.STOPPED
    return run.status


def _trajectory(
    marionette: Marionette,
    rows: Array,
    events: Array,
    status: Status,
    method: str,
    with_effort: bool,
) -> Trajectory:
    tree = marionette.tree
    part = marionette.row_layout.split(rows)
    n_strings = len(tree.strings)
    strings = tuple(s.name for s in tree.strings)
    limits = tuple(limit.name for limit in tree.limits)
    tension = part["tension"][:, :n_strings]
    effort = None
    if with_effort:
        moved = (part[name] for name in ("q_D", "v_D", "q_K", "v_K", "acc_D", "acc_K"))
        effort = Columns(
            marionette.coordinates.v_K, marionette.effort(*moved, tension), "driven velocity"
        )
    return Trajectory(
        **{name: part[name] for name in ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")},
        tension=Columns(strings, tension, "string"),
        limit_force=Columns(limits, part["tension"][:, n_strings:], "limit"),
        taut=Columns(strings, part["taut"][:, :n_strings] > 0, "string"),
        ledger=_ledger(part),
        events=tuple(_event(tree, row, n_strings) for row in events),
        status=status,
        method=method,
        coordinates=marionette.coordinates,
        puppet=marionette.puppet,
        effort=effort,
    )


def _ledger(part: dict[str, Array]) -> Columns:
    """residual = (T + V) - (T + V)_0 - work + damping + impact + slip: what the books miss."""
    slip = np.zeros_like(part["work"])
    energy = part["kinetic"] + part["potential"]
    residual = energy - energy[0] - part["work"] + part["damping"] + part["impact"] + slip
    entries = {**part, "slip": slip, "residual": residual}
    return Columns(LEDGER, np.stack([entries[name] for name in LEDGER], axis=1), "entry")


def _event(tree, row: Array, n_strings: int) -> Event:
    t, kind, index, impulse, speed = row
    kind, index = _KINDS[int(kind)], int(index)
    if index >= n_strings:
        kind = _LIMIT_KINDS.get(kind, kind)
    name = tree.row_names[index] if index >= 0 else ""
    return Event(float(t), kind, name, float(impulse), float(speed))
