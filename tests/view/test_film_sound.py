"""Films with sound and captions: content, duration, and times of captions."""

from __future__ import annotations

import subprocess
import wave
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

from fantoccini.base.media import MediaError, sound_duration
from fantoccini.output import view
from fantoccini.output.view.drawing import Sheet
from fantoccini.output.view.subtitles import Subtitles
from fantoccini.output.view.theme import theme_of
from fantoccini.theatre.gestures import Caption, Sound
from view.still_life import bundled_still_life, swinging_motion

RATE = 8000
FFMPEG = imageio_ffmpeg.get_ffmpeg_exe()


@pytest.fixture(scope="module")
def puppet():
    m = bundled_still_life("arm2d")
    return m, swinging_motion(m, 2.0)


@pytest.fixture
def beep(tmp_path) -> Sound:
    """A tone of 440 Hz that begins at 0.5 s and lasts 0.5 s."""
    path = tmp_path / "a'b;[0].wav"
    tone = 0.5 * np.sin(2.0 * np.pi * 440.0 * np.arange(RATE // 2) / RATE)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes((32767 * tone).astype("<i2").tobytes())
    return Sound(path, 0.5, 1.0, 0.5)


def sound_of(film: Path) -> np.ndarray:
    """The film's sound at 8000 samples per second."""
    command = [FFMPEG, "-v", "error", "-i", str(film), "-map", "0:a:0", "-ac", "1"]
    done = subprocess.run(
        [*command, "-ar", str(RATE), "-f", "f32le", "pipe:1"], capture_output=True, check=True
    )
    return np.frombuffer(done.stdout, dtype="<f4")


def times_with_sound(film: Path) -> np.ndarray:
    """Times with sound [s]."""
    return np.flatnonzero(np.abs(sound_of(film)) > 0.05) / RATE


def frame_pixels(film: Path) -> list[np.ndarray]:
    """The frames' pixels."""
    reader = imageio_ffmpeg.read_frames(str(film))
    width, height = next(reader)["source_size"]
    return [np.frombuffer(x, np.uint8).reshape(height, width, 3).astype(float) for x in reader]


def options() -> dict:
    return {"fps": 10, "size": (160, 200)}


def test_the_sound_is_in_the_film_at_its_time(puppet, beep, tmp_path):
    film = view.film(*puppet, tmp_path / "a.mp4", sounds=[beep], **options())
    assert len(sound_of(film)) / RATE == pytest.approx(2.0, abs=0.03)
    at = times_with_sound(film)
    assert at.min() == pytest.approx(0.5, abs=0.03) and at.max() == pytest.approx(1.0, abs=0.03)
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(film))
    assert frames == 20


def test_slow_films_have_slow_sound_of_the_same_pitch(puppet, beep, tmp_path):
    film = view.film(*puppet, tmp_path / "a.mp4", sounds=[beep], speed=0.5, **options())
    at = times_with_sound(film)
    assert at.min() == pytest.approx(1.0, abs=0.08) and at.max() == pytest.approx(2.0, abs=0.08)
    part = sound_of(film)[int(1.3 * RATE) : int(1.7 * RATE)]
    spectrum = np.abs(np.fft.rfft(part * np.hanning(len(part))))
    assert np.argmax(spectrum) * RATE / len(part) == pytest.approx(440.0, abs=6.0)
    with pytest.raises(ValueError, match=r"needs 0\.25 to 4"):
        view.film(*puppet, tmp_path / "b.mp4", sounds=[beep], speed=0.1, **options())
    assert not (tmp_path / "b.mp4").exists()


def test_sounds_are_mixed_and_cut_with_the_film(puppet, beep, tmp_path):
    quiet = Sound(beep.path, 1.8, 0.3, 0.5)
    before = Sound(beep.path, -0.4, 1.0, 0.5)
    never = Sound(beep.path, 7.0, 1.0, 0.5)
    film = view.film(*puppet, tmp_path / "a.mp4", sounds=[beep, quiet, before, never], **options())
    samples = sound_of(film)
    assert len(samples) / RATE == pytest.approx(2.0, abs=0.03)
    at = times_with_sound(film)
    gaps = at[1:][np.diff(at) > 0.1]
    np.testing.assert_allclose(gaps, [0.5, 1.8], atol=0.04)
    assert at.min() < 0.03
    parts = [samples[int(a * RATE) : int(b * RATE)] for a, b in ((0.6, 0.9), (1.85, 2.0))]
    strongest = [np.abs(part).max() for part in parts]
    assert strongest[1] / strongest[0] == pytest.approx(0.3, rel=0.2)


def test_a_gif_is_silent_and_a_film_without_sounds_has_none(puppet, beep, tmp_path):
    assert view.film(*puppet, tmp_path / "a.gif", sounds=[beep], **options()).stat().st_size > 0
    film = view.film(*puppet, tmp_path / "a.mp4", **options())
    with pytest.raises(subprocess.CalledProcessError):
        sound_of(film)


def test_captions_are_in_the_picture_in_their_time_only(puppet, tmp_path):
    long = "Good evening, ladies & gentlemen: $x_1$ \\frac, and then some more words to wrap"
    captions = [Caption(0.5, 1.0, "Hop!"), Caption(1.2, 1.6, long)]
    film = view.film(*puppet, tmp_path / "a.mp4", captions=captions, **options())
    plain = view.film(*puppet, tmp_path / "b.mp4", captions=[Caption(5, 6, long)], **options())
    changed = [
        np.sum(np.abs(a - b)[120:176] > 60.0)  # above the scale of tension
        for a, b in zip(frame_pixels(film), frame_pixels(plain), strict=True)
    ]
    assert list(np.flatnonzero(changed)) == [5, 6, 7, 8, 9, 12, 13, 14, 15]
    assert changed[13] > 3 * changed[7]


def test_overlapping_captions_are_all_shown_with_their_speakers(puppet):
    """Regression: the older of two captions vanished, and no speaker was named."""
    first = Caption(0.0, 2.0, "Good evening!", "pierrot")
    second = Caption(1.0, 3.0, "Ah!", "doctor")
    alone = Caption(4.0, 5.0, "A bell rings")
    subtitles = Subtitles([alone, second, first], 960, 14.0, 300.0)
    subtitles.place(Sheet((960, 720), theme_of("light")), 40.0)

    def read(t: float) -> list[str]:
        return [line for text in subtitles.at(t) for line in text.get_text().split("\n")]

    assert read(0.5) == ["pierrot: Good evening!"]
    assert read(1.5) == ["pierrot: Good evening!", "doctor: Ah!"]
    assert read(2.0) == ["doctor: Ah!"]
    assert read(3.5) == []
    assert read(4.0) == ["A bell rings"]


def test_captions_leave_space_for_the_picture(puppet, tmp_path):
    """Several simultaneous captions are written smaller, and none is lost."""
    words = "all of us say " + "quite " * 30
    captions = [Caption(0.0, 2.0, words, f"player_{k}") for k in range(9)]
    low = Subtitles(captions, 320, 6.0, 96.0)
    assert 0.0 < low.height <= 96.0
    low.place(Sheet((320, 240), theme_of("light")), 10.0)
    (text,) = low.at(1.0)
    assert all(f"player_{k}: all of us" in text.get_text() for k in range(9))
    film = view.film(*puppet, tmp_path / "a.mp4", captions=captions, fps=2, size=(320, 240))
    assert film.stat().st_size > 0


def test_files_without_sound_are_refused(beep, puppet, tmp_path):
    assert sound_duration(beep.path) == pytest.approx(0.5, abs=0.01)
    text = tmp_path / "words.wav"
    text.write_text("#EXTM3U\nhttp://127.0.0.1:9/a.wav\n", encoding="utf-8")
    with pytest.raises(MediaError, match="no sound that can be read"):
        sound_duration(text)
    with pytest.raises(MediaError, match=r"ends in '\.mid'"):
        sound_duration(tmp_path / "a.mid")
    with pytest.raises(view.FilmError, match="Invalid data"):
        view.film(*puppet, tmp_path / "a.mp4", sounds=[Sound(text, 0.0, 1.0, 1.0)], **options())
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".wav", ".wav"]


