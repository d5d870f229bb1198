"""Slide and height of a puppet's feet, and the distance walked, in a run of a gait.

    slide = sum over samples of   max over loaded points of |d + w x m|   horizontally

d is the displacement of a foot's origin until the next sample, w its rotation vector, and m the
place of a point relative to that origin: the mean of a point that carries load now and of the
nearest one then. On a foot that rolls the point moves, and nothing slides. A marionette is a puppet
with its compiled equations; `marionette.puppet` is the description in its file. In names, D stands
for dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and
lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from fantoccini.base import Array, Outcome, Status, rotation
from fantoccini.model.puppet import FLOOR, Box, Capsule, Ellipsoid, Mesh, Shape, Sphere, load_mesh
from fantoccini.motion import ContactPoints, Trajectory
from fantoccini.theatre.gaits.gait import CLOSING_STEPS, PREPARATION_STEPS, Gait
from fantoccini.theatre.gestures import BodyParts, foot_links, gait_phases, leg_length

MAX_STANDING_HEIGHT, MAX_SLIDING_HEIGHT = 1e-4, 3e-5
"""Heights below which a foot counts as on the floor, and as sliding on it [m]."""
_MIN_LOAD = 1e-6
"""Normal force above which a contact point carries load, relative to the weight."""
_SAME_TIME = 1e-6
"""Tolerance of the end of a run [s]."""
_MIN_UPRIGHT_COSINE = np.cos(np.radians(35.0))
"""Least cosine of the trunk's inclination relative to the start; below it the puppet falls."""
MAX_SLIDE = 2e-3
"""Largest slide of a foot in a cycle for which the puppet counts as walking [m]."""
_MAX_DISTANCE_ERROR = 0.05
"""Largest relative error of the distance for which the puppet counts as walking."""
MIN_STANDING_SHARE = 0.4
"""Least share of a cycle on the floor, of each foot, for which the puppet counts as walking."""


class WalkStatus(Outcome):
    """Outcome of a run of a gait; the gravest if several apply."""

    WALKS = "it walks the distance, and no foot slides more than 2 mm in a cycle"
    SLIDES = "it walks the distance, but a foot slides more than 2 mm in a cycle"
    HOVERS = "it does not fall, but a foot is on the floor for less than 40 % of a cycle"
    OFF_DISTANCE = "it does not fall, but its distance is more than 5 % off"
    FALLS = "it falls: its trunk tilts by more than 35 degrees"
    STOPPED = "its run ended early, or the results of the run are not sound"


@dataclass(frozen=True, eq=False)
class Footfalls:
    """Feet in a run of a gait. True if the puppet walks.

    Attributes:
        slide: (n, n_legs) distance that a foot slides on the floor, in each cycle of a leg [m]. At
            each time that of the loaded point that slides farthest counts. n is 0 if the run ends
            in the first cycle.
        lift: (n, n_legs) largest height of the foot above the floor in each cycle [m].
        stands: (n, n_legs) share of each cycle in which the foot is on the floor; NaN for a cycle
            in which the leg closes up, unless it is the first.
        distance: distance that the trunk moves forward, along its heading; below 0 backward [m].
        wanted_distance: distance of the gait's steps [m].
        distance_error: error of the distance, relative to ``wanted_distance``, or to the legs'
            length if that is longer.
        turn: angle by which the trunk turns to the left, over the run [rad].
        upright: least cosine of the trunk's inclination, relative to the start.
        run_status: status of the run; ``RUNNING`` if it ends before the gait.
    """

    slide: Array
    lift: Array
    stands: Array
    distance: float
    wanted_distance: float
    distance_error: float
    turn: float
    upright: float
    run_status: Status

    @property
    def falls(self) -> bool:
        """Whether the puppet falls."""
        return self.upright < _MIN_UPRIGHT_COSINE

    @property
    def max_slide(self) -> float:
        """Largest slide of a foot in a cycle [m]."""
        return float(self.slide.max(initial=0.0))

    @property
    def standing_share(self) -> float:
        """Least share of a cycle in which a foot is on the floor, without cycles that close up."""
        return float(np.nanmin(self.stands, initial=1.0))

    @property
    def status(self) -> WalkStatus:
        """Whether the puppet walks, or why it does not."""
        if self.run_status is not Status.DONE:
            return WalkStatus.STOPPED
        if self.falls:
            return WalkStatus.FALLS
        if self.distance_error > _MAX_DISTANCE_ERROR:
            return WalkStatus.OFF_DISTANCE
        if self.standing_share < MIN_STANDING_SHARE:
            return WalkStatus.HOVERS
        return WalkStatus.WALKS if self.max_slide <= MAX_SLIDE else WalkStatus.SLIDES

    @property
    def message(self) -> str:
        """Status in words, with the numbers that decide it."""
        run = "" if self.run_status is Status.DONE else f"; the run: {self.run_status.message}"
        return (
            f"{self.status.message}: {self.distance:.3f} m of {self.wanted_distance:.3f} m, slide "
            f"{1e3 * self.max_slide:.1f} mm, inclination "
            f"{np.degrees(np.arccos(np.clip(self.upright, -1.0, 1.0))):.0f} deg{run}"
        )

    def __bool__(self) -> bool:
        return self.status is WalkStatus.WALKS


