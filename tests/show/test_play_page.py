"""The page of a show: the Play tab directs it; a browser draws it, and its MIDI gives GO."""

from __future__ import annotations

from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest
from tests.perform.short_play import PLAY
from tests.show.browser import chrome, page_text, picture, pixel, until
from tests.show.viewer import Viewer
from websockets.sync.client import connect

import fantoccini as fan
from fantoccini.app.web.page import open_live_play

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("show")
    (folder / "short.yaml").write_text(PLAY, encoding="utf-8")
    show = fan.theatre.LivePlay(fan.load_play(folder / "short.yaml"))
    with open_live_play(show, "light", "127.0.0.1", 0, folder) as page, Viewer(page.url) as viewer:
        yield SimpleNamespace(page=page, show=show, viewer=viewer)


@pytest.fixture(autouse=True)
def begun(scene):
    """Every test begins before the first GO."""
    scene.page.view.enqueue(None, scene.page.view.reset)
    until(lambda: scene.show.voice is None, "it is at the start")


def test_buttons_direct_the_show(scene):
    show, viewer = scene.show, scene.viewer
    viewer.wait_for_text("stands by for GO")
    viewer.press("GO (Space)")
    until(lambda: show.t > 0.3, "it plays")
    viewer.wait_for_text("Good evening!")
    viewer.press("Hold (Y)")
    until(lambda: show.is_held, "it is held")
    viewer.wait_for_text("is held")
    viewer.press("Go on (Y)")
    until(lambda: not show.is_held, "it goes on")
    viewer.press("Take pierrot")
    until(lambda: show.taken == {"pierrot"}, "it is taken")
    viewer.wait_for_text("pierrot is in your hands")
    until(lambda: "Give pierrot back" in _labels(viewer), "the button gives it back")
    viewer.press("Give pierrot back")
    until(lambda: not show.taken, "it is given back")
    viewer.press("Skip (K)")
    until(lambda: show.t >= show.play.cues[1].start, "the next cue")
    viewer.choose("Cue", "4 pierrot: bow")
    viewer.press("Start this cue")
    until(lambda: show.t >= show.play.cues[3].start, "the last cue")
    viewer.press("All stop (I)")
    until(lambda: show.is_held, "all hands stop")


def test_the_page_lists_acts_cues_and_refused_cues(scene):
    scene.viewer.wait_for_text("columbine: nod")
    assert "One" in scene.viewer.text


def test_a_note_of_a_midi_device_is_go(scene):
    url = scene.page.url
    with connect(url.replace("http", "ws", 1) + "/midi", origin=url) as device:
        device.send("something else")
        device.send("go")
        until(lambda: scene.show.voice is not None, "it plays")


def test_a_browser_shows_go_the_cue_and_the_caption_at_once_and_the_space_bar_is_go(scene):
    """It opened with the strings, and GO, the cue and the caption were not in view."""
    with chrome() as browser:
        browser.get(scene.page.url)
        until(lambda: "stands by for GO" in page_text(browser), "the tab is shown")
        shown = "GO (Space)", "GO begins 1 pierrot: wave", "pierrot: Good evening!"
        ends = browser.execute_script(
            "return arguments[0].map((text) => [...document.querySelectorAll('*')]"
            ".filter((e) => e.textContent.trim() === text).pop()"
            ".getBoundingClientRect().bottom / innerHeight)",
            shown,
        )
        assert all(0.0 < end <= 1.0 for end in ends)
        picture(browser, "play-opened")
        browser.find_element("tag name", "body").send_keys(" ")
        until(lambda: scene.show.voice is not None, "it plays")
        errors = [e for e in browser.get_log("browser") if e["level"] == "SEVERE"]
        assert [e for e in errors if "favicon" not in e["message"]] == []


def _labels(viewer: Viewer) -> list[str]:
    return [props.get("label", "") for _, props in viewer.controls.items()]


def test_the_page_opens_with_the_play_from_the_audiences_side(scene):
    """It opened with the strings, from the side."""
    labels = [
        props["_tab_labels"] for _, props in scene.viewer.controls.items() if "_tab_labels" in props
    ]
    assert labels == [["Play", "Strings", "Gestures", "Takes"]]
    camera = scene.page.server.viser.initial_camera
    sight = np.array(camera.look_at) - np.array(camera.position)
    assert sight[0] < 0.0  # the audience sits at +x
    assert abs(sight[1]) < 1e-9 * abs(sight[0])


def test_the_panel_does_not_cover_the_stage(scene):
    (client,) = scene.page.server.viser.get_clients().values()
    window = {"x": 0.0, "y": 0.0, "width": 800.0, "height": 600.0}
    camera = scene.page.server.viser.initial_camera
    scene.viewer.look(camera.position, camera.look_at)  # as a browser does after its connection
    until(lambda: client.camera.look_at[1] != 0.0, "the camera is moved")
    x, marionette = scene.show.play.x0, scene.show.performance.marionette
    places = np.asarray(marionette.poses(x.q_D, x.q_K))[:, :, 3]
    across, down = np.array([pixel(client, place, window) for place in places]).T
    assert across.min() > 0.0 and across.max() < 800.0 - 320.0
    assert down.min() > 0.0 and down.max() < 600.0


def test_a_flood_of_jobs_does_not_hold_the_puppet(scene):
    live, performance, ended = scene.page.view, scene.show.performance, Event()

    def again() -> None:
        if not ended.is_set():
            live.jobs.put(again)

    begun = performance.t
    live.jobs.put(again)
    try:
        until(lambda: performance.t > begun + 0.1, "time goes on")
    finally:
        ended.set()
