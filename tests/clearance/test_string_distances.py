"""Distances of strings, compared with samples and with the hanging curves of pictures."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar

import fantoccini as fan
from clearance.balls import balls, carried, smooth
from fantoccini.dynamics.clearance import Approach, StringDistances
from fantoccini.dynamics.clearance.segments import (
    distance_bound_from_ellipsoid,
    distance_from_box,
    segment_distance,
    slack_curves,
)
from fantoccini.dynamics.clearance.string_pairs import string_pairs
from fantoccini.output.view import rope

pytestmark = pytest.mark.medium

N_POINTS = 200
"""Number of points that represent a string."""

MISSED = {-0.1: 6e-3, 0.05: 8e-3}
"""Error of distances by points, and of the twelve chords of a slack string [m], for each slack."""

CRATE, TURN = np.array([0.2, 0.1, 0.3]), [0.3, 0.2, 0.1]
RADII = {"p.ball0": 0.01, "p.ball1": 0.01, "q.ball0": 0.01, "q.ball1": 0.01}


@cache
def scene() -> fan.Marionette:
    """Two puppets of two balls each, and a crate without support."""
    crate = {"type": "box", "size": CRATE.tolist(), "mass": 1, "orientation": {"rpy": TURN}}
    return fan.Marionette(
        fan.Scene.model_validate(
            {
                "scene": "pair",
                "puppets": [{"name": name, "puppet": balls(2).puppet} for name in "pq"],
                "props": [{"name": "crate", "shapes": [crate], "at": [0, 0, 0.5]}],
            }
        )
    )


def wandering(seed: int, slack: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q_D, q_K and t; strings exceed their spans by up to a part of the spans."""
    rng, stage, t = np.random.default_rng(seed), scene(), np.linspace(0.0, 4.0, 161)
    table = stage.coordinates
    q_D, q_K = (0.2 * smooth(rng, t, (n,)) for n in (table.n_qD, table.n_qK))
    for q, names in ((q_D, table.q_D), (q_K, table.q_K)):
        for name, up in (("crate.z", 0.5), (".s0.z", 1.0), (".s1.z", 1.1)):
            q[:, [n for n, joint in enumerate(names) if joint.endswith(name)]] += up
    for place in table.quaternions_D:
        q_D[:, place] /= np.linalg.norm(q_D[:, place], axis=1, keepdims=True)
    paths = stage.string_points(q_D, q_K)
    for string, path in zip(stage.tree.strings, paths.values(), strict=True):
        span = np.linalg.norm(path[:, 1] - path[:, 0], axis=1)
        q_K[:, string.driven_length[0]] = span * (1.0 + slack * np.sin(3.0 * t) ** 2)
    return q_D, q_K, t


@cache
def expected(seed: int, slack: float) -> dict[tuple[str, str], np.ndarray]:
    """(T,) distances by names, with strings and boxes as clouds of points."""
    stage, (q_D, q_K, t) = scene(), wandering(seed, slack)
    lengths, places = stage.string_lengths(q_D, q_K), stage.string_points(q_D, q_K).values()
    clouds = {
        string.name: np.array(
            [rope.slack_curve(place[k], lengths[k, n], N_POINTS) for k in range(len(t))]
        )
        for n, (string, place) in enumerate(zip(stage.tree.strings, places, strict=True))
    }
    names, distances = list(clouds), {}
    for n, name in enumerate(names):
        for other in names[n + 1 :]:
            pairs = zip(clouds[name], clouds[other], strict=True)
            gaps = [np.linalg.norm(x[:, None] - y, axis=2).min() for x, y in pairs]
            distances[name, other] = np.array(gaps)
        for i, link in enumerate(stage.tree.links):
            R, r = np.split(stage.poses(q_D, q_K)[:, i], [3], axis=2)
            inside = (clouds[name] - r.swapaxes(1, 2)) @ R
            if link.name in RADII:
                gaps = np.linalg.norm(inside, axis=2).min(axis=1)
                distances[name, link.name] = gaps - RADII[link.name]
            elif link.name == "crate":
                (box,) = link.shapes
                inside = inside @ np.asarray(box.orientation.matrix)  # type: ignore[attr-defined]
                out = inside - np.clip(inside, -CRATE / 2, CRATE / 2)
                distances[name, link.name] = np.linalg.norm(out, axis=2).min(axis=1)
    for name in names:
        del distances[name, name.replace(".s", ".ball")]  # tied to it
    return distances


