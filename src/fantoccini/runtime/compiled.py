"""A puppet's shared library and its runs.

A :class:`Library` evaluates the generated functions over whole arrays; a :class:`Run` holds one
simulation and hands out rows and events in pieces, so that a progress bar can move and Ctrl-C
works between them. ctypes releases the interpreter's lock during every call.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.contract import EVENT, ROW, Solved, width
from fantoccini.errors import ARRIVED, Status
from fantoccini.motion import Input, State
from fantoccini.runtime import memory
from fantoccini.runtime.functions import Functions, pointer
from fantoccini.runtime.structures import (
    UNLIMITED,
    RecordArrays,
    RunOptions,
    input_arrays,
    structures,
)
from fantoccini.tree import Tree


class Library(Functions):
    """A puppet's compiled functions and runs.

    Attributes:
        key: of its folder in the cache, which no other puppet, compiler or version has.

    Args:
        path: the shared library.
        tree: the tree it was generated from.

    Raises:
        BuildError: it cannot be loaded, or is not this tree's.
    """

    def __init__(self, path: Path, tree: Tree):
        super().__init__(path, tree.sizes)
        self.key = path.parent.name
        self.n_blamable = len(tree.blamable)
        self.handle.fan_new.restype = ctypes.c_void_p
        self.handle.fan_free.argtypes = [ctypes.c_void_p]

    def complementarity(
        self,
        W: Array,
        b: Array,
        two_sided: MaskRows | None = None,
        upper: Array | None = None,
        guess: MaskRows | None = None,
    ) -> Complementarity:
        """0 <= x <= upper, s = W^T W x - b: >= 0 at x = 0, <= 0 at x = upper, 0 between.

        Args:
            W: (n_vD, n) a column a row; at most as many as the puppet has rows.
            b: (n,).
            two_sided: (n,) rows with s = 0 and x of any sign; none when not given.
            upper: (n,) bounds of x; none when not given.
            guess: (n,) rows that are expected to have x > 0; all when not given.
        """
        n = len(b)
        if n > self.sizes["n_rows"]:
            raise ValueError(f"{n} rows are more than the puppet has")
        if W.shape != (self.sizes["n_vD"], n):
            raise ValueError(f"W has the shape {W.shape}; it must be {(self.sizes['n_vD'], n)}")
        columns, b = (np.ascontiguousarray(a, dtype=float) for a in (W.T, b))
        upper = np.full(n, UNLIMITED) if upper is None else np.minimum(upper, UNLIMITED)
        sides = np.zeros(n, bool) if two_sided is None else two_sided
        active = np.ones(n, bool) if guess is None else guess
        sides, active = (a.astype(np.int32) for a in (sides, active))
        x, s, ray = np.zeros(n), np.zeros(n), np.zeros(n)
        status = self.handle.fan_complementarity(
            n, pointer(columns), pointer(b), pointer(upper), pointer(sides),
            pointer(active), pointer(x), pointer(s), pointer(ray),
        )  # fmt: skip
        return Complementarity(
            x, s, status == Solved.YES, ray if status == Solved.INFEASIBLE else None
        )


@dataclass(frozen=True, eq=False)
class Complementarity:
    """What :meth:`Library.complementarity` found.

    Attributes:
        x: (n,) of least norm where several give the same motion.
        s: (n,).
        solved: whether x and s are the answer.
        ray: (n,) where there is none: y >= 0 with W y = 0 and b . y > 0, which says that the rows
            with y > 0 cannot hold together.
    """

    x: Array
    s: Array
    solved: bool
    ray: Array | None


class Run:
    """One simulation in progress.

    Args:
        library: the compiled puppet.
        method: ``event``, or another one of those that the library makes runs of.
        options: numbers that steer it.
        x0: where it starts.
        p: (n_p,) parameters.
        winches: (n_strings, 3) largest tension [N], rewinding speed [m/s], restitution.
        inputs: bound inputs.
        save_at: (n,) increasing times at which the event-driven run writes rows [s].
    """

    rows_at_once = 512
    events_at_once = 1024
    steps_at_once = 200
    """Bound on the steps of one call, so that bars move and Ctrl-C is answered at once."""

    def __init__(
        self,
        library: Library,
        method: str,
        options: RunOptions,
        x0: State,
        p: Array,
        winches: Array,
        inputs: Input,
        save_at: Array | None = None,
    ):
        self.library = library
        self._run = ctypes.c_void_p(library.handle.fan_new(int(method == "event")))
        if not self._run:
            raise MemoryError("no memory for a run")
        self._keep = np.ascontiguousarray(save_at if save_at is not None else [], dtype=float)
        n_row = self.rows_at_once
        n_event = max(self.events_at_once, 16 * library.n_blamable + 64)
        self._rows = np.zeros((n_row, width(ROW, library.sizes)))
        self._events = np.zeros((n_event, len(EVENT)))
        self._record = RecordArrays(
            rows=pointer(self._rows), row_capacity=n_row,
            events=pointer(self._events), event_capacity=n_event,
        )  # fmt: skip
        self._taken_bytes, self._bound = 0.0, memory.bound(0.0, options.max_memory)
        arrays, held = input_arrays(inputs)
        slip = x0.slip if len(x0.slip) else np.zeros(library.sizes["n_strings"])
        given = {
            "q_D": x0.q_D, "v_D": x0.v_D, "slip": slip, "p": p,
            "winches": np.minimum(winches, UNLIMITED),
        }  # fmt: skip
        given = {name: np.ascontiguousarray(a, dtype=float) for name, a in given.items()}
        start = structures["StartArrays"](
            t=x0.t, **{name: pointer(a) for name, a in given.items()}, input=arrays,
            options=options.structure(), save_at=pointer(self._keep), n_save=len(self._keep),
            save_every=options.save_every,
        )  # fmt: skip
        self.status = Status(
            library.handle.fan_start(
                self._run, ctypes.byref(start), ctypes.byref(self._record)
            )
        )
        del held

    def __del__(self) -> None:
        if getattr(self, "_run", None):
            self.library.handle.fan_free(self._run)
            self._run = None

    def advance(self, t_end: float) -> Iterator[tuple[Array, Array]]:
        """Runs until ``t_end`` or until something stops it; yields (rows, events) pieces.

        The status afterwards says how it ended; the pieces of one call are kept within the bound
        on memory.
        """
        self._taken_bytes = 0.0
        yield self._taken()
        while self.status in (Status.RUNNING, *ARRIVED):
            if self._is_full:
                self.status = Status.TOO_MANY_ROWS
                return
            self.status = Status(
                self.library.handle.fan_run(
                    self._run,
                    ctypes.c_double(t_end),
                    ctypes.c_longlong(self.steps_at_once),
                    ctypes.byref(self._record),
                )
            )
            yield self._taken()
            if self.status is not Status.RUNNING:
                return

    def present(self) -> tuple[Array, Array]:
        """The present state as a row (rows, events)."""
        self.library.handle.fan_emit(self._run, ctypes.byref(self._record))
        return self._taken()

    def set_input(self, inputs: Input) -> None:
        """New bound inputs from the present time on."""
        arrays, held = input_arrays(inputs)
        self.library.handle.fan_set_input(self._run, ctypes.byref(arrays))
        del held

    def memory(self) -> bytes:
        """What the run knows beside its inputs, for :meth:`recall`."""
        call = self.library.handle.fan_memory
        call.restype = ctypes.c_longlong
        kept = ctypes.create_string_buffer(call(self._run, None, None))
        call(self._run, kept, None)
        return kept.raw

    def recall(self, memory: bytes) -> None:
        """Goes on as the run did that ``memory`` is of, from :meth:`set_input` on.

        Args:
            memory: of a run of the same library and method.

        Raises:
            ValueError: it is of another library or method.
        """
        if len(memory) != len(self.memory()):
            raise ValueError("this memory is of a run of another library or method")
        self.library.handle.fan_memory(self._run, None, memory)
        self.present()

    @property
    def progress(self) -> Any:
        """``steps`` taken, ``t`` reached [s], worst ``violation`` so far (of fixed steps) [m]."""
        out = structures["RunProgress"]()
        self.library.handle.fan_progress(self._run, ctypes.byref(out))
        return out

    @property
    def blame(self) -> Array:
        """(n_rows + n_watched,) how much each row and drive is to blame for the status, 0 to 1."""
        out = np.zeros(self.library.n_blamable)
        self.library.handle.fan_blame(self._run, int(self.status), pointer(out))
        return out

    def _taken(self) -> tuple[Array, Array]:
        rows = self._rows[: self._record.n_rows].copy()
        events = self._events[: self._record.n_events].copy()
        self._record.n_rows = self._record.n_events = 0
        self._taken_bytes += memory.bytes_of(*rows.shape) + memory.EVENT_BYTES * len(events)
        return rows, events

    @property
    def _is_full(self) -> bool:
        """Whether what was handed out since :meth:`advance` began is all that may be kept."""
        if not np.isfinite(self._bound):
            self._bound = memory.bound(self._taken_bytes, None)
        return self._taken_bytes > self._bound
