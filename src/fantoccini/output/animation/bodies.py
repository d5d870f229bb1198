"""Keys of all bodies: as few as keep each point on them within a tolerance, in the world frame.

A key is a value at a time, between which programs that play the animation interpolate. A link is a
body on its joint. A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from fantoccini.base import Array, Indices, Times, rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.animation.grid import Grid
from fantoccini.output.animation.joints import LocalMotion
from fantoccini.output.animation.keys import Curve, Keys, cubic_keys
from fantoccini.output.animation.scene import AnimatedScene

POSITION_TOLERANCE = 1e-5
"""Largest distance of an animated point of a body from its position in the run [m]."""

_MIN_EXTENT = 1e-3
"""Extent of a link without shapes [m]."""
_SHARE_PASSES = 2
_MAX_REFINEMENTS = 12
_FIRST_FACTOR = 3.0
"""Factor by which the first shares exceed equal ones: errors of joints rarely add up."""
_TARGET_SHARE = 0.9
"""Share of the tolerance that the passes aim at."""
_SAMPLE_SHARE = 0.97
"""Share of the tolerance allowed at the samples; errors between them may be slightly larger."""
_WINDOW = 31
"""Number of samples around an error in which keys are set more densely."""


@dataclass(frozen=True, eq=False)
class Track:
    """A curve with its keys.

    Attributes:
        curve: values on the grid.
        keys: its keys; None for a constant curve.
    """

    curve: Curve
    keys: Keys | None

    @property
    def values(self) -> Array:
        """(T, n) values that a player shows on the grid."""
        if self.keys is None:
            return np.tile(self.curve.x[0], (len(self.curve.t), 1))
        return self.keys.evaluate(self.curve, self.curve.t)

    @property
    def errors(self) -> Array:
        """(T,) errors of these values, in units of the tolerance."""
        offsets: Array = np.linalg.norm(self.values - self.curve.x, axis=1) / self.curve.tolerance
        return offsets

    def refined(self, samples: Indices) -> Track:
        """The track with another key in the middle of each span with one of `samples`."""
        return (
            self if self.keys is None else Track(self.curve, self.keys.refined(self.curve, samples))
        )


@dataclass(frozen=True, eq=False)
class BodyTracks:
    """Translation and orientation of a link in its parent's frame."""

    r: Track
    q: Track


def compute_tracks(scene: AnimatedScene, grid: Grid) -> dict[int, BodyTracks]:
    """Tracks of every shown link.

    At first each joint has an equal share of the tolerance, by the number of joints of the longest
    limb. Shares then shrink around the times when errors are too large, and grow elsewhere. Keys in
    between remove the remaining errors.
    """
    motions = {k: scene.motion(k, grid.run) for k in scene.links}
    extents = _extents(scene)
    reaches = _reaches(scene, motions, extents)
    depths = {WORLD: 0}
    for k in scene.links:
        depths[k] = depths[scene.parents[k]] + 1
    joint_tolerance = np.full(
        len(grid.t), _FIRST_FACTOR * POSITION_TOLERANCE / max(depths.values())
    )
    for _ in range(_SHARE_PASSES):
        tracks = {
            k: _body_tracks(grid.t, m, joint_tolerance, reaches[k]) for k, m in motions.items()
        }
        max_error = np.max(list(_errors(scene, motions, tracks, extents).values()), axis=0)
        local_max_error = maximum_filter1d(max_error, _WINDOW)
        joint_tolerance = joint_tolerance * np.clip(
            _TARGET_SHARE * POSITION_TOLERANCE / np.maximum(local_max_error, 1e-12), 0.2, 2.0
        )
        joint_tolerance = np.clip(joint_tolerance, 0.01 * POSITION_TOLERANCE, POSITION_TOLERANCE)
    for _ in range(_MAX_REFINEMENTS):
        bad_samples = {
            k: np.flatnonzero(error > _SAMPLE_SHARE * POSITION_TOLERANCE)
            for k, error in _errors(scene, motions, tracks, extents).items()
        }
        if not any(len(samples) for samples in bad_samples.values()):
            break
        _add_keys(scene, tracks, bad_samples)
    return tracks


