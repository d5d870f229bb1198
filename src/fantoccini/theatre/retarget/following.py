"""Following: motions of the hands with which a puppet moves as a clip does.

    min over acc_K of  sum_i w_i |x_i(t) - x_i,hang(t)|^2 + w_K |q_K - q_K,hang|^2 + smoothness

over a receding horizon, within bounds of speed and acceleration (:class:`fantoccini.MPC`):
x_i,hang are the positions of the parts in the hanging poses nearest to the clip. The hands lead by
the lag of the limbs, and damp their swing.

q_K are the driven coordinates, which the hands move, and acc_K their accelerations; n_vK is the
number of driven velocities. A hanging pose is the pose at rest for given q_K. In names, D stands
for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d

from fantoccini.base import (
    ARRIVED,
    Array,
    OnProgress,
    Outcome,
    Progress,
    StateError,
    Times,
    check_positive,
)
from fantoccini.control.optimal import MPC
from fantoccini.control.tasks import Bounds, Smooth, Task, Track
from fantoccini.dynamics.clearance import Crossing, StringDistances
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory
from fantoccini.theatre.capture import Capture
from fantoccini.theatre.retarget.deviations import (
    MAX_LOST_SHARE,
    LimbBend,
    PartError,
    PartLoss,
    find_losses,
    group_errors,
    limb_bends,
    lost_share,
    part_errors,
    run_positions,
)
from fantoccini.theatre.retarget.figure import Figure
from fantoccini.theatre.retarget.mapping import SIDES, MappingFile
from fantoccini.theatre.retarget.retargeting import (
    LEAN_FACTORS,
    PART_WEIGHTS,
    PlacedClip,
    RetargetedClip,
    place_clip,
    retarget_clip,
)

MAX_SPEED, MAX_ACCELERATION = 2.0, 30.0
"""Default bounds of the driven coordinates [m/s, m/s^2]."""
INPUT_INTERVAL = 0.05
"""Interval over which the hands' accelerations are constant [s]."""
_HORIZON = 14
"""Number of intervals in the horizon."""
_TIME_STEP = 0.0125
"""Time step of predictions [s]."""
_PART_WEIGHT, _HAND_WEIGHT = 1e4, 30.0
"""Factor of the parts' weights w_i, and weight w_K of the hands [1/m^2]."""
_SMOOTHNESS_COST = Smooth(acceleration=1e-3, jerk=1e-6)
_SETTLING_INTERVALS = 8
"""Number of intervals after the clip's end in which the puppet comes to rest."""
_SPEED_CHANGE_TIME = 0.5
"""Duration in which the clip accelerates to its speed, and in which it stops [s]."""
MAX_ERROR = 0.15
"""Largest error of a group of parts in a run that follows, relative to the puppet's height."""
REDUCED_BOUND_FACTORS = 0.5, 0.25
"""Factors of the bounds of speed and acceleration to try if the run leaves the clip."""
_SAMPLE_STRIDE = 4
"""Stride of the samples of a run that are searched for crossings."""
_SMOOTHING_TIME = 0.035
"""Standard deviation of the smoothing of the hanging poses [s]."""


_GUIDE_LINES = (
    ("trunk", "neck", "head"),
    *(("neck", f"shoulder_{side}", f"elbow_{side}", f"hand_{side}") for side in SIDES),
    *(("trunk", f"hip_{side}", f"knee_{side}", f"foot_{side}") for side in SIDES),
)
"""Parts of a person that are joined in drawings."""


class FollowStatus(Outcome):
    """Outcome of following a clip."""

    FOLLOWS = "the run reached the clip's end, within 15 % of the puppet's height of the clip"
    DIVERGED = "the run, or a part of the puppet, is 15 % of the height or more off the clip"
    STOPPED = "the event-driven run stopped before the clip's end"


