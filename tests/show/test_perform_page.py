"""The page as an instrument, without a browser: gestures, takes, a score, the beat and sound."""

from __future__ import annotations

import json
import time
import wave
from types import SimpleNamespace

import numpy as np
import pytest
from tests.show.browser import until
from tests.show.viewer import Viewer
from websockets.sync.client import connect

import fantoccini as fan
from fantoccini.app.live.gesture_player import GestureOptions
from fantoccini.theatre.perform.player import MotionPlayer

pytestmark = pytest.mark.slow

SCORE = """\
score: number
tempo: 120
marks: {turn: 6}
lanes:
  arm: [{gesture: wave, at: 1}]
  head: [{gesture: nod, at: turn}]
waits: {applause: {at: 12}}
captions: [{at: 0, until: 20, text: "<b>One</b>, two"}]
sound: bell.wav
"""


def bell(path) -> None:
    """A second of a tone."""
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 8000, 8000, "NONE", ""))
        tone = np.sin(2 * np.pi * 440 * np.arange(8000) / 8000)
        file.writeframes((8000 * tone).astype("<i2").tobytes())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("performed")
    bell(path / "bell.wav")
    (path / "number.yaml").write_text(SCORE, encoding="utf-8")
    (path / "curtsy.yaml").write_text(
        "gesture: curtsy\nmoves: {knee_left.up: [[0, 0], [0.5, 5 cm], [1, 0]]}\n"
    )
    (path / "wrong.yaml").write_text("gesture: wrong\nmoves: {kne.up: [[0, 0], [1, 5 cm]]}\n")
    return path


@pytest.fixture(scope="module")
def scene(folder):
    page = fan.show(
        fan.puppets.marionette(),
        port=0,
        browser=False,
        wait=False,
        record_to=folder,
        score=folder / "number.yaml",
    )
    with page, Viewer(page.url) as viewer:
        assert page.view.stage.gesture_player.tempo.bpm == 120.0
        yield SimpleNamespace(
            page=page,
            live=page.view,
            stage=page.view.stage,
            viewer=viewer,
            folder=folder,
            performance=page.view.performance,
        )


@pytest.fixture(autouse=True)
def quiet(request):
    """Every test begins at the start, with nothing played and free strings."""
    if "scene" in request.fixturenames:
        live = request.getfixturevalue("scene").live
        live.holder.release(live.holder.viewer)
        live.enqueue(None, live.reset)
        until(live.jobs.empty, "the jobs are done")


def record_take(scene, seconds: float = 0.6) -> str:
    """Record a hand that moves to and fro; returns the name of the take."""
    before = scene.stage.takes.names
    scene.viewer.press("Record")
    until(lambda: scene.live.recorder.running, "it records")
    home = scene.performance.place("hand_left")[0]

    def passed() -> bool:
        t = scene.live.recorder.time
        scene.performance.move("hand_left", home + np.array([0.04 * np.sin(8.0 * t), 0.0, 0.0]))
        return t > seconds

    until(passed, "time passes")
    scene.viewer.press("Stop recording")
    until(lambda: len(scene.stage.takes.names) > len(before), "there is a take")
    name = scene.stage.takes.chosen
    until(lambda: (scene.folder / f"{name}.npz").is_file(), "it is written")
    return name


def test_a_button_plays_a_gesture_and_home_reverts_it(scene):
    home = scene.performance.state.q_K
    scene.viewer.pick("C V U", "wave")
    until(lambda: scene.performance.playing == ("wave",), "it waves")
    until(lambda: np.max(np.abs(scene.performance.state.q_K - home)) > 0.05, "the hand is up")
    scene.viewer.wait_for_text("Plays wave")
    scene.viewer.press("Home (H)")
    until(lambda: scene.performance.playing == (), "it is home")
    until(lambda: np.max(np.abs(scene.performance.state.q_K - home)) < 1e-9, "the hands are home")


def test_files_of_the_folder_are_gestures_and_mistakes_are_reported(scene):
    assert "curtsy" in scene.stage.gesture_player.gestures
    scene.viewer.wait_for_text("kne")  # of wrong.yaml
    assert "wrong.yaml" in scene.viewer.text


