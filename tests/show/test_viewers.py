"""Viewers of a page, without a browser: their effect on the puppet and on each other."""

from __future__ import annotations

import gc
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from scipy.spatial.transform import Rotation
from tests.show.browser import until
from tests.show.toys import BAR, ROCKER, TOY
from tests.show.viewer import Viewer
from viser import ClientHandle

import fantoccini as fan
from fantoccini.app.pages.viser_private import is_valid_value

pytestmark = pytest.mark.slow

BEAD, RINGS = "/handles/0", "/rings/0"


def open_page(marionette, folder):
    """A live page."""
    page = fan.show(marionette, port=0, browser=False, wait=False, record_to=folder)
    return SimpleNamespace(
        page=page,
        live=page.view,
        performance=page.view.performance,
        url=page.url,
        clients=page.server.viser.get_clients,
    )


@pytest.fixture
def scene(tmp_path):
    """A live page with the ball on a string."""
    opened_scene = open_page(fan.loads(TOY), tmp_path)
    yield opened_scene
    opened_scene.page.close()


def finite(performance) -> bool:
    """Whether the puppet's state is finite."""
    x = performance.state
    return all(np.isfinite(part).all() for part in (x.q_D, x.v_D, x.q_K, x.v_K))


def test_strings_are_free_after_a_bead_is_released(scene):
    home = scene.performance.place("line")[0]
    with Viewer(scene.url) as viewer:
        viewer.drag("start", BEAD, home, home)
        until(lambda: scene.live.holder.viewer is not None, "the strings are held")
        for distance in (0.02, 0.05):
            viewer.drag("update", BEAD, home, home + distance * np.eye(3)[1])
        # The camera is level with the plane of the hand, where motion in depth is invisible.
        at_the_last_move = pytest.approx(0.05, abs=1e-4)
        until(lambda: scene.performance.target("line")[0][1] == at_the_last_move, "a move")
        began = scene.performance.t
        viewer.drag("end", BEAD, home, home)
        until(lambda: scene.live.holder.viewer is None, "the strings are free")
        assert scene.performance.t < began + 2.0  # released at once, not by timeout
        assert scene.performance.target("line")[0][1] == at_the_last_move


def test_one_of_two_viewers_holds_and_the_other_is_notified(scene, monkeypatch):
    monkeypatch.setattr(scene.live.holder, "max_idle_time", 60.0)
    line = "line"
    with Viewer(scene.url) as second:
        first = Viewer(scene.url)
        first.slide(line, 0.5)
        until(lambda: scene.performance.target_length(line) == 0.5, "the first winds")
        until(lambda: second.value(line) == 0.5, "the other sees it")
        second.slide(line, 0.7)
        second.wait_for_text("Another viewer holds the strings")
        until(lambda: second.value(line) == 0.5, "the slider of the other snaps back")
        assert scene.performance.target_length(line) == 0.5
        first.close()
        until(lambda: scene.live.holder.viewer is None, "the holder's tab is closed")
        second.slide(line, 0.7)
        until(lambda: scene.performance.target_length(line) == 0.7, "the other takes over")


def test_each_viewer_sees_the_holder_of_the_strings(scene, monkeypatch):
    """The holder reads "You hold the strings"; others read the holder's number."""
    monkeypatch.setattr(scene.live.holder, "max_idle_time", 60.0)
    with Viewer(scene.url) as holder, Viewer(scene.url) as second:
        for viewer in (holder, second):
            viewer.wait_for_text("The strings are free")
        holder.slide("line", 0.5)
        holder.wait_for_text("You hold the strings")
        second.wait_for_text("holds the strings")
        assert "You hold" not in second.text
        number = scene.live.holder.viewer + 1
        assert f"Viewer {number} holds the strings" in second.text
        assert f"Viewer {number} holds" not in holder.text


