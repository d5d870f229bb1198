"""A hand reaches its target in the least time within its bounds, and stays."""

from __future__ import annotations

import numpy as np
import pytest

from fantoccini.theatre.perform import reach

pytestmark = pytest.mark.medium

TICK, SPEED, ACCELERATION = 1 / 120, 1.5, 10.0


def travel(x, v, target, ticks, speed=SPEED, acceleration=ACCELERATION):
    """Positions and velocities (ticks + 1, n) of a hand of n axes."""
    x, v, target = (np.array(a, dtype=float) for a in (x, v, target))
    group, bounds = np.zeros(len(x), dtype=int), (np.array([speed]), np.array([acceleration]))
    xs, vs = [x], [v]
    for _ in range(ticks):
        wanted = reach.wanted_velocity(target - x, v, TICK, group, *bounds)
        acc = reach.bounded_acceleration(wanted, v, TICK, group, bounds[1])
        x, v = x + TICK * v + 0.5 * TICK**2 * acc, v + TICK * acc
        xs.append(x)
        vs.append(v)
    return np.array(xs), np.array(vs)


def test_full_speed_is_braked_within_the_distance_of_the_closed_form():
    """Braking from k a T takes k ticks and k^2 a T^2/2 = v^2/(2 a), corner by corner."""
    k = 12
    v = k * ACCELERATION * TICK
    distance = v**2 / (2 * ACCELERATION)
    xs, vs = travel([0.0], [v], [distance], k + 1)
    assert np.allclose(vs[: k + 1, 0], v - ACCELERATION * TICK * np.arange(k + 1), atol=1e-12)
    assert xs[k, 0] == pytest.approx(distance, abs=1e-14)
    assert abs(vs[k, 0]) < 1e-13


@pytest.mark.parametrize("distance", [1e-4, 0.01, 0.1, 0.225, 0.3, 1.0, 10.0])
def test_a_move_takes_the_time_of_bang_bang(distance):
    """The duration from rest to rest is 2 sqrt(d/a), or d/v + v/a if the speed is reached, and
    at most three more ticks, because ticks are whole.
    """
    min_time = (
        2 * np.sqrt(distance / ACCELERATION)
        if distance < SPEED**2 / ACCELERATION
        else distance / SPEED + SPEED / ACCELERATION
    )
    xs, vs = travel([0.0], [0.0], [distance], int(min_time / TICK) + 20)
    arrived = np.flatnonzero(np.abs(xs[:, 0] - distance) + np.abs(vs[:, 0]) < 1e-12)
    assert min_time - 1e-9 <= arrived[0] * TICK <= min_time + 3 * TICK
    assert np.all(np.diff(xs[:, 0]) >= -1e-15 * max(1.0, 4 * distance))
    assert np.max(xs) <= distance * (1 + 1e-14)
    # It stays there.
    assert np.max(np.abs(xs[arrived[0] :] - distance)) < 1e-14 * max(1.0, distance)


def test_a_straight_drag_is_a_straight_move():
    rng = np.random.default_rng(0)
    target = rng.normal(size=3)
    xs, _ = travel(np.zeros(3), np.zeros(3), target, 400)
    along = target / np.linalg.norm(target)
    assert np.max(np.abs(xs - np.outer(xs @ along, along))) < 1e-14
    assert np.max(np.abs(xs[-1] - target)) < 1e-14


def test_bounds_hold_for_all_targets_and_every_target_is_reached():
    rng = np.random.default_rng(1)
    for _ in range(40):
        v = rng.normal(size=2)
        v *= SPEED * rng.random() / np.linalg.norm(v)
        target = rng.normal(size=2) * 10.0 ** rng.uniform(-4, 1)
        xs, vs = travel(np.zeros(2), v, target, 1800)
        assert np.max(np.linalg.norm(vs, axis=1)) <= SPEED * (1 + 1e-12)
        change = np.linalg.norm(np.diff(vs, axis=0), axis=1) / TICK
        assert np.max(change) <= ACCELERATION * (1 + 1e-9)
        assert np.max(np.abs(xs[-1] - target)) < 1e-13


def test_on_a_line_no_target_within_braking_distance_is_passed():
    rng = np.random.default_rng(2)
    for _ in range(100):
        v = SPEED * rng.random()
        k = int(np.ceil(v / (ACCELERATION * TICK)))
        distance = 0.5 * k * (k + 1) * ACCELERATION * TICK**2 + 10.0 ** rng.uniform(-6, 0)
        xs, _ = travel([0.0], [v], [distance], 400)
        assert np.max(xs) <= distance * (1 + 1e-13)
