"""Clips as gestures: from where a puppet hangs into a clip, through it on the spot, and back.

    x_i(t) = x_i,hang + s(t / T) (x_i,clip(0) - x_i,hang),   s = minimum jerk

leads into the clip's first pose, and likewise back from its last. The hands follow all of it as
those of :func:`follow_clip` do, within bounds that hold whichever way the puppet looks.
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
from fantoccini.theatre.retarget.following import (
    GROUPS,
    INTERVAL,
    PartError,
    crossings_in,
    driven,
    eased,
    errors_of,
    lead_along,
    report_of,
    smoothed,
    tracks_along,
)
from fantoccini.theatre.retarget.mapping import MappingFile
from fantoccini.theatre.retarget.placing import Placing
from fantoccini.theatre.retarget.retargeting import (
    LEANS,
    WEIGHTS,
    Placed,
    Retargeted,
    place_clip,
    places_in,
    retarget_clip,
)

BEGINS, OVER = "begins", "over"
"""Marks of the clip's first and last frame."""
_RATE = 30.0
"""Frames a second from which on some are left out."""
_EASE = 0.5
"""Time in which the clip's time begins to run, and comes to its end [s]."""
_LEAD, _SHARES = 0.5, (0.5, 0.25)
"""Shortest way into a clip and back [s], and the shares of the bounds that ways use."""
_BACK = 0.02
"""Duration of stillness at the end [s]."""
_AFTER = 0.6
"""Time that coming to rest after all takes at most [s]."""


