"""Distances from triangle meshes, measured by the library coal.

A puppet's compiled library measures distances from bounding boxes; it calls this module for meshes
whose boxes are too near.

A solid is a shape of a body or an obstacle. The winding number of a closed surface is 1 at a point
inside and 0 outside. A hull is the smallest convex solid around a mesh or a piece of it.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, MaskRows
from fantoccini.kernel.runtime import BOX, HALF_SPACE
from fantoccini.model.puppet import Mesh, load_mesh


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances for meshes."""

    touching_distance: float = 1e-8
    """Distance up to which solids count as overlapping [m]: the tolerance of coal's iteration."""
    convexity: float = 1e-7
    """Largest depth of dents relative to the size, and largest missing volume relative to the
    volume, of a mesh that counts as convex. Corners in STL files are rounded to seven digits."""


_TOLERANCES = _Tolerances()


class Meshes:
    """Meshes among the solids, and their distances from other solids.

        d = min |x - y|, x in the mesh, y in the other's core (the solid without its radius)

    A closed mesh is solid: anything inside it overlaps it. A mesh is closed if its triangles use
    every edge equally often in both directions; it may have several pieces and hollows. Other
    meshes are surfaces without an inside.
    """

    def __init__(self) -> None:
        self._bodies: list[_Body] = []
        self._request: Any = None
        self._digest = hashlib.sha256()

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def digest(self) -> str:
        """SHA-256 of all corners and triangles, in hexadecimal."""
        return self._digest.hexdigest()

    def add(self, shape: Mesh) -> tuple[int, Array, Array]:
        """Adds a mesh; returns its index, and its bounding box's centre and half edges (3,) [m]."""
        import coal

        if self._request is None:
            self._request = coal.DistanceRequest()
            self._request.enable_signed_distance = False
            self._request.gjk_tolerance = _TOLERANCES.touching_distance
        mesh = load_mesh(shape)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        low, high = mesh.bounds
        centre, half = (low + high) / 2, (high - low) / 2
        mesh.apply_translation(-centre)
        self._bodies.append(_Body.from_mesh(mesh))
        for a in (centre, mesh.vertices, mesh.faces):
            self._digest.update(np.ascontiguousarray(a).tobytes())
        return len(self._bodies) - 1, centre, half

    def distance(self, x: np.void, y: np.void) -> float:
        """Distance of the cores of two solids in the world, one of them a mesh.

        The caller subtracts the radii.

        Args:
            x, y: ``SOLID`` records; only y may be a half-space. An ellipsoid is replaced by the
                axis of the smallest capsule around it.

        Returns:
            Distance [m]; negative where they overlap, independent of the depth.
        """
        import coal

        if y["kind"] == HALF_SPACE:
            corners = self._bodies[x["mesh"]].hull @ _rotation(x).T + x["a"]
            return float(np.min((corners - y["a"]) @ y["b"]))
        result = coal.distance(*self._core(x), *self._core(y), self._request, coal.DistanceResult())
        if result <= _TOLERANCES.touching_distance or self._contains(x, y) or self._contains(y, x):
            return -_TOLERANCES.touching_distance
        return result

    def _core(self, x: np.void) -> tuple[Any, Any]:
        """A solid's core as coal's geometry, and its pose."""
        import coal

        if x["mesh"] >= 0:
            return self._bodies[x["mesh"]].geometry, coal.Transform3s(_rotation(x), x["a"])
        if x["kind"] == BOX:
            return coal.Box(*(2.0 * x["half"]).tolist()), coal.Transform3s(_rotation(x), x["a"])
        a, b = x["a"].tolist(), x["b"].tolist()
        middle = np.array([0.5 * (p + q) for p, q in zip(a, b, strict=True)])
        length = math.dist(a, b)
        if length < _TOLERANCES.touching_distance:
            return coal.Sphere(0.0), coal.Transform3s(np.eye(3), middle)
        return coal.Capsule(0.0, length), coal.Transform3s(
            _rotation_to_segment(a, b, length), middle
        )

    def _contains(self, x: np.void, y: np.void) -> bool:
        """Whether y lies inside x, provided that their surfaces do not meet."""
        inside = self._bodies[x["mesh"]].inside if x["mesh"] >= 0 else None
        if inside is None:
            return False
        R, offset = _rotation(x), y["a"] - x["a"]
        if y["mesh"] < 0:
            return inside.contains(offset @ R)
        points = self._bodies[y["mesh"]].points @ _rotation(y).T
        return any(inside.contains(point) for point in (offset + points) @ R)