@dataclass(frozen=True, eq=False)
class FollowResult:
    """Motion of a puppet that follows a clip. True if its run arrived and is near the clip.

    Attributes:
        retargeted: clip, and the hanging poses nearest to it.
        status: outcome.
        run: event-driven run.
        acc_K: (N, n_vK) accelerations of the driven coordinates in each interval.
        interval: duration of an interval [s].
        t: (T,) times in the run of the clip's frames, with a slow beginning and end [s].
        computing_time: computing time [s].
        bound_factor: factor of the bounds of speed and acceleration; below 1 if the run left the
            clip with the full bounds.
    """

    retargeted: RetargetedClip
    status: FollowStatus
    run: Trajectory
    acc_K: Array
    interval: float
    t: Times
    computing_time: float
    bound_factor: float = 1.0

    def __bool__(self) -> bool:
        return self.status is FollowStatus.FOLLOWS

    @property
    def arrived(self) -> bool:
        """Whether the run reached the clip's end."""
        return self.status is not FollowStatus.STOPPED

    @property
    def error(self) -> float:
        """Largest error of a group of parts, root mean square, relative to the puppet's height."""
        return max(part.run_error for part in self.report) / self.retargeted.figure.height

    @property
    def pose_error(self) -> float:
        """The same error for the hanging poses nearest to the clip."""
        return max(part.pose_error for part in self.report) / self.retargeted.figure.height

    @cached_property
    def losses(self) -> tuple[PartLoss, ...]:
        """Times in which a part is 15 % of the height farther off than its hanging pose."""
        max_excess = MAX_ERROR * self.retargeted.figure.height
        return find_losses(self.t, self.errors, self.retargeted.errors, max_excess)

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Crossings of the puppet's strings in the run."""
        return string_crossings(self.retargeted.marionette, self.run)

    def __repr__(self) -> str:
        clip = self.retargeted.clip
        return (
            f"<FollowResult {clip.name!r}: {self.status.name}, {100 * self.error:.1f} % of the "
            f"height from the clip, {100 * self.pose_error:.1f} % in hanging poses>"
        )

    @property
    def inputs(self) -> Input:
        """Motion of the hands from ``retargeted.start``."""
        inputs = driven_inputs(self.retargeted.marionette, self.run.state(0), self.acc_K)
        return inputs.with_name(self.retargeted.clip.name)

    def guides(self, times: Times) -> list[Array]:
        """(len(times), n, 3) lines through the parts of the clip, at times of the run [m].

        The lines are trunk and head, both arms and both legs, for ``view.film(...,
        guides=followed.guides)``.
        """
        parts, lines = self.retargeted.targets.parts, []
        for line in _GUIDE_LINES:
            corners = np.stack([parts[part] for part in line], axis=1).reshape(len(self.t), -1)
            line_positions = np.stack(
                [np.interp(times, self.t, column) for column in corners.T], axis=1
            )
            lines.append(line_positions.reshape(len(times), len(line), 3))
        return lines

    @cached_property
    def positions(self) -> dict[str, Array]:
        """Part -> (T, 3) position in the run at the clip's frames, up to the run's end [m]."""
        return run_positions(self.retargeted, self.run, self.t)

    @cached_property
    def errors(self) -> dict[str, Array]:
        """Part -> (T,) distance of the run from the clip [m]."""
        return part_errors(self.retargeted, self.run, self.t)

    @cached_property
    def report(self) -> tuple[PartError, ...]:
        """Errors of hands, head, feet and trunk."""
        return group_errors(self.retargeted, self.errors)

    @cached_property
    def bends(self) -> tuple[LimbBend, ...]:
        """Bending of elbows and knees in the clip and in the run."""
        return limb_bends(self.retargeted.targets.parts, self.positions)


def follow_clip(
    marionette: Marionette,
    clip: Capture | PlacedClip | RetargetedClip | str | os.PathLike[str],
    mapping: MappingFile | str | os.PathLike[str] | None = None,
    *,
    start: State | None = None,
    travel: float = 1.0,
    up: str | None = None,
    of: str = "",
    speed: float | Mapping[str, float] = MAX_SPEED,
    acceleration: float | Mapping[str, float] = MAX_ACCELERATION,
    progress: OnProgress | None = None,
) -> FollowResult:
    """Motion of the hands with which a puppet follows captured motion.

    Strings are vertical; if they cross, the clip is followed again with strings that lean outwards,
    and the motion with the fewest crossings is returned. If the run leaves the clip, smaller shares
    of the bounds are tried.

    Args:
        marionette: puppet without contact.
        clip: a BVH file, the result of :func:`load_bvh`, or that of :func:`place_clip` or
            :func:`retarget_clip`; the poses of the latter are followed unchanged.
        mapping: see :func:`retarget_clip`, as for ``start``, ``travel``, ``up`` and ``of``.
        start: state at rest from which the search for the first pose begins.
        travel: share of the motion over the floor that is followed.
        speed, acceleration: bounds of the driven coordinates, for all or by name; others have the
            default bounds [m/s or rad/s, m/s^2 or rad/s^2].
        progress: called with the completed share.

    Raises:
        FileError: the files have mistakes, or joints are missing.
        StateError: the puppet does not have the bodies of a person, or has contact.
    """
    start_time = time.perf_counter()
    has_options = mapping is not None or start is not None or travel != 1.0 or bool(up or of)
    if has_options and isinstance(clip, PlacedClip | RetargetedClip):
        raise StateError(
            "follow_clip: a clip that was placed or retargeted has its mapping, start, travel, up "
            "and of already"
        )
    if isinstance(clip, RetargetedClip):
        best = _follow_within(clip, speed, acceleration, progress)
    else:
        if not isinstance(clip, PlacedClip):
            clip = place_clip(marionette, clip, mapping, start, travel, up, of=of)
        best = _follow_within(retarget_clip(marionette, clip), speed, acceleration, progress)
        for lean in LEAN_FACTORS:
            if not best or not best.crossings:
                break
            retargeted = retarget_clip(marionette, replace(clip, lean=lean))
            followed = _follow_within(retargeted, speed, acceleration, progress)
            if followed and len(followed.crossings) < len(best.crossings):
                best = followed
    return replace(best, computing_time=time.perf_counter() - start_time)


