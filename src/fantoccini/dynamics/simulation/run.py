"""simulate: a marionette, a start state and inputs -> Trajectory.

The equation of motion is that of the dynamic coordinates (D), driven by the others (K: ends and
lengths of strings, driven joints). A row is a string or a joint limit; slip is the length that a
winch has let out. A taut string pulls, a slack one does not. The ledger is the table of energies
and work.
"""

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
from fantoccini.dynamics.simulation.effort_of_contacts import contact_effort
from fantoccini.dynamics.simulation.judging import fixed_step_verdict, prescribed_verdict
from fantoccini.dynamics.simulation.pace import Pace, short_steps_message
from fantoccini.dynamics.simulation.weak_motors import weak_motors_message
from fantoccini.dynamics.steppers import (
    CONTRADICTION_STATUSES,
    Check,
    Contradiction,
    contradiction,
    decide,
    first_excess_tension,
    ledger_of,
    measuring_times,
    overlap_events,
    prescribed_overlaps,
    separated,
    undetermined,
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

_EVENT_KINDS = {
    code: EventKind.RUNAWAY if code is contract.EventCode.RAN_AWAY else EventKind[code.name]
    for code in contract.EventCode
}
_LIMIT_KINDS = {EventKind.CATCH: EventKind.LIMIT_ON, EventKind.RELEASE: EventKind.LIMIT_OFF}


@dataclasses.dataclass(frozen=True)
class Reporting:
    """Thresholds of messages about runs that stopped."""

    min_share: float = 0.1
    """Share in causing a status, 0 to 1, above which a row or drive is named."""
    large_tension: float = 10.0  # Tension above which it is mentioned, in weights of the puppet
    short_length: float = 1e-3  # Length below which a string is mentioned as nearly 0 [m]


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
    """Solves M_DD acc_D + M_DK acc_K + c = u_D + A_D^T lambda, with strings that only pull.

    Between events the taut strings hold (Eqs. 10-12). When one releases or snaps taut, the run
    stops, the impulse acts (Eqs. 13-15) and the active set is determined again (Sec. IV). For
    many runs at once see :func:`simulate_batch`.

    Args:
        marionette: the puppet.
        x0: start state; no string may be longer than its length.
        inputs: motion of the driven coordinates; by default they hold still. Times are
            absolute: the run starts at ``x0.t``.
        t_end: end of the run [s]; by default the end of the inputs.
        method: ``event``: adaptive order 8 with located events. ``timestepping``: fixed step, for
            interaction, planning and batches. ``variational``: fixed step of second order whose
            energy does not drift, with exact lengths at every step; for large steps and long runs.
            With options: :class:`Event`, :class:`TimeStepping`, :class:`Variational`.
        save_at: (n,) times of samples besides the start, the end and those of events
            (event-driven only) [s]; by default every step.
        save_every: number of steps per sample (not event-driven); by default 1.
        effort: whether to compute the force on every driven coordinate.
        progress: callback for a progress bar, with the simulated time [s].
        throw: whether to raise if the run stops before its end; otherwise see its status.
        max_memory: largest memory of samples and events [bytes]; by default half of the free
            memory. Runs that cannot fit are refused; an event-driven run ends with
            ``TOO_MANY_SAMPLES`` when its samples no longer fit.
        time_limit: computing time after which the run ends with ``OUT_OF_TIME`` [s]; by default
            none. Runs of several minutes warn after some seconds of computing.

    Raises:
        StateError: ``x0`` violates a string or limit; ``marionette.project(x0)`` repairs it. Or
            the step is too long for a chain or a spring, or the samples do not fit in memory.
        InputError: the inputs do not start where ``x0`` is.
        TypeError: there are several states or inputs, as for :func:`simulate_batch`.
        ValueError: an argument is invalid.
        SimulationError: the run stopped, or with a fixed step violated rows or gained energy;
            the error carries the trajectory so far.
    """
    method_options = as_method(method)
    name = method_options.name
    check_marionette(marionette)
    check_one_run(x0, inputs)
    options = marionette.run_options(
        **method_options.options,
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
    x0 = separated(marionette, x0)
    check_start(marionette, x0, name)
    check_step(marionette, name, x0.q_D, x0.q_K, options.dt)
    save_at = save_times(save_at, save_every, name, x0.t, t_end)
    check_samples(marionette, name, options, x0.t, t_end, save_at)
    arguments = options, x0, marionette.p, marionette.winches, bound, save_at
    run = Run(marionette.libraries.library_of(name), name, *arguments)
    pieces = list[Piece]()
    pace = Pace(x0.t, t_end, time_limit, lambda: _short_steps_text(marionette, pieces))
    samples_and_events, status = _collect_pieces(run, x0.t, t_end, progress, pieces, pace)
    samples, events = samples_and_events.samples, samples_and_events.events
    seconds = pace.seconds

    def trajectory(samples: Array, events: Array) -> Trajectory:
        return trajectory_of_samples(
            marionette,
            Piece(samples, events, samples_and_events.contacts),
            status,
            name,
            effort,
            run.attribution,
            seconds,
        )

    result = trajectory(samples, events)
    motion_at, last_sample = _motion_of(result), None
    if name != "event" and status in ARRIVED:
        # Fixed steps bound the tensions of contradicting strings, or average them.
        last_sample = first_excess_tension(marionette, result.tension.values, motion_at)
    contradiction_ = None
    if last_sample is not None or status in CONTRADICTION_STATUSES:
        contradiction_ = contradiction(
            marionette, *motion_at(len(result) - 1 if last_sample is None else last_sample)
        )
    if last_sample is not None and contradiction_:
        is_before = events[:, contract.EVENT_AT["t"]] <= result.t[last_sample]
        result = trajectory(samples[: last_sample + 1], events[is_before])
    overlaps = prescribed_overlaps(
        marionette,
        lambda t: bound.evaluate(t)[0],
        measuring_times(bound.breaks, x0.t, float(result.t[-1])),
    )
    if overlaps:
        event_arrays = samples_and_events.events, overlap_events(marionette, overlaps, x0.t)
        all_events = np.concatenate(event_arrays)
        all_events = all_events[all_events[:, contract.EVENT_AT["t"]] <= result.t[-1]]
        records = tuple(_event(marionette, event) for event in _in_order(all_events))
        result = dataclasses.replace(result, events=records)
    checks: list[Check] = [lambda: prescribed_verdict(overlaps)]
    if name != "event" and result.t[-1] >= t_end:
        max_violation = float(run.progress.violation)
        checks.insert(0, lambda: fixed_step_verdict(marionette, result, options.dt, max_violation))
    verdict = decide(status, contradiction_, checks)
    if verdict.status is not status:
        causes = contradiction_.names if contradiction_ else ()
        result = dataclasses.replace(result, status=verdict.status, causes=causes)
    if result.status is not Status.DONE and throw:
        message = verdict.text or _stop_message(marionette, result, contradiction_)
        raise SimulationError(result.status, message, result)
    return result


def _motion_of(run: Trajectory) -> Callable[[int], tuple[State, Array]]:
    """Function: sample -> its state and driven accelerations."""
    return lambda i: (run.state(i), run.acc_K[i])


def _stop_message(
    marionette: Marionette, result: Trajectory, contradiction_: Contradiction | None = None
) -> str:
    """Time and cause of a run's stop, in words."""
    text = f"at t = {result.t[-1]:.6g} s"
    if contradiction_:
        largest = np.max(result.tension.values)
        return f"{text}: {contradiction_}. The largest tension was {largest:.3g} N"
    if result.status is Status.OUT_OF_TIME:
        return f"{text}: {short_steps_message(result.t, result.contact, result.events)}"
    if result.status is Status.TOO_MANY_SAMPLES:
        return f"{text} after {len(result)} samples; save fewer with save_at, or allow max_memory"
    if result.causes:
        text += f", because of {', '.join(result.causes)}"
    if result.status is Status.TOO_MANY_EVENTS:
        text += f": {short_steps_message(result.t, result.contact, result.events)}"
        text += "; method='timestepping' does not stop there"
    if result.status is Status.NO_UNIQUE_MOTION:
        text += f", where {_sliding_pairs(result)} slide"
        text += "; method='timestepping' continues with an impulse"
    text += weak_motors_message(marionette, result)
    last_tensions = result.tension.values[-1]
    if np.max(last_tensions, initial=0.0) > REPORTING.large_tension * marionette.weight:
        text += f"; the largest tension was {np.max(last_tensions):.3g} N"
    lengths = marionette.string_lengths(result.q_D[-1], result.q_K[-1])
    short = lengths < REPORTING.short_length
    spent_strings = [
        name for name, is_short in zip(result.tension.names, short, strict=True) if is_short
    ]
    return text + "".join(f"; {name}.length is nearly 0" for name in spent_strings)


def _short_steps_text(marionette: CompiledPuppet, pieces: list[Piece]) -> str:
    """Message on the cause of a run's short steps, from the pieces so far."""
    samples_so_far = Piece.joined(pieces)
    t = marionette.sample_layout.split(samples_so_far.samples)["t"]
    events = [_event(marionette, event) for event in samples_so_far.events]
    return short_steps_message(
        t, _contact_points(marionette, samples_so_far.contacts, len(t)), events
    )


def _sliding_pairs(result: Trajectory) -> str:
    """Names of the pairs that touched at the last samples."""
    contact = result.contact
    if contact is None or not np.any(contact.sample >= len(result) - 3):
        return "solids"
    in_last_samples = contact.sample >= len(result) - 3
    return ", ".join(pair_name(contact.names[k]) for k in np.unique(contact.pair[in_last_samples]))


def _collect_pieces(
    run: Run,
    start: float,
    t_end: float,
    progress: OnProgress | None,
    pieces: list[Piece],
    pace: Pace,
) -> tuple[Piece, Status]:
    """Samples of a run and its status; the samples so far after Ctrl-C or a time limit."""
    try:
        for piece in run.advance(t_end):
            pieces.append(piece)
            t = run.progress.t
            if progress:
                progress(Progress(done=t - start, total=t_end - start))
            if pace.is_over_limit and run.status in (Status.RUNNING, *ARRIVED) and t < t_end:
                pieces.append(run.present())
                return Piece.joined(pieces), Status.OUT_OF_TIME
            pace.report_time(t)
        status = run.status
    except KeyboardInterrupt:
        pieces.append(run.present())
        status = Status.STOPPED
    return Piece.joined(pieces), status


def trajectory_of_samples(
    marionette: Marionette,
    piece: Piece,
    status: Status,
    method: str,
    with_effort: bool,
    attribution: Array,
    seconds: float | None = None,
) -> Trajectory:
    """The trajectory of a run's samples.

    Args:
        marionette: the puppet.
        piece: samples (T, width), events and contact points of the run.
        status: status of the run.
        method: method of the run.
        with_effort: whether to compute the force on every driven coordinate.
        attribution: (n_rows + n_watched,) shares of rows and drives in causing the status, 0 to 1.
        seconds: computing time of the run [s].
    """
    tree = marionette.tree
    columns = marionette.sample_layout.split(piece.samples)
    n_strings = len(tree.strings)
    strings = tuple(s.name for s in tree.strings)
    limits = tuple(limit.name for limit in tree.limits)
    tension = columns["tension"][:, :n_strings]
    contact = _contact_points(marionette, piece.contacts, len(piece.samples))
    effort = None
    if with_effort:
        motion = {name: columns[name] for name in ("q_D", "v_D", "q_K", "v_K", "acc_D", "acc_K")}
        force = marionette.effort(**motion, tension=tension)
        if contact is not None:
            force = force + contact_effort(marionette, contact, columns["q_D"], columns["q_K"])
        effort = Columns(marionette.coordinates.v_K, force, "driven velocity")
    h = marionette.library.evaluate(
        "rows", q_D=columns["q_D"], q_K=columns["q_K"], p=marionette.p
    ).h
    h[:, :n_strings] -= columns["slip"]
    violation = np.where(marionette.two_sided, np.abs(h), np.maximum(h, 0.0))
    result = Trajectory(
        t=columns["t"],
        q_D=columns["q_D"],
        v_D=columns["v_D"],
        acc_D=columns["acc_D"],
        q_K=columns["q_K"],
        v_K=columns["v_K"],
        acc_K=columns["acc_K"],
        tension=Columns(strings, tension, "string"),
        limit_force=Columns(limits, columns["tension"][:, n_strings:], "limit"),
        taut=Columns(strings, np.asarray(columns["taut"][:, :n_strings], dtype=bool), "string"),
        ledger=Columns(LEDGER, ledger_of(columns), "entry"),
        events=tuple(_event(marionette, event) for event in _in_order(piece.events)),
        status=status,
        method=method,
        coordinates=marionette.coordinates,
        puppet=marionette.current_puppet,
        effort=effort,
        violation=Columns(tree.row_names, violation, "string or limit"),
        slip=Columns(strings, columns["slip"], "string"),
        causes=tuple(
            tree.attributable[i] for i in np.flatnonzero(attribution > REPORTING.min_share)
        ),
        seconds=seconds,
        contact=contact,
        contact_residual=None if contact is None else columns["contact_residual"],
    )
    if not with_effort:
        return result
    return dataclasses.replace(result, undetermined=undetermined(marionette, result))


def _contact_points(marionette: CompiledPuppet, rows: Array, n: int) -> ContactPoints | None:
    """Contact points of a run of n samples; None without contact."""
    if marionette.contacts is None:
        return None
    return contact_points(rows[rows[:, 0] < n], marionette.contacts.names)


def _in_order(events: Array) -> Array:
    """Events in order of time; the runtime reports sliding with a delay."""
    return events[np.argsort(events[:, contract.EVENT_AT["t"]], kind="stable")]


def _event(marionette: CompiledPuppet, event: Array) -> EventRecord:
    tree = marionette.tree
    fields = {part.name: float(value) for part, value in zip(contract.EVENT, event, strict=True)}
    kind, index = _EVENT_KINDS[contract.EventCode(int(fields["kind"]))], int(fields["row"])
    if index >= len(tree.strings):
        kind = _LIMIT_KINDS.get(kind, kind)
    name = tree.attributable[index] if 0 <= index < len(tree.attributable) else ""
    if index >= len(tree.attributable):
        tables = (marionette.contacts, marionette.prescribed)
        pairs = [names for table in tables if table is not None for names in table.names]
        name = pair_name(pairs[index - len(tree.attributable)])
    return EventRecord(fields["t"], kind, name, fields["impulse"], fields["speed"])
