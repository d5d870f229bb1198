"""Body map of a puppet: which bodies are trunk, head and limbs, and which strings move them.

A limb is an arm, leg, wing, tail or neck; a twin is the mirror image of a body or string.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from fantoccini.model.puppet import LimbKind, Mirror, Rig, RigHead, RigLimb, Side, twin_name

RANK_WORDS = {2: ("front", "hind"), 3: ("front", "middle", "hind")}
"""Number of limbs of one kind on a side -> words in their names, from the front."""


@dataclass(frozen=True)
class Head:
    """The head.

    Attributes:
        body: name of its body.
        end: its top, in the body's frame [m].
    """

    body: str
    end: tuple[float, float, float]


@dataclass(frozen=True)
class Limb:
    """A limb: a chain of bodies that begins at the trunk.

    Attributes:
        kind: arm, leg, wing, tail or neck.
        side: side of the puppet, as it sees it.
        bodies: names of its bodies, from the trunk to the end.
        end: its end (hand, foot, tip) in the frame of the last body [m].
        strings: names of the strings that lift it, the one nearest to its end first.
        length: length over its joints to its end [m].
    """

    kind: LimbKind
    side: Side
    bodies: tuple[str, ...]
    end: tuple[float, float, float]
    strings: tuple[str, ...] = ()
    length: float = 0.0


@dataclass(frozen=True)
class Doubt:
    """A doubtful entry of a body map.

    Attributes:
        part: name of the part: ``trunk``, ``head``, ``facing``, a limb or a string.
        reason: reason for the doubt, as a sentence without a full stop.
    """

    part: str
    reason: str


@dataclass(frozen=True)
class BodyMap:
    """Body map of a puppet.

    Attributes:
        trunk: names of the trunk's bodies, beginning with the one that carries the others.
        head: the head; None without one.
        limbs: limbs; those of one kind and side in order from the front to the back.
        facing: (3,) unit direction in which it looks, in the frame of the trunk's first body.
        carrying: names of the strings that carry the trunk.
        looking: names of the strings that move the head.
        control: name of the driven body from which the strings hang; empty without one.
        size: length over legs, trunk, neck and head, from a sole to the top [m].
        doubts: doubtful entries.
    """

    trunk: tuple[str, ...]
    head: Head | None
    limbs: tuple[Limb, ...]
    facing: tuple[float, float, float]
    carrying: tuple[str, ...] = ()
    looking: tuple[str, ...] = ()
    control: str = ""
    size: float = 0.0
    doubts: tuple[Doubt, ...] = ()

    @cached_property
    def parts(self) -> Mapping[str, Limb]:
        """Name -> limb: ``arm_left``, ``leg_front_right``, ``leg_4_left``, ``tail``."""
        return dict(zip(_names(self.limbs), self.limbs, strict=True))

    def strings_of(self, part: str) -> tuple[str, ...]:
        """Names of the strings that move ``trunk``, ``head`` or a limb; empty for other parts."""
        trunk_and_head = {"trunk": self.carrying, "head": self.looking}
        limb = self.parts.get(part)
        return trunk_and_head.get(part, ()) if limb is None else limb.strings

    def doubt(self, part: str) -> str:
        """Reasons for doubt about a part, joined by semicolons; empty without doubt."""
        return "; ".join(doubt.reason for doubt in self.doubts if doubt.part == part)


def rig_of(body_map: BodyMap, mirror: Mirror | None = None) -> Rig:
    """The section `rig` of a file that gives a body map.

    Args:
        body_map: body map of a single puppet.
        mirror: mirror of the puppet's file; mirror images of other entries are left out.
    """

    def twins(names: tuple[str, ...]) -> tuple[str, ...]:
        if mirror is None:
            return names
        return tuple(twin_name(name, mirror.from_, mirror.to) for name in names)

    def originals_of(names: tuple[str, ...]) -> tuple[str, ...]:
        images = {t for name, t in zip(names, twins(names), strict=True) if t != name}
        return tuple(name for name in names if name not in images)

    limb_keys = {(limb.bodies, limb.strings) for limb in body_map.limbs}
    images = {
        twin
        for bodies, strings in limb_keys
        if (twin := (twins(bodies), twins(strings))) != (bodies, strings)
    }
    limbs = [
        RigLimb(
            kind=limb.kind, side=limb.side, bodies=limb.bodies, end=limb.end, strings=limb.strings
        )
        for limb in body_map.limbs
        if (limb.bodies, limb.strings) not in images
    ]
    head = body_map.head
    return Rig(
        trunk=body_map.trunk,
        head=None if head is None else RigHead(body=head.body, end=head.end),
        limbs=tuple(limbs),
        facing=body_map.facing,
        carrying=originals_of(body_map.carrying),
        looking=originals_of(body_map.looking),
        control=body_map.control or None,
    )


def _names(limbs: tuple[Limb, ...]) -> tuple[str, ...]:
    """Names of limbs: kind, place from the front where there are several, and side."""
    total = Counter((limb.kind, limb.side) for limb in limbs)
    count: Counter[tuple[str, str]] = Counter()
    names = []
    for limb in limbs:
        key = (limb.kind, limb.side)
        ranks = RANK_WORDS.get(total[key], tuple(map(str, range(1, total[key] + 1))))
        rank = [ranks[count[key]]] if total[key] > 1 else []
        count[key] += 1
        side = [] if limb.side == "middle" else [limb.side]
        names.append("_".join([limb.kind, *rank, *side]))
    return tuple(names)
