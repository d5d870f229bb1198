"""The page of a show: the Play tab directs it; a browser draws it, and its MIDI gives GO."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from tests.perform.played import PLAY
from tests.show.browser import chrome, until
from tests.show.viewer import Viewer
from websockets.sync.client import connect

import fantoccini as fan
from fantoccini.app.web.page import open_show

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("show")
    (folder / "short.yaml").write_text(PLAY, encoding="utf-8")
    show = fan.theatre.LivePlay(fan.load_play(folder / "short.yaml"))
    with open_show(show, "light", "127.0.0.1", 0, folder) as page, Viewer(page.url) as viewer:
        yield SimpleNamespace(page=page, show=show, viewer=viewer)


@pytest.fixture(autouse=True)
def begun(scene):
    """Every test begins before the first GO."""
    scene.page.show.later(None, scene.page.show.reset)
    until(lambda: scene.show.voice is None, "it is at the start")


def test_buttons_direct_the_show(scene):
    show, viewer = scene.show, scene.viewer
    viewer.until_said("stands by for GO")
    viewer.press("GO (Space)")
    until(lambda: show.t > 0.3, "it plays")
    viewer.until_said("Good evening!")
    viewer.press("Hold (Y)")
    until(lambda: show.held, "it is held")
    viewer.until_said("is held")
    viewer.press("Go on (Y)")
    until(lambda: not show.held, "it goes on")
    viewer.press("Take pierrot")
    until(lambda: show.taken == {"pierrot"}, "it is taken")
    viewer.until_said("pierrot is in your hands")
    until(lambda: "Give pierrot back" in _labels(viewer), "the button gives it back")
    viewer.press("Give pierrot back")
    until(lambda: not show.taken, "it is given back")
    viewer.press("Skip (K)")
    until(lambda: show.t >= show.play.cues[1].start, "the next cue")
    viewer.choose("Cue", "4 pierrot: bow")
    viewer.press("Start this cue")
    until(lambda: show.t >= show.play.cues[3].start, "the last cue")
    viewer.press("All stop (I)")
    until(lambda: show.held, "all hands stop")


def test_the_page_lists_acts_cues_and_refused_cues(scene):
    scene.viewer.until_said("columbine: nod")
    assert "One" in scene.viewer.said


def test_a_note_of_a_midi_device_is_go(scene):
    url = scene.page.url
    with connect(url.replace("http", "ws", 1) + "/midi", origin=url) as device:
        device.send("something else")
        device.send("go")
        until(lambda: scene.show.voice is not None, "it plays")


def test_a_browser_shows_the_tab_and_the_space_bar_is_go(scene):
    from selenium.webdriver.common.by import By

    with chrome() as browser:
        browser.get(scene.page.url)
        tabs = until(
            lambda: browser.find_elements(By.XPATH, "//*[normalize-space(text())='Play']"), "a tab"
        )
        tabs[-1].click()
        until(lambda: "stands by for GO" in browser.page_source, "the tab is shown")
        browser.find_element(By.TAG_NAME, "body").send_keys(" ")
        until(lambda: scene.show.voice is not None, "it plays")
        errors = [e for e in browser.get_log("browser") if e["level"] == "SEVERE"]
        assert [e for e in errors if "favicon" not in e["message"]] == []


def _labels(viewer: Viewer) -> list[str]:
    return [props.get("label", "") for _, props in viewer.controls.items()]
