"""`--from` and `--to`, and captions as files."""

from __future__ import annotations

import json
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake
from tests.plays.tiny import write_play

import fantoccini as fan

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def swung(tmp_path_factory) -> Path:
    """Saved run of two seconds."""
    path = tmp_path_factory.mktemp("run") / "run.npz"
    start = ("--start", "bob.x=0.5", "--start", "bob.z=0.6", "--duration", "2")
    assert (
        fantoccini("simulate", "string_pendulum", *start, "--quiet", "--out", path).exit_code == 0
    )
    return path


def film_duration(film: Path) -> float:
    """Duration of a film."""
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(film))
    return frames / 10.0


def test_a_part_is_exported_in_every_format(swung, tmp_path):
    part = ("--from", "0.5", "--to", "1.25")
    for name in ("part.npz", "part.csv", "part.mp4", "part.glb"):
        fps = ("--fps", "10") if name == "part.mp4" else ()
        done = fantoccini("export", swung, tmp_path / name, *part, *fps, "--quiet")
        assert done.exit_code == 0, done.stderr
    whole, run = fan.Trajectory.load(swung), fan.Trajectory.load(tmp_path / "part.npz")
    assert (run.t[0], run.t[-1]) == (0.5, 1.25)
    assert np.allclose(run.q_D[0], whole.at(0.5).q_D, atol=1e-12)
    rows = (tmp_path / "part.csv").read_text().splitlines()
    assert [float(rows[k].split(",")[0]) for k in (1, -1)] == [0.5, 1.25]
    assert film_duration(tmp_path / "part.mp4") == pytest.approx(0.75, abs=0.11)
    content = (tmp_path / "part.glb").read_bytes()
    size = int.from_bytes(content[12:16], "little")
    scene = json.loads(content[20 : 20 + size])
    keys = [scene["accessors"][x["input"]] for x in scene["animations"][0]["samplers"]]
    assert min(key["min"][0] for key in keys) == 0.0
    assert max(key["max"][0] for key in keys) == pytest.approx(0.75, abs=1e-6)


def test_the_ends_of_the_motion_may_be_left_out(swung, tmp_path):
    assert fantoccini("export", swung, tmp_path / "a.npz", "--from", "1.5").exit_code == 0
    assert fantoccini("export", swung, tmp_path / "b.npz", "--to", "0.5").exit_code == 0
    a, b = (fan.Trajectory.load(tmp_path / name) for name in ("a.npz", "b.npz"))
    assert (a.t[0], a.t[-1], b.t[0], b.t[-1]) == (1.5, 2.0, 0.0, 0.5)


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (("--from", "2.5"), "--from: found 2.5 s; the motion lasts from 0 s to 2 s"),
        (("--from", "-1"), "--from: found -1 s; the motion lasts from 0 s to 2 s"),
        (("--to", "7"), "--to: found 7 s; the motion lasts from 0 s to 2 s"),
        (("--from", "1", "--to", "1"), "--to: found 1 s to 1 s; needed: an end after the begin"),
        (("--from", "nan"), "--from: found nan; needed: a time in seconds"),
    ],
)
def test_times_outside_of_the_motion_are_mistakes(swung, tmp_path, part, expected):
    message = " ".join(mistake("export", swung, tmp_path / "a.glb", *part).split())
    assert expected in message.replace("Invalid value for ", "").replace("'", "")
    assert not list(tmp_path.iterdir())


def test_times_are_checked_before_simulating(tmp_path):
    common = ("simulate", "string_pendulum", "--duration", "3000")
    message = mistake(*common, "--out", tmp_path / "a.mp4", "--from", "1", "--to", "3001")
    assert "the motion lasts from 0 s to 3000 s" in " ".join(message.split())
    assert "applies to the files of --out" in " ".join(mistake(*common, "--to", "1").split())


def test_a_film_of_a_part_and_its_captions(tmp_path):
    play = write_play(tmp_path)
    films = [f"--out={tmp_path / name}" for name in ("a.mp4", "a.srt", "b.srt")]
    look = ("--size", "160x120", "--fps", "10", "--from", "0.75", "--to", "2.5")
    done = fantoccini("play", play, *films, *look)
    assert done.exit_code == 0, done.stderr
    assert film_duration(tmp_path / "a.mp4") == pytest.approx(1.75, abs=0.11)
    captions = fan.load_play(play).score.captions
    assert captions[0].start == pytest.approx(0.5)
    end = round(1000 * (min(captions[0].end, 2.5) - 0.75))
    text = (tmp_path / "a.srt").read_text(encoding="utf-8")
    assert text == f"1\n00:00:00,000 --> 00:00:0{end // 1000},{end % 1000:03}\none: <Hop> & hop\n"
    assert (tmp_path / "b.srt").read_text(encoding="utf-8") == text


