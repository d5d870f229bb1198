"""Following: motions of the hands with which a puppet moves as a clip does.

    min over acc_K of  sum_i w_i |x_i(t) - x_i,hang(t)|^2 + w_K |q_K - q_K,hang|^2 + smoothness

over a receding horizon, within bounds of speed and acceleration (:class:`fantoccini.MPC`):
x_i,hang are the positions of the parts in the hanging poses nearest to the clip. The hands lead by
the lag of the limbs, and damp their swing.
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
    Loss,
    PartError,
    errors_of,
    losses_of,
    lost_share,
    places_of,
    report_of,
)
from fantoccini.theatre.retarget.figure import Figure
from fantoccini.theatre.retarget.mapping import SIDES, MappingFile
from fantoccini.theatre.retarget.retargeting import (
    LEANS,
    WEIGHTS,
    PlacedClip,
    Retargeted,
    place_clip,
    retarget_clip,
)

SPEED, ACCELERATION = 2.0, 30.0
"""Default bounds of the driven coordinates [m/s, m/s^2]."""
INTERVAL = 0.05
"""Interval over which the hands' accelerations are constant [s]."""
_HORIZON = 14
"""Number of intervals in the horizon."""
_TIME_STEP = 0.0125
"""Time step of predictions [s]."""
_PART_WEIGHT, _HAND_WEIGHT = 1e4, 30.0
"""Factor of the parts' weights w_i, and weight w_K of the hands [1/m^2]."""
_SMOOTH = Smooth(acceleration=1e-3, jerk=1e-6)
_SETTLING_INTERVALS = 8
"""Number of intervals after the clip's end in which the puppet comes to rest."""
_EASE_TIME = 0.5
"""Duration in which the clip accelerates to its speed, and in which it stops [s]."""
MAX_ERROR = 0.15
"""Largest error of a group of parts in a run that follows, relative to the puppet's height."""
BOUND_FACTORS = 0.5, 0.25
"""Factors of the bounds of speed and acceleration to try if the run leaves the clip."""
_SAMPLE_STRIDE = 4
"""Stride of the samples of a run that are searched for crossings."""
_SMOOTHING_TIME = 0.035
"""Standard deviation of the smoothing of the hanging poses [s]."""


