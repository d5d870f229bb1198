"""The pace of a run: computing time per motion, and the causes of short steps.

The pace is bad if a second of motion takes long to compute.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Times
from fantoccini.motion import ContactPoints, EventRecord, pair_name


@dataclass(frozen=True)
class _Limits:
    """Limits above which a run counts as slow."""

    first_check: float = 3.0
    """Computing time before the first check of the pace [s]."""
    pace_time: float = 1.0
    """Computing time over which the pace is measured [s]."""
    max_remaining: float = 60.0
    """Remaining computing time, at this pace, above which a run warns [s]."""
    n_samples: int = 500
    """Number of the last samples, searched for chattering strings and bodies."""
    max_named: int = 3
    """Maximum number of names in the message."""


LIMITS = _Limits()


class SlowRunWarning(UserWarning):
    """A run takes far more computing time than its motion lasts."""


class Pace:
    """Monitor of a run's computing time.

    Attributes:
        seconds: computing time so far [s].

    Args:
        t, t_end: start and end of the run [s].
        limit: computing time after which the run is late [s]; None for no limit.
        cause: callback for the text on the cause of short steps.
    """

    def __init__(self, t: float, t_end: float, limit: float | None, cause: Callable[[], str]):
        self._began = time.perf_counter()
        self._t_end, self._limit, self._cause_text = t_end, limit, cause
        self._progress_marks = deque([(0.0, t)])
        self._has_warned = False

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self._began

    @property
    def is_over_limit(self) -> bool:
        """Whether the limit is reached."""
        return self._limit is not None and self.seconds > self._limit

    def report_time(self, t: float) -> None:
        """Records the time reached [s]; warns once if the end is far away at this pace."""
        now, marks = self.seconds, self._progress_marks
        marks.append((now, t))
        while len(marks) > 2 and now - marks[1][0] > LIMITS.pace_time:
            marks.popleft()
        if self._has_warned or now < LIMITS.first_check:
            return
        computing_time, motion_time = now - marks[0][0], t - marks[0][1]
        remaining = (
            (self._t_end - t) * computing_time / motion_time if motion_time > 0.0 else np.inf
        )
        if remaining <= LIMITS.max_remaining:
            return
        self._has_warned = True
        forecast = (
            "does not come nearer to" if remaining == np.inf else f"needs {remaining:.2g} s more to"
        )
        warnings.warn(
            f"after {now:.1f} s of computing the run is at t = {t:.6g} s and {forecast} its end at "
            f"{self._t_end:g} s: {self._cause_text()}. method='timestepping' steps over events "
            "this fast, at less accuracy; time_limit bounds the computing time",
            SlowRunWarning,
            stacklevel=4,
        )


def short_steps_message(
    t: Times, contact: ContactPoints | None, events: Iterable[EventRecord]
) -> str:
    """Text on the cause of a run's short last steps: their events and contacts.

    Args:
        t: (T,) times of the samples [s].
        contact: points that pushed; None without contact.
        events: events of the run.
    """
    first = max(0, len(t) - LIMITS.n_samples)
    if len(t) - first < 2:  # few samples are saved
        return "its steps are short"
    text = f"its last {len(t) - first} samples take {t[-1] - t[first]:.2g} s of motion"
    counts = Counter(e.name for e in events if e.name and e.t >= t[first])
    if counts:
        frequent = counts.most_common(LIMITS.max_named)
        text += ", with events of " + ", ".join(f"{name} ({n})" for name, n in frequent)
    if contact is not None:
        loaded = contact.subset(contact.sample >= first)
        pairs = Counter(pair_name(contact.names[k]) for k in loaded.pair.tolist())
        names = [name for name, _ in pairs.most_common(LIMITS.max_named) if name not in counts]
        if names:
            text += f", while {', '.join(names)} {'touches' if len(names) == 1 else 'touch'}"
    return text
