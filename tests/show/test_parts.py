"""Parts of a page that need no browser: hands, gamepads, text, strings, files."""

from __future__ import annotations

import shutil
import subprocess
from datetime import datetime
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from tests.show.browser import until
from tests.show.toys import toy

import fantoccini as fan
from fantoccini.app.live import drag, midi, pad, recorder, sound, watched_file
from fantoccini.app.live.holder import Holder, holder_text
from fantoccini.app.pages import labels, panel, replay
from fantoccini.app.pages.viser_private import CLIENT_SCRIPT
from fantoccini.app.web import page

AHEAD = np.array([0.0, 1.0, 0.0])
HOSTILE = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "a&b",
    "{alert(1)}",
    "\u202ex",
)


def test_across_the_line_of_sight_a_handle_stays_under_the_mouse():
    eye, moved = np.array([0.0, -3.0, 0.0]), np.array([0.2, 0.0, -0.1])
    home = np.zeros(3)
    assert drag.drag_displacement(np.eye(3), eye, home, home, moved) == pytest.approx(
        moved, rel=1e-12
    )
    assert drag.drag_displacement(np.eye(3)[:1], eye, home, home, moved) == pytest.approx(
        [0.2, 0.0, 0.0], rel=1e-2
    )
    assert drag.drag_displacement(np.zeros((0, 3)), eye, home, home, moved) == pytest.approx(home)


def ray(eye, point):
    """(3,) unit vector from the eye to a point."""
    away = np.asarray(point) - eye
    return away / np.linalg.norm(away)


