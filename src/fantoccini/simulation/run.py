"""simulate: a marionette, a start state and inputs -> Trajectory."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from fantoccini import contract
from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED, SimulationError, Status
from fantoccini.marionette import (
    Marionette,
    check_method,
    check_rows,
    check_step,
    ready,
)
from fantoccini.motion import (
    Columns,
    Event,
    EventKind,
    Input,
    Inputs,
    State,
    Trajectories,
    Trajectory,
)
from fantoccini.motion.trajectory import LEDGER
from fantoccini.runtime import Run
from fantoccini.simulation.many import simulate_many
from fantoccini.simulation.redundant import STOPPED_BY, Contradiction, contradiction, overpulled
from fantoccini.simulation.soundness import judged
from fantoccini.simulation.weak_motors import too_weak

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

_KINDS = {
    code: EventKind.RUNAWAY if code is contract.EventKind.RAN_AWAY else EventKind[code.name]
    for code in contract.EventKind
}
_TO_BLAME = 0.1
"""Share of the blame for a status, 0 to 1, from which a string or limit is named."""
_LIMIT_KINDS = {EventKind.CATCH: EventKind.LIMIT_ON, EventKind.RELEASE: EventKind.LIMIT_OFF}


def simulate(
    marionette: Marionette,
    x0: State | Sequence[State],
    inputs: Input | Inputs | Sequence[Input] | None = None,
    t_end: float | None = None,
    *,
    method: Literal["event", "timestepping", "variational"] = "event",
    integrator: str | type[OdeSolver] | None = None,
    rtol: float = 1e-11,
    atol: float = 1e-11,
    max_step: float = 0.1,
    dt: float = 0.002,
    extrapolate: bool = True,
    save_at: Array | None = None,
    save_every: int = 1,
    effort: bool = True,
    progress: Callable[[float], None] | None = None,
    throw: bool = True,
    save: Sequence[str] | str | None = None,
    out: Mapping[str, Array] | None = None,
    threads: int | None = None,
    max_memory: float | None = None,
) -> Trajectory | Trajectories:
    """M_DD acc_D + M_DK acc_K + c = u_D + A_D^T lambda, with strings that only pull.

    Between events the taut strings hold (Eqs. 10-12); where one releases or snaps taut the run
    stops, the impulse acts (Eqs. 13-15) and the mode is chosen anew (Sec. IV).

    Many states, many inputs or both make a batch, which gives :class:`Trajectories`: on threads,
    and fixed steps in lanes. A run of a batch that stops early is told by its status and does
    not raise; Ctrl-C keeps what was reached, with the others STOPPED.

    Args:
        marionette: the puppet.
        x0: where it starts; no string may be longer than its length. A list of states of one time
            makes a batch.
        inputs: what the driven coordinates do; they hold still when not given. Times are absolute:
            the run starts at ``x0.t``. A list of them, or :class:`Inputs`, makes a batch; there
            must be as many as states, or a single one of either.
        t_end: end of the run [s]; the end of the inputs when not given.
        method: ``event``: adaptive order 8 with located events. ``timestepping``: fixed step, for
            interaction, planning and batches. ``variational``: fixed step of second order whose
            energy does not drift, with lengths exact at every step; for large steps and long runs.
        integrator: of ``event``: a method of SciPy's ``solve_ivp`` (``RK23``, ``RK45``,
            ``DOP853``, ``Radau``, ``BDF``, ``LSODA``) or a subclass of its ``OdeSolver``; the
            compiled one, which is of order 8 and many times faster, when not given.
        rtol, atol: tolerances of the event-driven integrator.
        max_step: its largest step [s].
        dt: step of ``timestepping`` and ``variational`` [s].
        extrapolate: time-stepping takes velocity products half a step on, from the accelerations of
            the steps before, which keeps energy where something spins; False makes each step depend
            on its state alone, so that a run goes on from any row to the same bits.
        save_at: (n,) times to write, next to the start, the end and those of events
            (event-driven only) [s]; every step when not given.
        save_every: write every so many steps (not event-driven).
        effort: compute the force on every driven coordinate.
        progress: called with the time reached, for a progress bar [s].
        throw: raise when the run stops before its end; otherwise the status tells.
        save: of a batch, what to save: ``all``, or names of its arrays; q_D, v_D and tension when
            not given.
        out: of a batch, arrays to write into, by name, with the shapes that the batch gives:
            C-contiguous (n, T, width); new ones where not given. ``force`` holds tension and
            limit_force side by side, ``books`` what the ledger is made of.
        threads: of a batch; all processors when not given.
        max_memory: for the rows and events of a run, or the arrays of a batch [bytes]; half of the
            memory that is free when not given. Rows that are known not to fit are refused; an
            event-driven run ends with ``TOO_MANY_ROWS`` where they no longer do.

    Returns:
        The trajectory, or those of a batch.

    Raises:
        StateError: ``x0`` breaks a string or limit; ``marionette.project(x0)`` repairs it. Or
            ``dt`` is too long for a chain or a spring, or the rows do not fit in memory.
        InputError: the inputs do not start where ``x0`` is.
        ValueError: an argument that makes no sense.
        SimulationError: the run stopped, or with a fixed step overstepped rows or gained energy;
            the error carries the trajectory so far.
    """
    check_method(method)
    if integrator is not None:
        if method != "event":
            raise ValueError(f"integrator goes with method='event'; {method} has its own")
        from fantoccini.simulation.scipy_run import ScipyRun, solver_class

        solver_class(integrator)
    if not isinstance(marionette, Marionette):
        raise TypeError(
            f"marionette is a {type(marionette).__name__}; it must be one Marionette, as fan.load "
            "gives it. Simulate several one by one, or with fan.sweep"
        )
    if not extrapolate and method != "timestepping":
        raise ValueError(f"extrapolate=False goes with method='timestepping', not {method!r}")
    many = not isinstance(x0, State) or not isinstance(inputs, Input | None)
    options = marionette.run_options(
        rtol=rtol, atol=atol, max_step=max_step, dt=dt, save_steps=save_at is None and not many,
        save_every=save_every, max_memory=max_memory, extrapolate=extrapolate,
    )  # fmt: skip
    if many:
        if integrator is not None:
            raise ValueError("integrator goes with a single run; batches have the compiled one")
        times = _save_times(save_at, method, -np.inf, np.inf)
        return simulate_many(
            marionette, x0, inputs, t_end, method, options, save_at=times, save=save, out=out,
            threads=threads, progress=progress,
        )  # fmt: skip
    for name, value in (("save", save), ("out", out), ("threads", threads)):
        if value is not None:
            raise ValueError(f"{name} goes with many states or inputs")
    marionette.check_state(x0)
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    t_end = inputs.end if t_end is None else float(t_end)
    if not np.isfinite(t_end) or not t_end > x0.t:
        raise ValueError(f"t_end is {t_end}; it must be later than the start at {x0.t}")
    bound = ready(marionette, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    marionette.check_start(x0, method)
    check_step(marionette, method, x0.q_D, x0.q_K, dt)
    save_at = _save_times(save_at, method, x0.t, t_end)
    check_rows(marionette, method, options, x0.t, t_end, save_at)
    about = options, x0, marionette.p, marionette.winches, bound, save_at
    if integrator is None:
        run = Run(marionette.library_of(method), method, *about)
    else:
        run = ScipyRun(integrator, marionette.library, *about)
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
        last = overpulled(marionette, made)
        if last is not None:
            contradicted = contradiction(marionette, made, last)
        if contradicted:
            before = events[:, contract.EVENT_AT["t"]] <= made.t[last]
            made = trajectory(rows[: last + 1], events[before])
    elif status in STOPPED_BY:
        contradicted = contradiction(marionette, made, len(made) - 1)
    if contradicted:
        status = Status.REDUNDANT_STRINGS
        made = dataclasses.replace(made, status=status, blamed=contradicted.names)
    unsound = ""
    if method != "event" and status in ARRIVED and made.t[-1] >= t_end:
        # What a variational step counts has no slip in it; it holds all rows, or is not made.
        worst = run.progress.violation if method == "timestepping" else 0.0
        verdict, unsound = judged(marionette, made, dt, worst)
        if verdict is not Status.DONE:
            status = verdict
            made = dataclasses.replace(made, status=status, blamed=())
    if status is not Status.DONE and throw:
        raise SimulationError(status, unsound or _where(marionette, made, contradicted), made)
    return made


def _where(
    marionette: Marionette, made: Trajectory, contradicted: Contradiction | None = None
) -> str:
    """When a run stopped, the strings that made it, and what they pulled."""
    text = f"at t = {made.t[-1]:.6g} s"
    if contradicted:
        most = np.max(made.tension.values)
        return f"{text}: {contradicted}. The largest tension was {most:.3g} N"
    if made.status is Status.TOO_MANY_ROWS:
        return f"{text} after {len(made)} rows; write fewer with save_at, or allow max_memory"
    if made.blamed:
        text += f", because of {', '.join(made.blamed)}"
    text += too_weak(marionette, made)
    last = made.tension.values[-1]
    if np.max(last, initial=0.0) > 10.0 * marionette.weight:
        text += f"; the largest tension was {np.max(last):.3g} N"
    lengths = marionette.string_lengths(made.q_D[-1], made.q_K[-1])
    gone = [n for n, x in zip(made.tension.names, lengths, strict=True) if x < 1e-3]
    return text + "".join(f"; {n}.length is nearly 0" for n in gone)


def _save_times(save_at: Array | None, method: str, t: float, t_end: float) -> Array | None:
    """The times to write, the end among them."""
    if save_at is None:
        return None
    if method != "event":
        raise ValueError(f"save_at goes with method='event'; {method} takes save_every")
    times = np.asarray(save_at, dtype=float)
    if times.ndim != 1 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise ValueError("save_at must be a list of finite times that increase")
    if len(times) and (times[0] < t or times[-1] > t_end):
        raise ValueError(f"save_at must lie between the start {t:g} s and the end {t_end:g} s")
    return np.union1d(times, [t_end] if np.isfinite(t_end) else [])


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
        puppet=marionette.described,
        effort=effort,
        violation=_violation(marionette, part),
        slip=Columns(strings, part["slip"], "string"),
        blamed=tuple(tree.blamable[i] for i in np.flatnonzero(blame > _TO_BLAME)),
        seconds=seconds,
    )


def _violation(marionette: Marionette, part: dict[str, Array]) -> Columns:
    """max(h, 0) of every row, |h| of wires: how far strings and limits were overstepped."""
    h = marionette.library.evaluate("rows", q_D=part["q_D"], q_K=part["q_K"], p=marionette.p).h
    h[:, : part["slip"].shape[1]] -= part["slip"]
    beyond = np.where(marionette.two_sided, np.abs(h), np.maximum(h, 0.0))
    return Columns(marionette.tree.row_names, beyond, "string or limit")


def _ledger(part: dict[str, Array]) -> Columns:
    """residual = (T + V) - (T + V)_0 - work + damping + impact + slip: what the books miss."""
    slip = part["slip_loss"]
    energy = part["kinetic"] + part["potential"]
    residual = energy - energy[0] - part["work"] + part["damping"] + part["impact"] + slip
    entries = {**part, "slip": slip, "residual": residual}
    return Columns(LEDGER, np.stack([entries[name] for name in LEDGER], axis=1), "entry")


def _event(tree, row: Array, n_strings: int) -> Event:
    at = {part.name: float(value) for part, value in zip(contract.EVENT, row, strict=True)}
    kind, index = _KINDS[int(at["kind"])], int(at["row"])
    if index >= n_strings:
        kind = _LIMIT_KINDS.get(kind, kind)
    name = tree.blamable[index] if index >= 0 else ""
    return Event(at["t"], kind, name, at["impulse"], at["speed"])
