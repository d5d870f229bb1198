"""Dented meshes as convex pieces, by CoACD (Wei, Liu, Ling, Su, SIGGRAPH 2022).

Cuts by planes divide a mesh until every piece is nearly its convex hull. The hulls overlap a little
where the surface is curved inwards.

A hull is the smallest convex solid around a set of points.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.build import kept_arrays
from fantoccini.kernel.contract import HULL_VERTICES
from fantoccini.model.meshes import inside


@dataclass(frozen=True)
class PieceTolerances:
    """Tolerances of convex pieces. Lengths are relative to the mesh's longest side."""

    flat: float = 1e-6
    """Distance from a plane at which points count as on it: STL files have seven digits."""
    cut: float = 0.025
    """Depth of dents above which a piece is cut again."""
    deviation: float = 0.03
    """Largest accepted distance of the pieces from the mesh, or of the mesh from the pieces.
    CoACD measures dents by samples, and replaces triangles of meshes that intersect themselves."""
    thin: float = 1e-4
    """Thickness below which a piece is left out."""
    max_pieces: int = 128
    """Largest number of pieces of one mesh."""
    spacing: float = 0.03
    """Distance of the points at which the deviation is measured."""


TOLERANCES = PieceTolerances()


def convex_pieces(mesh: Any, name: str) -> list[Array]:
    """Corners (n, 3) of the convex pieces of a closed mesh [m], at most ``HULL_VERTICES`` each.

    The same mesh gives the same pieces, with any number of threads. They are stored in the cache
    folder.

    Args:
        mesh: a closed ``trimesh.Trimesh``.
        name: name of its file, for messages.

    Raises:
        ValueError: CoACD is not installed, or no good pieces were found.
    """
    try:
        version = importlib.metadata.version("coacd")
    except importlib.metadata.PackageNotFoundError:
        raise ValueError(
            f"{name} is not convex, and the package that cuts meshes into convex pieces is not "
            "installed: python -m pip install coacd. Or split it into several convex meshes of the "
            "same body, or let boxes, capsules, spheres touch"
        ) from None
    digest = hashlib.sha256(f"convex pieces {version} {TOLERANCES} {HULL_VERTICES}".encode())
    for a in (mesh.vertices, mesh.faces):
        digest.update(np.ascontiguousarray(a).tobytes())
    return kept_arrays(digest.hexdigest(), lambda: _cut(mesh, name))


def standing_out(points: Array, size: float) -> Array:
    """Vertices of a convex hull, those that stand out most first; at most ``HULL_VERTICES``.

    Vertices on the planes of the others do not count.

    Args:
        points: (n, 3) [m].
        size: length to which ``TOLERANCES.flat`` is relative [m].
    """
    from scipy.spatial import ConvexHull

    points = points[ConvexHull(points).vertices]
    first = _spread(points)
    hull, chosen = ConvexHull(points[first], incremental=True), list(first)
    while True:
        # Facets in one plane are triangles with one equation.
        planes = np.unique(hull.equations, axis=0)
        out = np.max(points @ planes[:, :3].T + planes[:, 3], axis=1)
        farthest = int(np.argmax(out))
        if out[farthest] <= TOLERANCES.flat * size or len(chosen) == int(HULL_VERTICES):
            break
        chosen.append(farthest)
        hull.add_points(points[[farthest]])
    hull.close()
    return np.asarray(points[chosen])


def _spread(points: Array) -> list[int]:
    """Four points of a large tetrahedron, by a greedy choice."""
    a = int(np.argmin(points[:, 0]))
    b = int(np.argmax(np.linalg.norm(points - points[a], axis=1)))
    direction = (points[b] - points[a]) / np.linalg.norm(points[b] - points[a])
    from_a = points - points[a]
    c = int(np.argmax(np.linalg.norm(from_a - np.outer(from_a @ direction, direction), axis=1)))
    d = int(np.argmax(np.abs(from_a @ np.cross(direction, from_a[c]))))
    return [a, b, c, d]


