"""``fantoccini play``: cue times, report, film, exit codes and mistakes."""

from __future__ import annotations

import json
import subprocess
import time
import wave
from pathlib import Path

import pytest
from tests.cli.command import fantoccini, mistake
from tests.plays.tiny import OPTIONAL_TOUCHING_CUES, TOUCHING_CUES, write_play

import fantoccini as fan
from fantoccini.base.media import ffmpeg
from fantoccini.kernel.build import ArrayStore
from fantoccini.output import reports, view
from fantoccini.theatre.cast import result_cache

pytestmark = pytest.mark.medium


@pytest.fixture(autouse=True)
def kept(tmp_path, monkeypatch):
    """No test uses the runs that another one has kept on disk."""
    monkeypatch.setattr(result_cache, "RESULTS", ArrayStore(str(tmp_path / "kept")))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("play")


@pytest.fixture(scope="module")
def played(folder):
    """The command with every kind of output."""
    out = [f"--out={folder / name}" for name in ("run.npz", "run.png", "run.mp4")]
    with wave.open(str(folder / "drum.wav"), "wb") as sound:
        sound.setparams((1, 2, 8000, 8000, "NONE", ""))
        sound.writeframes(bytes(16000))
    path = write_play(folder, extra_keys="sound: drum.wav\n")
    report, look = f"--report={folder / 'page.html'}", ["--size", "240x180", "--fps", "4"]
    return fantoccini("play", path, report, *out, *look)


def test_a_valid_play_ends_with_0_and_prints_its_cue_times(played):
    assert played.exit_code == 0, played.stderr
    lines = [line.split() for line in played.stdout.splitlines()]
    assert ["First", "<act>,", "from", "0.00", "s"] in lines
    assert ["1", "14", "hop.yaml", "one", "0.50", "0.50", "+0"] in lines
    assert ["2", "15", "hop.yaml", "(top)", "two", "2.00", "2.00", "+0"] in lines
    assert "2 players, 6 degrees of freedom, 2 strings, 6 driven coordinates" in played.stdout
    assert "2 of 2 cues can be done" in played.stdout
    assert "the run meets every requirement" in played.stdout
    assert {"1 caption", "drum.wav from 0.00 s for 1.00 s"} <= set(played.stdout.splitlines())


def test_progress_names_the_present_task(played):
    lines = played.stderr.splitlines()
    assert lines[0] == "casting"
    for step in ("rehearsing", "looking for touches", "simulating and measuring"):
        assert any(line.startswith(step) for line in lines)


def test_every_output_is_written(played, folder):
    run = fan.Trajectory.load(folder / "run.npz")
    assert run.t[-1] == pytest.approx(3.5, abs=0.01)
    assert (folder / "run.png").read_bytes().startswith(b"\x89PNG")
    film = [ffmpeg(), "-hide_banner", "-i", str(folder / "run.mp4")]
    streams = subprocess.run(film, capture_output=True, text=True).stderr
    assert "Video: h264" in streams and "Audio: aac" in streams
    assert (folder / "page.html").read_text(encoding="utf-8").endswith("</html>\n")
    assert not list(folder.glob("*.part"))


@pytest.mark.parametrize(
    ("options", "captions", "shots", "look"),
    [
        ((), True, 1, None),
        (("--look", "stage"), False, 1, "stage"),
        (("--look", "stage", "--captions", "--view", "front"), True, 0, "stage"),
        (("--no-captions",), False, 1, None),
    ],
)
def test_a_film_on_a_stage_has_captions_only_if_asked(
    folder, tmp_path, monkeypatch, options, captions, shots, look
):
    film_arguments = {}

    def film(marionette, run, path, **arguments):
        film_arguments.update(arguments)
        path.touch()

    monkeypatch.setattr(view, "film", film)
    path = write_play(folder, extra_keys="    camera: [{at: one}]\n")
    result = fantoccini("play", path, "--out", tmp_path / "a.mp4", *options)
    assert result.exit_code == 0, result.stderr
    assert bool(film_arguments.get("captions")) is captions
    assert len(film_arguments.get("shots", ())) == shots
    assert film_arguments.get("look") == look


