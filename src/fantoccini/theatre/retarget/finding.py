"""Search for the joints of a person in a skeleton, by its tree and the lengths of its bones.

The two longest pairs of mirrored limbs are arms and legs; the legs are nearer to the root, and the
head is the branch between the arms. Sides come from names or, without them, from the toes.

A doubt is a sign that a joint may be the wrong part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, unit
from fantoccini.theatre.capture import Skeleton
from fantoccini.theatre.retarget.limbs import ARM_PARTS, LEG_PARTS, JointTree, Limb, Pair
from fantoccini.theatre.retarget.naming import END_SUFFIX, limb_of_names, part_of_name, side_of

_MIN_LIMB_LENGTH_RATIO = 0.5
"""Least length of limbs, relative to the longest."""
_MAX_OTHER_LENGTH_RATIO = 0.7
"""Largest length of other pairs of limbs, relative to the shorter of the two longest."""
_MAX_LENGTH_RATIO_BEYOND = 0.6
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
class JointGuess:
    """Joints of a person.

    Attributes:
        joints: part -> index of the joint.
        doubts: signs of errors.
    """

    joints: dict[str, int]
    doubts: tuple[Doubt, ...]


def guess_joints(skeleton: Skeleton, positions: Array | None = None) -> JointGuess:
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
        Doubt("", f"{_names_text(tree, pair)} may be limbs as well; they are left out")
        for pair in pairs[2:]
    ]
    head = _head_joint(tree, legs, arms)
    poses = _standing_poses(skeleton, positions, legs, arms)
    _check_upright(poses, legs, arms)
    joints = {"head": head}
    first_is_left, side_doubts = _first_is_left(tree, poses, legs, arms)
    doubts += side_doubts
    for pair, parts, first_on_left in zip(
        (arms, legs), (ARM_PARTS, LEG_PARTS), first_is_left, strict=True
    ):
        limbs = pair.limbs if first_on_left else pair.limbs[::-1]
        for side, limb in zip(("left", "right"), limbs, strict=True):
            names = [f"{part}_{side}" for part in parts]
            joints.update(zip(names, limb.joints, strict=True))
            doubts += _doubts_of_limb(tree, names, limb)
        lengths = [limb.length for limb in limbs]
        if max(lengths) - min(lengths) > _MAX_LIMB_DIFFERENCE * max(lengths):
            doubts.append(Doubt("", f"{_names_text(tree, pair)} differ in length"))
    return JointGuess(joints, (*doubts, *_doubts_of_names(skeleton, tree, joints)))


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
    n_pairs = sum(pair.length > _MIN_LIMB_LENGTH_RATIO * pairs[0].length for pair in pairs)
    if n_pairs > 3:
        raise StateError(f"found {n_pairs} pairs of limbs, of several people or an animal")
    return pairs[:2] + [
        p for p in pairs[2:] if p.length > _MAX_OTHER_LENGTH_RATIO * pairs[1].length
    ]


def _legs_and_arms(tree: JointTree, first: Pair, second: Pair) -> tuple[Pair, Pair, list[Doubt]]:
    """Legs and arms among two pairs of limbs, by a vote of several signs, and doubts."""
    root_side = (tree.root_distance(first.junction) < tree.root_distance(second.junction)) - (
        tree.root_distance(first.junction) > tree.root_distance(second.junction)
    )
    limb_names = [
        limb_of_names([tree.plain_names[i] for i in pair.path]) for pair in (first, second)
    ]
    if limb_names == ["leg", "leg"]:
        raise StateError(
            "both long pairs of limbs are called legs, as an animal's; needed: a person"
        )
    by_name = (limb_names[0] == "leg") - (limb_names[0] == "arm") - (limb_names[1] == "leg")
    by_name = int(np.sign(by_name + (limb_names[1] == "arm")))
    by_length = 1 if first.length > second.length else -1
    votes = 2 * root_side + 2 * by_name + by_length + 2 * _head_side_sign(tree, first, second)
    legs, arms = (first, second) if votes > 0 else (second, first)
    doubts = []
    if abs(votes) < 2 or by_name * votes < 0:
        doubts.append(Doubt("", f"{_names_text(tree, arms)} may be legs, and the others arms"))
    return legs, arms, doubts


def _head_side_sign(tree: JointTree, first: Pair, second: Pair) -> int:
    """1 if the head is nearer to the second pair, -1 if to the first, 0 if that is unclear."""
    branches = [_branches(tree, pair.junction, (first, second)) for pair in (first, second)]
    if first.junction != second.junction:
        return bool(branches[1]) - bool(branches[0])
    if len(branches[0]) != 1:
        return 0
    # All begin at one body: the head is near the shoulders.
    offsets = [
        tree.offsets[[limb.path[0] for limb in pair.limbs]].mean(axis=0) for pair in (first, second)
    ]
    distances = [float(np.linalg.norm(tree.offsets[branches[0][0]] - offset)) for offset in offsets]
    return int(np.sign(distances[0] - distances[1]))


def _branches(tree: JointTree, junction: int, pairs: Sequence[Pair]) -> list[int]:
    """Children of a joint that lead neither into limbs nor to the junction of limbs."""
    excluded = {i for pair in pairs for i in (pair.junction, *tree.ancestors(pair.junction))}
    excluded |= {limb.path[0] for pair in pairs for limb in pair.limbs}
    branches = [
        child
        for child in tree.children[junction]
        if child not in excluded and not tree.is_accessory_joint(child)
    ]
    return [child for child in branches if tree.lengths[child] + tree.branch_lengths[child] > 0.0]


def _head_joint(tree: JointTree, legs: Pair, arms: Pair) -> int:
    """Joint of the head: the first with such a name in the branch between the arms, or its end."""
    for junction in (arms.junction, *tree.ancestors(arms.junction)):
        if branches := _branches(tree, junction, (legs, arms)):
            break
    else:
        raise StateError("found arms and legs, but no head between the arms")
    named_branches = [child for child in branches if _head_by_name(tree, child) is not None]
    joint = max(
        named_branches or branches,
        key=lambda child: tree.lengths[child] + tree.branch_lengths[child],
    )
    if (head := _head_by_name(tree, joint)) is not None:
        return head
    while True:
        children = [
            child
            for child in tree.children[joint]
            if not tree.plain_names[child].endswith(END_SUFFIX)
        ]
        if len(children) != 1 or tree.is_accessory_joint(children[0]):
            return joint
        joint = children[0]


def _head_by_name(tree: JointTree, joint: int) -> int | None:
    """First joint of a branch with the name of a head; None without one."""
    joints = [i for i in tree.subtree(joint) if not tree.plain_names[i].endswith(END_SUFFIX)]
    return next((i for i in joints if part_of_name(tree.plain_names[i]) == "head"), None)


def _standing_poses(
    skeleton: Skeleton, positions: Array | None, legs: Pair, arms: Pair
) -> Array | None:
    """(T, n, 3) poses in which the skeleton stands: its rest pose if it does, or those of a clip.

    In some files the bones of the rest pose point along the axes of their joints.
    """
    rest = skeleton.rest[None]
    trunk_direction, legs_direction, _ = _directions(rest, legs, arms)
    upright = -float(trunk_direction[0] @ legs_direction[0])
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
    trunk_direction, leg_direction, arm_direction = _directions(poses, legs, arms)
    trunk_cosine = float(np.median(np.abs(np.sum(trunk_direction * leg_direction, axis=1))))
    limb_cosine = float(np.median(np.sum(leg_direction * arm_direction, axis=1)))
    if trunk_cosine < _MIN_STANDING_COSINE and limb_cosine > _MIN_LEG_COSINE:
        raise StateError("the skeleton stands on four legs, as an animal; needed: a person")


def _first_is_left(
    tree: JointTree, poses: Array | None, legs: Pair, arms: Pair
) -> tuple[tuple[bool, bool], list[Doubt]]:
    """Whether the first of the arms, and the first of the legs, is the left one; and doubts."""
    signs = [_named_side_sign(tree, pair) for pair in (arms, legs)]
    same_side = 0 if poses is None else _same_side_sign(poses, legs, arms)
    toes_side = 0 if poses is None else _toes_side_sign(tree, poses, legs, arms)
    doubts = []
    signs = [
        sign or other_sign * same_side for sign, other_sign in zip(signs, signs[::-1], strict=True)
    ]
    if not any(signs):
        signs = [toes_side * same_side, toes_side]
    if not all(signs):
        raise StateError("neither the joints' names nor toes distinguish left and right")
    if signs[0] * signs[1] * same_side < 0:
        doubts.append(Doubt("", "by their names the left arm and the left leg are not on one side"))
    if signs[1] * toes_side < 0:
        doubts.append(Doubt("", "the toes point backwards if the names of the sides are right"))
    return (signs[0] > 0, signs[1] > 0), doubts


def _named_side_sign(tree: JointTree, pair: Pair) -> int:
    """1 if the first limb of a pair is the left one according to most names, -1 if the other is."""
    sides = [
        side_of(tree.plain_names[a], tree.plain_names[b])
        for a, b in zip(pair.limbs[0].path, pair.limbs[1].path, strict=False)
    ]
    return int(np.sign(sides.count("left") - sides.count("right")))


def _vectors_across(poses: Array, pair: Pair) -> Array:
    """(T, 3) vectors from the second limb of a pair to the first."""
    a, b = (poses[:, limb.joints[0]] for limb in pair.limbs)
    return np.asarray(a - b)


def _same_side_sign(poses: Array, legs: Pair, arms: Pair) -> int:
    """1 if the first arm and the first leg are on the same side, -1 if not."""
    cosines = np.sum(_vectors_across(poses, legs) * _vectors_across(poses, arms), axis=1)
    return int(np.sign(np.median(cosines)))


def _toes_side_sign(tree: JointTree, poses: Array, legs: Pair, arms: Pair) -> int:
    """1 if the first leg is the left one according to the toes; 0 if there are none."""
    up, _, _ = _directions(poses, legs, arms)
    toes = sum(poses[:, limb.path[-1]] - poses[:, limb.joints[2]] for limb in legs.limbs)
    horizontal_toes = toes - np.sum(toes * up, axis=1, keepdims=True) * up
    lengths = np.linalg.norm(horizontal_toes, axis=1)
    if not np.median(lengths) > _MIN_TOE_SHARE * np.median(np.linalg.norm(toes, axis=1)):
        return 0
    left = np.cross(up, horizontal_toes)
    return int(np.sign(np.median(np.sum(left * _vectors_across(poses, legs), axis=1))))


def _doubts_of_limb(tree: JointTree, part_names: Sequence[str], limb: Limb) -> list[Doubt]:
    """Signs that the bones of a limb are wrong; none if all joints have names of its parts."""
    if all(part_of_name(tree.plain_names[joint]) for joint in limb.joints):
        return []
    doubts = []
    if not limb.is_plausible:
        doubts.append(
            Doubt(part_names[1], "upper and lower bone differ in length more than twofold")
        )
    if limb.length_beyond > _MAX_LENGTH_RATIO_BEYOND * limb.length:
        doubts.append(
            Doubt(part_names[2], "the limb extends beyond it by more than half its length")
        )
    return doubts


def _doubts_of_names(skeleton: Skeleton, tree: JointTree, joints: dict[str, int]) -> list[Doubt]:
    """Signs that a joint is another part, by its name."""
    doubts = []
    for part, joint in joints.items():
        name = skeleton.names[joint]
        part_name = "" if name.endswith(END_SUFFIX) else part_of_name(tree.plain_names[joint])
        if part_name not in ("", part.split("_")[0]):
            doubts.append(Doubt(part, f"{name!r} is the name of a {part_name}"))
    return doubts


def _names_text(tree: JointTree, pair: Pair) -> str:
    return " and ".join(repr(tree.plain_names[limb.joints[0]]) for limb in pair.limbs)
