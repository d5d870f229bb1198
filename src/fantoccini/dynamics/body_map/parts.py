"""Trunk, head and limbs of a puppet, from its branches about the plane of symmetry.

A segment is a body with the bodies fixed on it. The root is the segment that carries all others of
its tree, and a twin the mirror image of a branch.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.body_map.anatomy import NO_PARENT, Anatomy
from fantoccini.dynamics.body_map.symmetry import Plane, branches_of, plane_of
from fantoccini.model.puppet import LimbKind

MAX_GROUND_HEIGHT = 0.15
"""Largest height of a limb that reaches the ground, relative to the puppet's height."""
MAX_DOUBTFUL_HEIGHT = 0.25
"""Largest height of a limb that may be an arm or a leg, relative to the puppet's height."""
MIN_LIMB_LENGTH = 0.15
"""Smallest length of a limb of one body on a string, relative to the puppet's size."""
MAX_THICKNESS, MIN_BREADTH = 0.35, 0.15
"""Largest thickness of a flat body, relative to its breadth; and smallest breadth, relative to its
length."""
MIN_LENGTH_RATIO = 2.0
"""Ratio of lengths from which a branch continues in its longest child."""
END_SHARE = 0.15
"""Part of a body's length that counts as its end."""
MIN_HEAD_SCORE = 2.0
"""Smallest score of a head; the largest branch in the middle has at least 1."""
MIN_HEAD_MASS = 0.5
"""Smallest mass of a head, relative to the heaviest body of its branch."""
CLEAR_MARGIN, CLEAR_RISE = 0.5, 0.1
"""Margin of scores, and height above the trunk relative to the puppet's height, above which a head
is not doubtful."""

MIN_PLANE_OFFSET = 1e-3
"""Smallest distance of an end from the plane of symmetry that is not rounding, relative to the
puppet's size."""