def test_a_cue_that_cannot_be_done_ends_with_1_and_its_line(tmp_path):
    path = write_play(tmp_path, TOUCHING_CUES)
    result = fantoccini("play", path, "--report", tmp_path / "page.html")
    assert result.exit_code == 1
    assert f"{path}:15: acts[0].cues[1]: one: sway.yaml cannot be done" in result.stderr
    assert "cannot be done" in result.stdout
    assert "1 of 2 cues can be done" in result.stdout
    assert "cannot be done: " in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_an_omitted_optional_cue_is_reported_and_ends_with_0(tmp_path):
    result = fantoccini("play", write_play(tmp_path, OPTIONAL_TOUCHING_CUES))
    assert result.exit_code == 0
    assert "acts[0].cues[1]: one: sway.yaml is left out" in result.stderr


def test_the_verdict_is_printed_before_the_report_and_the_film_are_written(tmp_path, monkeypatch):
    """Regression: it was printed only after them, and not at all if one failed."""

    def fails(*_, **__):
        raise fan.errors.PictureError("no room on the disk")

    monkeypatch.setattr(reports, "play_report", fails)
    result = fantoccini(
        "play", write_play(tmp_path, TOUCHING_CUES), "--report", tmp_path / "page.html"
    )
    assert result.exit_code != 0
    assert "1 of 2 cues can be done" in result.stdout
    assert "one: sway.yaml cannot be done" in result.stderr


def test_a_play_at_its_time_limit_is_reported(tmp_path):
    began = time.monotonic()
    result = fantoccini("play", write_play(tmp_path, TOUCHING_CUES), "--within", "0")
    assert result.exit_code == 1
    assert "compiling was stopped after 1 round" in result.stderr
    assert "2 of 2 cues can be done, " in result.stdout and " remarks" in result.stdout
    assert time.monotonic() - began < 60.0


def test_check_names_the_player_who_cannot_walk(tmp_path):
    path = write_play(tmp_path, "      - {who: one, walks to: there}\n")
    message = mistake("check", path)
    assert f"{path}:14: acts[0].cues[0]['walks to']: one cannot do `walks to`" in message


WRONG = {
    "another report": (["--report", "page.pdf"], "page.pdf ends in '.pdf'; allowed: .html"),
    "a report in no folder": (["--report", "no/page.html"], "there is no folder no"),
    "another output": (["--out", "x.txt"], ".npz, .csv"),
    "an output twice": (["--out", "x.npz", "--out", "x.npz"], "is given twice"),
    "a look of nothing": (
        ["--fps", "10"],
        "applies to a film, an animation or a table (.csv), but none is written",
    ),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_mistakes(arguments, message, folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert message in " ".join(mistake("play", write_play(folder), *arguments).split())


def test_a_mistake_of_the_file_ends_with_2(tmp_path):
    path = write_play(tmp_path, "      - {who: three, does: hopp.yaml}\n")
    message = mistake("play", path)
    assert f"{path}:14: acts[0].cues[0].who" in message
    assert message.startswith("casting\n")


def test_a_file_of_another_kind_is_named(tmp_path):
    write_play(tmp_path)
    assert "this is a puppet file; a play has" in mistake("play", tmp_path / "bob.yaml")
    assert "found nothing here" in mistake("play", tmp_path / "none.yaml")


def test_check_reads_a_play_and_simulates_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("fantoccini.theatre.plays.compiling.find_touches", None)
    path = write_play(tmp_path)
    result = fantoccini("check", path, "arm2d")
    assert result.exit_code == 0
    first, second, *_ = result.stdout.splitlines()
    assert first.startswith(f"{path}: no mistakes; 2 players, 1 act, 2 cues")
    assert second.startswith("arm2d: no mistakes")
    wrong = write_play(tmp_path, "      - {who: one, does: hopp}\n      - {who: two, dos: hop}\n")
    assert f"{wrong}:15: acts[0].cues[1].dos" in mistake("check", wrong)
    assert "applies to puppets" in mistake("check", wrong, "--inputs", wrong)


def test_the_schema_of_plays_is_json():
    schema = json.loads(fantoccini("schema", "play").stdout)
    assert {"play", "cast", "acts"} <= set(schema["properties"])
