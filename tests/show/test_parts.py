"""The parts of a page that need no browser: hands, gamepads, text, strings, files."""

from __future__ import annotations

from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.show.toys import toy

import fantoccini as fan
from fantoccini.show import drag, pad, page, panel, replay, source, take
from fantoccini.show.holder import Holder
from fantoccini.show.poses import turned_to

AHEAD = np.array([0.0, 1.0, 0.0])
HOSTILE = (
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a&b", "{alert(1)}", "\u202ex",
)  # fmt: skip


def test_across_the_line_of_sight_a_handle_stays_under_the_mouse():
    moved = np.array([0.2, 0.0, -0.1])
    assert drag.follow(np.eye(3), AHEAD, moved) == pytest.approx(moved, rel=1e-12)
    assert drag.follow(np.eye(3)[:1], AHEAD, moved) == pytest.approx([0.2, 0.0, 0.0])
    assert drag.follow(np.zeros((0, 3)), AHEAD, moved) == pytest.approx(np.zeros(3))


@given(st.floats(-np.pi, np.pi), st.floats(-1.5, 1.5), st.tuples(*[st.floats(-1, 1)] * 3))
def test_no_mouse_lets_a_handle_run_away(azimuth, elevation, moved):
    ahead = -np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
         np.sin(elevation)]
    )  # fmt: skip
    moved = np.array(moved) - ahead * (ahead @ np.array(moved))
    for axes in (np.eye(3)[:1], np.eye(3)[:2], np.eye(3)):
        went = drag.follow(axes, ahead, moved)
        # s / (s^2 + eps^2) is at most 1 / (2 eps).
        assert np.linalg.norm(went) <= (1 + 0.15**2) / (2 * 0.15) * np.linalg.norm(moved) + 1e-12
        assert went @ moved >= -1e-12


def test_a_push_up_is_a_push_away_for_a_handle_in_a_plane():
    assert drag.nudge(np.eye(3)[:2], AHEAD, 0.1, 0.2) == pytest.approx([0.1, 0.2, 0.0])
    assert drag.nudge(np.eye(3), AHEAD, 0.1, 0.2) == pytest.approx([0.1, 0.0, 0.2])
    down = np.array([0.0, 0.0, -1.0])
    assert np.isfinite(drag.nudge(np.eye(3)[:2], down, 0.1, 0.2)).all()


def test_one_viewer_holds_the_strings_until_hands_are_off():
    now = [0.0]
    holder = Holder(idle=3.0, clock=lambda: now[0])
    assert holder.claim(0) and not holder.claim(1) and holder.viewer == 0
    now[0] = 2.9
    assert holder.claim(0)
    now[0] = 5.8
    assert not holder.claim(1)
    now[0] = 6.0
    assert holder.viewer is None and holder.claim(1) and not holder.claim(0)
    holder.leave(0)
    assert holder.viewer == 1
    holder.leave(1)
    assert holder.claim(0)


@pytest.mark.parametrize("name", HOSTILE)
def test_text_of_a_puppet_is_never_markup(name):
    shown = panel.text(name)
    assert "<" not in shown and ">" not in shown and '"' not in shown and "\u202e" not in shown
    stage = SimpleNamespace(
        colours=SimpleNamespace(top=1.0, hexadecimal=lambda _: "#000000"),
        theme=SimpleNamespace(colour=lambda _: "#111111"), scene=SimpleNamespace(wires=(False,)),
    )  # fmt: skip
    moment = SimpleNamespace(tension=np.array([0.5]), taut=np.array([True]))
    for html in (panel.bars([name], moment, stage), panel.note(name)):
        assert shown in html
        assert name == shown or name not in html
    event = SimpleNamespace(t=0.0, kind="catch", name=name, impulse=0.0)
    assert shown in replay._listed([event], 1.0)


@given(st.binary(max_size=300) | st.text(max_size=300))
def test_a_gamepad_that_says_nonsense_is_not_listened_to(message):
    sticks = pad.read(message)
    assert sticks is None or max(map(abs, (sticks.right, sticks.away, sticks.up))) <= 1.0


def test_sticks_rest_in_the_middle_and_are_bounded():
    assert pad.read('{"axes": [0.1, -0.1, 0, 0.14], "buttons": []}') == pad.Sticks()
    sticks = pad.read('{"axes": [1, -7, 0, 0.575], "buttons": [0, 1, 0, 1]}')
    assert (sticks.right, sticks.away) == (1.0, 1.0)
    assert sticks.up == pytest.approx(-0.5)
    assert sticks.buttons == {1, 3}
    for wrong in ("{}", "[]", '{"axes": ["x"], "buttons": []}', '{"axes": [NaN], "buttons": []}'):
        assert pad.read(wrong) is None
    assert pad.read('{"axes": [' + "0," * 2000 + '0], "buttons": []}') is None