def listed(found: fan.dynamics.clearance.Approaches) -> list[Approach]:
    return [*found.strings, *found.bodies, *found.own]


@pytest.mark.parametrize("slack", list(MISSED))
@pytest.mark.parametrize("seed", [0, 1])
def test_the_nearest_of_every_pair_is_found(seed, slack):
    q_D, q_K, t = wandering(seed, slack)
    approaches = listed(StringDistances(scene()).motion(q_D, q_K, t).nearest(max_distance=10.0))
    assert {(a.first, a.second) for a in approaches} == set(expected(seed, slack))
    for approach in approaches:
        distances = expected(seed, slack)[approach.first, approach.second]
        assert approach.distance == pytest.approx(distances.min(), abs=MISSED[slack])
        at_that_time = distances[np.searchsorted(t, approach.t)]
        assert at_that_time == pytest.approx(distances.min(), abs=2 * MISSED[slack])


@pytest.mark.parametrize("slack", list(MISSED))
def test_the_first_time_of_every_pair_is_found(slack):
    (q_D, q_K, t), missed = wandering(0, slack), MISSED[slack]
    approaches = listed(StringDistances(scene()).motion(q_D, q_K, t).nearer_than(0.05))
    assert len(approaches) > 5
    for pair, distance in expected(0, slack).items():
        first = [a for a in approaches if (a.first, a.second) == pair]
        assert first or distance.min() > 0.05 - missed
        for approach in first:
            k = int(np.searchsorted(t, approach.t))
            assert approach.distance < 0.05 and distance[:k].min(initial=1.0) > 0.05 - missed
            assert approach.distance == pytest.approx(
                np.interp(approach.t, t, distance), abs=missed
            )


@pytest.mark.parametrize("seed", [0, 1])
def test_distances_within_a_puppet_can_be_left_out(seed):
    q_D, q_K, t = wandering(seed, 0.05)
    full = StringDistances(scene()).motion(q_D, q_K, t)
    without_own = StringDistances(scene(), own=False).motion(q_D, q_K, t)

    def puppet(name: str) -> str:
        return name.partition(".")[0]

    for all_pairs, remaining in (
        (full.nearest(max_distance=10.0), without_own.nearest(max_distance=10.0)),
        (full.nearer_than(0.1), without_own.nearer_than(0.1)),
    ):
        expected = [a for a in listed(all_pairs) if puppet(a.first) != puppet(a.second)]
        approaches = listed(remaining)
        assert expected and not remaining.own
        assert [(a.first, a.second) for a in approaches] == [(a.first, a.second) for a in expected]
        for approach, other in zip(approaches, expected, strict=True):
            assert_allclose(
                [approach.distance, approach.t, *approach.place],
                [other.distance, other.t, *other.place],
                atol=1e-9,
            )


def test_without_pairs_of_one_puppet_its_crossings_are_still_found():
    """Strings with opposite inclinations swap sides."""
    puppet, t, side = balls(2), np.linspace(0.0, 1.0, 11), np.array([-1.0, 1.0])
    low = np.zeros((len(t), 2, 3))
    low[..., 0], low[..., 1] = 0.2 * np.outer(1.0 - 2.0 * t, side), -0.01 * side
    high = low * [1.0, -1.0, 1.0] + [0.0, 0.0, 1.0]
    q_D, q_K = carried(puppet, low, high)
    motion = StringDistances(puppet, own=False).motion(q_D, q_K, t)
    assert not listed(motion.nearest(max_distance=10.0)) and not listed(motion.nearer_than(0.5))
    (crossing,) = motion.crossings()
    assert {crossing.first, crossing.second} == {"s0", "s1"}
    assert 0.4 < crossing.t < 0.6


