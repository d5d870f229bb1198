"""Limbs of a skeleton: chains of joints, and pairs of them that are mirror images.

A bone is the line from a joint to the next one. A twin is the mirror image of a joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.capture import Skeleton
from fantoccini.theatre.retarget.naming import (
    END_SUFFIX,
    is_accessory,
    part_of_name,
    plain_names,
    side_of,
    stem_of,
)

ARM_PARTS, LEG_PARTS = ("shoulder", "elbow", "hand"), ("hip", "knee", "foot")
"""Start, middle and end of the limbs."""
_MAX_BONE_RATIO = 2.0
"""Largest ratio of the lengths of a limb's two bones."""
_MAX_DIFFERENCE = 0.1
"""Largest relative difference of the bones of two limbs of a pair."""
_MAX_TWIN_DIFFERENCE = 0.4
"""Largest relative difference of the bones of a pair whose names differ in their side only."""
_MIN_START_DISTANCE_RATIO = 0.04
"""Least distance of a shoulder or hip from the joint between both, relative to the limb."""
_MIN_NAMED_LENGTH = 0.7
"""Length, relative to that of the longest choice, above which a choice is judged by its names."""
_MAX_INNER_LENGTH = 0.6
"""Largest length of limbs within a limb, relative to its own."""


@dataclass(frozen=True)
class Limb:
    """Chain of joints with the upper and lower bone of a limb.

    Attributes:
        path: all joints, from the first to the end of the longest branch.
        joints: start, middle and end of the limb: shoulder, elbow, hand.
        bones: lengths of the upper and lower bone.
        length_beyond: length from the limb's end to the path's.
    """

    path: tuple[int, ...]
    joints: tuple[int, int, int]
    bones: tuple[float, float]
    length_beyond: float

    @property
    def length(self) -> float:
        """Length of both bones."""
        return sum(self.bones)

    @property
    def is_plausible(self) -> bool:
        """Whether the bones are similar in length."""
        return max(self.bones) <= _MAX_BONE_RATIO * min(self.bones)


@dataclass(frozen=True)
class Pair:
    """Two limbs at one joint that are mirror images.

    Attributes:
        junction: joint at which both begin.
        limbs: the limbs, in any order.
    """

    junction: int
    limbs: tuple[Limb, Limb]

    @property
    def length(self) -> float:
        """Mean length of the limbs."""
        return 0.5 * (self.limbs[0].length + self.limbs[1].length)

    @property
    def path(self) -> tuple[int, ...]:
        """Joints of both."""
        return self.limbs[0].path + self.limbs[1].path


