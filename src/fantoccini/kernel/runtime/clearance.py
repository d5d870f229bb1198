"""Clearances of many configurations, measured by a puppet's compiled library.

A solid is a shape of a body or an obstacle. q_D and q_K are the dynamic and driven coordinates of
the configurations. A link is a body on its joint.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array
from fantoccini.kernel.contract import SolidKind
from fantoccini.kernel.runtime.functions import Loaded, pointer
from fantoccini.kernel.runtime.packing import packed
from fantoccini.kernel.runtime.solids import SOLID
from fantoccini.kernel.runtime.structures import dtype_of, structures
from fantoccini.model.tree import Role, Tree

SEGMENT, BOX, HALF_SPACE = SolidKind.SEGMENT, SolidKind.BOX, SolidKind.HALF_SPACE
"""Kinds of solids."""

JOINT = dtype_of("JointPlace")
"""A link's joint, and the indices of its coordinates."""

_EXACT: Any = next(f[1] for f in structures["ClearanceArrays"]._fields_ if f[0] == "exact")

_CONFIGURATIONS_PER_THREAD = 4096
"""Number of configurations measured in the time in which a thread starts."""


Records = NDArray[np.void]


@dataclass(frozen=True, eq=False)
class Solids:
    """Solids, and the pairs of them whose distance is measured.

    Attributes:
        moving, standing: (n,) ``SOLID``; every moving solid is measured against all standing ones
            except those left out.
        pairs: (n, 2) indices of moving solids that are measured against one another.
        left_out: (moving, standing) bool, pairs that are not measured.
        string_radius: (n_strings,) radius against standing solids [m]; negative: not measured.
        joints: (n_links,) ``JOINT``, the joints of the links that carry solids and string points.
        carriers: (n_points,) links of the strings' points; -1 for the world.
        exact: distance of two placed solids (``SOLID`` records), one of them a mesh, without
            radii [m]; negative where they overlap. None without meshes.
    """

    moving: Records
    standing: Records
    pairs: NDArray[np.int32]
    left_out: NDArray[np.bool_]
    string_radius: Array
    joints: Records
    carriers: NDArray[np.int32]
    exact: Callable[[np.void, np.void], float] | None = None

    @classmethod
    def none(cls, tree: Tree) -> Solids:
        """No solids: clearance is infinite."""
        solids = np.zeros(0, dtype=SOLID)
        no_pairs = np.zeros((0, 2), dtype=np.int32), np.zeros((0, 0), dtype=bool)
        return cls(solids, solids, *no_pairs, np.full(len(tree.strings), -1.0), *moved_by(tree))


def moved_by(tree: Tree) -> tuple[Records, NDArray[np.int32]]:
    """``joints`` and ``carriers`` of :class:`Solids`."""
    joints = []
    for link in tree.links:
        is_moving = link.v.stop > link.v.start
        turns = {"revolute": 1, "ball": 4, "free": 4}.get(link.kind, 0) if is_moving else 0
        role = 1 + (Role.DYNAMIC, Role.DRIVEN).index(link.role) if is_moving else 0
        slides = link.q.stop - link.q.start - turns
        joints.append((link.parent, role, link.q.start, slides, turns))
    carriers = [point.link for string in tree.strings for point in string.points]
    return np.array(joints, dtype=JOINT), np.array(carriers, dtype=np.int32)


def clearance_arrays(solids: Solids, exact: Exact) -> ctypes.Structure:
    """The contract's ``ClearanceArrays``; ``exact`` must exist as long as it is used."""
    counts = {f"n_{name}": len(getattr(solids, name)) for name in ("moving", "standing", "pairs")}
    names = ("moving", "standing", "pairs", "left_out", "string_radius", "joints", "carriers")
    arrays = {name: getattr(solids, name) for name in names}
    return packed("ClearanceArrays", **counts, **arrays, exact=exact.function)


