"""Clips as gestures: from a puppet's rest into a clip, through it on the spot, and back.

    x_i(t) = x_i,hang + s(t / T) (x_i,clip(0) - x_i,hang),   s = minimum jerk

leads into the clip's first pose, and likewise back from its last. The hands follow all of it as in
:func:`follow_clip`, within bounds that hold for every heading of the puppet.
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
from fantoccini.theatre.gestures import Gesture, planes
from fantoccini.theatre.retarget.deviations import GROUPS, PartError, errors_of, report_of
from fantoccini.theatre.retarget.following import (
    INTERVAL,
    crossings_in,
    driven,
    eased,
    lead_along,
    smoothed,
    tracks_along,
)
from fantoccini.theatre.retarget.mapping import MappingFile
from fantoccini.theatre.retarget.placing import Placing
from fantoccini.theatre.retarget.retargeting import (
    LEANS,
    WEIGHTS,
    PlacedClip,
    Retargeted,
    place_clip,
    places_in,
    retarget_clip,
)

BEGINS, OVER = "begins", "over"
"""Marks of the clip's first and last frame."""
_MAX_RATE = 30.0
"""Frame rate above which frames are left out [1/s]."""
_EASE = 0.5
"""Time over which the clip's time starts and stops [s]."""
_MIN_LEAD, _BOUND_SHARES = 0.5, (0.5, 0.25)
"""Least duration of the ways into a clip and back [s], and their shares of the bounds."""
_REST_TIME = 0.02
"""Duration of rest at the end [s]."""
_STOP_TIME = 0.6
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
    retargeted: Retargeted
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

    The motion over the floor and the turning about the vertical are removed: the hips stay above
    their place, and the trunk keeps its heading.

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
        every = max(1, int((len(clip.t) - 1) / (clip.duration * _MAX_RATE) + 1e-3))
        clip = dataclasses.replace(
            clip,
            t=clip.t[::every],
            positions=clip.positions[::every],
            rotations=clip.rotations[::every],
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
        faster: speed of the clip itself; the ways into it and back keep theirs.
        lasts: duration of the whole gesture instead [s].
        speed, acceleration: bounds of the driven coordinates, along any direction of ends that
            move over the floor [m/s or rad/s, m/s^2 or rad/s^2].

    Raises:
        StateError: the puppet cannot begin there, an end does not move along both x and y, or the
            ways alone take longer than ``lasts``.
    """
    check_positive(faster=faster, speed=speed, acceleration=acceleration)
    first: ClipGesture | None = None
    for lean in LEANS:
        gesture = _gesture_with_lean(
            dataclasses.replace(placed, lean=lean), faster, lasts, speed, acceleration
        )
        if not gesture.crossings:
            return gesture
        first = first or gesture
    assert first is not None
    return first


def _gesture_with_lean(
    placed: PlacedClip, faster: float, lasts: float | None, speed: float, acceleration: float
) -> ClipGesture:
    marionette = placed.figure.marionette
    start = placed.start.replace(t=0.0)
    home = places_in(placed.figure, marionette.poses(start.q_D[None], start.q_K[None]))
    retargeted = retarget_clip(marionette, placed)
    dip = max(
        float(np.max(home[foot][0, 2] - retargeted.hung[foot][:, 2])) for foot in GROUPS["feet"]
    )
    if dip > 0.0:
        retargeted = retarget_clip(marionette, _raised(placed, dip))
    parts, q_K = smoothed(retargeted)
    ways = _lead_times(retargeted, q_K, start, speed, acceleration)
    if lasts is not None:
        faster = _faster(retargeted, lasts, sum(ways) + _STOP_TIME)
    own = eased(retargeted.t / faster, _EASE)
    t, frames = _clock(own, ways)
    tracks = tracks_along(
        retargeted.figure,
        t,
        {part: _joined(home[part][0], parts[part], t, frames) for part in WEIGHTS},
        _joined(start.q_K, q_K, t, frames),
    )
    bounds = _every_way(marionette, speed, acceleration)
    acc_K, _ = lead_along(marionette, start, float(t[-1]), tracks, *bounds)
    gesture = Gesture.of_input(driven(marionette, start, acc_K), name=placed.clip.name)
    slow = {"speed": speed * _BOUND_SHARES[0], "acceleration": acceleration * _BOUND_SHARES[1]}
    gesture = gesture.then(Gesture.rest(marionette.coordinates, _REST_TIME), **slow)
    at = t[frames]
    if at[-1] > gesture.duration:
        raise StateError(f"{placed.clip.name}: the puppet's run stops at {gesture.duration:.2f} s")
    marks = {BEGINS: float(at[0]), OVER: float(at[-1])}
    gesture = dataclasses.replace(gesture, name=placed.clip.name, marks=marks)
    if lasts is not None:
        at = at * lasts / gesture.duration
        gesture = gesture.lasting(lasts)
    run = simulate(marionette, start, gesture.inputs(start), effort=False, throw=False)
    report = report_of(retargeted, errors_of(retargeted, run, at))
    return ClipGesture(gesture, retargeted, at, run, report, crossings_in(marionette, run))


class TooShortError(StateError):
    """A clip would last no longer than the ways into it and back.

    Args:
        name: name of the clip.
        lasts: wanted duration [s].
        ways: duration of the ways [s].
        beat: duration of a beat, in which the message gives times; in seconds by default [s].
    """

    def __init__(self, name: str, lasts: float, ways: float, beat: float | None = None):
        self.name, self.lasts, self.ways = name, lasts, ways
        unit, scale = ("s", 1.0) if beat is None else ("beats", beat)
        super().__init__(
            f"found {lasts / scale:.3g} {unit} for {name}; needed: more than {ways / scale:.3g} "
            f"{unit}, which the ways into it and back take"
        )


def _raised(placed: PlacedClip, by: float) -> PlacedClip:
    """The clip with all targets raised [m]."""
    up = np.array([0.0, 0.0, by])
    shift = np.zeros((3, 4))
    shift[:, 3] = up
    places = placed.places
    return dataclasses.replace(
        placed,
        places=Placing(
            {part: path + up for part, path in places.parts.items()},
            {part: frame + shift for part, frame in places.frames.items()},
            places.scale,
        ),
    )


def _faster(clip: Retargeted, lasts: float, others: float) -> float:
    """Speed of the clip with which it and the other parts last a given time [s]."""
    own = lasts - others
    if own <= 0.0:
        raise TooShortError(clip.clip.name, lasts, others)
    return float(clip.t[-1]) / max(own - _EASE, 0.5 * own)


def _every_way(
    marionette: Marionette, speed: float, acceleration: float
) -> tuple[dict[str, float], dict[str, float]]:
    """Bounds by coordinate; ends that move over the floor keep theirs along any direction."""
    table = marionette.coordinates
    share = np.ones(table.n_vK)
    for x, y in planes(table, np.ones(table.n_vK, dtype=bool)):
        share[[x, y]] = np.sqrt(0.5)
    return (
        dict(zip(table.v_K, (speed * share).tolist(), strict=True)),
        dict(zip(table.v_K, (acceleration * share).tolist(), strict=True)),
    )


def _lead_times(
    retargeted: Retargeted, q_K: Array, start: State, speed: float, acceleration: float
) -> tuple[float, float]:
    """Durations of the ways into the first pose and back from the last [s]."""
    scalars = [q for q, _ in retargeted.marionette.coordinates.scalars_K]
    times = []
    for pose in (q_K[0], q_K[-1]):
        way = float(np.max(np.abs((pose - start.q_K)[scalars]), initial=0.0))
        times.append(
            max(
                _MIN_LEAD,
                polynomial.minimum_jerk_duration(
                    way, _BOUND_SHARES[0] * speed, _BOUND_SHARES[1] * acceleration
                ),
            )
        )
    return times[0], times[1]


def _clock(own: Times, ways: tuple[float, float]) -> tuple[Times, slice]:
    """Times of the ways and the clip's frames, and the slice of the clip's."""
    count = [int(np.ceil(way / INTERVAL)) for way in ways]
    into = np.linspace(0.0, ways[0], count[0] + 1)[:-1]
    back = np.linspace(0.0, ways[1], count[1] + 1)[1:]
    clip = ways[0] + own - own[0]
    return np.concatenate([into, clip, clip[-1] + back]), slice(count[0], count[0] + len(own))


def _joined(home: Array, clip: Array, t: Times, frames: slice) -> Array:
    """(n, ...) values from home into the clip's, through them, and back."""
    begins, over = t[frames][0], t[frames][-1]
    into, back = t[: frames.start] / begins, (t[frames.stop :] - over) / (t[-1] - over)

    def way(a: Array, b: Array, s: Times) -> Array:
        share, _, _ = polynomial.minimum_jerk(s)
        return np.asarray(a + share[:, None] * (b - a))

    return np.concatenate([way(home, clip[0], into), clip, way(clip[-1], home, back)])
