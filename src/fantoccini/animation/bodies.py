"""The keys of all bodies: as few as keep every point of them within a tolerance in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.animation.grid import Grid
from fantoccini.animation.joints import LocalMotion
from fantoccini.animation.keys import Curve, Keys, cubic_keys
from fantoccini.animation.scene import AnimatedScene
from fantoccini.arrays import Array, Times
from fantoccini.motion import rotation
from fantoccini.tree import WORLD

TOLERANCE = 1e-5
"""How far a point of a body may be from where the run has it [m]."""

_TRIES = 5
_WANTED = 0.9
"""Share of the tolerance that is aimed at."""


@dataclass(frozen=True, eq=False)
class Track:
    """A curve with its keys.

    Attributes:
        curve: on the grid.
        keys: of it; None where it stands still.
    """

    curve: Curve
    keys: Keys | None

    def at(self, t: Times) -> Array:
        """(m, n) what a player shows at times [s]."""
        if self.keys is None:
            return np.tile(self.curve.x[0], (len(t), 1))
        return self.keys.evaluate(self.curve, t)


@dataclass(frozen=True, eq=False)
class BodyTracks:
    """Translation and orientation of a link in its parent's frame."""

    r: Track
    q: Track


def tracks_of(scene: AnimatedScene, grid: Grid) -> dict[int, BodyTracks]:
    """The tracks of every link that is shown.

    The first tolerances of the joints are such that their shares add up to the whole at the ends of
    the limbs. What is left of the whole is then given to all.
    """
    motions = {k: scene.motion(k, grid.run) for k in scene.links}
    reaches = _reaches(scene, motions)
    depth = {WORLD: 0}
    for k in scene.links:
        depth[k] = depth[scene.parents[k]] + 1
    share, best = 2.0 * TOLERANCE / max(depth.values()), {}
    for _ in range(_TRIES):
        tracks = {
            k: _tracks(grid.t, motion, share, reaches[k]) for k, motion in motions.items()
        }
        error = _worst(scene, grid, motions, tracks, reaches)
        if error <= TOLERANCE:
            best = tracks
            if error >= 0.6 * TOLERANCE or share >= TOLERANCE:
                break
        share *= float(np.clip(_WANTED * TOLERANCE / max(error, 1e-12), 0.2, 2.0))
    return best or tracks


def _tracks(t: Times, motion: LocalMotion, share: float, reach: float) -> BodyTracks:
    # A quaternion is off by half the angle.
    turn = Curve(t, rotation.continuous(motion.q), np.zeros_like(motion.q), 0.0, True)
    q = turn.x
    rate = 0.5 * rotation.multiply(q, np.concatenate([np.zeros((len(q), 1)), motion.w], axis=1))
    return BodyTracks(
        _track(Curve(t, motion.r, motion.v, share, False)),
        _track(Curve(t, q, rate, 0.5 * share / reach, True)),
    )


def _track(curve: Curve) -> Track:
    return Track(curve, None if curve.still else cubic_keys(curve))


def _reaches(scene: AnimatedScene, motions: dict[int, LocalMotion]) -> dict[int, float]:
    """Of every link the farthest that a point on it or on what hangs from it is from its origin."""
    own = {k: 1e-3 for k in scene.links}
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
    for k in reversed(scene.links):
        parent = scene.parents[k]
        if parent != WORLD:
            far = float(np.linalg.norm(motions[k].r, axis=1).max())
            own[parent] = max(own[parent], far + own[k])
    return own


def _worst(
    scene: AnimatedScene,
    grid: Grid,
    motions: dict[int, LocalMotion],
    tracks: dict[int, BodyTracks],
    reaches: dict[int, float],
) -> float:
    """How far a point of a body is at most from where the run has it [m]."""
    still = np.zeros((len(grid.t), 3))
    worst = 0.0
    pose = {WORLD: (np.eye(3)[None], still, np.eye(3)[None], still)}
    for k in scene.links:
        R0, r0, R1, r1 = pose[scene.parents[k]]
        motion, track = motions[k], tracks[k]
        turned = R0 @ rotation.matrix(motion.q), R1 @ rotation.matrix(track.q.at(grid.t))
        placed = (
            rotation.apply(R0, motion.r) + r0, rotation.apply(R1, track.r.at(grid.t)) + r1
        )  # fmt: skip
        pose[k] = turned[0], placed[0], turned[1], placed[1]
        off = placed[1] - placed[0]
        tips = reaches[k] * (turned[1] - turned[0])
        for sign in (1.0, -1.0):
            far = np.linalg.norm(off[:, :, None] + sign * tips, axis=1)
            worst = max(worst, float(far.max()))
    return worst