@given(st.floats(-np.pi, np.pi), st.floats(0.3, 1.4), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_in_a_visible_plane_a_handle_stays_under_the_mouse(azimuth, elevation, right, up):
    """The motion follows the ray through the handle, at any place in the picture."""
    ahead = -np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    upwards = np.cross(across, ahead)
    place = np.array([0.3, -0.2, 1.0])
    # The camera's axis does not pass through the handle.
    eye = place - 3.0 * ahead + 0.3 * across - 0.2 * upwards
    mouse = place + right * across + up * upwards
    for axes in (np.eye(3)[:2], np.array([[0.8, 0.6, 0.0], [0.0, 1.0, 0.0]])):
        went = drag.drag_displacement(axes, eye, place, place, mouse)
        assert went[2] == pytest.approx(0.0, abs=1e-12)
        if ray(eye, mouse)[2] < -0.2:  # the view of the plane is good there as well
            assert ray(eye, place + went) == pytest.approx(ray(eye, mouse), abs=4e-3)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_handle_never_runs_away_or_moves_against_the_mouse(height, right, up):
    """A plane above the eye is seen from below, and down in the picture is away in it."""
    eye, place = np.array([3.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0 + height])
    mouse = place + np.array([0.0, right, up])
    for axes in (np.eye(3)[:1], np.eye(3)[:2], np.eye(3)[1:], np.eye(3)):
        went = drag.drag_displacement(axes, eye, place, place, mouse)
        # At most twice the angle of the mouse, at a distance that grows by e to the gain.
        turn = np.hypot(right, up) / 2.5
        assert np.linalg.norm(went) <= 5.0 * np.expm1(turn / 0.15) + 1e-9
        seen = ray(eye, place + went) - ray(eye, place)
        assert seen @ (ray(eye, mouse) - ray(eye, place)) >= -1e-3 * turn


def test_names_of_handles_do_not_cover_each_other():
    """Only the chosen bead had a name; names of close beads stand apart."""
    names = ["head", "shoulder_left", "shoulder_right", "far"]
    places = np.array([[0.0, 0.0, 1.0], [0.0, 0.01, 1.0], [0.0, 0.02, 1.0], [0.0, 0.9, 1.0]])
    view = SimpleNamespace(eye=np.array([3.0, 0.0, 1.0]), target=np.array([0.0, 0.0, 1.0]))
    above = labels.handle_label_heights(names, places, view, 1.0)
    near = np.sort(above[:3])
    assert np.all(np.diff(near) > 0.02)
    assert above[3] == near[0] > 0.0
    assert np.all(labels.handle_label_heights(names, places, view, 2.0) >= 2.0 * near[0])
    assert labels.handle_label_heights([], np.zeros((0, 3)), view, 1.0).shape == (0,)


def test_a_push_up_is_a_push_away_for_a_handle_in_a_plane():
    assert drag.push_displacement(np.eye(3)[:2], AHEAD, 0.1, 0.2) == pytest.approx([0.1, 0.2, 0.0])
    assert drag.push_displacement(np.eye(3), AHEAD, 0.1, 0.2) == pytest.approx([0.1, 0.0, 0.2])
    down = np.array([0.0, 0.0, -1.0])
    assert np.isfinite(drag.push_displacement(np.eye(3)[:2], down, 0.1, 0.2)).all()


def test_one_viewer_holds_the_strings_until_it_releases_them():
    now = [0.0]
    holder = Holder(max_idle_time=3.0, clock=lambda: now[0])
    assert holder.claim(0) and not holder.claim(1) and holder.viewer == 0
    now[0] = 2.9
    assert holder.claim(0)
    now[0] = 5.8
    assert not holder.claim(1)
    now[0] = 6.0
    assert holder.viewer is None and holder.claim(1) and not holder.claim(0)
    holder.release(0)
    assert holder.viewer == 1
    holder.release(1)
    assert holder.claim(0)


def test_each_viewer_is_told_the_holder_of_the_strings():
    """The notice "Viewer 5 holds the strings" was shown to viewer 5."""
    assert holder_text(None, 4) == "The strings are free"
    assert holder_text(4, 4) == "You hold the strings"
    assert holder_text(4, 3) == holder_text(4) == "Viewer 5 holds the strings"
    assert holder_text("gamepad 1", 3) == "Gamepad 1 holds the strings"


class Page(HTMLParser):
    """Tags and words of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.words = set(), ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)

    def handle_data(self, data):
        self.words += data


@pytest.mark.parametrize("name", HOSTILE)
def test_text_of_a_puppet_is_never_markup(name):
    nodes = SimpleNamespace(
        colours=SimpleNamespace(full_scale=1.0, hexadecimal=lambda _: "#000000"),
        theme=SimpleNamespace(colour=lambda _: "#111111"),
        scene=SimpleNamespace(wires=(False,)),
    )
    moment = SimpleNamespace(tension=np.array([0.5]), taut=np.array([True]))
    event = SimpleNamespace(t=0.0, kind="catch", name=name, impulse=0.0)
    for html in (
        panel.tension_table_html([name], moment, nodes),
        panel.note_html(name),
        replay.events_html([event], 1.0),
    ):
        page = Page(html)
        assert page.tags <= {"div", "span"}
        assert name.replace("\u202e", "\ufffd") in page.words


@given(st.binary(max_size=300) | st.text(max_size=300))
def test_invalid_messages_of_gamepads_are_ignored(message):
    sticks = pad.read_message(message)
    assert sticks is None or max(map(abs, (sticks.right, sticks.away, sticks.up))) <= 1.0


def test_sticks_rest_in_the_middle_and_are_bounded():
    assert pad.read_message('{"axes": [0.1, -0.1, 0, 0.14], "buttons": []}') == pad.Sticks()
    sticks = pad.read_message('{"axes": [1, -7, 0, 0.575], "buttons": [0, 1, 0, 1]}')
    assert (sticks.right, sticks.away) == (1.0, 1.0)
    assert sticks.up == pytest.approx(-0.5)
    assert sticks.buttons == {1, 3}
    for wrong in ("{}", "[]", '{"axes": ["x"], "buttons": []}', '{"axes": [NaN], "buttons": []}'):
        assert pad.read_message(wrong) is None
    assert pad.read_message('{"axes": [' + "0," * 2000 + '0], "buttons": []}') is None


def test_recordings_have_names_of_their_own(tmp_path):
    now = datetime(2026, 3, 1, 9, 5, 7)
    first = recorder.recording_path(tmp_path, "toy", now)
    assert first == tmp_path / "toy-20260301-090507.npz"
    first.touch()
    assert recorder.recording_path(tmp_path, "toy", now) == tmp_path / "toy-20260301-090507-2.npz"
    assert recorder.recording_path(tmp_path, "../../etc/x y", now).parent == tmp_path
    second = recorder.recording_path(tmp_path, "toy", now, {tmp_path / "toy-20260301-090507-2.npz"})
    assert second == tmp_path / "toy-20260301-090507-3.npz"


def test_two_short_recordings_are_two_files(tmp_path):
    live = fan.Performance(fan.puppets.string_pendulum())
    taken = recorder.Recorder(live, tmp_path)
    for _ in range(3):
        taken.begin()
        live.advance(0.05)
        taken.end()
    taken.finish()
    assert len(list(tmp_path.glob("*.npz"))) == 3


def test_errors_of_saving_a_recording_are_reported(tmp_path, monkeypatch):
    spare = tmp_path / "spare"
    spare.mkdir()
    monkeypatch.setattr(recorder.tempfile, "gettempdir", lambda: str(spare))
    live = fan.Performance(fan.puppets.string_pendulum())
    taken = recorder.Recorder(live, tmp_path / "gone")
    taken.begin()
    live.advance(0.05)
    taken.finish()
    (path,) = spare.iterdir()  # nothing is lost if its folder is missing
    assert "there is no folder" in taken.status and f"; wrote {path} (0.1 s)" in taken.status
    assert taken.status.count("cannot be written") == 1
    assert fan.theatre.Recording.load(path).duration == pytest.approx(0.05)
    monkeypatch.setattr(fan.theatre.Recording, "save", lambda *_: 1 / 0)
    taken.begin()
    live.advance(0.05)
    taken.finish()
    assert taken.status.count("cannot be written: division by zero") == 2
    assert taken.status.endswith("the recording is lost")


def test_a_recording_is_shown_with_its_parameters_and_all_its_puppets(tmp_path):
    arm, two = fan.puppets.arm2d().puppet, fan.puppets.string_pendulum().puppet
    world = fan.Marionette(fan.Scene.of(arm, two)).with_parameters({"arm2d.m1": 0.3})
    live = fan.Performance(world)
    live.record()
    live.advance(0.1)
    recording = live.stop()
    recording.save(tmp_path / "two.npz")
    for what in (recording, tmp_path / "two.npz"):
        subject = page.subject_of(what)
        assert np.array_equal(subject.marionette.p, world.p)
        scene = replay.ResampledRun.from_run(subject.marionette, subject.run).geometry
        assert len(scene.names) == 2
    recording.trajectory.save(tmp_path / "run.npz")
    for run in (recording.trajectory, tmp_path / "run.npz"):
        assert page.subject_of(run).marionette.coordinates.q_D == world.coordinates.q_D


def test_an_unreadable_file_is_reported(tmp_path, monkeypatch):
    path = toy(tmp_path)
    watched = watched_file.WatchedFile(path, watched_file.load_compiled)
    monkeypatch.setattr(watched_file, "load", lambda _: 1 / 0)
    path.write_text(path.read_text() + "\n")
    result = until(lambda: watched.poll(0.0), "it is read")
    assert result.mistakes == ("internal error: ZeroDivisionError: division by zero",)


def test_objects_that_cannot_be_shown_are_refused():
    with pytest.raises(ValueError, match="found int; needed: a puppet"):
        fan.show(3)
    with pytest.raises(ValueError, match="live puppet cannot be written as a file"):
        page.write_page(page.Subject(fan.puppets.string_pendulum()), "x.html", "light")
    with pytest.raises(fan.errors.UnknownNameError, match="no theme is called 'green'"):
        fan.show("string_pendulum", theme="green", port=0, wait=False)
    with pytest.raises(fan.FantocciniError, match="there is no such folder"):
        fan.show("string_pendulum", port=0, wait=False, record_to="no/such/folder")


def test_the_scripts_of_pages_can_be_read():
    """A name declared twice ended the whole script: sound, MIDI, gamepads and keys."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    scripts = CLIENT_SCRIPT, pad.PAD_SCRIPT, sound.SOUND_SCRIPT, midi.MIDI_SCRIPT
    for script in scripts:
        done = subprocess.run([node, "--check", "-"], input=script, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
