"""Checks that the hands stand still at waits of live performances, and that loops close."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.bounding import Cues, moving
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.score import Wait
from fantoccini.theatre.script import ScriptLog, Spot

_TOLERANCE = 1e-6
"""Tolerance for equal offsets and rates [m or rad, s]."""


def note_moving(whole: Gesture, waits: Sequence[Wait], cues: Cues, log: ScriptLog) -> None:
    """Records mistakes for waits at which something moves, and for loops that do not close."""
    for wait in waits:
        d, rate = piecewise.at(whole.breaks, whole.coef, wait.t)
        if wait.loop_start is None:
            v = int(np.argmax(np.abs(rate)))
            if abs(rate[v]) > _TOLERANCE:
                text = f"{whole.coordinates.v_K[v]} moves at {abs(rate[v]):.3g} m/s"
                when = log.in_words(wait.t)
                log.mistakes.add(
                    ("waits", wait.name),
                    f"{text} {when}, in {_cue(cues, wait.t, v, log)}; "
                    "needed: a time at which all lanes rest, or a loop",
                )
            continue
        first, first_rate = piecewise.at(whole.breaks, whole.coef, wait.loop_start)
        for what, unit, gap in (
            ("value", "m", np.abs(d - first)),
            ("speed", "m/s", np.abs(rate - first_rate)),
        ):
            v = int(np.argmax(gap))
            if gap[v] > _TOLERANCE:
                spot: Spot = ("waits", wait.name, "loop")
                log.mistakes.add(
                    spot,
                    f"the {what} of {whole.coordinates.v_K[v]} {log.in_words(wait.t)}, in "
                    f"{_cue(cues, wait.t, v, log)}, differs by {gap[v]:.3g} {unit} from that "
                    f"{log.in_words(wait.loop_start)}; needed: a loop that ends as it begins",
                )
                break


def _cue(cues: Cues, t: float, v: int, log: ScriptLog) -> str:
    """Cue that moves a driven velocity at a time, with its line, in words."""
    indices = moving(cues, t, v)
    if not indices:
        return "no cue"
    cue, played, _ = cues[indices[0]]
    return f"{played.gesture} of lane {played.lane} (line {log.located.line(cue.spot)})"
