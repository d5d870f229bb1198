"""Direction in which a puppet looks, from its head, tail, feet, joints and strings.

A clue votes for a direction or its opposite; a doubt means that clues contradict one another. A
link is a body on its joint. A segment is a body with the bodies fixed on it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.body_map.anatomy import Anatomy
from fantoccini.dynamics.body_map.parts import Parts
from fantoccini.dynamics.compiled import CompiledPuppet

MIN_EVIDENCE = 0.3
"""Sum of the clues below which the direction is doubtful."""
MAX_DISSENT = 0.4
"""Share of clues for the other direction above which it is doubtful."""
FULL_OFFSET = 0.1
"""Offset at which a clue counts in full, relative to the size of the part."""
_BEND_FRACTION = 0.5
"""Share of its range by which a hinge is bent, to find the direction of its limb."""


def facing_of(puppet: CompiledPuppet, anatomy: Anatomy, parts: Parts) -> tuple[Array, str]:
    """Horizontal unit direction (3,) in which a puppet looks at rest, and a reason for doubt."""
    forward = np.cross(parts.plane.across, [0.0, 0.0, 1.0])
    clues = list(_clues(puppet, anatomy, parts, forward))
    total = sum(weight for weight in clues)
    opposed = sum(abs(weight) for weight in clues if weight * total < 0.0)
    if abs(total) < MIN_EVIDENCE:
        # Puppets of unknown direction look towards +x, as the bundled ones do, or else +y.
        main_component = forward[0] if abs(forward[0]) > 0.1 else forward[1]
        sign = 1.0 if main_component > 0.0 else -1.0
        return (
            sign * forward,
            "head, tail, feet, joints and strings do not distinguish front and back",
        )
    doubt = ""
    if opposed > MAX_DISSENT * sum(map(abs, clues)):
        doubt = "head, tail, feet, joints and strings contradict one another"
    return (forward if total > 0.0 else -forward), doubt


def _clues(
    puppet: CompiledPuppet, anatomy: Anatomy, parts: Parts, forward: Array
) -> Iterator[float]:
    """Weights of the clues; above 0 for ``forward``, below 0 against it."""
    middle = anatomy.middle(parts.trunk)
    size = anatomy.size
    if parts.head is not None:
        last_segment = anatomy.segments[parts.head.chain[-1]]
        centre = 0.5 * (last_segment.outline.min(axis=0) + last_segment.outline.max(axis=0))
        yield 3.0 * _clipped(float((centre - middle) @ forward), 3.0 * size)
        # A nose reaches farther from the middle of the shapes than the back of the head.
        along = (last_segment.outline - last_segment.joint) @ forward
        yield 1.0 * _clipped(along.max() + along.min(), along.max() - along.min())
    for limb in parts.limbs:
        last_segment = anatomy.segments[limb.chain[-1]]
        outline = last_segment.outline
        end = last_segment.pose[:, :3] @ limb.end + last_segment.pose[:, 3]
        if limb.kind == "tail":
            yield -2.0 * _clipped(float((end - middle) @ forward), 2.0 * size)
        elif limb.kind == "leg" and len(last_segment.corners):
            lowest_corners = outline[
                outline[:, 2] <= outline[:, 2].min() + 0.25 * np.ptp(outline[:, 2])
            ]
            foot = (
                0.5 * (lowest_corners.min(axis=0) + lowest_corners.max(axis=0)) - last_segment.joint
            )
            yield 0.5 * _clipped(float(foot @ forward), float(np.linalg.norm(foot)))
        if limb.kind == "arm":
            yield 0.5 * np.sign(_far_bend_offset(puppet, anatomy, limb.chain, forward))
            arm_ties = [tie for tie in anatomy.ties if tie.segment in limb.chain]
            trunk_string_ends = [
                tie.other_end for tie in anatomy.ties if tie.segment in parts.trunk
            ]
            if arm_ties and trunk_string_ends:
                offset = (arm_ties[-1].other_end - np.mean(trunk_string_ends, axis=0)) @ forward
                yield 0.5 * _clipped(offset, size)


def _far_bend_offset(
    puppet: CompiledPuppet, anatomy: Anatomy, chain: tuple[int, ...], forward: Array
) -> float:
    """Move of an arm's end along ``forward`` as its last hinge bends to its far limit [m]."""
    for k in reversed(chain):
        segment = anatomy.segments[k]
        link = puppet.tree.links[segment.link]
        bounds = [limit.bound for limit in puppet.tree.limits if limit.link == segment.link]
        if link.kind == "revolute" and len(bounds) == 2 and abs(sum(bounds)) > 0.1:
            axis = segment.pose[:, :3] @ link.axes[:, 0]
            lever_arm = segment.outline.mean(axis=0) - segment.joint
            return float(np.cross(_BEND_FRACTION * sum(bounds) * axis, lever_arm) @ forward)
    return 0.0


def _clipped(offset: float, size: float) -> float:
    """Offset relative to ``FULL_OFFSET`` of a size, between -1 and 1."""
    return float(np.clip(offset / max(FULL_OFFSET * size, 1e-12), -1.0, 1.0))
