"""Cache of results of compiled plays, across rounds, calls and processes.

Keys hold all that results depend on; on disk, also the package, the libraries and the processor.

A round places and simulates all cues of a play once. A digest is a hash of everything that a result
depends on; a disk format converts a result to arrays and back. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints. Breaks are the times at which the pieces of a motion meet, and `coef` their
coefficients.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np

from fantoccini.base import Array, npz
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.build import RESULTS, results_fingerprint
from fantoccini.motion import State, Trajectory, pack_run, unpack_run
from fantoccini.theatre.gestures import Gesture

T = TypeVar("T")

_MAX_RESULTS = 600
"""Number of cached results; the least recently used ones are dropped first."""


_MAX_BYTES = 1.5e9
"""Size of the results on disk above which the ones used least recently are removed [bytes]."""


@dataclass(frozen=True)
class DiskFormat(Generic[T]):
    """Conversion of a kind of result to arrays on disk, and back.

    Attributes:
        pack: arrays of a result.
        unpack: result of such arrays, to the same bits.
    """

    pack: Callable[[T], Sequence[Array]]
    unpack: Callable[[Sequence[Array]], T]


NUMBERS_FORMAT: DiskFormat[Any] = DiskFormat(
    lambda numbers: [np.array(numbers, dtype=float)], lambda arrays: tuple(arrays[0].tolist())
)
"""A tuple of numbers."""


def run_format(marionette: Marionette) -> DiskFormat[Trajectory]:
    """Format of runs of a puppet."""
    puppet, table = marionette.current_puppet, marionette.coordinates
    return DiskFormat(pack_run, lambda arrays: unpack_run(arrays, puppet, table))


def gesture_format(marionette: Marionette) -> DiskFormat[Gesture]:
    """Format of gestures of a puppet."""

    def pack(gesture: Gesture) -> list[Array]:
        words = text_array([gesture.name, dict(gesture.marks), gesture.changes_heading])
        named = gesture.named.astype(float)
        return [words, gesture.breaks, gesture.coef, named, gesture.travel]

    def unpack(arrays: Sequence[Array]) -> Gesture:
        words, breaks, coef, named, travel = arrays
        return Gesture(
            marionette.coordinates, breaks, coef, named.astype(bool), travel, *text_in(words)
        )

    return DiskFormat(pack, unpack)


def text_array(value: Any) -> Array:
    """A value as JSON, in an array of bytes."""
    return np.frombuffer(json.dumps(value).encode(), dtype=np.uint8)


def text_in(array: Array) -> Any:
    """The inverse of :func:`text_array`."""
    return json.loads(array.tobytes())


class OutOfTime(Exception):
    """The time limit has passed; no further result is computed."""


@dataclass
class ResultCache:
    """Results by key, for use from several threads.

    Attributes:
        on_disk: whether results that have a format are read from the cache folder, and kept there
            for the next process.
        n_computed: number of results computed because they were not cached.
        deadline: time of the monotonic clock after which no result is computed [s]; see
            :meth:`time_limit`.
    """

    on_disk: bool = False
    n_computed: int = 0
    deadline: float = math.inf
    _results: OrderedDict[str, Any] = field(default_factory=OrderedDict)
    _lock: Lock = field(default_factory=Lock)

    @contextmanager
    def time_limit(self, deadline: float) -> Iterator[None]:
        """Context in which nothing is computed after a time of the monotonic clock [s]."""
        self.deadline = deadline
        try:
            yield
        finally:
            self.deadline = math.inf

    def get(self, key: str, job: Callable[[], T], disk_format: DiskFormat[T] | None = None) -> T:
        """Cached result, computed if it is missing.

        Args:
            key: text that determines the result.
            job: computes it.
            disk_format: its format on disk; None to keep it in memory only.

        Raises:
            OutOfTime: it is missing, and the time limit has passed.
        """
        with self._lock:
            if key in self._results:
                self._results.move_to_end(key)
                cached: T = self._results[key]
                return cached
        result = (
            self._from_disk(key, disk_format) if self.on_disk and disk_format is not None else None
        )
        computed = result is None
        if result is None:
            self.check()
            result = job()
            if self.on_disk and disk_format is not None:
                RESULTS.write(self._file(key), disk_format.pack(result))
        with self._lock:
            self.n_computed += computed
            self._results[key] = result
            while len(self._results) > _MAX_RESULTS:
                self._results.popitem(last=False)
        return result

    def _from_disk(self, key: str, disk_format: DiskFormat[T]) -> T | None:
        """Result that an earlier process kept; None if it is missing or damaged."""
        arrays = RESULTS.read(self._file(key))
        try:
            return None if arrays is None else disk_format.unpack(arrays)
        except npz.UNREADABLE:
            return None

    def _file(self, key: str) -> str:
        """Key of a result on disk."""
        return hashlib.sha256(f"{self._fingerprint} {key}".encode()).hexdigest()

    @cached_property
    def _fingerprint(self) -> str:
        RESULTS.trim(_MAX_BYTES)
        return results_fingerprint()

    def check(self, *_: object) -> None:
        """Raises OutOfTime after the time limit; also a progress callback for jobs."""
        if time.monotonic() > self.deadline:
            raise OutOfTime

    def in_parallel(self, jobs: Mapping[str, Callable[[], T]], threads: int) -> dict[str, T]:
        """Name -> result of each job, computed in parallel."""
        with ThreadPoolExecutor(max(1, threads)) as pool:
            return dict(zip(jobs, pool.map(lambda job: job(), jobs.values()), strict=True))


def digest(x: State, motion: Gesture, *further_values: object) -> str:
    """Hash of a state, of a motion of the hands from there, and of further values."""
    hasher = hashlib.blake2b(repr((motion.coordinates.q_D, *further_values)).encode())
    for array in (x.q_D, x.v_D, x.q_K, x.v_K, x.taut, x.slip, motion.breaks, motion.coef):
        hasher.update(np.ascontiguousarray(array).tobytes())
    return hasher.hexdigest()
