"""CSV: columns of a run, poses of bodies and ends of strings.

q_D and q_K are the dynamic and driven coordinates.
"""

from __future__ import annotations

from pathlib import Path

from fantoccini.base import Array, rotation, write_table
from fantoccini.motion import Trajectory
from fantoccini.output.animation.scene import AnimatedScene

_POSITION_KEYS = ("x", "y", "z")
_QUATERNION_KEYS = ("qw", "qx", "qy", "qz")


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes the columns of a run, at all samples or at the frames.

    If bodies were given, columns ``pose:torso.x`` to ``pose:torso.qz`` follow for every body, and
    ``start:hand.x`` to ``end:hand.z`` for every string.
    """
    run = scene.run
    if scene.fps is not None:
        run = run.resample(scene.frames(scene.fps))
    columns = run.columns()
    if scene.bodies_given:
        columns |= pose_columns(scene, run)
    write_table(columns, path)


def pose_columns(scene: AnimatedScene, run: Trajectory) -> dict[str, Array]:
    """Poses of the bodies and ends of the strings in the world frame, as columns (T,) [m and 1]."""
    poses = scene.still.poses(run.q_D, run.q_K)
    columns: dict[str, Array] = {}
    for k in scene.without_lines().links:
        name = scene.tree.links[k].name
        quaternions = rotation.quaternion(poses[:, k, :, :3])
        columns |= _columns(f"pose:{name}", _POSITION_KEYS, poses[:, k, :, 3])
        columns |= _columns(f"pose:{name}", _QUATERNION_KEYS, rotation.continuous(quaternions))
    for line in scene.lines:
        for end_name, point in (("start", line.points[0]), ("end", line.points[-1])):
            columns |= _columns(
                f"{end_name}:{line.name}", _POSITION_KEYS, scene.world_positions(point, poses)
            )
    return columns


def _columns(name: str, keys: tuple[str, ...], values: Array) -> dict[str, Array]:
    return {f"{name}.{key}": x for key, x in zip(keys, values.T, strict=True)}