def test_kinds_names_and_order():
    q_D, q_K, t = wandering(0, -0.1)
    approaches = StringDistances(scene()).motion(q_D, q_K, t).nearest(max_distance=10.0)
    assert len(approaches.strings) == 6
    assert {(a.first, a.second) for a in approaches.own} == {
        ("p.s0", "p.ball1"),
        ("p.s1", "p.ball0"),
        ("q.s0", "q.ball1"),
        ("q.s1", "q.ball0"),
    }
    assert {a.second for a in approaches.bodies} == {*RADII, "crate"}
    assert [a.distance for a in approaches.strings] == sorted(
        a.distance for a in approaches.strings
    )


def test_thickness_counts_for_each_string():
    q_D, q_K, t = wandering(0, -0.1)
    for k in range(0, len(t), 40):
        thin, thick = (
            StringDistances(scene(), radius=radius)
            .motion(q_D[[k]], q_K[[k]], t[[k]])
            .nearest(max_distance=10.0)
            for radius in (0.0, 0.004)
        )
        for kind, sides in (("strings", 2), ("bodies", 1), ("own", 1)):
            at = {(a.first, a.second): a.distance for a in getattr(thick, kind)}
            for approach in getattr(thin, kind):
                if approach.distance > 0.0:
                    less = approach.distance - at[approach.first, approach.second]
                    assert less == pytest.approx(sides * 0.004, abs=2e-5)


def test_strings_through_one_point_are_left_out():
    puppet = balls(2).puppet.model_dump(mode="json", exclude_unset=True, by_alias=True)
    puppet["strings"][1]["path"][0] = {"body": "ball0"}
    marionette = fan.Marionette(fan.model.Puppet.model_validate(puppet))
    pairs = string_pairs(marionette, [0, 1], np.array([0.01, 0.01]), 0.0)
    assert pairs.names == (("s0", "ball1"), ("s1", "ball1"))


def test_a_time_and_a_place_are_reported():
    t = np.linspace(0.0, 1.0, 101)
    low = np.zeros((101, 2, 3))
    low[:, 1, 0] = np.abs(t - 0.5) + 0.01
    motion = StringDistances(balls(2)).motion(*carried(balls(2), low, low + np.array([0, 0, 1])), t)
    (approach,) = motion.nearest().strings
    assert (approach.t, approach.distance) == (pytest.approx(0.5), pytest.approx(0.01))
    assert_allclose(approach.place[:2], 0.0, atol=1e-12)
    assert str(approach).startswith("string s0 is 0.01 m from s1 at t = 0.5 s")
    (first,) = motion.nearer_than(0.055).strings
    assert first.t == pytest.approx(0.455, abs=2e-4)


def test_a_string_that_passes_a_body_between_two_samples_is_found():
    """A ball flies past a string at rest, 20 cm from it at both samples."""
    t = np.array([0.0, 0.02])
    low = np.zeros((2, 2, 3))
    low[:, 0] = [0.0, 0.0, -0.5]
    low[:, 1] = [[-0.2, 0.004, 0.0], [0.2, 0.004, 0.0]]
    high = low + np.array([0, 0, 1])
    high[:, 1] += [0.0, 0.5, 0.0]
    motion = StringDistances(balls(2)).motion(*carried(balls(2), low, high), t)
    (approach,) = (a for a in motion.nearest().own if a.first == "s0")
    assert approach.distance == pytest.approx(0.004 - 0.01, abs=2e-4)
    (first,) = (a for a in motion.nearer_than(0.01).own if a.first == "s0")
    assert first.t == pytest.approx(0.01 * (1.0 - np.sqrt(0.02**2 - 0.004**2) / 0.2), abs=1e-5)


