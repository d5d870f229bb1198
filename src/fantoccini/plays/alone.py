"""Event-driven runs of every player alone.

A run is made in parts, from one rest of the hands to the next; a part depends on the state in
which it begins and on what the hands do in it. So a change leaves the parts before it as they are,
and a play that is compiled after a change is, to the bit, the one that is compiled from nothing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Status
from fantoccini.gestures import Gesture, piecewise
from fantoccini.gestures.joining import Motion
from fantoccini.motion import Columns, State, Trajectory
from fantoccini.motion.trajectory import LEDGER
from fantoccini.plays.casting import Cast, Player
from fantoccini.plays.kept import Kept, digest
from fantoccini.plays.play_file import StageFile
from fantoccini.runtime import default_threads
from fantoccini.simulation import simulate

_REST = 1e-9
"""Rate below which hands are at rest [m/s or rad/s]."""
_SHORTEST = 0.5
"""Of a part, so that beginning anew costs little [s]."""
_SAMPLED = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
_COLUMNS = ("tension", "limit_force", "taut", "violation", "slip")
_ENERGIES = ("kinetic", "potential")


def runs_alone(
    cast: Cast, motions: Mapping[str, Gesture], starts: Mapping[str, Sequence[float]], kept: Kept
) -> dict[str, Trajectory]:
    """Player -> its event-driven run, all of them side by side.

    Args:
        cast: of the play.
        motions: player -> what its hands do.
        starts: player -> times at which its cues begin [s].
        kept: has the parts that were made before.
    """
    jobs = {
        name: partial(_run, cast.players[name], motion, starts[name], cast.file.stage, kept)
        for name, motion in motions.items()
    }
    return kept.side_by_side(jobs, default_threads())


def _run(
    player: Player, motion: Gesture, starts: Sequence[float], stage: StageFile, kept: Kept
) -> Trajectory:
    """The run of a player, part by part."""
    x, parts = player.x0, list[tuple[float, Trajectory]]()
    cuts = _cuts(motion, starts)
    for begun, end in pairwise(cuts):
        own = Gesture(motion.coordinates, *excerpt(motion, begun, end))
        key = digest(x, own, "part", player.content, stage.speed, stage.acceleration)
        run = kept.get(key, partial(_part, player, x, own, stage))
        parts.append((begun, run))
        if run.status is not Status.DONE:
            break
        x = run.state(len(run) - 1).replace(t=0.0)
    return _joined(parts)


def _part(player: Player, x: State, motion: Gesture, stage: StageFile) -> Trajectory:
    inputs = motion.inputs(x, speed=stage.speed, acceleration=stage.acceleration)
    return simulate(player.alone, x, inputs, effort=False, throw=False)


def _cuts(motion: Gesture, starts: Sequence[float]) -> list[float]:
    """Times from 0 to the end at which a part begins or ends: where the hands rest."""
    cuts = [0.0]
    for t in sorted(starts):
        if t < cuts[-1] + _SHORTEST or t > motion.duration - _SHORTEST:
            continue
        if np.max(np.abs(motion.offsets(t)[1])) < _REST:
            cuts.append(float(t))
    return [*cuts, motion.duration]


def excerpt(whole: Gesture, begun: float, end: float) -> Motion:
    """A motion from one time to another, from offsets of 0 at its beginning."""
    clock = np.union1d(whole.breaks, [begun, end])
    coef = piecewise.on(whole.breaks, whole.coef, clock)
    inside = (clock[:-1] >= begun) & (clock[:-1] < end)
    breaks, own = np.append(clock[:-1][inside], end), coef[inside]
    own[:, :, 0] -= own[0, :, 0]
    return Motion(breaks - begun, own, whole.named, np.zeros_like(whole.travel))


def _joined(parts: Sequence[tuple[float, Trajectory]]) -> Trajectory:
    """Runs one after the other as one run."""
    runs = [run for _, run in parts]
    first, last = runs[0], runs[-1]
    if len(runs) == 1:
        return first
    changes: dict[str, Any] = {
        name: np.concatenate([getattr(run, name) for run in runs]) for name in _SAMPLED
    }
    # Where two parts meet, rounding may put one before the other.
    changes["t"] = np.maximum.accumulate(np.concatenate([begun + run.t for begun, run in parts]))
    for name in _COLUMNS:
        own: Columns | None = getattr(first, name)
        if own is not None:
            changes[name] = own.like(np.concatenate([getattr(run, name).values for run in runs]))
    events = tuple(
        dataclasses.replace(event, t=begun + event.t)
        for begun, run in parts for event in run.events
    )  # fmt: skip
    return dataclasses.replace(
        first, **changes, ledger=first.ledger.like(_ledger(runs)), events=events,
        status=last.status, blamed=last.blamed, seconds=None,
    )  # fmt: skip


def _ledger(runs: Sequence[Trajectory]) -> Array:
    """Losses and work go on from one run to the next."""
    goes_on = np.array([name not in _ENERGIES for name in LEDGER])
    found, before = [], np.zeros(len(LEDGER))
    for run in runs:
        values = run.ledger.values + before * goes_on
        before = values[-1]
        found.append(values)
    return np.concatenate(found)
