"""Scores: lanes and beats, delays, bounds, marks, and mistakes with their places."""

from __future__ import annotations

import subprocess
import wave
from pathlib import Path

import imageio_ffmpeg
import jsonschema
import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError
from fantoccini.theatre.script import is_score, score_schema

pytestmark = pytest.mark.medium

HEAD = """\
score: number
tempo: 100
speed: 1.2
acceleration: 12
marks: {turn: 24}
lanes:
"""
LANES = (
    """\
  legs:
    - {gesture: march, at: 2, lasts: 4, repeat: 4}
""",
    """\
  right arm:
    - {gesture: wave, on: {first: 8}, repeat: 2}
    - {gesture: point, at: turn - 4, mirrored: true}
""",
    """\
  body:
    - {gesture: bow, on: {low: turn + 2}}
""",
)
NUMBER = f"""{HEAD}{"".join(LANES)}\
captions:
  - {{at: 2, until: 6, text: Left and right}}
"""


def write_score(tmp_path, text: str):
    path = tmp_path / "number.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def find_cue(score: fan.theatre.Score, gesture: str):
    return next(cue for cue in score.cues if cue.gesture == gesture)


def test_gestures_are_on_their_beats(marionette, tmp_path):
    path = write_score(tmp_path, NUMBER)
    score = fan.load_score(marionette, path)
    assert score and is_score(path) and score.beat == pytest.approx(0.6)
    assert find_cue(score, "wave").marks["first"] == pytest.approx(8 * 0.6)
    assert find_cue(score, "bow").marks["low"] == pytest.approx(26 * 0.6)
    assert find_cue(score, "point").start == pytest.approx(20 * 0.6)
    march = find_cue(score, "march")
    assert march.start == pytest.approx(1.2)
    assert march.end == pytest.approx(1.2 + 4 * 4 * 0.6)
    assert score.marks == {"turn": pytest.approx(14.4)}
    assert score.captions[0].start == pytest.approx(1.2)
    assert score.duration == pytest.approx(find_cue(score, "bow").end)


def test_lanes_add_up(marionette, tmp_path):
    """The result is the sum of the lanes' motions, each in a score of its own, at every time."""
    x0 = marionette.rest()
    whole = fan.load_score(marionette, write_score(tmp_path, NUMBER)).inputs(x0)
    t = np.linspace(0.0, whole.end, 301)
    total = np.zeros((len(t), marionette.coordinates.n_qK))
    for lane in LANES:
        motion = fan.load_score(marionette, write_score(tmp_path, HEAD + lane)).inputs(x0)
        total += motion.evaluate(t)[0] - x0.q_K
    np.testing.assert_allclose(whole.evaluate(t)[0] - x0.q_K, total, atol=1e-12)


def test_delayed_cues_are_reported(marionette, tmp_path):
    text = """\
score: late
lanes:
  body:
    - {gesture: sit, at: 0}
    - {gesture: bow, at: 1.3}
"""
    score = fan.load_score(marionette, write_score(tmp_path, text))
    assert not score and len(score.changes) == 1
    change = str(score.changes[0])
    assert "number.yaml:5" in change and "instead of at 1.30 s" in change and "after sit" in change
    bow = find_cue(score, "bow")
    assert bow.start > 1.3 and f"at {bow.start:.2f} s" in change


def test_a_cue_before_the_end_of_another_waits_for_it(marionette, tmp_path):
    text = "score: late\nlanes: {body: [{gesture: wave, at: 0}, {gesture: bow, at: 1}]}\n"
    (change,) = fan.load_score(marionette, write_score(tmp_path, text)).changes
    assert "bow begins at 3.80 s instead of at 1.00 s: wave ends at 3.80 s" in str(change)


def test_gestures_with_different_ends_take_longer_to_repeat(marionette, tmp_path):
    text = "score: late\nlanes: {body: [{gesture: sit, lasts: 4, repeat: 3}]}\n"
    score = fan.load_score(marionette, write_score(tmp_path, text))
    (change,) = score.changes
    assert f"sit takes {score.duration:.2f} s instead of 12.00 s" in str(change)


def test_cues_after_the_end_are_reported(marionette, tmp_path):
    text = """\
score: short
lanes: {body: [{gesture: nod}]}
marks: {never: 500}
captions: [{at: 1, until: 200, text: Too late}]
"""
    changes = fan.load_score(marionette, write_score(tmp_path, text)).changes
    assert [change.line for change in changes] == [3, 4]


