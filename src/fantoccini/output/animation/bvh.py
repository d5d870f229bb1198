"""BVH: the bodies as a skeleton. Metres, y up; the strings are left out.

Channels are joint motions: with all channels zero, the skeleton is the puppet with all joints at
zero, and its frames are parallel to the world frame. With W the rotation from z up to y up and G_k
the orientation of body k in that pose, body k at orientation R_k has the frame

    B_k = W R_k G_k^T W^T.

BVH is a format of captured motion. A channel is one number of a joint in every frame, and a bone
the line from a joint to the next one. A link is a body on its joint. A solid is a shape of a body
or an obstacle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.base import Array, Quaternion, Vec3, rotation
from fantoccini.model.tree import WORLD
from fantoccini.motion import Trajectory
from fantoccini.output.animation.euler import DEFAULT_ORDER, order_and_angles
from fantoccini.output.animation.joints import LocalMotion
from fantoccini.output.animation.scene import AnimatedScene

_Z_UP_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation matrix from z up to y up."""
_MIN_BONE = 1e-3
"""Smallest length of the last bone of a limb [m]."""
_MIN_COMPONENT = 0.5
"""Smallest component of a last bone, relative to the largest; smaller ones become 0."""
_DEFAULT_BONE = 0.01
"""Length of the last bone of a body without shapes [m]."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A body of the skeleton, with y up.

    Attributes:
        name: name of the body.
        parent: index of the parent among the joints, -1 for the root.
        offset: (3,) position in the parent's frame [m]; zero if it moves.
        positions: (T, 3) positions in the parent's frame [m]; None if the position is constant.
        order: axes of the angles, in order.
        angles: (T, 3) angles in that order [rad].
        tip: (3,) end of the bone in the body's frame [m].
    """

    name: str
    parent: int
    offset: Vec3
    positions: Vec3 | None
    order: str
    angles: Array
    tip: Vec3

    @property
    def channels(self) -> list[str]:
        """Names of the channels."""
        position_channels = [] if self.positions is None else [f"{axis}position" for axis in "XYZ"]
        return position_channels + [f"{axis}rotation" for axis in self.order]

    @property
    def values(self) -> Array:
        """(T, n) values of the channels [m and deg]."""
        angles = np.degrees(self.angles)
        return angles if self.positions is None else np.hstack([self.positions, angles])


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes the bodies of a scene; if several hang from the world, under one root joint."""
    assert scene.fps is not None
    run = scene.run.resample(scene.frames(scene.fps))
    joints = joints_of(scene.without_lines(), run)
    joint_order, lines = list[int](), ["HIERARCHY"]
    for text, k in _hierarchy(joints):
        lines.append(text)
        joint_order += [] if k is None else [k]
    values = np.hstack([joints[k].values for k in joint_order])
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / scene.fps:.12g}"]
    lines += [" ".join(_number_text(x) for x in row) for row in values.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def joints_of(scene: AnimatedScene, run: Trajectory) -> list[Joint]:
    """Joints of the skeleton, parents first, with their motion at the samples of a run."""
    tree, tips = scene.tree, _tips(scene)
    orientations = {WORLD: np.eye(3)}
    for k, link in enumerate(tree.links):
        orientations[k] = orientations[link.parent] @ link.rotation
    roots = [k for k in scene.links if scene.parents[k] == WORLD]
    joints, index = list[Joint](), {WORLD: -1}
    if len(roots) > 1:
        zeros, name = np.zeros((len(run), 3)), tree.name
        while name in (tree.links[k].name for k in scene.links):
            name += "_"
        joints.append(Joint(name, -1, np.zeros(3), zeros, DEFAULT_ORDER, zeros, np.zeros(3)))
        index[WORLD] = 0
    for k in scene.links:
        motion, parent_orientation = scene.motion(k, run), orientations[scene.parents[k]]
        q = _to_y_up(
            _in_zero_frames(
                rotation.quaternion(parent_orientation),
                motion,
                rotation.quaternion(orientations[k]),
            )
        )
        positions = motion.r @ (_Z_UP_TO_Y_UP @ parent_orientation).T
        moves = scene.parents[k] == WORLD or _origin_moves(scene, k)
        order, angles = order_and_angles(q)
        index[k] = len(joints)
        joints.append(
            Joint(
                tree.links[k].name,
                index[scene.parents[k]],
                np.zeros(3) if moves else positions[0],
                positions if moves else None,
                order,
                angles,
                _Z_UP_TO_Y_UP @ orientations[k] @ tips[k],
            )
        )
    return joints


def _in_zero_frames(
    parent: Quaternion, motion: LocalMotion, zero_orientation: Quaternion
) -> Quaternion:
    """(T, 4) orientation in the parent's frame, for frames parallel to the world at zero."""
    return rotation.multiply(
        rotation.multiply(parent, motion.q), rotation.conjugate(zero_orientation)
    )


