"""BVH: the bodies as a skeleton. Metres, y up; the strings are left out.

A channel of a joint is what the joint does: the skeleton whose channels are all zero is the puppet
with all joints at zero, and its frames are parallel to the world's. With W the turn from z up to y
up and G_k the orientation of body k in that pose, body k at R_k has the frame

    B_k = W R_k G_k^T W^T.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.base import Array, Quaternion, Vec3, rotation
from fantoccini.model.tree import WORLD
from fantoccini.motion import Trajectory
from fantoccini.output.animation.euler import USUAL, euler
from fantoccini.output.animation.joints import LocalMotion
from fantoccini.output.animation.scene import AnimatedScene

_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From z up to y up."""
_LEAST = 1e-3
"""Length of the last bone of a limb, at least [m]."""
_STUB = 0.01
"""Its length for a body without shapes [m]."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A body of the skeleton, with y up.

    Attributes:
        name: the body's.
        parent: place of its parent among the joints, -1 for the root.
        offset: (3,) place in the parent's frame [m]; zero where it moves.
        places: (T, 3) of one that moves, in the parent's frame [m]; None of others.
        order: of the axes of its angles.
        angles: (T, 3) in that order [rad].
        tip: (3,) the end of its bone in its own frame [m].
    """

    name: str
    parent: int
    offset: Vec3
    places: Vec3 | None
    order: str
    angles: Array
    tip: Vec3

    @property
    def channels(self) -> list[str]:
        """Their names."""
        moves = [] if self.places is None else [f"{axis}position" for axis in "XYZ"]
        return moves + [f"{axis}rotation" for axis in self.order]

    @property
    def values(self) -> Array:
        """(T, n) of the channels [m and deg]."""
        angles = np.degrees(self.angles)
        return angles if self.places is None else np.hstack([self.places, angles])


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes the bodies of a scene; bodies that hang from the world are under one root."""
    assert scene.fps is not None
    run = scene.run.resample(scene.frames(scene.fps))
    joints = joints_of(scene.without_lines(), run)
    order, lines = list[int](), ["HIERARCHY"]
    for text, k in _hierarchy(joints):
        lines.append(text)
        order += [] if k is None else [k]
    values = np.hstack([joints[k].values for k in order])
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / scene.fps:.12g}"]
    lines += [" ".join(_text(x) for x in row) for row in values.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def joints_of(scene: AnimatedScene, run: Trajectory) -> list[Joint]:
    """The skeleton, parents first, and its motion at the samples of a run."""
    tree, tips = scene.tree, _tips(scene)
    turned = {WORLD: np.eye(3)}
    for k, link in enumerate(tree.links):
        turned[k] = turned[link.parent] @ link.rotation
    roots = [k for k in scene.links if scene.parents[k] == WORLD]
    joints, index = list[Joint](), {WORLD: -1}
    if len(roots) > 1:
        still, name = np.zeros((len(run), 3)), tree.name
        while name in (tree.links[k].name for k in scene.links):
            name += "_"
        joints.append(Joint(name, -1, np.zeros(3), still, USUAL, still, np.zeros(3)))
        index[WORLD] = 0
    for k in scene.links:
        motion, above = scene.motion(k, run), turned[scene.parents[k]]
        q = _upright(_about(rotation.quaternion(above), motion, rotation.quaternion(turned[k])))
        places = motion.r @ (_UPRIGHT @ above).T
        moves = scene.parents[k] == WORLD or _moves(scene, k)
        order, angles = euler(q)
        index[k] = len(joints)
        joints.append(
            Joint(
                tree.links[k].name,
                index[scene.parents[k]],
                np.zeros(3) if moves else places[0],
                places if moves else None,
                order,
                angles,
                _UPRIGHT @ turned[k] @ tips[k],
            )
        )
    return joints


def _about(above: Quaternion, motion: LocalMotion, own: Quaternion) -> Quaternion:
    """(T, 4) orientation in the parent's frame, both frames as those of the pose at zero."""
    return rotation.multiply(rotation.multiply(above, motion.q), rotation.conjugate(own))


def _upright(q: Quaternion) -> Quaternion:
    """W R W^T: the axis is turned."""
    return np.concatenate([q[:, :1], q[:, 1:] @ _UPRIGHT.T], axis=1)


def _moves(scene: AnimatedScene, link: int) -> bool:
    """Whether the origin of a link moves in its parent's frame."""
    path = scene.tree.ancestors(link)
    between = path[1 : path.index(scene.parents[link])]
    kinds = {scene.tree.links[k].kind for k in between}
    return bool(kinds - {"fixed"}) or scene.tree.links[link].kind in (
        "prismatic",
        "translation",
        "free",
    )


def _tips(scene: AnimatedScene) -> dict[int, Vec3]:
    """Of every link the far end of its bone: the centre of its shapes lies in the middle."""
    low = {k: np.full(3, np.inf) for k in scene.links}
    high = {k: np.full(3, -np.inf) for k in scene.links}
    for solid in scene.geometry.solids:
        if solid.link in low:
            extent = solid.radius
            if solid.kind == "ellipsoid":
                extent = np.linalg.norm(solid.half, axis=1)
            low[solid.link] = np.minimum(low[solid.link], (solid.points - extent).min(axis=0))
            high[solid.link] = np.maximum(high[solid.link], (solid.points + extent).max(axis=0))
    tips = {}
    for k in scene.links:
        if not np.all(np.isfinite(low[k])):
            tips[k] = np.array([0.0, 0.0, _STUB])
        elif np.linalg.norm(low[k] + high[k]) < _LEAST:
            tips[k] = np.array([0.0, 0.0, max(high[k][2], _LEAST)])
        else:
            tips[k] = low[k] + high[k]
    return tips


def _hierarchy(joints: Sequence[Joint]) -> Iterator[tuple[str, int | None]]:
    """The lines of the skeleton; with each line of channels the joint's place, in file order."""
    below = [[i for i, joint in enumerate(joints) if joint.parent == k] for k in range(len(joints))]
    waiting: list[tuple[int, int | None]] = [(0, 0)]
    while waiting:
        depth, k = waiting.pop()
        tab = "\t" * depth
        if k is None:
            yield f"{tab}}}", None
            continue
        joint = joints[k]
        yield f"{tab}{'JOINT' if depth else 'ROOT'} {joint.name}", None
        yield f"{tab}{{", None
        yield f"{tab}\tOFFSET {' '.join(map(_text, joint.offset))}", None
        yield f"{tab}\tCHANNELS {len(joint.channels)} {' '.join(joint.channels)}", k
        if not below[k]:
            tip = " ".join(map(_text, joint.tip))
            yield from (
                (f"{tab}\t{line}", None) for line in ("End Site", "{", f"\tOFFSET {tip}", "}")
            )
        waiting.append((depth, None))
        waiting += [(depth + 1, i) for i in reversed(below[k])]


def _text(value: float) -> str:
    """A tenth of a nanometre, or of a billionth of a degree."""
    return f"{round(value, 10) + 0.0:.13g}"
