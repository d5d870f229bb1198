"""Nearer things are painted later."""

import numpy as np
import pytest

from fantoccini.output.view.camera import Camera, Viewport, camera_axes
from fantoccini.output.view.compose import make_occluder
from fantoccini.output.view.order import StringPiece, painting_order
from fantoccini.output.view.silhouettes import (
    box_solid,
    capsule_solid,
    ellipsoid_solid,
    mesh_solid,
    paint_solid,
    shadow_outline,
)
from fantoccini.output.view.theme import LIGHT

CAMERA = Camera(np.array([10.0, 0.0, 0.0]), camera_axes(0.0, 0.0), 0.3)
VIEW = Viewport(0.0, 0.0, 400.0, 400.0)
RED = np.array([0.8, 0.2, 0.2])
IDENTITY_POSE = np.eye(3, 4)


def order(solids, threads=()):
    occluders = [
        make_occluder(s, IDENTITY_POSE, paint_solid(s, IDENTITY_POSE, CAMERA, VIEW, LIGHT, 1.0))
        for s in solids
    ]
    return painting_order(CAMERA, VIEW, occluders, [np.array(t, dtype=float) for t in threads])


def ball(at, radius, link=0):
    return capsule_solid(link, RED, np.array([at, at]), radius)


def test_the_nearer_ball_is_painted_last():
    assert order([ball((1, 0, 0), 0.5), ball((-1, 0.1, 0), 0.5), ball((0, 0, 0), 0.5)]) == [1, 2, 0]


def test_a_button_is_seen_on_its_belly_only_from_the_front():
    belly = ellipsoid_solid(0, RED, np.zeros(3), np.diag([1.0, 1.0, 1.5]))
    assert order([ball((0.95, 0.4, 0.3), 0.1), belly]) == [1, 0]
    assert order([ball((-0.95, 0.4, 0.3), 0.1), belly]) == [0, 1]


def test_a_lamp_above_a_wide_table_is_before_it():
    """The table's middle is nearer to the eye than the lamp; its faces decide."""
    camera = Camera(np.array([10.0, 0.0, 4.0]), camera_axes(0.0, 0.38), 0.3)
    solids = [ball((-2.0, 0, 0.4), 0.3), box_solid(1, RED, np.zeros(3), np.diag([3.0, 3.0, 0.05]))]
    occluders = [
        make_occluder(s, IDENTITY_POSE, paint_solid(s, IDENTITY_POSE, camera, VIEW, LIGHT, 1.0))
        for s in solids
    ]
    assert painting_order(camera, VIEW, occluders, []) == [1, 0]


def test_a_string_is_cut_where_it_goes_behind():
    """It runs from in front of the ball to behind it."""
    string = np.linspace((2.0, -0.3, 1.5), (-2.0, 0.3, -1.5), 61)
    items = order([ball((0, 0, 0), 0.6)], [string])
    place = items.index(0)
    behind = [i for i in items[:place] if isinstance(i, StringPiece)]
    before = [i for i in items[place:] if isinstance(i, StringPiece)]
    assert behind and before
    pieces = sorted(behind + before, key=lambda p: p.start)
    assert [p.start for p in pieces] == [0, *(p.stop for p in pieces[:-1])]
    assert pieces[-1].stop == 60


@pytest.mark.parametrize("seed", range(5))
def test_everything_is_painted_once_even_in_a_tangle(seed):
    rng = np.random.default_rng(seed)
    solids = [capsule_solid(k, RED, rng.normal(size=(2, 3)), 0.2) for k in range(12)]
    solids += [
        box_solid(k, RED, rng.normal(size=3), np.diag(rng.uniform(0.1, 1.0, 3))) for k in range(4)
    ]
    items = order(solids, rng.normal(size=(3, 20, 3)))
    assert sorted(i for i in items if isinstance(i, int)) == list(range(16))
    pieces = [p for i in items if isinstance(i, StringPiece) for p in range(i.start, i.stop)]
    assert sorted(pieces) == sorted(list(range(19)) * 3)


def test_an_ellipsoids_outline_is_the_spheres_when_round():
    """A sphere of radius r at depth d shows with radius f r / sqrt(d^2 - r^2) on the axis."""
    outline = paint_solid(
        ellipsoid_solid(0, RED, np.zeros(3), np.eye(3)), IDENTITY_POSE, CAMERA, VIEW, LIGHT, 1.0
    )[0].outline
    radii = np.linalg.norm(outline - 200.0, axis=1)
    assert radii == pytest.approx(np.full(len(radii), 200.0 / 0.3 / np.sqrt(99.0)))


def test_shadows_lie_on_the_floor_and_have_the_right_size():
    ray = np.array([0.0, 0.0, -1.0])
    for solid in (
        ball((0, 0, 2.0), 0.5),
        ellipsoid_solid(0, RED, np.array([0, 0, 2.0]), np.diag([0.5, 0.5, 0.1])),
        box_solid(0, RED, np.array([0, 0, 2.0]), np.diag([0.5, 0.5, 0.1])),
    ):
        outline = shadow_outline(solid, IDENTITY_POSE, -1.0, ray)
        assert (outline[:, 2] == -1.0).all()
        assert np.ptp(outline[:, :2], axis=0) == pytest.approx([1.0, 1.0], rel=0.03)


def test_a_mesh_shows_its_near_faces():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    polygons = paint_solid(
        mesh_solid(0, RED, corners, faces), IDENTITY_POSE, CAMERA, VIEW, LIGHT, 1.0
    )
    # One of the four faces looks at +x; it is painted twice, first as the outline.
    assert len(polygons) == 2
