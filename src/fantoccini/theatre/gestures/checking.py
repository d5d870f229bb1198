"""Checks of a score's motion; each finding names the cue that moves at its time.

They report exceeded bounds, hands that move at waits, and loops that do not close.

A cue is a line of a score with a gesture. `breaks` are the times at which the pieces of a motion
meet, and `coef` the coefficients of each piece. At a wait, a live performance waits for GO. In
names, K stands for driven coordinates: ends and lengths of strings, driven joints. A spot is the
list of keys that leads to an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.joining import Motion
from fantoccini.theatre.gestures.moves import names_and_units
from fantoccini.theatre.gestures.score import PlayedGesture, Wait
from fantoccini.theatre.script import Cue, ScoreCue, ScriptLog, Spot

_ROUNDING = 2e-3
"""Tolerance of a bound, relative to it: computed peak speeds are upper bounds of the true ones."""
_CLOSING_TOLERANCE = 1e-6
"""Tolerance for equal offsets [m or rad] and equal rates [m/s or rad/s]."""

PlayedCues = Sequence[tuple[Cue[ScoreCue], PlayedGesture, Motion]]


def report_exceeded_bounds(
    gesture: Gesture, bounds: Array, cues: PlayedCues, log: ScriptLog
) -> None:
    """Records where a speed or an acceleration exceeds its bound, once for each cue."""
    peaks, piece_middles = gesture.peaks_of_pieces, 0.5 * (gesture.breaks[1:] + gesture.breaks[:-1])
    exceeds = peaks > bounds * (1.0 + _ROUNDING)
    worst_pieces: dict[tuple[int, int, int], int] = {}
    names_units = names_and_units(gesture.coordinates)
    for piece, row, v in np.argwhere(exceeds).tolist():
        for i in moving_cues(cues, float(piece_middles[piece]), v):
            worst_piece = worst_pieces.setdefault((i, row, v), piece)
            if peaks[piece, row, v] > peaks[worst_piece, row, v]:
                worst_pieces[i, row, v] = piece
    for (i, row, v), piece in worst_pieces.items():
        verb_text, per_unit = (("moves at", "s"), ("changes by", "s^2"))[row]
        name, unit = names_units[v][0], f"{names_units[v][1]}/{per_unit}"
        log.change(
            cues[i][0].spot,
            f"{name} {verb_text} {peaks[piece, row, v]:.4g} {unit} "
            f"{log.in_words(gesture.breaks[piece])}; the bound is {bounds[row, v]:.4g}: play it "
            "smaller or slower",
        )


def moving_cues(cues: PlayedCues, t: float, v: int) -> list[int]:
    """Indices of cues that move a driven coordinate at a time; else the next one, else the last."""
    candidates = [i for i, (_, _, motion) in enumerate(cues) if motion.named[v]]
    current = [i for i in candidates if cues[i][1].start <= t < cues[i][1].end]
    later = [i for i in candidates if cues[i][1].start >= t]
    return (
        current or [min(later, key=lambda i: cues[i][1].start)]
        if later
        else current or candidates[-1:]
    )


def report_motion_at_waits(
    gesture: Gesture, waits: Sequence[Wait], cues: PlayedCues, log: ScriptLog
) -> None:
    """Records mistakes for waits at which something moves, and for loops that do not close."""
    for wait in waits:
        offsets, rates = piecewise.evaluate(gesture.breaks, gesture.coef, wait.t)
        if wait.loop_start is None:
            v = int(np.argmax(np.abs(rates)))
            if abs(rates[v]) > _CLOSING_TOLERANCE:
                text = f"{gesture.coordinates.v_K[v]} moves at {abs(rates[v]):.3g} m/s"
                time_text = log.in_words(wait.t)
                log.mistakes.add(
                    ("waits", wait.name),
                    f"{text} {time_text}, in {_cue_text(cues, wait.t, v, log)}; "
                    "needed: a time at which all lanes rest, or a loop",
                )
            continue
        loop_offsets, loop_rates = piecewise.evaluate(gesture.breaks, gesture.coef, wait.loop_start)
        for quantity, unit, differences in (
            ("value", "m", np.abs(offsets - loop_offsets)),
            ("speed", "m/s", np.abs(rates - loop_rates)),
        ):
            v = int(np.argmax(differences))
            if differences[v] > _CLOSING_TOLERANCE:
                spot: Spot = ("waits", wait.name, "loop")
                log.mistakes.add(
                    spot,
                    f"the {quantity} of {gesture.coordinates.v_K[v]} {log.in_words(wait.t)}, in "
                    f"{_cue_text(cues, wait.t, v, log)}, differs by {differences[v]:.3g} {unit} "
                    f"from that {log.in_words(wait.loop_start)}; needed: a loop that ends as it "
                    "begins",
                )
                break


def _cue_text(cues: PlayedCues, t: float, v: int, log: ScriptLog) -> str:
    """Cue that moves a driven velocity at a time, with its line, in words."""
    indices = moving_cues(cues, t, v)
    if not indices:
        return "no cue"
    cue, played, _ = cues[indices[0]]
    return f"{played.gesture} of lane {played.lane} (line {log.located.line(cue.spot)})"
