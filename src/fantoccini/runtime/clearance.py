"""Clearances of many configurations, by a puppet's compiled library of them."""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from types import FrameType
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import STRUCTURES, SolidKind
from fantoccini.runtime.functions import Loaded, pointer
from fantoccini.runtime.structures import dtype_of, structures

SEGMENT, BOX, HALF_SPACE = SolidKind
"""Kinds of solids."""

ClearanceArrays = structures["ClearanceArrays"]

SOLID = dtype_of(next(s for s in STRUCTURES if s.name == "Solid"))
"""A solid: a link's number, -1 for the world; a mesh's, -1 for none; R column by column."""

_EXACT = dict(ClearanceArrays._fields_)["exact"]

_APART = 4096
"""Configurations from which on they are dealt to threads."""


@dataclass(frozen=True, eq=False)
class Solids:
    """What is measured against what.

    Attributes:
        moving, standing: (n,) ``SOLID``.
        pairs: (n, 2) numbers of moving solids that are measured against one another.
        string_radius: (n_strings,) of strings against standing solids [m]; negative: not at all.
        exact: distance of two placed solids (``SOLID`` records) one of which is a mesh, before
            radii are taken off [m]; negative where they overlap. None where there is no mesh.
    """

    moving: np.ndarray
    standing: np.ndarray
    pairs: np.ndarray
    string_radius: Array
    exact: Callable[[np.void, np.void], float] | None = None

    @classmethod
    def none(cls, n_strings: int) -> Solids:
        """Nothing is measured."""
        solids = np.zeros(0, dtype=SOLID)
        return cls(solids, solids, np.zeros((0, 2), dtype=np.int32), np.full(n_strings, -1.0))


def clearance_arrays(solids: Solids, exact: Exact, kept: list[np.ndarray]) -> Any:
    """As the library takes them; ``exact`` and ``kept`` must live as long as that."""
    held = {
        "moving": np.ascontiguousarray(solids.moving, dtype=SOLID),
        "standing": np.ascontiguousarray(solids.standing, dtype=SOLID),
        "pairs": np.ascontiguousarray(solids.pairs, dtype=np.int32),
        "string_radius": np.ascontiguousarray(solids.string_radius, dtype=float),
    }
    kept += held.values()
    counts = {f"n_{name}": len(held[name]) for name in ("moving", "standing", "pairs")}
    places = {name: pointer(array) for name, array in held.items()}
    return ClearanceArrays(**counts, **places, exact=exact.function)


class Exact:
    """``Solids.exact`` as the library calls it: ``with`` it, the library may be called.

    What it raises cannot pass through compiled code: all then overlaps, so that the call soon ends,
    and the end of ``with`` raises it.

    Args:
        solids: whose function it is.
    """

    def __init__(self, solids: Solids):
        self._raised: list[BaseException] = []
        self._handler: Any = None
        raised, exact = self._raised, solids.exact

        def asked(x: int, y: int) -> float:
            try:
                return -1.0 if raised else exact(_record(x), _record(y))
            except BaseException as error:
                raised.append(error)
                return -1.0

        self.function = _EXACT() if exact is None else _EXACT(asked)

    def __enter__(self) -> Exact:
        # Ctrl-C would be raised on entry to `asked`, before its `try`, and be lost.
        if self.function and threading.current_thread() is threading.main_thread():
            handler = signal.getsignal(signal.SIGINT)
            if callable(handler):
                self._handler = handler
                signal.signal(signal.SIGINT, self._interrupted)
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)
        if self._raised and kind is None:
            raise self._raised[0]

    def _interrupted(self, number: int, frame: FrameType | None) -> None:
        try:
            self._handler(number, frame)
        except BaseException as error:
            self._raised.append(error)


def _record(address: int) -> np.void:
    return np.frombuffer((ctypes.c_char * SOLID.itemsize).from_address(address), SOLID)[0].copy()


class ClearanceLibrary(Loaded):
    """A library that measures clearances."""

    def measure(
        self, solids: Solids, q_D: Array, q_K: Array, p: Array, threads: int
    ) -> tuple[Array, np.ndarray]:
        """The least distance at each of n configurations, and the number of the pair that has it.

        Args:
            solids: what is measured.
            q_D, q_K: (n, n_qD), (n, n_qK).
            p: (n_p,) parameters.
            threads: that share the work where there is much of it.

        Returns:
            (n,) [m], and (n,) numbers in the order of ``Clearance::measure``; -1 where nothing is
            measured.
        """
        kept: list[np.ndarray] = []
        n = len(q_D)
        q_D, q_K, p = (np.ascontiguousarray(a, dtype=float) for a in (q_D, q_K, p))
        clearance, pair = np.empty(n), np.empty(n, dtype=np.int64)
        failed: list[int] = []
        exact = Exact(solids)
        arrays = clearance_arrays(solids, exact, kept)

        def work(first: int, last: int) -> None:
            part = slice(first, last)
            failed.append(
                self.handle.fan_clearance(
                    ctypes.c_longlong(last - first), pointer(q_D[part]), pointer(q_K[part]),
                    pointer(p), ctypes.byref(arrays), pointer(clearance[part]), pointer(pair[part]),
                )
            )  # fmt: skip

        parts = max(1, min(threads, n // _APART))
        ends = np.linspace(0, n, parts + 1).astype(int)
        others = [threading.Thread(target=work, args=span) for span in pairwise(ends[1:])]
        with exact:
            for other in others:
                other.start()
            if n:
                work(0, ends[1])
            for other in others:
                other.join()
        if any(failed):
            raise MemoryError("no memory for clearances")
        return clearance, pair
