"""Deviations of a run from its clip: distances, bending of limbs, times in which a part is lost.

A clip is a captured motion. A part is lost while it is much farther from the clip than in the
hanging pose, the pose at rest for the same position of the hands. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.motion import Trajectory
from fantoccini.theatre.retarget.mapping import SIDES
from fantoccini.theatre.retarget.retargeting import PART_WEIGHTS, RetargetedClip, part_positions

PART_GROUPS = {
    "hands": ("hand_left", "hand_right"),
    "head": ("head",),
    "feet": ("foot_left", "foot_right"),
    "trunk": ("trunk", "shoulder_left", "shoulder_right"),
}
"""Parts whose errors are reported together."""
_BENDS = {"elbows": ("shoulder", "elbow", "hand"), "knees": ("hip", "knee", "foot")}
"""Joint of both limbs -> ends of its limb, with the joint between them."""
MIN_LOSS_TIME = 0.3
"""Duration of the shortest loss that counts: one swing of a hand [s]."""
MAX_LOST_SHARE = 0.25
"""Largest share of a clip in which a part may be lost."""


@dataclass(frozen=True)
class PartError:
    """Errors of a group of parts: root mean squares over time and parts [m].

    Attributes:
        name: name of the group.
        pose_error: error of the hanging poses nearest to the clip, the least possible one.
        run_error: error of the run.
        max_run_error: largest error of the run at any time.
        excess: difference of ``run_error`` and ``pose_error``, relative to the puppet's height.
    """

    name: str
    pose_error: float
    run_error: float
    max_run_error: float
    excess: float


def run_positions(retargeted: RetargetedClip, run: Trajectory, t: Times) -> dict[str, Array]:
    """Part -> (T, 3) position in a run at times of the clip's frames, up to the run's end [m]."""
    run = run.resample(np.clip(t, run.t[0], run.t[-1]))
    return part_positions(retargeted.figure, retargeted.marionette.poses(run.q_D, run.q_K))


def part_errors(retargeted: RetargetedClip, run: Trajectory, t: Times) -> dict[str, Array]:
    """Part -> (T,) distance of a run from the clip [m]."""
    positions, targets = run_positions(retargeted, run, t), retargeted.targets.parts
    return {part: np.linalg.norm(positions[part] - targets[part], axis=1) for part in PART_WEIGHTS}


def group_errors(retargeted: RetargetedClip, errors: Mapping[str, Array]) -> tuple[PartError, ...]:
    """Errors of hands, head, feet and trunk, from those of the parts."""
    groups = []
    for name, parts in PART_GROUPS.items():
        run_errors = np.stack([errors[part] for part in parts])
        pose_errors = np.stack([retargeted.errors[part] for part in parts])
        pose_error, run_error = (
            float(np.sqrt(np.mean(np.square(errors_of_parts))))
            for errors_of_parts in (pose_errors, run_errors)
        )
        excess = (run_error - pose_error) / retargeted.figure.height
        groups.append(PartError(name, pose_error, run_error, float(run_errors.max()), excess))
    return tuple(groups)


@dataclass(frozen=True)
class LimbBend:
    """Bending of both arms or both legs, at elbows or knees [rad].

    Attributes:
        name: name of the joints.
        clip, run: larger range of the two joints' angles, in the clip and in the run.
        error: difference of the angles, root mean square.
    """

    name: str
    clip: float
    run: float
    error: float


def limb_bends(
    targets: Mapping[str, Array], positions: Mapping[str, Array]
) -> tuple[LimbBend, ...]:
    """Bending of elbows and knees.

    Args:
        targets: part -> (T, 3) position in the clip [m].
        positions: part -> (T, 3) position in the run [m].
    """
    bends = []
    for name, parts in _BENDS.items():
        clip, run = (
            np.stack([_bend(paths, parts, side) for side in SIDES])
            for paths in (targets, positions)
        )
        clip_range, run_range = (float(np.max(np.ptp(angles, axis=1))) for angles in (clip, run))
        error = float(np.sqrt(np.mean((run - clip) ** 2)))
        bends.append(LimbBend(name, clip_range, run_range, error))
    return tuple(bends)


def _bend(positions: Mapping[str, Array], parts: tuple[str, ...], side: str) -> Array:
    """(T,) angle between the two halves of a limb [rad]; 0 if it is straight."""
    corners = np.stack([positions[f"{part}_{side}"] for part in parts])
    upper, lower = np.diff(corners, axis=0)
    sine = np.linalg.norm(np.cross(upper, lower), axis=1)
    return np.arctan2(sine, np.sum(upper * lower, axis=1))


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


def find_losses(
    t: Times, errors: Mapping[str, Array], pose_errors: Mapping[str, Array], max_excess: float
) -> tuple[PartLoss, ...]:
    """Losses of all parts, in order of their beginnings.

    Args:
        t: (T,) times of the frames [s].
        errors: part -> (T,) distance of the run from the clip [m].
        pose_errors: part -> (T,) distance of the hanging poses from the clip [m].
        max_excess: largest excess of a run's distance over that of the hanging pose [m].
    """
    losses = []
    for part, distance in errors.items():
        is_lost = np.concatenate([[False], distance - pose_errors[part] > max_excess, [False]])
        edges = np.flatnonzero(np.diff(is_lost.astype(int)))
        for start, stop in edges.reshape(-1, 2).tolist():
            begin, end = float(t[start]), float(t[stop - 1])
            if end - begin >= MIN_LOSS_TIME:
                losses.append(PartLoss(part, begin, end, float(np.max(distance[start:stop]))))
    return tuple(sorted(losses, key=lambda loss: loss.begin))


def lost_share(losses: tuple[PartLoss, ...], duration: float) -> float:
    """Largest share of a duration [s] in which one part is lost."""
    lost_times: dict[str, float] = {}
    for loss in losses:
        lost_times[loss.part] = lost_times.get(loss.part, 0.0) + loss.end - loss.begin
    return max(lost_times.values(), default=0.0) / duration