def _cut(mesh: Any, name: str) -> list[Array]:
    import coacd

    coacd.set_log_level("error")
    size = float(np.max(mesh.extents))
    # Its unit of length is half of the longest side.
    parts = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), threshold=2.0 * TOLERANCES.cut)
    corners = [_merged(vertices, mesh.vertices, TOLERANCES.thin * size) for vertices, _ in parts]
    pieces = [_corners_of(x, size) for x in corners if thickness(x) > TOLERANCES.thin * size]
    if len(pieces) > TOLERANCES.max_pieces:
        raise ValueError(
            f"{name} needs {len(pieces)} convex pieces in contact; allowed: "
            f"{TOLERANCES.max_pieces}. "
            "Make the mesh plainer, or let boxes, capsules, spheres touch"
        )
    off = _deviation(mesh, pieces, size) / size
    if off > TOLERANCES.deviation:
        raise ValueError(
            f"{name} could not be cut into convex pieces: those found leave its surface by "
            f"{100 * off:.1f} % of its longest side; allowed: {100 * TOLERANCES.deviation:g} %. "
            "See that no triangles intersect, or split it into several convex meshes of the same "
            "body"
        )
    return pieces


def _corners_of(points: Array, size: float) -> Array:
    """Vertices of a piece's convex hull, at most ``HULL_VERTICES``."""
    from scipy.spatial import ConvexHull

    points = points[np.sort(ConvexHull(points).vertices)]
    return points if len(points) <= int(HULL_VERTICES) else standing_out(points, size)


def _merged(corners: Array, vertices: Array, max_distance: float) -> Array:
    """Corners (n, 3) at least ``max_distance`` apart [m]; those near a mesh vertex are moved to it.

    Cuts leave corners that nearly coincide, with facets of arbitrary direction between them.
    """
    from scipy.spatial import cKDTree

    distance, nearest_vertex = cKDTree(vertices).query(corners)
    snapped = np.where((distance < max_distance)[:, None], vertices[nearest_vertex], corners)
    is_kept = np.ones(len(snapped), dtype=bool)
    tree = cKDTree(snapped)
    for i in np.argsort(distance, kind="stable"):  # the mesh's own first
        if is_kept[i]:
            is_kept[[k for k in tree.query_ball_point(snapped[i], max_distance) if k != i]] = False
    return snapped[is_kept]


def thickness(points: Array) -> float:
    """Extent [m] of points (n, 3) along the axis in which they vary least."""
    if len(points) < 4:
        return 0.0
    offsets = points - points.mean(axis=0)
    return float(np.ptp(offsets @ np.linalg.svd(offsets, full_matrices=False)[2][-1]))


def _deviation(mesh: Any, pieces: list[Array], size: float) -> float:
    """Largest distance [m], at samples, of the pieces from the mesh and of the mesh from them."""
    import trimesh
    from scipy.spatial import ConvexHull

    if not pieces:
        return np.inf
    samples, missed = [], np.inf
    mesh_points = np.concatenate([mesh.vertices, mesh.triangles_center])
    for corners in pieces:
        hull = ConvexHull(corners)
        samples.append(
            trimesh.remesh.subdivide_to_size(
                corners, hull.simplices, TOLERANCES.spacing * size, max_iter=12
            )[0]
        )
        planes = np.unique(hull.equations, axis=0)
        missed = np.minimum(missed, np.max(mesh_points @ planes[:, :3].T + planes[:, 3], axis=1))
    points = np.concatenate(samples)
    distance = distances(mesh, points)
    suspects = np.flatnonzero(distance > TOLERANCES.deviation * size)
    outside = distance[suspects[~inside(mesh, points[suspects])]]
    return max(float(np.max(outside, initial=0.0)), float(np.max(missed, initial=0.0)))


def distances(mesh: Any, points: Array) -> Array:
    """(n,) distances of points (n, 3) from the surface of a mesh, by coal [m]."""
    import coal

    surface, corners, triangles = coal.BVHModelOBBRSS(), coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    corners.extend(list(np.asarray(mesh.vertices)))
    triangles.extend([coal.Triangle(*face) for face in mesh.faces.tolist()])
    surface.beginModel(len(mesh.faces), len(mesh.vertices))
    surface.addSubModel(corners, triangles)
    surface.endModel()
    point, request, identity = (
        coal.Sphere(1e-12),
        coal.DistanceRequest(),
        coal.Transform3s.Identity(),
    )
    request.enable_signed_distance = False
    rotation_ = np.eye(3)
    return np.array(
        [
            coal.distance(
                surface,
                identity,
                point,
                coal.Transform3s(rotation_, x),
                request,
                coal.DistanceResult(),
            )
            for x in points
        ]
    )