def footfalls(body_parts: BodyParts, run: Trajectory, gait: Gait, steps: int) -> Footfalls:
    """Feet of a puppet in a run of a gait.

    Args:
        body_parts: parts of the puppet.
        run: run of ``gait.inputs(..., steps)``, with at least 100 samples per second. If it ends
            early, incomplete cycles are left out. If it has no contact forces between a foot and
            the floor, as in runs of batches, the lowest points and the corners of boxes
            slide.
        gait, steps: the gait, and its number of steps.

    Raises:
        StateError: no body of a leg has shapes.
    """
    marionette, t = body_parts.marionette, np.asarray(run.t) - run.t[0]
    poses = marionette.poses(run.q_D, run.q_K)
    floor = marionette.number(marionette.puppet.floor or 0.0)
    leg_phases = gait_phases(body_parts.body_map, gait.pattern)
    n_cycles = int(np.ceil(0.5 * steps))
    is_whole = t[-1] > gait.duration(steps) - _SAME_TIME
    if not is_whole:
        n_complete = 0.5 * (t[-1] / gait.step_time - PREPARATION_STEPS) - max(leg_phases.values())
        n_cycles = min(n_cycles, max(0, int(n_complete)))
    slide, lift, stands = np.zeros((3, n_cycles, len(leg_phases)))
    for leg, (name, foot) in enumerate(foot_links(body_parts).items()):
        link = marionette.tree.links[foot]
        height, slides = _lowest(link.shapes, poses[:, foot], floor)
        points = _loaded_points(run.contact, link.name, _MIN_LOAD * marionette.weight)
        if points is not None:
            slides = _slides(points, poses[:, foot])
        cycle = 0.5 * (t / gait.step_time - PREPARATION_STEPS) - leg_phases[name]
        for k in range(n_cycles):
            inside = (cycle >= k) & (cycle < k + 1)
            slide[k, leg], lift[k, leg] = slides[inside].sum(), height[inside].max()
            stands[k, leg] = np.mean(height[inside] < MAX_STANDING_HEIGHT)
            closing = steps + CLOSING_STEPS - 2.0 * (1.0 - gait.duty)
            if k and 2.0 * (k + 1 + leg_phases[name]) > closing:
                stands[k, leg] = np.nan
    trunk = poses[:, marionette.link_index(body_parts.body_map.trunk[0])]
    L = leg_length(body_parts.body_map)
    wanted_distance = steps * gait.stride * L
    up = trunk[0, 2, :3]
    forward = np.array(body_parts.body_map.facing) @ trunk[:, :2, :3].transpose(0, 2, 1)
    headings = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
    distance = _forward_distance(trunk[:, :2, 3], headings, t, 2.0 * gait.step_time)
    return Footfalls(
        slide,
        lift,
        stands,
        distance,
        wanted_distance,
        abs(distance - wanted_distance) / max(abs(wanted_distance), L),
        float(headings[-1] - headings[0]),
        float(np.min(trunk[:, 2, :3] @ up / np.linalg.norm(up))),
        Status.RUNNING if run.status is Status.DONE and not is_whole else run.status,
    )


def _forward_distance(place: Array, heading: Array, t: Array, period: float) -> float:
    """Sum over cycles of the displacement along the mean heading of the cycle [m].

    The trunk sways and turns in every cycle, and walks along its mean heading.

    Args:
        place: (T, 2) places [m].
        heading: (T,) headings [rad].
        t: (T,) times, from 0 [s].
        period: duration of a cycle [s].
    """
    edges = np.append(np.arange(0.0, t[-1], period), t[-1])
    at = np.searchsorted(t, edges)
    distance = 0.0
    for first, last in pairwise(at):
        mean = np.exp(1j * heading[first : last + 1]).mean()
        x, y = place[last] - place[first]
        distance += float(x * mean.real + y * mean.imag) / abs(mean)
    return distance


