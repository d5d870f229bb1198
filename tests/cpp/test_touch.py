"""The narrow phase, compared with coal and closed forms; contact points are persistent."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpp.placed import (
    HALF_SPACE,
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

pytestmark = pytest.mark.slow

KINDS = ("sphere", "capsule", "box", "ellipsoid", "hull", "half-space")
PAIRS = [p for p in itertools.combinations_with_replacement(KINDS, 2) if p[0] != "half-space"]
MARGIN = 0.05
ACROSS = Rotation.from_euler("y", 90, degrees=True)

# Two solids lying on one another, and the number of contact points.
LYING: dict[str, tuple[Placed, Placed, int]] = {
    "box on plane": (box([0.3, 0, 0.0499], [0.2, 0.1, 0.05]), half_space([0, 0, 0], [0, 0, 1]), 4),
    "plate on plane": (
        box([0.3, 0, 0], [0.2, 0.1, 0], Rotation.from_euler("x", 180, degrees=True)),
        half_space([0, 0, 0], [0, 0, 1]),
        4,
    ),
    "capsule on plane": (
        capsule([0, 0, 0.03], [0.3, 0.1, 0.03], 0.03),
        half_space([0, 0, 0], [0, 0, 1]),
        2,
    ),
    "capsule on capsule": (
        capsule([-0.1, 0, 0.05], [0.3, 0, 0.05], 0.03),
        capsule([0.2, 0, 0], [-0.2, 0, 0], 0.02),
        2,
    ),
    "capsule on box": (
        capsule([-0.1, 0.02, 0.0799], [0.1, 0.02, 0.0799], 0.03),
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        2,
    ),
    "capsule over an edge": (
        capsule([-0.1, 0.02, 0.0801], [0.4, 0.05, 0.0801], 0.03),
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        2,
    ),
    "capsule along an edge": (
        capsule([-0.1, 0.1 + 0.0201, 0.05 + 0.0201], [0.3, 0.1 + 0.0201, 0.05 + 0.0201], 0.03),
        box([0, 0, 0], [0.2, 0.1, 0.05]),
        2,
    ),
    "box on box": (
        box([0.05, 0.02, 0.0999], [0.1, 0.05, 0.05], Rotation.from_euler("z", 0.3)),
        box([0, 0, 0], [0.3, 0.2, 0.05]),
        4,
    ),
    "equal boxes": (box([0, 0, 0.0999], [0.1] * 3), box([0, 0, -0.1], [0.1] * 3), 4),
    "equal boxes, one upside down": (
        box([0, 0, 0.0999], [0.1] * 3, Rotation.from_euler("x", 180, degrees=True)),
        box([0, 0, -0.1], [0.1] * 3),
        4,
    ),
    "equal boxes side by side": (
        box([0.2, 0.03, 0], [0.1] * 3, Rotation.from_euler("x", 90, degrees=True)),
        box([0, 0, 0], [0.1] * 3),
        4,
    ),
    "box on its edge": (
        box([0, 0, 0.1 * 2**0.5], [0.2, 0.1, 0.1], Rotation.from_euler("x", 45, degrees=True)),
        box([0, 0, -0.1], [0.4, 0.4, 0.1]),
        2,
    ),
    "turned boxes": (
        box([0, 0, 0.05], [0.1, 0.1, 0.05], Rotation.from_euler("z", 45, degrees=True)),
        box([0, 0, -0.05], [0.1, 0.1, 0.05]),
        8,
    ),
    "overhanging box": (
        box([0.1, 0.02, 0.0998], [0.1, 0.3, 0.05], Rotation.from_euler("z", 0.2)),
        box([0, 0, 0], [0.15, 0.2, 0.05]),
        4,
    ),
    "ellipsoid on box": (
        ellipsoid([0.05, 0.02, 0.0999], [0.1, 0.08, 0.05]),
        box([0, 0, 0], [0.3, 0.2, 0.05]),
        1,
    ),
    "ellipsoid on plane": (
        ellipsoid([0.05, 0.02, 0.0499], [0.1, 0.08, 0.05]),
        half_space([0, 0, 0], [0, 0, 1]),
        1,
    ),
}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_program("touch.cpp", tmp_path_factory.mktemp("touch"), "-O1", *SANITIZE)


def pairs_of(
    kinds: tuple[str, str], n: int, low: float, high: float
) -> list[tuple[Placed, Placed]]:
    rng = np.random.default_rng(len("".join(kinds)))
    return [random_pair(rng, *kinds, low, high) for _ in range(n)]


def check_same(pair: Pair, other: Pair, tolerance: float, *, turned: bool = False) -> None:
    """The same points, in any order, with reversed normals if `turned`."""
    assert len(pair.touches) == len(other.touches)
    for t in pair.touches:
        near = min(other.touches, key=lambda o: float(np.linalg.norm(o.point - t.point)))
        side = -1 if turned else 1
        assert np.allclose(near.point, t.point, rtol=0, atol=tolerance)
        assert np.allclose(near.normal, side * t.normal, rtol=0, atol=100 * tolerance)
        assert near.gap == pytest.approx(t.gap, abs=tolerance)


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
@pytest.mark.parametrize("high", [1e-4, 0.04])
def test_the_least_gap_of_solids_apart_is_their_distance(
    program: Path, kinds: tuple[str, str], high: float
) -> None:
    pairs = pairs_of(kinds, 200, 0.01 * high, high)
    gap_errors, normal_errors = [], []
    for (x, y), pair in zip(pairs, touches(program, pairs, MARGIN), strict=True):
        distance, normal = coal_distance(x, y)
        touch = min(pair.touches, key=lambda t: t.gap)
        gap_errors.append(abs(touch.gap - distance))
        normal_errors.append(np.linalg.norm(touch.normal - normal))
    # The points of nearly flat cores are not the nearest points.
    assert np.max(gap_errors) < 2e-5
    assert np.quantile(gap_errors, 0.98) < 1e-8
    assert np.max(normal_errors) < 0.02
    assert np.quantile(normal_errors, 0.98) < 1e-3


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_the_least_gap_of_overlapping_solids_is_the_depth(
    program: Path, kinds: tuple[str, str]
) -> None:
    pairs = pairs_of(kinds, 200, -0.004, -1e-5)
    compared = 0
    for (x, y), pair in zip(pairs, touches(program, pairs, MARGIN), strict=True):
        distance, _ = coal_distance(x, y)
        if not -0.01 < distance < 0:
            continue  # coal did not find the depth
        compared += 1
        # A face is preferred to an edge with nearly its depth.
        assert distance * 1.06 - 3e-5 <= pair.gap <= distance + 2e-5
    assert compared > 150


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_the_gap_is_certain(program: Path, kinds: tuple[str, str]) -> None:
    """Planes across the normal separate the solids by at least the gap, and points of both
    surfaces are apart by no more.
    """
    pairs = pairs_of(kinds, 300, -0.002, 0.04)
    surface_errors, support_errors = [], []
    for (x, y), pair in zip(pairs, touches(program, pairs, MARGIN), strict=True):
        t = min(pair.touches, key=lambda t: t.gap)
        assert np.linalg.norm(t.normal) == pytest.approx(1, abs=1e-12)
        # Half way between the surfaces, but on that of a half-space.
        part = 1.0 if kinds[1] == "half-space" else 0.5
        on_x, on_y = t.point + t.normal * t.gap * part, t.point - t.normal * t.gap * (1 - part)
        support_gap = -x.reach(-t.normal) - y.reach(t.normal)
        surface_errors.append(max(abs(x.off_surface(on_x)), abs(y.off_surface(on_y))))
        support_errors.append(abs(support_gap - t.gap))
    # For nearly flat cores, the points are not the nearest points, and the normals turn.
    assert np.quantile(surface_errors, 0.97) < 1e-9
    assert np.max(surface_errors) < 1e-4
    assert np.quantile(support_errors, 0.97) < 1e-9
    assert np.max(support_errors) < 2e-3


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_the_gap_of_slender_ellipsoids_is_certain(program: Path, kind: str) -> None:
    """Separate, touching and overlapping, with axes of 1 to 100."""
    rng = np.random.default_rng(5)
    pairs = []
    for share in rng.choice([1.2, 1.0, 0.9, 0.5], 300):
        radii, n = 10 ** rng.uniform(-2, 0, 3), rng.normal(size=3)
        x = ellipsoid([0, 0, 0], radii, random_turn(rng))
        y, n = random_solid(rng, kind), n / np.linalg.norm(n)
        pairs.append((x.moved(share * n * (x.reach(-n) + y.reach(n))), y))
    for (x, y), pair in zip(pairs, touches(program, pairs, 10.0), strict=True):
        (t,) = pair.touches
        assert -x.reach(-t.normal) - y.reach(t.normal) == pytest.approx(t.gap, abs=1e-12)
        assert x.off_surface(t.point + t.normal * t.gap / 2) == pytest.approx(0, abs=1e-12)
        if kind == "hull" and t.gap < -0.01:
            continue  # facets replace edges that run through the ellipsoid
        assert y.off_surface(t.point - t.normal * t.gap / 2) == pytest.approx(0, abs=1e-12)


def test_closed_forms(program: Path) -> None:
    plane = half_space([0, 0, 1], [0, 0, 1])
    # The ellipsoid's lowest point, below its middle and to its side.
    tilted, sine, cosine = Rotation.from_euler("y", 0.4), np.sin(0.4), np.cos(0.4)
    low = np.hypot(0.3 * sine, 0.1 * cosine)
    beside = (0.3**2 - 0.1**2) * sine * cosine / low
    cases = [
        (sphere([1, 2, 1.2], 0.19), plane, [1, 2, 1], [0, 0, 1], 0.01),
        (sphere([1, 0, 0], 0.5), sphere([0, 0, 0], 0.6), [0.55, 0, 0], [1, 0, 0], -0.1),
        (sphere([0.1, 0, 0.3], 0.1), box([0, 0, 0], [0.2] * 3), [0.1, 0, 0.2], [0, 0, 1], 0),
        (sphere([0.19, 0, 0], 0.1), box([0, 0, 0], [0.2] * 3), [0.145, 0, 0], [1, 0, 0], -0.11),
        (
            capsule([-1, 0, 0.3], [1, 0, 0.3], 0.1),
            capsule([0.2, -1, 0], [0.2, 1, 0], 0.16),
            [0.2, 0, 0.18],
            [0, 0, 1],
            0.04,
        ),
        (
            ellipsoid([0, 0, 1.3], [0.3, 0.1, 0.1], tilted),
            plane,
            [beside, 0, 1],
            [0, 0, 1],
            0.3 - low,
        ),
        (
            ellipsoid([0, 0, 0.25], [0.3, 0.2, 0.1]),
            sphere([0, 0, 0], 0.12),
            [0, 0, 0.135],
            [0, 0, 1],
            0.03,
        ),
    ]
    pairs = touches(program, [(x, y) for x, y, *_ in cases], 0.2)
    for pair, (_, _, point, normal, gap) in zip(pairs, cases, strict=True):
        (t,) = pair.touches
        assert np.allclose(t.point, point, rtol=0, atol=1e-12)
        assert np.allclose(t.normal, normal, rtol=0, atol=1e-12)
        assert t.gap == pytest.approx(gap, abs=1e-12)


@pytest.mark.parametrize("name", LYING)
def test_points_of_lying_solids_stay(program: Path, name: str) -> None:
    x, y, n = LYING[name]
    rng, small = np.random.default_rng(1), 1e-6
    moved = [
        x.turned(random_turn(rng, small)).moved(small * rng.uniform(-1, 1, 3)) for _ in range(300)
    ]
    start, *later = touches(program, [(x, y)] + [(m, y) for m in moved], 1e-3)
    assert len(start.touches) == n
    for pair in later:
        assert pair.features == start.features
        assert np.max(np.linalg.norm(pair.points - start.points, axis=1)) < 10 * small
        for before, after in zip(start.touches, pair.touches, strict=True):
            assert np.linalg.norm(after.normal - before.normal) < 1e-4
            assert abs(after.gap - before.gap) < 5 * small


def test_points_of_boxes_side_by_side_lie_on_both(program: Path) -> None:
    """Their bottoms are level up to rounding, so that edges of both lie along one another.

    Their intersection is then arbitrary.
    """
    post = box([0.3, 0.05, 0.3], [0.05, 0.05, 0.3])
    beside = box([0.1515, -0.09975, 0.05], [0.1, 0.15, 0.05], Rotation.from_euler("z", 0.0209))
    rng = np.random.default_rng(5)
    moved = [
        beside.turned(random_turn(rng, small)).moved([0, 0, small * rng.uniform(-0.1, 0.1)])
        for small in 10.0 ** rng.uniform(-13, -6, 300)
    ]
    for pair in touches(program, [(x, post) for x in moved], 0.01):
        assert pair.touches
        for t in pair.touches:
            assert t.gap > 0.0
            assert max(post.off_surface(t.point), beside.off_surface(t.point)) < 0.01


@pytest.mark.parametrize("name", ["box on plane", "plate on plane", "capsule on plane"])
def test_solids_lie_on_their_lowest_points(program: Path, name: str) -> None:
    x, y, _ = LYING[name]
    (pair,) = touches(program, [(x, y)], 1.0)
    for t in pair.touches:
        assert t.gap == pytest.approx(-x.reach(-y.b), abs=1e-12)


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
@pytest.mark.parametrize("low", [-0.1, -0.002])
def test_swapped_solids_have_the_same_points(
    program: Path, kinds: tuple[str, str], low: float
) -> None:
    pairs = pairs_of(kinds, 200, low, 0.01)
    swapped = [(y, x) for x, y in pairs]
    for pair, other in zip(
        touches(program, pairs, MARGIN), touches(program, swapped, MARGIN), strict=True
    ):
        check_same(pair, other, 1e-7, turned=True)
        if kinds != ("capsule", "capsule"):
            assert pair.features == other.features


@pytest.mark.parametrize("name", LYING)
def test_swapped_lying_solids_have_the_same_points(program: Path, name: str) -> None:
    x, y, _ = LYING[name]
    pair, other = touches(program, [(x, y), (y, x)])
    check_same(pair, other, 1e-12, turned=True)


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_a_motion_of_both_moves_the_points(program: Path, kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(2)
    pairs = pairs_of(kinds, 200, -0.003, 0.01)
    motions = [(rng.normal(size=3), random_turn(rng)) for _ in pairs]
    moved = [(x.moved(*m), y.moved(*m)) for (x, y), m in zip(pairs, motions, strict=True)]
    before, after = touches(program, pairs, MARGIN), touches(program, moved, MARGIN)
    for pair, other, (by, turn) in zip(before, after, motions, strict=True):
        assert pair.features == other.features
        for t, u in zip(pair.touches, other.touches, strict=True):
            assert np.allclose(turn.apply(t.point) + by, u.point, rtol=0, atol=1e-7)
            assert np.allclose(turn.apply(t.normal), u.normal, rtol=0, atol=1e-6)
            assert u.gap == pytest.approx(t.gap, abs=1e-9)


def sweeps() -> dict[str, list[tuple[Placed, Placed]]]:
    """Motions from lying flat to crossing, in small steps."""
    log = capsule([-0.2, 0, 0], [0.2, 0, 0], 0.02)
    rod, block = (
        capsule([-0.15, 0, 0.051], [0.25, 0, 0.051], 0.03),
        box([0, 0, 0], [0.2, 0.1, 0.05]),
    )
    angles = np.linspace(0, 0.1, 801)
    return {
        "yaw on a capsule": [(rod.turned(Rotation.from_euler("z", a)), log) for a in angles],
        "pitch on a capsule": [
            (rod.turned(Rotation.from_euler("y", a)).moved([0, 0, 0.15 * a]), log) for a in angles
        ],
        "end to end": [(rod.moved([s, 0, 0]), log) for s in np.linspace(0.3, 0.4, 801)],
        "over a box's edge": [
            (rod.turned(Rotation.from_euler("y", a)).moved([0.1, 0.03, 0.035 + 0.1 * a]), block)
            for a in angles
        ],
        "off a box's edge": [
            (rod.moved([0.1, s, 0.03]), block) for s in np.linspace(0.08, 0.12, 801)
        ],
    }


def test_points_slide_from_lying_to_crossing(program: Path) -> None:
    """Points neither jump, nor appear and vanish where solids are apart."""
    for name, pairs in sweeps().items():
        moving = touches(program, pairs, 0.2)
        assert {len(pair.touches) for pair in moving} <= {1, 2}, name
        for before, after in itertools.pairwise(moving):
            longer, shorter = before.points, after.points
            if len(longer) < len(shorter):
                longer, shorter = shorter, longer
            for k, point in enumerate(longer):
                assert np.linalg.norm(point - shorter[min(k, len(shorter) - 1)]) < 6e-3, name


def degenerate() -> list[Placed]:
    """Solids without extent in some direction, about the origin."""
    turn = Rotation.from_euler("xyz", [0.3, 0.5, 0.7])
    return [
        sphere([0, 0, 0], 0),
        sphere([0, 0, 0], 0.1),
        capsule([-0.1, 0, 0], [0.1, 0, 0], 0.1),
        capsule([-0.1, 0, 0], [0.1, 0, 0], 0),
        capsule([0, 0, 0], [1e-13, 0, 0], 0.1),
        capsule([0, 0, 0], [1e-9, 0, 0], 0.1),
        box([0, 0, 0], [0.1, 0.1, 0.1]),
        box([0, 0, 0], [0.1, 0.1, 0.1], turn),
        box([0, 0, 0], [0.1, 0.1, 0]),
        box([0, 0, 0], [0.1, 0, 0]),
        box([0, 0, 0], [0, 0, 0]),
        ellipsoid([0, 0, 0], [0.1, 0.2, 0.3], turn),
        ellipsoid([0, 0, 0], [0.1, 0.1, 0.1]),
        ellipsoid([0, 0, 0], [0.1, 1e-9, 0.1]),
        ellipsoid([0, 0, 0], [1e-6, 10, 1e-6]),
        polytope(0.1 * np.eye(4, 3), [-0.025] * 3),
        polytope([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (0, 1e-6)]),
        half_space([0, 0, 0], [0, 0, 1]),
    ]


def check_finite(pairs: Sequence[Pair]) -> None:
    """`touches` has asserted that all numbers are finite."""
    for pair in pairs:
        for t in pair.touches:
            assert np.linalg.norm(t.normal) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("by", [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0, 0, 0.2], [1e-14, 0, 0]])
def test_degenerate_solids_have_finite_points(program: Path, by: list[float]) -> None:
    pairs = [(x.moved(by), y) for x in degenerate() for y in degenerate()]
    results = touches(program, pairs, MARGIN)
    check_finite(results)
    if not np.any(by):
        for (x, y), pair in zip(pairs, results, strict=True):
            both_planes = x.kind == y.kind == HALF_SPACE
            assert bool(pair.touches) != both_planes, (x, y)


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_deep_solids_have_points(program: Path, kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(3)
    pairs = [
        (random_solid(rng, kinds[0], 0.1 * rng.normal(size=3)), random_solid(rng, kinds[1]))
        for _ in range(300)
    ]
    results = touches(program, pairs, MARGIN)
    check_finite(results)
    for (x, y), pair in zip(pairs, results, strict=True):
        if coal_distance(x, y)[0] < MARGIN - 1e-3:
            assert pair.touches


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_solids_certainly_apart_do_not_touch(program: Path, kinds: tuple[str, str]) -> None:
    pairs = pairs_of(kinds, 200, 0, 2 * MARGIN)
    distant = [(x.moved(2 * y.b if y.kind == HALF_SPACE else [2, 0, 0]), y) for x, y in pairs]
    for pair in touches(program, pairs, MARGIN):
        assert not (pair.apart and pair.touches)
    assert all(pair.apart for pair in touches(program, distant, MARGIN))


def test_the_bounding_sphere_contains_the_solid(program: Path) -> None:
    rng = np.random.default_rng(4)
    solids = [random_solid(rng, kind) for kind in KINDS[:-1] for _ in range(20)]
    solids += [replace(s, radius=0.1) for s in solids if s.kind == 1]
    for solid, pair in zip(solids, touches(program, [(s, s) for s in solids]), strict=True):
        directions = rng.normal(size=(200, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        reach = max(solid.reach(n) - n @ solid.centre for n in directions)
        assert reach <= pair.radius <= 2 * reach


def test_round_boxes_are_inflated(program: Path) -> None:
    """Boxes with a radius, as in the planner."""
    block = box([0, 0, 0], [0.1, 0.1, 0.1])
    other = box([0, 0, 0.25], [0.05, 0.05, 0.05])
    plane = half_space([0, 0, -0.2], [0, 0, 1])
    rounded = replace(block, radius=0.04)
    for y, gap in ((other, 0.06), (plane, 0.06), (sphere([0, 0, 0.25], 0.05), 0.06)):
        for x, z in ((rounded, y), (y, rounded)):
            (pair,) = touches(program, [(x, z)], 0.1)
            assert pair.gap == pytest.approx(gap, abs=1e-12)
            assert np.allclose(pair.points[:, 2], 0.17 if y is not plane else -0.2, atol=1e-12)
    (pair,) = touches(program, [(rounded, ellipsoid([0, 0, 0.25], [0.1, 0.2, 0.05]))], 0.1)
    assert pair.gap == pytest.approx(0.06, abs=1e-12)
