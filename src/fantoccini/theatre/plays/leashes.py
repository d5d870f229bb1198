"""Leashes in runs of a play: they must stay slack, because players are simulated without them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import Cast, needed_lengths, rounded_up
from fantoccini.theatre.plays.rounds import Results, Round, Rule, Stage
from fantoccini.theatre.plays.stage_run import SAMPLE, together
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE

_WITHDRAWAL_TIME = 1.0
"""Time before a stretch over which the motions of a leash's ends are compared [s]."""


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
    lengths = needed_lengths(cast.file, cast.whole, run.q_D[::every], run.q_K[::every])
    for name, needed in lengths.items():
        length = cast.file.leashes[name].length
        if np.any(needed > length):
            first = float(run.t[::every][int(np.argmax(needed > length))])
            listed.append(Stretch(first, name, length, rounded_up(float(np.max(needed)))))
    return sorted(listed, key=lambda stretch: stretch.t)


def stretches_in(stage: Stage, this_round: Round) -> list[Stretch]:
    """Leashes that do not stay slack in a round, in order of time."""
    cast = stage.script.cast
    if not cast.file.leashes:
        return []
    return stretches(cast, together(cast, this_round.runs, SAMPLE_STRIDE * SAMPLE), every=1)


def refuse_stretched(stage: Stage, results: Results, this_round: Round) -> Rule:
    """Refuses the first cue in which a leash would be stretched.

    The cue is that of the player whose end moves away, or else that of the other player.
    """
    cast = stage.script.cast
    if not cast.file.leashes:
        return results, False
    run = together(cast, this_round.runs, SAMPLE_STRIDE * SAMPLE)
    for stretch in stretches(cast, run, every=1):
        for player in _by_withdrawal(cast, run, stretch):
            cue = this_round.cue_during(stretch.t, {player})
            after = results.with_refusal(cue, f"{stretch} {this_round.in_words(stretch.t)}")
            if after is not None:
                return after, True
    return results, False


def _by_withdrawal(cast: Cast, run: Trajectory, stretch: Stretch) -> list[str]:
    """Players of a leash; the one whose end moved farther away before a stretch comes first."""
    leash = cast.file.leashes[stretch.leash]
    rows = np.searchsorted(run.t, [max(stretch.t - _WITHDRAWAL_TIME, run.t[0]), stretch.t])
    before, after = cast.whole.string_points(run.q_D[rows], run.q_K[rows])[stretch.leash]
    along = after[1] - after[0]
    holder, other = (after - before) @ along
    players = [leash.held_by, leash.to]
    return players if -holder > other else players[::-1]
