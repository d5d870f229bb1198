"""CSV: columns of a run, poses of bodies and ends of strings."""

from __future__ import annotations

from pathlib import Path

from fantoccini.base import Array, rotation, write_table
from fantoccini.motion import Trajectory
from fantoccini.output.animation.scene import AnimatedScene

_PLACE = ("x", "y", "z")
_TURN = ("qw", "qx", "qy", "qz")


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes the columns of a run, at all samples or at the frames.

    If bodies were given, columns ``pose:torso.x`` to ``pose:torso.qz`` follow for every body, and
    ``start:hand.x`` to ``end:hand.z`` for every string.
    """
    run = scene.run
    if scene.fps is not None:
        run = run.resample(scene.frames(scene.fps))
    columns = run.columns()
    if scene.named:
        columns |= places(scene, run)
    write_table(columns, path)


def places(scene: AnimatedScene, run: Trajectory) -> dict[str, Array]:
    """Poses of the bodies and ends of the strings in the world frame, as columns (T,) [m and 1]."""
    poses = scene.still.poses(run.q_D, run.q_K)
    columns: dict[str, Array] = {}
    for k in scene.without_lines().links:
        name = scene.tree.links[k].name
        turns = rotation.quaternion(poses[:, k, :, :3])
        columns |= _columns(f"pose:{name}", _PLACE, poses[:, k, :, 3])
        columns |= _columns(f"pose:{name}", _TURN, rotation.continuous(turns))
    for line in scene.lines:
        for which, point in (("start", line.points[0]), ("end", line.points[-1])):
            columns |= _columns(f"{which}:{line.name}", _PLACE, scene.place(point, poses))
    return columns


def _columns(name: str, parts: tuple[str, ...], values: Array) -> dict[str, Array]:
    return {f"{name}.{part}": x for part, x in zip(parts, values.T, strict=True)}