def test_mirrored_and_repeated_gestures(scene):
    names, home = scene.performance.marionette.coordinates.q_K, scene.performance.state.q_K
    left = [i for i, name in enumerate(names) if name.startswith("hand_left")]
    right = [i for i, name in enumerate(names) if name.startswith("hand_right")]
    scene.viewer.tick("Mirrored", True)
    scene.viewer.tick("Again", True)
    until(lambda: scene.stage.gesture_player.options.repeat, "the boxes are ticked")
    scene.viewer.pick("C V U", "wave")
    until(lambda: scene.performance.playing == ("wave, mirrored",), "it waves")
    until(lambda: np.abs(scene.performance.state.q_K - home)[left].max() > 0.05, "the left hand")
    np.testing.assert_array_equal(scene.performance.state.q_K[right], home[right])
    scene.viewer.pick("C V U", "wave")
    scene.viewer.tick("Mirrored", False)
    scene.viewer.tick("Again", False)
    until(lambda: not scene.stage.gesture_player.options.repeat, "the boxes are clear")
    until(lambda: scene.performance.playing == (), "it ends with the round")


def test_gestures_begin_on_the_beat(scene, monkeypatch):
    tempo, play, begun = scene.stage.gesture_player.tempo, MotionPlayer.play, []

    def play_and_note(player, gesture, **options):
        begins = play(player, gesture, **options)
        begun.append(scene.performance.t - player.t + begins)
        return begins

    monkeypatch.setattr(MotionPlayer, "play", play_and_note)
    scene.viewer.tick("On the beat", True)
    until(lambda: scene.stage.gesture_player.options.on_beat, "the box is ticked")
    scene.viewer.slide("Beats a minute", 60.0)
    until(lambda: tempo.bpm == 60.0, "the tempo")
    scene.viewer.pick("7 8 9", "nod")
    until(lambda: scene.performance.playing, "it begins")
    beats = tempo.beat_number(begun[0])
    assert beats == pytest.approx(round(beats), abs=1e-6)
    scene.viewer.tick("On the beat", False)
    until(lambda: not scene.stage.gesture_player.options.on_beat, "the box is clear")


def test_a_take_is_edited_played_kept_and_made_a_gesture(scene):
    name = record_take(scene, 1.0)
    take = scene.stage.takes.take
    until(lambda: name in scene.viewer.options("Take"), "it is listed")
    until(lambda: scene.live.panel.takes.part_of == name, "its part is shown")
    scene.viewer.keep_part("Part [s]", 0.2, 0.7)
    scene.viewer.slide("Smooth [s]", 0.1)
    scene.viewer.slide("Stretch", 2.0)
    until(lambda: scene.stage.takes.edits.stretch == 2.0, "the edits")
    edited = scene.stage.takes.edited()
    expected = take.trimmed(0.2, 0.7).smoothed(0.1).stretched(2.0)
    np.testing.assert_array_equal(edited.acc_K, expected.acc_K)
    scene.viewer.press("Play (L)")
    until(lambda: (scene.performance.take_time or 0.0) > 0.2, "it plays")
    until(lambda: scene.performance.take_time is None, "it ends")
    scene.viewer.type_in("Name", "reach")
    until(lambda: scene.live.panel.takes.name_field.value == "reach", "the name")
    scene.viewer.press("Make a gesture of it")
    until(lambda: "reach" in scene.stage.gesture_player.gestures, "it is a gesture")
    until((scene.folder / "reach.npz").is_file, "its file")
    gesture = fan.theatre.load_gesture(scene.performance.marionette, scene.folder / "reach.npz")
    assert gesture.uses == ("hand_left",)
    assert gesture.duration == pytest.approx(1.0)
    until(lambda: "reach" in str(list(scene.viewer.controls.values())), "its button")
    # Existing names, invalid names and names in other folders are refused.
    for wrong, why in (("reach", "already"), ("../out", "not a valid name"), ("wave", "already")):
        scene.viewer.type_in("Name", wrong)
        until(lambda wrong=wrong: scene.live.panel.takes.name_field.value == wrong, "the name")
        scene.viewer.press("Make a gesture of it")
        scene.viewer.wait_for_text(why)
        scene.live.panel.report("")
    assert not (scene.folder.parent / "out.npz").exists()
    scene.viewer.pick("Save as", "New take")
    until(lambda: scene.live.panel.takes.part_of == f"{name}-edited", "the edited take")
    until((scene.folder / f"{name}-edited.npz").is_file, "its file")
    saved = fan.theatre.Recording.load(scene.folder / f"{name}-edited.npz")
    np.testing.assert_array_equal(saved.acc_K, expected.acc_K)
    scene.viewer.choose("Take", name)
    until(lambda: scene.stage.takes.chosen == name, "the first take")
    assert scene.stage.takes.edits.stretch == 1.0


