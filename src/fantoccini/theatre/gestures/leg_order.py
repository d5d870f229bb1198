"""Order in which the legs of a puppet leave the floor, as phases of a cycle of two steps.

A leg with phase p leaves the floor p cycles after the first one. Patterns are those of Hildebrand
(The quadrupedal gaits of vertebrates, BioScience 39, 1989): lateral sequence, diagonal and lateral
couplets, all legs at once; six legs walk on tripods. A link is a body on its joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias

from fantoccini.base import StateError
from fantoccini.model import BodyMap, Limb
from fantoccini.theatre.gestures.body_parts import BodyParts

Pattern: TypeAlias = Literal["walk", "trot", "pace", "hop"]
PATTERNS: tuple[Pattern, ...] = ("walk", "trot", "pace", "hop")
_LATERAL_LEAD = 0.25
"""Phase by which a front leg follows the hind leg of its side, in a walk on four legs [cycles]."""
_MIDDLE_PHASE = 0.25
"""Phase of the first leg without a side, halfway between the first left and right legs [cycles]."""


def gait_phases(body_map: BodyMap, pattern: Pattern = "walk") -> dict[str, float]:
    """Leg -> phase in the cycle, in [0, 1).

    Args:
        body_map: body map of a puppet.
        pattern: ``walk``: two legs in turn, four in lateral sequence, six or more on two tripods;
            ``trot``: a leg together with its diagonal neighbours; ``pace``: those of a side
            together; ``hop``: all together. Legs without a side step halfway in time between those
            of the two sides.

    Raises:
        StateError: the legs left and right are not pairs, or there are none.
        ValueError: unknown pattern.
    """
    if pattern not in PATTERNS:
        raise ValueError(f"pattern is {pattern!r}; needed: {', '.join(PATTERNS)}")
    side_phase: dict[str, float] = {"left": 0.0, "right": 0.5, "middle": _MIDDLE_PHASE}
    legs_by_side: dict[str, list[str]] = {side: [] for side in side_phase}
    for name, limb in legs(body_map).items():
        legs_by_side[limb.side].append(name)
    n = len(legs_by_side["left"])
    if not n or len(legs_by_side["right"]) != n:
        part_names = ", ".join(body_map.parts) or "no limbs"
        raise StateError(f"it walks on pairs of legs, left and right; the puppet has {part_names}")
    phases = {}
    for side, names in legs_by_side.items():
        for rank, name in enumerate(names):
            phase = side_phase[side]
            if pattern == "hop":
                phase = 0.0
            elif pattern == "walk" and n == 2 and side != "middle":
                phase += _LATERAL_LEAD * (n - 1 - rank)
            elif pattern != "pace":
                phase += 0.5 * (rank % 2)
            phases[name] = phase % 1.0
    return phases


def legs(body_map: BodyMap) -> Mapping[str, Limb]:
    """Name -> leg."""
    return {name: limb for name, limb in body_map.parts.items() if limb.kind == "leg"}


def leg_length(body_map: BodyMap) -> float:
    """Mean length of the legs [m]; 0 without legs."""
    lengths = [limb.length for limb in legs(body_map).values()]
    return sum(lengths) / len(lengths) if lengths else 0.0


def foot_links(body_parts: BodyParts) -> dict[str, int]:
    """Leg -> index of the link that touches the floor: the leg's last body with shapes.

    Raises:
        StateError: no body of a leg has shapes.
    """
    marionette, links = body_parts.marionette, {}
    for name, limb in legs(body_parts.body_map).items():
        leg_links = [marionette.link_index(body) for body in limb.bodies]
        links_with_shapes = [link for link in leg_links if marionette.tree.links[link].shapes]
        if not links_with_shapes:
            bodies = ", ".join(limb.bodies)
            raise StateError(f"it stands on {name}; needed: shapes on one of its bodies, {bodies}")
        links[name] = links_with_shapes[-1]
    return links


def leg_strings(body_parts: BodyParts) -> dict[str, str]:
    """String -> leg that it lifts.

    Raises:
        StateError: no string moves one of the legs.
    """
    return {string: leg for leg in legs(body_parts.body_map) for string in body_parts.strings(leg)}