def test_a_film_beside_its_captions_does_not_show_them_twice(tmp_path):
    play, look = write_play(tmp_path), ("--size", "160x120", "--fps", "4", "--quiet")
    for name in ("alone", "beside", "asked"):
        files = [f"--out={tmp_path / name}.mp4"]
        files += [] if name == "alone" else [f"--out={tmp_path / name}.srt"]
        files += ["--captions"] if name == "asked" else []
        assert fantoccini("play", play, *files, *look).exit_code == 0
    frames = {}
    for name in ("alone", "beside", "asked"):
        reader = imageio_ffmpeg.read_frames(str(tmp_path / f"{name}.mp4"))
        next(reader)
        frames[name] = np.frombuffer([*reader][3], np.uint8).astype(float)  # at 0.75 s
    assert np.abs(frames["alone"] - frames["beside"]).max() > 60.0
    assert np.array_equal(frames["alone"], frames["asked"])


def test_captions_are_those_of_scores_and_plays(swung, tmp_path):
    out = tmp_path / "a.srt"
    message = mistake("simulate", "string_pendulum", "--out", out)
    assert "there are no captions; scores and plays can have some" in " ".join(message.split())
    assert ".srt" in mistake("export", swung, out)


SHIFT = """\
task: shift
puppet: crane
start: {trolley: 0}
end: {trolley: 0.1}
duration: 2
bounds: {acceleration: 2}
interval: 0.2
step: 0.05
"""
RAISE = """\
problem: raise
puppet: arm2d
start: {hand.length: 0.8}
goal:
  pose: {elbow: 40 deg}
tolerance: 0.3
"""


@pytest.mark.parametrize(
    ("command", "text", "options"),
    [
        ("optimise", SHIFT, ("--tolerance", "1e-3")),
        ("plan", RAISE, ("--no-confirm", "--threads", "1")),
    ],
    ids=["optimise", "plan"],
)
def test_a_part_of_a_search_is_written(command, text, options, tmp_path):
    (tmp_path / "given.yaml").write_text(text)
    names = ("whole.npz", "part.npz", "part.csv", "part.mp4")
    whole, part, table, film = (tmp_path / name for name in names)
    search = (command, tmp_path / "given.yaml", *options, "--quiet", "--out")
    assert fantoccini(*search, whole).exit_code == 0
    run = fan.Trajectory.load(whole)
    begin, end = (round(share * run.duration, 3) for share in (0.25, 0.75))
    more_files = ("--out", table, "--out", film, "--fps", "10", "--size", "64x48")
    done = fantoccini(*search, part, *more_files, "--from", begin, "--to", end)
    assert done.exit_code == 0, done.stderr
    run_part = fan.Trajectory.load(part)
    assert (run_part.t[0], run_part.t[-1]) == (begin, end)
    assert run_part.q_D[0] == pytest.approx(run.at(begin).q_D, abs=1e-9)
    rows = table.read_text().splitlines()
    times = [float(rows[k].split(",")[0]) for k in (1, -1)]
    assert times == pytest.approx([begin, end], abs=0.1 + 1e-9)
    assert film_duration(film) == pytest.approx(end - begin, abs=0.11)


def test_times_beyond_a_search_are_reported(tmp_path):
    """An optimised motion has a duration before the search, a plan only after it."""
    for name, text in (("shift", SHIFT), ("raise", RAISE)):
        (tmp_path / f"{name}.yaml").write_text(text)
    out = tmp_path / "part.npz"
    message = mistake("optimise", tmp_path / "shift.yaml", "--out", out, "--to", "3")
    assert "the motion lasts from 0 s to 2 s" in " ".join(message.split())
    assert not out.exists() and "optimising" not in message
    done = fantoccini("plan", tmp_path / "raise.yaml", "--no-confirm", "--out", out, "--to", "99")
    assert done.exit_code == 1
    assert "; the files contain the whole motion" in " ".join(done.stderr.split())
    assert fan.Trajectory.load(out).t[0] == 0.0


def test_follow_follows_a_part_of_the_clip(tmp_path):
    message = mistake("follow", "jumps", "marionette", "--from", "1000")
    assert "--from" in message and "the motion lasts from 0 s to" in " ".join(message.split())
    marionette, clip = fan.puppets.marionette(), fan.theatre.load_bvh("jumps")
    placed = fan.theatre.retarget.place_clip(marionette, clip, begin=1.0, end=2.0)
    frames = (clip.t >= 1.0 - 1e-6) & (clip.t <= 2.0 + 1e-6)
    assert np.array_equal(placed.clip.t, clip.t[frames])
    assert placed.clip.unit == clip.upright().unit
    with pytest.raises(fan.errors.StateError, match="needed: two frames or more"):
        clip.between(1.0, 1.0 + 1e-9)
