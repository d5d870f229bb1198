"""Rotations compared with matrices, and derivatives of exp with differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from fantoccini.base import rotation

SIZES = [0.0, 1e-200, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.999, 1.001, 2.0, 3.0, np.pi, 4.0, 6.0]


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def vectors(rng, size):
    axis = rng.normal(size=(20, 3))
    return size * axis / np.linalg.norm(axis, axis=-1, keepdims=True)


def test_product_is_the_matrix_product(rng):
    p, q = rotation.normalised(rng.normal(size=(2, 50, 4)))
    both = rotation.matrix(p) @ rotation.matrix(q)
    assert np.allclose(rotation.matrix(rotation.multiply(p, q)), both, atol=1e-14)


def test_matrix_agrees_with_scipy(rng):
    q = rotation.normalised(rng.normal(size=(50, 4)))
    theirs = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
    assert np.allclose(rotation.matrix(q), theirs, atol=1e-14)


@pytest.mark.parametrize("size", SIZES)
def test_exp_is_the_matrix_exponential(rng, size):
    for phi in vectors(rng, size)[:5]:
        assert np.allclose(rotation.matrix(rotation.exp(phi)), expm(rotation.skew(phi)), atol=2e-14)


@pytest.mark.parametrize("size", [s for s in SIZES if s < np.pi])
def test_log_undoes_exp_to_the_last_digits(rng, size):
    phi = vectors(rng, size)
    assert np.allclose(rotation.log(rotation.exp(phi)), phi, rtol=1e-14, atol=1e-15 * size)
    assert np.allclose(rotation.log(-rotation.exp(phi)), phi, rtol=1e-14, atol=1e-15 * size)


@pytest.mark.parametrize("size", SIZES)
def test_right_jacobian_gives_the_angular_velocity(rng, size):
    phi, rate = vectors(rng, size), rng.normal(size=(20, 3))
    step = 1e-5
    w = rotation.between(rotation.exp(phi - step * rate), rotation.exp(phi + step * rate))
    assert np.allclose(
        rotation.apply(rotation.right_jacobian(phi), rate), w / (2 * step), atol=1e-8
    )


@pytest.mark.parametrize("size", SIZES)
def test_rate_of_the_right_jacobian(rng, size):
    phi, rate = vectors(rng, size), rng.normal(size=(20, 3))
    step = 1e-5
    difference = rotation.right_jacobian(phi + step * rate) - rotation.right_jacobian(
        phi - step * rate
    )
    assert np.allclose(rotation.right_jacobian_rate(phi, rate), difference / (2 * step), atol=1e-9)


@pytest.mark.parametrize("size", [s for s in SIZES if s <= 6.0])
def test_inverse_of_the_right_jacobian(rng, size):
    phi = vectors(rng, size)
    product = rotation.right_jacobian(phi) @ rotation.right_jacobian_inverse(phi)
    assert np.allclose(product, np.eye(3), atol=1e-12)


def test_series_and_closed_forms_meet(rng):
    phi = vectors(rng, 1.0)
    rate = rng.normal(size=(20, 3))
    for f in (
        rotation.right_jacobian,
        rotation.right_jacobian_inverse,
        lambda x: rotation.right_jacobian_rate(x, rate),
    ):
        assert np.allclose(f(phi * (1 - 1e-13)), f(phi * (1 + 1e-13)), rtol=0, atol=5e-13)


def test_tangent_motion_undoes_body_motion(rng):
    phi, rate, curve = vectors(rng, 2.5), rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    back = rotation.tangent_motion(phi, *rotation.body_motion(phi, rate, curve))
    assert np.allclose(back, (rate, curve), atol=1e-12)
