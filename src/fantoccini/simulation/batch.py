"""Many runs at once: states x inputs -> Trajectories."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import BOOKS, PARTS
from fantoccini.errors import ARRIVED, Status
from fantoccini.marionette import (
    STOPPED_BY,
    Marionette,
    Method,
    MethodName,
    as_method,
    check_memory,
    check_starts,
    check_step,
    contradiction,
    many_of,
    may_contradict,
    overpulled,
    ready_many,
    rows_of_steps,
)
from fantoccini.motion import SAVED, Columns, Input, Inputs, State, Trajectories
from fantoccini.motion.trajectory import LEDGER
from fantoccini.runtime import Batch, RunOptions, default_threads, whole
from fantoccini.simulation.bar import Bar
from fantoccini.simulation.checks import check_marionette, save_times
from fantoccini.simulation.soundness import gains, verdict

SAVE = ("q_D", "v_D", "tension")
"""What a batch saves unless told otherwise."""

_PART = {"tension": "force", "limit_force": "force", "ledger": "books"}
"""What is saved -> the runtime's part that it is read from, where the names differ."""

_NUMBER = 8
"""Bytes."""
_LEDGER_NUMBERS = 16
"""That a row's ledger takes while it is made."""
_TIMES = 4
"""Numbers for every row's time while the times are made."""


