"""Solids in the world for tests of the narrow phase, and the results of coal."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cpp.toolchain import run_program
from fantoccini.kernel.runtime.hulls import Hull, hull_of

SEGMENT, BOX, HALF_SPACE, HULL = 0, 1, 2, 3
MAX_TOUCHES = 8


@dataclass(frozen=True, eq=False)
class Placed:
    """A solid with the fields of `PlacedSolid`; the columns of R (3, 3) are the axes, `mesh` is
    a hull.
    """

    kind: int
    a: np.ndarray
    b: np.ndarray
    R: np.ndarray
    half: np.ndarray
    radius: float
    mesh: Hull | None = None

    @property
    def corners(self) -> np.ndarray:
        """Vertices of a hull in the world."""
        assert self.mesh is not None
        return np.asarray(self.mesh.vertices @ self.R.T + self.a)

    @property
    def words(self) -> list[float]:
        return [self.kind, *self.a, *self.b, *self.R.T.ravel(), *self.half, self.radius]

    @property
    def centre(self) -> np.ndarray:
        return (self.a + self.b) / 2 if self.kind == SEGMENT else self.a

    @property
    def ellipsoid(self) -> bool:
        return self.kind == SEGMENT and bool(self.half[0] > 0)

    def moved(self, by: ArrayLike, turn: Rotation | None = None) -> Placed:
        """The solid turned about the origin, then shifted."""
        Q = np.eye(3) if turn is None else turn.as_matrix()
        b = Q @ self.b if self.kind == HALF_SPACE else Q @ self.b + np.asarray(by)
        return replace(self, a=Q @ self.a + np.asarray(by), b=b, R=Q @ self.R)

    def turned(self, turn: Rotation) -> Placed:
        """The solid turned about its own centre."""
        return self.moved(self.centre - turn.apply(self.centre), turn)

    def reach(self, n: np.ndarray) -> float:
        """max n . x over the solid; for half-spaces only along their normal."""
        if self.kind == HALF_SPACE:
            return float(self.a @ self.b) if n @ self.b > 1 - 1e-9 else np.inf
        if self.ellipsoid:
            return float(n @ self.centre + np.linalg.norm(self.half * (self.R.T @ n)))
        if self.kind == BOX:
            return float(n @ self.a + self.half @ np.abs(self.R.T @ n)) + self.radius
        if self.kind == HULL:
            return float(np.max(self.corners @ n)) + self.radius
        return float(max(n @ self.a, n @ self.b)) + self.radius

    def off_surface(self, point: np.ndarray) -> float:
        """Signed distance of a point from the surface; for ellipsoids to first order."""
        if self.kind == HALF_SPACE:
            return float((point - self.a) @ self.b)
        local = self.R.T @ (point - self.centre)
        if self.kind == BOX:
            over = np.abs(local) - self.half
            return float(np.linalg.norm(np.maximum(over, 0)) + min(np.max(over), 0) - self.radius)
        if self.mesh is not None:
            inside = np.max(self.mesh.planes[:, :3] @ local - self.mesh.planes[:, 3])
            if inside <= 0:
                return float(inside - self.radius)
            return _distance(self.mesh.vertices - local) - self.radius
        if self.ellipsoid:
            slope = 2 * np.linalg.norm(local / self.half**2)
            return float((np.sum((local / self.half) ** 2) - 1) / max(slope, 1e-300))
        along = self.b - self.a
        t = np.clip((point - self.a) @ along / max(along @ along, 1e-300), 0, 1)
        return float(np.linalg.norm(point - self.a - t * along) - self.radius)


@dataclass(frozen=True, eq=False)
class Touch:
    """`alone`: normal (3) and gap by feature and region alone, if they are defined; `holds`:
    whether the point is within its features.
    """

    point: np.ndarray
    normal: np.ndarray
    gap: float
    feature: int
    region: int
    alone: np.ndarray | None
    holds: bool


@dataclass(frozen=True, eq=False)
class Pair:
    """Result of the narrow phase for two solids."""

    radius: float
    apart: bool
    touches: list[Touch]

    @property
    def gap(self) -> float:
        return min(t.gap for t in self.touches)

    @property
    def features(self) -> list[int]:
        return [t.feature for t in self.touches]

    @property
    def points(self) -> np.ndarray:
        return np.array([t.point for t in self.touches])


def _distance(corners: np.ndarray) -> float:
    """Distance of the origin from the convex hull of points (n, 3) (Lawson and Hanson, 1974,
    chapter 23).
    """
    weight, _ = nnls(np.vstack([corners.T, np.ones(len(corners))]), [0.0, 0.0, 0.0, 1.0])
    return float(np.linalg.norm(weight @ corners) / weight.sum())


def placed_solid(kind: int, a: ArrayLike, b: ArrayLike, **rest: Any) -> Placed:
    R, half, radius = rest.get("R", np.eye(3)), rest.get("half", np.zeros(3)), rest.get("radius", 0)
    return Placed(
        kind, np.array(a, float), np.array(b, float), R, np.array(half, float), float(radius)
    )


def capsule(a: ArrayLike, b: ArrayLike, radius: float) -> Placed:
    return placed_solid(SEGMENT, a, b, radius=radius)


def sphere(at: ArrayLike, radius: float) -> Placed:
    return capsule(at, at, radius)


def box(at: ArrayLike, half: ArrayLike, turn: Rotation | None = None) -> Placed:
    R = np.eye(3) if turn is None else turn.as_matrix()
    return placed_solid(BOX, at, at, R=R, half=half)


def half_space(at: ArrayLike, normal: ArrayLike) -> Placed:
    n = np.asarray(normal, float)
    return placed_solid(HALF_SPACE, at, n / np.linalg.norm(n))


def ellipsoid(at: ArrayLike, radii: ArrayLike, turn: Rotation | None = None) -> Placed:
    """Ellipsoid with the capsule around it."""
    R = np.eye(3) if turn is None else turn.as_matrix()
    sizes, centre = np.asarray(radii, float), np.asarray(at, float)
    longest, middle = int(np.argmax(sizes)), float(np.sort(sizes)[1])
    along = (sizes[longest] - middle) * R[:, longest]
    return placed_solid(SEGMENT, centre - along, centre + along, R=R, half=sizes, radius=middle)


def touches(
    program: Path, pairs: Sequence[tuple[Placed, Placed]], margin: float = 0.05
) -> list[Pair]:
    """The contact points of pairs."""
    meshes = {s.mesh for pair in pairs for s in pair if s.mesh is not None}
    hulls = {h: k for k, h in enumerate(sorted(meshes, key=lambda h: h.vertices.tobytes()))}
    words = [margin, len(hulls), *(w for hull in hulls for w in hull_words(hull)), len(pairs)]
    for x, y in pairs:
        for s in (x, y):
            words += [*s.words, -1 if s.mesh is None else hulls[s.mesh]]
    lines = run_program(program, "\n".join(repr(float(w)) for w in words)).splitlines()
    assert len(lines) == len(pairs)
    return [_parsed([float(word) for word in line.split()]) for line in lines]


def hull_words(hull: Hull) -> list[float]:
    """Numbers of a hull in the program's format."""
    counts = len(hull.vertices), len(hull.planes), len(hull.edges), len(hull.corners)
    arrays = (
        hull.vertices,
        hull.planes,
        hull.begins,
        hull.corners,
        hull.sides,
        hull.edges,
        hull.around_begins,
        hull.around,
    )
    radii = (float(np.min(hull.planes[:, 3])), hull.outer)
    return [*counts, *radii, *(float(w) for a in arrays for w in np.ravel(a))]