def test_an_exceeded_bound_is_reported_for_each_cue(marionette, tmp_path):
    text = """\
score: blame
speed: 3
acceleration: 12
lanes:
  head:
    - {gesture: nod}
  legs:
    - {gesture: march, lasts: 0.6}
    - {gesture: march}
    - {gesture: march, lasts: 0.5, at: 3}
"""
    changes = fan.load_score(marionette, write_score(tmp_path, text)).changes
    lines = sorted({change.line for change in changes})
    assert lines == [8, 10] and all("knee_" in str(change) for change in changes)
    # A bound just above the largest acceleration is kept.
    bow = fan.theatre.load_gesture(marionette, "bow")
    bound = 1.003 * bow.peaks[1].max()
    text = f"score: near\nacceleration: {bound}\nlanes: {{body: [{{gesture: bow}}]}}\n"
    assert fan.load_score(marionette, write_score(tmp_path, text))


def test_exceeded_bounds_are_reported(marionette, tmp_path):
    text = NUMBER.replace("lasts: 4", "lasts: 1")
    score = fan.load_score(marionette, write_score(tmp_path, text))
    assert not score
    for change in score.changes:
        assert "number.yaml:8" in str(change) and "the bound is 12" in str(change)
    _, _, acceleration = score.inputs(marionette.rest()).evaluate(np.linspace(0.0, 5.0, 5001))
    assert np.abs(acceleration).max() > 12.0
    good = fan.load_score(marionette, write_score(tmp_path, NUMBER)).inputs(marionette.rest())
    _, speed, acceleration = good.evaluate(np.linspace(0.0, good.end, 20001))
    assert np.abs(speed).max() <= 1.2 and np.abs(acceleration).max() <= 12.0


def test_gestures_may_be_in_the_folder_of_the_score(marionette, tmp_path):
    (tmp_path / "lift.yaml").write_text(
        "gesture: lift\nmoves: {hand_left.up: [[0, 0], [1, 9 cm]]}\n", encoding="utf-8"
    )
    text = "score: own\nlanes: {arm: [{gesture: lift.yaml, larger: 2}]}\n"
    score = fan.load_score(marionette, write_score(tmp_path, text))
    x0 = marionette.rest()
    offsets = score.inputs(x0).evaluate(1.0)[0] - x0.q_K
    i = marionette.coordinates.q_K.index("hand_left.length")
    assert offsets[i] == pytest.approx(-0.18) and np.count_nonzero(offsets) == 1


def test_files_in_the_folder_may_be_named_without_their_ending(marionette, tmp_path):
    """`{gesture: wag}` did not find wag.yaml; a file of another kind is no gesture."""
    lift = "gesture: lift\nmoves: {hand_left.up: [[0, 0], [1, 9 cm]]}\n"
    (tmp_path / "lift.yaml").write_text(lift, encoding="utf-8")
    (tmp_path / "bow.yaml").write_text("score: bow\nlanes: {arm: [{gesture: bow}]}\n")
    text = "score: own\nlanes: {arm: [{gesture: lift}], body: [{gesture: bow, at: 2}]}\n"
    score = fan.load_score(marionette, write_score(tmp_path, text))
    assert len(find_cue(score, "lift").marks) == 0 and find_cue(score, "bow").marks
    (tmp_path / "bow.yaml").write_text(lift.replace("lift", "bow"))
    message = "'bow' is bow.yaml and a bundled gesture; write bow.yaml for the file, or rename it"
    with pytest.raises(FileError, match=f"number.yaml:2: lanes.body.0..gesture: {message}"):
        fan.load_score(marionette, write_score(tmp_path, text))
    (tmp_path / "lift.yml").write_text(lift, encoding="utf-8")
    with pytest.raises(FileError, match=r"'lift' is lift\.yaml and lift\.yml; write"):
        fan.load_score(marionette, write_score(tmp_path, text))
    with pytest.raises(FileError, match="no bundled gesture, is called 'lfit'"):
        fan.load_score(
            marionette, write_score(tmp_path, text.replace("gesture: lift", "gesture: lfit"))
        )


def test_the_schema_takes_scores_and_refuses_others(tmp_path):
    schema = score_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(read_file(write_score(tmp_path, NUMBER)).data, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"score": "x", "lanes": {"a": [{"gestur": "bow"}]}}, schema)


