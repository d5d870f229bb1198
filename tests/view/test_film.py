"""Films have the right frames and duration, and appear whole or not at all."""

import importlib

import imageio_ffmpeg
import numpy as np
import pytest

from fantoccini import view
from fantoccini.view.film import Frames
from fantoccini.view.scene import scene_of
from fantoccini.view.theme import DARK
from view.still_life import bundled, swinging


@pytest.fixture(scope="module")
def puppet():
    m = bundled("marionette")
    return m, swinging(m)


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_frames_duration_and_size(tmp_path, puppet, ending):
    seen = []
    target = view.film(
        *puppet, tmp_path / f"a.{ending}", fps=20, size=(239, 180),
        progress=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
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


def test_slow_motion_is_longer(tmp_path, puppet):
    target = view.film(*puppet, tmp_path / "a.mp4", fps=10, size=(160, 120), speed=0.5)
    assert imageio_ffmpeg.count_frames_and_secs(str(target))[0] == 20


def test_frames_move_and_repeat_exactly(puppet):
    m, run = puppet
    frames = Frames(scene_of(m, run), (320, 240), DARK)
    first = np.array(frames.draw(0))
    later = np.array(frames.draw(20))
    assert first.shape == (240, 320, 4)
    assert np.any(first != later)
    assert np.array_equal(np.array(frames.draw(0)), first)


def test_a_failing_encoder_is_quoted_and_leaves_nothing(tmp_path, puppet, monkeypatch):
    codecs = importlib.import_module("fantoccini.view.film").CODECS
    monkeypatch.setitem(codecs, ".mp4", ("-c:v", "no_such_codec", "-f", "mp4"))
    with pytest.raises(view.FilmError, match="no_such_codec"):
        view.film(*puppet, tmp_path / "a.mp4", fps=10, size=(160, 120))
    assert list(tmp_path.iterdir()) == []


def test_a_stopped_film_leaves_nothing(tmp_path, puppet):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        view.film(*puppet, tmp_path / "a.mp4", fps=10, size=(160, 120), progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_filmed_is_said(tmp_path, puppet):
    with pytest.raises(ValueError, match=r"\.mp4 or \.gif"):
        view.film(*puppet, tmp_path / "a.avi")
    with pytest.raises(ValueError, match="fps"):
        view.film(*puppet, tmp_path / "a.mp4", fps=0)
    with pytest.raises(view.FilmError, match="no folder"):
        view.film(*puppet, tmp_path / "none" / "a.mp4")
