"""Hulls of meshes in the narrow phase: their shape, and points as persistent as those of boxes.

`test_touch.py` compares random hulls with coal, as it does all other solids.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cpp.placed import (
    BOX,
    MAX_TOUCHES,
    Pair,
    Placed,
    box,
    capsule,
    coal_distance,
    ellipsoid,
    half_space,
    polytope,
    random_pair,
    random_solid,
    random_turn,
    sphere,
    touches,
)
from cpp.toolchain import SANITIZE, compile_program
from fantoccini.kernel.contract import HULL_VERTICES
from fantoccini.kernel.runtime.hulls import Hull, hull_of

pytestmark = pytest.mark.slow

PLANE = half_space([0, 0, 0], [0, 0, 1])
SIDES = np.array(list(itertools.product([-1, 1], repeat=3)), float)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_program("touch.cpp", tmp_path_factory.mktemp("hull"), "-O1", *SANITIZE)


def as_hull(x: Placed) -> Placed:
    """A box as a hull."""
    if x.kind != BOX:
        return x
    return polytope(SIDES * x.half, x.a, Rotation.from_matrix(x.R))


def prism(n: int, radius: float = 0.1, height: float = 0.1) -> np.ndarray:
    """(2 n, 3) corners of an upright prism about the origin."""
    angles = 2 * np.pi * np.arange(n) / n
    ring = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([np.column_stack([ring, np.full(n, z)]) for z in (-height / 2, height / 2)])


def cut(n: int) -> np.ndarray:
    """(n, 3) random points of a sphere."""
    points = np.random.default_rng(n).normal(size=(n, 3))
    return np.asarray(0.1 * points / np.linalg.norm(points, axis=1)[:, None])


SHAPES: dict[str, np.ndarray] = {
    "box": 0.1 * SIDES,
    "tetrahedron": 0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "wedge": 0.1 * np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0], [0, 0, 1], [0, 1, 1]]),
    "prism of 40": prism(40),
    "icosphere": 0.1 * np.array(trimesh.creation.icosphere(subdivisions=1).vertices),
    "100 points": cut(100),
    "subdivided box": 0.1 * np.array(trimesh.creation.box().subdivide().subdivide().vertices),
    "subdivided box of seven digits": np.array(
        Rotation.from_rotvec([0.3, 0.5, 0.7])
        .apply(trimesh.creation.box().subdivide().subdivide().vertices)
        .astype(np.float32),
        float,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_hull_is_a_closed_surface_around_its_points(name: str) -> None:
    points, hull = SHAPES[name], hull_of(SHAPES[name])
    normals, heights = hull.planes[:, :3], hull.planes[:, 3]
    size = np.max(np.ptp(points, axis=0))
    assert len(hull.vertices) + len(hull.planes) - len(hull.edges) == 2
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, rtol=0, atol=1e-12)
    # All points are inside, up to the tolerance of flatness.
    assert np.max((points - hull.centroid) @ normals.T - heights) < 3e-6 * size
    # A facet's corners lie in its plane and are anticlockwise; its sides are the edges.
    for f, corners in enumerate(facets(hull)):
        x, n = hull.vertices[corners], normals[f]
        assert np.max(np.abs(x @ n - heights[f])) < 3e-6 * size
        turns = np.cross(np.roll(x, -1, 0) - x, np.roll(x, -2, 0) - np.roll(x, -1, 0)) @ n
        assert np.min(turns) > 0
        sides = hull.sides[hull.begins[f] : hull.begins[f + 1]]
        for a, b, e in zip(corners, np.roll(corners, -1), sides, strict=True):
            from_, to, left, right = hull.edges[e]
            assert (from_, to, left) == (a, b, f) or (from_, to, right) == (b, a, f)
            assert np.all(n @ (hull.vertices[from_] - hull.vertices[to]) < 3e-6 * size)
    for i in range(len(hull.vertices)):
        around = hull.around[hull.around_begins[i] : hull.around_begins[i + 1]]
        assert sorted(around) == [f for f, c in enumerate(facets(hull)) if i in c]


def facets(hull: Hull) -> list[list[int]]:
    return [hull.corners[a:b].tolist() for a, b in itertools.pairwise(hull.begins)]


def test_facets_in_one_plane_are_one() -> None:
    for name in ("box", "subdivided box", "subdivided box of seven digits"):
        hull = hull_of(SHAPES[name])
        assert (len(hull.vertices), len(hull.planes), len(hull.edges)) == (8, 6, 12)
    hull = hull_of(SHAPES["prism of 40"])
    assert sorted(len(f) for f in facets(hull)) == [4] * 40 + [40, 40]


def test_the_centroid_is_the_centre_of_mass() -> None:
    for points in SHAPES.values():
        mesh = trimesh.convex.convex_hull(points)
        assert np.allclose(hull_of(points).centroid, mesh.center_mass, rtol=0, atol=1e-7)


@pytest.mark.parametrize("other", ["sphere", "capsule", "box", "hull"])
def test_separated_hulls_have_the_distance_of_coal(program: Path, other: str) -> None:
    """They agree to rounding, with coal's normal, except for the few nearly flat ones."""
    rng = np.random.default_rng(7)
    pairs = [random_pair(rng, "hull", other, 1e-5, 0.04) for _ in range(300)]
    exact = 0
    for (x, y), pair in zip(pairs, touches(program, pairs), strict=True):
        distance, normal = coal_distance(x, y)
        assert pair.gap == pytest.approx(distance, abs=2e-5)
        if len(pair.touches) > 1:
            continue  # they lie nearly flat
        exact += 1
        tolerance = 1e-9 if other != "box" else 1e-8  # coal's tolerance for boxes
        assert pair.gap == pytest.approx(distance, abs=tolerance)
        if other != "box":
            assert np.allclose(pair.touches[0].normal, normal, rtol=0, atol=1e-9)
    assert exact > 280


