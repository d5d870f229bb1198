"""Anatomy of a puppet at rest: segments of bodies that move as one, and strings tied to them.

A chain is a string of point masses and springs. A member is a puppet of a scene. In names, D stands
for dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and
lengths of strings, driven joints. A link is a body on its joint. A row of the tree describes a
string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.compiled import CompiledPuppet, forward_dynamics
from fantoccini.model.puppet import Capsule, Shape
from fantoccini.model.tree import (
    WORLD,
    Point,
    Role,
    StringRow,
    link_inertia,
    link_poses,
    measure,
    point_position,
    shape_box,
)
from fantoccini.motion import State

NO_PARENT = -1
"""Parent of the segment that carries all others."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A body, and the bodies fixed on it.

    Attributes:
        link: index of the body's link.
        name: name of the body.
        parent: index of the segment that carries it, or ``NO_PARENT``.
        children: indices of the segments that it carries.
        pose: (3, 4) pose of the body at rest.
        mass: mass [kg].
        corners: (n, 3) corners of the boxes around its shapes, in the body's frame [m].
    """

    link: int
    name: str
    parent: int
    children: tuple[int, ...]
    pose: Array
    mass: float
    corners: Array

    @property
    def joint(self) -> Array:
        """(3,) position of the joint that carries it, in the world [m]."""
        return self.pose[:, 3]

    @property
    def outline(self) -> Array:
        """(n, 3) corners in the world, and the joint [m]."""
        return np.vstack([self.joint, self.corners @ self.pose[:, :3].T + self.joint])

    @cached_property
    def box_lengths(self) -> Array:
        """(3,) lengths of the box around its shapes, the smallest first [m]; 0 without shapes."""
        return np.sort(np.ptp(self.corners, axis=0)) if len(self.corners) else np.zeros(3)


@dataclass(frozen=True, eq=False)
class Tie:
    """A point at which a string is tied to a segment.

    Attributes:
        string: name of the string.
        segment: index of the segment.
        local_position: (3,) the point in the body's frame [m].
        position: (3,) the point in the world, at rest [m].
        other_end: (3,) other end of the string, in the world [m].
        holder: name of the driven body to which the other end is tied; empty without one.
        lift_share: upward force at rest, relative to the puppet's weight; inf if it is not known.
    """

    string: str
    segment: int
    local_position: Array
    position: Array
    other_end: Array
    holder: str
    lift_share: float


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Segments of a puppet at rest, parents first, and the points where strings are tied.

    Attributes:
        segments: segments; the first carries all others.
        ties: points where strings are tied, in the order of the file.
    """

    segments: tuple[Segment, ...]
    ties: tuple[Tie, ...]

    @cached_property
    def outline(self) -> Array:
        """(n, 3) corners of all segments [m]."""
        return np.vstack([segment.outline for segment in self.segments])

    @cached_property
    def size(self) -> float:
        """Longest side of the box around all segments [m]."""
        return max(float(np.ptp(self.outline, axis=0).max()), 1e-9)

    @cached_property
    def lowest_z(self) -> float:
        """Height of the puppet's lowest point [m]."""
        return float(self.outline[:, 2].min())

    @cached_property
    def height(self) -> float:
        """Height of the highest point above the lowest one [m]."""
        return max(float(np.ptp(self.outline[:, 2])), 1e-9)

    def branch(self, segment: int) -> Iterator[int]:
        """Indices of a segment and all segments that it carries, parents first."""
        stack = [segment]
        while stack:
            k = stack.pop()
            yield k
            stack += self.segments[k].children

    def relative_lowest_height(self, segment: int) -> float:
        """Height of a branch's lowest point above the puppet's, relative to the puppet's height."""
        lowest = min(self.segments[k].outline[:, 2].min() for k in self.branch(segment))
        return (float(lowest) - self.lowest_z) / self.height

    def ties_of(self, segment: int) -> list[Tie]:
        """Ties of strings to a branch."""
        branch = set(self.branch(segment))
        return [tie for tie in self.ties if tie.segment in branch]

    def top(self, segments: Iterable[int]) -> float:
        """Height of the highest point of segments [m]."""
        return max(float(self.segments[segment].outline[:, 2].max()) for segment in segments)

    def middle(self, segments: tuple[int, ...]) -> Array:
        """(3,) middle of the box around segments [m]."""
        points = np.vstack([self.segments[k].outline for k in segments])
        return 0.5 * (points.min(axis=0) + points.max(axis=0))