def test_an_overdub_keeps_the_take_and_adds_the_hands(scene):
    name = record_take(scene)
    take = scene.stage.takes.take
    scene.viewer.tick("hand_right", True)
    until(lambda: scene.stage.armed == {"hand_right"}, "it is armed")
    scene.viewer.press("Overdub (O)")
    until(lambda: scene.performance.take_time is not None, "it plays")
    target = scene.performance.place("hand_right")[0] + [0.04, 0.0, 0.0]
    scene.performance.move("hand_right", target)
    until(lambda: scene.stage.takes.chosen != name, "it ends with the take")
    overdub = scene.stage.takes.take
    names = scene.performance.marionette.coordinates.q_K
    other_columns = [
        i for i, name_of_string in enumerate(names) if not name_of_string.startswith("hand_right")
    ]
    n = min(len(overdub.trajectory), len(take.trajectory))
    assert n >= len(take.trajectory) - 1
    a, b = overdub.trajectory.q_K[:n], take.trajectory.q_K[:n]
    np.testing.assert_allclose(a[:, other_columns], b[:, other_columns], rtol=0, atol=1e-12)
    moved = names.index("hand_right.x")
    assert overdub.trajectory.q_K[-1, moved] > take.trajectory.q_K[-1, moved] + 0.01
    scene.viewer.tick("hand_right", False)
    until(lambda: not scene.stage.armed, "it is not armed")


def test_a_viewer_without_the_strings_changes_nothing(scene, monkeypatch):
    name, stage = record_take(scene), scene.stage
    until(lambda: scene.live.panel.takes.part_of == name, "its part is shown")
    other = stage.takes.names[-1]
    monkeypatch.setattr(scene.live.holder, "max_idle_time", 60.0)
    with Viewer(scene.page.url) as second:
        scene.viewer.tick("On the beat", False)
        until(lambda: scene.live.holder.viewer is not None, "the first holds the strings")
        until(lambda: "Stretch" in str(list(second.controls.values())), "the second sees the page")
        for label in ("Mirrored", "hand_right", "Loop"):
            second.tick(label, True)
        second.slide("Size", 2.0)
        second.slide("Stretch", 3.0)
        second.choose("Take", other)
        takes = scene.live.panel.takes
        until(lambda: second.notices, "it is told")
        time.sleep(0.5)
        assert not stage.armed and stage.takes.chosen == name == takes.choice.value
        assert stage.gesture_player.options == GestureOptions() and stage.takes.edits.stretch == 1.0
        assert takes.stretch.value == 1.0 and not takes.repeat.value
        assert not takes.lane_boxes["hand_right"].value
        assert second.value("Size") == 1.0


def test_a_take_becomes_a_film(scene):
    name = record_take(scene)
    scene.viewer.pick("Save as", "Film")
    until((scene.folder / f"{name}.mp4").is_file, "the film")
    import imageio_ffmpeg

    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(scene.folder / f"{name}.mp4"))
    assert frames == pytest.approx(30.0 * scene.stage.takes.take.duration, abs=1.5)


def test_a_score_waits_for_go_pauses_and_jumps_to_marks(scene):
    performance = scene.performance
    scene.viewer.wait_for_text(", beat 0.0")
    scene.viewer.wait_for_text("Changes to the score:")  # the caption ends after the score
    scene.viewer.press("GO (Space)")
    until(lambda: performance.score is not None and performance.score.t > 0.5, "it begins")
    scene.viewer.wait_for_text("&lt;b&gt;One&lt;/b&gt;, two")  # words, not markup
    assert "<b>One" not in scene.viewer.text
    scene.viewer.press("Pause (Y)")
    until(lambda: performance.score.is_still, "a pause")
    scene.viewer.pick("Go to", "turn")
    until(lambda: performance.score.t == 3.0, "the mark")
    scene.viewer.press("Play (Y)")
    until(lambda: performance.score.t > 3.0, "it goes on")
    scene.viewer.slide("Time [s]", 5.8)
    until(lambda: performance.score.conductor.waiting is not None, "it waits")
    scene.viewer.wait_for_text("waits at applause for GO")
    scene.viewer.press("GO (Space)")
    until(lambda: performance.score.conductor.waiting is None, "it goes on")
    scene.viewer.press("Stop")
    until(lambda: performance.score is None, "it ends")


