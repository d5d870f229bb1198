"""Films have the right frames and duration, and appear whole or not at all."""

import importlib
from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

import fantoccini as fan
from fantoccini.output import view
from fantoccini.output.view.drawing import PictureOptions
from fantoccini.output.view.films import Frames
from fantoccini.output.view.geometry import run_geometry
from fantoccini.output.view.theme import DARK
from view.still_life import bundled_still_life, walking_motion

pytestmark = pytest.mark.medium


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_frames_duration_and_size(tmp_path, swung, ending):
    seen = []
    target = view.film(
        *swung,
        tmp_path / f"a.{ending}",
        fps=20,
        size=(239, 180),
        progress=lambda at: seen.append((at.done, at.total)),
    )
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(target))
    assert frames == 20
    assert seconds == pytest.approx(1.0, abs=0.051)
    assert seen == [(k, 20) for k in range(1, 21)]
    assert [p.name for p in tmp_path.iterdir()] == [f"a.{ending}"]
    about = next(imageio_ffmpeg.read_frames(str(target)))
    assert about["source_size"] == (240, 180)
    if ending == "mp4":
        assert about["codec"] == "h264"
        assert about["pix_fmt"].startswith("yuv420p")


@pytest.mark.parametrize("fps", [50, 50.1, 60, 75, 100, 240])
def test_a_gif_plays_in_browsers_as_long_as_the_motion_lasts(tmp_path, swung, fps):
    """Browsers show a frame of 0.01 s or less for 0.1 s."""
    with Image.open(view.film(*swung, tmp_path / "a.gif", fps=fps, size=(64, 48))) as film:
        delays = [film.seek(k) or film.info["duration"] for k in range(film.n_frames)]  # type: ignore[attr-defined]
    assert min(delays) >= 20
    assert sum(delays) == pytest.approx(1000.0, abs=25)


def test_slow_motion_is_longer(tmp_path, swung):
    target = view.film(*swung, tmp_path / "a.mp4", fps=10, size=(160, 120), speed=0.5)
    assert imageio_ffmpeg.count_frames_and_secs(str(target))[0] == 20


def test_frames_move_and_repeat_exactly(swung):
    m, run = swung
    frames = Frames(run_geometry(m, run), PictureOptions.resolve(theme=DARK, size=(320, 240)))
    first = np.array(frames.draw(0))
    later = np.array(frames.draw(20))
    assert first.shape == (240, 320, 4)
    assert np.any(first != later)
    assert np.array_equal(np.array(frames.draw(0)), first)


def test_a_failing_encoder_is_quoted_and_leaves_nothing(tmp_path, swung, monkeypatch):
    codecs = importlib.import_module("fantoccini.output.view.films").CODEC_ARGUMENTS
    monkeypatch.setitem(codecs, ".mp4", ("-c:v", "no_such_codec", "-f", "mp4"))
    with pytest.raises(view.FilmError, match="no_such_codec"):
        view.film(*swung, tmp_path / "a.mp4", fps=10, size=(160, 120))
    assert list(tmp_path.iterdir()) == []


def test_a_stopped_film_leaves_nothing(tmp_path, swung):
    def stop(at):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        view.film(*swung, tmp_path / "a.mp4", fps=10, size=(160, 120), progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_motions_that_cannot_be_filmed_are_refused(tmp_path, swung):
    with pytest.raises(ValueError, match=r"\.mp4 or \.gif"):
        view.film(*swung, tmp_path / "a.avi")
    with pytest.raises(ValueError, match="fps"):
        view.film(*swung, tmp_path / "a.mp4", fps=0)
    with pytest.raises(view.FilmError, match="no folder"):
        view.film(*swung, tmp_path / "none" / "a.mp4")


def test_the_camera_follows_a_walking_puppet():
    """Regression: a walking puppet was small in the picture, or left it."""
    m = bundled_still_life("marionette_bar")
    run = walking_motion(m, 4.0)
    geometry = run_geometry(m, run)
    frames = Frames(geometry, PictureOptions.resolve(theme=DARK, size=(320, 240)))
    assert frames.pan[-1] - frames.pan[0] == pytest.approx([4.0, 0.0, 0.0], abs=0.1)
    still = Frames(geometry, PictureOptions.resolve(theme=DARK, size=(320, 240)), follow=False)
    assert still.pan is None
    for k in (0, 20, 40):
        camera = frames.layout.camera
        camera = replace(camera, eye=camera.eye + frames.pan[k])
        places = geometry.poses[k, :, :, 3]
        seen = camera.project(places, frames.layout.viewport)
        assert np.all((seen[:, 0] > 0) & (seen[:, 0] < 320) & (seen[:, 1] > 0))
        assert np.all(seen[:, 1] < 240)
        # Its size is the same in every frame, and larger than a still camera shows it.
        assert np.ptp(seen[:, 1]) > 120
    first, last = np.array(frames.draw(0)), np.array(frames.draw(40))
    assert np.array_equal(first, np.array(frames.draw(0)))
    assert not np.array_equal(first, last)


def test_the_camera_stands_still_without_a_walk(swung):
    m, run = swung
    look = PictureOptions.resolve(focus="bodies", theme=DARK, size=(160, 120))
    assert Frames(run_geometry(m, run), look).pan is None
    m = bundled_still_life("marionette_bar")
    run = walking_motion(m, 0.2)
    assert (
        Frames(run_geometry(m, run), PictureOptions.resolve(theme=DARK, size=(160, 120))).pan
        is None
    )


def test_pictures_and_films_have_one_default_theme():
    """Regression: strips were light and films dark."""
    from inspect import signature

    themes = {
        signature(f).parameters["theme"].default
        for f in (view.film, view.strip, view.draw, view.plot, fan.show)
    }
    assert themes == {"light"}
