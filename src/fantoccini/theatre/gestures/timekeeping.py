"""Lateness of limbs on the beats of a score, and hanging poses under its motion.

    late = t_turn - t_mark

t_turn is the time at which the end of a string turns back, along the direction in which its gesture
turns at a mark.

A mark is a named time of a gesture, such as that at which a hand is up. A hanging pose is the pose
at rest for given driven coordinates q_K, the ends and lengths of strings. In names, D stands for
dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError, Times
from fantoccini.control.optimal import ReachedPoses, TargetKey, reach
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State, Trajectory, pieces
from fantoccini.theatre.gestures.score import PlayedGesture, Score

AXIS_OF_COORDINATE = {"x": 0, "y": 1, "length": 2}
"""Coordinate of a driven string -> axis along which it carries the hanging end."""
_MAX_WINDOW_TIME = 0.3
"""Longest time before or after a mark in which a limb may turn [s]."""
_WINDOW_SHARE = 0.45
"""Share of the time to the cue's nearest other turn in which a limb may turn."""
_HAND_TURN_TIME = 0.12
"""Time before and after a mark in which the hand turns [s]."""
_PEAK_TOLERANCE = 0.35
"""Share of the path's range by which a turn may be below the highest point."""
_MIN_TRAVEL_SHARE = 0.9
"""Least travel of a string that counts as turning too, relative to the largest travel."""
_MIN_TRAVEL = 2e-3
"""Least travel to a turn and back from it [m]."""

_MAX_HANGING_ERROR = 5e-3
"""Largest distance between the strings of a score and those of a hanging pose [m]."""
_SAMPLE_INTERVAL = 2e-3
"""Time between samples of a run [s]."""

Point = tuple[str, tuple[float, float, float]]
"""A body, and a point in its frame."""


@dataclass(frozen=True)
class LimbLateness:
    """Lateness of a limb on a mark of a cue.

    Attributes:
        cue, mark: gesture and mark on which it is late.
        string: string to which the limb is tied.
        seconds: time from the mark to the turn [s]; negative if it is early.
    """

    cue: PlayedGesture
    mark: str
    string: str
    seconds: float


def tied_points(marionette: Marionette) -> dict[str, Point]:
    """String -> point at which it is tied to a body that is not driven."""
    tree = marionette.tree
    points = {}
    for string in tree.strings:
        tied_end = string.points[0]
        if tied_end.link >= 0:
            x, y, z = (marionette.number(v) for v in tied_end.at)
            points[string.name] = (tree.links[tied_end.link].name, (x, y, z))
    return points


def point_paths(
    marionette: Marionette, run: Trajectory, points: Mapping[str, Point], t: Times
) -> Array:
    """(T, n_points, 3) positions of points at times of a run [m]."""
    samples = run.resample(np.clip(t, run.t[0], run.t[-1]))
    return point_positions(marionette, samples.q_D, samples.q_K, points)


def point_positions(
    marionette: Marionette, q_D: Array, q_K: Array, points: Mapping[str, Point]
) -> Array:
    """(T, n_points, 3) positions of points in poses [m]."""
    poses = marionette.poses(q_D, q_K)
    positions = np.empty((len(q_D), len(points), 3))
    for i, (body, point) in enumerate(points.values()):
        pose = poses[:, marionette.link_index(body)]
        positions[:, i] = pose[:, :, 3] + pose[:, :, :3] @ np.array(point)
    return positions


def hanging_poses(marionette: Marionette, q_K: Array, x0: State, t: Times) -> ReachedPoses:
    """Hanging poses of a puppet with its strings at q_K (T, n_qK).

    Raises:
        StateError: it has contact, or does not hang at a time t [s], which the message gives.
    """
    table = marionette.coordinates
    targets: dict[TargetKey, Array] = {table.q_K[q]: q_K[:, q] for q, _ in table.scalars_K}
    reached_poses = reach(marionette, targets, x0, slack=True)
    worst = int(np.argmax(reached_poses.distance))
    if reached_poses.distance[worst] > _MAX_HANGING_ERROR:
        raise StateError(
            f"the puppet does not hang where the score takes its strings at {t[worst]:.2f} s: "
            f"{reached_poses[worst].summary()}"
        )
    return reached_poses