def _add_keys(
    scene: AnimatedScene, tracks: dict[int, BodyTracks], bad_samples: Mapping[int, Indices]
) -> None:
    """Adds keys around the samples at which the errors of links are too large."""
    for k, samples in bad_samples.items():
        if not len(samples):
            continue
        chain = [k]
        while scene.parents[chain[-1]] != WORLD:
            chain.append(scene.parents[chain[-1]])
        components = [(link, component) for link in chain for component in ("r", "q")]
        errors = np.array(
            [getattr(tracks[link], component).errors[samples] for link, component in components]
        )
        for (link, component), is_largest in zip(
            components, errors >= 0.5 * errors.max(axis=0), strict=True
        ):
            if is_largest.any():
                refined = getattr(tracks[link], component).refined(samples[is_largest])
                tracks[link] = replace(tracks[link], **{component: refined})


def _body_tracks(t: Times, motion: LocalMotion, tolerance: Array, reach: float) -> BodyTracks:
    q = rotation.continuous(motion.q)
    # The error of a quaternion is half the angle.
    return BodyTracks(
        _track(Curve(t, motion.r, motion.v, tolerance, False)),
        _track(Curve(t, q, replace(motion, q=q).q_rate, 0.5 * tolerance / reach, True)),
    )


def _track(curve: Curve) -> Track:
    return Track(curve, None if curve.constant else cubic_keys(curve))


def _extents(scene: AnimatedScene) -> dict[int, float]:
    """Largest distance of a point of each link from the link's origin [m]."""
    extents = dict.fromkeys(scene.links, _MIN_EXTENT)
    for solid in scene.geometry.solids:
        if solid.link in extents:
            distance = np.linalg.norm(solid.points, axis=1).max() + solid.radius
            distance += (
                float(np.linalg.norm(solid.half_axes, axis=0).max())
                if solid.kind != "faces"
                else 0.0
            )
            extents[solid.link] = max(extents[solid.link], float(distance))
    for line in scene.lines:
        for point in line.points:
            if point.link != WORLD:
                distance = float(np.linalg.norm(scene.at(point)))
                extents[point.link] = max(extents[point.link], distance)
    return extents


def _reaches(
    scene: AnimatedScene, motions: dict[int, LocalMotion], extents: dict[int, float]
) -> dict[int, float]:
    """Extents that include the points of all descendants [m]."""
    reaches = dict(extents)
    for k in reversed(scene.links):
        parent = scene.parents[k]
        if parent != WORLD:
            distance = float(np.linalg.norm(motions[k].r, axis=1).max())
            reaches[parent] = max(reaches[parent], distance + reaches[k])
    return reaches


def _errors(
    scene: AnimatedScene,
    motions: dict[int, LocalMotion],
    tracks: dict[int, BodyTracks],
    extents: dict[int, float],
) -> dict[int, Array]:
    """(T,) largest position error of a point of each link [m]."""
    errors = {}
    zero = np.zeros((1, 3))
    poses = {WORLD: (np.eye(3)[None], zero, np.eye(3)[None], zero)}
    for k in scene.links:
        R0, r0, R1, r1 = poses[scene.parents[k]]
        motion, body = motions[k], tracks[k]
        r0, r1 = rotation.apply(R0, motion.r) + r0, rotation.apply(R1, body.r.values) + r1
        R0, R1 = R0 @ rotation.matrix(motion.q), R1 @ rotation.matrix(body.q.values)
        poses[k] = R0, r0, R1, r1
        angle = np.linalg.norm(R1 - R0, axis=(1, 2)) / np.sqrt(2.0)
        errors[k] = np.linalg.norm(r1 - r0, axis=1) + extents[k] * angle
    return errors
