"""The slack string's curve has the string's own length, for any positions of its ends."""

import numpy as np
import pytest

from fantoccini.output.view import rope


def length_of(points):
    return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()


@pytest.mark.parametrize("seed", range(40))
def test_catenary_has_its_length_and_ends(seed):
    rng = np.random.default_rng(seed)
    start, end = rng.normal(size=(2, 3))
    span = np.linalg.norm(end - start)
    length = span * (1.0 + 10.0 ** rng.uniform(-8.0, 1.5))
    points = rope.hanging_curve(start, end, length, 4000)
    assert length_of(points) == pytest.approx(length, rel=1e-6)
    assert points[0] == pytest.approx(start, abs=1e-12)
    assert points[-1] == pytest.approx(end, abs=1e-12)
    assert points[-2] == pytest.approx(end, abs=1e-2 * length)


def test_catenary_satisfies_its_equation():
    """z'' = sqrt(1 + z'^2) / a: slope grows in proportion to arc length."""
    points = rope.hanging_curve((0.0, 0.0, 0.0), (1.0, 0.0, 0.4), 1.7, 3001)
    steps = np.diff(points, axis=0)
    s = np.cumsum(np.linalg.norm(steps, axis=1))
    keep = np.abs(steps[:, 0]) > 1e-6
    slope = steps[keep, 2] / steps[keep, 0]
    middle = (s - 0.5 * np.linalg.norm(steps, axis=1))[keep]
    fitted = np.polynomial.Polynomial.fit(middle, slope, 1)
    assert np.abs(fitted(middle) - slope).max() < 1e-4 * np.ptp(slope)


@pytest.mark.parametrize(
    ("end", "length"),
    [
        ((0.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, 0.0), 0.0),
        ((0.0, 0.0, -1.0), 1.0 + 1e-12),
        ((0.0, 0.0, -1.0), 1.3),
        ((1e-15, 0.0, 1.0), 2.0),
        ((1e-9, -1e-9, 1.0), 1.0 + 1e-6),
        ((1.0, 0.0, 0.0), 1.0),
        ((1.0, 0.0, 0.0), 0.5),
        ((1.0, 1.0, 1.0), float("nan")),
        ((1.0, 0.0, 0.0), 1e6),
    ],
)
def test_degenerate_strings_stay_finite(end, length):
    points = rope.hanging_curve((0.0, 0.0, 0.0), end, length, 3000)
    assert np.isfinite(points).all()
    assert points[-1] == pytest.approx(end, abs=1e-12)
    wanted = max(np.linalg.norm(end), length) if np.isfinite(length) else np.linalg.norm(end)
    assert length_of(points) == pytest.approx(wanted, rel=1e-6, abs=1e-9)


def test_fold_hangs_where_it_should():
    """Ends one above the other: the fold's lowest point splits the length."""
    points = rope.hanging_curve((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 1.5, 200)
    assert points[:, 2].min() == pytest.approx(-0.25, abs=1e-8)


def test_a_path_shares_its_slack_among_segments():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.5]])
    points = rope.slack_curve(corners, 4.0, 3000)
    assert length_of(points) == pytest.approx(4.0, rel=1e-6)
    assert np.min(np.linalg.norm(points - corners[1], axis=1)) == 0.0
