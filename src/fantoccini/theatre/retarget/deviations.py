"""Distances of a run from its clip by groups of parts, and times in which a part is far off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.motion import Trajectory
from fantoccini.theatre.retarget.retargeting import WEIGHTS, RetargetedClip, part_positions

GROUPS = {
    "hands": ("hand_left", "hand_right"),
    "head": ("head",),
    "feet": ("foot_left", "foot_right"),
    "trunk": ("trunk", "shoulder_left", "shoulder_right"),
}
"""Parts whose errors are reported together."""
MIN_LOSS_TIME = 0.3
"""Duration of the shortest loss that counts: one swing of a hand [s]."""
MAX_LOST_SHARE = 0.25
"""Largest share of a clip in which a part may be lost."""


@dataclass(frozen=True)
class PartError:
    """Errors of a group of parts: root mean squares over time and parts [m].

    Attributes:
        name: name of the group.
        reach: error of the hanging poses nearest to the clip, the least possible one.
        run: error of the run.
        largest: largest error of the run at any time.
        excess: difference of ``run`` and ``reach``, relative to the puppet's height.
    """

    name: str
    reach: float
    run: float
    largest: float
    excess: float


def places_of(retargeted: RetargetedClip, run: Trajectory, t: Times) -> dict[str, Array]:
    """Part -> (T, 3) position in a run at times of the clip's frames, up to the run's end [m]."""
    run = run.resample(np.clip(t, run.t[0], run.t[-1]))
    return part_positions(retargeted.figure, retargeted.marionette.poses(run.q_D, run.q_K))


def errors_of(retargeted: RetargetedClip, run: Trajectory, t: Times) -> dict[str, Array]:
    """Part -> (T,) distance of a run from the clip [m]."""
    places, wanted = places_of(retargeted, run, t), retargeted.places.parts
    return {part: np.linalg.norm(places[part] - wanted[part], axis=1) for part in WEIGHTS}


def report_of(retargeted: RetargetedClip, errors: Mapping[str, Array]) -> tuple[PartError, ...]:
    """Errors of hands, head, feet and trunk, from those of the parts."""
    part_errors = []
    for name, parts in GROUPS.items():
        run = np.stack([errors[part] for part in parts])
        reach = np.stack([retargeted.errors[part] for part in parts])
        a, b = (float(np.sqrt(np.mean(np.square(e)))) for e in (reach, run))
        excess = (b - a) / retargeted.figure.height
        part_errors.append(PartError(name, a, b, float(run.max()), excess))
    return tuple(part_errors)


@dataclass(frozen=True)
class PartLoss:
    """Time in which a part is much farther from the clip than its hanging pose.

    Attributes:
        part: part of a person: ``hand_left``.
        begin, end: time in the run [s].
        distance: largest distance from the clip in that time [m].
    """

    part: str
    begin: float
    end: float
    distance: float

    def __str__(self) -> str:
        return (
            f"{self.part} is lost from t = {self.begin:.2f} to {self.end:.2f} s, up to "
            f"{1e3 * self.distance:.0f} mm from the clip"
        )


def losses_of(
    t: Times, errors: Mapping[str, Array], hanging: Mapping[str, Array], allowed: float
) -> tuple[PartLoss, ...]:
    """Losses of all parts, in order of their beginnings.

    Args:
        t: (T,) times of the frames [s].
        errors: part -> (T,) distance of the run from the clip [m].
        hanging: part -> (T,) distance of the hanging poses from the clip [m].
        allowed: largest excess of a run's distance over that of the hanging pose [m].
    """
    losses = []
    for part, distance in errors.items():
        away = np.concatenate([[False], distance - hanging[part] > allowed, [False]])
        edges = np.flatnonzero(np.diff(away.astype(int)))
        for first, after in edges.reshape(-1, 2).tolist():
            begin, end = float(t[first]), float(t[after - 1])
            if end - begin >= MIN_LOSS_TIME:
                losses.append(PartLoss(part, begin, end, float(np.max(distance[first:after]))))
    return tuple(sorted(losses, key=lambda loss: loss.begin))


def lost_share(losses: tuple[PartLoss, ...], duration: float) -> float:
    """Largest share of a duration [s] in which one part is lost."""
    lost: dict[str, float] = {}
    for loss in losses:
        lost[loss.part] = lost.get(loss.part, 0.0) + loss.end - loss.begin
    return max(lost.values(), default=0.0) / duration
