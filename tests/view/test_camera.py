"""Known points fall on known pixels, and the whole motion lies inside the picture."""

import numpy as np
import pytest

from fantoccini.output.view.camera import Camera, Viewport, camera_axes, fit_camera, point_of_view

VIEW = Viewport(0.0, 0.0, 400.0, 200.0)


def test_known_points_fall_on_known_pixels():
    """The eye is at +x, 10 m away, opening 90 deg: +y is right, +z up, half the height is 10 m."""
    camera = Camera(np.array([10.0, 0.0, 0.0]), camera_axes(0.0, 0.0), 1.0)
    points = np.array([[0, 0, 0], [0, 10, 0], [0, 0, 10], [5, 5, 0]], dtype=float)
    wanted = [[200, 100, 10], [300, 100, 10], [200, 200, 10], [300, 100, 5]]
    assert camera.project(points, VIEW) == pytest.approx(np.array(wanted, dtype=float))


def test_rays_undo_projection():
    camera = Camera(np.array([3.0, -2.0, 1.0]), camera_axes(-0.6, 0.2), 0.3)
    points = np.random.default_rng(1).normal(size=(20, 3)) * 0.3
    placed = camera.project(points, VIEW)
    again = camera.eye + camera.rays(placed[:, :2], VIEW) * placed[:, 2:]
    assert again == pytest.approx(points, abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_fit_holds_every_ball_and_no_more(seed):
    rng = np.random.default_rng(seed)
    points, radii = rng.normal(size=(60, 3)) * [1.0, 2.0, 3.0], rng.uniform(0.0, 0.3, 60)
    camera = fit_camera(points, radii, *rng.uniform(-1.0, 1.0, 2), 2.0, margin=0.0)
    ball = rng.normal(size=(500, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    placed = camera.project(points[:, None] + radii[:, None, None] * ball, VIEW)
    assert (placed[..., 2] > 0.0).all()
    assert (placed[..., :2] > -1e-6).all()
    assert (placed[..., 0] < 400.0 + 1e-6).all()
    assert (placed[..., 1] < 200.0 + 1e-6).all()
    sides = np.array([placed[..., 0].min(), 400.0 - placed[..., 0].max()])
    ends = np.array([placed[..., 1].min(), 200.0 - placed[..., 1].max()])
    assert sides.max() < 4.0 or ends.max() < 4.0


def test_points_of_view():
    points = np.random.default_rng(0).normal(size=(50, 3))
    assert point_of_view("front", points, "xz")[0] == 0.0
    assert point_of_view("side", points, "xz")[0] == pytest.approx(np.pi / 2)
    assert point_of_view((30.0, 10.0), points, None) == pytest.approx(np.radians((30.0, 10.0)))
    flat = points * [1.0, 0.0, 1.0]
    assert point_of_view("auto", flat, None)[0] == pytest.approx(-np.pi / 2)
    with pytest.raises(ValueError, match="there is no view"):
        point_of_view("above", points, None)