@pytest.mark.parametrize(
    ("q_D", "t", "text"),
    [((2, 5), [0, 1], "shapes"), ((0, 6), [], "shapes"), ((2, 6), [1, 0], "decrease")],
)
def test_wrong_motions_are_refused(q_D, t, text):
    with pytest.raises(ValueError, match=text):
        StringDistances(balls(2)).motion(np.zeros(q_D), np.zeros((len(t), 8)), t)


def test_wrong_numbers_are_refused():
    with pytest.raises(ValueError, match="radius"):
        StringDistances(balls(2), radius=-1.0)
    x = balls(2).state()
    motion = StringDistances(balls(2)).motion(x.q_D[None], x.q_K[None], [0.0])
    for measured in (motion.nearest, motion.nearer_than):
        with pytest.raises(ValueError, match="greater than 0"):
            measured(0.0)


def test_segments_against_minimisation():
    rng, steps = np.random.default_rng(2), np.linspace(0.0, 1.0, 2001)[:, None]
    a, b, c, d = rng.normal(size=(4, 60, 3))
    d[:10] = c[:10] + (b - a)[:10]  # parallel
    d[10:20] = c[10:20]  # points
    half = rng.uniform(0.2, 1.0, (60, 3))
    of_segments, s = segment_distance(a, b, c, d)
    of_boxes, _ = distance_from_box(a, b, half)
    for n in range(60):
        line = a[n] + steps * (b - a)[n]
        out = np.linalg.norm(line - np.clip(line, -half[n], half[n]), axis=1)
        assert of_boxes[n] == pytest.approx(out.min(), abs=1e-3)

        # The distance from a point of one segment to the other is convex along the first.
        def gap(x, n=n):
            near = a[n] + x * (b - a)[n]
            t = np.clip((near - c[n]) @ (d - c)[n] / max(np.sum((d - c)[n] ** 2), 1e-9), 0, 1)
            return np.linalg.norm(near - c[n] - t * (d - c)[n])

        minimum = minimize_scalar(gap, bounds=(0, 1), method="bounded", options={"xatol": 1e-9})
        assert of_segments[n] == pytest.approx(min(minimum.fun, gap(0), gap(1)), abs=1e-7)
        assert gap(s[n]) == pytest.approx(of_segments[n])


def test_bounds_of_ellipsoids_hold_and_are_sharp_where_strings_touch():
    rng = np.random.default_rng(4)
    half = rng.uniform(0.02, 0.1, (40, 3))
    middle, along = rng.normal(size=(2, 40, 3))
    middle *= 0.1 / np.linalg.norm(middle, axis=1, keepdims=True)
    a, b = middle - along, middle + along
    bound, t = distance_bound_from_ellipsoid(a, b, half)
    u = rng.normal(size=(20_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    for n in range(40):
        surface = u * half[n]
        d = (b - a)[n]
        s = np.clip((surface - a[n]) @ d / (d @ d), 0, 1)
        gap = np.linalg.norm(surface - a[n] - s[:, None] * d, axis=1).min()
        meet = np.linalg.norm((a[n] + t[n] * d) / half[n]) < 1
        assert (bound[n] < 0) == meet
        if not meet:
            assert bound[n] <= gap + 1e-9
            assert gap - bound[n] < 0.002 + 5.0 * gap**2 / half[n].min()


def test_slack_strings_hang_as_in_pictures():
    rng = np.random.default_rng(3)
    start, end = rng.uniform(-1, 1, (2, 30, 3))
    end[0, :2] = start[0, :2]  # a fold
    span = np.linalg.norm(end - start, axis=1)
    length = span * (1.0 + 10.0 ** rng.uniform(-5, 0, 30))
    for n, points in enumerate(slack_curves(start, end, length)):
        drawn = rope.hanging_curve(start[n], end[n], length[n], 2000)
        gaps = segment_distance(
            *(np.repeat(x, 1999, axis=0) for x in (points, points)),
            *(np.tile(x, (len(points), 1)) for x in (drawn[:-1], drawn[1:])),
        )[0].reshape(len(points), -1)
        assert gaps.min(axis=1).max() < 1e-4 * length[n]