_LINES = (
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
class Followed:
    """Motion of a puppet that follows a clip. True if its run arrived and is near the clip.

    Attributes:
        retargeted: clip, and the hanging poses nearest to it.
        status: outcome.
        run: event-driven run.
        acc_K: (N, n_vK) accelerations of the driven coordinates in each interval.
        interval: duration of an interval [s].
        t: (T,) times in the run of the clip's frames, with a slow beginning and end [s].
        seconds: computing time [s].
        share: factor of the bounds of speed and acceleration; below 1 if the run left the clip with
            the full bounds.
    """

    retargeted: Retargeted
    status: FollowStatus
    run: Trajectory
    acc_K: Array
    interval: float
    t: Times
    seconds: float
    share: float = 1.0

    def __bool__(self) -> bool:
        return self.status is FollowStatus.FOLLOWS

    @property
    def arrived(self) -> bool:
        """Whether the run reached the clip's end."""
        return self.status is not FollowStatus.STOPPED

    @property
    def error(self) -> float:
        """Largest error of a group of parts, root mean square, relative to the puppet's height."""
        return max(part.run for part in self.report) / self.retargeted.figure.height

    @property
    def pose_error(self) -> float:
        """The same error for the hanging poses nearest to the clip."""
        return max(part.reach for part in self.report) / self.retargeted.figure.height

    @cached_property
    def losses(self) -> tuple[Loss, ...]:
        """Times in which a part is 15 % of the height farther off than its hanging pose."""
        allowed = MAX_ERROR * self.retargeted.figure.height
        return losses_of(self.t, self.errors, self.retargeted.errors, allowed)

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Crossings of the puppet's strings in the run."""
        return crossings_in(self.retargeted.marionette, self.run)

    def __repr__(self) -> str:
        clip = self.retargeted.clip
        excess = ", ".join(f"{part.name} {100 * part.excess:.1f} %" for part in self.report)
        return f"<Followed {clip.name!r}: {self.status.name}, excess {excess} of the height>"

    @property
    def inputs(self) -> Input:
        """Motion of the hands from ``retargeted.start``."""
        inputs = driven(self.retargeted.marionette, self.run.state(0), self.acc_K)
        return inputs.with_name(self.retargeted.clip.name)

    def guides(self, times: Times) -> list[Array]:
        """(len(times), n, 3) lines through the parts of the clip, at times of the run [m].

        The lines are trunk and head, both arms and both legs, for ``view.film(...,
        guides=followed.guides)``.
        """
        parts, lines = self.retargeted.places.parts, []
        for line in _LINES:
            path = np.stack([parts[part] for part in line], axis=1).reshape(len(self.t), -1)
            at = np.stack([np.interp(times, self.t, column) for column in path.T], axis=1)
            lines.append(at.reshape(len(times), len(line), 3))
        return lines

    @cached_property
    def places(self) -> dict[str, Array]:
        """Part -> (T, 3) position in the run at the clip's frames, up to the run's end [m]."""
        return places_of(self.retargeted, self.run, self.t)

    @cached_property
    def errors(self) -> dict[str, Array]:
        """Part -> (T,) distance of the run from the clip [m]."""
        return errors_of(self.retargeted, self.run, self.t)

    @cached_property
    def report(self) -> tuple[PartError, ...]:
        """Errors of hands, head, feet and trunk."""
        return report_of(self.retargeted, self.errors)


def follow_clip(
    marionette: Marionette,
    clip: Capture | PlacedClip | Retargeted | str | os.PathLike[str],
    mapping: MappingFile | str | os.PathLike[str] | None = None,
    *,
    start: State | None = None,
    travel: float = 1.0,
    up: str | None = None,
    of: str = "",
    speed: float | Mapping[str, float] = SPEED,
    acceleration: float | Mapping[str, float] = ACCELERATION,
    progress: OnProgress | None = None,
) -> Followed:
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
    if has_options and isinstance(clip, PlacedClip | Retargeted):
        raise StateError(
            "follow_clip: a clip that was placed or retargeted has its mapping, start, travel, up "
            "and of already"
        )
    if isinstance(clip, Retargeted):
        best = _follow_within(clip, speed, acceleration, progress)
    else:
        if not isinstance(clip, PlacedClip):
            clip = place_clip(marionette, clip, mapping, start, travel, up, of=of)
        best = _follow_within(retarget_clip(marionette, clip), speed, acceleration, progress)
        for lean in LEANS:
            if not best or not best.crossings:
                break
            retargeted = retarget_clip(marionette, replace(clip, lean=lean))
            followed = _follow_within(retargeted, speed, acceleration, progress)
            if followed and len(followed.crossings) < len(best.crossings):
                best = followed
    return replace(best, seconds=time.perf_counter() - start_time)


def _follow_within(
    clip: Retargeted,
    speed: float | Mapping[str, float],
    acceleration: float | Mapping[str, float],
    progress: OnProgress | None,
) -> Followed:
    """The clip followed within the full bounds, or within reduced bounds if the run leaves it."""
    names, best = clip.marionette.coordinates.v_K, None
    for share in (1.0, *BOUND_FACTORS):
        bounds = [
            {name: share * limit for name, limit in _by_name(bound, default, names).items()}
            for bound, default in ((speed, SPEED), (acceleration, ACCELERATION))
        ]
        followed = replace(_followed(clip, bounds[0], bounds[1], progress), share=share)
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


def _followed(
    clip: Retargeted,
    speed: Mapping[str, float],
    acceleration: Mapping[str, float],
    progress: OnProgress | None,
) -> Followed:
    """The clip followed within bounds of the driven coordinates, by name."""
    marionette, x0 = clip.marionette, clip.start
    t = x0.t + eased(clip.t)
    tracks = tracks_along(clip.figure, t, *smoothed(clip))
    acc_K, arrived = lead_along(marionette, x0, t[-1], tracks, speed, acceleration, progress)
    # A second run uses the inputs alone, as a stand without feedback does.
    run = simulate(marionette, x0, driven(marionette, x0, acc_K), effort=False, throw=False)
    status = FollowStatus.FOLLOWS if arrived and run.status in ARRIVED else FollowStatus.STOPPED
    followed = Followed(clip, status, run, acc_K, INTERVAL, t, 0.0)
    is_lost = lost_share(followed.losses, float(t[-1] - t[0])) > MAX_LOST_SHARE
    if followed and (followed.error > MAX_ERROR or is_lost):
        return replace(followed, status=FollowStatus.DIVERGED)
    return followed


def lead_along(
    marionette: Marionette,
    x0: State,
    until: float,
    tracks: Sequence[Track],
    speed: float | Mapping[str, float] = SPEED,
    acceleration: float | Mapping[str, float] = ACCELERATION,
    progress: OnProgress | None = None,
) -> tuple[Array, bool]:
    """Accelerations of the hands with which parts follow tracks, by MPC in an event-driven run.

    Args:
        marionette: puppet.
        x0: state at rest.
        until: end of the tracks, after which the hands come to rest [s].
        tracks: tracks of parts and hands.
        speed, acceleration, progress: see :func:`follow_clip`.

    Returns:
        (n, n_vK) accelerations over intervals of ``INTERVAL`` each, and whether the run arrived.
    """
    n = int(np.ceil((until - x0.t) / INTERVAL - 1e-9)) + _SETTLING_INTERVALS
    names = marionette.coordinates.v_K
    bounds = Bounds(
        speed=_by_name(speed, SPEED, names),
        acceleration=_by_name(acceleration, ACCELERATION, names),
    )
    largest_acceleration = bounds.magnitudes(marionette, "acceleration")
    task = Task(
        marionette,
        x0,
        n * INTERVAL,
        list(tracks),
        _SMOOTH,
        bounds,
        interval=INTERVAL,
        dt=_TIME_STEP,
    )
    mpc = MPC(marionette, task, _HORIZON * INTERVAL, _HORIZON, dt=_TIME_STEP, deadline=1e9)
    stepper = marionette.stepper(x0, "event")
    acc_K = np.zeros((n, marionette.coordinates.n_vK))
    for i in range(n):
        acc_K[i] = mpc.step(stepper.state)
        if i == n - 1:
            acc_K[i] = np.clip(
                -stepper.state.v_K / INTERVAL, -largest_acceleration, largest_acceleration
            )
        stepper.advance(INTERVAL, acc_K[i], throw=False)
        if not stepper.arrived:
            return acc_K[: i + 1], False
        if progress is not None:
            progress(Progress(done=i + 1, total=n))
    return acc_K, True


def driven(marionette: Marionette, x0: State, acc_K: Array) -> Input:
    """Motion of the hands with accelerations (n, n_vK) in successive intervals."""
    times = x0.t + INTERVAL * np.arange(len(acc_K) + 1, dtype=float)
    return Input.segments(marionette, times, x0.q_K, x0.v_K, acc_K)


def crossings_in(marionette: Marionette, run: Trajectory) -> tuple[Crossing, ...]:
    """Crossings of strings in a run."""
    k = np.unique(np.append(np.arange(0, len(run), _SAMPLE_STRIDE), len(run) - 1))
    samples = (x[k] for x in (run.q_D, run.q_K, run.t))
    return StringDistances(marionette).motion(*samples).crossings()


def eased(t: Times, ease: float = _EASE_TIME) -> Times:
    """Times of a clip's frames with a smooth beginning and end [s].

    Over ``ease`` seconds at either end the clip's speed changes linearly between 0 and 1; clips
    shorter than that are slower throughout.
    """
    check_positive(ease=ease)
    s, end = t - t[0], float(t[-1] - t[0])
    ease = min(ease, end)
    first = np.sqrt(2.0 * ease * np.maximum(s, 0.0))
    last = end + ease - np.sqrt(2.0 * ease * np.maximum(end - s, 0.0))
    middle = s + 0.5 * ease
    return np.where(s < 0.5 * ease, first, np.where(s > end - 0.5 * ease, last, middle))


def smoothed(clip: Retargeted) -> tuple[dict[str, Array], Array]:
    """Part -> (T, 3) positions in the hanging poses, and (T, n_qK) hands, smoothed."""
    frames = _SMOOTHING_TIME * (len(clip.t) - 1) / float(clip.t[-1])

    def smooth(values: Array) -> Array:
        return np.asarray(gaussian_filter1d(values, frames, axis=0, mode="nearest"))

    return {part: smooth(clip.hanging_positions[part]) for part in WEIGHTS}, smooth(clip.reach.q_K)


def tracks_along(figure: Figure, t: Times, places: Mapping[str, Array], q_K: Array) -> list[Track]:
    """Tracks of a puppet's parts over time, and of its hands."""
    tracks = []
    for part, weight in WEIGHTS.items():
        body, at = figure.points[part]
        tracks.append(Track.point(body, (t, places[part]), at=at, weight=_PART_WEIGHT * weight))
    table = figure.marionette.coordinates
    tracks += [
        Track.coordinate(table.q_K[q], (t, q_K[:, q]), weight=_HAND_WEIGHT)
        for q, _ in table.scalars_K
    ]
    return tracks


def _by_name(
    bound: float | Mapping[str, float], default: float, names: tuple[str, ...]
) -> dict[str, float]:
    """Bounds of all driven velocities by name, with the default for those not given."""
    if not isinstance(bound, Mapping):
        return dict.fromkeys(names, float(bound))
    return {**dict.fromkeys(names, default), **bound}
