"""Kinematic inputs: motions of the hands from inverse kinematics, with no simulation.

The baseline for :func:`follow_clip`: K. Yamane, J. K. Hodgins and H. B. Brown,
"Controlling a marionette with human motion capture data", ICRA 2003. Inverse kinematics over the
puppet's pose, with its strings taut and vertical:

    min over q_D of  sum_i w_i |x_i(q_D) - x_i,clip|^2 + w_V V(q_D) / (m g),   limits h(q_D) <= 0
    upper end: straight above the tie,   length = height of the upper end above the tie

V lowers parts that nothing holds as far as possible. The upper ends of the hands' strings then pass
through the inverse of the hands' swing (:mod:`benchmarks.capture.swing`).

Differences from the paper: poses are found from positions, with weights instead of two
priorities of velocities; all strings' upper ends move, not only those of the hands, and all strings
are vertical; the clip is placed as in :func:`retarget_clip`, not by a similarity for each frame;
motors do not lag; the feed-forward acts on the upper ends, not on the markers before inverse
kinematics; and it has no lag unless ``lag`` is given, since the clip is known
beforehand. Like the paper's, it assumes that hands hang vertically below their upper ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from benchmarks.capture.swing import Swing, hand_strings, lead
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from fantoccini.base.arrays import Array, Times, check_positive
from fantoccini.base.errors import StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.theatre.retarget.following import MAX_ACCELERATION, MAX_SPEED, eased_times
from fantoccini.theatre.retarget.retargeting import (
    PART_WEIGHTS,
    RetargetedClip,
    TiedString,
    part_positions,
    tied_strings,
    vertical_strings,
)

_POTENTIAL = 1e-3
"""w_V [m]."""
_LIMIT = 1.0
"""Weight of violated limits."""
_DAMPING = 1e-4
"""Weight of a step to the next pose: free parts stay."""
_FIRST, _NEXT = 200, 6
"""Iterations for the first frame, and for each later one, from the previous."""
_NUDGE = 1e-6
"""Step of finite differences [rad or m]."""
_DT = 0.01
"""Time step of the inputs [s]."""
_SETTLE = 6.0
"""Number of lags for which the inputs continue after the clip's end."""
_WIDTH, _WIDER = 0.035, 1.1
"""Standard deviation of the smoothing [s], and its growth factor until bounds hold."""


@dataclass(frozen=True, eq=False)
class KinematicMotion:
    """Motions of the hands by inverse kinematics.

    Attributes:
        retargeted: the clip; its hanging poses are only used for the state at the start.
        times: (n,) times of the poses, with the interval of the clip's frames [s].
        q_D: (n, n_qD) poses.
        errors: part -> (n,) distance of the poses from the part's target [m].
        inputs: the motion of the hands.
        widths: string -> standard deviation of the smoothing with which bounds hold [s].
        t: (T,) times of the clip's frames in the run, as in :class:`FollowResult` [s].
    """

    retargeted: RetargetedClip
    times: Times
    q_D: Array
    errors: Mapping[str, Array]
    inputs: Input
    widths: Mapping[str, float]
    t: Times

    @property
    def start(self) -> State:
        """The state in which the puppet hangs at rest at the start of the inputs."""
        clip = self.retargeted
        q_K = self.inputs.evaluate(clip.start.t)[0]
        return clip.marionette.rest(clip.start.replace(q_K=q_K))


def kinematic_inputs(
    retargeted: RetargetedClip,
    feed_forward: bool | Swing = True,
    *,
    lag: float = 0.0,
    speed: float = MAX_SPEED,
    acceleration: float = MAX_ACCELERATION,
) -> KinematicMotion:
    """The motion of the hands by inverse kinematics and swing feed-forward; see the module.

    Each string's path is smoothed by the narrowest Gaussian, from 0.035 s up, with which the bounds
    hold.

    Args:
        retargeted: the clip.
        feed_forward: True for pendulums of the string's length, a = L/g and b = 0; an
            identified swing (:func:`identify_swing`); False for none.
        lag: T of 1/(T s + 1)^3 on the paths of all parts, which the paper needs for live use, with
            T = 0.2 s; the puppet is then late by about 3 T [s].
        speed, acceleration: bounds of the driven coordinates [m/s, m/s^2].

    Raises:
        StateError: the clip has one frame, or its strings cannot follow within the bounds.
    """
    check_positive(speed=speed, acceleration=acceleration, **({"lag": lag} if lag else {}))
    if len(retargeted.t) < 2:
        raise StateError("kinematic_inputs: the clip has one frame; needed: two or more")
    marionette, start = retargeted.marionette, retargeted.start
    figure, t, places = retargeted.figure, eased_times(retargeted.t), retargeted.targets.parts
    frame = float(np.median(np.diff(t)))
    at = frame * np.arange(int(np.ceil((t[-1] + _SETTLE * lag) / frame - 1e-9)) + 1, dtype=float)
    wanted = CubicSpline(t, np.stack([places[part] for part in PART_WEIGHTS], axis=1))(
        np.minimum(at, t[-1])
    )
    for _ in range(3 if lag else 0):
        wanted = _with_lag(wanted, frame / lag)
    q_D = poses_near(retargeted, wanted)
    poses = marionette.poses(q_D, np.broadcast_to(start.q_K, (len(q_D), len(start.q_K))))
    positions = part_positions(figure, poses)
    errors = {
        part: np.linalg.norm(positions[part] - wanted[:, i], axis=1)
        for i, part in enumerate(PART_WEIGHTS)
    }
    frames = {part: poses[:, marionette.link_index(body)] for part, body in figure.bodies.items()}
    times = _DT * np.arange(int(np.ceil(at[-1] / _DT - 1e-9)) + 1, dtype=float)
    above = vertical_strings(figure, frames, start)
    hands = [string.name for string in hand_strings(figure, start)]
    columns: dict[str, Array] = {}
    widths = {}
    for string in tied_strings(figure, start):
        names = [*string.ends, *filter(None, [string.length])]
        if not names:
            continue
        path = CubicSpline(at, np.stack([above[name] for name in names], axis=1))
        values = path(np.minimum(times, at[-1]))
        ahead = _leader(string, feed_forward, marionette) if string.name in hands else None
        smooth_path, widths[string.name] = _bounded_paths(values, ahead, times, speed, acceleration)
        columns.update(zip(names, smooth_path.T, strict=True))
    inputs = Input.samples(marionette, start.t + times, columns).with_name(retargeted.clip.name)
    return KinematicMotion(retargeted, at, q_D, errors, inputs, widths, t)


