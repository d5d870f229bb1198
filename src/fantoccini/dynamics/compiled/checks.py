"""Validation of a run's arguments: step, memory, start state, inputs.

q_D are the dynamic and q_K the driven coordinates, v_D and v_K their velocities. A row is a string
or a joint limit, and breaks are the times at which pieces of an input meet. A marionette is a
puppet with its compiled equations; `marionette.puppet` is the description in its file. h is the gap
of a string, path length minus string length; hdot and hddot are its rates. A taut string pulls, a
slack one does not.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array, InputError, Mistake, StateError, floats, is_number
from fantoccini.dynamics.compiled.active_set import ROW_TOLERANCES
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.critical_step import critical_step
from fantoccini.kernel.runtime import RunOptions, memory
from fantoccini.motion import Input, Inputs, State, States, joints

_CHUNK_SIZE = 4096
"""Number of states evaluated together, which bounds the memory."""
_MAX_LISTED = 20
"""Maximum number of mistakes of one kind in a message."""


def checked_end(t_end: object, t: float) -> float:
    """The end of a run that starts at t [s].

    Raises:
        ValueError: ``t_end`` is not a finite time later than the start.
    """
    if not is_number(t_end) or not t < floats(t_end) < np.inf:
        raise ValueError(
            f"t_end is {t_end!r}; it must be a finite time later than the start at {t:g} s"
        )
    return float(t_end)


def check_step(marionette: CompiledPuppet, method: str, q_D: Array, q_K: Array, dt: float) -> None:
    """Raises StateError if time-stepping would be unstable on a spring or a chain.

    dt <= 2 (sqrt(1 + zeta^2) - zeta) / omega,   omega = 2 sqrt(k / m) cos(pi / 2n)

    omega is the fastest vibration of a chain with fixed ends, n the number of its pieces, k their
    stiffness and m each of its masses; zeta = omega c / 2k is its damping ratio, c a piece's
    damping. Both forces are those at the step's start, v+ = v - dt (omega^2 q + 2 zeta omega v) and
    q+ = q + dt v+, with an eigenvalue -1 at (omega dt)^2 + 4 zeta omega dt = 4. For springs see
    :mod:`fantoccini.dynamics.compiled.critical_step`.

    Args:
        marionette: the puppet.
        method: method of the run; only ``timestepping`` evaluates forces at the step's start.
        q_D, q_K: (..., n_qD) dynamic, (..., n_qK) kinematic (driven) configurations at the start.
        dt: length of the steps [s].
    """
    if method != "timestepping":
        return
    if result := critical_step(marionette, q_D, q_K, dt):
        max_dt, name = result
        raise StateError(
            f"dt = {dt:g} s is too long for the spring {name}: with method='timestepping' its "
            f"vibrations grow without bound in steps above {max_dt:.2g} s (2 / omega without "
            "damping). Take a shorter dt, method='event', or a softer or less damped spring"
        )
    for chain in marionette.tree.chains:
        n, length = chain.pieces, np.min(chain.unstretched_length(q_D, q_K, marionette.number))
        mass_share = marionette.tree.links[chain.points[1].link].mass_shares[0]
        k = marionette.number(chain.stiffness) * n / length
        m = marionette.number(mass_share.amount) * mass_share.volume
        omega = 2.0 * np.sqrt(k / m) * np.cos(np.pi / (2 * n))
        zeta = 0.5 * omega * marionette.number(chain.damping) / marionette.number(chain.stiffness)
        max_dt = 2.0 / (omega * (np.hypot(1.0, zeta) + zeta))
        if not dt <= max_dt:
            raise StateError(
                f"dt = {dt:g} s is too long for the chain {chain.name}: with method="
                f"'timestepping' its vibrations grow without bound in steps above {max_dt:.2g} s. "
                "Take a shorter dt, method='event', or fewer, softer, heavier or less damped pieces"
            )


def check_steps(
    marionette: CompiledPuppet, method: str, states: States, p: Array, dt: float
) -> None:
    """Calls :func:`check_step` for one state or many, at parameters (1 or n, n_p)."""
    rows, first = np.unique(p, axis=0, return_index=True)
    if len(rows) == 1 or not (marionette.tree.chains or marionette.tree.springs):
        check_step(marionette.with_p(p[0]), method, states.q_D, states.q_K, dt)
        return
    for i in map(int, np.sort(first)):
        chunk = states.subset(slice(i, i + 1) if len(states) > 1 else slice(None))
        check_step(marionette.with_p(p[i]), method, chunk.q_D, chunk.q_K, dt)


def check_samples(
    marionette: CompiledPuppet,
    method: str,
    options: RunOptions,
    t: float,
    t_end: float,
    save_at: Array | None = None,
) -> None:
    """Raises StateError if the samples of a run from t to t_end [s] will not fit in memory.

    An event-driven run that saves its own steps (no ``save_at``) stops when its samples reach the
    bound.
    """
    if method != "event":
        n = count_samples(options, t, t_end)
    elif save_at is not None:
        n = len(save_at)
    else:
        return
    n_columns = sum(marionette.sample_layout.widths.values())
    check_memory(method, options, t, t_end, n, memory.bytes_of(n, n_columns))


def count_samples(options: RunOptions, t: float, t_end: float) -> float:
    """Number of samples of a run in fixed steps; StateError if the clock cannot resolve dt."""
    finest = 4.0 * np.spacing(max(1.0, abs(t), abs(t_end)))
    if options.dt < min(finest, 0.5 * (t_end - t)):
        raise StateError(
            f"dt is {options.dt:g} s; the clock of a run from {t:g} s to {t_end:g} s resolves "
            f"{finest:.2g} s. Take longer steps, or count time from a start near 0"
        )
    return np.ceil((t_end - t) / options.dt / options.save_every) + 1.0


def check_memory(
    method: str, options: RunOptions, t: float, t_end: float, n: float, n_bytes: float
) -> None:
    """Raises StateError unless ``n_bytes`` bytes for n samples from t to t_end [s] may be used."""
    max_bytes = memory.bound(n_bytes, options.max_memory)
    if n_bytes <= max_bytes:
        return
    samples = f"{n:.3g} samples from {t:g} s to {t_end:g} s"
    advice = "give fewer times in save_at"
    if method != "event":
        every = np.ceil(1.1 * options.save_every * n_bytes / max_bytes)
        samples += f", one every {options.save_every * options.dt:g} s,"
        advice = f"write fewer with save_every={every:.0f}"
    raise StateError(
        f"{samples} need {n_bytes / 1e9:.3g} GB of memory; {max_bytes / 1e9:.3g} GB may be used. "
        "End "
        f"sooner, {advice}, or allow more with max_memory"
    )


def check_start(marionette: CompiledPuppet, x: State, method: str = "event") -> None:
    """Raises StateError with rows and violations if a run cannot begin at a state.

    ``event`` and ``variational`` require that no string is longer than its length, or at its length
    and lengthening, and that strings marked taut are not shorter. ``timestepping`` may start from
    any state that its steps produce: it corrects violations and catches imminent ones.
    """
    check_starts(marionette, marionette.states([x]), method)


def check_starts(
    marionette: CompiledPuppet, states: States, method: str = "event", p: Array | None = None
) -> None:
    """Calls :func:`check_start` for many states; the message names the first invalid one.

    Args:
        marionette: the puppet.
        states: one state for all parameters, or one for each.
        method: method of the runs.
        p: (1 or n, n_p) parameters of the runs; by default the puppet's.
    """
    p = marionette.p[None] if p is None else p
    is_timestepping = method == "timestepping"
    _check_contact(marionette, states, method)
    if len(states) == 1 and len(p) > 1:
        states = states.repeated(len(p))
    for chunk_start in range(0, len(states), _CHUNK_SIZE):
        chunk = states.subset(slice(chunk_start, chunk_start + _CHUNK_SIZE))
        chunk_p = p if len(p) == 1 else p[chunk_start : chunk_start + _CHUNK_SIZE]
        h, hdot = _gaps_and_rates(marionette, chunk, chunk_p)
        scale = marionette.row_scales(chunk.q_D, chunk.q_K)
        wires, cannot_slip = marionette.two_sided, ~np.isfinite(marionette.max_forces)
        max_gap = (
            ROW_TOLERANCES.stepped_gap if is_timestepping else ROW_TOLERANCES.start_gap
        ) * scale
        # Time-stepping may continue from a state that violates rows because of its inputs.
        is_marked_taut = chunk.taut if is_timestepping else np.zeros_like(chunk.taut)
        is_violated = ~(np.where(wires, np.abs(h), h) <= max_gap) & ~is_marked_taut
        speed_scale = np.max(np.abs(chunk.v_D), axis=1, initial=1.0)[:, None]
        rest_speed = ROW_TOLERANCES.rest_speed * speed_scale
        # A winch that slips absorbs the speed.
        passes_bound = ~(np.where(wires, np.abs(hdot), hdot) <= rest_speed) & (wires | cannot_slip)
        # A string slack by more than rounding is caught right after the start of the run.
        is_open = (h < -ROW_TOLERANCES.closed_gap * scale) & ~chunk.taut & ~wires
        passes_bound &= ~is_violated & ~is_open & (np.abs(h) <= max_gap) & (not is_timestepping)
        is_slack = chunk.taut & ~(h >= -max_gap) & ~is_violated & (not is_timestepping)
        is_wrong = is_violated | passes_bound | is_slack
        if not np.any(is_wrong):
            continue
        i = int(np.argmax(np.any(is_wrong, axis=1)))
        subject = f"states[{chunk_start + i}]" if len(states) > 1 else "the start state"
        rows, findings = np.flatnonzero(is_wrong[i]), []
        for r in rows:
            name = marionette.tree.row_names[r]
            if is_violated[i, r]:
                findings.append(f"{name} is violated by {h[i, r]:.3g}")
            elif is_slack[i, r]:
                findings.append(f"{name} is marked taut and slack by {-h[i, r]:.3g}")
            else:
                findings.append(f"{name} is at its bound and moves past it at {hdot[i, r]:.3g}/s")
        raise StateError(
            f"{subject} violates {len(findings)} of the strings and limits: "
            + "; ".join(findings)
            + ". marionette.project(x) gives the nearest state that does not."
        )


def refuse_contact(marionette: CompiledPuppet, what: str) -> None:
    """Raises StateError if a puppet has contact, which ``what`` does not support."""
    if marionette.puppet.touching is not None:
        text = (
            f"{marionette.name} has contact, which {what} does not support; "
            f"{_leave_out(marionette)}"
        )
        raise StateError(text)


def _leave_out(marionette: CompiledPuppet) -> str:
    """Advice on removing the contact of a puppet, with the path of its file."""
    file, _ = marionette.puppet.locate("")
    if not os.path.isfile(file):
        return "leave its contact out (contact: false)"
    return f"write contact: false in {file}, or in a copy of it"


def _check_contact(marionette: CompiledPuppet, states: States, method: str) -> None:
    """Raises StateError if a method supports no contact, or solids overlap at the start."""
    if marionette.puppet.touching is None:
        return
    if method == "variational":
        raise StateError(
            f"{marionette.name} has contact, which method={method!r} does not support; "
            f"needed: method='event' or 'timestepping', or {_leave_out(marionette)}"
        )
    allowed = ROW_TOLERANCES
    check_apart(marionette, states, allowed.touching if method == "event" else allowed.stepped_gap)


def check_apart(
    marionette: CompiledPuppet, states: States, max_overlap: float = ROW_TOLERANCES.stepped_gap
) -> None:
    """Raises StateError if solids overlap by more than ``max_overlap`` [m]."""
    if marionette.contacts is None:
        return
    for chunk_start in range(0, len(states), _CHUNK_SIZE):
        chunk = slice(chunk_start, chunk_start + _CHUNK_SIZE)
        gaps = marionette.library.gaps(
            marionette.contacts, states.q_D[chunk], states.q_K[chunk], marionette.p
        )
        too_deep = np.flatnonzero(np.any(gaps < -max_overlap, axis=1))
        if not len(too_deep):
            continue
        i = chunk_start + int(too_deep[0])
        overlaps_by_pair = marionette.overlaps(states.q_D[i], states.q_K[i], max_overlap)
        subject = f"states[{i}]" if len(states) > 1 else "the start state"
        overlap_text = "; ".join(
            f"{name} by {depth:.3g} m" for name, depth in overlaps_by_pair.items()
        )
        raise StateError(f"in {subject} solids overlap: {overlap_text}. Move them apart")


def _gaps_and_rates(marionette: CompiledPuppet, x: States, p: Array) -> tuple[Array, Array]:
    """Gaps h and rates hdot (n, n_rows) of states at parameters (1 or n, n_p)."""
    tree, table = marionette.tree, marionette.coordinates
    zeros = {"acc_K": np.zeros(table.n_vK), "u_D": np.zeros(table.n_vD)}
    evaluated = marionette.library.evaluate("dynamics", **marionette.at(x, p), **zeros)
    hdot_limit = np.zeros_like(evaluated.h_limit)
    for i, limit in enumerate(tree.limits):
        velocities = tree.links[limit.link].v
        J = evaluated.J_limit[:, : velocities.stop - velocities.start, i]
        hdot_limit[:, i] = (J * x.v_D[:, velocities]).sum(axis=1)
    hdot = evaluated.hdot - marionette.rewinding(x.slip)
    return np.hstack([evaluated.h - x.slip, evaluated.h_limit]), np.hstack([hdot, hdot_limit])


def bind_input(
    marionette: CompiledPuppet, inputs: Input, q_K: Array, v_K: Array, t: float, t_end: float
) -> Input:
    """Inputs bound to the driven configuration and velocity of a start state, for a run.

    Args:
        marionette: the puppet.
        inputs: inputs that are not bound yet.
        q_K, v_K: (n_qK,), (n_vK,) driven motion of the start state.
        t, t_end: start and end of the run [s].

    Raises:
        InputError: they belong to another puppet, begin elsewhere, or begin or end abruptly.
        StateError: a driven velocity would jump.
    """
    check_inputs(marionette, inputs, t, t_end)
    if t < inputs.start or inputs.end < t_end:
        inputs = inputs.at_rest()
    bound = inputs.bound(q_K, t, v_K)
    check_speeds(marionette, t, v_K[None], as_inputs(bound))
    return bound


def bind_inputs(
    marionette: CompiledPuppet, inputs: Inputs, q_K: Array, v_K: Array, t: float, t_end: float
) -> Inputs:
    """Inputs bound by :func:`bind_input`, for many inputs or many states: (n or 1, ...)."""
    check_inputs(marionette, inputs, t, t_end)
    ends_within = np.any(t < inputs.breaks[:, 0]) or np.any(inputs.breaks[:, -1] < t_end)
    if ends_within and not inputs.relative:
        inputs = inputs.at_rest()
    bound = inputs.bound(q_K, t, v_K)
    check_speeds(marionette, t, v_K, bound)
    return bound


def check_inputs(
    marionette: CompiledPuppet, inputs: Input | Inputs, t: float, t_end: float
) -> None:
    """Raises InputError unless inputs fit the puppet and begin and end at rest within a run."""
    inputs = as_inputs(inputs)
    needed, actual = marionette.coordinates, inputs.coordinates
    if (needed.q_K, needed.v_D) != (actual.q_K, actual.v_D):
        text = (
            "were made for a puppet with the driven coordinates "
            f"{', '.join(actual.q_K) or 'none'}; {marionette.name} has "
            f"{', '.join(needed.q_K) or 'none'}"
        )
        raise InputError([Mistake("inputs", None, "", text)])
    mistakes = []
    last = inputs.breaks[:, -1]
    boundaries = (
        ("begin", inputs.breaks[:, 0], inputs.breaks[:, 0] > t, inputs.coef[:, 0, :, 1]),
        ("end", last, last < t_end, inputs.evaluate(last)[1]),
    )
    for verb, times, is_inside, speed in boundaries:
        is_wrong = ~(np.abs(speed) <= joints.TOLERANCES.speed) & is_inside[:, None]
        if np.any(is_wrong):
            is_wrong &= ~(np.abs(speed) <= joints.tolerances(needed, inputs.breaks, inputs.coef)[1])
        for n, i in np.argwhere(is_wrong)[:_MAX_LISTED]:
            time = times[n if len(times) > 1 else 0]
            subject = f"inputs[{n}].{needed.v_K[i]}" if len(inputs) > 1 else needed.v_K[i]
            text = (
                f"the inputs {verb} at t = {time:g} s with the velocity {speed[n, i]:.6g}, and the "
                f"run lasts from {t:g} s to {t_end:g} s; needed: inputs that {verb} at rest, or a "
                "run within them"
            )
            mistakes.append(Mistake("inputs", None, subject, text))
    if mistakes:
        raise InputError(mistakes)


def check_speeds(marionette: CompiledPuppet, t: float, v_K: Array, bound: Inputs) -> None:
    """Raises StateError if driven velocities v_K (n or 1, n_vK) at t jump to bound inputs."""
    input_speeds = bound.evaluate(t)[1]
    is_wrong = ~(np.abs(input_speeds - v_K) <= joints.TOLERANCES.speed)
    if not np.any(is_wrong):
        return
    i = int(np.argmax(np.any(is_wrong, axis=1)))
    rows = np.flatnonzero(is_wrong[i])
    names = [marionette.coordinates.v_K[r] for r in rows]
    state_speeds, start_speeds = (
        np.broadcast_to(v_K, is_wrong.shape)[i],
        np.broadcast_to(input_speeds, is_wrong.shape)[i],
    )
    subject = f" of run {i}" if len(is_wrong) > 1 else ""
    raise StateError(
        f"the velocity of {', '.join(names)}{subject} would jump at t = {t:g} s: the state has "
        f"{state_speeds[rows[0]]:.6g}, the inputs begin with {start_speeds[rows[0]]:.6g}"
    )


def as_inputs(inputs: Input | Inputs | Sequence[Input]) -> Inputs:
    """One or several inputs, stacked."""
    if isinstance(inputs, Inputs):
        return inputs
    return Inputs.stack([inputs] if isinstance(inputs, Input) else list(inputs))
