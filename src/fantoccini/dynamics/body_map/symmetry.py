"""Plane of symmetry of a puppet, from pairs of branches that are alike.

A segment is a body with the bodies fixed on it; a branch is a segment with everything that it
carries.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.body_map.anatomy import Anatomy

SIZE_TOLERANCE = 0.02
"""Largest difference of places and lengths of a pair, relative to the puppet's size."""
MASS_TOLERANCE = 0.1
"""Largest difference of the masses of a pair, relative to their sum."""
MAX_SLOPE = 0.5
"""Largest vertical component of the direction from one of a pair to the other."""


@dataclass(frozen=True, eq=False)
class Plane:
    """A vertical plane {p: across . p = offset}.

    Attributes:
        across: (3,) unit normal.
        offset: place along the normal [m].
        is_ambiguous: whether another plane explains the puppet as well.
    """

    across: Array
    offset: float
    is_ambiguous: bool = False

    def side(self, point: Array) -> float:
        """Distance of a point (3,) from the plane, along the normal [m]."""
        return float(self.across @ point - self.offset)


@dataclass(frozen=True)
class Branches:
    """Children of a segment, by their places about a plane.

    Attributes:
        pairs: pairs of children that are mirror images, on the side of the normal first.
        middle: children on the plane.
        unpaired: other children.
    """

    pairs: tuple[tuple[int, int], ...]
    middle: tuple[int, ...]
    unpaired: tuple[int, ...]


def alike(anatomy: Anatomy, i: int, j: int) -> bool:
    """Whether two branches have the same tree, lengths and masses."""
    a, b = anatomy.segments[i], anatomy.segments[j]
    if len(a.children) != len(b.children):
        return False
    if abs(a.mass - b.mass) > MASS_TOLERANCE * (a.mass + b.mass):
        return False
    tolerance = SIZE_TOLERANCE * anatomy.size
    if np.any(np.abs(a.box_lengths - b.box_lengths) > 2.0 * tolerance):
        return False
    unmatched = list(b.children)
    for child in a.children:
        candidates = [
            candidate
            for candidate in unmatched
            if abs(_joint_distance(anatomy, i, child) - _joint_distance(anatomy, j, candidate))
            <= tolerance
            and alike(anatomy, child, candidate)
        ]
        if not candidates:
            return False
        unmatched.remove(candidates[0])
    return True


def plane_of(anatomy: Anatomy) -> Plane | None:
    """The plane that explains most of the puppet; None without a pair of branches.

    Every pair of like branches of one segment proposes the plane between them. A plane scores the
    number of segments in pairs and on it, less that of the others. Of planes with equal scores, the
    one with the closer pairs is taken: bodies are longer than they are wide.
    """
    proposals: list[tuple[float, float, Plane]] = []
    for segment in anatomy.segments:
        for i, j in combinations(segment.children, 2):
            between = anatomy.segments[i].joint - anatomy.segments[j].joint
            distance = float(np.linalg.norm(between))
            if distance < SIZE_TOLERANCE * anatomy.size or not alike(anatomy, i, j):
                continue
            across = between / distance
            if abs(across[2]) > MAX_SLOPE:
                continue
            across = np.array([across[0], across[1], 0.0]) / np.hypot(across[0], across[1])
            middle = 0.5 * (anatomy.segments[i].joint + anatomy.segments[j].joint)
            plane = Plane(across, float(across @ middle))
            proposals.append((_score(anatomy, plane), -distance, plane))
    if not proposals:
        return None
    score, _, plane = max(proposals, key=lambda p: p[:2])
    is_ambiguous = any(
        s >= score and abs(p.across @ plane.across) < 1.0 - MAX_SLOPE for s, _, p in proposals
    )
    return Plane(plane.across, plane.offset, is_ambiguous)


def branches_of(anatomy: Anatomy, plane: Plane, segment: int) -> Branches:
    """The children of a segment, by their places about a plane."""
    tolerance = SIZE_TOLERANCE * anatomy.size
    unpaired_children = list(anatomy.segments[segment].children)
    pairs = []
    for i, j in combinations(anatomy.segments[segment].children, 2):
        if i not in unpaired_children or j not in unpaired_children:
            continue
        a, b = anatomy.segments[i].joint, anatomy.segments[j].joint
        mirrored_a = a - 2.0 * plane.side(a) * plane.across
        is_off_plane = abs(plane.side(a)) > 0.5 * tolerance
        if (
            is_off_plane
            and np.linalg.norm(mirrored_a - b) <= 2.0 * tolerance
            and alike(anatomy, i, j)
        ):
            pairs.append((i, j) if plane.side(a) > 0.0 else (j, i))
            unpaired_children.remove(i)
            unpaired_children.remove(j)
    middle = [
        k for k in unpaired_children if abs(plane.side(anatomy.segments[k].joint)) <= tolerance
    ]
    return Branches(
        tuple(pairs), tuple(middle), tuple(k for k in unpaired_children if k not in middle)
    )


def _score(anatomy: Anatomy, plane: Plane) -> float:
    """Number of segments explained by a plane, less that of the others; strings count a tenth."""
    score, middle_segments = 0.0, [0]
    for segment in middle_segments:
        branches = branches_of(anatomy, plane, segment)
        score += sum(len(list(anatomy.branch(k))) for pair in branches.pairs for k in pair)
        score += len(branches.middle)
        score -= sum(len(list(anatomy.branch(k))) for k in branches.unpaired)
        middle_segments += branches.middle
    sides = [plane.side(tie.position) for tie in anatomy.ties if tie.segment in middle_segments]
    tolerance = SIZE_TOLERANCE * anatomy.size
    return score + 0.1 * sum(any(abs(a + b) <= 2.0 * tolerance for b in sides) for a in sides)


def _joint_distance(anatomy: Anatomy, upper: int, lower: int) -> float:
    """Distance between the joints of a segment and one that it carries [m]."""
    between = anatomy.segments[lower].joint - anatomy.segments[upper].joint
    return float(np.linalg.norm(between))