@dataclass(frozen=True, eq=False)
class _Body:
    """A mesh relative to the centre of its bounding box.

    Attributes:
        geometry: geometry of coal: convex and solid, or a tree of triangles.
        hull: (n, 3) corners of the convex hull, or of the mesh if it is open [m].
        points: (k, 3) a corner of every connected piece [m].
        inside: test for points inside; None for open meshes, and for convex ones, which coal tests.
    """

    geometry: Any
    hull: Array
    points: Array
    inside: _InsideTest | None

    @classmethod
    def from_mesh(cls, mesh: Any) -> _Body:
        import coal
        from trimesh.graph import connected_component_labels

        component = connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
        first_faces = np.unique(component, return_index=True)[1]
        points = np.array(mesh.vertices[mesh.faces[first_faces, 0]])
        hull = mesh.convex_hull if mesh.is_volume else mesh
        if hull is not mesh and _is_convex(mesh, hull):
            geometry = coal.Convex(_corners(hull), _triangles(hull))
            return cls(geometry, np.array(hull.vertices), points, None)
        geometry = coal.BVHModelOBBRSS()
        geometry.beginModel(len(mesh.faces), len(mesh.vertices))
        geometry.addSubModel(_corners(mesh), _triangles(mesh))
        geometry.endModel()
        inside = _InsideTest(np.array(mesh.triangles)) if _is_closed(mesh.edges) else None
        return cls(geometry, np.array(hull.vertices), points, inside)


class _InsideTest:
    """Test for points inside closed surfaces, by winding number.

        w = sum over the triangles above the point of the sign of n_z

    Args:
        corners: (n, 3, 3) corners of triangles whose normals point outwards [m].
    """

    def __init__(self, corners: Array):
        self._corners = corners
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        self._box = np.concatenate([self._low.min(axis=0), self._high.max(axis=0)]).tolist()
        self._normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def contains(self, point: Array) -> bool:
        """Whether a point (3,), not on a surface, is inside."""
        (x, y, z), (x_low, y_low, z_low, x_high, y_high, z_high) = point.tolist(), self._box
        if not (x_low <= x <= x_high and y_low <= y <= y_high and z_low <= z <= z_high):
            return False
        is_near = (self._low[:, :2] <= point[:2]) & (point[:2] <= self._high[:, :2])
        (candidates,) = np.nonzero(is_near.all(axis=1) & (self._high[:, 2] >= point[2]))
        corners, normal = self._corners[candidates], self._normal[candidates]
        # In the x-y plane, a ray from inside a triangle crosses one edge, others none or two.
        crosses_odd_edges = np.zeros(len(candidates), dtype=bool)
        for k in range(3):
            crosses_odd_edges ^= _ray_crosses(point, corners[:, k], corners[:, (k + 1) % 3])
        height = np.einsum("ni,ni->n", corners[:, 0] - point, normal)
        sign = np.sign(normal[:, 2])
        return bool(np.sum(sign[crosses_odd_edges & (height * sign > 0.0)]))


def _ray_crosses(point: Array, a: Array, b: Array) -> MaskRows:
    """Whether the ray from a point along +x crosses edges a-b (n, 3) in the x-y plane: (n,) bool.

    The result does not depend on the order of a and b, so that a point on the edge of two triangles
    counts for one of them only.
    """
    is_downward = (a[:, 1] > b[:, 1])[:, None]
    lower, upper = np.where(is_downward, b, a), np.where(is_downward, a, b)
    spans_height = (lower[:, 1] <= point[1]) & (point[1] < upper[:, 1])
    rise = np.where(spans_height, upper[:, 1] - lower[:, 1], 1.0)
    x = lower[:, 0] + (point[1] - lower[:, 1]) * (upper[:, 0] - lower[:, 0]) / rise
    return spans_height & (point[0] < x)


def _is_closed(edges: np.ndarray) -> bool:
    """Whether directed edges (n, 2) of triangles cancel out."""
    edge_index = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)[1]
    return not np.bincount(edge_index.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1)).any()


def _is_convex(mesh: Any, hull: Any) -> bool:
    """Whether a closed mesh is its convex hull up to a tolerance."""
    tolerance = _TOLERANCES.convexity
    if mesh.body_count != 1 or np.max(mesh.face_adjacency_projections) > tolerance * mesh.scale:
        return False
    return bool(hull.volume - mesh.volume <= tolerance * hull.volume)


def _corners(mesh: Any) -> Any:
    import coal

    result = coal.StdVec_Vec3s()
    result.extend(list(np.asarray(mesh.vertices)))
    return result


def _triangles(mesh: Any) -> Any:
    import coal

    result = coal.StdVec_Triangle()
    result.extend([coal.Triangle(*corners) for corners in mesh.faces.tolist()])
    return result


def _rotation(x: np.void) -> Array:
    """Rotation (3, 3) of a solid, whose record has it column by column."""
    return x["R"].reshape(3, 3).T


def _rotation_to_segment(a: list[float], b: list[float], length: float) -> Array:
    """Rotation (3, 3) whose z axis points from a to b.

    After Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    """
    x, y, z = ((q - p) / length for p, q in zip(a, b, strict=True))
    s = math.copysign(1.0, z)
    p = -1.0 / (s + z)
    q = x * y * p
    return np.array([[1.0 + s * x * x * p, q, x], [s * q, s + y * y * p, y], [-s * x, -y, z]])