def _parsed(line: list[float]) -> Pair:
    assert np.all(np.isfinite(line))
    radius, apart, n, *rest = line
    assert n <= MAX_TOUCHES and len(rest) == 15 * n
    points = []
    for r in np.array(rest).reshape(-1, 15):
        known, holds = bool(r[9]), bool(r[10])
        alone = r[11:] if known else None
        points.append(Touch(r[:3], r[3:6], float(r[6]), int(r[7]), int(r[8]), alone, holds))
    return Pair(radius, bool(apart), points)


def coal_distance(x: Placed, y: Placed) -> tuple[float, np.ndarray]:
    """Distance, negative for the depth, and the direction from the second to the first."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    request.gjk_max_iterations = request.epa_max_iterations = 2000
    distance = coal.distance(*_coal(x), *_coal(y), request, result)
    return float(distance), -np.array(result.normal).ravel()


def _coal(x: Placed) -> tuple[Any, Any]:
    at = coal.Transform3s(x.R, x.centre)
    if x.kind == HALF_SPACE:
        return coal.Halfspace(x.b, float(x.a @ x.b)), coal.Transform3s.Identity()
    if x.kind == BOX:
        return coal.Box(*(2 * x.half).tolist()), at
    if x.ellipsoid:
        return coal.Ellipsoid(*x.half.tolist()), at
    if x.mesh is not None:
        return _coal_hull(x.mesh), at
    length = float(np.linalg.norm(x.b - x.a))
    if length == 0:
        return coal.Sphere(x.radius), at
    turn = Rotation.align_vectors([(x.b - x.a) / length], [[0, 0, 1]])[0].as_matrix()
    return coal.Capsule(x.radius, length), coal.Transform3s(turn, x.centre)


@functools.cache
def _coal_hull(hull: Hull) -> Any:
    """The triangles of Qhull, without merged facets."""
    qhull = ConvexHull(hull.vertices)
    x = hull.vertices[qhull.simplices]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    outward = np.einsum("ni,ni->n", normal, qhull.equations[:, :3]) > 0
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(hull.vertices))
    corners = np.where(outward[:, None], qhull.simplices, qhull.simplices[:, ::-1])
    triangles.extend([coal.Triangle(*t) for t in corners.tolist()])
    return coal.Convex(points, triangles)


def polytope(points: ArrayLike, at: ArrayLike = (0, 0, 0), turn: Rotation | None = None) -> Placed:
    """The convex hull of points, turned about the origin and shifted."""
    mesh = hull_of(np.asarray(points, float))
    R = np.eye(3) if turn is None else turn.as_matrix()
    centre = R @ mesh.centroid + np.asarray(at)
    return replace(placed_solid(HULL, centre, centre, R=R), mesh=mesh)


def random_turn(rng: np.random.Generator, size: float = np.pi) -> Rotation:
    """Rotation by up to `size` [rad] about a random axis."""
    axis = rng.normal(size=3)
    return Rotation.from_rotvec(rng.uniform(0, size) * axis / np.linalg.norm(axis))


def random_solid(rng: np.random.Generator, kind: str, at: ArrayLike = (0, 0, 0)) -> Placed:
    """A solid of random size and orientation at a place."""
    turn, sizes = Rotation.random(random_state=rng), rng.uniform(0.05, 0.2, 3)
    match kind:
        case "sphere":
            return sphere(at, sizes[0])
        case "capsule":
            along = sizes[1] * turn.as_matrix()[:, 0]
            return capsule(np.asarray(at) - along, np.asarray(at) + along, 0.5 * sizes[0])
        case "box":
            return box(at, sizes, turn)
        case "ellipsoid":
            return ellipsoid(at, sizes, turn)
        case "hull":
            points = rng.normal(size=(rng.integers(4, 30), 3))
            points /= np.linalg.norm(points, axis=1)[:, None]
            return polytope((points - points.mean(axis=0)) * sizes, at, turn)
    return half_space(at, turn.as_matrix()[:, 0])


def random_pair(
    rng: np.random.Generator, first: str, second: str, low: float, high: float
) -> tuple[Placed, Placed]:
    """Two separate solids brought together along the line of their nearest points, to a distance
    in [low, high]; below 0 approximately.
    """
    x, y = random_solid(rng, first), random_solid(rng, second)
    away = y.b if second == "half-space" else rng.normal(size=3)
    x = x.moved(away / np.linalg.norm(away) * 1.5)
    distance, normal = coal_distance(x, y)
    return x.moved((rng.uniform(low, high) - distance) * normal), y
