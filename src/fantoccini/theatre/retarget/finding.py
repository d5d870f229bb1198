"""Search for the joints of a person in a skeleton, by its tree and the lengths of its bones.

The two longest pairs of mirrored limbs are arms and legs; the legs are nearer to the root, and the
head is the branch between the arms. Sides come from names or, without them, from the toes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, unit
from fantoccini.theatre.capture import Skeleton
from fantoccini.theatre.retarget.limbs import ARM, LEG, JointTree, Limb, Pair
from fantoccini.theatre.retarget.naming import END, limb_called, part_called, side_of

_MIN_LIMB_LENGTH = 0.5
"""Least length of limbs, relative to the longest."""
_MAX_OTHER_LENGTH = 0.7
"""Largest length of other pairs of limbs, relative to the shorter of the two longest."""
_MAX_LENGTH_BEYOND = 0.6
"""Largest length beyond hand or foot, relative to the limb."""
_MAX_LIMB_DIFFERENCE = 0.25
"""Largest relative difference in length of left and right limbs."""
_MIN_STANDING_COSINE = 0.5
"""Least cosine between the trunk and the legs, both upwards, of a standing pose."""
_MIN_LEG_COSINE = 0.5
"""Least cosine between front and hind legs of an animal."""
_MIN_TOE_SHARE = 0.25
"""Least horizontal share of the toes' length for which they have a direction."""
_MAX_POSES = 200
"""Largest number of frames to examine."""


@dataclass(frozen=True)
class Doubt:
    """Sign that a part may be another joint.

    Attributes:
        part: part of a person (``knee_left``); "" for all.
        reason: sentence without a full stop.
    """

    part: str
    reason: str

    def __str__(self) -> str:
        return f"{self.part}: {self.reason}" if self.part else self.reason


@dataclass(frozen=True)
class Guess:
    """Joints of a person.

    Attributes:
        joints: part -> index of the joint.
        doubts: signs of errors.
    """

    joints: dict[str, int]
    doubts: tuple[Doubt, ...]


