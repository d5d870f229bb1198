"""Shots of a film's camera: cuts and moves, and players at the places where they must appear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fantoccini.output.view.drawing import PictureOptions
from fantoccini.output.view.films import Frames
from fantoccini.output.view.geometry import run_geometry
from fantoccini.theatre.plays import Shot
from view.still_life import bundled_still_life, swinging_motion, walking_motion

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

SIZE = (320, 240)
OPTIONS = PictureOptions.resolve(view=(0.0, 10.0), size=SIZE, look="stage")
ARM = ("upper_arm_left", "forearm_left")


@pytest.fixture(scope="module", name="geometry")
def _geometry(swung):
    return run_geometry(*swung)


def bounding_box(geometry, frames: Frames, k: int, names: tuple[str, ...]) -> np.ndarray:
    """(2, 2) lower left and upper right corner of bodies in frame k, by their solids [px]."""
    viewport, camera = frames.layout.viewport, frames.cameras[k]
    links = [i for i, link in enumerate(geometry.tree.links) if link.name in names]
    corners = []
    for solid in geometry.solids:
        if solid.link in links:
            pose = geometry.poses[k, solid.link]
            seen = camera.project(solid.axis @ pose[:, :3].T + pose[:, 3], viewport)
            radius = solid.half_thickness * camera.scale(seen[:, 2], viewport)
            corners += [seen[:, :2] - radius[:, None], seen[:, :2] + radius[:, None]]
    points = np.concatenate(corners)
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_without_shots_one_camera_is_fixed(geometry):
    frames = Frames(geometry, OPTIONS)
    assert len({id(camera) for camera in frames.cameras}) == 1


def test_a_body_without_a_pose_does_not_attract_the_camera(geometry):
    """A shot at two bodies, of which one has no pose, is aimed as a shot at the other alone."""
    poses = geometry.poses.copy()
    (lost,) = (i for i, link in enumerate(geometry.tree.links) if link.name == ARM[0])
    poses[:, lost] = np.nan
    broken = replace(geometry, poses=poses)
    eyes = [
        Frames(broken, OPTIONS, shots=(Shot(0.0, bodies=bodies),)).cameras[-1].eye
        for bodies in (ARM, ARM[1:])
    ]
    assert eyes[0] == pytest.approx(eyes[1], abs=1e-6)


def test_a_cut_is_between_two_frames(geometry):
    shot = Shot(0.5, bodies=ARM)
    cameras = Frames(geometry, OPTIONS, shots=(shot,)).cameras
    cut = int(np.argmin(np.abs(geometry.t - 0.5)))
    assert all(camera is cameras[0] for camera in cameras[:cut])
    before, after = (np.linalg.norm(cameras[k].eye - cameras[0].eye) for k in (cut - 1, cut))
    assert before == 0.0 and after > 0.3


def test_a_body_fills_the_picture_at_zoom_1(geometry):
    frames = Frames(geometry, OPTIONS, shots=(Shot(0.0, bodies=ARM),))
    viewport = frames.layout.viewport
    low, high = [], []
    for k in range(len(geometry.t)):
        lower, upper = bounding_box(geometry, frames, k, ARM)
        low.append(lower), high.append(upper)
    low, high = np.min(low, axis=0), np.max(high, axis=0)
    assert low[0] >= viewport.x and high[0] <= viewport.x + viewport.width
    assert low[1] >= viewport.y and high[1] <= viewport.y + viewport.height
    shares = (high - low) / [viewport.width, viewport.height]
    assert 0.75 < shares.max() < 1.0


@pytest.mark.parametrize("zoom", [0.5, 2.0])
def test_zoom_is_the_size_in_the_picture(geometry, zoom):
    sizes = []
    for factor in (1.0, zoom):
        frames = Frames(geometry, OPTIONS, shots=(Shot(0.0, bodies=ARM, zoom=factor),))
        corners = bounding_box(geometry, frames, 10, ARM)
        sizes.append(corners[1, 1] - corners[0, 1])
    assert sizes[1] / sizes[0] == pytest.approx(zoom, rel=0.12)


@pytest.mark.parametrize("azimuth", [0.0, 0.5 * np.pi, -2.0])
def test_a_shot_is_taken_from_its_side(geometry, azimuth):
    frames = Frames(geometry, OPTIONS, shots=(Shot(0.0, azimuth=azimuth, elevation=0.2),))
    back = frames.cameras[3].axes[2]
    assert back == pytest.approx(
        [np.cos(0.2) * np.cos(azimuth), np.cos(0.2) * np.sin(azimuth), np.sin(0.2)]
    )


def test_a_move_is_smooth_and_ends_in_the_shot_of_a_cut(swung):
    m, _ = swung
    geometry = run_geometry(m, swinging_motion(m, 4.0, 401))
    move = Frames(geometry, OPTIONS, shots=(Shot(1.0, 2.0, ARM, azimuth=1.0),)).cameras
    cut = Frames(geometry, OPTIONS, shots=(Shot(1.0, 0.0, ARM, azimuth=1.0),)).cameras
    t = geometry.t
    for k in np.flatnonzero(t < 0.999):
        assert move[k] is move[0]
    for k in np.flatnonzero(t > 3.001):
        np.testing.assert_allclose(move[k].eye, cut[k].eye, rtol=0.0, atol=1e-9)
    eyes = np.array([camera.eye for camera in move])
    speed = np.linalg.norm(np.diff(eyes, axis=0), axis=1) / np.diff(t)
    jump = np.abs(np.diff(speed)).max()
    assert speed.max() > 0.3
    assert jump < 0.05 * speed.max()  # 0.01 s between frames


def test_the_whole_stage_again_is_the_first_picture(geometry):
    shots = (Shot(0.2, bodies=ARM), Shot(0.6, elevation=np.radians(10.0)))
    cameras = Frames(geometry, OPTIONS, shots=shots).cameras
    assert cameras[-1] is cameras[-2]
    np.testing.assert_allclose(cameras[-1].eye, cameras[0].eye, rtol=0.0, atol=1e-9)


def test_a_shot_follows_a_walking_player():
    m = bundled_still_life("marionette_bar")
    geometry = run_geometry(m, walking_motion(m, 2.0))
    frames = Frames(geometry, OPTIONS, shots=(Shot(0.0, bodies=("torso",), zoom=0.4),))
    viewport = frames.layout.viewport
    for k in (0, 20, 40):
        low, high = bounding_box(geometry, frames, k, ("torso",))
        middle = 0.5 * (low + high)
        assert abs(middle[0] - viewport.centre[0]) < 0.1 * viewport.width
        assert abs(middle[1] - viewport.centre[1]) < 0.15 * viewport.height
    assert frames.cameras[-1].eye[0] - frames.cameras[0].eye[0] == pytest.approx(2.0, abs=0.1)


def test_a_place_is_in_the_middle_of_the_picture(geometry):
    frames = Frames(geometry, OPTIONS, shots=(Shot(0.0, place=(0.3, 0.4, 0.2)),))
    viewport = frames.layout.viewport
    seen = frames.cameras[0].project(np.array([0.3, 0.4, 0.2]), viewport)
    assert seen[:2] == pytest.approx(viewport.centre, abs=1e-6)


@pytest.mark.parametrize("look", ["stage", "diagram"])
def test_frames_of_a_moving_camera_repeat_exactly(geometry, look):
    """Backgrounds are kept between frames of one camera."""
    options = PictureOptions.resolve(view=(0.0, 10.0), size=SIZE, look=look)
    frames = Frames(geometry, options, shots=(Shot(0.5, 0.2, bodies=ARM),))
    order = (0, 1, 25, 40, 39, 0)
    pictures = [np.array(frames.draw(k)) for k in order]
    assert np.array_equal(pictures[0], pictures[-1])
    assert len({picture.tobytes() for picture in pictures[:-1]}) == 5
    # The background moves with the camera: it is not that of the first frame.
    again = Frames(geometry, options, shots=(Shot(0.5, 0.2, bodies=ARM),))
    assert np.array_equal(np.array(again.draw(40)), pictures[3])