def write_silence(path, seconds: float) -> None:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(2 * int(8000 * seconds)))


def test_sounds_are_in_the_folder_of_the_score(marionette, tmp_path):
    write_silence(tmp_path / "a.wav", 1.5)
    for text, starts in (
        ("sound: a.wav\n", [0.0]),
        ("sound: {file: a.wav, at: turn, gain: 0.5}\n", [14.4]),
        ("sound: [{file: a.wav}, {file: a.wav, at: wave.up}]\n", [0.0, (8.0 - 0.25 / 0.6) * 0.6]),
    ):
        score = fan.load_score(marionette, write_score(tmp_path, NUMBER + text))
        jsonschema.validate(read_file(tmp_path / "number.yaml").data, score_schema())
        assert [sound.start for sound in score.sounds] == pytest.approx(starts)
        assert all(sound.path.samefile(tmp_path / "a.wav") for sound in score.sounds)
        assert score.sounds[0].duration == pytest.approx(1.5, abs=0.01)
        assert score.sounds[0].gain == (0.5 if "gain" in text else 1.0)
    late_sound = "sound: {file: a.wav, at: 90}\n"
    (change,) = fan.load_score(marionette, write_score(tmp_path, NUMBER + late_sound)).changes
    assert change.line == 16 and "the score ends" in str(change)


@pytest.mark.parametrize(
    ("sound", "message"),
    [
        ("sound: b.wav", "no file of this file's folder is called 'b.wav'"),
        ("sound: ../a.wav", "no file of this file's folder"),
        ("sound: number.yaml", r"ends in '.yaml'; a sound file ends in .wav, .mp3"),
        ("sound: broken.mp3", "broken.mp3 is no sound that can be read"),
        ("sound: [{file: a.wav, at: tun}]", "did you mean 'turn'"),
        ("sound: [{file: a.wav, gain: -1}]", "found -1"),
        ("sound: [{file: a.wav, loud: 1}]", "this key is not known"),
        ("sound: 3", "needed: a list"),
    ],
)
def test_mistakes_in_sounds_have_places(marionette, tmp_path, sound, message):
    write_silence(tmp_path / "a.wav", 0.5)
    (tmp_path / "broken.mp3").write_bytes(b"no sound")
    with pytest.raises(FileError, match=message) as error:
        fan.load_score(marionette, write_score(tmp_path, NUMBER + sound + "\n"))
    assert "number.yaml:16: sound" in str(error.value)


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("gesture: bow", "gesture: bwo"), 13, "did you mean 'bow'"),
        (("turn - 4", "tun - 4"), 11, "did you mean 'turn'"),
        (("{first: 8}", "{furst: 8}"), 10, "did you mean 'first'"),
        (("{first: 8}", "{first: 1}"), 10, "before the score"),
        (("turn - 4", "turn - 40"), 11, "before the score"),
        (("at: 2, lasts: 4", "at: 2, on: {left: 3}"), 8, "both `at` and `on`"),
        (("lasts: 4", "lasts: 4, faster: 2"), 8, "both `lasts` and `faster`"),
        (("{first: 8}", "{first: 8, second: 9}"), 10, "found 2 marks"),
        (("repeat: 4", "repeat: 0"), 8, "greater than or equal to 1"),
        (("tempo: 100", "tempo: 0"), 2, "from 0.001 to 1000"),
        (("tempo: 100", "tempo: 1e308"), 2, "from 0.001 to 1000"),
        (("at: 2, ", "at: 1e300, "), 8, "needed: a time, or one by name"),
        (("at: 2, ", "at: .nan, "), 8, "needed: a time, or one by name"),
        (("at: 2, ", "larger: 1e300, "), 8, "from 0.001 to 1000"),
        (("acceleration: 12", "acceleration: {hand_right.z: 1}"), 4, "did you mean 'hand_right.y'"),
        (("acceleration: 12", "acceleration: 1e-9"), 4, "at least 1e-06"),
        (("marks:", "duration: -4\nmarks:"), 5, "positive"),
        (("{first: 8}, ", "{first: 8}, larger: 20, "), 10, "hand_right.length: is -"),
        (("speed: 1.2", "speed: {hand_rigt.x: 1}"), 3, "did you mean 'hand_right.x'"),
        (("until: 6", "until: 1"), 15, "ends on beat 1"),
        (("gesture: bow", "gesture: ../../etc/passwd"), 13, "no gesture file in this one's folder"),
    ],
)
def test_mistakes_have_places(marionette, tmp_path, change, line, message):
    assert change[0] in NUMBER
    path = write_score(tmp_path, NUMBER.replace(*change))
    with pytest.raises(FileError, match=message) as error:
        fan.load_score(marionette, path)
    assert f"number.yaml:{line}" in str(error.value)


