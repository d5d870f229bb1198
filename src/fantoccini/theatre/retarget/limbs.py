"""Limbs of a skeleton: chains of joints, and pairs of them that are mirror images."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.capture import Skeleton
from fantoccini.theatre.retarget.naming import (
    END,
    is_added,
    part_called,
    plain_names,
    side_of,
    stem_of,
)

ARM, LEG = ("shoulder", "elbow", "hand"), ("hip", "knee", "foot")
"""Start, middle and end of the limbs."""
_MAX_BONE_RATIO = 2.0
"""Largest ratio of the lengths of a limb's two bones."""
_MAX_DIFFERENCE = 0.1
"""Largest relative difference of the bones of two limbs of a pair."""
_MAX_TWIN_DIFFERENCE = 0.4
"""Largest relative difference of the bones of a pair whose names differ in their side only."""
_MIN_START_DISTANCE = 0.04
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
        beyond: length from the limb's end to the path's.
    """

    path: tuple[int, ...]
    joints: tuple[int, int, int]
    bones: tuple[float, float]
    beyond: float

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
        self.plain = plain_names(skeleton.names)
        self.offsets = skeleton.offsets
        bones = skeleton.offsets[None]
        if positions is not None:
            above = np.maximum(np.array(self.parents), 0)
            bones = positions - positions[:, above]
        self.lengths = np.median(np.linalg.norm(bones, axis=2), axis=0)
        self.children: list[list[int]] = [[] for _ in self.parents]
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                self.children[parent].append(i)

    @cached_property
    def depth(self) -> Array:
        """(n,) lengths from joints to the ends of their longest branches, without added joints."""
        depth = np.zeros(len(self.parents))
        for i in reversed(range(len(self.parents))):
            depth[i] = max(
                (
                    self.lengths[k] + depth[k]
                    for k in self.children[i]
                    if not self.is_added_joint(k)
                ),
                default=0.0,
            )
        return depth

    def is_added_joint(self, joint: int) -> bool:
        """Whether a joint belongs to a face, hair, clothes, props or controls."""
        return is_added(self.plain[joint])

    def above(self, joint: int) -> list[int]:
        """Joints from a joint's parent up to the root."""
        path = []
        while (joint := self.parents[joint]) >= 0:
            path.append(joint)
        return path

    def below(self, joint: int) -> list[int]:
        """A joint and all its descendants."""
        joints = [joint]
        for i in joints:
            joints += self.children[i]
        return joints

    def height(self, joint: int) -> float:
        """Length of the bones from the root to a joint."""
        return float(sum(self.lengths[i] for i in (joint, *self.above(joint)[:-1])))

    def limb(self, first: int) -> Limb | None:
        """Limb that begins at or after a joint: its two longest consecutive bones.

        Joints within a bone, such as twist joints, are recognised by their names. None if the
        longest branch has fewer than two bones.
        """
        path = [first]
        while below := [k for k in self.children[path[-1]] if not self.is_added_joint(k)]:
            path.append(max(below, key=lambda k: self.lengths[k] + self.depth[k]))
        merged = [i for i in range(len(path)) if not i or not self._same_bone(*path[i - 1 : i + 1])]
        limbs = [_longest(self, path, places) for places in (merged, range(len(path)))]
        return next((limb for limb in limbs if limb and limb.is_plausible), limbs[0] or limbs[1])

    def _same_bone(self, above: int, joint: int) -> bool:
        """Whether a joint is a piece of the bone of the joint above it."""
        names = self.plain[above], self.plain[joint]
        return not names[1].endswith(END) and stem_of(names[0]) == stem_of(names[1])

    def pairs(self, joint: int = 0) -> list[Pair]:
        """Pairs of limbs in the branch of a joint, without those within a limb."""
        children = [k for k in self.children[joint] if not self.is_added_joint(k)]
        inner = {k: self.pairs(k) for k in children}
        limbs = {
            k: limb
            for k in children
            if (limb := self.limb(k)) and not self._has_limbs(inner[k], limb)
        }
        pairs, taken = [], set[int]()
        for _, a, b in sorted(self._similar(limbs)):
            if not taken & {a, b}:
                pairs.append(Pair(joint, (limbs[a], limbs[b])))
                taken |= {a, b}
        return pairs + [pair for k in children if k not in taken for pair in inner[k]]

    def _has_limbs(self, inner: Sequence[Pair], limb: Limb) -> bool:
        """Whether a branch has limbs of its own, so that it is no limb."""
        return any(pair.length > _MAX_INNER_LENGTH * limb.length for pair in inner)

    def _similar(self, limbs: dict[int, Limb]) -> Iterator[tuple[tuple[bool, float], int, int]]:
        """Measure of their difference, and first joints, of limbs that may be a pair."""
        for a, b in combinations(limbs, 2):
            bones = np.array([limbs[a].bones, limbs[b].bones])
            difference = float(np.max(np.abs(bones[0] - bones[1]) / np.maximum(bones.max(0), 1e-9)))
            twins = bool(side_of(self.plain[a], self.plain[b]))
            if difference < (_MAX_TWIN_DIFFERENCE if twins else _MAX_DIFFERENCE):
                yield (not twins, difference), a, b


def _longest(tree: JointTree, path: Sequence[int], places: Sequence[int]) -> Limb | None:
    """Limb of the longest two consecutive bones between given places of a path.

    Among bones of similar length, those whose joints have the names of a limb's parts are
    preferred: some collar bones are longer than forearms.
    """
    ends = np.concatenate([[0.0], np.cumsum(tree.lengths[list(path[1:])])])
    bones = np.diff(ends[list(places)])
    sums = bones[:-1] + bones[1:]
    valid = np.minimum(bones[:-1], bones[1:]) > 0.0
    if not np.any(valid):
        return None
    is_far = tree.lengths[path[0]] + ends[list(places[:-2])] > _MIN_START_DISTANCE * sums.max()
    choices = np.flatnonzero(valid & is_far if np.any(valid & is_far) else valid)
    long = choices[sums[choices] > _MIN_NAMED_LENGTH * sums[choices].max()]
    joints = [(path[places[i]], path[places[i + 1]], path[places[i + 2]]) for i in long]
    scores = [_agreement([tree.plain[k] for k in three]) for three in joints]
    best = max(range(len(long)), key=lambda j: (scores[j], sums[long[j]]))
    i = int(long[best])
    lengths = float(bones[i]), float(bones[i + 1])
    return Limb(tuple(path), joints[best], lengths, float(ends[-1] - ends[places[i + 2]]))


def _agreement(names: Sequence[str]) -> int:
    """Number of joints with the name of their part of a limb, less those with another's name."""
    parts = [part_called(name) for name in names]
    return sum(
        0 if not part else 1 if part in (arm, leg) else -1
        for part, arm, leg in zip(parts, ARM, LEG, strict=True)
    )
