"""Leashes in runs of a play: they must stay slack, because players are simulated without them.

A leash is a string between two players, a stretch a time in which it would be taut. q_D are dynamic
coordinates, q_K driven ones (ends and lengths of strings).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import Cast, needed_lengths, rounded_up_to_cm
from fantoccini.theatre.plays.rounds import CompileContext, Results, Round, RuleResult
from fantoccini.theatre.plays.stage_run import SAMPLE_INTERVAL, combine_runs
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


def find_stretches(cast: Cast, run: Trajectory, stride: int = SAMPLE_STRIDE) -> list[Stretch]:
    """Leashes that do not stay slack in a run of the stage, in order of time.

    Args:
        cast: cast of the play.
        run: run of the stage.
        stride: stride of the measured samples.
    """
    stretches: list[Stretch] = []
    if not cast.file.leashes:
        return stretches
    lengths = needed_lengths(cast.file, cast.marionette, run.q_D[::stride], run.q_K[::stride])
    for name, min_lengths in lengths.items():
        length = cast.file.leashes[name].length
        if np.any(min_lengths > length):
            first = float(run.t[::stride][int(np.argmax(min_lengths > length))])
            stretches.append(
                Stretch(first, name, length, rounded_up_to_cm(float(np.max(min_lengths))))
            )
    return sorted(stretches, key=lambda stretch: stretch.t)


def stretches_in(context: CompileContext, this_round: Round) -> list[Stretch]:
    """Leashes that do not stay slack in a round, in order of time."""
    cast = context.script.cast
    if not cast.file.leashes:
        return []
    return find_stretches(
        cast, combine_runs(cast, this_round.runs, SAMPLE_STRIDE * SAMPLE_INTERVAL), stride=1
    )


def refuse_stretched(context: CompileContext, results: Results, this_round: Round) -> RuleResult:
    """Refuses the first cue in which a leash would be stretched.

    The cue is that of the player whose end moves away, or else that of the other player.
    """
    cast = context.script.cast
    if not cast.file.leashes:
        return results, False
    run = combine_runs(cast, this_round.runs, SAMPLE_STRIDE * SAMPLE_INTERVAL)
    for stretch in find_stretches(cast, run, stride=1):
        for player in _by_withdrawal(cast, run, stretch):
            cue = this_round.cue_during(stretch.t, {player})
            refused = results.with_refusal(cue, f"{stretch} {this_round.in_words(stretch.t)}")
            if refused is not None:
                return refused, True
    return results, False


def _by_withdrawal(cast: Cast, run: Trajectory, stretch: Stretch) -> list[str]:
    """Players of a leash; the one whose end moved farther away before a stretch comes first."""
    leash = cast.file.leashes[stretch.leash]
    rows = np.searchsorted(run.t, [max(stretch.t - _WITHDRAWAL_TIME, run.t[0]), stretch.t])
    ends_before, ends_after = cast.marionette.string_points(run.q_D[rows], run.q_K[rows])[
        stretch.leash
    ]
    leash_vector = ends_after[1] - ends_after[0]
    holder_motion, other_motion = (ends_after - ends_before) @ leash_vector
    players = [leash.held_by, leash.to]
    return players if -holder_motion > other_motion else players[::-1]
