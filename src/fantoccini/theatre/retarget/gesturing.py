"""Clips as gestures: from a puppet's rest to a clip, through it on the spot, and back.

    x_i(t) = x_i,hang + s(t / T) (x_i,clip(0) - x_i,hang),   s = minimum jerk

leads to the clip's first pose, and likewise back from its last. The hands follow all of it as in
:func:`follow_clip`, within bounds that hold for every heading of the puppet.

A lead is the motion from rest to the first pose of the clip, or from the last one back. q_K are the
driven coordinates, which the hands move, v_K and acc_K their velocities and accelerations. In
names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass

import numpy as np

from fantoccini.base import ARRIVED, Array, StateError, Times, check_positive, polynomial
from fantoccini.dynamics.clearance import Crossing
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import State, Trajectory
from fantoccini.theatre.capture import Capture, load_bvh
from fantoccini.theatre.gestures import Gesture, xy_indices
from fantoccini.theatre.retarget.deviations import PART_GROUPS, PartError, group_errors, part_errors
from fantoccini.theatre.retarget.following import (
    INPUT_INTERVAL,
    driven_inputs,
    eased_times,
    follow_tracks,
    smooth_poses,
    string_crossings,
    tracks_along,
)
from fantoccini.theatre.retarget.mapping import MappingFile
from fantoccini.theatre.retarget.placing import PartTargets
from fantoccini.theatre.retarget.retargeting import (
    LEAN_FACTORS,
    PART_WEIGHTS,
    PlacedClip,
    RetargetedClip,
    part_positions,
    place_clip,
    retarget_clip,
)

CLIP_START_MARK, CLIP_END_MARK = "begins", "over"
"""Marks of the clip's first and last frame."""
_MAX_FRAME_RATE = 30.0
"""Frame rate above which frames are left out [1/s]."""
_EASE_TIME = 0.5
"""Duration in which the clip accelerates to its speed, and in which it stops [s]."""
_MIN_LEAD_TIME, _LEAD_BOUND_FACTORS = 0.5, (0.5, 0.25)
"""Least duration of the leads to a clip and back [s], and the shares of the bounds of speed and
acceleration that they use."""
_REST_TIME = 0.02
"""Duration of rest at the end [s]."""
_MAX_STOP_TIME = 0.6
"""Largest time to come to rest at the end [s]."""


@dataclass(frozen=True, eq=False)
class ClipGesture:
    """A clip as a gesture of a puppet.

    Attributes:
        gesture: motion of the hands from the puppet's rest and back; its marks are ``begins`` and
            ``over``.
        retargeted: clip on the spot, and the hanging poses nearest to it.
        t: (T,) times in the gesture of the clip's frames [s].
        run: event-driven run of the gesture, from the puppet's rest.
        report: errors of hands, head, feet and trunk in the run, relative to the clip.
        crossings: crossings of the puppet's strings in the run.
    """

    gesture: Gesture
    retargeted: RetargetedClip
    t: Times
    run: Trajectory
    report: tuple[PartError, ...]
    crossings: tuple[Crossing, ...]

    @property
    def arrived(self) -> bool:
        """Whether the run reached its end."""
        return self.run.status in ARRIVED


def place_on_spot(
    marionette: Marionette,
    clip: Capture | str | os.PathLike[str],
    mapping: MappingFile | str | os.PathLike[str] | None = None,
    start: State | None = None,
) -> PlacedClip:
    """Targets of a puppet's parts in a clip on the spot, with 30 frames a second or a few more.

    Motion over the floor and turning about the vertical are removed: the hips stay above their
    place, and the trunk keeps its heading.

    Args:
        marionette, clip, mapping, start: see :func:`retarget_clip`.

    Raises:
        FileError: the files have mistakes, or joints are missing.
        StateError: the puppet does not have the bodies of a person, or has contact.
    """
    if not isinstance(clip, Capture):
        clip = load_bvh(clip)
    if len(clip.t) > 2:
        clip = clip.without_calibration()
        stride = max(1, int((len(clip.t) - 1) / (clip.duration * _MAX_FRAME_RATE) + 1e-3))
        clip = dataclasses.replace(
            clip,
            t=clip.t[::stride],
            positions=clip.positions[::stride],
            rotations=clip.rotations[::stride],
        )
    return place_clip(marionette, clip, mapping, start, travel=0.0, turning=0.0)