def _loaded_points(
    contact: ContactPoints | None, foot: str, min_load: float
) -> ContactPoints | None:
    """Points with which a foot loads the floor; None if there are no forces between the two."""
    if contact is None or not any({foot, FLOOR} == {*pair} for pair in contact.names):
        return None
    points = contact.involving(foot, FLOOR)
    return points.subset(points.normal_force > min_load)


def _slides(points: ContactPoints, poses: Array) -> Array:
    """(T,) slide of a foot until the next sample [m]; see the top of this file.

    It is 0 unless points carry load now and at the next sample.

    Args:
        points: points that carry load.
        poses: (T, 3, 4) poses of the foot.
    """
    R, r = poses[:, :, :3], poses[:, :, 3]
    slides, displacements = np.zeros(len(r)), np.diff(r, axis=0)
    rotations = rotation.log(rotation.quaternion(R[1:] @ R[:-1].swapaxes(1, 2)))
    first = np.searchsorted(points.sample, np.arange(len(r) + 1))
    is_loaded = np.diff(first) > 0
    for i in np.flatnonzero(is_loaded[:-1] & is_loaded[1:]):
        now, then = (points.point[first[k] : first[k + 1]] for k in (i, i + 1))
        distances = np.linalg.norm(now[:, None] - then, axis=2)
        middle = 0.5 * (now - r[i] + then[np.argmin(distances, axis=1)] - r[i + 1])
        moved = displacements[i] + np.cross(rotations[i], middle)
        slides[i] = np.linalg.norm(moved[:, :2], axis=1).max()
    return slides


def _lowest(shapes: tuple[Shape, ...], poses: Array, floor: float) -> tuple[Array, Array]:
    """(T,) height of the lowest point of shapes, and (T,) slide until the next sample [m].

    It follows the points that are lowest now and all corners of boxes, so that a pivoting sole
    counts as sliding. Of those on the floor now and at the next sample, the one that slides
    farthest counts.
    """
    R, r = poses[:, :, :3], poses[:, :, 3]
    below = -R[:, 2, :]
    points = np.concatenate([_low_points(shape, below) for shape in shapes])
    position = np.einsum("tij,stj->sti", R, points) + r
    next_position = np.einsum("tij,stj->sti", R[1:], points[:, :-1]) + r[1:]
    height = position[..., 2] - floor
    distance = np.linalg.norm((next_position - position[:, :-1])[..., :2], axis=-1)
    is_down = height < MAX_SLIDING_HEIGHT
    slides = np.where(is_down[:, :-1] & is_down[:, 1:], distance, 0.0).max(axis=0)
    return height.min(axis=0), np.append(slides, 0.0)


def _low_points(shape: Shape, below: Array) -> Array:
    """(S, T, 3) candidates for a shape's points on the floor, in the body's axes [m].

    Args:
        shape: the shape.
        below: (T, 3) directions downwards in the body's axes, unit vectors.

    Raises:
        TypeError: it is not a shape.
    """
    if isinstance(shape, Sphere):
        return (np.array(shape.at) + shape.radius * below)[None]
    if isinstance(shape, Capsule):
        return np.array([shape.from_, shape.to])[:, None] + shape.radius * below
    if isinstance(shape, Mesh):
        vertices = np.asarray(load_mesh(shape).vertices)
        return vertices[np.argmax(below @ vertices.T, axis=1)][None]
    if not isinstance(shape, Box | Ellipsoid):
        raise TypeError(f"{type(shape).__name__} is not a shape")
    Q = np.eye(3) if shape.orientation is None else shape.orientation.matrix
    if isinstance(shape, Box):
        signs = np.array(list(product((-1.0, 1.0), repeat=3)))
        corners = np.array(shape.at) + (0.5 * signs * np.array(shape.size)) @ Q.T
        return np.repeat(corners[:, None], len(below), axis=1)
    radii = np.array(shape.radii)
    scaled = (below @ Q) * radii
    farthest = scaled / np.linalg.norm(scaled, axis=1, keepdims=True) * radii
    return (np.array(shape.at) + farthest @ Q.T)[None]