def measure_lateness(score: Score, run: Trajectory) -> tuple[LimbLateness, ...]:
    """Lateness of limbs in a run under a score, at every mark at which one turns.

    Marks at which no hand turns back, such as those of a hand that stays up, have no lateness.

    Args:
        score: score that was played.
        run: run from the beginning of the score.
    """
    marionette = score.marionette
    points = tied_points(marionette)
    t = np.arange(0.0, run.t[-1] - run.t[0], _SAMPLE_INTERVAL)
    turning_marks = list[tuple[PlayedGesture, str, list[tuple[str, int, float]], Indices]]()
    for cue in score.cues:
        strings_of_mark = {
            mark: _turning_strings(score, cue, mark_time, points)
            for mark, mark_time in cue.marks.items()
        }
        times = [
            cue.marks[mark] for mark, turning_strings in strings_of_mark.items() if turning_strings
        ]
        for mark, turning_strings in strings_of_mark.items():
            mark_time = cue.marks[mark]
            window = min(
                [
                    _MAX_WINDOW_TIME,
                    *(
                        _WINDOW_SHARE * abs(mark_time - other_time)
                        for other_time in times
                        if other_time != mark_time
                    ),
                ]
            )
            nearby: Indices = np.flatnonzero(np.abs(t - mark_time) <= window)
            if turning_strings and len(nearby) > 2:
                turning_marks.append((cue, mark, turning_strings, nearby))
    if not turning_marks:
        return ()
    # Positions are computed only around the marks, a small part of a long run.
    sample_indices = np.unique(np.concatenate([nearby for *_, nearby in turning_marks]))
    positions = point_paths(marionette, run, points, run.t[0] + t[sample_indices])
    late_limbs = []
    for cue, mark, turning_strings, nearby in turning_marks:
        mark_time, rows = cue.marks[mark], np.searchsorted(sample_indices, nearby)
        for string, axis, sign in turning_strings:
            path = sign * positions[rows, list(points).index(string), axis]
            late_limbs.append(
                LimbLateness(cue, mark, string, _turn_delay(path, t[nearby] - mark_time))
            )
    return tuple(late_limbs)


def _turn_delay(path: Array, delays: Times) -> float:
    """Time from a mark to the nearest high point of a path, or to the highest point [s]."""
    inner = np.arange(1, len(path) - 1)
    threshold = path.max() - _PEAK_TOLERANCE * (path.max() - path.min())
    peaks = inner[
        (path[inner] >= path[inner - 1])
        & (path[inner] > path[inner + 1])
        & (path[inner] >= threshold)
    ]
    if not len(peaks):
        return float(delays[np.argmax(path)])
    k = peaks[np.argmin(np.abs(delays[peaks]))]
    a, b, c = path[k - 1 : k + 2]  # the turn is the top of the parabola through them
    return float(delays[k] + 0.5 * _SAMPLE_INTERVAL * (a - c) / (a - 2.0 * b + c))


def _turning_strings(
    score: Score, cue: PlayedGesture, mark_time: float, points: Mapping[str, Point]
) -> list[tuple[str, int, float]]:
    """Strings whose hands turn most at a mark, with the axes and signs of the turns."""
    gesture = score.lanes[cue.lane]
    times = mark_time + _HAND_TURN_TIME * np.linspace(-1.0, 1.0, 9)
    offsets = np.array([gesture.offsets(t)[0] for t in times])
    candidates: dict[str, tuple[float, int, float]] = {}
    for name, (_, v) in pieces.channel_names(gesture.coordinates).items():
        string, _, part = name.rpartition(".")
        if string not in points or part not in AXIS_OF_COORDINATE:
            continue
        for sign in (1.0, -1.0):
            offset = sign * offsets[:, v.start]
            travel = min(offset[4] - offset[0], offset[4] - offset[-1])
            if offset[4] >= offset.max() - 1e-9 and travel > max(
                _MIN_TRAVEL, candidates.get(string, (0.0,))[0]
            ):
                candidates[string] = (
                    travel,
                    AXIS_OF_COORDINATE[part],
                    -sign if part == "length" else sign,
                )
    largest = max((travel for travel, *_ in candidates.values()), default=0.0)
    return [
        (string, axis, sign)
        for string, (travel, axis, sign) in candidates.items()
        if travel > _MIN_TRAVEL_SHARE * largest
    ]
