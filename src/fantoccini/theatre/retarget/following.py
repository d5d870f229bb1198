"""Following: motions of the hands with which a puppet itself does what a clip shows.

    min over acc_K of  sum_i w_i |x_i(t) - x_i,hung(t)|^2 + w_K |q_K - q_K,hung|^2 + smoothness

over a horizon that goes along, within bounds of speed and acceleration (:class:`fantoccini.MPC`):
x_i,hung are the places of the parts in the hanging poses nearest to the clip. The hands lead by as
much as limbs lag, and take their swing out.
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
from fantoccini.dynamics.clearance import Crossing, StringsApart
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory
from fantoccini.theatre.capture import Capture
from fantoccini.theatre.retarget.figure import Figure
from fantoccini.theatre.retarget.mapping import SIDES, MappingFile
from fantoccini.theatre.retarget.retargeting import (
    LEANS,
    WEIGHTS,
    Placed,
    Retargeted,
    place_clip,
    places_in,
    retarget_clip,
)

SPEED, ACCELERATION = 2.0, 30.0
"""Bounds of the driven coordinates where none are given [m/s, m/s^2]."""
INTERVAL = 0.05
"""Over which the hands' accelerations are constant [s]."""
_HORIZON = 14
"""Intervals that are looked ahead."""
_DT = 0.0125
"""Time step of predictions [s]."""
_WEIGHT, _WEIGHT_K = 1e4, 30.0
"""Weight of the parts, which their own weights multiply, and w_K [1/m^2]."""
_SMOOTH = Smooth(acceleration=1e-3, jerk=1e-6)
_STILL = 8
"""Intervals after the clip's end in which the puppet comes to rest."""
_EASE = 0.5
"""Time in which the clip's time begins to run, and comes to its end [s]."""
MAX_ERROR = 0.15
"""Largest error of a group of parts in a run that follows, relative to the puppet's height."""
_SLOWER = 0.5, 0.25
"""Factors of the bounds of speed and acceleration, tried when a run goes astray."""
_EVERY = 4
"""Step between samples of a run between which crossings are searched."""
_WIDTH = 0.035
"""Standard deviation of what smooths the hanging poses [s]."""
GROUPS = {
    "hands": ("hand_left", "hand_right"),
    "head": ("head",),
    "feet": ("foot_left", "foot_right"),
    "trunk": ("trunk", "shoulder_left", "shoulder_right"),
}
"""Parts whose errors are reported together."""


_LINES = (
    ("trunk", "neck", "head"),
    *(("neck", f"shoulder_{side}", f"elbow_{side}", f"hand_{side}") for side in SIDES),
    *(("trunk", f"hip_{side}", f"knee_{side}", f"foot_{side}") for side in SIDES),
)
"""Parts of a person that are joined in drawings."""


class FollowStatus(Outcome):
    """A clip followed by a puppet."""

    FOLLOWS = "the run reached the clip's end, within 15 % of the puppet's height of the clip"
    ASTRAY = "the run is farther from the clip than 15 % of the puppet's height"
    STOPPED = "the event-driven run stopped before the clip's end"


@dataclass(frozen=True)
class PartError:
    """Errors of a group of parts, root mean squares over time and parts [m].

    Attributes:
        name: of the group.
        reach: of the hanging poses nearest to the clip: what no hands can better.
        run: of the run, from the clip.
        largest: of the run, at any time.
        above: share of the puppet's height by which ``run`` exceeds ``reach``.
    """

    name: str
    reach: float
    run: float
    largest: float
    above: float


