"""Distances from triangle meshes, by coal.

The compiled library measures from the box about a mesh, and asks here where that is not enough.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.puppet.shapes import Mesh, load_mesh
from fantoccini.runtime import BOX, HALF_SPACE

_TOUCH = 1e-8
"""Distance up to which things overlap [m]; coal's iteration tells no more."""

_FLAT = 1e-7
"""Part of its size by which a convex mesh may be dented, and of its volume that may lack: corners
in STL files have seven digits."""


class Meshes:
    """The meshes among solids, and how far they are from the others.

        d = min |x - y|, x in the mesh, y in the other's core

    A closed mesh is solid: what lies within it overlaps. Closed are triangles that run along every
    edge as often one way as the other; they may be in pieces, and leave hollows. Any others are a
    surface without an inside: what they surround is clear.
    """

    def __init__(self):
        self._made: list[_Body] = []
        self._request: Any = None
        self._digest = hashlib.sha256()

    def __len__(self) -> int:
        return len(self._made)

    @property
    def digest(self) -> str:
        """SHA-256 of all corners and triangles, in hexadecimal."""
        return self._digest.hexdigest()

    def add(self, shape: Mesh) -> tuple[int, Array, Array]:
        """A mesh's number, and the centre and half edges (3,) of the box about it [m]."""
        import coal

        if self._request is None:
            self._request = coal.DistanceRequest()
            self._request.enable_signed_distance = False
            self._request.gjk_tolerance = _TOUCH
        mesh = load_mesh(shape)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        low, high = mesh.bounds
        centre, half = (low + high) / 2, (high - low) / 2
        mesh.apply_translation(-centre)
        self._made.append(_Body.of(mesh))
        for a in (centre, mesh.vertices, mesh.faces):
            self._digest.update(np.ascontiguousarray(a).tobytes())
        return len(self._made) - 1, centre, half

    def distance(self, x: np.void, y: np.void) -> float:
        """Of two solids in the world, one of which is a mesh, before radii are taken off.

        Args:
            x, y: ``SOLID`` records; only y may be a half-space. An ellipsoid is the segment of the
                capsule about it.

        Returns:
            [m]; negative where they overlap, and no measure of how far.
        """
        import coal

        if y["kind"] == HALF_SPACE:
            corners = self._made[x["mesh"]].hull @ _turn(x).T + x["a"]
            return float(np.min((corners - y["a"]) @ y["b"]))
        found = coal.distance(
            *self._placed(x), *self._placed(y), self._request, coal.DistanceResult()
        )
        if found <= _TOUCH or self._holds(x, y) or self._holds(y, x):
            return -_TOUCH
        return found

    def _placed(self, x: np.void) -> tuple[Any, Any]:
        """A solid's core as coal's geometry, and where it is."""
        import coal

        if x["mesh"] >= 0:
            return self._made[x["mesh"]].geometry, coal.Transform3s(_turn(x), x["a"])
        if x["kind"] == BOX:
            return coal.Box(*(2.0 * x["half"]).tolist()), coal.Transform3s(_turn(x), x["a"])
        a, b = x["a"].tolist(), x["b"].tolist()
        middle = np.array([0.5 * (p + q) for p, q in zip(a, b, strict=True)])
        length = math.dist(a, b)
        if length < _TOUCH:
            return coal.Sphere(0.0), coal.Transform3s(np.eye(3), middle)
        return coal.Capsule(0.0, length), coal.Transform3s(_along(a, b, length), middle)

    def _holds(self, x: np.void, y: np.void) -> bool:
        """Whether y lies within x, where their surfaces do not meet."""
        inside = self._made[x["mesh"]].inside if x["mesh"] >= 0 else None
        if inside is None:
            return False
        turn, middle = _turn(x), y["a"] - x["a"]
        if y["mesh"] < 0:
            return inside.holds(middle @ turn)
        points = self._made[y["mesh"]].points @ _turn(y).T
        return any(inside.holds(point) for point in (middle + points) @ turn)