def anatomy_of(puppet: CompiledPuppet, member: str, x: State | None) -> Anatomy:
    """Anatomy of a puppet, or of the member of a scene.

    Args:
        puppet: puppet or scene.
        member: name of the scene's member; empty for the only puppet.
        x: state at rest; None for the pose of the puppet's file, so that nothing is compiled.

    Raises:
        StateError: no body of the puppet moves freely.
    """
    number = puppet.number
    poses = measure(puppet.tree, number).poses[None]
    if x is not None:
        poses = link_poses(puppet.tree.links, x.q_D[None], x.q_K[None], number)
    leader_of = _leaders(puppet, member)
    segments = _segments(puppet, leader_of, poses[0], member or puppet.name)
    index_of_leader = {
        segment.link: segment_index for segment_index, segment in enumerate(segments)
    }
    segment_of_link = {
        i: index_of_leader[leader_link]
        for i, leader_link in leader_of.items()
        if leader_link in index_of_leader
    }
    forces = {} if x is None else _forces(puppet, x, poses)
    gravity = np.linalg.norm([number(g) for g in puppet.tree.gravity])
    weight = max(float(gravity) * sum(segment.mass for segment in segments), 1e-12)
    ties: list[Tie] = []
    for row in (*puppet.tree.strings, *puppet.tree.chains):
        points = row.points if isinstance(row, StringRow) else (row.points[0], row.points[-1])
        tied_points = [p for p in (points[0], points[-1]) if p.link in segment_of_link]
        tied_points = tied_points or [p for p in points if p.link in segment_of_link]
        free_points = [p for p in (points[-1], points[0], *points) if p.link not in segment_of_link]
        for point in tied_points:
            other_point = free_points[0] if free_points else point
            segment_index, position = (
                segment_of_link[point.link],
                point_position(poses, point, number)[0],
            )
            ties.append(
                Tie(
                    string=row.name,
                    segment=segment_index,
                    local_position=segments[segment_index].pose[:, :3].T
                    @ (position - segments[segment_index].joint),
                    position=position,
                    other_end=point_position(poses, other_point, number)[0],
                    holder=_driven_body(puppet, other_point),
                    lift_share=forces.get(row.name, np.inf) / weight,
                )
            )
    return Anatomy(segments, tuple(ties))


def _segments(
    puppet: CompiledPuppet, leader_of: Mapping[int, int], poses: Array, name: str
) -> tuple[Segment, ...]:
    """Segments of the largest tree of bodies that moves freely, parents first."""
    links, number = puppet.tree.links, puppet.number
    roots = {
        leader_link: _root(puppet, leader_of, leader_link)
        for leader_link in sorted(set(leader_of.values()))
    }
    trees: dict[int, list[int]] = {}
    for leader_link, root in roots.items():
        trees.setdefault(root, []).append(leader_link)
    movable = [tree for tree in trees.values() if any(links[k].role is Role.DYNAMIC for k in tree)]
    if not movable:
        raise StateError(
            f"{name} has no body map of trunk and limbs: none of its bodies moves freely"
        )
    leader_links = max(movable, key=len)
    index_of_leader = {leader_link: k for k, leader_link in enumerate(leader_links)}
    carriers = {
        leader_link: leader_of.get(links[leader_link].parent, NO_PARENT)
        for leader_link in leader_links
    }
    segments = []
    for leader_link in leader_links:
        members = [i for i, link_leader in leader_of.items() if link_leader == leader_link]
        segments.append(
            Segment(
                link=leader_link,
                name=links[leader_link].name,
                parent=index_of_leader.get(carriers[leader_link], NO_PARENT),
                children=tuple(
                    index_of_leader[k] for k in leader_links if carriers[k] == leader_link
                ),
                pose=poses[leader_link],
                mass=sum(link_inertia(links[i], number)[0] for i in members),
                corners=_corners(puppet, poses, leader_link, members),
            )
        )
    return tuple(segments)