@dataclass(frozen=True, eq=False)
class Followed:
    """A puppet that follows a clip. True where its run arrived and is near the clip.

    Attributes:
        retargeted: the clip, and the hanging poses nearest to it.
        status: how it ended.
        run: the event-driven run.
        acc_K: (N, n_vK) accelerations of the driven coordinates, over an interval each.
        interval: [s].
        t: (T,) times in the run of the clip's frames, with a slow beginning and end [s].
        seconds: computing time [s].
        share: factor of the bounds of speed and acceleration: less than 1 if the run went astray
            with the full bounds.
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
    def far(self) -> float:
        """Largest error of a group of parts, root mean square, relative to the puppet's height."""
        return max(part.run for part in self.report) / self.retargeted.figure.height

    @property
    def hanging_far(self) -> float:
        """The same error for the hanging poses nearest to the clip."""
        return max(part.reach for part in self.report) / self.retargeted.figure.height

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Crossings of the puppet's strings in the run."""
        return crossings_in(self.retargeted.marionette, self.run)

    def __repr__(self) -> str:
        clip = self.retargeted.clip
        above = ", ".join(f"{one.name} {100 * one.above:.1f} %" for one in self.report)
        return f"<Followed {clip.name!r}: {self.status.name}, above reach {above} of the height>"

    @property
    def inputs(self) -> Input:
        """The motion of the hands, from ``retargeted.start`` on."""
        made = driven(self.retargeted.marionette, self.run.state(0), self.acc_K)
        return made.called(self.retargeted.clip.name)

    def guides(self, times: Times) -> list[Array]:
        """(len(times), n, 3) lines through the parts of the clip at times of the run [m].

        Trunk and head, both arms, both legs; for ``view.film(..., guides=followed.guides)``.
        """
        parts, found = self.retargeted.places.parts, []
        for line in _LINES:
            path = np.stack([parts[part] for part in line], axis=1).reshape(len(self.t), -1)
            at = np.stack([np.interp(times, self.t, column) for column in path.T], axis=1)
            found.append(at.reshape(len(times), len(line), 3))
        return found

    @cached_property
    def places(self) -> dict[str, Array]:
        """Part -> (T, 3) where it is in the run at the clip's frames, while it lasts [m]."""
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
    clip: Capture | Placed | Retargeted | str | os.PathLike[str],
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
    """The motion of the hands with which a puppet follows captured motion.

    Strings run straight up; where they pass through one another, the clip is followed again with
    strings that lean outwards, and the motion with the fewest passages is returned. Where the run
    goes astray, smaller shares of the bounds are tried.

    Args:
        marionette: the puppet, without contact.
        clip: a BVH file, what :func:`load_bvh` read, or the result of :func:`place_clip` or
            :func:`retarget_clip`; the poses of the latter are followed as they are.
        mapping: see :func:`retarget_clip`, as for ``start``, ``travel``, ``up`` and ``of``.
        start: where the puppet hangs, from which the first pose is looked for.
        travel: share of the way along the floor that is kept.
        speed, acceleration: bounds of the driven coordinates, for all or by name; others have the
            usual ones [m/s or rad/s, m/s^2 or rad/s^2].
        progress: called with the share that is done.

    Raises:
        FileError: files with mistakes, or joints that are not found.
        StateError: the puppet has not the bodies of a person, or has contact.
    """
    began = time.perf_counter()
    given = mapping is not None or start is not None or travel != 1.0 or bool(up or of)
    if given and isinstance(clip, Placed | Retargeted):
        raise StateError(
            "follow_clip: a clip that was placed or retargeted has its mapping, start, travel, up "
            "and of already"
        )
    if isinstance(clip, Retargeted):
        best = _follow_within(clip, speed, acceleration, progress)
    else:
        if not isinstance(clip, Placed):
            clip = place_clip(marionette, clip, mapping, start, travel, up, of=of)
        best = _follow_within(retarget_clip(marionette, clip), speed, acceleration, progress)
        for lean in LEANS:
            if not best or not best.crossings:
                break
            hung = retarget_clip(marionette, replace(clip, lean=lean))
            made = _follow_within(hung, speed, acceleration, progress)
            if made and len(made.crossings) < len(best.crossings):
                best = made
    return replace(best, seconds=time.perf_counter() - began)


def _follow_within(
    clip: Retargeted,
    speed: float | Mapping[str, float],
    acceleration: float | Mapping[str, float],
    progress: OnProgress | None,
) -> Followed:
    """The clip followed within the full bounds, or within reduced bounds if the run goes astray."""
    names, best = clip.marionette.coordinates.v_K, None
    for share in (1.0, *_SLOWER):
        bounds = [
            {name: share * most for name, most in _every(bound, usual, names).items()}
            for bound, usual in ((speed, SPEED), (acceleration, ACCELERATION))
        ]
        made = replace(_followed(clip, bounds[0], bounds[1], progress), share=share)
        if best is None or (bool(made), made.arrived, -made.far) > (
            bool(best),
            best.arrived,
            -best.far,
        ):
            best = made
        if best or best.hanging_far > MAX_ERROR:
            break
    assert best is not None
    return best