def test_a_score_that_is_saved_is_loaded_again(scene):
    file = scene.folder / "number.yaml"
    scene.viewer.press("GO (Space)")
    until(lambda: scene.performance.score is not None and scene.performance.score.t > 0.3, "plays")
    file.write_text(SCORE.replace("nod", "nodd"), encoding="utf-8")
    scene.viewer.wait_for_text("the score is unchanged")
    assert "nodd" in scene.viewer.text
    file.write_text(SCORE.replace("nod", "shake"), encoding="utf-8")
    until(lambda: "shake" in [cue.gesture for cue in scene.stage.score.cues], "it is loaded")
    assert scene.performance.score.t > 0.3
    file.write_text(SCORE, encoding="utf-8")
    until(lambda: "nod" in [cue.gesture for cue in scene.stage.score.cues], "as it was")


def next_message(socket, condition, patience: float = 20.0) -> dict:
    """The first message to a page's script that fulfils a condition."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        answer = socket.recv(timeout=patience)
        if isinstance(answer, str) and condition(message := json.loads(answer)):
            return message
    raise AssertionError("no such message was received")


def test_the_sound_follows_the_beat_and_the_score(scene):
    tempo = scene.stage.gesture_player.tempo
    with connect(
        scene.page.url.replace("http", "ws", 1) + "/sound", origin=scene.page.url
    ) as socket:
        assert json.loads(socket.recv(timeout=20.0)) == {"start": 0.0, "gain": 1.0}
        assert socket.recv(timeout=20.0) == (scene.folder / "bell.wav").read_bytes()
        assert next_message(socket, lambda answer: "beat" in answer) == {
            "beat": None,
            "score": None,
        }
        scene.viewer.pick("B M", "Metronome")
        beat = next_message(socket, lambda answer: answer.get("beat"))["beat"]
        assert beat["period"] == pytest.approx(tempo.beat) and 0 <= beat["next"] <= tempo.beat
        scene.viewer.pick("B M", "Metronome")
        next_message(socket, lambda answer: "beat" in answer and answer["beat"] is None)
        scene.viewer.press("GO (Space)")
        assert next_message(socket, lambda answer: answer.get("score"))["score"]["t"] > 0.0
        scene.viewer.press("Stop")
        next_message(socket, lambda answer: "score" in answer and answer["score"] is None)


def test_a_tapped_tempo_is_shown(scene):
    tempo = scene.stage.gesture_player.tempo
    for _ in range(4):
        scene.viewer.pick("B M", "Tap")
        time.sleep(0.4)
    until(lambda: 100.0 < tempo.bpm < 160.0, "the tempo")
    until(
        lambda: abs(scene.viewer.value("Beats a minute") - tempo.bpm) <= 0.5, "the slider follows"
    )


def test_a_puppet_without_these_strings_has_no_buttons(tmp_path):
    with (
        fan.show(
            fan.puppets.arm2d(), port=0, browser=False, wait=False, record_to=tmp_path
        ) as page,
        Viewer(page.url) as viewer,
    ):
        assert page.view.stage.gesture_player.gestures == {}
        viewer.wait_for_text("No bundled gesture fits these strings")
        viewer.press("Play (L)")
        viewer.wait_for_text("there is no take yet")


def test_a_score_is_for_live_puppets_and_without_mistakes(folder, tmp_path):
    arm = fan.puppets.arm2d()
    run = fan.simulate(arm, arm.rest(), t_end=0.1)
    with pytest.raises(ValueError, match="live"):
        fan.show(run, score=folder / "number.yaml", port=0, browser=False, wait=False)
    (tmp_path / "wrong.yaml").write_text("score: wrong\nlanes: {a: [{gesture: nodd}]}\n")
    with pytest.raises(fan.errors.FileError, match="nodd"):
        fan.show(
            fan.puppets.marionette(),
            score=tmp_path / "wrong.yaml",
            port=0,
            browser=False,
            wait=False,
        )
