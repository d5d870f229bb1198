"""Trunk, head and limbs of a puppet, from its branches about the plane of symmetry."""

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

MIN_ASIDE = 1e-3
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
        more = ", ..." if len(anatomy.segments) > 6 else ""
        raise StateError(
            f"{name} has no body map: no two branches of its bodies ({bodies}{more}) are alike, "
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
        for k in branches.odd:
            odd = replace(_branch(anatomy, k), kind=_kind(anatomy, trunk, k))
            limbs.append(odd.doubted("it has no twin on the other side"))
    head, tails = _head(anatomy, trunk, middles)
    head = None if head is None else _in_plane(anatomy, plane, head)
    tails = [_in_plane(anatomy, plane, tail) for tail in tails]
    doubts: tuple[str, ...] = ()
    if plane.rival:
        doubts = (
            "its two ends are as alike as its two sides, so that front and side may be swapped",
        )
    return Parts(trunk, head, (*_without_wings_as_legs(anatomy, limbs), *tails), plane, doubts)


def _in_plane(anatomy: Anatomy, plane: Plane, branch: Branch) -> Branch:
    """The branch of a body in the middle with its end in the plane of symmetry.

    A head on a pair of strings ends between their ties.
    """
    own = anatomy.segments[branch.chain[-1]]
    R, r = own.pose[:, :3], own.pose[:, 3]
    distance = plane.side(R @ branch.end + r)
    if abs(distance) < MIN_ASIDE * anatomy.size:
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
    long = _length(anatomy, _branch(anatomy, first)) >= MIN_LIMB_LENGTH * anatomy.size
    return long and bool(anatomy.ties_of(first))


def far_end(anatomy: Anatomy, segment: int) -> Array:
    """(3,) point at the end of a segment that is far from its joint, in its frame [m].

    It is the middle of the box around the corners that lie there. Without shapes it is the farthest
    joint or string on the segment.
    """
    own = anatomy.segments[segment]
    to_body = own.pose[:, :3]
    tips = [(anatomy.segments[k].joint - own.joint) @ to_body for k in own.children]
    tips += [tie.at for tie in anatomy.ties if tie.segment == segment]
    points = own.corners if len(own.corners) else np.array([np.zeros(3), *tips])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    length = float(np.linalg.norm(middle))
    if length < 1e-9:
        return points[int(np.argmax(np.linalg.norm(points, axis=1)))]
    # Bodies are long along one axis of their frame; a foot must not tilt the direction.
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(middle)))
    axis[k] = np.sign(middle[k])
    along = points @ axis
    last = points[along >= along.max() - END_SHARE * abs(float(along.max()))]
    return 0.5 * (last.min(axis=0) + last.max(axis=0))


def _trunk(anatomy: Anatomy, plane: Plane) -> tuple[int, ...]:
    """Segments on the plane that carry pairs of limbs, and those between them and the root."""
    trunk: set[int] = set()
    axial = [0]
    while axial:
        segment = axial.pop()
        branches = branches_of(anatomy, plane, segment)
        axial += branches.middle
        if any(is_limb_pair(anatomy, pair) for pair in branches.pairs):
            while segment != NO_PARENT:
                trunk.add(segment)
                segment = anatomy.segments[segment].parent
    return tuple(sorted(trunk))


def _branch(anatomy: Anatomy, first: int) -> Branch:
    """The chain of a branch: it ends where several children are as long as one another."""
    chain = [first]
    while children := anatomy.segments[chain[-1]].children:
        lengths = sorted((_depth(anatomy, k), k) for k in children)
        if len(lengths) > 1 and lengths[-1][0] < MIN_LENGTH_RATIO * lengths[-2][0]:
            break
        chain.append(lengths[-1][1])
    tied = [tie.at for tie in anatomy.ties if tie.segment == chain[-1]]
    return Branch(tuple(chain), tied[-1] if tied else far_end(anatomy, chain[-1]))


def _pair(anatomy: Anatomy, trunk: tuple[int, ...], pair: tuple[int, int]) -> list[Branch]:
    kind = _kind(anatomy, trunk, pair[0])
    limbs = []
    for own, other in (pair, pair[::-1]):
        limb = replace(_branch(anatomy, own), kind=kind, twin=other)
        if kind == "leg":
            # A foot ends at its sole, not at the string that lifts it.
            limb = replace(limb, end=far_end(anatomy, limb.chain[-1]))
        elif anatomy.relative_lowest_height(own) <= MAX_DOUBTFUL_HEIGHT:
            share = f"{anatomy.relative_lowest_height(own):.0%} of the height"
            limb = limb.doubted(f"it ends {share} above the lowest point; it could be a leg")
        if kind != "leg" and not anatomy.ties_of(own):
            limb = limb.doubted("no string lifts it")
        limbs.append(limb)
    return limbs