def clip_gesture(
    placed: PlacedClip,
    faster: float = 1.0,
    lasts: float | None = None,
    *,
    speed: float,
    acceleration: float,
) -> ClipGesture:
    """Gesture of a clip.

    Strings lean outwards and forwards, at least as much as at rest, so that they do not cross;
    several leans are tried. The clip is raised until no foot is lower than at rest.

    Args:
        placed: clip on the spot.
        faster: speed factor of the clip itself, without the leads to it and back.
        lasts: duration of the whole gesture [s]; overrides ``faster``.
        speed, acceleration: bounds of the driven coordinates, along any direction of ends that
            move over the floor [m/s or rad/s, m/s^2 or rad/s^2].

    Raises:
        StateError: the puppet cannot reach the clip's start, an end does not move along both x and
            y, or the leads alone take longer than ``lasts``.
    """
    check_positive(faster=faster, speed=speed, acceleration=acceleration)
    first_gesture: ClipGesture | None = None
    for lean in LEAN_FACTORS:
        gesture = _gesture_with_lean(
            dataclasses.replace(placed, lean=lean), faster, lasts, speed, acceleration
        )
        if not gesture.crossings:
            return gesture
        first_gesture = first_gesture or gesture
    assert first_gesture is not None
    return first_gesture


def _gesture_with_lean(
    placed: PlacedClip, faster: float, lasts: float | None, speed: float, acceleration: float
) -> ClipGesture:
    marionette = placed.figure.marionette
    start = placed.start.replace(t=0.0)
    rest_positions = part_positions(
        placed.figure, marionette.poses(start.q_D[None], start.q_K[None])
    )
    retargeted = retarget_clip(marionette, placed)
    sinking = max(
        float(np.max(rest_positions[foot][0, 2] - retargeted.hanging_positions[foot][:, 2]))
        for foot in PART_GROUPS["feet"]
    )
    if sinking > 0.0:
        retargeted = retarget_clip(marionette, _raise_targets(placed, sinking))
    parts, q_K = smooth_poses(retargeted)
    leads = _lead_times(retargeted, q_K, start, speed, acceleration)
    if lasts is not None:
        faster = _speed_factor(retargeted, lasts, sum(leads) + _MAX_STOP_TIME)
    clip_times = eased_times(retargeted.t / faster, _EASE_TIME)
    t, frames = _gesture_times(clip_times, leads)
    tracks = tracks_along(
        retargeted.figure,
        t,
        {
            part: _with_leads(rest_positions[part][0], parts[part], t, frames)
            for part in PART_WEIGHTS
        },
        _with_leads(start.q_K, q_K, t, frames),
    )
    bounds = _bounds_for_all_headings(marionette, speed, acceleration)
    acc_K, _ = follow_tracks(marionette, start, float(t[-1]), tracks, *bounds)
    gesture = Gesture.from_input(driven_inputs(marionette, start, acc_K), name=placed.clip.name)
    lead_bounds = {
        "speed": speed * _LEAD_BOUND_FACTORS[0],
        "acceleration": acceleration * _LEAD_BOUND_FACTORS[1],
    }
    gesture = gesture.then(Gesture.rest(marionette.coordinates, _REST_TIME), **lead_bounds)
    frame_times = t[frames]
    if frame_times[-1] > gesture.duration:
        raise StateError(f"{placed.clip.name}: the puppet's run stops at {gesture.duration:.2f} s")
    marks = {CLIP_START_MARK: float(frame_times[0]), CLIP_END_MARK: float(frame_times[-1])}
    gesture = dataclasses.replace(gesture, name=placed.clip.name, marks=marks)
    if lasts is not None:
        frame_times = frame_times * lasts / gesture.duration
        gesture = gesture.lasting(lasts)
    run = simulate(marionette, start, gesture.inputs(start), effort=False, throw=False)
    report = group_errors(retargeted, part_errors(retargeted, run, frame_times))
    crossings = string_crossings(marionette, run)
    return ClipGesture(gesture, retargeted, frame_times, run, report, crossings)