LYING: dict[str, tuple[Placed, Placed]] = {
    "on a plane": (box([0.3, 0, 0.0499], [0.2, 0.1, 0.05]), PLANE),
    "on another": (
        box([0.05, 0.02, 0.0999], [0.1, 0.05, 0.05], Rotation.from_euler("z", 0.3)),
        box([0, 0, 0], [0.3, 0.2, 0.05]),
    ),
    "on its equal": (box([0, 0, 0.0999], [0.1] * 3), box([0, 0, -0.1], [0.1] * 3)),
    "on its edge": (
        box([0, 0, 0.1 * 2**0.5], [0.2, 0.1, 0.1], Rotation.from_euler("x", 45, degrees=True)),
        box([0, 0, -0.1], [0.4, 0.4, 0.1]),
    ),
    "on its corner": (
        box(
            [0, 0, 0.1 * 3**0.5 - 1e-4],
            [0.1] * 3,
            Rotation.align_vectors([[0, 0, 1]], [[1, 1, 1]])[0],
        ),
        box([0, 0, -0.1], [0.4, 0.4, 0.1]),
    ),
    "across an edge": (
        box([0.25, 0, 0.2399], [0.2, 0.1, 0.1], Rotation.from_euler("xz", [45, 0], degrees=True)),
        box([0, 0, 0], [0.3, 0.3, 0.1]),
    ),
    "overhanging": (
        box([0.1, 0.02, 0.0998], [0.1, 0.3, 0.05], Rotation.from_euler("z", 0.2)),
        box([0, 0, 0], [0.15, 0.2, 0.05]),
    ),
    "turned": (
        box([0, 0, 0.05], [0.1, 0.1, 0.05], Rotation.from_euler("z", 45, degrees=True)),
        box([0, 0, -0.05], [0.1, 0.1, 0.05]),
    ),
    "under a capsule": (
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        capsule([-0.1, 0.02, 0.0799], [0.1, 0.02, 0.0799], 0.03),
    ),
    "under a capsule over the edge": (
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        capsule([-0.1, 0.02, 0.0801], [0.4, 0.05, 0.0801], 0.03),
    ),
    "along a capsule": (
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        capsule([-0.1, 0.1201, 0.0701], [0.3, 0.1201, 0.0701], 0.03),
    ),
    "in a capsule": (
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        capsule([-0.1, 0.02, 0.045], [0.1, 0.02, 0.045], 0.03),
    ),
    "in a sphere": (box([0, 0, 0], [0.2, 0.1, 0.05]), sphere([0.05, 0.02, 0.04], 0.03)),
    "under an ellipsoid": (
        box([0, 0, 0], [0.3, 0.2, 0.05]),
        ellipsoid([0.05, 0.02, 0.0999], [0.1, 0.08, 0.05]),
    ),
}