def test_a_score_is_an_input_of_the_command_line(tmp_path):
    write_silence(tmp_path / "a.wav", 1.0)
    sounds_and_waits = "sound: a.wav\nwaits: {curtain: {at: 1, loop: 0}}\n"
    path = write_score(tmp_path, NUMBER.replace("lasts: 4", "lasts: 1") + sounds_and_waits)
    check_result = fantoccini("check", "marionette", "--inputs", str(path))
    assert check_result.exit_code == 0 and "the bound is 12" in check_result.stderr
    assert "waits for GO at curtain, 0.60 s, repeating from 0.00 s" in check_result.stdout
    assert (
        "a.wav from 0.00 s for 1.00 s" in check_result.stdout
        and "1 caption\n" in check_result.stdout
    )
    out = tmp_path / "run.npz"
    done = fantoccini(
        "simulate",
        "marionette",
        "--inputs",
        str(path),
        "--method",
        "timestepping",
        "--out",
        str(out),
    )
    assert done.exit_code == 0 and "the bound is 12" in done.stderr
    run = fan.Trajectory.load(out)
    assert run.t[0] == 0.0 and run.t[-1] == pytest.approx(26 * 0.6 + 1.7)
    assert "waits for GO at curtain" in done.stdout
    for kind in ("gesture", "score"):
        assert fantoccini("schema", kind).exit_code == 0


def test_check_calls_an_exceeded_bound_a_warning(marionette, tmp_path):
    """It counted "1 warning" below a line without this word."""
    number = write_score(tmp_path, NUMBER.replace("lasts: 4", "lasts: 1"))
    result = fantoccini("check", "marionette", "--inputs", number)
    lines = [line for line in result.stderr.splitlines() if "the bound is 12" in line]
    assert lines and all(line.startswith(f"{number}:8: ") for line in lines)
    assert all(": warning: " in line for line in result.stderr.splitlines())
    assert f"{len(result.stderr.splitlines())} warning" in result.stdout


def test_on_beat_rehearses_scores_only(tmp_path):
    quick = "score: q\nlanes: {legs: [{gesture: march}]}\n"
    done = fantoccini(
        "simulate",
        "marionette",
        "--inputs",
        write_score(tmp_path, quick),
        "--on-beat",
        "--method",
        "timestepping",
    )
    assert done.exit_code == 0 and "knee_left" in done.stdout and "rehearsed" in done.stdout
    assert "no --inputs are given" in mistake("simulate", "marionette", "--on-beat")
    start = ("simulate", "marionette", "--on-beat", "--start", "elbow_left=0.1")
    assert "--start is given" in mistake(*start, "--inputs", write_score(tmp_path, quick))
    greeting = Path(fan.puppets.path("marionette")).parent / "performances" / "greeting.yaml"
    output = mistake("simulate", "marionette", "--on-beat", "--inputs", greeting)
    assert "applies to a score, and" in output


def test_the_command_line_films_scores_with_their_sound(tmp_path):
    write_silence(tmp_path / "a.wav", 0.5)
    text = (
        "score: s\nsound: a.wav\nlanes: {legs: [{gesture: march}]}\n"
        "captions: [{at: march.left, until: march.end, text: Left}]\n"
    )
    film, picture = tmp_path / "a.mp4", tmp_path / "a.gif"
    done = fantoccini(
        "simulate",
        "marionette",
        "--inputs",
        write_score(tmp_path, text),
        "--method",
        "timestepping",
        "--out",
        film,
        "--out",
        picture,
        "--size",
        "96x120",
        "--fps",
        "5",
    )
    assert done.exit_code == 0 and "a .gif is silent" in done.stderr
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", str(film)]
    output = subprocess.run(command, capture_output=True, text=True, check=False).stderr
    assert "Audio: aac" in output and "Video: h264" in output
