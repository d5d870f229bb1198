"""A check, before a long search, for targets of a task that no hanging pose reaches.

In a hanging pose, a puppet is at rest for given ends and lengths of its strings. A touch is a point
of a body that should pass a place.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError, Times
from fantoccini.control.optimal.reached import length_text
from fantoccini.control.optimal.reaching import reach
from fantoccini.control.tasks import Task, Track, track_path
from fantoccini.motion import State

_SAMPLES = 25
"""Number of points of a path that are checked."""
_MIN_DISTANCE = 1e-3
"""Smallest distance from a path that is reported [m]."""


def reach_notes(task: Task) -> list[str]:
    """Notes on points that cannot hang near their path or touch: the distance and its reason.

    A motion may swing farther than the puppet hangs, so this is no mistake of the task. Points
    within 1 mm are left out; so are all points if the puppet does not hang at the start.
    """
    marionette, x0 = task.marionette, task.x0
    try:
        start = marionette.rest(x0)
    except StateError:
        return []
    notes = [_track_note(task, track, start) for track in task.tracks]
    notes += [
        _farthest_place(
            task, start, touch.body, touch.at, np.array([touch.place]), "the place it touches"
        )
        for touch in task.all_touches
    ]
    return [text for text in notes if text]


def _track_note(task: Task, track: Track, start: State) -> str:
    """A note on the path of a point; empty if the point can hang there, or for another track."""
    first = max(track.start, task.x0.t)
    last = min(track.end, task.x0.t + task.durations[1])
    if track.kind != "point" or not last > first or not track.weight + track.end_weight > 0.0:
        return ""
    t = np.linspace(first, last, _SAMPLES) if track.weight > 0.0 else np.array([last])
    positions = track_path(task.marionette, track, t)
    return _farthest_place(task, start, track.name, track.at, positions, "its path", t)


def _farthest_place(
    task: Task,
    start: State,
    body: str,
    at: tuple[float, float, float],
    places: Array,
    label: str,
    t: Times | None = None,
) -> str:
    """A note on the place that a point misses by the largest distance; empty if it reaches all."""
    try:
        poses = reach(
            task.marionette,
            {(body, at): places},
            start,
            bounds=task.bounds,
            slack=task.conditions.slack,
        )
    except StateError:  # the start is beyond bounds or hangs unstably: the search reports that
        return ""
    worst = int(np.argmax(poses.distance))
    pose = poses[worst]
    if pose or pose.distance <= _MIN_DISTANCE:
        return ""
    at_time = "" if t is None else f" at {t[worst]:.3g} s"
    reason = f": {pose.limits[0]}" if pose.limits else ""
    return f"{body} hangs no nearer than {length_text(pose.distance)} to {label}{at_time}{reason}"