def _follow_within(
    clip: RetargetedClip,
    speed: float | Mapping[str, float],
    acceleration: float | Mapping[str, float],
    progress: OnProgress | None,
) -> FollowResult:
    """The clip followed within the full bounds, or within reduced bounds if the run leaves it."""
    names, best = clip.marionette.coordinates.v_K, None
    for bound_factor in (1.0, *REDUCED_BOUND_FACTORS):
        bounds = [
            {
                name: bound_factor * limit
                for name, limit in _bounds_by_name(bound, default, names).items()
            }
            for bound, default in ((speed, MAX_SPEED), (acceleration, MAX_ACCELERATION))
        ]
        followed = _follow_with_bounds(clip, bounds[0], bounds[1], progress)
        followed = replace(followed, bound_factor=bound_factor)
        if best is None or (bool(followed), followed.arrived, -followed.error) > (
            bool(best),
            best.arrived,
            -best.error,
        ):
            best = followed
        if best or best.pose_error > MAX_ERROR:
            break
    assert best is not None
    return best


def _follow_with_bounds(
    clip: RetargetedClip,
    speed: Mapping[str, float],
    acceleration: Mapping[str, float],
    progress: OnProgress | None,
) -> FollowResult:
    """The clip followed within bounds of the driven coordinates, by name."""
    marionette, x0 = clip.marionette, clip.start
    t = x0.t + eased_times(clip.t)
    tracks = tracks_along(clip.figure, t, *smooth_poses(clip))
    acc_K, arrived = follow_tracks(marionette, x0, t[-1], tracks, speed, acceleration, progress)
    # A second run uses the inputs alone, as a stand without feedback does.
    run = simulate(marionette, x0, driven_inputs(marionette, x0, acc_K), effort=False, throw=False)
    status = FollowStatus.FOLLOWS if arrived and run.status in ARRIVED else FollowStatus.STOPPED
    followed = FollowResult(clip, status, run, acc_K, INPUT_INTERVAL, t, 0.0)
    is_lost = lost_share(followed.losses, float(t[-1] - t[0])) > MAX_LOST_SHARE
    if followed and (followed.error > MAX_ERROR or is_lost):
        return replace(followed, status=FollowStatus.DIVERGED)
    return followed