def test_a_bead_winds_its_string_without_shift(scene):
    """For phones, which have no Shift key: dragging up in the picture winds in, in every view."""
    home = scene.performance.place("line")[0]
    with Viewer(scene.url) as viewer:
        viewer.tick("Drag winds", True)
        until(lambda: scene.live.panel.drag_winds, "the box is ticked")
        length = scene.performance.target_length("line")
        viewer.drag("start", BEAD, home, home)
        viewer.drag("update", BEAD, home, home + 0.05 * np.eye(3)[2])
        until(lambda: scene.performance.target_length("line") < length, "it winds in")
        assert scene.performance.target_length("line") == pytest.approx(length - 0.05)
        assert np.array_equal(scene.performance.target("line")[0], home)
        viewer.drag("end", BEAD, home, home)


def test_rings_are_about_the_handle_that_is_chosen(tmp_path):
    """Only the chosen handle has rings: those of a bar and of a rocker on it would overlap."""
    scene = open_page(fan.loads(ROCKER), tmp_path)
    controls = scene.live.controls
    try:
        assert {name: ring.visible for name, ring in controls.rings.items()} == {
            "bar": True,
            "rocker": False,
        }
        with Viewer(scene.url) as viewer:
            viewer.choose("Handle", "rocker")
            until(lambda: controls.selected == "rocker", "it is chosen")
            until(lambda: controls.rings["rocker"].visible, "its rings are seen")
            assert not controls.rings["bar"].visible
            assert {label.visible for label in controls.labels.values()} == {True}
    finally:
        scene.page.close()


def test_a_viewers_last_choice_is_kept(tmp_path):
    """A frame drawn between a choice and its callback does not revert the choice."""
    scene = open_page(fan.loads(ROCKER.replace("length: 0.4", "length: driven")), tmp_path)
    try:
        # viser sets the values before it calls any callback.
        choice, slider = scene.live.panel.handle_choice, scene.live.controls.sliders["left"]
        choice.value, slider.value = "rocker", 0.5
        t = scene.performance.t
        until(lambda: scene.performance.t > t + 0.5, "frames")
        assert (choice.value, slider.value) == ("rocker", 0.5)
    finally:
        scene.page.close()


def test_a_viewer_who_leaves_during_a_drag_frees_the_strings(scene):
    home = scene.performance.place("line")[0]
    viewer = Viewer(scene.url)
    viewer.drag("start", BEAD, home, home)
    viewer.drag("update", BEAD, home, home + 0.05 * np.eye(3)[1])
    until(lambda: scene.live.holder.viewer is not None, "the strings are held")
    viewer.close()
    until(lambda: not scene.live.controls.grabs, "nothing is in a hand")
    assert scene.live.holder.viewer is None


def lasting_threads() -> int:
    """Number of threads except those of viser's pool, which starts up to 32 as needed."""
    names = [thread.name for thread in threading.enumerate()]
    return sum(not name.startswith("ThreadPoolExecutor") for name in names)


def test_many_tabs_leave_nothing_behind(scene):
    def tabs(count: int) -> None:
        for _ in range(count):
            with Viewer(scene.url) as viewer:
                until(lambda: viewer.bundles > 2, "the page is sent")
                viewer.slide("line", 0.6)
        until(lambda: not scene.clients(), "all are gone")

    tabs(8)
    gc.collect()
    threads, seconds = lasting_threads(), scene.performance.t
    tabs(24)
    gc.collect()
    until(lambda: lasting_threads() <= threads, "no thread stays")
    handles = sum(isinstance(thing, ClientHandle) for thing in gc.get_objects())
    assert handles <= 3  # those of closed tabs have been freed
    server = scene.page.server.viser._websock_server
    assert not server._client_state_from_id and not server._broadcast_buffer.generator_cursors
    assert len(server._broadcast_buffer.message_from_id) < 500
    assert finite(scene.performance) and scene.performance.t > seconds


