"""Ten motions of a person of 1.7 m who stands, moves and stands again.

A motion sets a few functions of time: the position of the hips, turns of pelvis, spine and head,
wrists as seen from the shoulders, and balls of the feet; elbows and knees follow from the lengths
of the limbs. In metres, y up: the person looks along +z and has its left at +x.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from fantoccini.base import polynomial
from fantoccini.base.arrays import Array

SIDES = ("Left", "Right")
OUTWARD_SIGNS = np.array([1.0, -1.0])
"""Outward direction along x, by side."""

POINTS = {
    "hips": (0.0, 0.93, 0.0),
    "spine": (0.0, 1.02, -0.01),
    "spine1": (0.0, 1.14, -0.015),
    "chest": (0.0, 1.26, -0.01),
    "neck": (0.0, 1.43, 0.0),
    "head": (0.0, 1.51, 0.01),
    "top": (0.0, 1.70, 0.01),
    "collar": (0.03, 1.40, 0.0),
    "shoulder": (0.18, 1.40, 0.0),
    "elbow": (0.46, 1.40, 0.0),
    "wrist": (0.71, 1.40, 0.0),
    "knuckles": (0.80, 1.40, 0.0),
    "fingers": (0.88, 1.40, 0.0),
    "thumb": (0.76, 1.40, 0.05),
    "hip": (0.09, 0.87, 0.0),
    "knee": (0.09, 0.46, 0.0),
    "ankle": (0.09, 0.07, 0.0),
    "ball": (0.09, 0.015, 0.12),
    "toes": (0.09, 0.015, 0.18),
}
"""Places of the joints in the T pose, for the left side [m]."""
STANDING = 0.925
"""Height of the hips of a standing person [m]."""


def joint_position(name: str, side: int = 0) -> Array:
    """(3,) place of a joint in the T pose; side 1 is the right one."""
    return np.array(POINTS[name]) * (OUTWARD_SIGNS[side], 1.0, 1.0)


def joint_distance(a: str, b: str) -> float:
    """Distance of two joints [m]."""
    return float(np.linalg.norm(joint_position(a) - joint_position(b)))


ARM = joint_distance("shoulder", "elbow") + joint_distance("elbow", "wrist")


class Pose:
    """Variables of a motion at times t; first axes of length two are left and right.

    Attributes:
        hips: (T, 3) place [m].
        pelvis, spine, head: (T, 3) turns forward, to the left side and about the vertical to the
            left [deg]: of the pelvis in the world, of the chest and the head in what is below.
        wrists: (2, T, 3) places of the wrists from the shoulders, in the world's axes [m].
        elbows: (2, 3) directions towards which the elbows point.
        balls: (2, T, 3) places of the balls of the feet [m].
        heels: (2, T) angles by which the heels are lifted about the balls [deg].
        knees: (2, 3) directions towards which the knees point.
    """

    def __init__(self, t: Array):
        frames = len(t)
        self.hips = np.tile([0.0, STANDING, 0.0], (frames, 1))
        self.pelvis, self.spine, self.head = (np.zeros((frames, 3)) for _ in range(3))
        self.wrists = np.stack([arm(np.full(frames, 4.0), 9.0, 0.975, side) for side in (0, 1)])
        self.elbows = np.array([[0.3, -0.6, -0.7], [-0.3, -0.6, -0.7]])
        self.balls = np.stack(
            [np.tile(joint_position("ball", side), (frames, 1)) for side in (0, 1)]
        )
        self.heels = np.zeros((2, frames))
        self.knees = np.array([[0.1, 0.0, 1.0], [-0.1, 0.0, 1.0]])


def arm(forward: Array | float, out: Array | float, reach: Array | float, side: int) -> Array:
    """(T, 3) wrist from the shoulder: a hanging arm lifted forward and out [deg].

    Args:
        forward: angle: 0 down, 90 forward, 180 up.
        out: angle: 0 in the plane of the chest's side, 90 straight out.
        reach: distance of the wrist, relative to the arm's length.
        side: 0 left, 1 right.
    """
    forward, out, reach = np.broadcast_arrays(np.radians(forward), np.radians(out), reach)
    return (ARM * reach)[:, None] * np.stack(
        [
            OUTWARD_SIGNS[side] * np.sin(out),
            -np.cos(out) * np.cos(forward),
            np.cos(out) * np.sin(forward),
        ],
        axis=-1,
    )


def smooth_step(u: Array | float) -> Array:
    """A step from 0 at u = 0 to 1 at u = 1, with two vanishing derivatives at both."""
    return polynomial.minimum_jerk(np.clip(u, 0.0, 1.0))[0]


def pulse(t: Array, start: float, stop: float, ramp: float) -> Array:
    """1 from start to stop, 0 before and after, with ramps inside [s]."""
    return smooth_step((t - start) / ramp) * smooth_step((stop - t) / ramp)


def interpolated(place: Array, other: Array, part: Array) -> Array:
    """Interpolation from one path to another."""
    return place + part[..., None] * (other - place)


# The motions: functions of time that set a pose.


def wave(t: Array, pose: Pose) -> None:
    """The right hand is lifted and waves at 1.75 Hz."""
    up, swing = pulse(t, 0.4, 5.6, 0.9), pulse(t, 1.2, 4.8, 0.5)
    waving = 0.13 * swing * np.sin(2.0 * np.pi * 1.75 * t)
    high = np.stack([-0.27 - waving, 0.30 - 2.0 * waving**2, np.full_like(t, 0.12)], axis=-1)
    pose.wrists[1] = interpolated(pose.wrists[1], high, up)
    pose.wrists[1, :, 2] += 0.9 * up * (1.0 - up)  # in front of the body, not through it
    pose.elbows[1] = (-0.6, -1.0, -0.5)
    pose.spine[:, 1] = 3.0 * up
    pose.head[:, 1] = -6.0 * up
    pose.hips[:, 0] = 0.015 * up


def bow(t: Array, pose: Pose) -> None:
    """The trunk bends by 60 degrees, stays and comes up."""
    down = pulse(t, 0.5, 5.5, 1.7)
    pose.pelvis[:, 0], pose.spine[:, 0], pose.head[:, 0] = 33.0 * down, 27.0 * down, 12.0 * down
    pose.hips += down[:, None] * (0.0, -0.02, -0.10)
    for side in (0, 1):
        pose.wrists[side] = interpolated(
            pose.wrists[side], arm(14.0 + 0.0 * t, 6.0, 0.96, side), down
        )


def curtsey(t: Array, pose: Pose) -> None:
    """The right foot goes behind the left one, the knees bend and the hands spread a skirt."""
    step, down = pulse(t, 0.5, 6.5, 1.2), pulse(t, 1.5, 5.5, 1.5)
    pose.balls[1] += step[:, None] * (0.15, 0.0, -0.27)
    pose.balls[1, :, 1] += 0.16 * step * (1.0 - step)
    pose.heels[1] = 38.0 * step
    pose.hips += step[:, None] * (0.03, -0.035, -0.06) + down[:, None] * (0.0, -0.17, 0.0)
    pose.knees = np.array([[0.35, 0.0, 1.0], [-0.35, 0.0, 1.0]])
    pose.pelvis[:, 0], pose.spine[:, 0], pose.head[:, 0] = 6.0 * down, 9.0 * down, 18.0 * down
    for side in (0, 1):
        pose.wrists[side] = arm(4.0 + 2.0 * step, 9.0 + 29.0 * step, 0.975 - 0.03 * step, side)


class Steps(NamedTuple):
    """A gait: its phase, 1 per cycle of two steps, its amplitude, and the distance covered [m]."""

    phase: Array
    share: Array
    way: Array


def set_gait(
    t: Array,
    pose: Pose,
    cadence: float,
    stride: float,
    lift: tuple[float, float],
    push: float,
    *,
    knee: float = 0.0,
    hang: float = 0.0,
    duty: float = 0.6,
) -> Steps:
    """Sets hips and feet of a gait: of a foot on the ground only the heel moves.

    Args:
        t: times [s].
        pose: pose to set.
        cadence: cycles per second.
        stride: distance per cycle [m].
        lift: height of left and right ball in the swing [m].
        push: angle of the heel when the foot leaves [deg].
        knee: forward motion of the foot in the swing, in addition to the stride [m].
        hang: angle of the foot in the swing [deg].
        duty: share of the cycle in which a foot is on the ground.
    """
    front = 0.38 * duty
    phase = cadence * (t - 0.6)
    last = phase[-1] - 0.6 * cadence
    grid = np.linspace(min(phase[0], -2.0) - 2.0, phase[-1] + 2.0, 4000)
    rate = stride * pulse(grid, 0.0, last, 1.5)
    way = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * np.diff(grid))])
    share, gone = pulse(phase, 0.0, last, 1.0), np.interp(phase, grid, way)
    for side, offset in enumerate((0.25, 0.75)):
        cycle = phase + offset + front
        count = np.floor(cycle)
        down = cycle - count
        u = np.clip((down - duty) / (1.0 - duty), 0.0, 1.0)
        here, there = (np.interp(count + k - offset, grid, way) for k in (0, 1))
        hop = share * np.sin(np.pi * u) ** 2
        pose.balls[side, :, 2] += here + (there - here) * u**2 * (3.0 - 2.0 * u) + knee * hop
        pose.balls[side, :, 1] += lift[side] * hop
        leaving = smooth_step((down - duty + 0.3) / 0.4) * (1.0 - smooth_step((u - 0.15) / 0.7))
        pose.heels[side] = push * share * leaving + hang * hop
    pose.hips[:, 2] += gone
    return Steps(phase, share, gone)


def set_arm_swing(pose: Pose, steps: Steps, middle: float, swing: float, reach: float) -> None:
    """Sets arms that swing opposite to the legs [deg]."""
    for side, sign in enumerate((1.0, -1.0)):
        turn = sign * np.cos(2.0 * np.pi * steps.phase)
        forward = 4.0 + steps.share * (middle - 4.0 + swing * turn)
        bent = 0.975 + steps.share * (reach - 0.975 - 0.02 * turn)
        pose.wrists[side] = arm(forward, 9.0, bent, side)


def walk(t: Array, pose: Pose) -> None:
    """A walk of 1.2 m/s at 120 steps a minute."""
    steps = set_gait(t, pose, 1.0, 1.2, (0.07, 0.07), 52.0)
    angle, share = 2.0 * np.pi * steps.phase, steps.share
    pose.hips[:, 1] -= share * (0.04 + 0.018 * np.cos(2.0 * angle))
    pose.hips[:, 0] -= share * 0.02 * np.sin(angle)
    pose.pelvis[:, 2], pose.spine[:, 2] = 6.0 * share * np.cos(angle), -11.0 * share * np.cos(angle)
    pose.pelvis[:, 1], pose.spine[:, 0] = 2.0 * share * np.sin(angle), 3.0 * share
    set_arm_swing(pose, steps, 2.0, 21.0, 0.965)


def march(t: Array, pose: Pose) -> None:
    """Marching on the spot at 100 steps a minute, with high knees."""
    steps = set_gait(
        t, pose, 100.0 / 120.0, 0.0, (0.27, 0.27), 15.0, knee=0.10, hang=28.0, duty=0.52
    )
    angle = 2.0 * np.pi * steps.phase
    pose.hips[:, 1] += steps.share * (-0.008 + 0.008 * np.cos(2.0 * angle))
    pose.hips[:, 0] -= steps.share * 0.025 * np.sin(angle)
    pose.spine[:, 2] = -5.0 * steps.share * np.cos(angle)
    set_arm_swing(pose, steps, 10.0, 32.0, 0.95)


def zombie(t: Array, pose: Pose) -> None:
    """A lurching walk with both arms stretched forward; the right leg drags."""
    steps = set_gait(t, pose, 0.6, 0.62, (0.07, 0.02), 22.0, duty=0.68)
    angle, share = 2.0 * np.pi * steps.phase, steps.share
    pose.hips[:, 1] -= share * (0.04 - 0.02 * np.sin(angle))
    pose.hips[:, 2] += share * 0.03 * np.sin(2.0 * angle)
    pose.hips[:, 0] -= share * 0.045 * np.sin(angle)
    pose.pelvis[:, 1] = share * 4.0 * np.sin(angle)
    pose.spine[:] = share[:, None] * np.stack(
        [14.0 + 4.0 * np.sin(2.0 * angle), 9.0 * np.sin(angle + 0.6), 6.0 * np.cos(angle)], axis=-1
    )
    pose.head[:, 0], pose.head[:, 1] = -8.0 * share, share * (14.0 + 6.0 * np.sin(angle))
    for side, height in enumerate((94.0, 82.0)):
        sway = 5.0 * np.sin(2.0 * angle + 1.5 * side)
        forward = 4.0 + share * (height - 4.0 + sway)
        pose.wrists[side] = arm(forward, 9.0 - 5.0 * share, 0.975 - 0.01 * share, side)


def dance(t: Array, pose: Pose) -> None:
    """The hips sway from side to side while the arms wave low, then high."""
    share, high = pulse(t, 0.5, 8.5, 1.2), smooth_step((t - 3.8) / 1.4)
    angle = 2.0 * np.pi * 0.8 * (t - 0.5)
    side_to_side = share * np.sin(angle)
    pose.balls[..., 0] += (
        OUTWARD_SIGNS[:, None] * 0.07 * smooth_step((t - 0.2) / 1.0) * smooth_step((8.8 - t) / 1.0)
    )
    for side in (0, 1):
        free = share * np.clip(-OUTWARD_SIGNS[side] * np.sin(angle), 0.0, None) ** 3
        pose.heels[side] = 26.0 * free
    pose.hips[:, 0] += 0.085 * side_to_side
    pose.hips[:, 1] -= share * (0.045 - 0.02 * np.cos(2.0 * angle))
    pose.pelvis[:, 1], pose.pelvis[:, 2] = 5.0 * side_to_side, 8.0 * share * np.cos(angle)
    pose.spine[:, 1], pose.spine[:, 2] = -12.0 * side_to_side, -14.0 * share * np.cos(angle)
    pose.head[:, 1] = 7.0 * side_to_side
    for side in (0, 1):
        wave_ = np.sin(angle + 0.9 * OUTWARD_SIGNS[side])
        out = 9.0 + share * (51.0 + 85.0 * high + (20.0 - 8.0 * high) * wave_)
        forward = 4.0 + share * (24.0 + 12.0 * np.cos(angle) * OUTWARD_SIGNS[side])
        bent = 0.975 - share * (0.09 - 0.05 * wave_)
        pose.wrists[side] = arm(forward * np.cos(np.radians(out)), out, bent, side)


def jumping_jack(t: Array, pose: Pose) -> None:
    """Jumping jacks at 60 per minute, each of two jumps of 10 cm."""
    share = pulse(t, 0.5, 7.5, 1.0)
    height, flight, hop = 0.10, 2.0 * np.sqrt(2.0 * 0.10 / 9.81), 0.5
    when = t - 0.5
    count = np.floor(when / hop)
    u = when - count * hop
    contact = hop - flight
    dip = 4.0 * height * contact / (np.pi * flight)  # as fast as the fall where the feet touch
    air = np.clip((u - contact) / flight, 0.0, 1.0)
    above = share * 4.0 * height * air * (1.0 - air)
    below = share * dip * np.sin(np.pi * np.clip(u / contact, 0.0, 1.0))
    apart = share * np.where(count % 2 == 0, smooth_step(air), 1.0 - smooth_step(air))
    pose.hips[:, 1] += above - below - share * 0.03
    pose.balls[..., 0] += OUTWARD_SIGNS[:, None] * 0.19 * apart
    pose.balls[..., 1] += 0.9 * above
    pose.heels[:] = 32.0 * share * np.sin(np.pi * air) ** 2
    pose.spine[:, 0] = 300.0 * below**2
    lifted = share * (1.0 - np.cos(2.0 * np.pi * when)) / 2.0
    for side in (0, 1):
        pose.wrists[side] = arm(4.0 * (1.0 - lifted), 9.0 + 156.0 * lifted, 0.975, side)
    pose.elbows[..., 1] = -0.1


def sit(t: Array, pose: Pose) -> None:
    """Sits down on an imaginary chair, and gets up."""
    down, lean = pulse(t, 0.5, 7.5, 2.0), pulse(t, 0.4, 2.7, 1.1) + pulse(t, 5.3, 7.6, 1.1)
    pose.hips += down[:, None] * (0.0, -0.42, 0.0)
    pose.hips[:, 2] -= 0.40 * np.sin(np.pi / 2.0 * down)
    pose.pelvis[:, 0] = 22.0 * lean - 4.0 * down
    pose.spine[:, 0], pose.head[:, 0] = 16.0 * lean, -12.0 * lean
    for side in (0, 1):
        lap = arm(40.0 + 22.0 * lean, 4.0, 0.88, side)
        pose.wrists[side] = interpolated(pose.wrists[side], lap, down)


def conduct(t: Array, pose: Pose) -> None:
    """Both arms beat four in a bar at 90 beats a minute, as mirror images."""
    share = pulse(t, 0.4, 8.6, 1.1)
    # Wrists from the shoulders, at the beats and half-way between: down, in, out, up.
    beats = np.array(
        [
            (0.02, -0.33, 0.34),
            (0.03, -0.20, 0.36),
            (-0.11, -0.29, 0.34),
            (-0.02, -0.17, 0.36),
            (0.20, -0.28, 0.33),
            (0.13, -0.13, 0.36),
            (0.05, -0.22, 0.37),
            (0.05, 0.08, 0.37),
            (0.02, -0.33, 0.34),
        ]
    )
    pattern = CubicSpline(np.arange(9.0), beats, bc_type="periodic")
    path = pattern(np.mod((t - 0.6) * 3.0, 8.0))  # two knots a beat, 1.5 beats a second
    for side in (0, 1):
        pose.wrists[side] = interpolated(
            pose.wrists[side], path * (OUTWARD_SIGNS[side], 1.0, 1.0), share
        )
    pose.elbows[:] = OUTWARD_SIGNS[:, None] * (0.6, 0.0, 0.0) + (0.0, -0.9, -0.35)
    beat = share * np.cos(2.0 * np.pi * 1.5 * (t - 0.6))
    pose.head[:, 0], pose.hips[:, 1] = 4.0 * beat, pose.hips[:, 1] - 0.006 * share + 0.004 * beat
    pose.spine[:, 0], pose.spine[:, 2] = 2.0 * share, 3.0 * share * np.sin(2.0 * np.pi * 0.375 * t)


MOTIONS: dict[str, tuple[float, Callable[[Array, Pose], None]]] = {
    "wave": (6.0, wave),
    "bow": (6.0, bow),
    "curtsey": (7.0, curtsey),
    "walk": (7.0, walk),
    "march": (8.0, march),
    "zombie": (9.0, zombie),
    "dance": (9.0, dance),
    "jumping_jack": (8.0, jumping_jack),
    "sit": (8.0, sit),
    "conduct": (9.0, conduct),
}
"""Durations [s] and motions, by name of the clip."""


def rotations_from_angles(angles: Array) -> Array:
    """(T, 3, 3) rotations by turns forward, to the side and about the vertical [deg]."""
    return Rotation.from_euler("YZX", angles[:, ::-1] * (1, -1, 1), degrees=True).as_matrix()


def limb_directions(
    target: Array, pole: Array, upper: float, lower: float
) -> tuple[Array, Array, Array]:
    """(T, 3) directions of the two parts of a limb that ends at target, and its hinge's axis.

    Args:
        target: (T, 3) end of the limb from its root [m].
        pole: (3,) or (T, 3) direction towards which its middle joint points.
        upper: length of the part at the root [m].
        lower: length of the other [m].
    """
    distance = np.linalg.norm(target, axis=1, keepdims=True)
    along = target / distance
    distance = np.minimum(distance, 0.9995 * (upper + lower))
    side = pole - np.sum(pole * along, axis=1, keepdims=True) * along
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    part = (upper**2 - lower**2 + distance**2) / (2.0 * distance)
    middle = part * along + np.sqrt(np.maximum(upper**2 - part**2, 0.0)) * side
    return middle / upper, (distance * along - middle) / lower, np.cross(side, along)


def aligning_rotations(rest: Array, rest_axis: Array, now: Array, axis: Array) -> Array:
    """(T, 3, 3) rotations that map a direction and a hinge's axis to others."""
    before = np.stack([rest, rest_axis, np.cross(rest, rest_axis)], axis=-1)
    after = np.stack([now, axis, np.cross(now, axis)], axis=-1)
    return after @ before.T