def test_lines_are_turned_along_their_strings():
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(40, 3))
    directions[0], directions[1] = [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    turns = Rotation.from_quat(turned_to(directions)[:, [1, 2, 3, 0]])
    assert turns.apply([1.0, 0.0, 0.0]) == pytest.approx(directions, abs=1e-12)


def test_recordings_have_names_of_their_own(tmp_path):
    now = datetime(2026, 3, 1, 9, 5, 7)
    first = take.free_path(tmp_path, "toy", now)
    assert first == tmp_path / "toy-20260301-090507.npz"
    first.touch()
    assert take.free_path(tmp_path, "toy", now) == tmp_path / "toy-20260301-090507-2.npz"
    assert take.free_path(tmp_path, "../../etc/x y", now).parent == tmp_path
    second = take.free_path(tmp_path, "toy", now, {tmp_path / "toy-20260301-090507-2.npz"})
    assert second == tmp_path / "toy-20260301-090507-3.npz"


def test_two_short_recordings_are_two_files(tmp_path):
    live = fan.Performance(fan.puppets.string_pendulum())
    taken = take.Take(live, tmp_path)
    for _ in range(3):
        taken.begin()
        live.advance(0.05)
        taken.end()
    taken.finish()
    assert len(list(tmp_path.glob("*.npz"))) == 3


def test_what_keeps_a_recording_from_disk_is_told(tmp_path, monkeypatch):
    spare = tmp_path / "spare"
    spare.mkdir()
    monkeypatch.setattr(take.tempfile, "gettempdir", lambda: str(spare))
    live = fan.Performance(fan.puppets.string_pendulum())
    taken = take.Take(live, tmp_path / "gone")
    taken.begin()
    live.advance(0.05)
    taken.finish()
    (path,) = spare.iterdir()  # nothing is lost where its folder is gone
    assert "there is no folder" in taken.said and f"; wrote {path} (0.1 s)" in taken.said
    assert taken.said.count("cannot be written") == 1
    assert fan.Recording.load(path).duration == pytest.approx(0.05)
    monkeypatch.setattr(fan.Recording, "save", lambda *_: 1 / 0)
    taken.begin()
    live.advance(0.05)
    taken.finish()
    assert taken.said.count("cannot be written: division by zero") == 2
    assert taken.said.endswith("the recording is lost")


def test_a_recording_is_shown_with_its_parameters_and_all_its_puppets(tmp_path):
    one, two = fan.puppets.arm2d().puppet, fan.puppets.string_pendulum().puppet
    world = fan.Marionette(fan.World.of(one, two)).with_parameters({"arm2d/m1": 0.3})
    live = fan.Performance(world)
    live.record()
    live.advance(0.1)
    made = live.stop()
    made.save(tmp_path / "two.npz")
    for what in (made, tmp_path / "two.npz"):
        subject = page.subject_of(what)
        assert np.array_equal(subject.marionette.p, world.p)
        scene = replay.Film.of(subject.marionette, subject.run).scene
        assert len(scene.names) == 2
    made.trajectory.save(tmp_path / "run.npz")
    with pytest.raises(ValueError, match="several puppets and knows only arm2d"):
        page.subject_of(made.trajectory)
    with pytest.raises(fan.FantocciniError, match=r"run\.npz.* knows only arm2d"):
        page.subject_of(tmp_path / "run.npz")


def test_a_file_that_cannot_even_be_read_is_told_of(tmp_path, monkeypatch):
    watched = source.Source(toy(tmp_path))
    monkeypatch.setattr(source, "load", lambda _: 1 / 0)
    watched._read()
    assert watched._news.mistakes == (
        "a fault of fantoccini itself: ZeroDivisionError: division by zero",
    )


def test_what_cannot_be_shown_is_said():
    with pytest.raises(ValueError, match="found int; what can be shown is a puppet"):
        fan.show(3)
    with pytest.raises(ValueError, match="alive cannot be written as a file"):
        page.write(page.Subject(fan.puppets.string_pendulum()), "x.html", "light")
    with pytest.raises(fan.UnknownNameError, match="no theme is called 'green'"):
        fan.show("string_pendulum", theme="green", port=0, wait=False)
    with pytest.raises(fan.FantocciniError, match="there is no such folder"):
        fan.show("string_pendulum", port=0, wait=False, record_to="no/such/folder")
