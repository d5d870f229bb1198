"""Results of compiling kept for the next round and the next time, by all they depend on."""

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

_MOST = 600
"""Results that are kept; those that were used longest ago go first."""


class OutOfTime(Exception):
    """The time limit has passed, so that no further result is computed."""


@dataclass
class Kept:
    """Results by key; several threads may ask.

    Attributes:
        made: number of results computed because they were not kept.
        until: time of the monotonic clock after which no result is computed [s]; see
            :meth:`limited`.
    """

    made: int = 0
    until: float = math.inf
    _found: OrderedDict[str, Any] = field(default_factory=OrderedDict)
    _lock: Lock = field(default_factory=Lock)

    @contextmanager
    def limited(self, until: float) -> Iterator[None]:
        """Computes no result after a time of the monotonic clock [s], while the context lasts."""
        self.until = until
        try:
            yield
        finally:
            self.until = math.inf

    def get(self, key: str, job: Callable[[], T]) -> T:
        """A result, made where it is not kept.

        Args:
            key: says all that the result depends on.
            job: makes it.

        Raises:
            OutOfTime: it is not kept, and the time is over.
        """
        with self._lock:
            if key in self._found:
                self._found.move_to_end(key)
                found: T = self._found[key]
                return found
        self.check()
        made = job()
        with self._lock:
            self.made += 1
            self._found[key] = made
            while len(self._found) > _MOST:
                self._found.popitem(last=False)
        return made

    def check(self, *_: object) -> None:
        """Raises OutOfTime if the time is over; can be the callback of a job's progress."""
        if time.monotonic() > self.until:
            raise OutOfTime

    def side_by_side(self, jobs: Mapping[str, Callable[[], T]], threads: int) -> dict[str, T]:
        """Name -> what each job makes, several at once."""
        with ThreadPoolExecutor(max(1, threads)) as pool:
            return dict(zip(jobs, pool.map(lambda job: job(), jobs.values()), strict=True))


def digest(x: State, motion: Gesture, *more: object) -> str:
    """A hash of a state, a motion of the hands from there, and more."""
    h = hashlib.blake2b(repr((motion.coordinates.q_D, *more)).encode())
    for array in (x.q_D, x.v_D, x.q_K, x.v_K, x.taut, x.slip, motion.breaks, motion.coef):
        h.update(np.ascontiguousarray(array).tobytes())
    return h.hexdigest()
