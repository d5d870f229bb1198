"""Body map of a puppet: entries of its file, completed from its anatomy at rest.

A body map says which bodies and strings are trunk, head and limbs. A member is a puppet of a scene,
and a twin the mirror image of a body. A segment is a body with the bodies fixed on it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.body_map.anatomy import Anatomy, anatomy_of
from fantoccini.dynamics.body_map.facing import facing_of
from fantoccini.dynamics.body_map.parts import Branch, Parts, parts_of
from fantoccini.dynamics.body_map.symmetry import SIZE_TOLERANCE
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.dynamics.equilibrium import equilibrium, initial_state
from fantoccini.model import BodyMap, Doubt, Head, Limb
from fantoccini.model.puppet import Rig, Side

MIN_SHARE = 0.02
"""Minimum share of the weight on a carrying string."""
MIN_COSINE = np.cos(np.radians(10.0))
"""Cosine of the largest angle between the trunk's axis and the direction in which it looks, for a
trunk that only leans at rest."""
_DECIMALS = 5
"""Decimals of points [m] and directions: a hundredth of a millimetre."""
_KIND_ORDER = {"arm": 0, "wing": 1, "leg": 2, "neck": 3, "tail": 4}


def find_body_map(puppet: CompiledPuppet, member: str = "") -> BodyMap:
    """Body map of a puppet: entries of its file, completed from its tree, shapes and strings.

    Names are those in the puppet or scene. Tensions at rest determine the carrying strings.

    Args:
        puppet: puppet or scene.
        member: name of the scene's member; empty for a single puppet.

    Raises:
        StateError: the puppet has no pair of limbs; the message has its bodies.
    """
    name, prefix = member or puppet.name, f"{member}." if member else ""
    puppet_with_mirror = puppet.puppet.expanded()
    rig = (puppet_with_mirror.rigs.get(member) if member else puppet_with_mirror.rig) or Rig()
    anatomy = anatomy_of(puppet, member, None)
    if rig.limbs is None:
        # The file's pose may already show that there is no map; a rest needs a compiled library.
        parts_of(anatomy, name)
    doubts: list[Doubt] = []
    if rig.limbs is None or rig.carrying is None:
        try:
            x = equilibrium.rest(puppet, initial_state.state(puppet))
            anatomy = anatomy_of(puppet, member, x)
        except StateError as error:
            text = f"no rest was found, so that the file's pose was used instead: {error}"
            doubts.append(Doubt("trunk", text))
    if rig.limbs is None:
        body_map = _map_of_anatomy(puppet, anatomy, parts_of(anatomy, name), rig, doubts)
    else:
        body_map = _map_of_file(rig, prefix)
    if rig.head is not None:
        body_map = _with_head(body_map, Head(prefix + rig.head.body, rig.head.end))
    body_map = _with_sizes(_with_strings(body_map, anatomy, rig, doubts), anatomy)
    if rig.carrying is not None:
        body_map = replace(body_map, carrying=tuple(prefix + string for string in rig.carrying))
    if rig.looking is not None:
        body_map = replace(body_map, looking=tuple(prefix + string for string in rig.looking))
    if rig.control is not None:
        body_map = replace(body_map, control=prefix + rig.control)
    return replace(body_map, doubts=tuple(doubts))


def _map_of_file(rig: Rig, prefix: str) -> BodyMap:
    """Trunk, limbs and facing from a file with these entries."""

    def prefixed(names: Iterable[str]) -> tuple[str, ...]:
        return tuple(prefix + name for name in names)

    count: Counter[tuple[str, str]] = Counter()
    ranked: list[tuple[int, int, str, Limb]] = []
    for limb in rig.limbs or ():
        mapped = Limb(limb.kind, limb.side, prefixed(limb.bodies), limb.end, prefixed(limb.strings))
        ranked.append((_KIND_ORDER[limb.kind], count[limb.kind, limb.side], limb.side, mapped))
        count[limb.kind, limb.side] += 1
    # Mirrored limbs follow the originals in the file; a pair stands together in the map.
    limbs = tuple(limb for *_, limb in sorted(ranked, key=lambda entry: entry[:3]))
    assert rig.trunk is not None and rig.facing is not None, "limbs are given with both"
    return BodyMap(prefixed(rig.trunk), None, limbs, rig.facing)


def _with_head(body_map: BodyMap, head: Head) -> BodyMap:
    """The map with another head, and without limbs that contain its body."""
    limbs = tuple(limb for limb in body_map.limbs if head.body not in limb.bodies)
    return replace(body_map, head=head, limbs=limbs)


def _map_of_anatomy(
    puppet: CompiledPuppet, anatomy: Anatomy, parts: Parts, rig: Rig, doubts: list[Doubt]
) -> BodyMap:
    """Trunk, head, limbs and facing from the anatomy; adds doubts."""
    trunk = [anatomy.segments[k] for k in parts.trunk]
    to_trunk = trunk[0].pose[:, :3].T
    if rig.facing is None:
        forward, doubt = facing_of(puppet, anatomy, parts)
        doubts += [Doubt("facing", doubt)] if doubt else []
    else:
        forward = to_trunk.T @ np.array(rig.facing)
    left = np.cross([0.0, 0.0, 1.0], forward)
    tolerance = SIZE_TOLERANCE * anatomy.size

    def side_of(branch: Branch) -> Side:
        offset = parts.plane.side(anatomy.segments[branch.chain[0]].joint)
        offset *= float(parts.plane.across @ left)
        in_middle = branch.twin < 0 and abs(offset) <= tolerance
        return "middle" if in_middle else "left" if offset > 0.0 else "right"

    def sort_key(branch: Branch) -> tuple[int, float, float]:
        joint = anatomy.segments[branch.chain[0]].joint
        rank_ahead = round(float(joint @ forward) / tolerance)
        return _KIND_ORDER[branch.kind], -rank_ahead, -float(joint @ left)

    branches, head = list(parts.limbs), None
    if parts.head is not None:
        head_segment = anatomy.segments[parts.head.chain[-1]]
        head = Head(head_segment.name, _rounded(parts.head.end))
        doubts += [Doubt("head", reason) for reason in parts.head.doubts]
        if neck := parts.head.chain[:-1]:
            neck_segment = anatomy.segments[neck[-1]]
            branches.append(
                Branch(
                    neck,
                    neck_segment.pose[:, :3].T @ (head_segment.joint - neck_segment.joint),
                    "neck",
                )
            )
    branches.sort(key=sort_key)
    head_chain = () if parts.head is None else parts.head.chain[-1:]
    limbs = tuple(
        Limb(
            kind=branch.kind,
            side=side_of(branch),
            bodies=tuple(anatomy.segments[k].name for k in branch.chain),
            end=_rounded(branch.end),
            strings=_strings_of_limb(anatomy, branch.chain, head_chain),
        )
        for branch in branches
    )
    names = tuple(segment.name for segment in trunk)
    body_map = BodyMap(names, head, limbs, _nearest_axis(to_trunk @ forward))
    for name, branch in zip(body_map.parts, branches, strict=True):
        doubts += [Doubt(name, reason) for reason in branch.doubts]
    doubts += [Doubt("trunk", reason) for reason in parts.doubts]
    return body_map


def _with_strings(body_map: BodyMap, anatomy: Anatomy, rig: Rig, doubts: list[Doubt]) -> BodyMap:
    """The map with the strings that carry and look, and the control; adds doubts."""
    index = {segment.name: k for k, segment in enumerate(anatomy.segments)}
    trunk = {index[name] for name in body_map.trunk if name in index}
    load_ties = [tie for tie in anatomy.ties if tie.lift_share >= MIN_SHARE]
    carrying = _distinct(tie.string for tie in load_ties if tie.segment in trunk)
    if not carrying and rig.carrying is None:
        trunk_strings = _distinct(tie.string for tie in anatomy.ties if tie.segment in trunk)
        carrying = trunk_strings or _distinct(tie.string for tie in load_ties)
        text = "its strings carry no weight at rest" if trunk_strings else "no string is tied to it"
        doubts.append(Doubt("trunk", text))
    bodies = [] if body_map.head is None else [body_map.head.body]
    bodies += [name for limb in body_map.limbs if limb.kind == "neck" for name in limb.bodies]
    looking = _distinct(
        tie.string for name in bodies if name in index for tie in anatomy.ties_of(index[name])
    )
    if body_map.head is not None and not looking and rig.looking is None:
        doubts.append(Doubt("head", "no string moves it"))
    mapped_strings = {
        *carrying,
        *looking,
        *(string for limb in body_map.limbs for string in limb.strings),
    }
    if rig.limbs is None:
        rig_strings = {*(rig.carrying or ()), *(rig.looking or ())}
        ties = [tie for tie in anatomy.ties if tie.string.rpartition(".")[2] not in rig_strings]
        unused = _distinct(tie.string for tie in ties if tie.string not in mapped_strings)
        doubts += [Doubt(name, "this string moves no part of the map") for name in unused]
    holders = [tie.holder for tie in anatomy.ties if tie.holder]
    control = max(sorted(set(holders)), key=holders.count, default="")
    return replace(body_map, carrying=carrying, looking=looking, control=control)


def _with_sizes(body_map: BodyMap, anatomy: Anatomy) -> BodyMap:
    """The map with the lengths of its limbs, and its size."""
    joints = {segment.name: segment.joint for segment in anatomy.segments}

    def path_length(points: list[Array]) -> float:
        return float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))

    def with_length(limb: Limb) -> Limb:
        joint_positions = [joints[name] for name in limb.bodies if name in joints]
        length = path_length(joint_positions) if joint_positions else 0.0
        return replace(limb, length=round(length + float(np.linalg.norm(limb.end)), _DECIMALS))

    limbs = tuple(with_length(limb) for limb in body_map.limbs)
    legs = [limb for limb in limbs if limb.kind == "leg"]
    hips = [joints[limb.bodies[0]] for limb in legs if limb.bodies[0] in joints]
    trunk = [joints[name] for name in body_map.trunk if name in joints]
    necks = [limb for limb in limbs if limb.kind == "neck"]
    # Hips and neck lie on the bodies of the trunk at places that do not depend on the pose.
    axis_points = [np.mean(hips, axis=0)] if hips else trunk[:1]
    upper_bodies = (
        [necks[0].bodies[0]] if necks else [] if body_map.head is None else [body_map.head.body]
    )
    axis_points += [joints[name] for name in upper_bodies if name in joints]
    size = path_length(axis_points) + max((leg.length for leg in legs), default=0.0)
    size += sum(neck.length for neck in necks)
    size += 0.0 if body_map.head is None else float(np.linalg.norm(body_map.head.end))
    return replace(body_map, limbs=limbs, size=round(size, _DECIMALS))


def _strings_of_limb(
    anatomy: Anatomy, chain: tuple[int, ...], heads: tuple[int, ...]
) -> tuple[str, ...]:
    """Strings tied to a chain or its branches without heads, the one nearest to the end first."""
    names: list[str] = []
    for k in reversed(chain):
        names += [tie.string for tie in anatomy.ties if tie.segment == k]
        side_branches = [
            child for child in anatomy.segments[k].children if child not in (*chain, *heads)
        ]
        names += [tie.string for child in side_branches for tie in anatomy.ties_of(child)]
    return _distinct(names)


def _distinct(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names))


def _nearest_axis(direction: Array) -> tuple[float, float, float]:
    """The axis of the frame next to a unit direction, or the direction if none is near."""
    axis = np.round(direction)
    near = np.linalg.norm(axis) == 1.0 and float(axis @ direction) >= MIN_COSINE
    return _rounded(axis if near else direction)


def _rounded(point: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(number), _DECIMALS) + 0.0 for number in point)
    return x, y, z