def part_rotations(pose: Pose) -> dict[str, Array]:
    """(T, 3, 3) rotations of the body's parts from the T pose, by name."""
    hips = rotations_from_angles(pose.pelvis)
    parts = {"hips": hips}
    for k, name in enumerate(("spine", "spine1", "chest"), 1):
        parts[name] = hips @ rotations_from_angles(pose.spine * k / 3.0)
    parts["neck"] = parts["chest"] @ rotations_from_angles(pose.head / 2.0)
    parts["head"] = parts["chest"] @ rotations_from_angles(pose.head)
    down = np.array([0.0, -1.0, 0.0])
    for side, name in enumerate(SIDES):
        straight = np.array([OUTWARD_SIGNS[side], 0.0, 0.0])
        hinge = np.cross([0.0, 0.0, -1.0], straight)
        upper, lower, axis = limb_directions(
            pose.wrists[side],
            pose.elbows[side],
            joint_distance("shoulder", "elbow"),
            joint_distance("elbow", "wrist"),
        )
        parts[f"arm{name}"] = aligning_rotations(straight, hinge, upper, axis)
        parts[f"forearm{name}"] = aligning_rotations(straight, hinge, lower, axis)
        foot = rotations_from_angles(
            np.stack([pose.heels[side], *[0.0 * pose.heels[side]] * 2], axis=-1)
        )
        ankle = pose.balls[side] + foot @ (joint_position("ankle") - joint_position("ball"))
        root = pose.hips + hips @ (joint_position("hip", side) - joint_position("hips"))
        upper, lower, axis = limb_directions(
            ankle - root,
            hips @ pose.knees[side],
            joint_distance("hip", "knee"),
            joint_distance("knee", "ankle"),
        )
        hinge = np.array([1.0, 0.0, 0.0])
        parts[f"thigh{name}"] = aligning_rotations(down, hinge, upper, axis)
        parts[f"shin{name}"] = aligning_rotations(down, hinge, lower, axis)
        parts[f"foot{name}"] = foot
    parts["toes"] = np.broadcast_to(np.eye(3), hips.shape)  # they stay level
    return parts
