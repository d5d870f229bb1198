"""Leashes in runs of a play: they must stay slack, because players are simulated without them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import Cast
from fantoccini.theatre.plays.rounds import Results, Round, Rule, Stage
from fantoccini.theatre.plays.stage_run import SAMPLE, together
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE

_SPARE = 0.02
"""Least difference of a leash's length and the distance of its ends [m]: the distance of ends that
part at 2 m/s grows by this much between samples."""


@dataclass(frozen=True)
class Stretch:
    """A leash that is too short.

    Attributes:
        t: time at which it is first too short [s].
        leash: its name.
        length: its length [m].
        needed: length that suffices for the whole run [m].
    """

    t: float
    leash: str
    length: float
    needed: float

    def __str__(self) -> str:
        return (
            f"{self.leash}, {self.length:g} m long, would be stretched; it needs to be "
            f"{self.needed:.2f} m long"
        )


def stretches(cast: Cast, run: Trajectory, every: int = SAMPLE_STRIDE) -> list[Stretch]:
    """Leashes that do not stay slack in a run of the stage, in order of time.

    Args:
        cast: cast of the play.
        run: run of the stage.
        every: stride of the measured samples.
    """
    listed: list[Stretch] = []
    if not cast.file.leashes:
        return listed
    points = cast.whole.string_points(run.q_D[::every], run.q_K[::every])
    for name, leash in cast.file.leashes.items():
        distance = np.linalg.norm(points[name][:, 1] - points[name][:, 0], axis=1) + _SPARE
        if np.any(distance > leash.length):
            first = float(run.t[::every][int(np.argmax(distance > leash.length))])
            # Rounded up to whole centimetres.
            needed = 0.01 * float(np.ceil(100.0 * np.max(distance)))
            listed.append(Stretch(first, name, leash.length, needed))
    return sorted(listed, key=lambda stretch: stretch.t)


def refuse_stretched(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the first cue in which a leash would be stretched."""
    cast = stage.script.cast
    if not cast.file.leashes:
        return results, False
    run = together(cast, this_round.runs, SAMPLE_STRIDE * SAMPLE)
    for stretch in stretches(cast, run, every=1):
        leash = cast.file.leashes[stretch.leash]
        cue = this_round.cue_during(stretch.t, {leash.held_by, leash.to})
        after = results.with_refusal(cue, f"{stretch} {this_round.in_words(stretch.t)}")
        if after is not None:
            return after, True
    return results, False
