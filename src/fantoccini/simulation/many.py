"""Many runs at once: states x inputs -> Trajectories."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import BOOKS, PARTS
from fantoccini.errors import ARRIVED, Status
from fantoccini.marionette import (
    Marionette,
    check_memory,
    check_starts,
    check_step,
    many_of,
    ready_many,
    rows_of_steps,
)
from fantoccini.motion import SAVED, Columns, Input, Inputs, State, Trajectories
from fantoccini.motion.trajectory import LEDGER
from fantoccini.runtime import Batch, RunOptions, default_threads, whole
from fantoccini.simulation.bar import Bar
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


def simulate_many(
    marionette: Marionette,
    states: State | Sequence[State],
    inputs: Inputs | Input | Sequence[Input] | None,
    t_end: float | None,
    method: str,
    options: RunOptions,
    *,
    save_at: Array | None,
    save: Sequence[str] | str | None,
    out: Mapping[str, Array] | None,
    threads: int | None,
    progress: Callable[[float], None] | None,
) -> Trajectories:
    """The batch behind :func:`fantoccini.simulation.simulate`, which has the arguments' meaning."""
    states = _listed(states, State, "x0", "marionette.rest()")
    if inputs is not None and not isinstance(inputs, Inputs):
        inputs = _listed(inputs, Input, "inputs", "Input.waypoints()")
    x0 = marionette.states(states)
    t = x0.t
    given = many_of(Input.hold(marionette).shifted(t) if inputs is None else inputs)
    n = _n_runs(len(x0), len(given))
    t_end = given.end if t_end is None else float(t_end)
    if not np.isfinite(t_end) or not t_end > t:
        raise ValueError(f"t_end is {t_end}; it must be later than the start at {t}")
    bound = ready_many(marionette, given, x0.q_K, x0.v_K, t, t_end)
    check_starts(marionette, x0, method)
    check_step(marionette, method, x0.q_D, x0.q_K, options.dt)
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
    )  # fmt: skip
    library = marionette.batch_library_of(method)
    threads = min(default_threads() if threads is None else threads, -(-n // library.width))
    # Ctrl-C keeps what was reached; what was not has the status it began with.
    with Bar(f"{n} runs", progress, t, t_end) as bar, contextlib.suppress(KeyboardInterrupt):
        batch.run(library, threads, bar.look)
    if method != "event":
        _judge(marionette, batch, method)
    return _trajectories(marionette, batch, method, names)


def _judge(marionette: Marionette, batch: Batch, method: str) -> None:
    """Names the runs that reached their end and are not sound; of energy, where books are kept."""
    done = np.isin(batch.status, ARRIVED) & (batch.reached >= batch.t_end)
    gain = np.zeros(batch.n)
    if "books" in batch.parts and np.any(done):
        columns = np.moveaxis(_ledger(batch.parts["books"][done]), -1, 0)
        kinetic, potential, work, residual = (
            columns[LEDGER.index(name)] for name in ("kinetic", "potential", "work", "residual")
        )
        gain[done] = gains(marionette, kinetic, potential, work, residual)
    # A variational step that does not hold all rows is not made; what it counts has no slip in it.
    violation = batch.violation if method == "timestepping" else np.zeros(batch.n)
    for i in np.flatnonzero(done):
        found = verdict(float(violation[i]), float(gain[i]))
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
        puppet=marionette.described,
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