@dataclass(frozen=True, eq=False)
class Branch:
    """A chain of segments that begins at the trunk.

    Attributes:
        chain: indices of its segments, from the trunk to the end.
        end: (3,) its end, in the frame of the last segment [m].
        kind: kind of limb; the head is the last segment of a neck.
        twin: index of the first segment of the limb on the other side; -1 without one.
        doubts: reasons for doubt.
    """

    chain: tuple[int, ...]
    end: Array
    kind: LimbKind = "arm"
    twin: int = -1
    doubts: tuple[str, ...] = ()

    def doubted(self, reason: str) -> Branch:
        """The branch with one more reason for doubt."""
        return replace(self, doubts=(*self.doubts, reason))


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of a puppet.

    Attributes:
        trunk: indices of the trunk's segments; the first carries the others.
        head: the head and its neck; None without one.
        limbs: limbs.
        plane: plane of symmetry.
        doubts: reasons for doubt about the trunk.
    """

    trunk: tuple[int, ...]
    head: Branch | None
    limbs: tuple[Branch, ...]
    plane: Plane
    doubts: tuple[str, ...] = field(default=())


def parts_of(anatomy: Anatomy, name: str) -> Parts:
    """Trunk, head and limbs.

    Raises:
        StateError: the puppet has no pair of limbs; the message has its bodies.
    """
    plane = plane_of(anatomy)
    trunk = () if plane is None else _trunk(anatomy, plane)
    if plane is None or not trunk:
        bodies = ", ".join(segment.name for segment in anatomy.segments[:6])
        ellipsis = ", ..." if len(anatomy.segments) > 6 else ""
        raise StateError(
            f"{name} has no body map: no two branches of its bodies ({bodies}{ellipsis}) are "
            "alike, "
            "one on each side. A body map has a trunk with at least one pair of limbs; give it "
            "under `rig` in the puppet file"
        )
    limbs: list[Branch] = []
    middles: list[Branch] = []
    for segment in trunk:
        branches = branches_of(anatomy, plane, segment)
        for pair in branches.pairs:
            if is_limb_pair(anatomy, pair):
                limbs += _pair(anatomy, trunk, pair)
        middles += [_branch(anatomy, k) for k in branches.middle if k not in trunk]
        for k in branches.unpaired:
            unpaired = replace(_branch(anatomy, k), kind=_kind(anatomy, trunk, k))
            limbs.append(unpaired.doubted("it has no twin on the other side"))
    head, tails = _head(anatomy, trunk, middles)
    head = None if head is None else _in_plane(anatomy, plane, head)
    tails = [_in_plane(anatomy, plane, tail) for tail in tails]
    doubts: tuple[str, ...] = ()
    if plane.is_ambiguous:
        doubts = (
            "its two ends are as alike as its two sides, so that front and side may be swapped",
        )
    return Parts(trunk, head, (*_without_wings_as_legs(anatomy, limbs), *tails), plane, doubts)


def _in_plane(anatomy: Anatomy, plane: Plane, branch: Branch) -> Branch:
    """The branch of a body in the middle with its end in the plane of symmetry.

    A head on a pair of strings ends between their ties.
    """
    segment = anatomy.segments[branch.chain[-1]]
    R, r = segment.pose[:, :3], segment.pose[:, 3]
    distance = plane.side(R @ branch.end + r)
    if abs(distance) < MIN_PLANE_OFFSET * anatomy.size:
        return branch
    return replace(branch, end=branch.end - distance * (plane.across @ R))


def is_limb_pair(anatomy: Anatomy, pair: tuple[int, int]) -> bool:
    """Whether branches are limbs, and not ears: of two bodies, on the ground, or on strings."""
    first = pair[0]
    if (
        anatomy.segments[first].children
        or anatomy.relative_lowest_height(first) <= MAX_GROUND_HEIGHT
    ):
        return True
    is_long = _length(anatomy, _branch(anatomy, first)) >= MIN_LIMB_LENGTH * anatomy.size
    return is_long and bool(anatomy.ties_of(first))


def far_end(anatomy: Anatomy, segment: int) -> Array:
    """(3,) point at the end of a segment that is far from its joint, in its frame [m].

    It is the middle of the box around the corners that lie there. Without shapes it is the farthest
    joint or string on the segment.
    """
    body = anatomy.segments[segment]
    to_body = body.pose[:, :3]
    joints_and_ties = [(anatomy.segments[k].joint - body.joint) @ to_body for k in body.children]
    joints_and_ties += [tie.local_position for tie in anatomy.ties if tie.segment == segment]
    points = body.corners if len(body.corners) else np.array([np.zeros(3), *joints_and_ties])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    length = float(np.linalg.norm(middle))
    if length < 1e-9:
        return points[int(np.argmax(np.linalg.norm(points, axis=1)))]
    # Bodies are long along one axis of their frame; a foot must not tilt the direction.
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(middle)))
    axis[k] = np.sign(middle[k])
    along = points @ axis
    end_points = points[along >= along.max() - END_SHARE * abs(float(along.max()))]
    return 0.5 * (end_points.min(axis=0) + end_points.max(axis=0))


def _trunk(anatomy: Anatomy, plane: Plane) -> tuple[int, ...]:
    """Segments on the plane that carry pairs of limbs, and those between them and the root."""
    trunk: set[int] = set()
    pending = [0]
    while pending:
        segment = pending.pop()
        branches = branches_of(anatomy, plane, segment)
        pending += branches.middle
        if any(is_limb_pair(anatomy, pair) for pair in branches.pairs):
            while segment != NO_PARENT:
                trunk.add(segment)
                segment = anatomy.segments[segment].parent
    return tuple(sorted(trunk))


def _branch(anatomy: Anatomy, first: int) -> Branch:
    """The chain of a branch: it ends where several children are as long as one another."""
    chain = [first]
    while children := anatomy.segments[chain[-1]].children:
        lengths = sorted((_longest_path(anatomy, k), k) for k in children)
        if len(lengths) > 1 and lengths[-1][0] < MIN_LENGTH_RATIO * lengths[-2][0]:
            break
        chain.append(lengths[-1][1])
    tie_positions = [tie.local_position for tie in anatomy.ties if tie.segment == chain[-1]]
    return Branch(tuple(chain), tie_positions[-1] if tie_positions else far_end(anatomy, chain[-1]))


def _pair(anatomy: Anatomy, trunk: tuple[int, ...], pair: tuple[int, int]) -> list[Branch]:
    kind = _kind(anatomy, trunk, pair[0])
    limbs = []
    for segment, twin in (pair, pair[::-1]):
        limb = replace(_branch(anatomy, segment), kind=kind, twin=twin)
        if kind == "leg":
            # A foot ends at its sole, not at the string that lifts it.
            limb = replace(limb, end=far_end(anatomy, limb.chain[-1]))
        elif anatomy.relative_lowest_height(segment) <= MAX_DOUBTFUL_HEIGHT:
            share = f"{anatomy.relative_lowest_height(segment):.0%} of the height"
            limb = limb.doubted(f"it ends {share} above the lowest point; it could be a leg")
        if kind != "leg" and not anatomy.ties_of(segment):
            limb = limb.doubted("no string lifts it")
        limbs.append(limb)
    return limbs


def _kind(anatomy: Anatomy, trunk: tuple[int, ...], first: int) -> LimbKind:
    """Leg if it reaches the ground, or would with straight joints; wing if it is flat; else arm."""
    joint = anatomy.segments[first].joint
    straight_end_height = joint[2] - _length(anatomy, _branch(anatomy, first)) - anatomy.lowest_z
    reaches_ground = (
        joint[2] < anatomy.middle(trunk)[2]
        and straight_end_height <= MAX_GROUND_HEIGHT * anatomy.height
    )
    if anatomy.relative_lowest_height(first) <= MAX_GROUND_HEIGHT or reaches_ground:
        return "leg"
    return "wing" if _is_flat(anatomy, first) else "arm"


def _without_wings_as_legs(anatomy: Anatomy, limbs: list[Branch]) -> list[Branch]:
    """The limbs, where flat ones that hang down to the ground are wings if others are the legs."""
    legs = [limb for limb in limbs if limb.kind == "leg"]
    round_legs = [limb for limb in legs if not _is_flat(anatomy, limb.chain[0])]
    if not round_legs:
        return limbs
    lowest = min(anatomy.segments[limb.chain[0]].joint[2] for limb in round_legs)

    def is_wing(limb: Branch) -> bool:
        is_higher = anatomy.segments[limb.chain[0]].joint[2] > lowest
        return limb in legs and limb not in round_legs and bool(is_higher)

    return [replace(limb, kind="wing") if is_wing(limb) else limb for limb in limbs]


def _is_flat(anatomy: Anatomy, first: int) -> bool:
    """Whether the larger part of a branch's area belongs to flat bodies."""
    flat_area = total_area = 0.0
    for k in anatomy.branch(first):
        thickness, breadth, length = anatomy.segments[k].box_lengths
        total_area += breadth * length
        if thickness < MAX_THICKNESS * breadth and breadth > MIN_BREADTH * length:
            flat_area += breadth * length
    return flat_area > 0.5 * total_area


