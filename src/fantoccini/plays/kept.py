"""What compiling keeps for the next time: runs of players, by what was played."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from fantoccini.gestures import Gesture
from fantoccini.motion import State, Trajectory

T = TypeVar("T")


@dataclass
class Kept:
    """Results of this round and of the one before.

    Results that a whole round has not asked for are dropped.

    Attributes:
        found, old: key -> result.
    """

    found: dict[Any, Any] = field(default_factory=dict)
    old: dict[Any, Any] = field(default_factory=dict)

    def next_round(self) -> None:
        """Drops what the round before has not asked for."""
        self.old, self.found = self.found, {}

    def all(self, jobs: Mapping[Any, Callable[[], T]], threads: int) -> dict[Any, T]:
        """The result of every job, made where it is not kept.

        Args:
            jobs: key -> what makes its result; keys say all that it depends on.
            threads: that share them.
        """
        for key in jobs:
            if key not in self.found and key in self.old:
                self.found[key] = self.old[key]
        missing = [key for key in jobs if key not in self.found]
        with ThreadPoolExecutor(max(1, threads)) as pool:
            for key, made in zip(missing, pool.map(lambda key: jobs[key](), missing), strict=True):
                self.found[key] = made
        return {key: self.found[key] for key in jobs}


def digest(x0: State, motion: Gesture, *more: object) -> str:
    """A hash of a start, a motion of the hands and more."""
    h = hashlib.blake2b(repr(more).encode())
    for array in (x0.q_D, x0.q_K, motion.breaks, motion.coef):
        h.update(np.ascontiguousarray(array).tobytes())
    return h.hexdigest()


Runs = Mapping[str, Trajectory]
"""Player -> its run."""
