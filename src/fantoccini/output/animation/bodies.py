"""The keys of all bodies: as few as keep every point of them within a tolerance in the world."""

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

TOLERANCE = 1e-5
"""How far a point of a body may be from where the run has it [m]."""

_LEAST = 1e-3
"""Size that a link without shapes has at least [m]."""
_TRIES = 2
_MENDS = 12
_FIRST = 3.0
"""Errors seldom add up: so many times their share are allowed at first."""
_WANTED = 0.9
"""Share of the tolerance that is aimed at."""
_ALLOWED = 0.97
"""Share of the tolerance that is kept at the samples; between them it may be a little more."""
_NEAR = 31
"""Samples about an error in which the keys are moved closer."""


@dataclass(frozen=True, eq=False)
class Track:
    """A curve with its keys.

    Attributes:
        curve: on the grid.
        keys: of it; None where it stands still.
    """

    curve: Curve
    keys: Keys | None

    @property
    def shown(self) -> Array:
        """(T, n) what a player shows on the grid."""
        if self.keys is None:
            return np.tile(self.curve.x[0], (len(self.curve.t), 1))
        return self.keys.evaluate(self.curve, self.curve.t)

    @property
    def errors(self) -> Array:
        """(T,) how far that is off, in tolerances."""
        away: Array = np.linalg.norm(self.shown - self.curve.x, axis=1) / self.curve.tolerance
        return away

    def finer(self, at: Indices) -> Track:
        """With keys in the middle of the spans about samples."""
        return self if self.keys is None else Track(self.curve, self.keys.halved(self.curve, at))


@dataclass(frozen=True, eq=False)
class BodyTracks:
    """Translation and orientation of a link in its parent's frame."""

    r: Track
    q: Track


def tracks_of(scene: AnimatedScene, grid: Grid) -> dict[int, BodyTracks]:
    """The tracks of every link that is shown.

    At first every joint of the longest limb has a like share of the tolerance. Shares are then
    smaller about the times when points are too far off, and larger where more is allowed; what is
    left is mended by keys in between.
    """
    motions = {k: scene.motion(k, grid.run) for k in scene.links}
    extents = _extents(scene)
    reaches = _reaches(scene, motions, extents)
    depth = {WORLD: 0}
    for k in scene.links:
        depth[k] = depth[scene.parents[k]] + 1
    share = np.full(len(grid.t), _FIRST * TOLERANCE / max(depth.values()))
    for _ in range(_TRIES):
        tracks = {k: _tracks(grid.t, m, share, reaches[k]) for k, m in motions.items()}
        worst = np.max(list(_errors(scene, motions, tracks, extents).values()), axis=0)
        near = maximum_filter1d(worst, _NEAR)
        share = share * np.clip(_WANTED * TOLERANCE / np.maximum(near, 1e-12), 0.2, 2.0)
        share = np.clip(share, 0.01 * TOLERANCE, TOLERANCE)
    for _ in range(_MENDS):
        wrong = {
            k: np.flatnonzero(error > _ALLOWED * TOLERANCE)
            for k, error in _errors(scene, motions, tracks, extents).items()
        }
        if not any(len(at) for at in wrong.values()):
            break
        _mend(scene, tracks, wrong)
    return tracks


def _mend(
    scene: AnimatedScene, tracks: dict[int, BodyTracks], wrong: Mapping[int, Indices]
) -> None:
    """Puts keys in between about the samples at which links are too far off."""
    for k, at in wrong.items():
        if not len(at):
            continue
        chain = [k]
        while scene.parents[chain[-1]] != WORLD:
            chain.append(scene.parents[chain[-1]])
        parts = [(link, part) for link in chain for part in ("r", "q")]
        own = np.array([getattr(tracks[link], part).errors[at] for link, part in parts])
        for (link, part), blame in zip(parts, own >= 0.5 * own.max(axis=0), strict=True):
            if blame.any():
                finer = getattr(tracks[link], part).finer(at[blame])
                tracks[link] = replace(tracks[link], **{part: finer})


def _tracks(t: Times, motion: LocalMotion, share: Array, reach: float) -> BodyTracks:
    q = rotation.continuous(motion.q)
    # A quaternion is off by half the angle.
    return BodyTracks(
        _track(Curve(t, motion.r, motion.v, share, False)),
        _track(Curve(t, q, replace(motion, q=q).q_rate, 0.5 * share / reach, True)),
    )


def _track(curve: Curve) -> Track:
    return Track(curve, None if curve.still else cubic_keys(curve))


def _extents(scene: AnimatedScene) -> dict[int, float]:
    """Of every link how far a point on it is from its origin, at most [m]."""
    own = dict.fromkeys(scene.links, _LEAST)
    for solid in scene.geometry.solids:
        if solid.link in own:
            far = np.linalg.norm(solid.points, axis=1).max() + solid.radius
            far += float(np.linalg.norm(solid.half, axis=0).max()) if solid.kind != "faces" else 0.0
            own[solid.link] = max(own[solid.link], float(far))
    for line in scene.lines:
        for point in line.points:
            if point.link != WORLD:
                far = float(np.linalg.norm(scene.at(point)))
                own[point.link] = max(own[point.link], far)
    return own


def _reaches(
    scene: AnimatedScene, motions: dict[int, LocalMotion], extents: dict[int, float]
) -> dict[int, float]:
    """The same with the points of the links that hang from it [m]."""
    reaches = dict(extents)
    for k in reversed(scene.links):
        parent = scene.parents[k]
        if parent != WORLD:
            far = float(np.linalg.norm(motions[k].r, axis=1).max())
            reaches[parent] = max(reaches[parent], far + reaches[k])
    return reaches


def _errors(
    scene: AnimatedScene,
    motions: dict[int, LocalMotion],
    tracks: dict[int, BodyTracks],
    extents: dict[int, float],
) -> dict[int, Array]:
    """Of every link (T,) how far a point of it is at most from where the run has it [m]."""
    found = {}
    none = np.zeros((1, 3))
    poses = {WORLD: (np.eye(3)[None], none, np.eye(3)[None], none)}
    for k in scene.links:
        R0, r0, R1, r1 = poses[scene.parents[k]]
        motion, own = motions[k], tracks[k]
        r0, r1 = rotation.apply(R0, motion.r) + r0, rotation.apply(R1, own.r.shown) + r1
        R0, R1 = R0 @ rotation.matrix(motion.q), R1 @ rotation.matrix(own.q.shown)
        poses[k] = R0, r0, R1, r1
        angle = np.linalg.norm(R1 - R0, axis=(1, 2)) / np.sqrt(2.0)
        found[k] = np.linalg.norm(r1 - r0, axis=1) + extents[k] * angle
    return found
