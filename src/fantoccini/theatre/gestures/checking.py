"""Checks of a score's motion; each finding names the cue that moves at its time.

They report exceeded bounds, hands that move at waits, and loops that do not close.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Motion
from fantoccini.theatre.gestures.moves import names_and_units
from fantoccini.theatre.gestures.score import Played, Wait
from fantoccini.theatre.script import Cue, ScoreCue, ScriptLog, Spot

_ROUNDING = 2e-3
"""Tolerance of a bound, relative to it: computed peak speeds are upper bounds of the true ones."""
_TOLERANCE = 1e-6
"""Tolerance for equal offsets [m or rad] and equal rates [m/s or rad/s]."""

Cues = Sequence[tuple[Cue[ScoreCue], Played, Motion]]


def note_exceeded(whole: Gesture, bounds: Array, cues: Cues, log: ScriptLog) -> None:
    """Records where a speed or an acceleration exceeds its bound, once for each cue."""
    sizes, middle = whole.peaks_of_pieces, 0.5 * (whole.breaks[1:] + whole.breaks[:-1])
    over = sizes > bounds * (1.0 + _ROUNDING)
    worst: dict[tuple[int, int, int], int] = {}
    driven = names_and_units(whole.coordinates)
    for piece, row, v in np.argwhere(over).tolist():
        for i in moving(cues, float(middle[piece]), v):
            before = worst.setdefault((i, row, v), piece)
            if sizes[piece, row, v] > sizes[before, row, v]:
                worst[i, row, v] = piece
    for (i, row, v), piece in worst.items():
        what, per = (("moves at", "s"), ("changes by", "s^2"))[row]
        name, unit = driven[v][0], f"{driven[v][1]}/{per}"
        log.change(
            cues[i][0].spot,
            f"{name} {what} {sizes[piece, row, v]:.4g} {unit} "
            f"{log.in_words(whole.breaks[piece])}; the bound is {bounds[row, v]:.4g}: play it "
            "smaller or slower",
        )


def moving(cues: Cues, t: float, v: int) -> list[int]:
    """Indices of cues that move a driven coordinate at a time; else the next one, else the last."""
    own = [i for i, (_, _, motion) in enumerate(cues) if motion.named[v]]
    now = [i for i in own if cues[i][1].start <= t < cues[i][1].end]
    later = [i for i in own if cues[i][1].start >= t]
    return now or [min(later, key=lambda i: cues[i][1].start)] if later else now or own[-1:]


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
