"""Many runs at once: states x inputs -> Trajectories.

Lanes are runs that the vector unit of the processor advances together. q_D and q_K are the dynamic
and driven coordinates; slip is the length that a winch has let out, and a ledger a table of
energies and work. A taut string pulls, a slack one does not. Breaks are the times at which the
pieces of an input meet.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

from fantoccini.base import Array, OnProgress, Progress, StateError, reporting
from fantoccini.dynamics.compiled import (
    CompiledPuppet,
    Method,
    MethodName,
    as_inputs,
    as_method,
    bind_inputs,
    check_memory,
    check_starts,
    check_steps,
    checked_end,
    count_samples,
    parameter_rows,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.batch_verdicts import BatchVerdicts
from fantoccini.dynamics.simulation.checks import check_marionette, save_times
from fantoccini.dynamics.steppers import (
    ForceSamples,
    force_names,
    ledgers_of_terms,
    may_be_redundant,
    separated_starts,
    undetermined,
)
from fantoccini.kernel.contract import PARTS
from fantoccini.kernel.runtime import Batch, RunOptions, checked_integer, default_threads
from fantoccini.motion import (
    LEDGER,
    RESIDUAL,
    SAVED,
    UNDETERMINED,
    Columns,
    Input,
    Inputs,
    State,
    Trajectories,
)

DEFAULT_SAVED = ("q_D", "v_D", "tension")
"""Arrays that a batch saves by default."""

_FORCE_SAMPLES = ("q_D", "v_D", "q_K", "v_K", "tension", "taut", "slip")
"""Arrays from which undetermined tensions are computed."""

_RUNTIME_PART = {"tension": "force", "limit_force": "force", "ledger": "energy_terms"}
"""Saved array -> the runtime's part with its values, if the names differ."""

T = TypeVar("T", State, Input)


_BYTES_PER_NUMBER = 8
"""Size of a number [bytes]."""
_PROGRESS_DELAY = 2.0
"""Delay of the progress bar [s]."""
_LEDGER_NUMBERS, _TIME_NUMBERS = 16, 4
"""Numbers per sample in memory while its ledger, and its time, are computed."""