@dataclass(frozen=True, eq=False)
class _Body:
    """A mesh about the centre of its box.

    Attributes:
        geometry: coal's: convex and solid, or a tree of triangles.
        hull: (n, 3) corners, those of its convex hull among them [m].
        points: (k, 3) a corner of every connected piece [m].
        inside: tells what is within; None for convex meshes, of which coal tells, and open ones.
    """

    geometry: Any
    hull: Array
    points: Array
    inside: _Inside | None

    @classmethod
    def of(cls, mesh: Any) -> _Body:
        import coal
        from trimesh.graph import connected_component_labels

        label = connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
        first = np.unique(label, return_index=True)[1]
        points = np.array(mesh.vertices[mesh.faces[first, 0]])
        hull = mesh.convex_hull if mesh.is_volume else mesh
        if hull is not mesh and _convex(mesh, hull):
            geometry = coal.Convex(_corners(hull), _triangles(hull))
            return cls(geometry, np.array(hull.vertices), points, None)
        geometry = coal.BVHModelOBBRSS()
        geometry.beginModel(len(mesh.faces), len(mesh.vertices))
        geometry.addSubModel(_corners(mesh), _triangles(mesh))
        geometry.endModel()
        inside = _Inside(np.array(mesh.triangles)) if _closed(mesh.edges) else None
        return cls(geometry, np.array(hull.vertices), points, inside)


class _Inside:
    """Whether points lie within closed surfaces: how often these wind about them.

        w = sum over the triangles above the point of the sign of n_z

    Args:
        corners: (n, 3, 3) of triangles that face out [m].
    """

    def __init__(self, corners: Array):
        self._corners = corners
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        self._box = np.concatenate([self._low.min(axis=0), self._high.max(axis=0)]).tolist()
        self._normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def holds(self, point: Array) -> bool:
        """Whether a point (3,) that is not on a surface is within one."""
        (x, y, z), (x_low, y_low, z_low, x_high, y_high, z_high) = point.tolist(), self._box
        if not (x_low <= x <= x_high and y_low <= y <= y_high and z_low <= z <= z_high):
            return False
        near = (self._low[:, :2] <= point[:2]) & (point[:2] <= self._high[:, :2])
        (which,) = np.nonzero(near.all(axis=1) & (self._high[:, 2] >= point[2]))
        corners, normal = self._corners[which], self._normal[which]
        odd = np.zeros(len(which), dtype=bool)
        for k in range(3):
            odd ^= _left_of(point, corners[:, k], corners[:, (k + 1) % 3])
        height = np.einsum("ni,ni->n", corners[:, 0] - point, normal)
        faces = np.sign(normal[:, 2])
        return bool(np.sum(faces[odd & (height * faces > 0.0)]))


def _left_of(point: Array, a: Array, b: Array) -> Array:
    """Whether edges a to b (n, 3), seen from above, pass a point on its right.

    The same for b to a, so that of triangles that share an edge one has the point.
    """
    turned = (a[:, 1] > b[:, 1])[:, None]
    low, high = np.where(turned, b, a), np.where(turned, a, b)
    passes = (low[:, 1] <= point[1]) & (point[1] < high[:, 1])
    rise = np.where(passes, high[:, 1] - low[:, 1], 1.0)
    x = low[:, 0] + (point[1] - low[:, 1]) * (high[:, 0] - low[:, 0]) / rise
    return passes & (point[0] < x)


def _closed(edges: np.ndarray) -> bool:
    """Whether edges (n, 2), as triangles run along them, cancel out."""
    which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)[1]
    return not np.bincount(which.ravel(), np.where(edges[:, 0] < edges[:, 1], 1, -1)).any()


def _convex(mesh: Any, hull: Any) -> bool:
    """Whether a closed mesh is its convex hull: no edge is dented, and it is as large."""
    if mesh.body_count != 1 or np.max(mesh.face_adjacency_projections) > _FLAT * mesh.scale:
        return False
    return hull.volume - mesh.volume <= _FLAT * hull.volume


def _corners(mesh: Any) -> Any:
    import coal

    found = coal.StdVec_Vec3s()
    found.extend(list(np.asarray(mesh.vertices)))
    return found


def _triangles(mesh: Any) -> Any:
    import coal

    found = coal.StdVec_Triangle()
    found.extend([coal.Triangle(*corners) for corners in mesh.faces.tolist()])
    return found


def _turn(x: np.void) -> Array:
    """(3, 3) the rotation of a solid, which is kept column by column."""
    return x["R"].reshape(3, 3).T


def _along(a: list[float], b: list[float], length: float) -> Array:
    """(3, 3) a rotation whose z axis points from a to b.

    As in Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    """
    x, y, z = ((q - p) / length for p, q in zip(a, b, strict=True))
    s = math.copysign(1.0, z)
    p = -1.0 / (s + z)
    q = x * y * p
    return np.array([[1.0 + s * x * x * p, q, x], [s * q, s + y * y * p, y], [-s * x, -y, z]])