@pytest.mark.parametrize("name", LYING)
@pytest.mark.parametrize("both", [False, True])
def test_a_box_as_a_hull_has_the_points_of_the_box(program: Path, name: str, both: bool) -> None:
    x, y = LYING[name]
    expected, pair = touches(program, [(x, y), (as_hull(x), as_hull(y) if both else y)], 1e-3)
    assert len(pair.touches) == len(expected.touches) > 0
    for t in expected.touches:
        near = min(pair.touches, key=lambda o: float(np.linalg.norm(o.point - t.point)))
        assert np.allclose(near.point, t.point, rtol=0, atol=1e-9)
        assert np.allclose(near.normal, t.normal, rtol=0, atol=1e-9)
        assert near.gap == pytest.approx(t.gap, abs=1e-9)


RESTING: dict[str, tuple[Placed, Placed]] = {
    "tetrahedron": (polytope(SHAPES["tetrahedron"], [0, 0, -1e-5]), PLANE),
    "prism on a plane": (polytope(prism(40), [0, 0, 0.05]), PLANE),
    "prism on a prism": (
        polytope(prism(40), [0.03, 0.01, 0.05]),
        polytope(prism(30), [0, 0, -0.05]),
    ),
    "prism on a box": (polytope(prism(40), [0.03, 0, 0.05]), box([0, 0, -0.1], [0.1] * 3)),
    "lying prism": (
        polytope(
            prism(8),
            [0, 0, 0.1 * np.cos(np.pi / 8)],
            Rotation.from_euler("zy", [np.pi / 8, np.pi / 2]),
        ),
        PLANE,
    ),
    "wedges": (
        polytope(SHAPES["wedge"], [0, 0, 0.1], Rotation.from_euler("z", 0.2)),
        polytope(SHAPES["wedge"], [0.02, 0.01, 0.1], Rotation.from_euler("x", np.pi)),
    ),
    **{f"box {name}": (as_hull(x), y) for name, (x, y) in LYING.items() if name != "on its corner"},
}


@pytest.mark.parametrize("name", RESTING)
def test_points_of_resting_hulls_stay(program: Path, name: str) -> None:
    x, y = RESTING[name]
    rng, small = np.random.default_rng(1), 1e-6
    moved = [
        x.turned(random_turn(rng, small)).moved(small * rng.uniform(-1, 1, 3)) for _ in range(300)
    ]
    start, *later = touches(program, [(x, y)] + [(m, y) for m in moved], 1e-3)
    assert start.touches
    for pair in later:
        assert pair.features == start.features
        assert np.max(np.linalg.norm(pair.points - start.points, axis=1)) < 20 * small
        for before, after in zip(start.touches, pair.touches, strict=True):
            assert np.linalg.norm(after.normal - before.normal) < 1e-4
            assert abs(after.gap - before.gap) < 5 * small


def test_many_corners_are_held_by_eight_points(program: Path) -> None:
    """The points span nearly the whole facet, and the lowest corner is one of them."""
    corners = prism(40)
    for tilt in (0.0, 0.003, 0.1):
        x = polytope(corners).moved([0, 0, 0.05], Rotation.from_rotvec([tilt, 0.4 * tilt, 0]))
        (pair,) = touches(program, [(x, PLANE)], 0.05)
        assert len(pair.touches) <= MAX_TOUCHES
        assert pair.gap == pytest.approx(-x.reach(-PLANE.b), abs=1e-6 * 0.1)
        if tilt < 0.01:
            assert ConvexHull(pair.points[:, :2]).volume > 0.85 * np.pi * 0.1**2


