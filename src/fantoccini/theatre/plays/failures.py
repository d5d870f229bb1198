"""Checks of runs of a play: whether props and sitting players are at the places of their cues.

A handle is the bar by which a prop hangs on a forearm, and a footing a place with a heading. In
names, D stands for dynamic coordinates, which move by the equations of motion, and K for driven
ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.cast import Cast, Footing, Meeting, Physique, obstacle_top
from fantoccini.theatre.plays.runs import Run, Runs
from fantoccini.theatre.script import MeetingKind, Spot

_CHECK_INTERVAL = 0.05
"""Time between checks [s]."""
_MAX_AXIS_DISTANCE, _ELBOW_DISTANCE_RANGE = 0.06, (0.0, 0.14)
"""Largest distance of a handle from the axis of its forearm, for any arm [m]; least and largest
distance from the elbow along that axis, for an arm of 19 cm [m]."""
_MISPLACED_TIME = 0.5
"""Time after a cue in which a prop counts as misplaced, not as dropped [s]."""
_MIN_SEAT_SHARE = 0.15
"""Least share of a sitter's weight on the seat."""
_MIN_COSINE, _MAX_HEIGHT_ERROR = np.cos(np.radians(10.0)), 0.008
"""Bounds for a standing prop: cosine of its axis to the vertical, error of its height [m]."""

_MAX_REST_SPEED = 0.02
"""Largest speed of a standing prop [m/s]."""


@dataclass(frozen=True)
class Failure:
    """Failure of a cue with a prop or a seat.

    Attributes:
        t: time of the failure [s].
        players: players that are involved.
        text: description.
        cue: cue that fails; None if it is unknown.
    """

    t: float
    players: tuple[str, ...]
    text: str
    cue: Spot | None


def find_failures(cast: Cast, meetings: Sequence[Meeting], runs: Runs) -> list[Failure]:
    """Failures of runs, in order of time."""
    failures: list[Failure] = []
    for meeting in meetings:
        for run, begin, end in _runs(meeting, runs):
            t = np.append(np.arange(begin, end, _CHECK_INTERVAL), end) - run.begin
            check = _CHECKS.get(meeting.kind)
            failure = check(cast, meeting, run, t) if check is not None else None
            if failure is not None:
                failures.append(failure)
                break
    return sorted(failures, key=lambda failure: failure.t)


def handle_position(
    cast: Cast, runs: Runs, meeting: Meeting, t: float
) -> tuple[float, float] | None:
    """Distance of a handle from the elbow and its height [m], at a time [s]; None if unknown."""
    (prop,), who = meeting.props, meeting.players[0]
    run, handle = runs.with_prop(prop, t), cast.props[prop].handle_height
    if run is None or handle is None:
        return None
    forearm, physique, side = _arm(cast, meeting, who)
    prop_pose, arm_pose = (_poses(run, x, np.array([t - run.begin]))[0] for x in (prop, forearm))
    bar_position = prop_pose[:, 3] + handle * prop_pose[:, 2]
    direction = arm_pose[:, :3] @ physique.forearm_direction(side)
    return float(direction @ (bar_position - arm_pose[:, 3])), float(bar_position[2])


def standing_place(cast: Cast, runs: Runs, prop: str, t: float) -> Footing | None:
    """Footing of a prop that was put down before a time [s]; None if it was not."""
    earlier_runs = [
        run for run in runs.companies if prop in run.scene.props and run.end <= t + 1e-9
    ]
    if not earlier_runs:
        return None
    run = earlier_runs[-1]
    pose = _poses(run, prop, run.trajectory.t[-1:])[0]
    return Footing(float(pose[0, 3]), float(pose[1, 3]), float(np.arctan2(pose[1, 0], pose[0, 0])))


def _runs(meeting: Meeting, runs: Runs) -> Iterator[tuple[Run, float, float]]:
    """Runs that contain a meeting, and its times there [s]."""
    for run in runs.companies:
        company = run.scene.company
        begin, end = max(meeting.begin, run.begin), min(meeting.end, run.end)
        contains = {*meeting.players} <= {*company.players} and meeting.pairs <= company.pairs
        if contains and begin < end:
            yield run, begin, end


