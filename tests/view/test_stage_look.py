"""Pictures and films in the look of a theatre."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.image import imread

from fantoccini.output import view
from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import string_lines
from fantoccini.output.view.drawing import PictureOptions, fit_layout
from fantoccini.output.view.films import Frames
from fantoccini.output.view.geometry import run_geometry
from fantoccini.output.view.stage_set import STAGE_THEME, StageSet
from fantoccini.theatre.gestures import Caption

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

SIZE = (320, 240)


def texts(path) -> int:
    """Number of text elements of an SVG."""
    return path.read_text(encoding="utf-8").count('<g id="text_')


def test_a_stage_has_no_writing(tmp_path, swung):
    m, run = swung
    diagram = view.strip(m, run, tmp_path / "a.svg", n=3)
    stage = view.strip(m, run, tmp_path / "b.svg", n=3, look="stage")
    assert texts(diagram) >= 3 + 5  # times, title, tension scale
    assert texts(stage) == 0
    picture = view.draw(m, run.state(3), tmp_path / "c.svg", run.tension.values[3], look="stage")
    assert texts(picture) == 0


def test_a_film_on_a_stage_has_no_writing_but_requested_captions(swung):
    m, run = swung
    geometry, options = run_geometry(m, run), PictureOptions.resolve(size=SIZE, look="stage")
    assert not Frames(geometry, options).sheet.axes.texts
    words = (Caption(0.0, 2.0, "Good evening!", "pierrot"),)
    frames = Frames(geometry, options, captions=words)
    assert len(frames.sheet.axes.texts) == 1
    assert np.any(np.array(frames.draw(0)) != np.array(Frames(geometry, options).draw(0)))


def test_strings_on_a_stage_are_thin_and_of_one_colour(swung):
    m, run = swung
    geometry, panel = run_geometry(m, run), Viewport(0.0, 0.0, 300.0, 300.0)
    stage, diagram = (
        fit_layout(geometry, panel, PictureOptions.resolve(look=look))
        for look in ("stage", "diagram")
    )
    drawn = string_lines(geometry, 20, stage)
    assert {tuple(line.colour) for line in drawn} == {tuple(STAGE_THEME.thread)}
    coloured = string_lines(geometry, 20, diagram)
    assert len({tuple(line.colour) for line in coloured}) > 2
    assert max(line.width for line in drawn) < 0.6 * min(line.width for line in coloured)
    assert stage.handles == () and diagram.handles


def luminance(pixels: np.ndarray) -> np.ndarray:
    return pixels[..., :3] @ [0.2126, 0.7152, 0.0722]


def test_light_falls_on_the_middle_of_the_stage(tmp_path, swung):
    """The picture is dark at its edges, and the floor is lighter than the border above."""
    m, run = swung
    path = view.draw(m, run.state(0), tmp_path / "a.png", size=SIZE, scale=1.0, look="stage")
    light = luminance(imread(path))
    height, width = light.shape
    top, bottom = light[: height // 12], light[-height // 12 :]
    corners = light[: height // 10, : width // 10]
    middle = light[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3]
    assert top.mean() < 0.1 and corners.mean() < 0.1
    assert middle.mean() > 2.0 * top.mean()
    assert bottom[:, width // 3 : 2 * width // 3].mean() > 2.0 * top.mean()
    # The set fills the sheet: nothing is left of a light background.
    assert np.mean(light > 0.9) < 0.02


def test_the_floor_of_the_set_lies_where_the_camera_sees_it(swung):
    m, run = swung
    geometry = run_geometry(m, run)
    frame = Viewport(0.0, 0.0, 320.0, 240.0)
    layout = fit_layout(geometry, frame, PictureOptions.resolve(view=(0.0, 10.0), look="stage"))
    stage, camera = layout.stage, layout.camera
    assert isinstance(stage, StageSet)
    under = np.append(stage.middle, stage.floor)
    behind = under + 0.9 * stage.radius * np.array([-1.0, 0.0, 1.0])
    x, y = np.rint(camera.project(under, frame)[:2] / 3.0).astype(int)
    pixels = stage.pixels(camera, frame, frame)
    red, green, blue = pixels[y, x]
    assert red > green > blue  # boards
    x, y = np.rint(camera.project(behind, frame)[:2] / 3.0).astype(int)
    red, green, blue = pixels[min(y, len(pixels) - 1), x]
    assert blue > red  # curtain


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 180.0, -135.0])
def test_the_curtain_is_behind_the_puppets_from_every_side(swung, azimuth):
    m, run = swung
    geometry, frame = run_geometry(m, run), Viewport(0.0, 0.0, 240.0, 240.0)
    options = PictureOptions.resolve(view=(azimuth, 10.0), look="stage")
    camera = fit_layout(geometry, frame, options).camera
    stage = fit_layout(geometry, frame, PictureOptions.resolve(look="stage")).stage
    rays = camera.rays(np.array([[120.0, y] for y in (10.0, 120.0, 230.0)]), frame)
    depth = stage.curtain_depth(camera.eye, rays)
    farthest = camera.to_camera(geometry.balls(strings=False)[0])[:, 2].max()
    assert depth.min() > farthest
    hits = camera.eye[:2] + depth[:, None] * rays[:, :2]
    np.testing.assert_allclose(np.linalg.norm(hits - stage.middle, axis=1), stage.radius, rtol=1e-9)


def test_a_strip_shows_one_stage_for_each_pose(tmp_path, swung):
    m, run = swung
    path = view.strip(m, run, tmp_path / "a.png", n=3, size=(600, 240), scale=1.0, look="stage")
    light = luminance(imread(path))
    gaps = light[:, [197, 397]]
    assert gaps.max() < 0.1
    for k in range(3):
        assert light[100:200, 200 * k + 60 : 200 * k + 130].mean() > 0.15


def test_a_strip_without_times_has_equal_time_steps(tmp_path, swung):
    m, run = swung
    pictures = []
    for k, times in enumerate(({}, {"times": "even"}, {"times": "poses"})):
        path = tmp_path / f"{k}.png"
        view.strip(m, run, path, n=4, size=(400, 120), scale=1.0, look="stage", **times)
        pictures.append(imread(path))
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[0], pictures[2])


def test_a_theme_with_the_look_of_a_stage_is_refused(tmp_path, swung):
    with pytest.raises(ValueError, match="has its own colours; leave it out"):
        view.film(*swung, tmp_path / "a.mp4", theme="dark", look="stage")


def test_an_unknown_look_is_refused(tmp_path, swung):
    with pytest.raises(ValueError, match="diagram or stage"):
        view.film(*swung, tmp_path / "a.mp4", look="theatre")