def _followed(
    clip: Retargeted,
    speed: Mapping[str, float],
    acceleration: Mapping[str, float],
    progress: OnProgress | None,
) -> Followed:
    """A clip followed within bounds of the driven coordinates, by name."""
    marionette, x0 = clip.marionette, clip.start
    t = x0.t + eased(clip.t)
    tracks = tracks_along(clip.figure, t, *smoothed(clip))
    acc_K, arrived = lead_along(marionette, x0, t[-1], tracks, speed, acceleration, progress)
    # Run again from the inputs alone: what a stand does that is not watched.
    run = simulate(marionette, x0, driven(marionette, x0, acc_K), effort=False, throw=False)
    status = FollowStatus.FOLLOWS if arrived and run.status in ARRIVED else FollowStatus.STOPPED
    followed = Followed(clip, status, run, acc_K, INTERVAL, t, 0.0)
    if followed and followed.far > MAX_ERROR:
        return replace(followed, status=FollowStatus.ASTRAY)
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
        marionette: the puppet.
        x0: where it hangs at rest.
        until: the time at which the tracks end; the hands come to rest after it [s].
        tracks: of parts and hands.
        speed, acceleration, progress: see :func:`follow_clip`.

    Returns:
        (n, n_vK) accelerations over intervals of ``INTERVAL`` each, and whether the run arrived.
    """
    n = int(np.ceil((until - x0.t) / INTERVAL - 1e-9)) + _STILL
    names = marionette.coordinates.v_K
    bounds = Bounds(
        speed=_every(speed, SPEED, names), acceleration=_every(acceleration, ACCELERATION, names)
    )
    most = bounds.magnitudes(marionette, "acceleration")
    task = Task(
        marionette, x0, n * INTERVAL, list(tracks), _SMOOTH, bounds, interval=INTERVAL, dt=_DT
    )
    mpc = MPC(marionette, task, _HORIZON * INTERVAL, _HORIZON, dt=_DT, deadline=1e9)
    stepper = marionette.stepper(x0, "event")
    acc_K = np.zeros((n, marionette.coordinates.n_vK))
    for i in range(n):
        acc_K[i] = mpc.step(stepper.state)
        if i == n - 1:
            acc_K[i] = np.clip(-stepper.state.v_K / INTERVAL, -most, most)
        stepper.advance(INTERVAL, acc_K[i], throw=False)
        if not stepper.arrived:
            return acc_K[: i + 1], False
        if progress is not None:
            progress(Progress(done=i + 1, total=n))
    return acc_K, True


def driven(marionette: Marionette, x0: State, acc_K: Array) -> Input:
    """The motion of the hands with accelerations (n, n_vK) over intervals."""
    times = x0.t + INTERVAL * np.arange(len(acc_K) + 1, dtype=float)
    return Input.segments(marionette, times, x0.q_K, x0.v_K, acc_K)


def places_of(retargeted: Retargeted, run: Trajectory, t: Times) -> dict[str, Array]:
    """Part -> (T, 3) where it is in a run at times of the clip's frames, while it lasts [m]."""
    run = run.resample(np.clip(t, run.t[0], run.t[-1]))
    return places_in(retargeted.figure, retargeted.marionette.poses(run.q_D, run.q_K))


def errors_of(retargeted: Retargeted, run: Trajectory, t: Times) -> dict[str, Array]:
    """Part -> (T,) distance of a run from the clip [m]."""
    places, wanted = places_of(retargeted, run, t), retargeted.places.parts
    return {part: np.linalg.norm(places[part] - wanted[part], axis=1) for part in WEIGHTS}


def report_of(retargeted: Retargeted, errors: Mapping[str, Array]) -> tuple[PartError, ...]:
    """Errors of hands, head, feet and trunk, from those of a run by part."""
    part_errors = []
    for name, parts in GROUPS.items():
        run = np.stack([errors[part] for part in parts])
        reach = np.stack([retargeted.errors[part] for part in parts])
        a, b = (float(np.sqrt(np.mean(np.square(e)))) for e in (reach, run))
        above = (b - a) / retargeted.figure.height
        part_errors.append(PartError(name, a, b, float(run.max()), above))
    return tuple(part_errors)


def crossings_in(marionette: Marionette, run: Trajectory) -> tuple[Crossing, ...]:
    """Passages of strings through one another in a run."""
    k = np.unique(np.append(np.arange(0, len(run), _EVERY), len(run) - 1))
    samples = (x[k] for x in (run.q_D, run.q_K, run.t))
    return StringsApart(marionette).over(*samples).crossings()


def eased(t: Times, ease: float = _EASE) -> Times:
    """Times of a clip's frames where its time begins to run from rest, and ends at rest [s].

    Over ``ease`` seconds at either end the clip's speed changes evenly between 0 and 1; clips
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
    """Part -> (T, 3) places in the hanging poses, and (T, n_qK) their hands, smoothed."""
    frames = _WIDTH * (len(clip.t) - 1) / float(clip.t[-1])

    def smooth(values: Array) -> Array:
        return np.asarray(gaussian_filter1d(values, frames, axis=0, mode="nearest"))

    return {part: smooth(clip.hung[part]) for part in WEIGHTS}, smooth(clip.reach.q_K)


def tracks_along(figure: Figure, t: Times, places: Mapping[str, Array], q_K: Array) -> list[Track]:
    """Targets of a puppet: places of its parts by time, and its hands."""
    tracks = []
    for part, weight in WEIGHTS.items():
        body, at = figure.points[part]
        tracks.append(Track.point(body, (t, places[part]), at=at, weight=_WEIGHT * weight))
    table = figure.marionette.coordinates
    tracks += [
        Track.coordinate(table.q_K[q], (t, q_K[:, q]), weight=_WEIGHT_K) for q, _ in table.scalars_K
    ]
    return tracks


def _every(
    bound: float | Mapping[str, float], usual: float, names: tuple[str, ...]
) -> dict[str, float]:
    """Bounds of all driven velocities, with the default for those not named."""
    if not isinstance(bound, Mapping):
        return dict.fromkeys(names, float(bound))
    return {**dict.fromkeys(names, usual), **bound}