def guess_joints(skeleton: Skeleton, positions: Array | None = None) -> Guess:
    """Joints of a person in a skeleton with any names.

    Args:
        skeleton: joints, parents first.
        positions: (T, n, 3) positions in a clip. They determine the lengths of the bones, and the
            directions if the rest pose does not stand.

    Raises:
        StateError: the skeleton is not that of one person, or its sides cannot be determined; the
            message has the reason.
    """
    if positions is not None:
        positions = positions[:: max(1, len(positions) // _MAX_POSES)]
    tree = JointTree(skeleton, positions)
    pairs = _longest_pairs(tree)
    legs, arms, doubts = _legs_and_arms(tree, *pairs[:2])
    doubts += [
        Doubt("", f"{_names(tree, pair)} may be limbs as well; they are left out")
        for pair in pairs[2:]
    ]
    head = _head(tree, legs, arms)
    poses = _standing(skeleton, positions, legs, arms)
    _check_upright(poses, legs, arms)
    joints = {"head": head}
    left_first, side_doubts = _sides(tree, poses, legs, arms)
    doubts += side_doubts
    for pair, parts, is_first in zip((arms, legs), (ARM, LEG), left_first, strict=True):
        limbs = pair.limbs if is_first else pair.limbs[::-1]
        for side, limb in zip(("left", "right"), limbs, strict=True):
            names = [f"{part}_{side}" for part in parts]
            joints.update(zip(names, limb.joints, strict=True))
            doubts += _limb_doubts(tree, names, limb)
        lengths = [limb.length for limb in limbs]
        if max(lengths) - min(lengths) > _MAX_LIMB_DIFFERENCE * max(lengths):
            doubts.append(Doubt("", f"{_names(tree, pair)} differ in length"))
    return Guess(joints, (*doubts, *_name_doubts(skeleton, tree, joints)))


def _longest_pairs(tree: JointTree) -> list[Pair]:
    """Pairs of limbs: the two longest, then others that are about as long."""
    roots = [i for i, parent in enumerate(tree.parents) if parent < 0]
    pairs = [pair for root in roots for pair in tree.pairs(root)]
    pairs.sort(key=lambda pair: -pair.length)
    if len(pairs) < 2:
        raise StateError(
            f"found {len(pairs) or 'no'} pair{'' if len(pairs) == 1 else 's'} of limbs of two "
            "bones; needed: arms and legs"
        )
    limbs = sum(pair.length > _MIN_LIMB_LENGTH * pairs[0].length for pair in pairs)
    if limbs > 3:
        raise StateError(f"found {limbs} pairs of limbs, of several people or an animal")
    return pairs[:2] + [p for p in pairs[2:] if p.length > _MAX_OTHER_LENGTH * pairs[1].length]


def _legs_and_arms(tree: JointTree, a: Pair, b: Pair) -> tuple[Pair, Pair, list[Doubt]]:
    """Legs and arms among two pairs of limbs, by a vote of several signs, and doubts."""
    root_side = (tree.height(a.junction) < tree.height(b.junction)) - (
        tree.height(a.junction) > tree.height(b.junction)
    )
    called = [limb_called([tree.plain[i] for i in pair.path]) for pair in (a, b)]
    if called == ["leg", "leg"]:
        raise StateError(
            "both long pairs of limbs are called legs, as an animal's; needed: a person"
        )
    by_name = (called[0] == "leg") - (called[0] == "arm") - (called[1] == "leg")
    by_name = int(np.sign(by_name + (called[1] == "arm")))
    by_length = 1 if a.length > b.length else -1
    votes = 2 * root_side + 2 * by_name + by_length + 2 * _head_side(tree, a, b)
    legs, arms = (a, b) if votes > 0 else (b, a)
    doubts = []
    if abs(votes) < 2 or by_name * votes < 0:
        doubts.append(Doubt("", f"{_names(tree, arms)} may be legs, and the others arms"))
    return legs, arms, doubts


def _head_side(tree: JointTree, a: Pair, b: Pair) -> int:
    """1 if the head is nearer to the second pair, -1 if to the first, 0 if that is unclear."""
    others = [_branches(tree, pair.junction, (a, b)) for pair in (a, b)]
    if a.junction != b.junction:
        return bool(others[1]) - bool(others[0])
    if len(others[0]) != 1:
        return 0
    # All begin at one body: the head is near the shoulders.
    offsets = [tree.offsets[[limb.path[0] for limb in pair.limbs]].mean(axis=0) for pair in (a, b)]
    near = [float(np.linalg.norm(tree.offsets[others[0][0]] - offset)) for offset in offsets]
    return int(np.sign(near[0] - near[1]))


def _branches(tree: JointTree, junction: int, pairs: Sequence[Pair]) -> list[int]:
    """Children of a joint that lead neither into limbs nor to the junction of limbs."""
    taken = {i for pair in pairs for i in (pair.junction, *tree.above(pair.junction))}
    taken |= {limb.path[0] for pair in pairs for limb in pair.limbs}
    branches = [k for k in tree.children[junction] if k not in taken and not tree.is_added_joint(k)]
    return [k for k in branches if tree.lengths[k] + tree.depth[k] > 0.0]


def _head(tree: JointTree, legs: Pair, arms: Pair) -> int:
    """Joint of the head: the first with such a name in the branch between the arms, or its end."""
    for junction in (arms.junction, *tree.above(arms.junction)):
        if branches := _branches(tree, junction, (legs, arms)):
            break
    else:
        raise StateError("found arms and legs, but no head between the arms")
    named = [k for k in branches if _named_head(tree, k) is not None]
    joint = max(named or branches, key=lambda k: tree.lengths[k] + tree.depth[k])
    if (head := _named_head(tree, joint)) is not None:
        return head
    while True:
        below = [k for k in tree.children[joint] if not tree.plain[k].endswith(END)]
        if len(below) != 1 or tree.is_added_joint(below[0]):
            return joint
        joint = below[0]


def _named_head(tree: JointTree, joint: int) -> int | None:
    """First joint of a branch with the name of a head; None without one."""
    below = [i for i in tree.below(joint) if not tree.plain[i].endswith(END)]
    return next((i for i in below if part_called(tree.plain[i]) == "head"), None)


def _standing(skeleton: Skeleton, positions: Array | None, legs: Pair, arms: Pair) -> Array | None:
    """(T, n, 3) poses in which the skeleton stands: its rest pose if it does, or those of a clip.

    In some files the bones of the rest pose point along the axes of their joints.
    """
    rest = skeleton.rest[None]
    trunk, down, _ = _directions(rest, legs, arms)
    upright = -float(trunk[0] @ down[0])
    if upright > _MIN_STANDING_COSINE or (positions is None and upright > -_MIN_STANDING_COSINE):
        return rest
    return positions


def _directions(poses: Array, legs: Pair, arms: Pair) -> tuple[Array, Array, Array]:
    """(T, 3) directions of the trunk, from hips to shoulders, of the legs and of the arms."""

    def middle(pair: Pair, joint: int) -> Array:
        a, b = (poses[:, limb.joints[joint]] for limb in pair.limbs)
        return np.asarray(0.5 * (a + b))

    hips, shoulders = middle(legs, 0), middle(arms, 0)
    return unit(shoulders - hips), unit(middle(legs, 2) - hips), unit(middle(arms, 2) - shoulders)


def _check_upright(poses: Array | None, legs: Pair, arms: Pair) -> None:
    """Raises StateError if the arms are front legs."""
    if poses is None:
        return
    trunk, hind, front = _directions(poses, legs, arms)
    level = float(np.median(np.abs(np.sum(trunk * hind, axis=1))))
    parallel = float(np.median(np.sum(hind * front, axis=1)))
    if level < _MIN_STANDING_COSINE and parallel > _MIN_LEG_COSINE:
        raise StateError("the skeleton stands on four legs, as an animal; needed: a person")


def _sides(
    tree: JointTree, poses: Array | None, legs: Pair, arms: Pair
) -> tuple[tuple[bool, bool], list[Doubt]]:
    """Whether the first of the arms, and the first of the legs, is the left one; and doubts."""
    signs = [_named_side(tree, pair) for pair in (arms, legs)]
    across = 0 if poses is None else _same_side(poses, legs, arms)
    toes = 0 if poses is None else _toes_side(tree, poses, legs, arms)
    doubts = []
    signs = [sign or other * across for sign, other in zip(signs, signs[::-1], strict=True)]
    if not any(signs):
        signs = [toes * across, toes]
    if not all(signs):
        raise StateError("neither the joints' names nor toes distinguish left and right")
    if signs[0] * signs[1] * across < 0:
        doubts.append(Doubt("", "by their names the left arm and the left leg are not on one side"))
    if signs[1] * toes < 0:
        doubts.append(Doubt("", "the toes point backwards if the names of the sides are right"))
    return (signs[0] > 0, signs[1] > 0), doubts


def _named_side(tree: JointTree, pair: Pair) -> int:
    """1 if the first limb of a pair is the left one according to most names, -1 if the other is."""
    sides = [
        side_of(tree.plain[a], tree.plain[b])
        for a, b in zip(pair.limbs[0].path, pair.limbs[1].path, strict=False)
    ]
    return int(np.sign(sides.count("left") - sides.count("right")))


def _across(poses: Array, pair: Pair) -> Array:
    """(T, 3) vectors from the second limb of a pair to the first."""
    a, b = (poses[:, limb.joints[0]] for limb in pair.limbs)
    return np.asarray(a - b)


def _same_side(poses: Array, legs: Pair, arms: Pair) -> int:
    """1 if the first arm and the first leg are on the same side, -1 if not."""
    cosines = np.sum(_across(poses, legs) * _across(poses, arms), axis=1)
    return int(np.sign(np.median(cosines)))


def _toes_side(tree: JointTree, poses: Array, legs: Pair, arms: Pair) -> int:
    """1 if the first leg is the left one according to the toes; 0 if there are none."""
    up, _, _ = _directions(poses, legs, arms)
    toes = sum(poses[:, limb.path[-1]] - poses[:, limb.joints[2]] for limb in legs.limbs)
    ahead = toes - np.sum(toes * up, axis=1, keepdims=True) * up
    lengths = np.linalg.norm(ahead, axis=1)
    if not np.median(lengths) > _MIN_TOE_SHARE * np.median(np.linalg.norm(toes, axis=1)):
        return 0
    left = np.cross(up, ahead)
    return int(np.sign(np.median(np.sum(left * _across(poses, legs), axis=1))))


def _limb_doubts(tree: JointTree, names: Sequence[str], limb: Limb) -> list[Doubt]:
    """Signs that the bones of a limb are wrong; none if all joints have names of its parts."""
    if all(part_called(tree.plain[joint]) for joint in limb.joints):
        return []
    doubts = []
    if not limb.is_plausible:
        doubts.append(Doubt(names[1], "upper and lower bone differ in length more than twofold"))
    if limb.beyond > _MAX_LENGTH_BEYOND * limb.length:
        doubts.append(Doubt(names[2], "the limb extends beyond it by more than half its length"))
    return doubts


def _name_doubts(skeleton: Skeleton, tree: JointTree, joints: dict[str, int]) -> list[Doubt]:
    """Signs that a joint is another part, by its name."""
    doubts = []
    for part, joint in joints.items():
        name = skeleton.names[joint]
        called = "" if name.endswith(END) else part_called(tree.plain[joint])
        if called not in ("", part.split("_")[0]):
            doubts.append(Doubt(part, f"{name!r} is the name of a {called}"))
    return doubts


def _names(tree: JointTree, pair: Pair) -> str:
    return " and ".join(repr(tree.plain[limb.joints[0]]) for limb in pair.limbs)
