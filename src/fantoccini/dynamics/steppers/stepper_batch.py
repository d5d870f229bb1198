"""StepperBatch: many runs that are advanced piece by piece, for learning and identification.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings); slip is the
length that a winch has let out. Lanes are runs that the vector unit of the processor advances
together. A taut string pulls, a slack one does not. A row is a string or a joint limit with its gap
h <= 0.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import (
    ARRIVED,
    UNSOUND,
    Array,
    Indices,
    MaskRows,
    StateError,
    Status,
    UnknownNameError,
    check_positive,
)
from fantoccini.dynamics.compiled import (
    CompiledPuppet,
    Method,
    MethodName,
    as_method,
    check_starts,
    check_steps,
    parameter_rows,
    vectors,
)
from fantoccini.dynamics.steppers.determinacy import ForceSamples, undetermined
from fantoccini.dynamics.steppers.running_ledgers import LaneLedgers
from fantoccini.dynamics.steppers.separate_runs import Engine, SeparateRuns
from fantoccini.dynamics.steppers.stepper import Stepper
from fantoccini.kernel.runtime import LaneRecord, LaneSteppers, checked_integer, default_threads
from fantoccini.motion import State, States

T = TypeVar("T", bound=np.generic)

_STATE_FIELDS = ("q_D", "v_D", "q_K", "v_K", "slip")


class StepperBatch:
    """n runs of one puppet that are advanced together, each with its own time and parameters.

    The arrays belong to the batch and change with every call; copy them to store values.
    Time-stepping advances in lanes, on threads; other methods run by run.

    Attributes:
        t: (n,) present times [s].
        q_D, v_D, q_K, v_K, slip: (n, ...) present states, as in :class:`State`.
        tension: (n, n_rows) forces of strings and limits [N or N m].
        taut: (n, n_rows) mask of taut rows.
        energy_terms: (n, 5) work of the inputs, and losses by damping, impacts, slipping
            winches and friction, since the start of each run [J].
        violation: (n,) largest h of all rows since the start, for time-stepping [m, rad or 1].
        status: (n,) :class:`Status` numbers; a run that stopped keeps its state until its reset.
            ``OVERSTEPPED``, ``GAINED_ENERGY`` and ``UNBALANCED`` do not stop it: the fixed steps
            are too long, by the check of :func:`simulate` at the ends of all pieces.
        p: (n, n_p) parameters.
        method: name of the method.

    Args:
        marionette: the puppet.
        x0: start state of all runs, or n start states of equal time.
        n: number of runs; by default the number of states or parameters.
        method: method of all runs.
        parameters: name -> value, or (n,) values.
        threads: number of threads; by default all processors.
    """

    def __init__(
        self,
        marionette: CompiledPuppet,
        x0: State | Sequence[State],
        n: int | None = None,
        method: Method | MethodName = "timestepping",
        parameters: Mapping[str, Array | float] | None = None,
        threads: int | None = None,
    ):
        method_options = as_method(method)
        states = marionette.states([x0] if isinstance(x0, State) else list(x0))
        p = parameter_rows(marionette, parameters)
        counts = {"states": len(states), "values of parameters": len(p)}
        if n is None:
            n = max(counts.values())
        n = checked_integer("n", n, minimum=1)
        for quantity, count in counts.items():
            if count not in (1, n):
                raise StateError(f"found {count} {quantity} for {n} runs; give one, or {n}")
        self.marionette, self.method, self._n = marionette, method_options.name, n
        options = marionette.run_options(**method_options.options)
        threads = (
            default_threads() if threads is None else checked_integer("threads", threads, minimum=1)
        )
        self.t = np.zeros(n)
        self._record = record = LaneRecord(n, marionette.tree.sizes)
        self.p, self.tension, self.taut = record.p, record.tension, record.taut
        self.q_D, self.v_D, self.q_K, self.v_K = record.q_D, record.v_D, record.q_K, record.v_K
        self.slip, self.energy_terms = record.slip, record.energy_terms
        self.violation, self.status = record.violation, record.status.copy()
        self._ledgers: LaneLedgers | None = None
        self._start_states, self._parameters = states, p
        self._options, self._threads = options, threads
        self._engine = self._new_engine()
        self.reset()

    def _new_engine(self) -> Engine:
        options, threads, record = self._options, self._threads, self._record
        if self.method != "timestepping":
            return SeparateRuns(self.marionette, self.method, options, record, self.t, threads)
        library = self.marionette.libraries.lanes
        return LaneSteppers(library, record, threads, options, self.marionette.winches)

    def __getstate__(self) -> dict[str, Any]:
        # The engine's memory belongs to its library, which returns it as bytes.
        state = {name: x for name, x in vars(self).items() if name != "_engine"}
        return state | {"_memory": (self._library_key, self._engine.checkpoint())}

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        library, memory = state.pop("_memory")
        self.__dict__.update(state)
        self._engine = self._new_engine()
        # Single steppers restore themselves under another library, and stay stopped.
        if library == self._library_key or self.method != "timestepping":
            self._engine.restore(memory)
        else:
            self._record.fresh[:] = True
            self._engine.advance(0.0, np.zeros((1, self.marionette.coordinates.n_vK)), None)
            self._ledgers = LaneLedgers(self.marionette, self._options.dt, self._record, self.t)
            self._update_status()

    def __copy__(self) -> Self:
        """An independent batch: the arrays of a batch are written in place."""
        return copy.deepcopy(self)

    @property
    def _library_key(self) -> str:
        libraries = self.marionette.libraries
        if self.method == "timestepping":
            return libraries.lanes.key
        return libraries.library_of(self.method).key

    def __len__(self) -> int:
        return self._n

    def __repr__(self) -> str:
        return f"<StepperBatch {self.marionette.name}: {self._n} runs, {self.method}>"

    @property
    def arrived(self) -> MaskRows:
        """Mask (n,) of the runs that reached the end of the last piece, even with lost steps."""
        return np.isin(self.status, (*ARRIVED, *UNSOUND))

    def causes(self, i: int, min_share: float = 0.1) -> tuple[str, ...]:
        """Names with a share above ``min_share`` in causing the status of run i."""
        share = self._record.attribution[i]
        return tuple(
            name
            for name, row_share in zip(self.marionette.tree.attributable, share, strict=True)
            if row_share > min_share
        )

    def undetermined(self, i: int) -> tuple[str, ...]:
        """Strings and driven velocities of run i whose tensions and efforts are not determined.

        Lanes do not store contact points: with contact, those of the next step at constant driven
        velocities are used.
        """
        if isinstance(self._engine, SeparateRuns):
            return self._engine.stepper(i).undetermined
        run_index, marionette = [i], self.marionette.with_p(self.p[i])
        if marionette.contacts is not None:
            return Stepper(marionette, self.state(i), self.method, self._options).undetermined
        samples = ForceSamples(
            q_D=self.q_D[run_index],
            v_D=self.v_D[run_index],
            q_K=self.q_K[run_index],
            v_K=self.v_K[run_index],
            force=self.tension[run_index],
            taut=self.taut[run_index, : len(marionette.tree.strings)],
            slip=self.slip[run_index],
            method=self.method,
        )
        flags = undetermined(marionette, samples)
        return tuple(name for name in flags.names if flags[name][0])

    def state(self, i: int) -> State:
        """The state of run i."""
        return State(
            float(self.t[i]),
            taut=self.taut[i],
            coordinates=self.marionette.coordinates,
            **{name: getattr(self, name)[i] for name in _STATE_FIELDS},
        )

    def reset(
        self,
        which: Indices | MaskRows | None = None,
        x0: State | Sequence[State] | None = None,
        parameters: Mapping[str, Array | float] | None = None,
        **arrays: Array,
    ) -> None:
        """Resets runs to a start.

        Args:
            which: indices (m,) of the runs, or mask (n,); all by default.
            x0: start state of all these runs, or one for each; by default their first start.
            parameters: name -> value, or one for each run; by default those of the first start.
            arrays: replacements of parts of x0: ``q_D``, ``v_D``, ``q_K``, ``v_K``, ``slip``
                (m, ...) and ``t`` (m,).

        Raises:
            StateError: a start violates a row or overlaps, or a number is not finite.
        """
        runs = _run_indices(which, self._n)
        if len(runs) == 0:
            return
        m, marionette = len(runs), self.marionette
        if x0 is None:
            states = _states_of(self._start_states, runs)
        else:
            states = marionette.states([x0] if isinstance(x0, State) else list(x0))
        p = _checked_rows("parameters", parameter_rows(marionette, parameters), m)
        if parameters is None:
            p = self._parameters if len(self._parameters) == 1 else self._parameters[runs]
        times = _checked_rows("t", arrays.pop("t", np.full(1, states.t)), m)
        state_arrays = {name: getattr(states, name) for name in _STATE_FIELDS}
        for name, array in arrays.items():
            if name not in state_arrays:
                raise TypeError(f"reset has no {name!r}; allowed: t, {', '.join(_STATE_FIELDS)}")
            width = state_arrays[name].shape[1]
            state_arrays[name] = np.atleast_2d(vectors(name, array, width))
        state_arrays = {name: _checked_rows(name, x, m) for name, x in state_arrays.items()}
        taut = _checked_rows("x0", states.taut if not arrays else np.zeros_like(states.taut), m)
        rows = max(
            len(x) for x in state_arrays.values()
        )  # arrays may have m rows, and a start state one
        state_arrays = {
            name: np.repeat(x, rows // len(x), axis=0) for name, x in state_arrays.items()
        }
        starts = States(states.t, **state_arrays, taut=np.repeat(taut, rows // len(taut), axis=0))
        check_starts(marionette, starts, self.method, p)
        check_steps(marionette, self.method, starts, p, self._options.dt)
        for name, x in state_arrays.items():
            getattr(self._record, name)[runs] = x
        self.p[runs], self.t[runs] = p, times
        self._record.fresh[runs] = True
        self._engine.advance(0.0, np.zeros((1, marionette.coordinates.n_vK)), None)
        if self.method == "timestepping":
            if self._ledgers is None:
                self._ledgers = LaneLedgers(marionette, self._options.dt, self._record, self.t)
            else:
                self._ledgers.restart(runs, self._record, self.t)
        self._update_status()

    def advance(
        self,
        duration: float,
        acc_K: Array | Mapping[str, Array | float] | None = None,
        *,
        u_D: Array | None = None,
    ) -> MaskRows:
        """Advances all runs that have not stopped by ``duration`` [s].

        Args:
            duration: duration of the piece, > 0 and finite.
            acc_K: (n, n_vK) or (n_vK,) accelerations of the driven coordinates, constant over the
                piece; or name -> number or (n,), others 0. Driven velocities are continuous.
            u_D: (n, n_vD) or (n_vD,) user forces, constant over the piece.

        Returns:
            Mask (n,) of the runs that arrived; ``status`` has the reasons of the others.
        """
        check_positive(duration=duration)
        table = self.marionette.coordinates
        acc = self._accelerations(acc_K)
        force = None
        if u_D is not None:
            force = _checked_rows("u_D", np.atleast_2d(vectors("u_D", u_D, table.n_vD)), self._n)
        is_running = self.arrived
        self._engine.advance(duration, acc, force)
        self.t[is_running] += self._record.advanced[is_running]
        if self._ledgers is not None:
            self._ledgers.add(self._record, self.t)
        self._update_status()
        return self.arrived

    def _update_status(self) -> None:
        """Sets ``status`` from the status of the steps, and from the ledgers of lanes."""
        self.status[:] = self._record.status
        if self._ledgers is not None:
            is_running = np.isin(self.status, ARRIVED)
            faults = self._ledgers.faults(self.violation)
            is_faulty = is_running & (faults != Status.DONE)
            self.status[is_faulty] = faults[is_faulty]

    def _accelerations(self, array: Array | Mapping[str, Array | float] | None) -> Array:
        """Accelerations (1 or n, n_vK) of all runs."""
        table = self.marionette.coordinates
        if array is None:
            return np.zeros((1, table.n_vK))
        if not isinstance(array, Mapping):
            rows = np.atleast_2d(vectors("acc_K", array, table.n_vK))
            return _checked_rows("acc_K", rows, self._n)
        acc = np.zeros((self._n, table.n_vK))
        for name, values in array.items():
            if name not in table.v_K:
                raise UnknownNameError("driven velocity", name, table.v_K)
            if np.shape(values) not in ((), (1,), (self._n,)):
                text = f"found the shape {np.shape(values)}; needed: a number, or ({self._n},)"
                raise StateError(f"acc_K[{name!r}]: {text}")
            acc[:, table.v_K.index(name)] = values
        return vectors("acc_K", acc, table.n_vK)


def _run_indices(which: Indices | MaskRows | None, n: int) -> NDArray[np.intp]:
    """Indices of the selected runs, of n; StateError for others."""
    array = np.arange(n) if which is None else np.asarray(which)
    is_mask = array.dtype == bool
    if array.ndim != 1 or (is_mask and len(array) != n):
        text = f"a mask of the shape {array.shape}" if is_mask else f"the shape {array.shape}"
        raise StateError(f"which: found {text}; needed: indices (m,), or a mask ({n},)")
    if is_mask:
        return np.flatnonzero(array)
    if array.size and not (array.dtype.kind in "iu" and -n <= array.min() <= array.max() < n):
        raise StateError(f"which: found {array!r}; needed: whole numbers from {-n} to {n - 1}")
    return array.astype(np.intp) % n


def _states_of(states: States, runs: NDArray[np.intp]) -> States:
    """States of selected runs; a single state is shared by all."""
    if len(states) == 1:
        return states
    parts = {name: getattr(states, name)[runs] for name in (*_STATE_FIELDS, "taut")}
    return States(states.t, **parts)


def _checked_rows(name: str, values: NDArray[T], n: int) -> NDArray[T]:
    """Values (n, ...) or (1, ...); StateError for other numbers of rows."""
    if len(values) not in (1, n):
        raise StateError(f"{name} has {len(values)} rows; it must have 1 or {n}")
    return values
