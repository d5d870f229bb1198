"""Contact points by their features alone agree with the narrow phase."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from cpp.placed import Placed, coal_distance, random_solid, touches
from cpp.toolchain import SANITIZE, compile_program

pytestmark = pytest.mark.slow

ALONG, BEYOND = 1, -1
"""Regions of points of two edges whose normals are not their product."""

PAIRS = [
    *itertools.combinations_with_replacement(("capsule", "box", "hull"), 2),
    ("sphere", "box"),
    ("sphere", "hull"),
    ("box", "half-space"),
    ("hull", "half-space"),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_program("touch.cpp", tmp_path_factory.mktemp("follow"), "-O1", *SANITIZE)


def brought_near(
    rng: np.random.Generator, first: str, second: str, max_gap: float
) -> tuple[Placed, Placed]:
    """Two solids, moved along a random line until their distance is at most `max_gap`: polytopes
    touch with a vertex and a facet or with two edges.
    """
    x, y = random_solid(rng, first), random_solid(rng, second)
    way = y.b if second == "half-space" else rng.normal(size=3)
    way = way / np.linalg.norm(way)
    low, high = 0.0, 1.5
    if coal_distance(x, y)[0] > 0:
        x = x.moved(y.centre - x.centre)
    for _ in range(60):
        middle = 0.5 * (low + high)
        distance = coal_distance(x.moved(middle * way), y)[0]
        if 0.1 * max_gap < distance < max_gap:
            break
        low, high = (low, middle) if distance > 0 else (middle, high)
    return x.moved(middle * way), y


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_points_are_those_of_their_features_alone(program: Path, first: str, second: str) -> None:
    """The solids are apart by up to 1 um."""
    rng = np.random.default_rng(17)
    pairs = [brought_near(rng, first, second, 1e-6) for _ in range(100)]
    known = 0
    for pair in touches(program, pairs, 1e-5):
        for t in pair.touches:
            if t.alone is None or t.region in (ALONG, BEYOND):
                continue
            known += 1
            assert np.allclose(t.alone[:3], t.normal, rtol=0, atol=1e-8)
            assert t.alone[3] == pytest.approx(t.gap, abs=1e-11)
            assert t.holds
    assert known > 60


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_the_normal_is_the_slope_of_the_gap(program: Path, first: str, second: str) -> None:
    """A small motion of the first solid changes the gap by the normal times the motion."""
    rng, step = np.random.default_rng(18), 1e-7
    compared = 0
    for _ in range(40):
        x, y = brought_near(rng, first, second, 1e-5)
        ways = step * rng.normal(size=(4, 3))
        here, *there = touches(program, [(x, y)] + [(x.moved(way), y) for way in ways], 1e-3)
        for t in here.touches:
            if t.alone is None or t.region in (ALONG, BEYOND):
                continue
            for way, pair in zip(ways, there, strict=True):
                for moved in pair.touches:
                    if (moved.feature, moved.region) != (t.feature, t.region):
                        continue
                    compared += 1
                    assert moved.gap - t.gap == pytest.approx(t.normal @ way, abs=1e-3 * step)
    assert compared > 80
