"""A puppet's compiled library and its runs.

A :class:`Library` evaluates the generated functions over whole arrays; a :class:`Run` is one
simulation, which returns samples and events in pieces so that a progress bar can move and Ctrl-C
works between them. ctypes releases the interpreter's lock during every call.

q_D and q_K are the dynamic and driven coordinates, v_D and v_K their velocities. A row is a string
or a joint limit; slip is the length that a winch has let out. The gap of two solids is their
distance, negative in an overlap.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fantoccini.base import ARRIVED, Array, MaskRows, Status
from fantoccini.kernel.contract import CONTACT, EVENT, SAMPLE, Solved, width
from fantoccini.kernel.runtime import memory
from fantoccini.kernel.runtime.contacts import Contacts
from fantoccini.kernel.runtime.functions import Functions, pointer
from fantoccini.kernel.runtime.inputs import HeldInput, input_arrays
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.packing import packed
from fantoccini.kernel.runtime.structures import UNLIMITED, structures
from fantoccini.model.tree import Tree
from fantoccini.motion import Input, State

_RUNS = (Status.RUNNING, *ARRIVED)
"""Statuses of runs that can continue."""
MAX_TOUCHES = 8
"""Largest number of contact points of a pair (``max_touches`` in collision/solids.hpp)."""


class Library(Functions):
    """A puppet's compiled functions and runs.

    Attributes:
        key: key of its folder in the cache; unique to puppet, compiler and version.
        n_attributable: number of rows and drives to which a status can be attributed, n_rows +
            n_watched.

    Args:
        path: the shared library.
        tree: the tree from which it was generated.

    Raises:
        BuildError: it cannot be loaded, or belongs to another tree.
    """

    def __init__(self, path: Path, tree: Tree):
        super().__init__(path, tree.sizes)
        self.key = path.parent.name
        self.n_attributable = len(tree.attributable)
        self.dll.fan_new.restype = ctypes.c_void_p
        self.dll.fan_free.argtypes = [ctypes.c_void_p]

    def complementarity(
        self,
        W: Array,
        b: Array,
        two_sided: MaskRows | None = None,
        upper: Array | None = None,
        guess: MaskRows | None = None,
    ) -> Complementarity:
        """Solves a linear complementarity problem with bounds.

            0 <= x <= upper,   s = W^T W x - b:   s >= 0 at x = 0, s <= 0 at x = upper, else s = 0.

        Args:
            W: (n_vD, n) matrix with a column for each row; n is at most the puppet's n_rows.
            b: (n,).
            two_sided: (n,) rows with s = 0 and x of either sign; none by default.
            upper: (n,) bounds of x; none by default.
            guess: (n,) rows expected to have x > 0; all by default.

        Raises:
            ValueError: too many rows, or another shape.
        """
        n = len(b)
        if n > self.sizes["n_rows"]:
            raise ValueError(f"found {n} rows; the puppet has {self.sizes['n_rows']}")
        if W.shape != (self.sizes["n_vD"], n):
            raise ValueError(f"W has the shape {W.shape}; it must be {(self.sizes['n_vD'], n)}")
        columns, b = (np.ascontiguousarray(a, dtype=float) for a in (W.T, b))
        upper = np.full(n, UNLIMITED) if upper is None else np.minimum(upper, UNLIMITED)
        sides = np.zeros(n, bool) if two_sided is None else two_sided
        active = np.ones(n, bool) if guess is None else guess
        sides, active = (a.astype(np.int32) for a in (sides, active))
        x, s, ray = np.zeros(n), np.zeros(n), np.zeros(n)
        status = self.dll.fan_complementarity(
            n,
            pointer(columns),
            pointer(b),
            pointer(upper),
            pointer(sides),
            pointer(active),
            pointer(x),
            pointer(s),
            pointer(ray),
        )
        return Complementarity(
            x, s, status == Solved.YES, ray if status == Solved.INFEASIBLE else None
        )

    def gaps(
        self, contacts: Contacts, q_D: Array, q_K: Array, p: Array, margin: float = 1e-3
    ) -> Array:
        """(..., m) distances of the solids of each pair, negative if they overlap [m].

        Args:
            contacts: the m pairs.
            q_D, q_K: (..., n_qD) dynamic and (..., n_qK) driven (kinematic) configurations.
            p: (n_p,) parameters.
            margin: pairs farther apart have an infinite distance [m].
        """
        out = np.full((*q_D.shape[:-1], len(contacts.pairs)), np.inf)
        arrays = [np.ascontiguousarray(a, dtype=float) for a in (q_D, q_K, p)]
        if self.dll.fan_gaps(
            ctypes.byref(contacts.structure),
            ctypes.c_longlong(math.prod(q_D.shape[:-1])),
            *(pointer(a) for a in arrays),
            ctypes.c_double(margin),
            pointer(out),
        ):
            raise MemoryError("no memory for contact points")
        return out

    def touches(
        self, contacts: Contacts, pair: int, poses: Array, second_pose: Array, margin: float
    ) -> Array:
        """Contact points of a pair at n poses of its first solid's link.

        Args:
            contacts: the puppet's contacts.
            pair: index of the pair.
            poses: (n, 12) poses: R column by column, then the origin [m].
            second_pose: (12,) pose of the second solid's link; ignored for a standing solid.
            margin: largest gap of the points [m].

        Returns:
            (n, 8, 8): feature, gap [m], point (3,) [m], unit normal (3,), in the order of the
            features; missing points have the feature -1.
        """
        out = np.zeros((len(poses), MAX_TOUCHES, 8))
        poses, second_pose = (np.ascontiguousarray(a, dtype=float) for a in (poses, second_pose))
        self.dll.fan_touches(
            ctypes.byref(contacts.structure),
            int(pair),
            len(poses),
            pointer(poses),
            pointer(second_pose),
            ctypes.c_double(margin),
            pointer(out),
        )
        return out


@dataclass(frozen=True, eq=False)
class Complementarity:
    """The result of :meth:`Library.complementarity`.

    Attributes:
        x: (n,) the solution, of least norm if several give the same motion.
        s: (n,).
        solved: whether x and s are a solution.
        ray: (n,) y >= 0 with W y = 0 and b . y > 0, if there is no solution: the rows with y > 0
            are inconsistent. None otherwise.
    """

    x: Array
    s: Array
    solved: bool
    ray: Array | None


class Piece(NamedTuple):
    """Output of a run since the last request.

    Attributes:
        samples: (n, width) samples; the contract has their columns in ``SAMPLE``.
        events: (n, 5) events; columns in ``EVENT``.
        contacts: (n, width) contact points; columns in ``CONTACT``, with the index of the sample in
            the piece.
    """

    samples: Array
    events: Array
    contacts: Array

    @classmethod
    def joined(cls, pieces: Sequence[Piece]) -> Piece:
        """Joins consecutive pieces."""
        if len(pieces) == 1:
            return pieces[0]
        samples, events, contacts = zip(*pieces, strict=True)
        first = np.cumsum([0, *map(len, samples[:-1])])
        renumbered = [c.copy() for c in contacts]
        for piece_contacts, n in zip(renumbered, first, strict=True):
            piece_contacts[:, 0] += n
        return cls(np.concatenate(samples), np.concatenate(events), np.concatenate(renumbered))


class Run:
    """One simulation in progress.

    Args:
        library: the compiled puppet.
        method: ``event``, or the fixed-step method of the library.
        options: options of the run.
        x0: start state.
        p: (n_p,) parameters.
        winches: (n_strings, 3) largest tension [N], rewinding speed [m/s], restitution.
        inputs: inputs bound to the puppet.
        save_at: (n,) increasing times of samples, for event-driven runs [s].

    Attributes:
        status: RUNNING, or the status at the run's end.
    """

    samples_per_piece = 512
    events_per_piece = 1024
    contacts_per_piece = 8192
    steps_per_piece = 200
    """Few enough for smooth progress bars and a quick response to Ctrl-C."""

    def __init__(
        self,
        library: Library,
        method: str,
        options: RunOptions,
        x0: State,
        p: Array,
        winches: Array,
        inputs: Input | HeldInput,
        save_at: Array | None = None,
    ):
        self.library = library
        self._run = ctypes.c_void_p(library.dll.fan_new(int(method == "event")))
        if not self._run:
            raise MemoryError("no memory for a run")
        self._save_at = np.ascontiguousarray(save_at if save_at is not None else [], dtype=float)
        n_samples = self.samples_per_piece
        n_events = max(self.events_per_piece, 16 * library.n_attributable + 64)
        self._samples = np.zeros((n_samples, width(SAMPLE, library.sizes)))
        n_contacts = self.contacts_per_piece * (library.sizes["n_contacts"] > 0)
        n_events += 4 * library.sizes["n_contacts"]
        self._events = np.zeros((n_events, len(EVENT)))
        self._contacts = np.zeros((n_contacts, width(CONTACT, {})))
        self._options = options
        self._record: Any = packed(
            "RecordArrays",
            samples=self._samples,
            sample_capacity=n_samples,
            events=self._events,
            event_capacity=n_events,
            contacts=self._contacts,
            contact_capacity=n_contacts,
        )
        self._taken_bytes, self._bound = 0.0, memory.bound(0.0, options.max_memory)
        slip = x0.slip if len(x0.slip) else np.zeros(library.sizes["n_strings"])
        start = packed(
            "StartArrays",
            t=x0.t,
            q_D=x0.q_D,
            v_D=x0.v_D,
            slip=slip,
            p=p,
            winches=np.minimum(winches, UNLIMITED),
            input=input_arrays(inputs),
            options=options.structure(),
            save_at=self._save_at,
            n_save=len(self._save_at),
            save_every=options.save_every,
        )
        self.status = Status(
            library.dll.fan_start(self._run, ctypes.byref(start), ctypes.byref(self._record))
        )

    def __del__(self) -> None:
        if getattr(self, "_run", None):
            self.library.dll.fan_free(self._run)
            self._run = ctypes.c_void_p()

    def advance(self, t_end: float) -> Iterator[Piece]:
        """Yields pieces until ``t_end`` or until the run stops, and sets ``status``.

        The run stops if the pieces of one call exceed the memory bound.
        """
        self._taken_bytes = 0.0
        if self._record.n_samples or self.status not in _RUNS:
            yield self._take_piece()
        until, budget = ctypes.c_double(t_end), ctypes.c_longlong(self.steps_per_piece)
        run, record = self.library.dll.fan_run, ctypes.byref(self._record)
        while self.status in _RUNS:
            if self._is_full:
                self.status = Status.TOO_MANY_SAMPLES
                return
            self.status = Status(run(self._run, until, budget, record))
            yield self._take_piece()
            if self.status is not Status.RUNNING:
                return

    def present(self) -> Piece:
        """A piece with the present state as its last sample."""
        self.library.dll.fan_emit(self._run, ctypes.byref(self._record))
        return self._take_piece()

    def set_input(self, inputs: Input | HeldInput) -> None:
        """Replaces the (bound) inputs from the present time on."""
        self.library.dll.fan_set_input(self._run, ctypes.byref(input_arrays(inputs)))

    def checkpoint(self) -> bytes:
        """The whole state of the run except its inputs, for :meth:`restore`."""
        call = self.library.dll.fan_memory
        call.restype = ctypes.c_longlong
        buffer = ctypes.create_string_buffer(call(self._run, None, None))
        call(self._run, buffer, None)
        return buffer.raw

    def restore(self, checkpoint: bytes) -> None:
        """Continues like the run of a checkpoint after its last :meth:`set_input`.

        Args:
            checkpoint: checkpoint of a run of the same library and method.

        Raises:
            ValueError: it belongs to another library or method.
        """
        if len(checkpoint) != len(self.checkpoint()):
            raise ValueError("this checkpoint belongs to another library or method")
        self.library.dll.fan_memory(self._run, None, checkpoint)
        self.present()

    @property
    def progress(self) -> ctypes.Structure:
        """``steps`` taken, ``t`` reached [s], largest ``violation`` (fixed steps) [m or rad]."""
        out = structures["RunProgress"]()
        self.library.dll.fan_progress(self._run, ctypes.byref(out))
        return out

    @property
    def attribution(self) -> Array:
        """(n_attributable,) share of each row and drive in the cause of the status, 0 to 1."""
        out = np.zeros(self.library.n_attributable)
        self.library.dll.fan_attribution(self._run, int(self.status), pointer(out))
        return out

    def _take_piece(self) -> Piece:
        """Copies the output since the last call, and empties the buffers."""
        record = self._record
        samples = self._samples[: record.n_samples].copy()
        events = self._events[: record.n_events].copy()
        contacts = self._contacts[: record.n_contacts].copy()
        record.n_samples = record.n_events = record.n_contacts = 0
        self._taken_bytes += memory.bytes_of(*samples.shape) + memory.MEMORY.event * len(events)
        self._taken_bytes += memory.bytes_of(*contacts.shape)
        return Piece(samples, events, contacts)

    @property
    def _is_full(self) -> bool:
        """Whether the pieces since :meth:`advance` began have reached the memory bound."""
        if self._bound == np.inf:
            self._bound = memory.bound(self._taken_bytes, None)
        return self._taken_bytes > self._bound
