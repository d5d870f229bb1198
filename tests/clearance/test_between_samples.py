"""Least distances along motions, compared with dense sampling, also between samples."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.dynamics.clearance import Clearance, Path

pytestmark = pytest.mark.medium

CHAIN = """
puppet: chain
bodies:
- name: swing
  joint: {type: free}
  shapes: [{type: box, size: [0.1, 0.05, 0.3], mass: 1}]
- name: upper
  parent: swing
  joint: {name: shoulder, type: revolute, axis: [0, 1, 0], at: [0, 0, -0.15]}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.3], radius: 0.01, mass: 0.1}]
- name: lower
  parent: upper
  joint: {name: elbow, type: ball, at: [0, 0, -0.3]}
  shapes: [{type: ellipsoid, radii: [0.02, 0.03, 0.1], at: [0, 0, -0.1], mass: 0.1}]
- name: tip
  parent: lower
  joint: {name: slide, type: prismatic, axis: [0, 0, 1], at: [0, 0, -0.2]}
  shapes: [{type: sphere, radius: 0.01, mass: 0.1}]
strings:
- name: s
  length: driven
  path: [{body: tip}, {body: upper, at: [0.05, 0, 0]}, {driven: [x, y, z], at: [0, 0, 2]}]
pose: {s.length: 2.2}
"""


@cache
def chain() -> fan.Marionette:
    return fan.loads(CHAIN)


def wild(rng: np.random.Generator, n: int, slack: float) -> Path:
    """n samples 0.1 s apart, with turns up to one radian and moves of 0.3 m between them."""
    chained = chain()
    x = chained.state({"s.length": 2.2})
    q_D, q_K = [x.q_D], [x.q_K]
    for _ in range(n - 1):
        q_D.append(chained.integrate(q_D[-1], rng.uniform(-0.5, 0.5, len(x.v_D))))
        q_K.append(q_K[-1] + rng.uniform(-0.2, 0.2, len(x.q_K)))
    q_D, q_K = np.array(q_D), np.array(q_K)
    (points,) = chained.string_points(q_D, q_K).values()
    spans = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    q_K[:, list(chained.coordinates.q_K).index("s.length")] = spans * (1.0 + slack)
    rates = tuple(
        rng.uniform(-size, size, (n, width))
        for size, width in ((3, len(x.v_D)), (30, len(x.v_D)), (0, len(x.v_K)), (0, len(x.v_K)))
    )
    return Path(chained, 0.1 * np.arange(n), q_D, q_K, rates)


def between(path: Path, per_piece: int) -> tuple[np.ndarray, np.ndarray]:
    """q_D and q_K at several places of every piece."""
    pieces = np.repeat(np.arange(len(path) - 1), per_piece)
    s = np.tile(np.linspace(0.0, 0.1, per_piece), len(path) - 1)
    return path.at(pieces, s)


def beads(rng: np.random.Generator, n: int) -> list[dict]:
    return [
        {"name": f"b{k}", "type": "sphere", "radius": 0.002, "at": at.tolist()}
        for k, at in enumerate(rng.normal(0, 0.6, (n, 3)))
    ]


@pytest.mark.parametrize("slack", [0.0, 0.02, 0.3])
def test_no_configuration_between_samples_is_nearer_than_the_least_distance(slack):
    rng = np.random.default_rng(5)
    for seed in range(3):
        path = wild(np.random.default_rng(seed), 4, slack)
        clear = Clearance(chain(), beads(rng, 5), self_collision=True, strings=True)
        for own in (clear, *clear.parts().values()):
            distance = own.least(path).distance
            dense = float(np.min(own.at(*between(path, 1001))))
            if dense < 0.0:
                assert distance < 0.0
            else:
                assert distance <= 1.02 * dense + 1e-6
                assert distance >= 0.98 * dense - 1e-6


def test_moves_about_a_configuration_bound_every_distance():
    rng = np.random.default_rng(6)
    path = wild(rng, 30, 0.1)
    clear = Clearance(chain(), beads(rng, 20), self_collision=True)
    pieces = np.arange(len(path) - 1)
    for part in clear.parts().values():
        for share in (1.0, 0.1, 0.01):
            start, end = np.zeros(len(pieces)), np.full(len(pieces), 0.1 * share)
            moves = path.move_bounds(pieces, start, end)
            _, lower = part.bounded(*path.at(pieces, start), moves)
            for s in np.linspace(0.0, 0.1 * share, 21):
                distance = part.at(*path.at(pieces, np.full(len(pieces), s)))
                assert np.all(distance >= lower - 1e-9)
