"""simulate: a marionette, a start state and inputs -> Trajectory."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from fantoccini.base import (
    ARRIVED,
    Array,
    OnProgress,
    Progress,
    SimulationError,
    Status,
    check_positive,
)
from fantoccini.dynamics.compiled import (
    CompiledPuppet,
    Method,
    MethodName,
    as_method,
    bind_input,
    check_samples,
    check_start,
    check_step,
    checked_end,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.checks import check_marionette, check_one_run, save_times
from fantoccini.dynamics.simulation.determinacy import undetermined
from fantoccini.dynamics.simulation.effort_of_contacts import contact_effort
from fantoccini.dynamics.simulation.ledgers import ledger_of
from fantoccini.dynamics.simulation.pace import Pace, chatter
from fantoccini.dynamics.simulation.soundness import judged, prescribed_verdict
from fantoccini.dynamics.simulation.weak_motors import weak_motors
from fantoccini.dynamics.steppers import (
    CONTRADICTION_STATUSES,
    Check,
    Contradiction,
    contradiction,
    decide,
    first_excess_tension,
    looks,
    overlap_events,
    parted,
    prescribed_overlaps,
)
from fantoccini.kernel import contract
from fantoccini.kernel.runtime import Piece, Run, contact_points
from fantoccini.motion import (
    LEDGER,
    Columns,
    ContactPoints,
    EventKind,
    EventRecord,
    Input,
    State,
    Trajectory,
    pair_name,
)

_KINDS = {
    code: EventKind.RUNAWAY if code is contract.EventCode.RAN_AWAY else EventKind[code.name]
    for code in contract.EventCode
}
_LIMIT_KINDS = {EventKind.CATCH: EventKind.LIMIT_ON, EventKind.RELEASE: EventKind.LIMIT_OFF}


@dataclasses.dataclass(frozen=True)
class Reporting:
    """Thresholds of messages about runs that stopped."""

    blame: float = 0.1
    """Share of the blame for a status, 0 to 1, from which a row or drive is named."""
    large_tension: float = 10.0  # Tension that is mentioned, in weights of the puppet
    short_length: float = 1e-3  # Length of a string that is mentioned as nearly 0 [m]


REPORTING = Reporting()


def simulate(
    marionette: Marionette,
    x0: State,
    inputs: Input | None = None,
    t_end: float | None = None,
    *,
    method: Method | MethodName = "event",
    save_at: Array | None = None,
    save_every: int | None = None,
    effort: bool = True,
    progress: OnProgress | None = None,
    throw: bool = True,
    max_memory: float | None = None,
    time_limit: float | None = None,
) -> Trajectory:
    """M_DD acc_D + M_DK acc_K + c = u_D + A_D^T lambda, with strings that only pull.

    Between events the taut strings hold (Eqs. 10-12); where one releases or snaps taut the run
    stops, the impulse acts (Eqs. 13-15) and the active set is found anew (Sec. IV). For many runs
    at once see :func:`simulate_batch`.

    Args:
        marionette: the puppet.
        x0: where it starts; no string may be longer than its length.
        inputs: motion of the driven coordinates; they hold still when not given. Times are
            absolute: the run starts at ``x0.t``.
        t_end: end of the run [s]; the end of the inputs when not given.
        method: ``event``: adaptive order 8 with located events. ``timestepping``: fixed step, for
            interaction, planning and batches. ``variational``: fixed step of second order whose
            energy does not drift, with lengths exact at every step; for large steps and long runs.
            With options: :class:`Event`, :class:`TimeStepping`, :class:`Variational`.
        save_at: (n,) times to write besides the start, the end and those of events
            (event-driven only) [s]; every step when not given.
        save_every: write every so many steps (not event-driven); every one when not given.
        effort: compute the force on every driven coordinate.
        progress: called with the time simulated, for a progress bar [s].
        throw: raise when the run stops before its end; otherwise see its status.
        max_memory: for samples and events [bytes]; half of the free memory when not given. Runs
            known not to fit are refused; an event-driven run ends with ``TOO_MANY_SAMPLES`` where
            its samples no longer fit.
        time_limit: computing time after which the run ends with ``OUT_OF_TIME`` [s]; none when not
            given. Runs with minutes to go warn after some seconds of computing.

    Raises:
        StateError: ``x0`` violates a string or limit; ``marionette.project(x0)`` repairs it. Or
            the step is too long for a chain or a spring, or the samples do not fit in memory.
        InputError: the inputs do not start where ``x0`` is.
        TypeError: several states or inputs, which :func:`simulate_batch` takes.
        ValueError: an invalid argument.
        SimulationError: the run stopped, or with a fixed step violated rows or gained energy;
            the error carries the trajectory so far.
    """
    chosen = as_method(method)
    name = chosen.name
    check_marionette(marionette)
    check_one_run(x0, inputs)
    options = marionette.run_options(
        **chosen.options,
        save_steps=save_at is None,
        max_memory=max_memory,
        save_every=1 if save_every is None else save_every,
    )
    marionette.check_state(x0)
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    t_end = checked_end(inputs.end if t_end is None else t_end, x0.t)
    if time_limit is not None:
        check_positive(time_limit=time_limit)
    bound = bind_input(marionette, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    x0 = parted(marionette, x0)
    check_start(marionette, x0, name)
    check_step(marionette, name, x0.q_D, x0.q_K, options.dt)
    save_at = save_times(save_at, save_every, name, x0.t, t_end)
    check_samples(marionette, name, options, x0.t, t_end, save_at)
    about = options, x0, marionette.p, marionette.winches, bound, save_at
    run = Run(marionette.libraries.library_of(name), name, *about)
    pieces = list[Piece]()
    pace = Pace(x0.t, t_end, time_limit, lambda: _chatter(marionette, pieces))
    written, status = _collect(run, x0.t, t_end, progress, pieces, pace)
    samples, events = written.samples, written.events
    seconds = pace.seconds

    def trajectory(samples: Array, events: Array) -> Trajectory:
        return trajectory_of_samples(
            marionette,
            Piece(samples, events, written.contacts),
            status,
            name,
            effort,
            run.blame,
            seconds,
        )

    made = trajectory(samples, events)
    motion, last = _motion_of(made), None
    if name != "event" and status in ARRIVED:
        # Fixed steps bound the tensions of contradicting strings, or average them.
        last = first_excess_tension(marionette, made.tension.values, motion)
    contradicted = None
    if last is not None or status in CONTRADICTION_STATUSES:
        contradicted = contradiction(marionette, *motion(len(made) - 1 if last is None else last))
    if last is not None and contradicted:
        before = events[:, contract.EVENT_AT["t"]] <= made.t[last]
        made = trajectory(samples[: last + 1], events[before])
    overlaps = prescribed_overlaps(
        marionette, lambda t: bound.evaluate(t)[0], looks(bound.breaks, x0.t, float(made.t[-1]))
    )
    if overlaps:
        told = written.events, overlap_events(marionette, overlaps, x0.t)
        kept = np.concatenate(told)
        kept = kept[kept[:, contract.EVENT_AT["t"]] <= made.t[-1]]
        events_of = tuple(_event(marionette, event) for event in _in_order(kept))
        made = dataclasses.replace(made, events=events_of)
    checks: list[Check] = [lambda: prescribed_verdict(overlaps)]
    if name != "event" and made.t[-1] >= t_end:
        worst = float(run.progress.violation)
        checks.insert(0, lambda: judged(marionette, made, options.dt, worst))
    verdict = decide(status, contradicted, checks)
    if verdict.status is not status:
        blamed = contradicted.names if contradicted else ()
        made = dataclasses.replace(made, status=verdict.status, blamed=blamed)
    if made.status is not Status.DONE and throw:
        where = verdict.text or _where(marionette, made, contradicted)
        raise SimulationError(made.status, where, made)
    return made


def _motion_of(run: Trajectory) -> Callable[[int], tuple[State, Array]]:
    """Sample -> the state there and the driven accelerations."""
    return lambda i: (run.state(i), run.acc_K[i])


def _where(
    marionette: Marionette, made: Trajectory, contradicted: Contradiction | None = None
) -> str:
    """When and why a run stopped."""
    text = f"at t = {made.t[-1]:.6g} s"
    if contradicted:
        most = np.max(made.tension.values)
        return f"{text}: {contradicted}. The largest tension was {most:.3g} N"
    if made.status is Status.OUT_OF_TIME:
        return f"{text}: {chatter(made.t, made.contact, made.events)}"
    if made.status is Status.TOO_MANY_SAMPLES:
        return f"{text} after {len(made)} samples; write fewer with save_at, or allow max_memory"
    if made.blamed:
        text += f", because of {', '.join(made.blamed)}"
    if made.status is Status.TOO_MANY_EVENTS:
        text += f": {chatter(made.t, made.contact, made.events)}; method='timestepping' goes on"
    if made.status is Status.NO_UNIQUE_MOTION:
        text += f", where {_sliding(made)} slide; method='timestepping' goes on with an impulse"
    text += weak_motors(marionette, made)
    last = made.tension.values[-1]
    if np.max(last, initial=0.0) > REPORTING.large_tension * marionette.weight:
        text += f"; the largest tension was {np.max(last):.3g} N"
    lengths = marionette.string_lengths(made.q_D[-1], made.q_K[-1])
    short = lengths < REPORTING.short_length
    gone = [n for n, is_short in zip(made.tension.names, short, strict=True) if is_short]
    return text + "".join(f"; {n}.length is nearly 0" for n in gone)


def _chatter(marionette: CompiledPuppet, pieces: list[Piece]) -> str:
    """Text on why the present steps of a run are short, from the pieces written so far."""
    written = Piece.joined(pieces)
    t = marionette.sample_layout.split(written.samples)["t"]
    events = [_event(marionette, event) for event in written.events]
    return chatter(t, _contact_points(marionette, written.contacts, len(t)), events)


def _sliding(made: Trajectory) -> str:
    """The pairs that touched at the last samples."""
    contact = made.contact
    if contact is None or not np.any(contact.sample >= len(made) - 3):
        return "solids"
    near = contact.sample >= len(made) - 3
    return ", ".join(pair_name(contact.names[k]) for k in np.unique(contact.pair[near]))


def _collect(
    run: Run,
    start: float,
    t_end: float,
    progress: OnProgress | None,
    pieces: list[Piece],
    pace: Pace,
) -> tuple[Piece, Status]:
    """The output of a run and its status; Ctrl-C and a time limit keep the samples so far."""
    try:
        for piece in run.advance(t_end):
            pieces.append(piece)
            t = run.progress.t
            if progress:
                progress(Progress(done=t - start, total=t_end - start))
            if pace.late and run.status in (Status.RUNNING, *ARRIVED) and t < t_end:
                pieces.append(run.present())
                return Piece.joined(pieces), Status.OUT_OF_TIME
            pace.note(t)
        status = run.status
    except KeyboardInterrupt:
        pieces.append(run.present())
        status = Status.STOPPED
    return Piece.joined(pieces), status


def trajectory_of_samples(
    marionette: Marionette,
    written: Piece,
    status: Status,
    method: str,
    with_effort: bool,
    blame: Array,
    seconds: float | None = None,
) -> Trajectory:
    """The trajectory of the samples that a run wrote.

    Args:
        marionette: the puppet.
        written: its samples (T, width), events and contact points.
        status: how the run ended.
        method: of the run.
        with_effort: compute the force on every driven coordinate.
        blame: (n_rows + n_watched,) the share of each row and drive in the blame for the status, 0
            to 1.
        seconds: how long the run took [s].
    """
    tree = marionette.tree
    part = marionette.sample_layout.split(written.samples)
    n_strings = len(tree.strings)
    strings = tuple(s.name for s in tree.strings)
    limits = tuple(limit.name for limit in tree.limits)
    tension = part["tension"][:, :n_strings]
    contact = _contact_points(marionette, written.contacts, len(written.samples))
    effort = None
    if with_effort:
        moved = {name: part[name] for name in ("q_D", "v_D", "q_K", "v_K", "acc_D", "acc_K")}
        force = marionette.effort(**moved, tension=tension)
        if contact is not None:
            force = force + contact_effort(marionette, contact, part["q_D"], part["q_K"])
        effort = Columns(marionette.coordinates.v_K, force, "driven velocity")
    h = marionette.library.evaluate("rows", q_D=part["q_D"], q_K=part["q_K"], p=marionette.p).h
    h[:, :n_strings] -= part["slip"]
    violation = np.where(marionette.two_sided, np.abs(h), np.maximum(h, 0.0))
    made = Trajectory(
        t=part["t"],
        q_D=part["q_D"],
        v_D=part["v_D"],
        acc_D=part["acc_D"],
        q_K=part["q_K"],
        v_K=part["v_K"],
        acc_K=part["acc_K"],
        tension=Columns(strings, tension, "string"),
        limit_force=Columns(limits, part["tension"][:, n_strings:], "limit"),
        taut=Columns(strings, np.asarray(part["taut"][:, :n_strings], dtype=bool), "string"),
        ledger=Columns(LEDGER, ledger_of(part), "entry"),
        events=tuple(_event(marionette, event) for event in _in_order(written.events)),
        status=status,
        method=method,
        coordinates=marionette.coordinates,
        puppet=marionette.described,
        effort=effort,
        violation=Columns(tree.row_names, violation, "string or limit"),
        slip=Columns(strings, part["slip"], "string"),
        blamed=tuple(tree.blamable[i] for i in np.flatnonzero(blame > REPORTING.blame)),
        seconds=seconds,
        contact=contact,
        contact_residual=None if contact is None else part["contact_residual"],
    )
    if not with_effort:
        return made
    return dataclasses.replace(made, undetermined=undetermined(marionette, made))


def _contact_points(marionette: CompiledPuppet, rows: Array, n: int) -> ContactPoints | None:
    """The contact points of a run of n samples; None where nothing may touch anything."""
    if marionette.contacts is None:
        return None
    return contact_points(rows[rows[:, 0] < n], marionette.contacts.names)


def _in_order(events: Array) -> Array:
    """Events in order of their times: that a point slides is told once it does."""
    return events[np.argsort(events[:, contract.EVENT_AT["t"]], kind="stable")]


def _event(marionette: CompiledPuppet, event: Array) -> EventRecord:
    tree = marionette.tree
    at = {part.name: float(value) for part, value in zip(contract.EVENT, event, strict=True)}
    kind, index = _KINDS[contract.EventCode(int(at["kind"]))], int(at["row"])
    if index >= len(tree.strings):
        kind = _LIMIT_KINDS.get(kind, kind)
    name = tree.blamable[index] if 0 <= index < len(tree.blamable) else ""
    if index >= len(tree.blamable):
        tables = (marionette.contacts, marionette.prescribed)
        pairs = [names for table in tables if table is not None for names in table.names]
        name = pair_name(pairs[index - len(tree.blamable)])
    return EventRecord(at["t"], kind, name, at["impulse"], at["speed"])
