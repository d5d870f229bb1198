"""Event-driven runs of every player alone."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from fantoccini.gestures import Gesture
from fantoccini.motion import Trajectory
from fantoccini.plays.casting import Cast, Player
from fantoccini.plays.kept import Kept, digest
from fantoccini.plays.play_file import StageFile
from fantoccini.runtime import default_threads
from fantoccini.simulation import simulate


def runs_alone(cast: Cast, motions: Mapping[str, Gesture], kept: Kept) -> dict[str, Trajectory]:
    """Player -> its event-driven run, all of them side by side.

    Args:
        cast: of the play.
        motions: player -> what its hands do.
        kept: has those that were made before.
    """
    keys = {
        name: digest(cast.players[name].x0, motion, cast.file.cast[name].puppet, "run")
        for name, motion in motions.items()
    }
    jobs = {
        keys[name]: partial(_run, cast.players[name], motion, cast.file.stage)
        for name, motion in motions.items()
    }
    found = kept.all(jobs, default_threads())
    return {name: found[key] for name, key in keys.items()}


def _run(player: Player, motion: Gesture, stage: StageFile) -> Trajectory:
    inputs = motion.inputs(player.x0, speed=stage.speed, acceleration=stage.acceleration)
    return simulate(player.alone, player.x0, inputs, effort=False, throw=False)
