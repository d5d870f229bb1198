"""A planner's rollouts in the compiled library (Python side of ``search/rollouts.hpp``).

A rollout is a simulation within the search, and a segment a piece of it with constant driven
accelerations acc_K. q_D and q_K are the dynamic and driven coordinates; lanes are rollouts that the
vector unit of the processor advances together. A winch changes the length of a string. At a catch,
a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.kernel.contract import GoalKind
from fantoccini.kernel.runtime.clearance import Exact, Solids, clearance_arrays
from fantoccini.kernel.runtime.functions import Loaded, pointer
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.packing import new_arrays, packed, repacked
from fantoccini.kernel.runtime.structures import UNLIMITED, structures

UNKNOWN, POSE, POINT = GoalKind
"""Kinds of goals; ``UNKNOWN`` is a Python function, which the library does not evaluate."""

STATE = ("q_D", "v_D", "slip", "q_K", "v_K")
"""Parts of a state."""

_RESULTS = (*STATE, "distance", "n_checks", "catches")
"""Results of every segment."""


@dataclass(frozen=True, eq=False)
class GoalNumbers:
    """A goal as numbers for the compiled library; see ``search/goal.hpp``.

    Attributes:
        kind: ``UNKNOWN``, ``POSE`` or ``POINT``.
        low, high: (n_qD,) interval of a pose.
        weight: (n_vD,) weights of its coordinates.
        v_D, v_K: (n_vD,), (n_vK,) target velocities.
        link: index of the link that carries the point.
        at: (3,) the point in the link's frame [m].
        place, place_high: (3,) corners of the target box [m].
        speed_weight, driven_weight: weights of the errors of v_D and v_K [s].
        touches: (n_pairs,) touch to which a contact pair belongs, or -1; None without touches.
        n_touches: number of required touches.
        open: addition to the distance while a touch does not push.
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
    touches: Indices | None = None
    n_touches: int = 0
    open: float = 0.0

    def structure(self, tolerance: float) -> ctypes.Structure:
        """The C structure."""
        return packed("GoalArrays", tolerance=tolerance, **vars(self))


@dataclass(frozen=True, eq=False)
class LqrLaw:
    """An equilibrium and the feedback law that leads to it; see ``search/feedback.hpp``.

    Attributes:
        q_D, q_K: (n_qD,), (n_qK,) the equilibrium.
        gains: (n_vK, 2 n_vD + 2 n_vK) gains of (dq_D, v_D, dq_K, v_K).
    """

    q_D: Array
    q_K: Array
    gains: Array


@dataclass(frozen=True, eq=False)
class RolloutSettings:
    """Settings common to all rollouts of a planner.

    Attributes:
        options: options of the time-stepper; ``save_every`` is the number of steps between checks.
        n_checks: number of checks of a segment.
        p, winches: see :class:`fantoccini.kernel.runtime.Run`.
        bounds: speed and acceleration (n_vK,), low and high (n_qK,).
        margin: minimum clearance [m].
        slack: whether taut strings may go slack.
        solids: solids with a minimum clearance.
        kept_off: (n_pairs,) bool, the contact pairs that must not touch.
        goal: end of a rollout.
        tolerance: distance from the goal at which it ends; negative to continue.
    """

    options: RunOptions
    n_checks: int
    p: Array
    winches: Array
    bounds: dict[str, Array]
    margin: float
    slack: bool
    solids: Solids
    goal: GoalNumbers
    tolerance: float
    kept_off: MaskRows | None = None


@dataclass(frozen=True, eq=False)
class Segments:
    """The segments of n rollouts.

    Attributes:
        states: part of a state -> (n, segments, width), at the segments' ends.
        acc_K: (n, segments, n_vK) [m/s^2 or rad/s^2].
        n_checks: (n, segments) duration of a segment in checks; 0 if not completed.
        distance: (n, segments) distance from the goal at its end.
        catches: (n, segments) number of strings and limits caught.
        n_simulated: number of rollouts simulated: all up to the first that reached the goal.
    """

    states: dict[str, Array]
    acc_K: Array
    n_checks: Indices
    distance: Array
    catches: Indices
    n_simulated: int


