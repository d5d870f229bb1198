"""Pairs of solids of a puppet that may touch, and their overlaps.

A solid is a shape of a body or an obstacle, and a link a body on its joint. In names, D stands for
dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and lengths
of strings, driven joints. A member is a puppet of a scene. A hull is the smallest convex solid
around a mesh or a piece of it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mistake, PuppetError
from fantoccini.kernel.runtime import (
    Contacts,
    Hull,
    Library,
    empty,
    half_space,
    hull_solid,
    mesh_hulls,
    solid,
    stacked,
)
from fantoccini.model.puppet import FLOOR, Contact, Group, Mesh, Obstacle, Puppet, Shape
from fantoccini.model.tree import WORLD, Role, Tree
from fantoccini.motion import pair_name

MAX_START_OVERLAP = 1e-9
"""Overlap at the start pose above which two solids of one tree never touch [m]."""
TOUCHING_GAP = 1e-6
"""Gap up to which solids count as touching [m]."""


@dataclass(frozen=True)
class _Part:
    """A shape with its link and the name of its body or obstacle; the floor has no shape."""

    name: str
    link: int
    shape: Shape | Obstacle | None


def solids_of_shapes(puppet: Puppet, tree: Tree) -> tuple[int, ...]:
    """Number of solids of each shape of the links; a dented mesh that may touch has several.

    A mesh that :func:`contacts_of` refuses counts as one solid.
    """
    of_links, standing = _parts(puppet, tree)
    counts = [1] * len(of_links)
    meshes = {i: part.shape for i, part in enumerate(of_links) if isinstance(part.shape, Mesh)}
    if puppet.touching is None or not meshes:
        return tuple(counts)
    pairs = _pairs(puppet, tree, puppet.touching, of_links, standing)
    for i in meshes.keys() & {i for a, b, _, _ in pairs for i in (a, b)}:
        with contextlib.suppress(ValueError):
            counts[i] = len(mesh_hulls(meshes[i]))
    return tuple(counts)


def touching_links(puppet: Puppet, tree: Tree) -> set[tuple[int, int]]:
    """Pairs of links, or of a link and the world, whose solids may touch by the rules of contact.

    The result depends on neither the compiled model nor the pose.
    """
    if puppet.touching is None:
        return set()
    of_links, standing = _parts(puppet, tree)
    parts = of_links + standing
    pairs = _pairs(puppet, tree, puppet.touching, of_links, standing)
    return {(parts[a].link, parts[b].link) for a, b, _, _ in pairs}


def contacts_of(
    puppet: Puppet, tree: Tree, library: Library, counts: Sequence[int]
) -> tuple[Contacts, Contacts] | None:
    """The pairs of solids that may touch, and those of them with prescribed relative motion.

    None if the puppet's file has no contact. Bodies that a joint connects do not touch, nor do
    bodies of one tree that overlap at the file's pose. Pairs of the second kind have no force: both
    solids follow the inputs, and only their overlap is measured.

    Args:
        puppet: puppet with rules of contact.
        tree: tree of the puppet.
        library: compiled model of the puppet.
        counts: numbers of solids in compiled arrays, from :func:`solids_of_shapes`.

    Raises:
        PuppetError: a mesh is open or flat, or cannot be cut into convex pieces.
    """
    rules = puppet.touching
    if rules is None:
        return None
    of_links, standing = _parts(puppet, tree)
    parts = of_links + standing
    part_pairs = list(_pairs(puppet, tree, rules, of_links, standing))
    touching = {i for a, b, _, _ in part_pairs for i in (a, b)}
    solids, hulls, indices = _solids(puppet, parts, touching, counts)
    # A dented mesh is several solids, each of which may touch the partners of the mesh.
    pairs = [
        (first_solid, second_solid, pair_index)
        for pair_index, (a, b, _, _) in enumerate(part_pairs)
        for first_solid in indices[a]
        for second_solid in indices[b]
    ]
    links = solids["link"].tolist()
    pairs.sort(key=lambda pair: (links[pair[0]], links[pair[1]], pair[1], pair[0]))
    part_pair_of = [pair_index for _, _, pair_index in pairs]
    contacts = Contacts(
        solids=solids,
        pairs=np.array([pair[:2] for pair in pairs], dtype=np.int32).reshape(-1, 2),
        friction=np.array([part_pairs[pair_index][2] for pair_index in part_pair_of]),
        restitution=np.array([part_pairs[pair_index][3] for pair_index in part_pair_of]),
        names=tuple(
            (parts[part_pairs[pair_index][0]].name, parts[part_pairs[pair_index][1]].name)
            for pair_index in part_pair_of
        ),
        hulls=hulls,
    )
    coordinates = tree.coordinates
    p = np.array(list(tree.parameters.values()), dtype=float)
    gaps = library.gaps(contacts, coordinates.start_D, np.nan_to_num(coordinates.start_K), p)
    excluded = {
        pair_index
        for pair_index, gap in zip(part_pair_of, gaps, strict=True)
        if gap < -MAX_START_OVERLAP
        and _same_moving_tree(tree, *(parts[i].link for i in part_pairs[pair_index][:2]))
    }
    is_selected = np.array(
        [pair_index not in excluded for pair_index in part_pair_of], dtype=np.bool_
    )
    links_of_pair = [
        (parts[part_pairs[pair_index][0]].link, parts[part_pairs[pair_index][1]].link)
        for pair_index in part_pair_of
    ]
    is_dynamic = np.array(
        [_has_relative_motion(tree, a, b, Role.DYNAMIC) for a, b in links_of_pair], dtype=np.bool_
    )
    return contacts.subset(is_selected & is_dynamic), contacts.subset(is_selected & ~is_dynamic)


def _parts(puppet: Puppet, tree: Tree) -> tuple[list[_Part], list[_Part]]:
    """Parts with a surface: the shapes of the links; and the obstacles and the floor."""
    of_links = [
        _Part(link.name, i, shape) for i, link in enumerate(tree.links) for shape in link.shapes
    ]
    standing = [_Part(o.name, WORLD, o) for o in puppet.obstacles]
    if puppet.floor is not None:
        standing.append(_Part(FLOOR, WORLD, None))
    return of_links, standing


def _solids(
    puppet: Puppet, parts: list[_Part], touching: set[int], counts: Sequence[int]
) -> tuple[np.ndarray, tuple[Hull, ...], list[Sequence[int]]]:
    """Solids of parts.

    Returns:
        Records (n,) ``SOLID``, hulls of the meshes that may touch, and the indices of each part's
        records.
    """
    records: list[np.ndarray] = []
    hulls: list[Hull] = []
    indices: list[Sequence[int]] = []
    for i, part in enumerate(parts):
        first = len(records)
        if part.shape is None:
            records.append(half_space((0.0, 0.0, puppet.floor or 0.0), (0.0, 0.0, 1.0)))
        elif not isinstance(part.shape, Mesh):
            records.append(solid(part.shape, part.link))
        elif i in touching:
            part_hulls = _hulls(puppet, part.shape, part.name)
            if i < len(counts) and len(part_hulls) != counts[i]:
                raise _mesh_error(
                    puppet,
                    part.name,
                    f"{part.shape.file} is not convex, and touched nothing when "
                    "the puppet was compiled; load it together with the solids that it touches now",
                )
            records += [hull_solid(h, len(hulls) + k, part.link) for k, h in enumerate(part_hulls)]
            hulls += part_hulls
        else:
            records += [empty(part.link)] * counts[i]
        indices.append(range(first, len(records)))
    return stacked(records), tuple(hulls), indices


def _hulls(puppet: Puppet, shape: Mesh, name: str) -> tuple[Hull, ...]:
    try:
        return mesh_hulls(shape)
    except ValueError as reason:
        raise _mesh_error(puppet, name, str(reason)) from None


def _mesh_error(puppet: Puppet, name: str, reason: str) -> PuppetError:
    file, line = puppet.locate(name)
    return PuppetError([Mistake(file, line, f"shapes of {name}", reason)])


def _pairs(
    puppet: Puppet, tree: Tree, rules: Contact, of_links: list[_Part], standing: list[_Part]
) -> Iterator[tuple[int, int, float, float]]:
    """Indices of two parts that may touch, and their friction and restitution."""
    for a, first in enumerate(of_links):
        for b, second in enumerate([*of_links[:a], *standing]):
            index = b if b < a else len(of_links) + b - a
            links = first.link, second.link
            has_motion = _has_relative_motion(tree, *links, Role.DYNAMIC) or _has_relative_motion(
                tree, *links, Role.DRIVEN
            )
            if has_motion and not _joined(tree, first, second):
                group = _group_of_pair(puppet, first, second)
                rule = _rule(puppet, rules, first.name, second.name, group)
                if rule is not None:
                    yield a, index, *rule


def _has_relative_motion(tree: Tree, a: int, b: int, role: Role) -> bool:
    """Whether a coordinate of a role moves one link relative to the other."""
    moving_ancestors = [
        {i for i in tree.ancestors(link) if tree.links[i].role is role} for link in (a, b)
    ]
    return moving_ancestors[0] != moving_ancestors[1]


def _same_moving_tree(tree: Tree, a: int, b: int) -> bool:
    """Whether two links have a common ancestor that is not fixed in the world."""
    moving_ancestors = [
        {i for i in tree.ancestors(x) if _rigid_root(tree, i) != WORLD} for x in (a, b)
    ]
    return bool(moving_ancestors[0] & moving_ancestors[1])


def _joined(tree: Tree, a: _Part, b: _Part) -> bool:
    """Whether one joint connects two bodies, or both are the same body."""
    if WORLD in (a.link, b.link):
        return False
    root_a, root_b = _rigid_root(tree, a.link), _rigid_root(tree, b.link)
    return root_a == root_b or root_b == _carrier(tree, root_a) or root_a == _carrier(tree, root_b)


def _rigid_root(tree: Tree, link: int) -> int:
    """First of the links that fixed joints connect to a link, or the world."""
    while link != WORLD and tree.links[link].kind == "fixed":
        link = tree.links[link].parent
    return link


def _carrier(tree: Tree, link: int) -> int:
    """Nearest ancestor of a link that has a shape, represented by its :func:`_rigid_root`."""
    roots_with_shapes = {
        _rigid_root(tree, i) for i, descendant in enumerate(tree.links) if descendant.shapes
    }
    while link != WORLD:
        link = _rigid_root(tree, tree.links[link].parent)
        if link in roots_with_shapes:
            return link
    return WORLD


def _group_of_pair(puppet: Puppet, a: _Part, b: _Part) -> Group:
    """Group of the second part, seen from the first."""
    if b.link == WORLD:
        return "floor" if b.name == FLOOR else "obstacles"
    members = puppet.member_of(a.name), puppet.member_of(b.name)
    if set(members) & set(puppet.props):
        return "props"
    return "self" if members[0] == members[1] else "puppets"


def _rule(
    puppet: Puppet, rules: Contact, a: str, b: str, group: Group
) -> tuple[float, float] | None:
    """Friction and restitution of two parts; None if they do not touch."""
    friction, restitution, touches = rules.friction, rules.restitution, group in rules.meets
    names_and_members = [{name, puppet.member_of(name)} for name in (a, b)]
    for pair in rules.pairs:
        first_name, second_name = pair.between
        if not any(
            first_name in names_a and second_name in names_b
            for names_a, names_b in (names_and_members, names_and_members[::-1])
        ):
            continue
        touches = pair.meet
        friction = friction if pair.friction is None else pair.friction
        restitution = restitution if pair.restitution is None else pair.restitution
    return (friction, restitution) if touches else None


def overlaps(
    library: Library, contacts: Contacts, q_D: Array, q_K: Array, p: Array, depth: float
) -> dict[str, float]:
    """Names of pairs that overlap by more than a depth [m] at a configuration -> overlap [m]."""
    gaps = library.gaps(contacts, q_D, q_K, p)
    overlap_by_pair: dict[str, float] = {}
    for names, gap in zip(contacts.names, gaps, strict=True):
        if gap < -depth:
            name = pair_name(names)
            overlap_by_pair[name] = max(overlap_by_pair.get(name, 0.0), -float(gap))
    return overlap_by_pair
