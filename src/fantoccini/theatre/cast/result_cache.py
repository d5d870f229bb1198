"""Cache of the results of compiling, across rounds and calls; keys hold all they depend on."""

from __future__ import annotations

import hashlib
import math
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, TypeVar

import numpy as np

from fantoccini.motion import State
from fantoccini.theatre.gestures import Gesture

T = TypeVar("T")

_MAX_RESULTS = 600
"""Number of cached results; the least recently used ones are dropped first."""


class OutOfTime(Exception):
    """The time limit has passed; no further result is computed."""


@dataclass
class ResultCache:
    """Results by key, for use from several threads.

    Attributes:
        n_computed: number of results computed because they were not cached.
        until: time of the monotonic clock after which no result is computed [s]; see
            :meth:`limited`.
    """

    n_computed: int = 0
    until: float = math.inf
    _results: OrderedDict[str, Any] = field(default_factory=OrderedDict)
    _lock: Lock = field(default_factory=Lock)

    @contextmanager
    def limited(self, until: float) -> Iterator[None]:
        """Context in which nothing is computed after a time of the monotonic clock [s]."""
        self.until = until
        try:
            yield
        finally:
            self.until = math.inf

    def get(self, key: str, job: Callable[[], T]) -> T:
        """Cached result, computed if it is missing.

        Args:
            key: text that determines the result.
            job: computes it.

        Raises:
            OutOfTime: it is missing, and the time limit has passed.
        """
        with self._lock:
            if key in self._results:
                self._results.move_to_end(key)
                cached: T = self._results[key]
                return cached
        self.check()
        result = job()
        with self._lock:
            self.n_computed += 1
            self._results[key] = result
            while len(self._results) > _MAX_RESULTS:
                self._results.popitem(last=False)
        return result

    def check(self, *_: object) -> None:
        """Raises OutOfTime after the time limit; can serve as a job's progress callback."""
        if time.monotonic() > self.until:
            raise OutOfTime

    def side_by_side(self, jobs: Mapping[str, Callable[[], T]], threads: int) -> dict[str, T]:
        """Name -> result of each job, computed in parallel."""
        with ThreadPoolExecutor(max(1, threads)) as pool:
            return dict(zip(jobs, pool.map(lambda job: job(), jobs.values()), strict=True))


def digest(x: State, motion: Gesture, *more: object) -> str:
    """Hash of a state, of a motion of the hands from there, and of further values."""
    h = hashlib.blake2b(repr((motion.coordinates.q_D, *more)).encode())
    for array in (x.q_D, x.v_D, x.q_K, x.v_K, x.taut, x.slip, motion.breaks, motion.coef):
        h.update(np.ascontiguousarray(array).tobytes())
    return h.hexdigest()
