"""What a task asks for that no hanging pose reaches, told before a long search."""

from __future__ import annotations

import numpy as np

from fantoccini.errors import StateError
from fantoccini.optimal.reached import length
from fantoccini.optimal.reaching import reach
from fantoccini.optimal.targets import values_at
from fantoccini.optimal.task import Task

_SAMPLES = 25
"""Places of a path that are looked at."""
_FAR = 1e-3
"""Distance from a path that is told [m]."""


def out_of_reach(task: Task) -> list[str]:
    """For each point tracked, how near to its path it can hang, and why no nearer.

    A motion may swing farther than the puppet hangs, so this is no mistake of the task. Points
    within 1 mm of their paths are left out; so are all where the puppet does not hang at the start.
    """
    marionette, x0 = task.marionette, task.x0
    try:
        start = marionette.rest(x0)
    except StateError:
        return []
    texts = []
    for track in task.tracks:
        first, last = max(track.start, x0.t), min(track.end, x0.t + task.durations[1])
        if track.kind != "point" or not last > first or not track.weight + track.end_weight > 0.0:
            continue
        t = np.linspace(first, last, _SAMPLES) if track.weight > 0.0 else np.array([last])
        places = values_at(f"the path of {track.name}", track.path, t, 3)
        try:
            found = reach(
                marionette, {(track.name, track.at): places}, start, bounds=task.bounds, slack=True
            )
        except StateError:  # the start is beyond bounds, or hangs unstably: the search will tell
            continue
        worst = int(np.argmax(found.distance))
        pose = found[worst]
        if not pose and pose.distance > _FAR:
            why = f": {pose.limits[0]}" if pose.limits else ""
            texts.append(
                f"{track.name} hangs no nearer than {length(pose.distance)} to its path at "
                f"{t[worst]:.3g} s{why}"
            )
    return texts