def _to_y_up(q: Quaternion) -> Quaternion:
    """W R W^T, as quaternions: W rotates the axis."""
    return np.concatenate([q[:, :1], q[:, 1:] @ _Z_UP_TO_Y_UP.T], axis=1)


def _origin_moves(scene: AnimatedScene, link: int) -> bool:
    """Whether the origin of a link moves in its parent's frame."""
    path = scene.tree.ancestors(link)
    intermediate = path[1 : path.index(scene.parents[link])]
    joint_types = {scene.tree.links[k].kind for k in intermediate}
    return bool(joint_types - {"fixed"}) or scene.tree.links[link].kind in (
        "prismatic",
        "translation",
        "free",
    )


def _tips(scene: AnimatedScene) -> dict[int, Vec3]:
    """End of each link's bone: twice as far from the origin as the centre of its shapes.

    Components below half the largest are left out, so that a shin with a foot points downwards.
    """
    low = {k: np.full(3, np.inf) for k in scene.links}
    high = {k: np.full(3, -np.inf) for k in scene.links}
    for solid in scene.geometry.solids:
        if solid.link in low:
            extent = solid.radius
            if solid.kind == "ellipsoid":
                extent = np.linalg.norm(solid.half_axes, axis=1)
            low[solid.link] = np.minimum(low[solid.link], (solid.points - extent).min(axis=0))
            high[solid.link] = np.maximum(high[solid.link], (solid.points + extent).max(axis=0))
    tips = {}
    for k in scene.links:
        if not np.all(np.isfinite(low[k])):
            tips[k] = np.array([0.0, 0.0, _DEFAULT_BONE])
        elif np.linalg.norm(low[k] + high[k]) < _MIN_BONE:
            tips[k] = np.array([0.0, 0.0, max(high[k][2], _MIN_BONE)])
        else:
            tip = low[k] + high[k]
            tips[k] = np.where(np.abs(tip) < _MIN_COMPONENT * np.max(np.abs(tip)), 0.0, tip)
    return tips


def _hierarchy(joints: Sequence[Joint]) -> Iterator[tuple[str, int | None]]:
    """Lines of the skeleton, in file order; a line of channels comes with its joint's index."""
    children = [
        [i for i, joint in enumerate(joints) if joint.parent == k] for k in range(len(joints))
    ]
    stack: list[tuple[int, int | None]] = [(0, 0)]
    while stack:
        depth, k = stack.pop()
        indent = "\t" * depth
        if k is None:
            yield f"{indent}}}", None
            continue
        joint = joints[k]
        yield f"{indent}{'JOINT' if depth else 'ROOT'} {joint.name}", None
        yield f"{indent}{{", None
        yield f"{indent}\tOFFSET {' '.join(map(_number_text, joint.offset))}", None
        yield f"{indent}\tCHANNELS {len(joint.channels)} {' '.join(joint.channels)}", k
        if not children[k]:
            tip = " ".join(map(_number_text, joint.tip))
            yield from (
                (f"{indent}\t{line}", None) for line in ("End Site", "{", f"\tOFFSET {tip}", "}")
            )
        stack.append((depth, None))
        stack += [(depth + 1, i) for i in reversed(children[k])]


def _number_text(value: float) -> str:
    """The value, rounded to 1e-10 m or deg."""
    return f"{round(value, 10) + 0.0:.13g}"
