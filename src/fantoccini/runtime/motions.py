"""A planner's motions: the Python side of ``cpp/fantoccini/sweep.hpp``."""

from __future__ import annotations

import contextlib
import ctypes
import os
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import GoalKind
from fantoccini.runtime.clearance import Exact, Solids, clearance_arrays
from fantoccini.runtime.functions import Loaded, pointer
from fantoccini.runtime.structures import UNLIMITED, RunOptions, structures

UNKNOWN, POSE, POINT = GoalKind
"""Kinds of goals."""

STATE = ("q_D", "v_D", "slip", "q_K", "v_K")
"""Parts of a state."""

_GoalArrays, _FunnelArrays, _BoundArrays, _SegmentArrays, _SweepArrays, _SweepProgress = (
    structures[name]
    for name in (
        "GoalArrays", "FunnelArrays", "BoundArrays", "SegmentArrays", "SweepArrays",
        "SweepProgress",
    )
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class GoalNumbers:
    """A goal as the library knows it; see ``goal.hpp``.

    Attributes:
        kind: ``UNKNOWN``, ``POSE`` or ``POINT``.
        low, high: (n_qD,) of a pose.
        weight: (n_vD,) of its coordinates.
        v_D, v_K: (n_vD,), (n_vK,) wanted velocities.
        link: of a point.
        at: (3,) in the link's frame [m].
        place, place_high: (3,) corners of the box it is to be in [m].
        speed_weight, driven_weight: of what v_D and v_K lack of them [s].
    """

    kind: int
    low: Array
    high: Array
    weight: Array
    v_D: Array
    v_K: Array
    link: int = 0
    at: Array = field(default_factory=lambda: np.zeros(3))
    place: Array = field(default_factory=lambda: np.zeros(3))
    place_high: Array = field(default_factory=lambda: np.zeros(3))
    speed_weight: float = 0.0
    driven_weight: float = 0.0

    def structure(self, tolerance: float, kept: list[Array]) -> _GoalArrays:
        """As the library takes it; ``kept`` must live as long as that."""
        arrays = ("low", "high", "weight", "v_D", "v_K")
        corners = ("at", "place", "place_high")
        return _GoalArrays(
            kind=self.kind, link=self.link, tolerance=tolerance,
            speed_weight=self.speed_weight, driven_weight=self.driven_weight,
            **{name: _held(getattr(self, name), kept) for name in arrays},
            **{name: (ctypes.c_double * 3)(*getattr(self, name)) for name in corners},
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Funnel:
    """An equilibrium and the law that leads there; see ``feedback.hpp``.

    Attributes:
        q_D, q_K: (n_qD,), (n_qK,) the equilibrium.
        gains: (n_vK, 2 n_vD + 2 n_vK) on (dq_D, v_D, dq_K, v_K).
    """

    q_D: Array
    q_K: Array
    gains: Array


@dataclass(frozen=True, eq=False)
class Terms:
    """What all motions of a planner have in common.

    Attributes:
        options: of the time-stepper.
        looks: of a segment.
        p, winches: as of :class:`fantoccini.runtime.Run`.
        bounds: speed and acceleration (n_vK,), low and high (n_qK,) places.
        margin: least clearance [m].
        slack: whether strings that pull may go slack.
        solids: what is kept clear of what.
        goal: that a motion ends at.
        tolerance: of the goal's distance; negative where motions go on.
    """

    options: RunOptions
    looks: int
    p: Array
    winches: Array
    bounds: dict[str, Array]
    margin: float
    slack: bool
    solids: Solids
    goal: GoalNumbers
    tolerance: float


@dataclass(frozen=True, eq=False)
class Segments:
    """What motions made, segment by segment.

    Attributes:
        states: part of a state -> (n, segments, width), at the segments' ends.
        acc_K: (n, segments, n_vK) [m/s^2 or rad/s^2].
        looks: (n, segments) that a segment lasted; 0 where it was not made.
        distance: (n, segments) from the goal at its end.
        catches: (n, segments) strings and limits that were caught.
        n_made: motions that were made: all up to the first that reached the goal.
    """

    states: dict[str, Array]
    acc_K: Array
    looks: Array
    distance: Array
    catches: Array
    n_made: int

    def of(self, i: int) -> Segments:
        """One of the motions."""
        one = slice(i, i + 1)
        states = {name: a[one] for name, a in self.states.items()}
        return Segments(
            states, self.acc_K[one], self.looks[one], self.distance[one], self.catches[one], 1
        )


class MotionLibrary(Loaded):
    """A library that makes a planner's motions."""

    def distances(
        self, goal: GoalNumbers, q_D: Array, v_D: Array, q_K: Array, v_K: Array, p: Array
    ) -> Array:
        """(n,) distances of states (n, n_qD), (n, n_vD), (n, n_qK), (n, n_vK) from a goal."""
        kept: list[Array] = []
        structure = goal.structure(0.0, kept)
        rows = [_held(a, kept) for a in (q_D, v_D, q_K, v_K, p)]
        found = np.empty(len(q_D))
        n = ctypes.c_longlong(len(q_D))
        self.handle.fan_goal_distances(n, *rows, ctypes.byref(structure), pointer(found))
        return found


class Sweeper:
    """Makes motions on some threads.

    Args:
        library: of the puppet.
        terms: what the motions have in common.
        threads: that share the work.
    """

    def __init__(self, library: MotionLibrary, terms: Terms, threads: int):
        self._library, self._others = library, threads - 1
        self._kept: list[Array] = []
        kept = self._kept
        self._solids = terms.solids
        self._arrays = _SweepArrays(
            looks=terms.looks,
            steps=terms.options.save_every,
            options=terms.options.structure(),
            p=_held(terms.p, kept),
            winches=_held(np.minimum(terms.winches, UNLIMITED), kept),
            bounds=_BoundArrays(**{name: _held(a, kept) for name, a in terms.bounds.items()}),
            margin=terms.margin,
            may_slacken=int(terms.slack),
            goal=terms.goal.structure(terms.tolerance, kept),
        )
        n_K, n_qK = (len(terms.bounds[name]) for name in ("speed", "low"))
        self._widths = {
            "q_D": len(terms.goal.low),
            "v_D": len(terms.goal.weight),
            "slip": len(terms.solids.string_radius),
            "q_K": n_qK,
            "v_K": n_K,
        }

    def __call__(
        self,
        starts: dict[str, Array],
        chosen: Array,
        acc_K: Array,
        given: Array,
        made: Array | None = None,
        funnels: list[Funnel] = (),
        which: Array | None = None,
        reach: Array | None = None,
        looks: int | None = None,
    ) -> Segments:
        """Motions, each until it is done, reaches the goal, or comes into collision.

        None is made, or kept, after the first that reaches the goal.

        Args:
            starts: part of a state -> (m, width) rows.
            chosen: (n,) the row that a motion begins at.
            acc_K: (n, segments, n_vK) accelerations of its first segments.
            given: (n,) how many of them are given; the others are led.
            made: (n,) how many segments it has, one at least; all by default.
            funnels: where to.
            which: (n,) the funnel of a motion.
            reach: (n,) by how much it hurries [s].
            looks: of a segment; those of the terms when not given.
        """
        kept: list[Array] = []
        n, segments = acc_K.shape[:2]
        acc_K = np.array(acc_K, dtype=float, order="C")
        which = np.zeros(n) if which is None else which
        reach = np.ones(n) if reach is None else reach
        laws = (_FunnelArrays * max(1, len(funnels)))(
            *(
                _FunnelArrays(**{name: _held(a, kept) for name, a in vars(f).items()})
                for f in funnels
            )
        )
        made = np.full(n, segments) if made is None else np.asarray(made)
        given, which, chosen = (np.asarray(a) for a in (given, which, chosen))
        self._check(starts, chosen, acc_K, given, made, which, len(funnels))
        states = {name: np.full((n, segments, w), np.nan) for name, w in self._widths.items()}
        distance = np.full((n, segments), np.inf)
        lasted = np.zeros((n, segments), dtype=np.int32)
        catches = np.zeros((n, segments), dtype=np.int32)
        arrays = _SweepArrays.from_buffer_copy(self._arrays)
        arrays.n, arrays.segments = n, segments
        exact = Exact(self._solids)
        solids = clearance_arrays(self._solids, exact, kept)
        arrays.solids = ctypes.addressof(solids)
        arrays.looks = looks or arrays.looks
        arrays.begins = _held(chosen, kept, np.int64)
        for name in STATE:
            setattr(arrays, name, _held(starts[name], kept))
        arrays.acc_K = pointer(acc_K)
        arrays.made = _held(made, kept, np.int32)
        arrays.given, arrays.which = _held(given, kept, np.int32), _held(which, kept, np.int32)
        arrays.reach, arrays.funnels = _held(reach, kept), ctypes.addressof(laws)
        out = {**states, "distance": distance, "looks": lasted, "catches": catches}
        arrays.out = _SegmentArrays(**{name: pointer(a) for name, a in out.items()})
        # Ctrl-C may leave a worker behind: what it uses lives as long as `arrays`.
        arrays.held = (self._kept, kept, acc_K, laws, out, solids, exact)
        with exact:
            reached = self._work(arrays)
        lasted[reached + 1 :] = 0
        return Segments(states, acc_K, lasted, distance, catches, min(reached + 1, n))

    def _check(
        self,
        starts: dict[str, Array],
        chosen: Array,
        acc_K: Array,
        given: Array,
        made: Array,
        which: Array,
        n_funnels: int,
    ) -> None:
        """Raises ValueError where sizes or numbers would lead out of the arrays."""
        n, segments = acc_K.shape[:2]
        rows = len(starts["q_D"])
        shapes = {name: a.shape for name, a in starts.items()}
        if shapes != {name: (rows, w) for name, w in self._widths.items()}:
            raise ValueError(
                f"the starts have the shapes {shapes}; needed: rows of a puppet's states"
            )
        if acc_K.shape[2] != self._widths["v_K"] or not segments:
            raise ValueError(f"the accelerations have the shape {acc_K.shape}")
        if any(a.shape != (n,) for a in (chosen, given, made, which)):
            raise ValueError("chosen, given, made and which have an entry for every motion")
        led = np.any(given < made)
        for name, a, low, high in (
            ("chosen", chosen, 0, rows - 1),
            ("made", made, 1, segments),
            ("given", given, 0, segments),
            ("which", which, 0, n_funnels - 1 if led else max(0, n_funnels - 1)),
        ):
            if n and not (low <= np.min(a) and np.max(a) <= high):
                span = f"{np.min(a)} to {np.max(a)}"
                raise ValueError(f"{name} goes from {span}; it must lie in {low} to {high}")

    def _work(self, arrays: _SweepArrays) -> int:
        """Makes the motions; the first that reached the goal, n where none did."""
        progress = _SweepProgress(next=0, reached=arrays.n)

        def work() -> int:
            return self._library.handle.fan_sweep(ctypes.byref(arrays), ctypes.byref(progress))

        others: list[Future[int]] = []
        needed = -(-arrays.n // _BUNDLE) - 1
        # Python hears signals only where it is not in the library itself.
        steps = arrays.n * arrays.segments * arrays.looks * arrays.steps
        away = steps > _DEAF
        try:
            for _ in range(min(self._others, needed) + away):
                others.append(_helpers(self._others + 1).submit(work))
            failed = [] if away else [work()]
            failed += [other.result() for other in others]
        except BaseException:
            # What they write to must live until they have stopped, however often Ctrl-C comes.
            progress.reached = -1
            while not all(other.done() or other.cancel() for other in others):
                with contextlib.suppress(KeyboardInterrupt):
                    wait(others)
            raise
        if any(failed):
            raise MemoryError("no memory for motions")
        return progress.reached


_DEAF = 500_000
"""Steps of motions for which this thread may be deaf to signals: some tenths of a second."""

_BUNDLE = 8
"""Motions that one thread makes side by side where lanes are widest; fewer need no other thread."""


@cache
def _helpers(n: int) -> ThreadPoolExecutor:
    """Threads that wait for work: to start one takes as long as some motions."""
    return ThreadPoolExecutor(n, thread_name_prefix="fantoccini-motions")


# A child of a fork has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)


def _held(array: Array, kept: list[Array], dtype: type = float) -> ctypes.c_void_p:
    """Where an array's numbers lie, once it is contiguous; kept alive in ``kept``."""
    kept.append(np.ascontiguousarray(array, dtype=dtype))
    return pointer(kept[-1])
