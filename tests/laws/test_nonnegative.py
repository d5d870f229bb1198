"""Least squares with unknowns that are not negative, by the conditions of its minimum."""

from __future__ import annotations

import numpy as np

from fantoccini.base import nonnegative_least_squares


def test_the_minimum_has_its_gradient_where_columns_depend_on_one_another():
    """x >= 0, g = A^T (A x - b) >= 0 and x . g = 0 of rank-deficient problems such as boxes'."""
    rng = np.random.default_rng(0)
    for _ in range(400):
        n, rank = rng.integers(1, 24), rng.integers(1, 7)
        A = rng.integers(-1, 2, size=(rank, n)) * rng.choice([0.15, 1.0, 30.0], size=(rank, 1))
        A = np.concatenate([A + 1e-17 * rng.normal(size=A.shape), np.ones((1, n))])
        b = np.append(np.zeros(rank), 1.0) if rng.random() < 0.5 else rng.normal(size=rank + 1)
        x, norm = nonnegative_least_squares(A, b)
        left = A @ x - b
        gradient, scale = A.T @ left, np.linalg.norm(A) * np.linalg.norm(b)
        assert np.all(x >= 0.0) and norm == np.linalg.norm(left)
        assert np.all(gradient >= -1e-9 * scale)
        assert abs(x @ gradient) <= 1e-9 * scale * max(1.0, float(np.max(x)))


def test_without_unknowns_all_is_left():
    x, norm = nonnegative_least_squares(np.zeros((3, 0)), np.array([3.0, 4.0, 0.0]))
    assert x.shape == (0,) and norm == 5.0
