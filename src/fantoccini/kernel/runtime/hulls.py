"""Convex hulls of meshes, as compiled code lets them touch.

A polytope is a convex solid with flat facets.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array
from fantoccini.kernel.runtime.packing import packed
from fantoccini.kernel.runtime.pieces import TOLERANCES, convex_pieces, standing_out, thickness
from fantoccini.model import meshes
from fantoccini.model.puppet import Mesh, load_mesh, unclosed

FILLED = 0.1
"""Volume that its hull may add to a mesh, relative to the mesh's, before it is cut into pieces."""


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polytope around its centroid.

    Attributes:
        centroid: (3,) in the frame of the mesh [m].
        vertices: (n, 3) from the centroid, in order of z, then y, then x [m].
        planes: (f, 4) outward unit normals of the facets, and their heights over the centroid [m].
        begins: (f + 1,) where the corners of each facet begin.
        corners: vertices of each facet in turn, anticlockwise seen from outside.
        sides: the edge from each corner to the next.
        edges: (e, 4) two vertices, the facets to the left and to the right.
        around_begins: (n + 1,) where the facets of each vertex begin.
        around: facets of each vertex.
    """

    centroid: Array
    vertices: Array
    planes: Array
    begins: NDArray[np.int32]
    corners: NDArray[np.int32]
    sides: NDArray[np.int32]
    edges: NDArray[np.int32]
    around_begins: NDArray[np.int32]
    around: NDArray[np.int32]

    @property
    def outer(self) -> float:
        """Radius of the ball about the centroid that contains all vertices [m]."""
        return float(np.max(np.linalg.norm(self.vertices, axis=1)))

    @cached_property
    def structure(self) -> ctypes.Structure:
        """The structure for compiled code; it and its arrays live as long as this object."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "centroid"}
        return packed(
            "Hull",
            n_vertices=len(self.vertices),
            n_facets=len(self.planes),
            n_edges=len(self.edges),
            inner=float(np.min(self.planes[:, 3])),
            outer=self.outer,
            **arrays,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, f.name) for f in fields(self))


def mesh_hulls(shape: Mesh) -> tuple[Hull, ...]:
    """The convex polytopes that replace a closed mesh, in the frame of its body.

    One for each nearly convex piece, and those of the convex pieces of others. Of more than
    ``HULL_VERTICES`` vertices those that stand out most are used; the others stand out by less
    than 2 % of the longest side, as for a ball.

    Args:
        shape: the mesh's file, scale and pose.

    Raises:
        ValueError: the mesh is open or flat, or cannot be cut into pieces.
    """
    mesh = load_mesh(shape)
    if not shape.read().closed:
        raise ValueError(
            f"{shape.file} {unclosed(mesh)}; meshes in contact must be closed: close its holes"
        )
    size = float(np.max(mesh.extents))
    if not float(np.min(mesh.extents)) > TOLERANCES.flat * size:
        raise ValueError(f"{shape.file} is flat; meshes in contact need a volume: use a thin box")
    parts = meshes.pieces(mesh)
    if len(parts) > 1:
        thick = [part for part in parts if thickness(part.vertices) > TOLERANCES.flat * size]
        parts = _outermost(thick)
    hulls = [hull for part in parts for hull in _piece_hulls(part, shape.file)]
    if len(hulls) > TOLERANCES.max_pieces:
        raise ValueError(
            f"{shape.file} needs {len(hulls)} convex pieces in contact; allowed: "
            f"{TOLERANCES.max_pieces}. Make it plainer, or let boxes, capsules, spheres touch"
        )
    return tuple(hulls)


def _outermost(parts: list[Any]) -> list[Any]:
    """The pieces of a mesh without those inside the hull of another, nearly convex piece."""
    planes = [_planes(np.array(p.vertices)) if _is_convex(p) else None for p in parts]
    visible = []
    for i, mesh_part in enumerate(parts):
        slack = TOLERANCES.flat * float(np.max(mesh_part.extents))
        hidden = any(
            other_planes is not None
            and k != i
            and parts[k].volume > mesh_part.volume
            and np.max(mesh_part.vertices @ other_planes[:, :3].T + other_planes[:, 3]) <= slack
            for k, other_planes in enumerate(planes)
        )
        if not hidden:
            visible.append(mesh_part)
    return visible


def _piece_hulls(mesh: Any, name: str) -> list[Hull]:
    """Hulls of one piece of a mesh."""
    from scipy.spatial import QhullError

    if _is_convex(mesh):
        points = np.array(mesh.vertices, dtype=float)
        return [hull_of(standing_out(points, float(np.max(mesh.extents))))]
    try:
        return [hull_of(corners) for corners in convex_pieces(mesh, name)]
    except QhullError:
        raise ValueError(
            f"{name} could not be cut into convex pieces: one of them has no hull. Split it "
            "into several convex meshes of the same body"
        ) from None


def _is_convex(mesh: Any) -> bool:
    return _volume(np.array(mesh.vertices)) <= (1.0 + FILLED) * float(mesh.volume)