def simulate_batch(
    marionette: Marionette,
    x0: State | Sequence[State],
    inputs: Inputs | Input | Sequence[Input] | None = None,
    t_end: float | None = None,
    *,
    method: Method | MethodName = "event",
    save_at: Array | None = None,
    save_every: int = 1,
    save: Sequence[str] | str | None = None,
    out: Mapping[str, Array] | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    max_memory: float | None = None,
) -> Trajectories:
    """Many runs of :func:`simulate` at once, on threads, and fixed steps in lanes.

    A run that stops early is told by its status and does not raise; Ctrl-C keeps what was reached,
    with the others STOPPED.

    Args:
        marionette: the puppet.
        x0: states of one time where the runs start, or one for all.
        inputs: as many as states, or one for all; they hold still when not given.
        t_end: end of the runs [s]; the end of the inputs when not given.
        method: as in :func:`simulate`; the event-driven method has its compiled integrator.
        save_at: (n,) times to write (event-driven only) [s]; start and end when not given.
        save_every: write every so many steps (not event-driven).
        save: ``all``, or names of the arrays to save; q_D, v_D and tension when not given.
        out: arrays to write into, by name, with the shapes that the batch gives: C-contiguous
            (n, T, width); new ones where not given. ``force`` holds tension and limit_force side by
            side, ``books`` what the ledger is made of.
        threads: all processors when not given.
        progress: called with the time reached, for a progress bar [s].
        max_memory: for the arrays [bytes]; half of the memory that is free when not given.

    Raises:
        StateError: a state breaks a string or limit, the step is too long for a chain or a spring,
            or the arrays do not fit in memory.
        InputError: inputs do not start where their states are.
        TypeError: what is given are no states or inputs.
        ValueError: an argument that makes no sense.
    """
    chosen = as_method(method)
    method = chosen.name
    if getattr(chosen, "integrator", None) is not None:
        raise ValueError("integrator goes with a single run; batches have the compiled one")
    check_marionette(marionette)
    options = marionette.model.run_options(
        **chosen.options, save_steps=False, save_every=save_every, max_memory=max_memory
    )
    save_at = save_times(save_at, method, -np.inf, np.inf)
    states = _listed(x0, State, "x0", "marionette.rest()")
    if inputs is not None and not isinstance(inputs, Inputs):
        inputs = _listed(inputs, Input, "inputs", "Input.waypoints()")
    x0 = marionette.model.states(states)
    t = x0.t
    given = many_of(Input.hold(marionette).shifted(t) if inputs is None else inputs)
    n = _n_runs(len(x0), len(given))
    t_end = given.end if t_end is None else float(t_end)
    if not np.isfinite(t_end) or not t_end > t:
        raise ValueError(f"t_end is {t_end}; it must be later than the start at {t}")
    bound = ready_many(marionette.model, given, x0.q_K, x0.v_K, t, t_end)
    check_starts(marionette.model, x0, method)
    check_step(marionette.model, method, x0.q_D, x0.q_K, options.dt)
    if threads is not None:
        threads = whole("threads", threads, least=1)
    names = _saved(save)
    _check_memory(marionette, method, options, names, n, t, t_end, save_at, out or {})
    times = _times(method, options, t, t_end, save_at)
    parts = _parts(marionette, names, n, len(times), out or {})
    batch = Batch(
        n=n, t=t, t_end=t_end,
        q_D=x0.q_D, v_D=x0.v_D, slip=x0.slip,
        breaks=bound.breaks, coef=bound.coef, base=bound.base, force=bound.force,
        p=marionette.p, winches=marionette.winches, options=options, times=times, parts=parts,
        status=np.full(n, Status.STOPPED, dtype=np.int32), reached=np.full(n, np.nan),
        violation=np.zeros(n),
        catches=np.zeros(n, dtype=np.int64), releases=np.zeros(n, dtype=np.int64),
        blame=np.zeros((n, len(marionette.tree.blamable))),
        end_q_D=np.full((n, x0.q_D.shape[1]), np.nan),
        end_v_D=np.full((n, x0.v_D.shape[1]), np.nan),
    )  # fmt: skip
    library = marionette.model.compiled.batch_library_of(method)
    threads = min(default_threads() if threads is None else threads, -(-n // library.width))
    # Ctrl-C keeps what was reached; what was not has the status it began with.
    with Bar(f"{n} runs", progress, t, t_end) as bar, contextlib.suppress(KeyboardInterrupt):
        batch.run(library, threads, bar.look)
    if may_contradict(marionette.model):
        _find_contradictions(marionette, batch, bound, method)
    if method != "event":
        _judge(marionette, batch)
    return _trajectories(marionette, batch, method, names)


def _find_contradictions(
    marionette: Marionette, batch: Batch, inputs: Inputs, method: str
) -> None:
    """Names the runs that redundant strings stopped; of those that fixed steps brought through,
    where the tensions are saved with the motion."""
    n_s, strings = len(marionette.tree.strings), [s.name for s in marionette.tree.strings]
    table, none = marionette.coordinates, np.zeros(marionette.tree.n_rows, dtype=bool)
    parts, looks = batch.parts, method != "event" and {"q_D", "v_D", "force"} <= set(batch.parts)
    for i in np.flatnonzero(np.isfinite(batch.reached)):
        given = inputs[i if len(inputs) > 1 else 0]

        def motion(t: float, q_D: Array, v_D: Array, given: Input = given) -> tuple[State, Array]:
            q_K, v_K, acc_K = given.evaluate(t)
            # Winches that slip are no rigid strings: how far they have says nothing here.
            return State(float(t), q_D, v_D, q_K, v_K, none, coordinates=table), acc_K

        def saved(row: int, i: int = i, motion=motion) -> tuple[State, Array]:
            return motion(batch.times[row], parts["q_D"][i, row], parts["v_D"][i, row])

        found = None
        if batch.status[i] in STOPPED_BY:
            found = contradiction(
                marionette.model, *motion(batch.reached[i], batch.end_q_D[i], batch.end_v_D[i])
            )
        elif looks and batch.status[i] in ARRIVED:
            row = overpulled(marionette.model, parts["force"][i, :, :n_s], saved)
            found = None if row is None else contradiction(marionette.model, *saved(row))
        if found:
            batch.status[i], batch.blame[i] = Status.REDUNDANT_STRINGS, 0.0
            batch.blame[i, [strings.index(name) for name in found.names]] = 1.0


def _judge(marionette: Marionette, batch: Batch) -> None:
    """Names the runs that reached their end and are not sound; of energy, where books are kept."""
    done = np.isin(batch.status, ARRIVED) & (batch.reached >= batch.t_end)
    gain = np.zeros(batch.n)
    if "books" in batch.parts and np.any(done):
        columns = np.moveaxis(_ledger(batch.parts["books"][done]), -1, 0)
        kinetic, potential, work, residual = (
            columns[LEDGER.index(name)] for name in ("kinetic", "potential", "work", "residual")
        )
        gain[done] = gains(marionette, kinetic, potential, work, residual)
    for i in np.flatnonzero(done):
        found = verdict(float(batch.violation[i]), float(gain[i]))
        if found is not Status.DONE:
            batch.status[i], batch.blame[i] = found, 0.0


def _listed(given, kind: type, name: str, maker: str) -> list:
    """One or many of a kind, as a list."""
    many = [given] if isinstance(given, kind) else given
    if isinstance(many, Sequence) and many and all(isinstance(one, kind) for one in many):
        return list(many)
    raise TypeError(
        f"{name} is {given!r}; it must be {kind.__name__}, as {maker} gives it, or a list of one "
        "or more of them"
    )


def _n_runs(n_states: int, n_inputs: int) -> int:
    """How many runs; one state or one input goes with all."""
    if n_states != n_inputs and 1 not in (n_states, n_inputs):
        raise ValueError(
            f"{n_states} states and {n_inputs} inputs do not go together; give as many of one as "
            "of the other, or a single one"
        )
    return max(n_states, n_inputs)


def _times(
    method: str, options: RunOptions, t: float, t_end: float, save_at: Array | None
) -> Array:
    """The times of the rows."""
    if method == "event":
        return np.union1d([] if save_at is None else save_at, [t, t_end])
    dt, every = options.dt, options.save_every
    n_steps = max(1, int(np.ceil((t_end - t) / dt - 1e-6)))
    steps = np.append(np.arange(0, n_steps, every), n_steps)
    return np.append(t + steps[:-1] * dt, t_end)


def _saved(save: Sequence[str] | str | None) -> tuple[str, ...]:
    if save is None:
        return SAVE
    if save == "all":
        return SAVED
    names = (save,) if isinstance(save, str) else tuple(save)
    for name in names:
        if name not in SAVED:
            raise ValueError(f"save names {name!r}; it takes 'all' or names of {', '.join(SAVED)}")
    return names


def _check_memory(
    marionette: Marionette,
    method: str,
    options: RunOptions,
    names: tuple[str, ...],
    n: int,
    t: float,
    t_end: float,
    save_at: Array | None,
    out: Mapping[str, Array],
) -> None:
    """Raises ValueError where the arrays that a batch would make do not fit in memory."""
    if method == "event":
        n_rows = 2.0 + (0 if save_at is None else len(save_at))
    else:
        n_rows = rows_of_steps(options, t, t_end)
    widths, made = _widths(marionette), {_PART.get(name, name) for name in names} - set(out)
    row = sum(widths[name] * (1 if name == "taut" else _NUMBER) for name in made)
    row += _LEDGER_NUMBERS * _NUMBER if "ledger" in names else 0
    check_memory(method, options, t, t_end, n_rows, n_rows * (n * row + _TIMES * _NUMBER))


def _widths(marionette: Marionette) -> dict[str, int]:
    """Numbers in a row, by the runtime's part."""
    sizes = marionette.tree.sizes
    return {part.name: part.numel(sizes) for part in PARTS}


def _parts(
    marionette: Marionette,
    names: tuple[str, ...],
    n: int,
    n_times: int,
    out: Mapping[str, Array],
) -> dict[str, Array]:
    """The runtime's arrays: those of ``out`` where given, and new ones. All begin as NaN."""
    widths = _widths(marionette)
    wanted = {_PART.get(name, name) for name in names}
    for name in out:
        if name not in wanted:
            raise ValueError(
                f"out has an array {name!r}, which this batch does not write; it writes "
                f"{', '.join(sorted(wanted))} ('force' is tension and limit_force side by side, "
                "'books' what the ledger is made of)"
            )
    given = list(out.items())
    for i, (name, part) in enumerate(given):
        for other, same in given[:i]:
            if np.may_share_memory(part, same):
                raise ValueError(
                    f"out[{name!r}] and out[{other!r}] share their memory; each takes its own array"
                )
    parts = {}
    for name in sorted(wanted):
        kind = np.bool_ if name == "taut" else np.float64
        shape = (n, n_times, widths[name])
        part = out.get(name)
        if part is None:
            part = np.empty(shape, dtype=kind)
        elif part.shape != shape or part.dtype != kind or not part.flags.c_contiguous:
            raise ValueError(
                f"out[{name!r}] is {part.dtype} of shape {part.shape}; it must be a C-contiguous "
                f"{np.dtype(kind)} array of shape {shape}"
            )
        elif not part.flags.writeable:
            raise ValueError(f"out[{name!r}] is read-only")
        part.fill(np.nan if kind is np.float64 else False)
        parts[name] = part
    return parts


def _trajectories(
    marionette: Marionette, batch: Batch, method: str, names: tuple[str, ...]
) -> Trajectories:
    tree, n_s = marionette.tree, len(marionette.tree.strings)
    strings = tuple(s.name for s in tree.strings)
    limits = tuple(limit.name for limit in tree.limits)
    views = {name: _read_only(part) for name, part in batch.parts.items()}
    made: dict[str, Array | Columns] = {}
    for name in names:
        view = views[_PART.get(name, name)]
        if name == "tension":
            made[name] = Columns(strings, view[..., :n_s], "string")
        elif name == "limit_force":
            made[name] = Columns(limits, view[..., n_s:], "limit")
        elif name == "taut":
            made[name] = Columns(strings, view[..., :n_s], "string")
        elif name == "slip":
            made[name] = Columns(strings, view, "string")
        elif name == "ledger":
            made[name] = Columns(LEDGER, _read_only(_ledger(view)), "entry")
        else:
            made[name] = view
    return Trajectories(
        t=_read_only(batch.times),
        status=_read_only(batch.status),
        reached=_read_only(batch.reached),
        violation=_read_only(batch.violation),
        catches=_read_only(batch.catches),
        releases=_read_only(batch.releases),
        blame=Columns(tree.blamable, batch.blame, "string, limit or drive"),
        method=method,
        coordinates=marionette.coordinates,
        puppet=marionette.model.described,
        **made,
    )


def _ledger(books: Array) -> Array:
    """(n, T, 7) the ledger from (n, T, 6) books."""
    of = dict(zip(BOOKS, np.moveaxis(books, -1, 0), strict=True))
    of["slip"] = of.pop("slip_loss")
    energy = of["kinetic"] + of["potential"]
    residual = energy - energy[:, :1] - of["work"] + of["damping"] + of["impact"] + of["slip"]
    return np.stack([(of | {"residual": residual})[name] for name in LEDGER], axis=-1)


def _read_only(array: Array) -> Array:
    view = array.view()
    view.setflags(write=False)
    return view