def test_rings_turn_a_bar_and_stay_with_the_hand_that_turns_them(tmp_path, monkeypatch):
    bar = open_page(fan.loads(BAR), tmp_path)
    monkeypatch.setattr(bar.live.holder, "max_idle_time", 60.0)
    turned = Rotation.from_euler("x", 20.0, degrees=True).as_quat()[[3, 0, 1, 2]]
    other = Rotation.from_euler("y", 60.0, degrees=True).as_quat()[[3, 0, 1, 2]]
    home, level = bar.performance.place("bar")
    try:
        with Viewer(bar.url) as holder, Viewer(bar.url) as second:
            holder.turn("start", RINGS, home, level)
            holder.turn("update", RINGS, home, turned)
            until(
                lambda: np.allclose(bar.performance.place("bar")[1], turned, atol=1e-3), "it turns"
            )
            second.turn("start", RINGS, home, level)
            second.turn("update", RINGS, home, other)
            second.wait_for_text("Another viewer holds the strings")
            assert bar.live.controls.turning_viewers == {"bar": 0}
            second.turn("end", RINGS, home, other)
            holder.turn("end", RINGS, home, turned)
            until(lambda: bar.live.holder.viewer is None, "the strings are free")
            # The block hangs from the turned bar: one end is higher by 0.24 m sin(20 deg).
            rings = bar.live.controls.rings["bar"]
            until(lambda: np.allclose(rings.wxyz, turned, atol=1e-6), "the rings snap back")
            assert np.allclose(bar.performance.target("bar")[1], turned)
            until(lambda: bar.performance.state.q_D[4] > 0.05, "the block tilts with it")
            assert finite(bar.performance)
    finally:
        bar.page.close()


def test_abuse_leaves_a_puppet_a_page_and_a_whole_recording(tmp_path):
    scene = open_page(fan.puppets.marionette(), tmp_path)
    performance, rng = scene.performance, np.random.default_rng(6)
    homes = [performance.place(handle.name)[0] for handle in performance.handles]
    try:
        with Viewer(scene.url) as viewer:
            viewer.press("Record")
            until(lambda: scene.live.recorder.running, "a recording")
            for n, home in enumerate(homes):
                viewer.drag("start", f"/handles/{n}", home, home)
            ends = {name: viewer.ends(name) for name in performance.lengths}
            for k in range(100):
                for n, home in enumerate(homes):
                    away = rng.normal(size=3)
                    target = home + 10.0 * away / np.linalg.norm(away)
                    viewer.drag("update", f"/handles/{n}", home, target)
                for name, (low, high) in ends.items():
                    viewer.slide(name, high if k % 2 else low)
                t = performance.t
                until(lambda: performance.t > t + 0.015, "time goes on")  # noqa: B023
                assert finite(performance)
                for n, home in enumerate(homes):
                    viewer.drag("update", f"/handles/{n}", home, home)
            for n, home in enumerate(homes):
                viewer.drag("end", f"/handles/{n}", home, home)
            viewer.press("Stop recording")
            path = until(lambda: next(iter(tmp_path.glob("*.npz")), None), "a file")
            assert scene.live.running and finite(performance)
            assert "internal error" not in viewer.text
            viewer.press("Pause")
            until(lambda: scene.live.paused, "the page still answers")
    finally:
        scene.page.close()
    recording = fan.theatre.Recording.load(path)
    assert recording.duration > 1.5
    again, first = recording.replay(), recording.trajectory
    for name in ("t", "q_D", "v_D", "q_K", "v_K"):
        assert np.array_equal(getattr(again, name), getattr(first, name)), name
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("value", [10**400, -(10**400), float("inf"), float("nan"), 2, "0.5"])
def test_a_slider_takes_values_in_its_range(value):
    server = viser.ViserServer(port=0, verbose=False)
    try:
        slider = server.gui.add_slider("T", min=0.0, max=1.0, step=0.01, initial_value=0.5)
        assert is_valid_value(slider, 0.7) and not is_valid_value(slider, value)
    finally:
        server.stop()