class JointTree:
    """Skeleton as a tree with the lengths of its bones."""

    def __init__(self, skeleton: Skeleton, positions: Array | None = None):
        """Tree of a skeleton.

        Args:
            skeleton: joints, parents first.
            positions: (T, n, 3) positions over time; median lengths of the bones in them replace
                the offsets, which are 0 in some files.
        """
        self.parents = skeleton.parents
        self.plain_names = plain_names(skeleton.names)
        self.offsets = skeleton.offsets
        bones = skeleton.offsets[None]
        if positions is not None:
            parents = np.maximum(np.array(self.parents), 0)
            bones = positions - positions[:, parents]
        self.lengths = np.median(np.linalg.norm(bones, axis=2), axis=0)
        self.children: list[list[int]] = [[] for _ in self.parents]
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                self.children[parent].append(i)

    @cached_property
    def branch_lengths(self) -> Array:
        """(n,) lengths from joints to the ends of their longest branches, without added joints."""
        lengths = np.zeros(len(self.parents))
        for i in reversed(range(len(self.parents))):
            lengths[i] = max(
                (
                    self.lengths[k] + lengths[k]
                    for k in self.children[i]
                    if not self.is_accessory_joint(k)
                ),
                default=0.0,
            )
        return lengths

    def is_accessory_joint(self, joint: int) -> bool:
        """Whether a joint belongs to a face, hair, clothes, props or controls."""
        return is_accessory(self.plain_names[joint])

    def ancestors(self, joint: int) -> list[int]:
        """Joints from a joint's parent up to the root."""
        path = []
        while (joint := self.parents[joint]) >= 0:
            path.append(joint)
        return path

    def subtree(self, joint: int) -> list[int]:
        """A joint and all its descendants."""
        joints = [joint]
        for i in joints:
            joints += self.children[i]
        return joints

    def root_distance(self, joint: int) -> float:
        """Length of the bones from the root to a joint."""
        return float(sum(self.lengths[i] for i in (joint, *self.ancestors(joint)[:-1])))

    def limb(self, first: int) -> Limb | None:
        """Limb that begins at or after a joint: its two longest consecutive bones.

        Joints within a bone, such as twist joints, are recognised by their names. None if the
        longest branch has fewer than two bones.
        """
        path = [first]
        while children := [k for k in self.children[path[-1]] if not self.is_accessory_joint(k)]:
            path.append(max(children, key=lambda k: self.lengths[k] + self.branch_lengths[k]))
        bone_starts = [
            i for i in range(len(path)) if not i or not self._same_bone(*path[i - 1 : i + 1])
        ]
        limbs = [
            _longest_limb(self, path, joint_indices)
            for joint_indices in (bone_starts, range(len(path)))
        ]
        return next((limb for limb in limbs if limb and limb.is_plausible), limbs[0] or limbs[1])

    def _same_bone(self, parent: int, joint: int) -> bool:
        """Whether a joint is a piece of the bone of the joint above it."""
        names = self.plain_names[parent], self.plain_names[joint]
        return not names[1].endswith(END_SUFFIX) and stem_of(names[0]) == stem_of(names[1])

    def pairs(self, joint: int = 0) -> list[Pair]:
        """Pairs of limbs in the branch of a joint, without those within a limb."""
        children = [child for child in self.children[joint] if not self.is_accessory_joint(child)]
        inner_pairs = {child: self.pairs(child) for child in children}
        limbs = {
            child: limb
            for child in children
            if (limb := self.limb(child)) and not self._has_limbs(inner_pairs[child], limb)
        }
        pairs, paired = [], set[int]()
        for _, a, b in sorted(self._similar_limbs(limbs)):
            if not paired & {a, b}:
                pairs.append(Pair(joint, (limbs[a], limbs[b])))
                paired |= {a, b}
        return pairs + [
            pair for child in children if child not in paired for pair in inner_pairs[child]
        ]

    def _has_limbs(self, inner_pairs: Sequence[Pair], limb: Limb) -> bool:
        """Whether a branch has limbs of its own, so that it is no limb."""
        return any(pair.length > _MAX_INNER_LENGTH * limb.length for pair in inner_pairs)

    def _similar_limbs(
        self, limbs: dict[int, Limb]
    ) -> Iterator[tuple[tuple[bool, float], int, int]]:
        """Measure of their difference, and first joints, of limbs that may be a pair."""
        for a, b in combinations(limbs, 2):
            bones = np.array([limbs[a].bones, limbs[b].bones])
            difference = float(np.max(np.abs(bones[0] - bones[1]) / np.maximum(bones.max(0), 1e-9)))
            are_twins = bool(side_of(self.plain_names[a], self.plain_names[b]))
            if difference < (_MAX_TWIN_DIFFERENCE if are_twins else _MAX_DIFFERENCE):
                yield (not are_twins, difference), a, b


def _longest_limb(
    tree: JointTree, path: Sequence[int], joint_indices: Sequence[int]
) -> Limb | None:
    """Limb of the longest two consecutive bones between given places of a path.

    Among bones of similar length, those whose joints have the names of a limb's parts are
    preferred: some collar bones are longer than forearms.
    """
    path_lengths = np.concatenate([[0.0], np.cumsum(tree.lengths[list(path[1:])])])
    bones = np.diff(path_lengths[list(joint_indices)])
    limb_lengths = bones[:-1] + bones[1:]
    valid = np.minimum(bones[:-1], bones[1:]) > 0.0
    if not np.any(valid):
        return None
    starts_far = (
        tree.lengths[path[0]] + path_lengths[list(joint_indices[:-2])]
        > _MIN_START_DISTANCE_RATIO * limb_lengths.max()
    )
    valid_indices = np.flatnonzero(valid & starts_far if np.any(valid & starts_far) else valid)
    candidates = valid_indices[
        limb_lengths[valid_indices] > _MIN_NAMED_LENGTH * limb_lengths[valid_indices].max()
    ]
    joints = [
        (path[joint_indices[i]], path[joint_indices[i + 1]], path[joint_indices[i + 2]])
        for i in candidates
    ]
    scores = [_name_score([tree.plain_names[k] for k in joint_triple]) for joint_triple in joints]
    best = max(range(len(candidates)), key=lambda j: (scores[j], limb_lengths[candidates[j]]))
    i = int(candidates[best])
    lengths = float(bones[i]), float(bones[i + 1])
    return Limb(
        tuple(path),
        joints[best],
        lengths,
        float(path_lengths[-1] - path_lengths[joint_indices[i + 2]]),
    )


def _name_score(names: Sequence[str]) -> int:
    """Number of joints with the name of their part of a limb, less those with another's name."""
    parts = [part_of_name(name) for name in names]
    return sum(
        0 if not part else 1 if part in (arm_part, leg_part) else -1
        for part, arm_part, leg_part in zip(parts, ARM_PARTS, LEG_PARTS, strict=True)
    )
