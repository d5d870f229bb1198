"""What a task asks for that no hanging pose reaches, told before a long search."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError, Times
from fantoccini.control.optimal.reached import length
from fantoccini.control.optimal.reaching import reach
from fantoccini.control.tasks import Task, Track, path_of
from fantoccini.motion import State

_SAMPLES = 25
"""Places of a path that are looked at."""
_FAR = 1e-3
"""Distance from a path that is told [m]."""


def out_of_reach(task: Task) -> list[str]:
    """For each point, how near to its path or the place it touches it can hang, and why no nearer.

    A motion may swing farther than the puppet hangs, so this is no mistake of the task. Points
    within 1 mm of these are left out; so are all where the puppet does not hang at the start.
    """
    marionette, x0 = task.marionette, task.x0
    try:
        start = marionette.rest(x0)
    except StateError:
        return []
    found = [_of_track(task, track, start) for track in task.tracks]
    found += [
        _off(task, start, touch.body, touch.at, np.array([touch.place]), "the place it touches")
        for touch in task.touches
    ]
    return [text for text in found if text]


def _of_track(task: Task, track: Track, start: State) -> str:
    """How near a point can hang to its path; empty where it is no point, or there."""
    first = max(track.start, task.x0.t)
    last = min(track.end, task.x0.t + task.durations[1])
    if track.kind != "point" or not last > first or not track.weight + track.end_weight > 0.0:
        return ""
    t = np.linspace(first, last, _SAMPLES) if track.weight > 0.0 else np.array([last])
    places = path_of(task.marionette, track, t)
    return _off(task, start, track.name, track.at, places, "its path", t)


def _off(
    task: Task,
    start: State,
    body: str,
    at: tuple[float, float, float],
    places: Array,
    what: str,
    t: Times | None = None,
) -> str:
    """How far a point hangs from the farthest of some places; empty where it reaches all."""
    try:
        found = reach(task.marionette, {(body, at): places}, start, bounds=task.bounds, slack=True)
    except StateError:  # the start is beyond bounds, or hangs unstably: the search will tell
        return ""
    worst = int(np.argmax(found.distance))
    pose = found[worst]
    if pose or pose.distance <= _FAR:
        return ""
    when = "" if t is None else f" at {t[worst]:.3g} s"
    why = f": {pose.limits[0]}" if pose.limits else ""
    return f"{body} hangs no nearer than {length(pose.distance)} to {what}{when}{why}"