def _head(
    anatomy: Anatomy, trunk: tuple[int, ...], middles: list[Branch]
) -> tuple[Branch | None, list[Branch]]:
    """The head with its neck, and the other branches in the middle, which are tails.

    A head is higher than the trunk's middle, hangs on strings, and its largest body is round and
    larger than those of tails.
    """
    trunk_height, trunk_top = anatomy.middle(trunk)[2], anatomy.top(trunk)
    heaviest = [_last_heavy_segment(anatomy, branch.chain) for branch in middles]
    max_size = max((_mass_or_volume(anatomy, k) for k in heaviest), default=0.0)
    scores = []
    for branch, k in zip(middles, heaviest, strict=True):
        lengths = anatomy.segments[k].box_lengths
        score = 1.0 if anatomy.top(anatomy.branch(branch.chain[0])) > trunk_height else 0.0
        score += 1.0 if anatomy.ties_of(branch.chain[0]) else 0.0
        score += lengths[0] / max(lengths[2], 1e-9) + _mass_or_volume(anatomy, k) / max(
            max_size, 1e-12
        )
        scores.append(score)
    order = sorted(range(len(middles)), key=lambda k: -scores[k])
    if not order or scores[order[0]] < MIN_HEAD_SCORE:
        return None, [replace(branch, kind="tail") for branch in middles]
    best, head_segment = middles[order[0]], heaviest[order[0]]
    tie_positions = [tie.local_position for tie in anatomy.ties if tie.segment == head_segment]
    head = Branch(
        chain=best.chain[: best.chain.index(head_segment) + 1],
        end=tie_positions[-1] if tie_positions else far_end(anatomy, head_segment),
        kind="neck",
    )
    if len(order) > 1 and scores[order[0]] - scores[order[1]] < CLEAR_MARGIN:
        rival = anatomy.segments[middles[order[1]].chain[0]].name
        head = head.doubted(f"{rival} could be the head as well")
    elif anatomy.top(anatomy.branch(best.chain[0])) < trunk_top + CLEAR_RISE * anatomy.height:
        head = head.doubted("it is as high as the trunk; it could be a tail")
    return head, [replace(middles[k], kind="tail") for k in order[1:]]


def _last_heavy_segment(anatomy: Anatomy, chain: tuple[int, ...]) -> int:
    """The last segment of a chain that is no jaw or beak: a neck may be heavier than its head."""
    min_size = MIN_HEAD_MASS * max(_mass_or_volume(anatomy, k) for k in chain)
    return [k for k in chain if _mass_or_volume(anatomy, k) >= min_size][-1]


def _mass_or_volume(anatomy: Anatomy, segment: int) -> float:
    """Mass of a segment [kg]; of massless ones the volume of the box around them [m^3]."""
    body = anatomy.segments[segment]
    return body.mass or float(np.prod(body.box_lengths))


def _length(anatomy: Anatomy, branch: Branch) -> float:
    """Length of a branch over its joints [m]."""
    joints = [anatomy.segments[k].joint for k in branch.chain]
    steps = np.diff(joints, axis=0)
    end = far_end(anatomy, branch.chain[-1])
    return float(np.sum(np.linalg.norm(steps, axis=1)) + np.linalg.norm(end))


def _longest_path(anatomy: Anatomy, segment: int) -> float:
    """Length of the longest chain of a branch [m]."""
    path_length = {segment: 0.0}
    for k in anatomy.branch(segment):
        for child in anatomy.segments[k].children:
            between = anatomy.segments[child].joint - anatomy.segments[k].joint
            path_length[child] = path_length[k] + float(np.linalg.norm(between))
    return max(path_length[k] + float(np.linalg.norm(far_end(anatomy, k))) for k in path_length)