class TooShortError(StateError):
    """A clip would last no longer than the leads to it and back.

    Args:
        name: name of the clip.
        lasts: wanted duration [s].
        leads: duration of the leads [s].
        beat: duration of a beat, in which the message gives times; in seconds by default [s].
    """

    def __init__(self, name: str, lasts: float, leads: float, beat: float | None = None):
        self.name, self.lasts, self.leads = name, lasts, leads
        unit, scale = ("s", 1.0) if beat is None else ("beats", beat)
        super().__init__(
            f"found {lasts / scale:.3g} {unit} for {name}; needed: more than {leads / scale:.3g} "
            f"{unit}, which the motions to its start and back take"
        )


def _raise_targets(placed: PlacedClip, height: float) -> PlacedClip:
    """The clip with all targets raised [m]."""
    offset = np.array([0.0, 0.0, height])
    shift = np.zeros((3, 4))
    shift[:, 3] = offset
    targets = placed.targets
    return dataclasses.replace(
        placed,
        targets=PartTargets(
            {part: path + offset for part, path in targets.parts.items()},
            {part: frame + shift for part, frame in targets.frames.items()},
            targets.scale,
        ),
    )


def _speed_factor(clip: RetargetedClip, lasts: float, lead_time: float) -> float:
    """Speed factor of the clip for a whole duration [s], of which other parts take a time [s]."""
    clip_time = lasts - lead_time
    if clip_time <= 0.0:
        raise TooShortError(clip.clip.name, lasts, lead_time)
    return float(clip.t[-1]) / max(clip_time - _EASE_TIME, 0.5 * clip_time)


def _bounds_for_all_headings(
    marionette: Marionette, speed: float, acceleration: float
) -> tuple[dict[str, float], dict[str, float]]:
    """Bounds of speed and acceleration by coordinate, which also hold after any turn."""
    table = marionette.coordinates
    factors = np.ones(table.n_vK)
    for x, y in xy_indices(table, np.ones(table.n_vK, dtype=bool)):
        factors[[x, y]] = np.sqrt(0.5)
    return (
        dict(zip(table.v_K, (speed * factors).tolist(), strict=True)),
        dict(zip(table.v_K, (acceleration * factors).tolist(), strict=True)),
    )


def _lead_times(
    retargeted: RetargetedClip, q_K: Array, start: State, speed: float, acceleration: float
) -> tuple[float, float]:
    """Durations of the leads to the first pose and back from the last [s]."""
    scalars = [q for q, _ in retargeted.marionette.coordinates.scalars_K]
    times = []
    for pose in (q_K[0], q_K[-1]):
        distance = float(np.max(np.abs((pose - start.q_K)[scalars]), initial=0.0))
        times.append(
            max(
                _MIN_LEAD_TIME,
                polynomial.minimum_jerk_duration(
                    distance, _LEAD_BOUND_FACTORS[0] * speed, _LEAD_BOUND_FACTORS[1] * acceleration
                ),
            )
        )
    return times[0], times[1]


def _gesture_times(frame_times: Times, leads: tuple[float, float]) -> tuple[Times, slice]:
    """Times of the gesture, and the slice of the clip's frames in them."""
    n_points = [int(np.ceil(lead / INPUT_INTERVAL)) for lead in leads]
    lead_in = np.linspace(0.0, leads[0], n_points[0] + 1)[:-1]
    lead_out = np.linspace(0.0, leads[1], n_points[1] + 1)[1:]
    clip_times = leads[0] + frame_times - frame_times[0]
    t = np.concatenate([lead_in, clip_times, clip_times[-1] + lead_out])
    return t, slice(n_points[0], n_points[0] + len(frame_times))


def _with_leads(rest: Array, values: Array, t: Times, frames: slice) -> Array:
    """(n, ...) values from home to the clip's first ones, through them, and back."""
    clip_start, clip_end = t[frames][0], t[frames][-1]
    s_in, s_out = t[: frames.start] / clip_start, (t[frames.stop :] - clip_end) / (t[-1] - clip_end)

    def blend(start: Array, end: Array, s: Times) -> Array:
        share, _, _ = polynomial.minimum_jerk(s)
        return np.asarray(start + share[:, None] * (end - start))

    return np.concatenate([blend(rest, values[0], s_in), values, blend(values[-1], rest, s_out)])