def _hangs(cast: Cast, meeting: Meeting, run: Run, t: Times) -> Failure | None:
    """Failure of a prop to hang on a forearm at times of a run."""
    (prop,), (who,) = meeting.props, meeting.players
    forearm, physique, side = _arm(cast, meeting, who)
    handle = cast.props[prop].handle_height
    assert handle is not None
    prop_poses, arm_poses = (_poses(run, name, t) for name in (prop, forearm))
    offsets = prop_poses[:, :, 3] + handle * prop_poses[:, :, 2] - arm_poses[:, :, 3]
    local_offsets, direction = (
        np.einsum("tij,ti->tj", arm_poses[:, :, :3], offsets),
        physique.forearm_direction(side),
    )
    elbow_distance = local_offsets @ direction
    axis_distance = np.linalg.norm(local_offsets - elbow_distance[:, None] * direction, axis=1)
    nearest, farthest = (physique.arm_ratio(side) * bound for bound in _ELBOW_DISTANCE_RANGE)
    is_off = axis_distance > _MAX_AXIS_DISTANCE
    is_off |= (elbow_distance < nearest) | (elbow_distance > farthest)
    if not np.any(is_off):
        return None
    t_off = run.begin + float(t[int(np.argmax(is_off))])
    is_misplaced = meeting.cue is not None and t_off <= meeting.begin + _MISPLACED_TIME
    text = f"{prop} would not hang on {who}'s arm" if is_misplaced else f"{who} would drop {prop}"
    return Failure(t_off, meeting.players, text, meeting.cue if is_misplaced else None)


def _stands(cast: Cast, meeting: Meeting, run: Run, t: Times) -> Failure | None:
    """Failure of a prop to stand on an obstacle at the last time."""
    (prop,) = meeting.props
    obstacles = {obstacle.name for obstacle in cast.file.stage.obstacles}
    (on,) = {name for pair in meeting.pairs for name in pair} & obstacles
    pose, top = _poses(run, prop, t[-1:])[0], obstacle_top(cast.file, on)
    assert top is not None
    index = run.trajectory.coordinates.v_D.index(f"{run.scene.props[prop]}.x")
    velocity = run.trajectory.resample(t[-1:]).v_D[0, index : index + 3]
    is_at_rest = float(np.linalg.norm(velocity)) <= _MAX_REST_SPEED
    if is_at_rest and pose[2, 2] >= _MIN_COSINE and abs(pose[2, 3] - top) <= _MAX_HEIGHT_ERROR:
        return None
    text = f"{prop} would not stand on {on}"
    return Failure(run.begin + float(t[-1]), meeting.players, text, meeting.cue)


def _sits(cast: Cast, meeting: Meeting, run: Run, _: Times) -> Failure | None:
    """Failure of a player to sit, by its weight on the seat."""
    (who,) = meeting.players
    begin, end = (max(x - run.begin, 0.0) for x in meeting.bearing_interval)
    end = min(end, float(run.trajectory.t[-1]))
    if begin >= end or run.trajectory.contact is None:
        return None
    body_names = {run.scene.local(body) for body in cast.players[who].bodies.seated}
    seat_names = {run.scene.local(name) for pair in meeting.pairs for name in pair} - body_names
    points = run.trajectory.contact
    is_seat_pair = [
        bool({a, b} & body_names) and bool({a, b} & seat_names) for a, b in points.names
    ]
    times = run.trajectory.t
    is_counted = (times >= begin) & (times <= end)
    is_seat_point = np.array(is_seat_pair, dtype=bool)[points.pair] & is_counted[points.sample]
    n = max(int(np.sum(is_counted)), 1)
    seat_force = float(np.sum(np.abs(points.force[is_seat_point, 2]))) / n
    weight = cast.players[who].marionette.weight
    if seat_force >= _MIN_SEAT_SHARE * weight:
        return None
    text = f"{who} would not sit: the seat bears {seat_force / weight:.0%} of its weight"
    return Failure(run.begin + begin, meeting.players, text, meeting.cue)


_CHECKS: dict[MeetingKind, Callable[[Cast, Meeting, Run, Times], Failure | None]] = {
    "hangs": _hangs,
    "put": _stands,
    "sits": _sits,
}
"""Kind of meeting -> check of its run."""


def _arm(cast: Cast, meeting: Meeting, who: str) -> tuple[str, Physique, str]:
    """Forearm of a player on which something hangs, the player's physique, and side of the arm."""
    names, player = {name for pair in meeting.pairs for name in pair}, cast.players[who]
    side, forearm = next(arm for arm in player.bodies.forearms.items() if arm[1] in names)
    return forearm, Physique.of(player.marionette), side


def _poses(run: Run, name: str, t: Times) -> Array:
    """(T, 3, 4) poses of a body or prop of the stage at times of a run."""
    samples = run.trajectory.resample(np.clip(t, 0.0, run.trajectory.t[-1]))
    marionette = run.scene.marionette
    poses: Array = marionette.poses(samples.q_D, samples.q_K)
    return poses[:, marionette.link_index(run.scene.local(name))]
