"""Support: bodies that nothing holds against gravity, from the puppet's structure alone.

Strings, springs, solids that may touch, and joints connect bodies, except joints that are free
along gravity. Bodies not connected to the world fall for ever.

A link is a body on its joint, and a root the first link of a tree of bodies. A marionette is a
puppet with its compiled equations; `marionette.puppet` is the description in its file. A member is
a puppet of a scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from fantoccini.dynamics.compiled import CompiledPuppet, touching_links
from fantoccini.model.tree import WORLD, Link, Role, Tree, link_inertia, measure

MIN_COSINE = 1e-9
"""Cosine between an axis and gravity above which a body slides down the axis."""
_MAX_LISTED = 6
"""Maximum number of bodies named in a message."""


def unsupported_groups(marionette: CompiledPuppet) -> tuple[tuple[int, ...], ...]:
    """Groups of links that nothing holds: in each, the roots, the highest first, then the others.

    A group that may touch the floor, an obstacle or what these carry is not listed.
    """
    tree, number = marionette.tree, marionette.number
    gravity = np.array([number(x) for x in tree.gravity])
    if not np.any(gravity):
        return ()
    measured = measure(tree, number)
    parent = {i: i for i in range(WORLD, len(tree.links))}

    def group_of(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for i, j in _supporting_pairs(marionette, measured.poses, gravity / np.linalg.norm(gravity)):
        parent[group_of(i)] = group_of(j)
    members: dict[int, list[int]] = {}
    for i in range(len(tree.links)):
        members.setdefault(group_of(i), []).append(i)
    members.pop(group_of(WORLD), None)
    heights = -measured.poses[:, :, 3] @ gravity
    groups = []
    for links in members.values():
        if not any(link_inertia(tree.links[i], number)[0] > 0.0 for i in links):
            continue
        is_root = {i: tree.links[i].parent not in links for i in links}
        groups.append(
            tuple(
                sorted(links, key=lambda i: (not is_root[i], -heights[i] if is_root[i] else 0.0, i))
            )
        )
    return tuple(groups)


def no_support_message(marionette: CompiledPuppet, group: tuple[int, ...]) -> str:
    """Message that a group of :func:`unsupported_groups` has no support."""
    chains = {p.link: chain.name for chain in marionette.tree.chains for p in chain.points[1:-1]}
    bodies = [marionette.tree.links[i].name for i in group if i not in chains]
    names = bodies or list(dict.fromkeys(chains[i] for i in group))
    listed = ", ".join(names[:_MAX_LISTED])
    if len(names) > _MAX_LISTED:
        listed += f" and {len(names) - _MAX_LISTED} more"
    return (
        f"nothing holds {listed}: no string, spring, drive or joint ties {_them(names)} to the "
        "world, and by the key contact no floor or obstacle carries "
        f"{_them(names)}, so that {_they(names)} for ever; make {names[0]} driven or fixed, or tie "
        "it to the world"
    )


def _them(names: list[str]) -> str:
    return "it" if len(names) == 1 else "them"


def _they(names: list[str]) -> str:
    return "it falls" if len(names) == 1 else "they fall"


def _supporting_pairs(
    marionette: CompiledPuppet, poses: np.ndarray, down: np.ndarray
) -> Iterator[tuple[int, int]]:
    """Pairs of links, or a link and the world, one of which holds or may carry the other."""
    tree = marionette.tree
    yield from touching_links(marionette.puppet.expanded(), tree)
    for i, link in enumerate(tree.links):
        if not _can_slide(marionette, i, poses, down):
            yield i, link.parent
    for row in (*tree.strings, *tree.chains):
        yield from pairwise(point.link for point in row.points)
    for spring in tree.springs:
        if marionette.number(spring.stiffness) > 0.0:
            yield spring.points[0].link, spring.points[1].link


def _can_slide(marionette: CompiledPuppet, i: int, poses: np.ndarray, down: np.ndarray) -> bool:
    """Whether a link falls along its joint; False if the axis may turn, where it is unknown."""
    tree = marionette.tree
    link = tree.links[i]
    if link.role is not Role.DYNAMIC or any(row.link == i for row in tree.drives):
        return False
    if link.kind == "free" or (link.kind == "translation" and link.axes.shape[1] == 3):
        return True
    if link.kind not in ("translation", "prismatic") or _may_turn(tree, link):
        return False
    carrier = np.eye(3) if link.parent == WORLD else poses[link.parent][:, :3]
    axis_along_gravity = down @ carrier @ link.rotation @ link.axes
    if link.kind == "translation":
        return bool(np.max(np.abs(axis_along_gravity)) > MIN_COSINE)
    side = "upper" if axis_along_gravity[0] > 0.0 else "lower"
    has_limit = any(limit.link == i and limit.side == side for limit in tree.limits)
    return (
        abs(axis_along_gravity[0]) > MIN_COSINE
        and not has_limit
        and not marionette.number(link.stiffness) > 0.0
    )


def _may_turn(tree: Tree, link: Link) -> bool:
    """Whether an ancestor of a link may turn."""
    while link.parent != WORLD:
        link = tree.links[link.parent]
        if link.kind in ("revolute", "ball", "free") and link.role is not Role.FIXED:
            return True
    return False