@pytest.mark.parametrize("ending", ["mp3", "ogg", "flac"])
def test_other_formats_are_read(beep, tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    command = [FFMPEG, "-v", "error", "-i", f"file:{beep.path}", str(path)]
    subprocess.run(command, check=True, capture_output=True)
    assert sound_duration(path) == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize("size", [(160, 120), (320, 240), (426, 240)])
def test_captions_take_a_fifth_of_small_films_at_most(puppet, tmp_path, size):
    """Regression: they covered a third of the film's height."""
    m, run = puppet
    still = run.resample(np.zeros(2)).q_D[:1]
    still = replace(run, q_D=np.repeat(still, len(run), axis=0))
    words = "Ladies and gentlemen, tonight we show you a tale of love and of strings, in two acts"
    captions = [Caption(1.0, 2.0, words, "pierrot"), Caption(1.0, 2.0, "Hush!", "columbine")]
    film = view.film(m, still, tmp_path / "a.mp4", captions=captions, fps=1, size=size)
    without, with_captions = frame_pixels(film)
    changed = np.abs(with_captions - without).max(axis=(1, 2)) > 60.0
    rows = np.flatnonzero(changed[size[1] // 3 :]) + size[1] // 3  # below the clock
    assert 0.1 * size[1] < np.ptp(rows) <= 0.2 * size[1]


def test_captions_are_written_for_players(tmp_path):
    captions = [
        Caption(3661.5, 3662.0, "Late"),
        Caption(1.0, 2.5, "Good evening!\n\n2\nladies", "pierrot"),
        Caption(2.0, 4.0, "Ah!"),
        Caption(0.0, 0.5, "Early"),
    ]
    path = view.save_captions(captions, tmp_path / "a.srt", 1.5, 4000.0)
    assert path.read_text(encoding="utf-8") == (
        "1\n00:00:00,000 --> 00:00:01,000\npierrot: Good evening! 2 ladies\n\n"
        "2\n00:00:00,500 --> 00:00:02,500\nAh!\n\n"
        "3\n01:01:00,000 --> 01:01:00,500\nLate\n"
    )
    read = [FFMPEG, "-v", "error", "-i", str(path), "-f", "webvtt", "pipe:1"]
    shown = subprocess.run(read, capture_output=True, check=True, text=True).stdout
    assert "00:00.000 --> 00:01.000\npierrot: Good evening! 2 ladies" in shown