def simulate_batch(
    marionette: Marionette,
    x0: State | Sequence[State],
    inputs: Inputs | Input | Sequence[Input] | None = None,
    t_end: float | None = None,
    *,
    method: Method | MethodName = "event",
    save_at: Array | None = None,
    save_every: int | None = None,
    save: Sequence[str] | str | None = None,
    out: Mapping[str, Array] | None = None,
    threads: int | None = None,
    parameters: Mapping[str, Array | float] | None = None,
    progress: OnProgress | None = None,
    max_memory: float | None = None,
) -> Trajectories:
    """Many runs of :func:`simulate` at once, on threads; fixed steps run in lanes.

    A run that stops early does not raise; see its status. After Ctrl-C the samples so far are
    returned, with the other runs STOPPED.

    Args:
        marionette: the puppet.
        x0: start states of equal time, or one for all.
        inputs: inputs of each run, or one for all; by default they hold still.
        t_end: end of the runs [s]; by default the end of the inputs.
        method: method of :func:`simulate`.
        save_at: (n,) times of samples (event-driven only) [s]; by default start and end.
        save_every: number of steps per sample (not event-driven); by default 1.
        save: ``all``, or names of the arrays to save; by default q_D, v_D and tension, and also
            undetermined without contact and with more strings than degrees of freedom.
        out: name -> array for the results, with the shape of the batch's: C-contiguous
            (n, T, width); others are new. ``force`` holds tension and limit_force,
            ``energy_terms`` the entries of the ledger.
        threads: number of threads; by default all processors.
        parameters: name -> value, or (n,) values, one for each run; by default the marionette's
            own. Parameters of winches are equal in all runs.
        progress: callback for a progress bar, with the mean simulated time [s].
        max_memory: largest memory of the arrays [bytes]; by default half of the free memory.

    Raises:
        StateError: a state violates a row, the step is too long for a chain or a spring, or
            the arrays do not fit in memory.
        InputError: inputs do not start where their states are.
        TypeError: ``x0`` is not a state or states, or ``inputs`` not inputs.
        ValueError: an argument is invalid.
    """
    method_options = as_method(method)
    name = method_options.name
    check_marionette(marionette)
    options = marionette.run_options(
        **method_options.options,
        save_steps=False,
        max_memory=max_memory,
        save_every=1 if save_every is None else save_every,
    )
    save_at = save_times(save_at, save_every, name, -np.inf, np.inf)
    states = marionette.states(_as_list(x0, State, "x0", "marionette.rest()"))
    t = states.t
    if inputs is None:
        inputs = Input.hold(marionette).shifted(t)
    elif not isinstance(inputs, Inputs):
        inputs = _as_list(inputs, Input, "inputs", "Input.waypoints()")
    batch_inputs = as_inputs(inputs)
    p = parameter_rows(marionette, parameters)
    n = max(len(states), len(batch_inputs), len(p))
    if not {len(states), len(batch_inputs), len(p)} <= {1, n}:
        parameter_text = f" and {len(p)} values of parameters" if len(p) > 1 else ""
        raise StateError(
            f"{len(states)} states and {len(batch_inputs)} inputs{parameter_text}; needed: equal "
            "numbers of them, or a single one"
        )
    t_end = checked_end(batch_inputs.end if t_end is None else t_end, t)
    bound = bind_inputs(marionette, batch_inputs, states.q_K, states.v_K, t, t_end)
    states = separated_starts(marionette, states, p)
    check_starts(marionette, states, name, p)
    check_steps(marionette, name, states, p, options.dt)
    if threads is not None:
        threads = checked_integer("threads", threads, minimum=1)
    saved_names = _saved(marionette, save)
    runtime_parts = _runtime_parts(saved_names)
    _check_memory(marionette, name, options, runtime_parts, n, t, t_end, save_at, out or {})
    times = _times(name, options, t, t_end, save_at)
    library = marionette.libraries.batch_library_of(name)
    batch = Batch(
        library=library,
        n=n,
        t=t,
        t_end=t_end,
        q_D=states.q_D,
        v_D=states.v_D,
        slip=states.slip,
        breaks=bound.breaks,
        coef=bound.coef,
        base=bound.base,
        force=bound.force,
        p=p,
        winches=marionette.winches,
        options=options,
        times=times,
        parts=_parts(marionette, runtime_parts, n, len(times), out or {}),
    )
    threads = min(default_threads() if threads is None else threads, -(-n // library.width))
    # After Ctrl-C the samples so far are returned; other runs keep their first status.
    time_progress = None if progress is None else partial(_in_seconds, progress, t_end - t)
    bar = reporting(f"{n} runs", time_progress, delay=_PROGRESS_DELAY)
    with bar as show, contextlib.suppress(KeyboardInterrupt):
        batch.run(threads, show)
    BatchVerdicts(marionette, batch, bound, name).decide()
    return _trajectories(marionette, batch, name, saved_names)


def _in_seconds(progress: OnProgress, duration: float, progress_by_run: Progress) -> None:
    """Reports the mean simulated time instead of the number of finished runs."""
    progress(Progress(done=progress_by_run.share * duration, total=duration))


def _as_list(items: object, kind: type[T], name: str, maker: str) -> list[T]:
    """List of one or several objects of a kind."""
    objects = [items] if isinstance(items, kind) else items
    if (
        isinstance(objects, Sequence)
        and objects
        and all(isinstance(entry, kind) for entry in objects)
    ):
        return list(objects)
    raise TypeError(
        f"{name} is {items!r}; it must be {kind.__name__}, as {maker} gives it, or a list of one "
        "or more of them"
    )


def _times(
    method: str, options: RunOptions, t: float, t_end: float, save_at: Array | None
) -> Array:
    """Times of the samples [s]."""
    if method == "event":
        return np.union1d([] if save_at is None else save_at, [t, t_end])
    dt, save_every = options.dt, options.save_every
    n_steps = max(1, int(np.ceil((t_end - t) / dt - 1e-6)))
    steps = np.append(np.arange(0, n_steps, save_every), n_steps)
    return np.append(t + steps[:-1] * dt, t_end)


def _saved(marionette: CompiledPuppet, save: Sequence[str] | str | None) -> tuple[str, ...]:
    """Names of the arrays to save; "all" omits those that need contact, or no contact."""
    has_contact = marionette.contacts is not None
    if save is None:
        has_redundant = not has_contact and may_be_redundant(marionette, winches=True)
        return (*DEFAULT_SAVED, UNDETERMINED) if has_redundant else DEFAULT_SAVED
    if save == "all":
        return tuple(name for name in SAVED if name != (UNDETERMINED if has_contact else RESIDUAL))
    names = (save,) if isinstance(save, str) else tuple(save)
    for name in names:
        if name not in SAVED:
            raise ValueError(f"save has {name!r}; needed: 'all' or names of {', '.join(SAVED)}")
    if has_contact and UNDETERMINED in names:
        raise ValueError(
            "save has 'undetermined', but a batch does not store contact points, which share the "
            "forces; simulate such runs one by one"
        )
    return names


def _runtime_parts(saved: tuple[str, ...]) -> tuple[str, ...]:
    """Arrays that the runtime writes for those to save."""
    if UNDETERMINED not in saved:
        return saved
    return tuple(dict.fromkeys([*(s for s in saved if s != UNDETERMINED), *_FORCE_SAMPLES]))


def _check_memory(
    marionette: CompiledPuppet,
    method: str,
    options: RunOptions,
    saved: tuple[str, ...],
    n: int,
    t: float,
    t_end: float,
    save_at: Array | None,
    out: Mapping[str, Array],
) -> None:
    """Raises StateError if the arrays of a batch do not fit in memory."""
    if method == "event":
        n_samples = 2.0 + (0 if save_at is None else len(save_at))
    else:
        n_samples = count_samples(options, t, t_end)
    widths, new_arrays = (
        _widths(marionette),
        {_RUNTIME_PART.get(name, name) for name in saved} - set(out),
    )
    bytes_per_sample = sum(
        widths[name] * (1 if name == "taut" else _BYTES_PER_NUMBER) for name in new_arrays
    )
    bytes_per_sample += _LEDGER_NUMBERS * _BYTES_PER_NUMBER if "ledger" in saved else 0
    n_bytes = n_samples * (n * bytes_per_sample + _TIME_NUMBERS * _BYTES_PER_NUMBER)
    check_memory(method, options, t, t_end, n_samples, n_bytes)


def _widths(marionette: CompiledPuppet) -> dict[str, int]:
    """Part of the runtime -> number of values per sample."""
    return {part.name: part.numel(marionette.tree.sizes) for part in PARTS}


def _parts(
    marionette: CompiledPuppet,
    saved: tuple[str, ...],
    n: int,
    n_times: int,
    out: Mapping[str, Array],
) -> dict[str, Array]:
    """Arrays for the runtime: those of ``out``, and new ones. All are filled with NaN."""
    widths = _widths(marionette)
    requested = {_RUNTIME_PART.get(name, name) for name in saved}
    for name in out:
        if name not in requested:
            raise ValueError(
                f"out has an array {name!r}, which this batch does not write; allowed: "
                f"{', '.join(sorted(requested))} ('force' is tension and limit_force in one array, "
                "'energy_terms' the entries of the ledger)"
            )
    for (name, part), (other_name, other_part) in combinations(out.items(), 2):
        if np.may_share_memory(part, other_part):
            raise ValueError(
                f"out[{other_name!r}] and out[{name!r}] share their memory; each needs its own "
                "array"
            )
    parts = {}
    for name in sorted(requested):
        dtype = np.dtype(np.bool_ if name == "taut" else np.float64)
        shape = (n, n_times, widths[name])
        part = out[name] if name in out else np.empty(shape, dtype=dtype)
        if part.shape != shape or part.dtype != dtype or not part.flags.c_contiguous:
            raise StateError(
                f"out[{name!r}] is {part.dtype} of shape {part.shape}; it must be a C-contiguous "
                f"{dtype} array of shape {shape}"
            )
        if not part.flags.writeable:
            raise ValueError(f"out[{name!r}] is read-only")
        part.fill(False if name == "taut" else np.nan)
        parts[name] = part
    return parts


def _trajectories(
    marionette: Marionette, batch: Batch, method: str, saved: tuple[str, ...]
) -> Trajectories:
    tree, n_s = marionette.tree, len(marionette.tree.strings)
    strings = tuple(s.name for s in tree.strings)
    limits = tuple(limit.name for limit in tree.limits)
    arrays: dict[str, Any] = {}
    for name in saved:
        if name == UNDETERMINED:
            flags = _read_only(_undetermined(marionette, batch, method))
            arrays[name] = Columns(force_names(marionette), flags, "string or driven velocity")
            continue
        view = _read_only(batch.parts[_RUNTIME_PART.get(name, name)])
        if name in ("tension", "taut", "slip"):
            arrays[name] = Columns(strings, view[..., :n_s], "string")
        elif name == "limit_force":
            arrays[name] = Columns(limits, view[..., n_s:], "limit")
        elif name == "ledger":
            arrays[name] = Columns(LEDGER, _read_only(ledgers_of_terms(view)), "entry")
        elif name == RESIDUAL:
            arrays[name] = view[..., 0]
        else:
            arrays[name] = view
    names = tuple(tree.parameters)
    values = np.ascontiguousarray(np.broadcast_to(batch.p, (batch.n, len(names))))
    result_fields = ("status", "reached", "violation", "catches", "releases")
    arrays |= {name: _read_only(getattr(batch, name)) for name in result_fields}
    return Trajectories(
        t=_read_only(batch.times),
        attribution=Columns(tree.attributable, batch.attribution, "string, limit or drive"),
        method=method,
        coordinates=marionette.coordinates,
        puppet=marionette.current_puppet,
        parameters=Columns(names, _read_only(values), "parameter"),
        **arrays,
    )


def _undetermined(marionette: Marionette, batch: Batch, method: str) -> Array:
    """(n, T, strings and driven velocities) masks of undetermined tensions and efforts."""
    n_s, parts = len(marionette.tree.strings), batch.parts
    flags = np.zeros((batch.n, len(batch.times), len(force_names(marionette))), dtype=bool)
    for i in range(batch.n):
        is_done = np.isfinite(parts["q_D"][i]).all(axis=1) & np.isfinite(parts["force"][i]).all(
            axis=1
        )
        samples = ForceSamples(
            q_D=parts["q_D"][i][is_done],
            v_D=parts["v_D"][i][is_done],
            q_K=parts["q_K"][i][is_done],
            v_K=parts["v_K"][i][is_done],
            force=parts["force"][i][is_done],
            taut=parts["taut"][i][is_done, :n_s],
            slip=parts["slip"][i][is_done],
            method=method,
        )
        if len(samples):
            run_puppet = marionette.with_p(batch.p[i % len(batch.p)])
            flags[i, is_done] = undetermined(run_puppet, samples).values
    return flags


def _read_only(array: Array) -> Array:
    view = array.view()
    view.setflags(write=False)
    return view