def _leader(
    string: TiedString, feed_forward: bool | Swing, marionette: Marionette
) -> Callable[[Array], Array] | None:
    """The feed-forward of a hand's string: (T, n) ends and length -> the same, with ends led."""
    if feed_forward is False:
        return None
    g = marionette.weight / marionette.mass

    def ahead(values: Array) -> Array:
        ends, length = values.copy(), values[:, -1]
        for i, (name, axis) in enumerate(string.ends.items()):
            if abs(axis[2]) < 1e-6:  # hands swing only horizontally
                ends[:, i] = (
                    feed_forward.lead(name, values[:, i], length, _DT)
                    if isinstance(feed_forward, Swing)
                    else lead(values[:, i], _DT, length / g)
                )
        return ends

    return ahead


def _with_lag(values: Array, h: float) -> Array:
    """(T, ...) behind a lag 1/(T s + 1), with a time step of h T."""
    filtered, decay = values.copy(), np.exp(-h)
    for i in range(1, len(filtered)):
        filtered[i] = decay * filtered[i - 1] + (1.0 - decay) * values[i]
    return filtered


def _bounded_paths(
    values: Array,
    ahead: Callable[[Array], Array] | None,
    times: Times,
    speed: float,
    acceleration: float,
) -> tuple[Array, float]:
    """(T, n) smooth paths within bounds, and the width of their smoothing [s]."""
    width = _WIDTH
    fine = np.linspace(times[0], times[-1], 4 * len(times))
    while width < 10.0 + times[-1]:
        smoothed = gaussian_filter1d(values, width / _DT, axis=0, mode="nearest")
        smoothed = smoothed if ahead is None else ahead(smoothed)
        spline = CubicSpline(times, smoothed, bc_type="clamped")
        fits = np.abs(spline(fine, 1)).max() <= speed
        if fits and np.abs(spline(times, 2)).max() <= acceleration:
            return smoothed, width
        width *= _WIDER
    raise StateError(
        f"kinematic_inputs: a string cannot follow within {speed:g} m/s and {acceleration:g} m/s^2"
    )


def poses_near(retargeted: RetargetedClip, wanted: Array) -> Array:
    """(n, n_qD) poses nearest to places, each starting from the previous.

    Args:
        retargeted: the clip.
        wanted: (n, parts, 3) targets of the parts of WEIGHTS [m].
    """
    marionette, figure = retargeted.marionette, retargeted.figure
    n, n_strings = marionette.coordinates.n_vD, len(marionette.tree.strings)
    q_K = np.broadcast_to(retargeted.start.q_K, (n + 1, len(retargeted.start.q_K)))
    still = {"v_D": np.zeros((n + 1, n)), "v_K": np.zeros((n + 1, marionette.coordinates.n_vK))}
    nudges = np.vstack([np.zeros(n), _NUDGE * np.eye(n)])
    scale = np.sqrt(list(PART_WEIGHTS.values()))[:, None]

    def step(q: Array, target: Array) -> Array:
        """(n,) Gauss-Newton step at a pose."""
        near = marionette.integrate(q, nudges)
        places = part_positions(figure, marionette.poses(near, q_K))
        off = np.stack([places[part] for part in PART_WEIGHTS], axis=1) - target
        at = {"q_D": near, "q_K": q_K, "p": marionette.p}
        h = marionette.library.evaluate("rows", **at).h[:, n_strings:]
        V = marionette.library.evaluate("energy", **at, **still).V.ravel() / marionette.weight
        r = np.hstack([(scale * off).reshape(n + 1, -1), _LIMIT * np.maximum(h, 0.0)])
        J, slope = (r[1:] - r[0]).T / _NUDGE, (V[1:] - V[0]) / _NUDGE
        return -np.linalg.solve(
            J.T @ J + _DAMPING * np.eye(n), J.T @ r[0] + 0.5 * _POTENTIAL * slope
        )

    q, pose_list = marionette.rest().q_D, []
    for i, target in enumerate(wanted):
        for _ in range(_NEXT if i else _FIRST):
            q = marionette.integrate(q, step(q, target))
        pose_list.append(q)
    return np.stack(pose_list)
