"""Writes ten clips of a person as BVH files, for tests and measurements without downloads.

    python -m benchmarks.capture.clips FOLDER [CONVENTION ...]

The motions of :mod:`benchmarks.capture.motions` with the names, units, frame rates and rest poses
of three common kinds of skeletons. Real files differ in the lengths of the limbs.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.capture.motions import MOTIONS, SIDES, Pose, joint_position, part_rotations
from scipy.spatial.transform import Rotation

from fantoccini.base.arrays import Array


@dataclass(frozen=True)
class Joint:
    """A joint of a skeleton.

    Attributes:
        name: name in the file.
        parent: its name; empty for the root.
        place: position in the T pose [m].
        part: part of the body that it turns.
        frame: (3, 3) its axes in the T pose, as columns; the reference of rotations.
        end: the end of a chain in the T pose [m], if one ends here.
    """

    name: str
    parent: str
    place: Array
    part: str
    frame: Array
    end: Array | None = None


@dataclass(frozen=True)
class Convention:
    """Format of a kind of file.

    Attributes:
        joints: joints, parents first.
        unit: unit of lengths [m].
        rate: frames per second.
        t_pose: whether the first frame is a T pose.
    """

    joints: tuple[Joint, ...]
    unit: float
    rate: float
    t_pose: bool = False


# Rows: joint, parent, point, part of the body, end of the chain. A star stands for a side, a plus
# for its letter.
_LIMBS = """
*Arm *Shoulder shoulder arm*
*ForeArm *Arm elbow forearm*
*UpLeg {hip} hip thigh*
*Leg *UpLeg knee shin*
*Foot *Leg ankle foot*
"""
_CMU = (
    """
Hips - hips hips
LowerBack Hips hips spine
Spine LowerBack spine1 spine1
Spine1 Spine chest chest
Neck Spine1 chest chest
Neck1 Neck neck neck
Head Neck1 head head top
+HipJoint Hips hips hips
*Shoulder Spine1 chest chest
"""
    + _LIMBS.format(hip="+HipJoint")
    + """
*ToeBase *Foot ball toes toes
*Hand *ForeArm wrist forearm*
*FingerBase *Hand wrist forearm*
+Fingers *FingerBase knuckles forearm* fingers
+Thumb *Hand wrist forearm* thumb
"""
)
_TORSO = """
Hips - hips hips
Spine Hips spine spine
Spine1 Spine spine1 spine1
Spine2 Spine1 chest chest
Neck Spine2 neck neck
*Shoulder Spine2 collar chest
"""
_MIXAMO = (
    _TORSO
    + _LIMBS.format(hip="Hips")
    + """
Head Neck head head
HeadTop_End Head top head top
*ToeBase *Foot ball toes toes
*Hand *ForeArm wrist forearm*
*HandMiddle1 *Hand knuckles forearm* fingers
"""
)
_LAFAN1 = (
    _TORSO
    + _LIMBS.format(hip="Hips")
    + """
Head Neck head head head
*Toe *Foot ball toes ball
*Hand *ForeArm wrist forearm* wrist
"""
)


def _rows(table: str) -> list[tuple[str, str, str, str, str, int]]:
    """Rows of a table, with the side for those of both sides."""
    both_sides: list[tuple[str, str, str, str, str, int]] = []
    for row in filter(None, table.splitlines()):
        words = [*row.split(), ""][:5]
        for side in (0, 1) if "*" in row or "+" in row else (0,):
            name, parent, place, part, end = (
                word.replace("*", SIDES[side]).replace("+", SIDES[side][0]) for word in words
            )
            both_sides.append((name, parent.strip("-"), place, part, end, side))
    return both_sides


def _joints(table: str, prefix: str = "") -> list[Joint]:
    """The joints of a table in file order, with frames along the world's axes."""
    unordered = [
        Joint(
            prefix + name,
            parent and prefix + parent,
            joint_position(place, side),
            part,
            np.eye(3),
            joint_position(end, side) if end else None,
        )
        for name, parent, place, part, end, side in _rows(table)
    ]

    def below(joint: Joint) -> list[Joint]:
        return [joint, *(d for c in unordered if c.parent == joint.name for d in below(c))]

    return below(unordered[0])


def _cmu() -> Convention:
    """Bruce Hahne's conversion of CMU's database: legs apart by 20 degrees without rotations."""
    joints = []
    for joint in _joints(_CMU):
        apart = 20.0 * joint.part.startswith(("thigh", "shin", "foot", "toes"))
        frame = Rotation.from_euler("Z", -apart * np.sign(joint.place[0]), degrees=True)
        joints.append(replace(joint, frame=frame.as_matrix()))
    return Convention(tuple(joints), 0.0254 / 0.45, 120.0, t_pose=True)