class RolloutLibrary(Loaded):
    """A puppet's compiled library of rollouts."""

    def distances(
        self, goal: GoalNumbers, q_D: Array, v_D: Array, q_K: Array, v_K: Array, p: Array
    ) -> Array:
        """(n,) distances of states (n, n_qD), (n, n_vD), (n, n_qK), (n, n_vK) from a goal."""
        structure = goal.structure(0.0)
        states = [np.ascontiguousarray(a, dtype=float) for a in (q_D, v_D, q_K, v_K, p)]
        distances = np.empty(len(q_D))
        n = ctypes.c_longlong(len(q_D))
        self.dll.fan_goal_distances(
            n, *map(pointer, states), ctypes.byref(structure), pointer(distances)
        )
        return distances


class RolloutPool:
    """Simulates rollouts on several threads.

    Args:
        library: the puppet's library.
        settings: settings common to the rollouts.
        threads: number of threads; results do not depend on it.
    """

    def __init__(self, library: RolloutLibrary, settings: RolloutSettings, threads: int):
        self._library, self._others = library, threads - 1
        self._solids = settings.solids
        bounds, kept_off = settings.bounds, settings.kept_off
        self._arrays = packed(
            "RolloutArrays",
            n_checks=settings.n_checks,
            steps=settings.options.save_every,
            options=settings.options.structure(),
            p=settings.p,
            winches=np.minimum(settings.winches, UNLIMITED),
            bounds=packed("BoundArrays", **bounds),
            margin=settings.margin,
            may_slacken=int(settings.slack),
            goal=settings.goal.structure(settings.tolerance),
            kept_off=None if kept_off is None or not np.any(kept_off) else kept_off,
        )
        self._sizes = {
            "n_qD": len(settings.goal.low),
            "n_vD": len(settings.goal.weight),
            "n_strings": len(settings.solids.string_radius),
            "n_qK": len(bounds["low"]),
            "n_vK": len(bounds["speed"]),
        }

    def __call__(
        self,
        starts: dict[str, Array],
        start: Indices,
        acc_K: Array,
        n_given: Indices,
        n_segments: Indices | None = None,
        laws: Sequence[LqrLaw] = (),
        law: Indices | None = None,
        lead_time: Array | None = None,
        n_checks: int | None = None,
    ) -> Segments:
        """Simulates each rollout until it is complete, reaches the goal, or leaves its bounds.

        The first that reaches the goal ends the search: later ones are discarded.

        Args:
            starts: part of a state -> (m, width).
            start: (n,) index of the start of each rollout.
            acc_K: (n, segments, n_vK) accelerations of its first segments.
            n_given: (n,) number of these; a law controls the other segments.
            n_segments: (n,) number of segments of each, at least one; all by default.
            laws: feedback laws.
            law: (n,) index of the law of each; the first by default.
            lead_time: (n,) lead of a law's reference; 1 by default [s].
            n_checks: number of checks of a segment; that of the settings by default.

        Raises:
            ValueError: wrong shapes, or indices out of range.
            MemoryError: no memory for the rollouts.
        """
        n, segments = acc_K.shape[:2]
        acc_K = np.array(acc_K, dtype=float, order="C")
        indices: dict[str, Indices] = {
            "start": start,
            "n_segments": np.full(n, segments) if n_segments is None else n_segments,
            "n_given": n_given,
            "law": np.zeros(n, dtype=int) if law is None else law,
        }
        out: dict[str, Any] = new_arrays(
            "SegmentArrays", _RESULTS, self._sizes, n=n, segments=segments
        )
        self._check(starts, acc_K, indices, len(laws))
        for name in STATE:
            out[name].fill(np.nan)
        out["distance"].fill(np.inf)
        law_arrays = [packed("LqrLawArrays", **vars(law)) for law in laws]
        exact = Exact(self._solids)
        arrays: Any = repacked(
            self._arrays,
            n=n,
            segments=segments,
            solids=clearance_arrays(self._solids, exact),
            acc_K=acc_K,
            lead_time=np.ones(n) if lead_time is None else lead_time,
            laws=(structures["LqrLawArrays"] * max(1, len(law_arrays)))(*law_arrays),
            out=packed("SegmentArrays", **out),
            **indices,
            **{name: starts[name] for name in STATE},
        )
        arrays.n_checks = n_checks or arrays.n_checks
        # Ctrl-C may leave a worker behind: its data live as long as `arrays`.
        arrays.kept += [law_arrays, exact]
        with exact:
            reached = self._work(arrays)
        out["n_checks"][reached + 1 :] = 0
        states = {name: out[name] for name in STATE}
        return Segments(
            states, acc_K, out["n_checks"], out["distance"], out["catches"], min(reached + 1, n)
        )

    def _check(
        self, starts: dict[str, Array], acc_K: Array, indices: dict[str, Indices], n_laws: int
    ) -> None:
        """Raises ValueError if sizes or indices exceed the arrays."""
        n, segments = acc_K.shape[:2]
        n_starts = len(starts["q_D"])
        shapes = {name: a.shape for name, a in starts.items()}
        widths = dict(zip(STATE, self._sizes.values(), strict=True))
        if shapes != {name: (n_starts, w) for name, w in widths.items()}:
            raise ValueError(f"the starts have the shapes {shapes}, which are not this puppet's")
        if acc_K.shape[2] != self._sizes["n_vK"] or not segments:
            raise ValueError(f"the accelerations have the shape {acc_K.shape}")
        if any(np.shape(a) != (n,) for a in indices.values()):
            raise ValueError(f"{', '.join(indices)} must have one entry for each rollout")
        led = np.any(np.less(indices["n_given"], indices["n_segments"]))
        for name, minimum, maximum in (
            ("start", 0, n_starts - 1),
            ("n_segments", 1, segments),
            ("n_given", 0, segments),
            ("law", 0, n_laws - 1 if led else max(0, n_laws - 1)),
        ):
            a = indices[name]
            if n and not (minimum <= np.min(a) and np.max(a) <= maximum):
                span = f"{np.min(a)} to {np.max(a)}"
                raise ValueError(
                    f"{name} ranges from {span}; it must lie in {minimum} to {maximum}"
                )

    def _work(self, arrays: Any) -> int:
        """Simulates the rollouts; index of the first that reached the goal, n if there is none."""
        progress: Any = packed("RolloutProgress", next=0, reached=arrays.n)

        def work() -> int:
            return self._library.dll.fan_rollouts(ctypes.byref(arrays), ctypes.byref(progress))

        helpers: list[Future[int]] = []
        n_needed = -(-arrays.n // _THREADING.lanes) - 1
        # Python handles signals only while this thread is outside the library.
        steps = arrays.n * arrays.segments * arrays.n_checks * arrays.steps
        releases_lock = steps > _THREADING.max_blocking_steps
        try:
            for _ in range(min(self._others, n_needed) + releases_lock):
                helpers.append(_helpers(self._others + 1).submit(work))
            failed = [] if releases_lock else [work()]
            failed += [helper.result() for helper in helpers]
        except BaseException:
            # Output arrays must live until all have stopped, however often Ctrl-C is pressed.
            progress.reached = -1
            while not all(helper.done() or helper.cancel() for helper in helpers):
                with contextlib.suppress(KeyboardInterrupt):
                    wait(helpers)
            raise
        if any(failed):
            raise MemoryError("no memory for rollouts")
        return progress.reached


@dataclass(frozen=True)
class _Threading:
    """Thresholds for the use of threads by rollouts."""

    max_blocking_steps: int = 500_000
    """Time steps during which this thread may ignore signals: some tenths of a second."""
    lanes: int = 8
    """Rollouts that one thread simulates at once with the widest lanes."""


_THREADING = _Threading()


@cache
def _helpers(n: int) -> ThreadPoolExecutor:
    """Waiting threads: starting one takes as long as several rollouts."""
    return ThreadPoolExecutor(n, thread_name_prefix="fantoccini-rollouts")


# A forked child has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)