def hull_of(points: Array) -> Hull:
    """The convex hull of points (n, 3) [m].

    Facets whose vertices lie within ``TOLERANCES.flat`` of a plane are merged; vertices in a facet
    or on an edge, up to that tolerance, are left out.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    vertices = points[np.sort(hull.vertices)]
    vertices = vertices[np.lexsort(vertices.T)]
    centroid = _centroid(vertices, ConvexHull(vertices))
    vertices = vertices - centroid
    flat = TOLERANCES.flat * float(np.max(np.ptp(vertices, axis=0)))
    facets = [_Facet.of(vertices, group) for group in _flat_groups(vertices, flat)]
    uses = np.bincount(np.concatenate([f.corners for f in facets]), minlength=len(vertices))
    if np.any(uses < 3):
        return hull_of(vertices[uses >= 3] + centroid)
    begins = np.cumsum([0, *(len(f.corners) for f in facets)])
    edges, sides = _edges_of([f.corners for f in facets])
    neighbours: list[list[int]] = [[] for _ in vertices]
    for i, facet in enumerate(facets):
        for corner in facet.corners:
            neighbours[corner].append(i)
    return Hull(
        centroid=centroid,
        vertices=vertices,
        planes=np.array([[*f.normal, f.height] for f in facets]),
        begins=_whole(begins),
        corners=_whole(np.concatenate([f.corners for f in facets])),
        sides=_whole(sides),
        edges=_whole(edges).reshape(-1, 4),
        around_begins=_whole(np.cumsum([0, *map(len, neighbours)])),
        around=_whole(np.concatenate(neighbours)),
    )


@dataclass(frozen=True, eq=False)
class _Facet:
    """A convex polygon: outward unit normal, height over the origin, corners anticlockwise."""

    normal: Array
    height: float
    corners: list[int]

    @classmethod
    def of(cls, vertices: Array, triangles: NDArray[np.int32]) -> _Facet:
        """The polygon that triangles (n, 3) in one plane form."""
        corners = _in_turn(triangles)
        x = vertices[corners]
        # Newell's normal; its length is twice the area.
        normal = np.sum(np.cross(x, np.roll(x, -1, axis=0)), axis=0)
        normal /= np.linalg.norm(normal)
        return cls(normal, float(np.max(x @ normal)), corners)


def _volume(points: Array) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(points).volume)


def _planes(points: Array) -> Array:
    """(n, 4) outward normals and offsets of the facets of a hull."""
    from scipy.spatial import ConvexHull

    return np.unique(ConvexHull(points).equations, axis=0)


def _centroid(vertices: Array, hull: Any) -> Array:
    """Centre of mass of a hull, by tetrahedra with a point inside."""
    middle = vertices.mean(axis=0)
    x = vertices[hull.simplices] - middle
    volume = np.abs(np.linalg.det(x))
    return np.asarray(middle + (volume @ x.sum(axis=1)) / (4.0 * volume.sum()))


def _flat_groups(vertices: Array, flat: float) -> Iterator[NDArray[np.int32]]:
    """The triangles of the hull's surface, gathered by planes; largest first."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    x = vertices[hull.simplices]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    outward = np.sign(np.einsum("ni,ni->n", normals, hull.equations[:, :3]))
    triangles = np.where((outward > 0)[:, None], hull.simplices, hull.simplices[:, ::-1])
    area = np.linalg.norm(normals, axis=1)
    is_ungrouped = np.ones(len(triangles), dtype=bool)
    for seed in np.argsort(-area, kind="stable"):
        if not is_ungrouped[seed]:
            continue
        normal = normals[seed] * outward[seed] / area[seed]
        height = vertices[triangles[seed, 0]] @ normal
        off = np.abs(vertices @ normal - height) <= flat
        group, edge = [int(seed)], [int(seed)]
        is_ungrouped[seed] = False
        while edge:
            for neighbour in hull.neighbors[edge.pop()]:
                if is_ungrouped[neighbour] and np.all(off[triangles[neighbour]]):
                    is_ungrouped[neighbour] = False
                    group.append(int(neighbour))
                    edge.append(int(neighbour))
        yield triangles[group]


def _in_turn(triangles: NDArray[np.int32]) -> list[int]:
    """The corners of the polygon that triangles form, in order."""
    directed = {(int(a), int(b)) for t in triangles for a, b in zip(t, np.roll(t, -1), strict=True)}
    onward = dict(pair for pair in directed if pair[::-1] not in directed)
    corners = [min(onward)]
    while len(corners) < len(onward):
        corners.append(onward[corners[-1]])
    return corners


def _edges_of(polygons: list[list[int]]) -> tuple[list[list[int]], list[int]]:
    """(e, 4) edges, and the edge from each corner of every polygon to the next."""
    face_of_edge = {pair: i for i, p in enumerate(polygons) for pair in pairwise([*p, p[0]])}
    number = {pair: k for k, pair in enumerate(sorted(p for p in face_of_edge if p[0] < p[1]))}
    edges = [[*pair, face_of_edge[pair], face_of_edge[pair[::-1]]] for pair in number]
    sides = [number[min(pair, pair[::-1])] for p in polygons for pair in pairwise([*p, p[0]])]
    return edges, sides


def _whole(numbers: Any) -> NDArray[np.int32]:
    return np.ascontiguousarray(numbers, dtype=np.int32)