def _leaders(puppet: CompiledPuppet, member: str) -> dict[int, int]:
    """Link of a body -> link of the body on which it is fixed, or its own.

    Props are omitted, as are frames in the world on which puppets of a scene stand.
    """
    links, prefix = puppet.tree.links, f"{member}." if member else ""
    bodies = {body.name for body in puppet.puppet.expanded().bodies}
    bodies -= set(puppet.puppet.props)
    leader_of: dict[int, int] = {}
    for i, link in enumerate(links):
        is_frame = link.kind == "fixed" and link.parent == WORLD
        is_frame &= not link.shapes and link_inertia(link, puppet.number)[0] == 0.0
        if link.name not in bodies or not link.name.startswith(prefix) or is_frame:
            continue
        is_fixed = link.kind == "fixed" and link.parent in leader_of
        leader_of[i] = leader_of[link.parent] if is_fixed else i
    return leader_of


def _root(puppet: CompiledPuppet, leader_of: Mapping[int, int], link: int) -> int:
    """Leading link of the segment that carries all others of its tree."""
    while (parent := puppet.tree.links[link].parent) in leader_of:
        link = leader_of[parent]
    return link


def _corners(puppet: CompiledPuppet, poses: Array, reference_link: int, links: list[int]) -> Array:
    """(n, 3) corners of the boxes around the shapes of links, in the frame of a link [m]."""
    R, r = poses[reference_link, :, :3], poses[reference_link, :, 3]
    corners = [np.zeros((0, 3))]
    for i in links:
        for shape in puppet.tree.links[i].shapes:
            for low, high in _boxes(shape):
                box = np.array(list(product(*zip(low, high, strict=True))))
                corners.append((box @ poses[i, :, :3].T + poses[i, :, 3] - r) @ R)
    return np.vstack(corners)


def _boxes(shape: Shape) -> list[tuple[Array, Array]]:
    """Boxes around a shape; for a capsule one around each end, since it may be oblique."""
    if not isinstance(shape, Capsule):
        return [shape_box(shape, np.eye(3, 4))]
    return [
        (np.array(end) - shape.radius, np.array(end) + shape.radius)
        for end in (shape.from_, shape.to)
    ]


def _forces(puppet: CompiledPuppet, x: State, poses: Array) -> dict[str, float]:
    """String -> upward force of its tension at rest [N]; chains are omitted."""
    tension = forward_dynamics(puppet, x).tension
    forces = {}
    for i, row in enumerate(puppet.tree.strings):
        points = [point_position(poses, p, puppet.number)[0] for p in row.points]
        between = points[-1] - points[0]
        vertical_share = abs(float(between[2])) / max(float(np.linalg.norm(between)), 1e-12)
        # The ends of a string over pulleys count as vertical.
        forces[row.name] = float(tension[i]) * (vertical_share if len(points) == 2 else 1.0)
    return forces


def _driven_body(puppet: CompiledPuppet, point: Point) -> str:
    """Driven body from which a string hangs: the last on the way to the world."""
    links, names = puppet.tree.links, {body.name for body in puppet.puppet.expanded().bodies}
    links_to_world = [] if point.link == WORLD else puppet.tree.ancestors(point.link)
    driven = [i for i in links_to_world if links[i].role is Role.DRIVEN and links[i].name in names]
    return links[driven[-1]].name if driven else ""