@dataclass(frozen=True, eq=False)
class ClipGesture:
    """A clip as a gesture of a puppet.

    Attributes:
        gesture: the motion of the hands, from where the puppet hangs and back; its marks are
            ``begins`` and ``over``.
        retargeted: the clip on the spot, and the hanging poses nearest to it.
        t: (T,) times in the gesture of the clip's frames [s].
        run: the event-driven run of the gesture, from where the puppet hangs.
        report: errors of hands, head, feet and trunk in it, from the clip.
        crossings: of the puppet's strings in it.
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
) -> Placed:
    """Where parts are to be in a clip on the spot, with 30 frames a second or a few more.

    Left out are the way over the floor and the turning about the vertical: the hips stay above
    their place, and the trunk looks one way.

    Args:
        marionette, clip, mapping, start: see :func:`retarget_clip`.

    Raises:
        FileError: files with mistakes, or joints that are not found.
        StateError: the puppet has not the bodies of a person, or has contact.
    """
    if not isinstance(clip, Capture):
        clip = load_bvh(clip)
    if len(clip.t) > 2:
        clip = clip.without_calibration()
        every = max(1, int((len(clip.t) - 1) / (clip.duration * _RATE) + 1e-3))
        clip = dataclasses.replace(
            clip,
            t=clip.t[::every],
            positions=clip.positions[::every],
            rotations=clip.rotations[::every],
        )
    return place_clip(marionette, clip, mapping, start, travel=0.0, turning=0.0)


def clip_gesture(
    placed: Placed,
    faster: float = 1.0,
    lasts: float | None = None,
    *,
    speed: float,
    acceleration: float,
) -> ClipGesture:
    """A clip as a gesture.

    Strings lean outwards and forwards, as where the puppet hangs and more, so that they do not
    cross; by how much, is tried. The clip is raised by as much as feet would be lower than where
    the puppet hangs.

    Args:
        placed: the clip on the spot.
        faster: the clip itself plays in 1/faster of its time; the ways into it and back do not.
        lasts: how long all of it takes instead [s].
        speed, acceleration: bounds of the driven coordinates, along any direction of ends that
            move over the floor [m/s or rad/s, m/s^2 or rad/s^2].

    Raises:
        StateError: the puppet cannot begin there, an end does not move along both x and y, or the
            ways alone take longer.
    """
    check_positive(faster=faster, speed=speed, acceleration=acceleration)
    first: ClipGesture | None = None
    for lean in LEANS:
        made = _made(dataclasses.replace(placed, lean=lean), faster, lasts, speed, acceleration)
        if not made.crossings:
            return made
        first = first or made
    assert first is not None
    return first


def _made(
    placed: Placed, faster: float, lasts: float | None, speed: float, acceleration: float
) -> ClipGesture:
    marionette = placed.figure.marionette
    start = placed.start.replace(t=0.0)
    home = places_in(placed.figure, marionette.poses(start.q_D[None], start.q_K[None]))
    found = retarget_clip(marionette, placed)
    dip = max(float(np.max(home[foot][0, 2] - found.hung[foot][:, 2])) for foot in GROUPS["feet"])
    if dip > 0.0:
        found = retarget_clip(marionette, _raised(placed, dip))
    parts, q_K = smoothed(found)
    ways = _lead_times(found, q_K, start, speed, acceleration)
    if lasts is not None:
        faster = _faster(found, lasts, sum(ways) + _AFTER)
    own = eased(found.t / faster, _EASE)
    t, frames = _clock(own, ways)
    tracks = tracks_along(
        found.figure,
        t,
        {part: _joined(home[part][0], parts[part], t, frames) for part in WEIGHTS},
        _joined(start.q_K, q_K, t, frames),
    )
    bounds = _every_way(marionette, speed, acceleration)
    acc_K, _ = lead_along(marionette, start, float(t[-1]), tracks, *bounds)
    made = Gesture.of_input(driven(marionette, start, acc_K), name=placed.clip.name)
    slow = {"speed": speed * _SHARES[0], "acceleration": acceleration * _SHARES[1]}
    made = made.then(Gesture.rest(marionette.coordinates, _BACK), **slow)
    at = t[frames]
    if at[-1] > made.duration:
        raise StateError(f"{placed.clip.name}: the puppet's run stops at {made.duration:.2f} s")
    marks = {BEGINS: float(at[0]), OVER: float(at[-1])}
    made = dataclasses.replace(made, name=placed.clip.name, marks=marks)
    if lasts is not None:
        at = at * lasts / made.duration
        made = made.lasting(lasts)
    run = simulate(marionette, start, made.inputs(start), effort=False, throw=False)
    report = report_of(found, errors_of(found, run, at))
    return ClipGesture(made, found, at, run, report, crossings_in(marionette, run))


def _raised(placed: Placed, by: float) -> Placed:
    """The same higher up [m]."""
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


def _faster(found: Retargeted, lasts: float, others: float) -> float:
    """Factor by which the clip plays faster, for it and others to last a time [s]."""
    own = lasts - others
    if own <= 0.0:
        raise StateError(
            f"{found.clip.name} lasts longer than {others:.2f} s, which the ways into it and back "
            f"take; found {lasts:.2f} s"
        )
    return float(found.t[-1]) / max(own - _EASE, 0.5 * own)


def _every_way(
    marionette: Marionette, speed: float, acceleration: float
) -> tuple[dict[str, float], dict[str, float]]:
    """Bounds by coordinate: ends that move over the floor keep theirs along any direction."""
    table = marionette.coordinates
    share = np.ones(table.n_vK)
    for x, y in planes(table, np.ones(table.n_vK, dtype=bool)):
        share[[x, y]] = np.sqrt(0.5)
    return (
        dict(zip(table.v_K, (speed * share).tolist(), strict=True)),
        dict(zip(table.v_K, (acceleration * share).tolist(), strict=True)),
    )


def _lead_times(
    found: Retargeted, q_K: Array, start: State, speed: float, acceleration: float
) -> tuple[float, float]:
    """Durations of the ways into the first pose and back from the last [s]."""
    scalars = [q for q, _ in found.marionette.coordinates.scalars_K]
    times = []
    for pose in (q_K[0], q_K[-1]):
        way = float(np.max(np.abs((pose - start.q_K)[scalars]), initial=0.0))
        times.append(
            max(
                _LEAD,
                polynomial.minimum_jerk_duration(
                    way, _SHARES[0] * speed, _SHARES[1] * acceleration
                ),
            )
        )
    return times[0], times[1]


def _clock(own: Times, ways: tuple[float, float]) -> tuple[Times, slice]:
    """Times of the ways and the clip's frames, and which are the clip's."""
    count = [int(np.ceil(way / INTERVAL)) for way in ways]
    into = np.linspace(0.0, ways[0], count[0] + 1)[:-1]
    back = np.linspace(0.0, ways[1], count[1] + 1)[1:]
    clip = ways[0] + own - own[0]
    return np.concatenate([into, clip, clip[-1] + back]), slice(count[0], count[0] + len(own))


def _joined(home: Array, clip: Array, t: Times, frames: slice) -> Array:
    """(n, ...) from home into the clip's values, through them, and back."""
    begins, over = t[frames][0], t[frames][-1]
    into, back = t[: frames.start] / begins, (t[frames.stop :] - over) / (t[-1] - over)

    def way(a: Array, b: Array, s: Times) -> Array:
        share, _, _ = polynomial.minimum_jerk(s)
        return np.asarray(a + share[:, None] * (b - a))

    return np.concatenate([way(home, clip[0], into), clip, way(clip[-1], home, back)])
