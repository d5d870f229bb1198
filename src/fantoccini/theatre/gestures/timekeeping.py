"""Lateness of limbs on the beats of a score, and hanging poses under its motion.

    late = t_turn - t_mark

t_turn is the time at which the end of a string turns back, along the direction in which its gesture
turns at a mark.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError, Times
from fantoccini.control.optimal import ReachedPoses, TargetKey, reach
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State, Trajectory, pieces
from fantoccini.theatre.gestures.score import Played, Score

AXES = {"x": 0, "y": 1, "length": 2}
"""Coordinate of a driven string -> axis along which it carries the hanging end."""
_MAX_WINDOW = 0.3
"""Longest time before or after a mark in which a limb may turn [s]."""
_WINDOW_SHARE = 0.45
"""Share of the time to the cue's nearest other turn in which a limb may turn."""
_TURN_TIME = 0.12
"""Time before and after a mark in which the hand turns [s]."""
_TOP_TOLERANCE = 0.35
"""Share of the path's range by which a turn may be below the highest point."""
_TURN_SHARE = 0.9
"""Least travel of a string that counts as turning too, relative to the largest travel."""
_MIN_TRAVEL = 2e-3
"""Least travel to a turn and back from it [m]."""

_MAX_HANGING_ERROR = 5e-3
"""Largest distance between the strings of a score and those of a hanging pose [m]."""
_STEP = 2e-3
"""Time between samples of a run [s]."""

Point = tuple[str, tuple[float, float, float]]
"""A body, and a point in its frame."""


@dataclass(frozen=True)
class Late:
    """Lateness of a limb on a mark of a cue.

    Attributes:
        cue, mark: gesture and mark on which it is late.
        string: string to which the limb is tied.
        seconds: time from the mark to the turn [s]; negative if it is early.
    """

    cue: Played
    mark: str
    string: str
    seconds: float


def ties(marionette: Marionette) -> dict[str, Point]:
    """String -> point at which it is tied to a body that is not driven."""
    tree = marionette.tree
    points = {}
    for string in tree.strings:
        end = string.points[0]
        if end.link >= 0:
            x, y, z = (marionette.number(v) for v in end.at)
            points[string.name] = (tree.links[end.link].name, (x, y, z))
    return points


def point_paths(
    marionette: Marionette, run: Trajectory, points: Mapping[str, Point], t: Times
) -> Array:
    """(T, n_points, 3) positions of points at times of a run [m]."""
    at = run.resample(np.clip(t, run.t[0], run.t[-1]))
    return point_positions(marionette, at.q_D, at.q_K, points)


def point_positions(
    marionette: Marionette, q_D: Array, q_K: Array, points: Mapping[str, Point]
) -> Array:
    """(T, n_points, 3) positions of points in poses [m]."""
    poses = marionette.poses(q_D, q_K)
    positions = np.empty((len(q_D), len(points), 3))
    for i, (body, at) in enumerate(points.values()):
        pose = poses[:, marionette.link_index(body)]
        positions[:, i] = pose[:, :, 3] + pose[:, :, :3] @ np.array(at)
    return positions


def hanging_poses(marionette: Marionette, q_K: Array, x0: State, t: Times) -> ReachedPoses:
    """Hanging poses of a puppet with its strings at q_K (T, n_qK).

    Raises:
        StateError: it has contact, or does not hang at a time t [s], which the message gives.
    """
    table = marionette.coordinates
    wanted: dict[TargetKey, Array] = {table.q_K[q]: q_K[:, q] for q, _ in table.scalars_K}
    reached_poses = reach(marionette, wanted, x0, slack=True)
    worst = int(np.argmax(reached_poses.distance))
    if reached_poses.distance[worst] > _MAX_HANGING_ERROR:
        raise StateError(
            f"the puppet does not hang where the score takes its strings at {t[worst]:.2f} s: "
            f"{reached_poses[worst].summary()}"
        )
    return reached_poses


def lateness(score: Score, run: Trajectory) -> tuple[Late, ...]:
    """Lateness of limbs in a run under a score, at every mark at which one turns.

    Marks at which no hand turns back, such as those of a hand that stays up, have no lateness.

    Args:
        score: score that was played.
        run: run from the beginning of the score.
    """
    marionette = score.marionette
    tied = ties(marionette)
    t = np.arange(0.0, run.t[-1] - run.t[0], _STEP)
    seen = list[tuple[Played, str, list[tuple[str, int, float]], Indices]]()
    for cue in score.cues:
        turns = {mark: _turning_strings(score, cue, at, tied) for mark, at in cue.marks.items()}
        times = [cue.marks[mark] for mark, own in turns.items() if own]
        for mark, own in turns.items():
            at = cue.marks[mark]
            window = min(
                [_MAX_WINDOW, *(_WINDOW_SHARE * abs(at - time) for time in times if time != at)]
            )
            near: Indices = np.flatnonzero(np.abs(t - at) <= window)
            if own and len(near) > 2:
                seen.append((cue, mark, own, near))
    if not seen:
        return ()
    # Positions are computed only around the marks, a small part of a long run.
    around = np.unique(np.concatenate([near for *_, near in seen]))
    moved = point_paths(marionette, run, tied, run.t[0] + t[around])
    late_limbs = []
    for cue, mark, own, near in seen:
        at, there = cue.marks[mark], np.searchsorted(around, near)
        for string, axis, sign in own:
            path = sign * moved[there, list(tied).index(string), axis]
            late_limbs.append(Late(cue, mark, string, _turn_time(path, t[near] - at)))
    return tuple(late_limbs)


def _turn_time(path: Array, away: Times) -> float:
    """Time from a mark to the nearest high point of a path, or to the highest point [s]."""
    inner = np.arange(1, len(path) - 1)
    high = path.max() - _TOP_TOLERANCE * (path.max() - path.min())
    tops = inner[
        (path[inner] >= path[inner - 1]) & (path[inner] > path[inner + 1]) & (path[inner] >= high)
    ]
    if not len(tops):
        return float(away[np.argmax(path)])
    k = tops[np.argmin(np.abs(away[tops]))]
    a, b, c = path[k - 1 : k + 2]  # the turn is the top of the parabola through them
    return float(away[k] + 0.5 * _STEP * (a - c) / (a - 2.0 * b + c))


def _turning_strings(
    score: Score, cue: Played, at: float, tied: Mapping[str, Point]
) -> list[tuple[str, int, float]]:
    """Strings whose hands turn most at a mark, with the axes and signs of the turns."""
    gesture = score.lanes[cue.lane]
    times = at + _TURN_TIME * np.linspace(-1.0, 1.0, 9)
    d = np.array([gesture.offsets(t)[0] for t in times])
    turning: dict[str, tuple[float, int, float]] = {}
    for name, (_, v) in pieces.channel_names(gesture.coordinates).items():
        string, _, part = name.rpartition(".")
        if string not in tied or part not in AXES:
            continue
        for sign in (1.0, -1.0):
            offset = sign * d[:, v.start]
            travel = min(offset[4] - offset[0], offset[4] - offset[-1])
            if offset[4] >= offset.max() - 1e-9 and travel > max(
                _MIN_TRAVEL, turning.get(string, (0.0,))[0]
            ):
                turning[string] = travel, AXES[part], -sign if part == "length" else sign
    largest = max((travel for travel, *_ in turning.values()), default=0.0)
    return [
        (string, axis, sign)
        for string, (travel, axis, sign) in turning.items()
        if travel > _TURN_SHARE * largest
    ]