def _kind(anatomy: Anatomy, trunk: tuple[int, ...], first: int) -> LimbKind:
    """Leg if it reaches the ground, or would with straight joints; wing if it is flat; else arm."""
    joint = anatomy.segments[first].joint
    straight = joint[2] - _length(anatomy, _branch(anatomy, first)) - anatomy.lowest_z
    low_down = (
        joint[2] < anatomy.middle(trunk)[2] and straight <= MAX_GROUND_HEIGHT * anatomy.height
    )
    if anatomy.relative_lowest_height(first) <= MAX_GROUND_HEIGHT or low_down:
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
        higher = anatomy.segments[limb.chain[0]].joint[2] > lowest
        return limb in legs and limb not in round_legs and bool(higher)

    return [replace(limb, kind="wing") if is_wing(limb) else limb for limb in limbs]


def _is_flat(anatomy: Anatomy, first: int) -> bool:
    """Whether the larger part of a branch's area belongs to flat bodies."""
    flat = total = 0.0
    for k in anatomy.branch(first):
        thin, broad, long = anatomy.segments[k].box_lengths
        total += broad * long
        if thin < MAX_THICKNESS * broad and broad > MIN_BREADTH * long:
            flat += broad * long
    return flat > 0.5 * total


def _head(
    anatomy: Anatomy, trunk: tuple[int, ...], middles: list[Branch]
) -> tuple[Branch | None, list[Branch]]:
    """The head with its neck, and the other branches in the middle, which are tails.

    A head is higher than the trunk's middle, hangs on strings, and its largest body is round and
    larger than those of tails.
    """
    middle, top = anatomy.middle(trunk)[2], anatomy.top(trunk)
    largest = [_last_bulky(anatomy, branch.chain) for branch in middles]
    max_bulk = max((_bulk(anatomy, k) for k in largest), default=0.0)
    scores = []
    for branch, k in zip(middles, largest, strict=True):
        box = anatomy.segments[k].box_lengths
        score = 1.0 if anatomy.top(anatomy.branch(branch.chain[0])) > middle else 0.0
        score += 1.0 if anatomy.ties_of(branch.chain[0]) else 0.0
        score += box[0] / max(box[2], 1e-9) + _bulk(anatomy, k) / max(max_bulk, 1e-12)
        scores.append(score)
    order = sorted(range(len(middles)), key=lambda k: -scores[k])
    if not order or scores[order[0]] < MIN_HEAD_SCORE:
        return None, [replace(branch, kind="tail") for branch in middles]
    best, last = middles[order[0]], largest[order[0]]
    tied = [tie.at for tie in anatomy.ties if tie.segment == last]
    head = Branch(
        chain=best.chain[: best.chain.index(last) + 1],
        end=tied[-1] if tied else far_end(anatomy, last),
        kind="neck",
    )
    if len(order) > 1 and scores[order[0]] - scores[order[1]] < CLEAR_MARGIN:
        rival = anatomy.segments[middles[order[1]].chain[0]].name
        head = head.doubted(f"{rival} could be the head as well")
    elif anatomy.top(anatomy.branch(best.chain[0])) < top + CLEAR_RISE * anatomy.height:
        head = head.doubted("it is as high as the trunk; it could be a tail")
    return head, [replace(middles[k], kind="tail") for k in order[1:]]


def _last_bulky(anatomy: Anatomy, chain: tuple[int, ...]) -> int:
    """The last segment of a chain that is no jaw or beak: a neck may be heavier than its head."""
    limit = MIN_HEAD_MASS * max(_bulk(anatomy, k) for k in chain)
    return [k for k in chain if _bulk(anatomy, k) >= limit][-1]


def _bulk(anatomy: Anatomy, segment: int) -> float:
    """Mass of a segment [kg]; of massless ones the volume of the box around them [m^3]."""
    own = anatomy.segments[segment]
    return own.mass or float(np.prod(own.box_lengths))


def _length(anatomy: Anatomy, branch: Branch) -> float:
    """Length of a branch over its joints [m]."""
    joints = [anatomy.segments[k].joint for k in branch.chain]
    ways = np.diff(joints, axis=0)
    tip = far_end(anatomy, branch.chain[-1])
    return float(np.sum(np.linalg.norm(ways, axis=1)) + np.linalg.norm(tip))


def _depth(anatomy: Anatomy, segment: int) -> float:
    """Length of the longest chain of a branch [m]."""
    way = {segment: 0.0}
    for k in anatomy.branch(segment):
        for child in anatomy.segments[k].children:
            between = anatomy.segments[child].joint - anatomy.segments[k].joint
            way[child] = way[k] + float(np.linalg.norm(between))
    return max(way[k] + float(np.linalg.norm(far_end(anatomy, k))) for k in way)