def follow_tracks(
    marionette: Marionette,
    x0: State,
    end_time: float,
    tracks: Sequence[Track],
    speed: float | Mapping[str, float] = MAX_SPEED,
    acceleration: float | Mapping[str, float] = MAX_ACCELERATION,
    progress: OnProgress | None = None,
) -> tuple[Array, bool]:
    """Accelerations of the hands with which parts follow tracks, by MPC in an event-driven run.

    Args:
        marionette: puppet.
        x0: state at rest.
        end_time: end of the tracks, after which the hands come to rest [s].
        tracks: tracks of parts and hands.
        speed, acceleration, progress: see :func:`follow_clip`.

    Returns:
        (n, n_vK) accelerations over intervals of ``INPUT_INTERVAL`` each, and whether the run
        arrived.
    """
    n_intervals = int(np.ceil((end_time - x0.t) / INPUT_INTERVAL - 1e-9)) + _SETTLING_INTERVALS
    names = marionette.coordinates.v_K
    bounds = Bounds(
        speed=_bounds_by_name(speed, MAX_SPEED, names),
        acceleration=_bounds_by_name(acceleration, MAX_ACCELERATION, names),
    )
    largest_acceleration = bounds.magnitudes(marionette, "acceleration")
    task = Task(
        marionette,
        x0,
        n_intervals * INPUT_INTERVAL,
        list(tracks),
        _SMOOTHNESS_COST,
        bounds,
        interval=INPUT_INTERVAL,
        dt=_TIME_STEP,
    )
    mpc = MPC(marionette, task, _HORIZON * INPUT_INTERVAL, _HORIZON, dt=_TIME_STEP, deadline=1e9)
    stepper = marionette.stepper(x0, "event")
    acc_K = np.zeros((n_intervals, marionette.coordinates.n_vK))
    for i in range(n_intervals):
        acc_K[i] = mpc.step(stepper.state)
        if i == n_intervals - 1:
            acc_K[i] = np.clip(
                -stepper.state.v_K / INPUT_INTERVAL, -largest_acceleration, largest_acceleration
            )
        stepper.advance(INPUT_INTERVAL, acc_K[i], throw=False)
        if not stepper.arrived:
            return acc_K[: i + 1], False
        if progress is not None:
            progress(Progress(done=i + 1, total=n_intervals))
    return acc_K, True


def driven_inputs(marionette: Marionette, x0: State, acc_K: Array) -> Input:
    """Motion of the hands with accelerations (n, n_vK) in successive intervals."""
    times = x0.t + INPUT_INTERVAL * np.arange(len(acc_K) + 1, dtype=float)
    return Input.segments(marionette, times, x0.q_K, x0.v_K, acc_K)


def string_crossings(marionette: Marionette, run: Trajectory) -> tuple[Crossing, ...]:
    """Crossings of strings in a run."""
    sample_indices = np.unique(np.append(np.arange(0, len(run), _SAMPLE_STRIDE), len(run) - 1))
    samples = (values[sample_indices] for values in (run.q_D, run.q_K, run.t))
    return StringDistances(marionette).motion(*samples).crossings()


def eased_times(t: Times, ease: float = _SPEED_CHANGE_TIME) -> Times:
    """Times of a clip's frames with a smooth beginning and end [s].

    Over ``ease`` seconds at either end the clip's speed changes linearly between 0 and 1; clips
    shorter than that are slower throughout.
    """
    check_positive(ease=ease)
    elapsed, end = t - t[0], float(t[-1] - t[0])
    ease = min(ease, end)
    start_times = np.sqrt(2.0 * ease * np.maximum(elapsed, 0.0))
    end_times = end + ease - np.sqrt(2.0 * ease * np.maximum(end - elapsed, 0.0))
    middle_times = elapsed + 0.5 * ease
    return np.where(
        elapsed < 0.5 * ease,
        start_times,
        np.where(elapsed > end - 0.5 * ease, end_times, middle_times),
    )


def smooth_poses(clip: RetargetedClip) -> tuple[dict[str, Array], Array]:
    """Part -> (T, 3) positions in the hanging poses, and (T, n_qK) hands, smoothed."""
    width = _SMOOTHING_TIME * (len(clip.t) - 1) / float(clip.t[-1])

    def smooth(values: Array) -> Array:
        return np.asarray(gaussian_filter1d(values, width, axis=0, mode="nearest"))

    positions = {part: smooth(clip.hanging_positions[part]) for part in PART_WEIGHTS}
    return positions, smooth(clip.hanging_poses.q_K)


def tracks_along(
    figure: Figure, t: Times, positions: Mapping[str, Array], q_K: Array
) -> list[Track]:
    """Tracks of a puppet's parts over time, and of its hands."""
    tracks = []
    for part, weight in PART_WEIGHTS.items():
        body, point = figure.points[part]
        tracks.append(
            Track.point(body, (t, positions[part]), at=point, weight=_PART_WEIGHT * weight)
        )
    table = figure.marionette.coordinates
    tracks += [
        Track.coordinate(table.q_K[q], (t, q_K[:, q]), weight=_HAND_WEIGHT)
        for q, _ in table.scalars_K
    ]
    return tracks


def _bounds_by_name(
    bound: float | Mapping[str, float], default: float, names: tuple[str, ...]
) -> dict[str, float]:
    """Bounds of all driven velocities by name, with the default for those not given."""
    if not isinstance(bound, Mapping):
        return dict.fromkeys(names, float(bound))
    return {**dict.fromkeys(names, default), **bound}