def _lafan1() -> Convention:
    """LAFAN1: every bone lies along its own x axis."""
    joints = _joints(_LAFAN1)
    bones: list[Joint] = []
    for joint in joints:
        below = [j.place for j in joints if j.parent == joint.name]
        upright = joint.part in ("hips", "spine", "spine1", "chest", "neck", "head")
        if joint.name.endswith("Shoulder"):
            along, third = np.array([np.sign(joint.place[0]), 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        elif upright:
            along, third = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
        else:
            along = below[0] - joint.place if below else bones[-1].frame[:, 0]
            third = np.array([0.0, 1.0, 0.0] if "arm" in joint.part else [1.0, 0.0, 0.0])
        first = along / np.linalg.norm(along)
        second = np.cross(third, first)
        second /= np.linalg.norm(second)
        bones.append(
            replace(joint, frame=np.stack([first, second, np.cross(first, second)], axis=1))
        )
    return Convention(tuple(bones), 0.01, 30.0)


CONVENTIONS = {
    "cmu": _cmu(),
    "mixamo": Convention(tuple(_joints(_MIXAMO, "mixamorig:")), 0.01, 30.0),
    "lafan1": _lafan1(),
}


def clip(name: str, convention: str) -> str:
    """The text of a BVH file.

    Args:
        name: name of the motion, one of MOTIONS.
        convention: one of CONVENTIONS.
    """
    kind = CONVENTIONS[convention]
    duration, motion = MOTIONS[name]
    t = np.arange(round(duration * kind.rate) + 1) / kind.rate
    pose = Pose(t)
    motion(t, pose)
    parts, hips = part_rotations(pose), pose.hips
    if kind.t_pose:
        parts = {part: np.concatenate([[np.eye(3)], turn]) for part, turn in parts.items()}
        hips = np.concatenate([hips[:1], hips])
    columns = [hips / kind.unit]
    world = {joint.name: parts[joint.part] @ joint.frame for joint in kind.joints}
    for joint in kind.joints:
        turn = world[joint.name]
        if joint.parent:
            turn = world[joint.parent].swapaxes(1, 2) @ turn
        columns.append(_angles(turn))
    rows = "\n".join(" ".join(f"{x:.4f}" for x in row) for row in np.hstack(columns))
    head = f"MOTION\nFrames: {len(hips)}\nFrame Time: {1.0 / kind.rate:.7f}\n"
    return f"HIERARCHY\n{_hierarchy(kind)}{head}{rows}\n"


def _angles(turn: Array) -> Array:
    """(T, 3) angles of successive rotations about z, y and x [deg], also at y = 90."""
    z = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    c, s = np.cos(z), np.sin(z)
    y = np.arctan2(-turn[:, 2, 0], c * turn[:, 0, 0] + s * turn[:, 1, 0])
    x = np.arctan2(s * turn[:, 0, 2] - c * turn[:, 1, 2], c * turn[:, 1, 1] - s * turn[:, 0, 1])
    return np.degrees(np.stack([z, y, x], axis=1))


def _hierarchy(kind: Convention) -> str:
    """The joints, with their offsets in their parents' frames."""
    placed = {joint.name: joint for joint in kind.joints}
    lines: list[str] = []

    def add(joint: Joint, depth: int) -> None:
        above, pad = placed.get(joint.parent), "\t" * depth
        offset = above.frame.T @ (joint.place - above.place) if above else 0.0 * joint.place
        moves = "" if above else "Xposition Yposition Zposition "
        lines.append(f"{pad}{'JOINT' if above else 'ROOT'} {joint.name}\n{pad}{{")
        lines.append(f"{pad}\tOFFSET {_numbers(offset / kind.unit)}")
        count = 3 if above else 6
        lines.append(f"{pad}\tCHANNELS {count} {moves}Zrotation Yrotation Xrotation")
        for below in kind.joints:
            if below.parent == joint.name:
                add(below, depth + 1)
        if joint.end is not None:
            end = _numbers(joint.frame.T @ (joint.end - joint.place) / kind.unit)
            lines.append(f"{pad}\tEnd Site\n{pad}\t{{\n{pad}\t\tOFFSET {end}\n{pad}\t}}")
        lines.append(f"{pad}}}")

    add(kind.joints[0], 0)
    return "\n".join(lines) + "\n"


def _numbers(values: Array) -> str:
    return " ".join(f"{value + 0.0:.5f}" for value in values)


def write(folder: Path, convention: str = "cmu") -> list[Path]:
    """The paths of the ten clips, written as FOLDER/NAME.bvh.

    Args:
        folder: destination, created if necessary.
        convention: one of CONVENTIONS.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.bvh" for name in MOTIONS]
    for path in paths:
        path.write_text(clip(path.stem, convention), encoding="utf-8")
    return paths


if __name__ == "__main__":
    for kind in sys.argv[2:] or CONVENTIONS:
        for path in write(Path(sys.argv[1]) / kind, kind):
            print(path)
