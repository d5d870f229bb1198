"""simulate: a marionette, a start state and inputs -> Trajectory."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from fantoccini import contract
from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED, SimulationError, Status
from fantoccini.marionette import (
    STOPPED_BY,
    Contradiction,
    Marionette,
    Method,
    MethodName,
    as_method,
    check_rows,
    check_step,
    contradiction,
    overpulled,
    ready,
)
from fantoccini.motion import (
    Columns,
    EventKind,
    EventRecord,
    Input,
    State,
    Trajectory,
)
from fantoccini.motion.trajectory import LEDGER
from fantoccini.runtime import Run
from fantoccini.simulation.checks import check_marionette, save_times
from fantoccini.simulation.soundness import judged
from fantoccini.simulation.weak_motors import too_weak

_KINDS = {
    code: EventKind.RUNAWAY if code is contract.EventCode.RAN_AWAY else EventKind[code.name]
    for code in contract.EventCode
}
_TO_BLAME = 0.1
"""Share of the blame for a status, 0 to 1, from which a string or limit is named."""
_LIMIT_KINDS = {EventKind.CATCH: EventKind.LIMIT_ON, EventKind.RELEASE: EventKind.LIMIT_OFF}


def simulate(
    marionette: Marionette,
    x0: State,
    inputs: Input | None = None,
    t_end: float | None = None,
    *,
    method: Method | MethodName = "event",
    save_at: Array | None = None,
    save_every: int = 1,
    effort: bool = True,
    progress: Callable[[float], None] | None = None,
    throw: bool = True,
    max_memory: float | None = None,
) -> Trajectory:
    """M_DD acc_D + M_DK acc_K + c = u_D + A_D^T lambda, with strings that only pull.

    Between events the taut strings hold (Eqs. 10-12); where one releases or snaps taut the run
    stops, the impulse acts (Eqs. 13-15) and the mode is chosen anew (Sec. IV). Many runs at once
    are :func:`simulate_batch`'s.

    Args:
        marionette: the puppet.
        x0: where it starts; no string may be longer than its length.
        inputs: what the driven coordinates do; they hold still when not given. Times are absolute:
            the run starts at ``x0.t``.
        t_end: end of the run [s]; the end of the inputs when not given.
        method: ``event``: adaptive order 8 with located events. ``timestepping``: fixed step, for
            interaction, planning and batches. ``variational``: fixed step of second order whose
            energy does not drift, with lengths exact at every step; for large steps and long runs.
            With options: :class:`Event`, :class:`TimeStepping`, :class:`Variational`.
        save_at: (n,) times to write, next to the start, the end and those of events
            (event-driven only) [s]; every step when not given.
        save_every: write every so many steps (not event-driven).
        effort: compute the force on every driven coordinate.
        progress: called with the time reached, for a progress bar [s].
        throw: raise when the run stops before its end; otherwise the status tells.
        max_memory: for the rows and events [bytes]; half of the memory that is free when not given.
            Rows that are known not to fit are refused; an event-driven run ends with
            ``TOO_MANY_SAMPLES`` where they no longer do.

    Raises:
        StateError: ``x0`` breaks a string or limit; ``marionette.project(x0)`` repairs it. Or
            the step is too long for a chain or a spring, or the rows do not fit in memory.
        InputError: the inputs do not start where ``x0`` is.
        TypeError: several states or inputs, which :func:`simulate_batch` takes.
        ValueError: an argument that makes no sense.
        SimulationError: the run stopped, or with a fixed step overstepped rows or gained energy;
            the error carries the trajectory so far.
    """
    chosen = as_method(method)
    method, integrator = chosen.name, getattr(chosen, "integrator", None)
    if integrator is not None:
        from fantoccini.simulation.scipy_run import ScipyRun, solver_class

        solver_class(integrator)
    check_marionette(marionette)
    if not isinstance(x0, State) or not isinstance(inputs, Input | None):
        raise TypeError(
            "simulate takes one state and one input; several of either go to fan.simulate_batch"
        )
    options = marionette.model.run_options(
        **chosen.options, save_steps=save_at is None, save_every=save_every, max_memory=max_memory
    )
    marionette.model.check_state(x0)
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    t_end = inputs.end if t_end is None else float(t_end)
    if not np.isfinite(t_end) or not t_end > x0.t:
        raise ValueError(f"t_end is {t_end}; it must be later than the start at {x0.t}")
    bound = ready(marionette.model, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    marionette.check_start(x0, method)
    check_step(marionette.model, method, x0.q_D, x0.q_K, options.dt)
    save_at = save_times(save_at, method, x0.t, t_end)
    check_rows(marionette.model, method, options, x0.t, t_end, save_at)
    about = options, x0, marionette.p, marionette.winches, bound, save_at
    if integrator is None:
        run = Run(marionette.model.compiled.library_of(method), method, *about)
    else:
        run = ScipyRun(integrator, marionette.model.library, *about)
    rows, events = [], []
    began = time.perf_counter()
    status = _collect(run, t_end, progress, rows, events)
    seconds = time.perf_counter() - began
    rows, events = np.concatenate(rows), np.concatenate(events)

    def trajectory(rows: Array, events: Array) -> Trajectory:
        return trajectory_of_rows(
            marionette, rows, events, status, method, effort, run.blame, seconds
        )

    made, contradicted = trajectory(rows, events), None
    if method != "event" and status in ARRIVED:
        # Fixed steps bound the tensions of strings that contradict one another, or average them.
        motion = _motion_of(made)
        last = overpulled(marionette.model, made.tension.values, motion)
        if last is not None:
            contradicted = contradiction(marionette.model, *motion(last))
        if contradicted:
            before = events[:, contract.EVENT_AT["t"]] <= made.t[last]
            made = trajectory(rows[: last + 1], events[before])
    elif status in STOPPED_BY:
        contradicted = contradiction(marionette.model, *_motion_of(made)(len(made) - 1))
    if contradicted:
        status = Status.REDUNDANT_STRINGS
        made = dataclasses.replace(made, status=status, blamed=contradicted.names)
    unsound = ""
    if method != "event" and status in ARRIVED and made.t[-1] >= t_end:
        verdict, unsound = judged(marionette, made, options.dt, run.progress.violation)
        if verdict is not Status.DONE:
            status = verdict
            made = dataclasses.replace(made, status=status, blamed=())
    if status is not Status.DONE and throw:
        raise SimulationError(status, unsound or _where(marionette, made, contradicted), made)
    return made


def _motion_of(run: Trajectory) -> Callable[[int], tuple[State, Array]]:
    """Row -> the state there and the driven accelerations."""
    return lambda row: (run.state(row), run.acc_K[row])


def _where(
    marionette: Marionette, made: Trajectory, contradicted: Contradiction | None = None
) -> str:
    """When a run stopped, the strings that made it, and what they pulled."""
    text = f"at t = {made.t[-1]:.6g} s"
    if contradicted:
        most = np.max(made.tension.values)
        return f"{text}: {contradicted}. The largest tension was {most:.3g} N"
    if made.status is Status.TOO_MANY_SAMPLES:
        return f"{text} after {len(made)} rows; write fewer with save_at, or allow max_memory"
    if made.blamed:
        text += f", because of {', '.join(made.blamed)}"
    text += too_weak(marionette, made)
    last = made.tension.values[-1]
    if np.max(last, initial=0.0) > 10.0 * marionette.weight:
        text += f"; the largest tension was {np.max(last):.3g} N"
    lengths = marionette.model.string_lengths(made.q_D[-1], made.q_K[-1])
    gone = [n for n, x in zip(made.tension.names, lengths, strict=True) if x < 1e-3]
    return text + "".join(f"; {n}.length is nearly 0" for n in gone)


def _collect(run: Run, t_end: float, progress, rows: list, events: list) -> Status:
    """Runs to the end piece by piece; Ctrl-C keeps what was reached."""
    try:
        for some_rows, some_events in run.advance(t_end):
            rows.append(some_rows)
            events.append(some_events)
            if progress:
                progress(run.progress.t)
    except KeyboardInterrupt:
        some_rows, some_events = run.present()
        rows.append(some_rows)
        events.append(some_events)
        return Status.STOPPED
    return run.status


def trajectory_of_rows(
    marionette: Marionette,
    rows: Array,
    events: Array,
    status: Status,
    method: str,
    with_effort: bool,
    blame: Array,
    seconds: float | None = None,
) -> Trajectory:
    """The trajectory of what a run wrote.

    Args:
        marionette: the puppet.
        rows: (T, width), laid out as ``marionette.row_layout`` says.
        events: (n, 5) time, kind, row, impulse, speed.
        status: how the run ended.
        method: of the run.
        with_effort: compute the force on every driven coordinate.
        blame: (n_rows + n_watched,) the share of each row and drive in the blame for the status, 0
            to 1.
        seconds: how long the run took [s].
    """
    tree = marionette.tree
    part = marionette.model.row_layout.split(rows)
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
        puppet=marionette.model.described,
        effort=effort,
        violation=_violation(marionette, part),
        slip=Columns(strings, part["slip"], "string"),
        blamed=tuple(tree.blamable[i] for i in np.flatnonzero(blame > _TO_BLAME)),
        seconds=seconds,
    )


def _violation(marionette: Marionette, part: dict[str, Array]) -> Columns:
    """max(h, 0) of every row, |h| of wires: how far strings and limits were overstepped."""
    h = marionette.model.library.evaluate(
        "rows", q_D=part["q_D"], q_K=part["q_K"], p=marionette.p
    ).h
    h[:, : part["slip"].shape[1]] -= part["slip"]
    beyond = np.where(marionette.model.two_sided, np.abs(h), np.maximum(h, 0.0))
    return Columns(marionette.tree.row_names, beyond, "string or limit")


def _ledger(part: dict[str, Array]) -> Columns:
    """residual = (T + V) - (T + V)_0 - work + damping + impact + slip: what the books miss."""
    slip = part["slip_loss"]
    energy = part["kinetic"] + part["potential"]
    residual = energy - energy[0] - part["work"] + part["damping"] + part["impact"] + slip
    entries = {**part, "slip": slip, "residual": residual}
    return Columns(LEDGER, np.stack([entries[name] for name in LEDGER], axis=1), "entry")


def _event(tree, row: Array, n_strings: int) -> EventRecord:
    at = {part.name: float(value) for part, value in zip(contract.EVENT, row, strict=True)}
    kind, index = _KINDS[int(at["kind"])], int(at["row"])
    if index >= n_strings:
        kind = _LIMIT_KINDS.get(kind, kind)
    name = tree.blamable[index] if index >= 0 else ""
    return EventRecord(at["t"], kind, name, at["impulse"], at["speed"])