def test_the_depth_is_the_least_of_all_directions(program: Path) -> None:
    """The facets of the difference of both hulls are the oracle, up to the preference of facets."""
    rng = np.random.default_rng(11)
    pairs = []
    while len(pairs) < 150:
        x, y = random_solid(rng, "hull", rng.uniform(-0.1, 0.1, 3)), random_solid(rng, "hull")
        if _depth(x, y) > 1e-6:
            pairs.append((x, y))
    off = []
    for (x, y), pair in zip(pairs, touches(program, pairs), strict=True):
        depth = _depth(x, y)
        t = min(pair.touches, key=lambda t: t.gap)
        along = x.reach(-t.normal) + y.reach(t.normal)
        assert depth - 1e-12 <= along < 1.06 * depth + 3e-5
        assert -t.gap < along + 1e-12
        if along < depth + 1e-12:  # no facet was preferred to two edges
            off.append(along + t.gap)
    assert len(off) > 50
    assert np.max(np.abs(off)) < 1e-9


def _depth(x: Placed, y: Placed) -> float:
    """Depth of the origin in x - y, 0 outside."""
    difference = (x.corners[:, None] - y.corners[None]).reshape(-1, 3)
    return max(float(-np.max(ConvexHull(difference).equations[:, 3])), 0.0)


@pytest.mark.parametrize("kind", ["sphere", "capsule", "box", "ellipsoid", "hull", "half-space"])
def test_points_do_not_jump_on_the_way_out(program: Path, kind: str) -> None:
    """The gap along a straight path from deep to apart is continuous, and grows at most as fast."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        x, y = random_solid(rng, "hull"), random_solid(rng, kind)
        way = y.b if kind == "half-space" else rng.normal(size=3)
        way = way / np.linalg.norm(way)
        steps = np.linspace(0, 0.5, 501)
        pairs = touches(program, [(x.moved(s * way), y) for s in steps], 1.0)
        gaps = np.array([pair.gap for pair in pairs])
        assert np.all(np.abs(np.diff(gaps)) < 0.06 * np.abs(gaps[1:]) + 2e-3)
        assert gaps[-1] > 0


def test_the_largest_number_of_vertices(program: Path) -> None:
    rng, n = np.random.default_rng(5), int(HULL_VERTICES)
    x, y = polytope(cut(n)), polytope(cut(n - 1))
    assert len(x.mesh.vertices) == n
    place = [random_turn(rng) for _ in range(40)]
    pairs = [(x.moved([0, 0, 0.1975], turn), y) for turn in place] + [
        (x.moved([0.05, 0, 0], turn), y) for turn in place
    ]
    for (a, b), pair in zip(pairs, touches(program, pairs), strict=True):
        distance, _ = coal_distance(a, b)
        if distance > 0:
            assert pair.gap == pytest.approx(distance, abs=1e-9)
        else:
            assert pair.gap < 1e-4


def check_mirrored(pair: Pair, other: Pair) -> None:
    assert pair.features == other.features
    for t, u in zip(pair.touches, other.touches, strict=True):
        assert np.allclose(t.point, u.point, rtol=0, atol=1e-12)
        assert np.allclose(t.normal, -u.normal, rtol=0, atol=1e-12)
        assert t.gap == pytest.approx(u.gap, abs=1e-12)


@pytest.mark.parametrize("name", RESTING)
def test_swapped_hulls_have_the_same_points(program: Path, name: str) -> None:
    x, y = RESTING[name]
    pair, other = touches(program, [(x, y), (y, x)])
    check_mirrored(pair, other)


def test_facets_enclose_the_volume_of_the_mesh() -> None:
    for points in SHAPES.values():
        hull = hull_of(points)
        volume = sum(
            plane[3] * _area(hull.vertices[f]) / 3
            for plane, f in zip(hull.planes, facets(hull), strict=True)
        )
        mesh = trimesh.convex.convex_hull(points)
        assert volume == pytest.approx(mesh.volume, rel=1e-5)


def _area(x: np.ndarray) -> float:
    return float(np.linalg.norm(np.sum(np.cross(x, np.roll(x, -1, axis=0)), axis=0)) / 2)
