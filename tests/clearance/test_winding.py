"""Crossings and windings: known cases, and random motions compared with an oracle in fine steps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from clearance.balls import balls, carried, smooth
from fantoccini.dynamics.clearance import StringDistances, StringMotion

pytestmark = pytest.mark.medium


def watched(t, low, high) -> StringMotion:
    """Strings between low and high (T, n, 3)."""
    marionette = balls(np.shape(low)[1])
    q = carried(marionette, np.asarray(low, dtype=float), np.asarray(high, dtype=float))
    return StringDistances(marionette).motion(*q, t)


def test_a_passage_between_two_samples_is_found():
    """Both samples are 10 cm apart: only the motion between them shows the passage."""
    low = [[[0, 0, 0], [0.1, 0.01, 0.1]], [[0, 0, 0], [-0.1, 0.01, 0.1]]]
    high = [[[0, 0.02, 1], [0.1, 0.01, 1.2]], [[0, 0.02, 1], [-0.1, 0.01, 1.2]]]
    motion = watched([3.0, 3.1], low, high)
    (approach,) = motion.nearest(0.09).strings
    assert approach.t == pytest.approx(3.05, abs=1e-4) and approach.distance < 1e-6
    (crossing,) = motion.crossings()
    assert (crossing.first, crossing.second) == ("s0", "s1")
    assert crossing.t == pytest.approx(3.05)
    assert_allclose(crossing.place, [0, 0.01, 0.5], atol=1e-9)
    assert str(crossing).startswith("string s0 crosses s1 at t = 3.05 s")


def test_a_string_that_passes_and_comes_back_in_one_step_crosses_twice():
    """It is on the same side at both samples: the volume of the ends has the same sign."""
    # s1 in the plane of x, s0 in that of y; each reaches the axis of z at a height of its own,
    # s1 evenly at 0.2 + 0.5 s. At a quarter and three quarters of the step the heights are equal.
    y = 0.2745819398, 0.0070234114
    low = [[[0, 0.1, 0], [-0.2 - 0.5 * s, 0, 0]] for s in (0, 1)]
    high = [[[0, -y[s], 1], [0.8 - 0.5 * s, 0, 1]] for s in (0, 1)]
    crossings = watched([0.0, 1.0], low, high).crossings()
    assert_allclose([c.t for c in crossings], [0.25, 0.75], atol=1e-6)
    assert_allclose([c.place for c in crossings], [[0, 0, 0.325], [0, 0, 0.575]], atol=1e-6)
    assert sum(c.turn for c in crossings) == 0


def test_strings_that_pass_above_the_end_of_another_do_not_cross():
    low = [[[0, 0, 0], [0.1, 0, 0.6]], [[0, 0, 0], [-0.1, 0, 0.6]]]
    high = [[[0, 0.2, 0.5], [0.1, -0.1, 1]], [[0, 0.2, 0.5], [-0.1, -0.1, 1]]]
    motion = watched([0.0, 1.0], low, high)
    assert motion.crossings() == ()
    assert motion.windings() == ()


@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_strings_in_one_plane_meet(tilt):
    """The volume of their ends is zero all the time."""
    low = [[[0, 0, 0], [0.1, 0, 0]], [[0, 0, 0], [-0.1, 0, 0]]]
    high = [[[0, 0, 1], [0.1 + tilt, 0, 1]], [[0, 0, 1], [-0.1 + tilt, 0, 1]]]
    (crossing,) = watched([0.0, 1.0], low, high).crossings()
    assert crossing.turn == 0
    assert crossing.t == pytest.approx(0.5, abs=1e-6)


def test_strings_that_hang_side_by_side_in_one_plane_do_not_meet():
    low = np.tile([[0, 0, 0], [0.1, 0, 0]], (5, 1, 1))
    motion = watched(np.arange(5.0), low, low + np.array([0, 0, 1]))
    assert motion.crossings() == ()


def round_each_other(angle: np.ndarray, height: float) -> np.ndarray:
    """(T, 2, 3) two points on opposite sides of a circle."""
    turned = 0.2 * np.column_stack([np.cos(angle), np.sin(angle)])
    flat = np.stack([turned, -turned], axis=1)
    return np.concatenate([flat, np.full((len(angle), 2, 1), height)], axis=2)


def test_puppets_that_walk_round_each_other_with_their_hands_do_not_wind():
    t = np.linspace(0.0, 2.0, 101)
    angle = np.pi * t
    motion = watched(t, round_each_other(angle, 0.0), round_each_other(angle + 0.3, 1.0))
    (winding,) = motion.windings()
    assert motion.crossings() == ()
    assert_allclose(winding.turns, 0.3 / (2 * np.pi), atol=1e-12)
    assert_allclose(winding.seen, winding.turns, atol=1e-12)


@pytest.mark.parametrize("sense", [1, -1])
def test_hands_that_circle_over_standing_puppets_cross_at_half_a_turn(sense):
    t = np.linspace(0.0, 2.0, 101)
    low = round_each_other(np.zeros(101), 0.0)
    # A little off the middle, where they would meet in one plane.
    motion = watched(t, low, round_each_other(sense * (np.pi * t + 1e-3), 1.0))
    (crossing,), (winding,) = motion.crossings(), motion.windings()
    assert crossing.t == pytest.approx(1.0, abs=1e-3)
    assert crossing.turn == sense
    assert winding.turns[-1] == pytest.approx(sense, abs=1e-3)
    assert winding.turns[-1] - winding.seen[-1] == pytest.approx(sense)


def crossed(before: np.ndarray, after: np.ndarray, n: int = 4000) -> np.ndarray:
    """Time (0 to 1) at which two segments pass through one another; ends a0, a1, b0, b1 (4, 3).

    In n steps of time: the passing side changes along the direction normal to both lines, at a
    point between the ends of both.
    """
    times = np.linspace(0.0, 1.0, n + 1)
    s = times[:, None]
    a0, a1, b0, b1 = ((1 - s) * x + s * y for x, y in zip(before, after, strict=True))
    u, v = a1 - a0, b1 - b0
    # Solves a0 + x u + h u x v = b0 + y v.
    columns = np.stack([u, -v, np.cross(u, v)], axis=2)
    x, y, h = np.linalg.solve(columns, (b0 - a0)[..., None])[..., 0].T
    on_both = (x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)
    passes = on_both[1:] & on_both[:-1] & ((h[1:] > 0) != (h[:-1] > 0))
    return times[:-1][passes]


def test_random_steps_against_fine_ones():
    rng = np.random.default_rng(5)
    n_found = 0
    for _ in range(60):
        low, high = rng.uniform(-0.2, 0.2, (2, 2, 2, 3))
        high[..., 2] += 1.0
        motion = watched([0.0, 1.0], low, high)
        ends = np.stack([low, high], axis=2)  # sample, string, end
        expected = crossed(*ends.reshape(2, 4, 3))
        assert_allclose([c.t for c in motion.crossings()], expected, atol=5e-4)
        n_found += len(expected)
    assert n_found > 10


@pytest.mark.parametrize("seed", range(3))
def test_windings_and_crossings_agree(seed):
    """Crossings account, with their sense, for the windings that are not observed directly."""
    rng, t = np.random.default_rng(seed), np.linspace(0.0, 6.0, 1501)
    low, high = 0.3 * smooth(rng, t, (4, 3)), 0.3 * smooth(rng, t, (4, 3))
    high[..., 2] += 1.0
    motion = watched(t, low, high)
    added = {frozenset((w.first, w.second)): 0 for w in motion.windings()}
    assert len(added) == 6
    crossings = motion.crossings()
    assert len(crossings) > 5
    assert list(crossings) == sorted(crossings, key=lambda c: c.t)
    for crossing in crossings:
        added[frozenset((crossing.first, crossing.second))] += crossing.turn
        k = np.searchsorted(t, crossing.t) - 1
        s = (crossing.t - t[k]) / (t[k + 1] - t[k])
        i = int(crossing.second[1:])
        b0, b1 = ((1 - s) * x[k, i] + s * x[k + 1, i] for x in (low, high))
        off = np.cross(b1 - b0, np.array(crossing.place) - b0) / np.linalg.norm(b1 - b0)
        assert np.linalg.norm(off) < 1e-7
    for winding in motion.windings():
        expected = added[frozenset((winding.first, winding.second))]
        assert_allclose(winding.turns[-1] - winding.seen[-1], expected, atol=1e-9)
        assert np.all(np.abs(winding.seen) <= 0.5)