class Exact:
    """``Solids.exact`` as a C callback, for calls of the library inside ``with``.

    An exception cannot pass through compiled code: the callback then reports overlap, so that the
    call soon ends, and leaving ``with`` raises it.

    Args:
        solids: the solids whose function it is.
    """

    def __init__(self, solids: Solids):
        self._raised: list[BaseException] = []
        self._handler: Callable[[int, FrameType | None], Any] | None = None
        raised, exact = self._raised, solids.exact
        if exact is None:
            self.function = _EXACT()
            return

        def callback(x: int, y: int) -> float:
            try:
                return -1.0 if raised else exact(_record(x), _record(y))
            except BaseException as error:
                raised.append(error)
                return -1.0

        self.function = _EXACT(callback)

    def __enter__(self) -> Exact:
        # Ctrl-C would be raised on entry to `callback`, before its `try`, and be lost.
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
            if self._handler is not None:
                self._handler(number, frame)
        except BaseException as error:
            self._raised.append(error)


def _record(address: int) -> np.void:
    solid: np.void = np.frombuffer(ctypes.string_at(address, SOLID.itemsize), SOLID)[0].copy()
    return solid


class Moves(NamedTuple):
    """Bounds of the joints' motion about n configurations.

    Attributes:
        slide, turn: (n, n_links) path of each link's origin in its parent's frame [m], and the
            angle that its joint turns [rad].
        wound: (n, n_strings) bounds of the changes of length [m].
        loose: (n, n_strings) 1.0 for strings that may go slack within these bounds, else 0.0.
    """

    slide: Array
    turn: Array
    wound: Array
    loose: Array


class ClearanceLibrary(Loaded):
    """The compiled library that measures clearances."""

    def measure(
        self,
        solids: Solids,
        q_D: Array,
        q_K: Array,
        p: Array,
        threads: int,
        moves: Moves | None = None,
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """The clearance at each of n configurations, and the index of the closest pair.

        Args:
            solids: the solids to measure.
            q_D, q_K: (n, n_qD), (n, n_qK).
            p: (n_p,) parameters.
            threads: number of threads for many configurations.
            moves: motion about the configurations; none by default.

        Returns:
            (n,) [m]; (n,) lower bounds of all distances on these moves [m]; and (n,) indices
            in the order of ``Clearance::measure``, -1 without pairs.

        Raises:
            MemoryError: no memory for the clearances.
        """
        n = len(q_D)
        q_D, q_K, p = (np.ascontiguousarray(a, dtype=float) for a in (q_D, q_K, p))
        move_arrays: list[Array | None] = [None] * len(Moves._fields)
        if moves is not None:
            move_arrays = [np.ascontiguousarray(a, dtype=float) for a in moves]
        clearance, lower, pair = np.empty(n), np.empty(n), np.empty(n, dtype=np.int64)
        failed: list[int] = []
        exact = Exact(solids)
        arrays = clearance_arrays(solids, exact)

        def work(first: int, last: int) -> None:
            chunk = slice(first, last)
            failed.append(
                self.dll.fan_clearance(
                    ctypes.c_longlong(last - first),
                    pointer(q_D[chunk]),
                    pointer(q_K[chunk]),
                    pointer(p),
                    *(None if a is None else pointer(a[chunk]) for a in move_arrays),
                    ctypes.byref(arrays),
                    pointer(clearance[chunk]),
                    pointer(lower[chunk]),
                    pointer(pair[chunk]),
                )
            )

        parts = max(1, min(threads, n // _CONFIGURATIONS_PER_THREAD))
        bounds = np.linspace(0, n, parts + 1).astype(int)
        helpers = [threading.Thread(target=work, args=span) for span in pairwise(bounds[1:])]
        with exact:
            for helper in helpers:
                helper.start()
            if n:
                work(0, bounds[1])
            for helper in helpers:
                helper.join()
        if any(failed):
            raise MemoryError("no memory for clearances")
        return clearance, lower, pair
