"""The steps from a drag of a bead to a film, only by the page, in a real browser."""

from __future__ import annotations

from types import SimpleNamespace

import imageio_ffmpeg
import numpy as np
import pytest
from tests.perform.hands import hands_of
from tests.show.browser import (
    canvas,
    count_similar_pixels,
    open_tab,
    page_text,
    picture,
    pixel,
    press,
    rectangles,
    until,
)
from tests.show.toys import toy

import fantoccini as fan

pytestmark = pytest.mark.slow

RED = (192, 32, 32)


@pytest.fixture
def scene(browser, tmp_path, monkeypatch):
    """A live page in the browser, and strings that stay in this viewer's hands."""
    page = fan.show(toy(tmp_path), port=0, browser=False, wait=False, record_to=tmp_path)
    with page:
        monkeypatch.setattr(page.view.holder, "max_idle_time", 60.0)
        page.view.panel.views.shadows_box.value = False  # software draws them slowly
        browser.get(page.url)
        clients = page.server.viser.get_clients
        until(
            lambda: clients() and count_similar_pixels(picture(browser), RED) > 200,
            "the puppet is seen",
        )
        yield SimpleNamespace(
            browser=browser,
            live=page.view,
            stage=page.view.stage,
            folder=tmp_path,
            performance=page.view.performance,
            client=next(iter(clients().values())),
        )


def drag_bead(scene, right: int) -> None:
    """Drag the bead to the right by pixels, and release it."""
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    start = scene.performance.place("line")[0]
    x, y = (round(c) for c in pixel(scene.client, start, canvas(scene.browser)))
    mouse = ActionBuilder(scene.browser, duration=50)
    mouse.pointer_action.move_to_location(x, y).pause(1.0).pointer_down().pause(0.5)
    for k in range(1, 9):
        mouse.pointer_action.move_to_location(x + round(right * k / 8), y).pause(0.1)
    mouse.pointer_action.pointer_up()
    mouse.perform()
    until(
        lambda: np.linalg.norm(scene.performance.place("line")[0] - start) > 0.05, "the hand moves"
    )


def visible_elements(scene, selector: str) -> list:
    """The visible elements."""
    elements = scene.browser.find_elements("css selector", selector)
    return [element for element in elements if element.is_displayed()]


def buttons(scene) -> list[str]:
    """Labels of the page's buttons."""
    return scene.browser.execute_script(
        "return [...document.querySelectorAll('button')].map((b) => b.textContent.trim())"
    )


def record_take(scene, do) -> str:
    """Record with the page's button; returns the name of the take."""
    before = scene.stage.takes.names
    press(scene.browser, "Record")
    until(lambda: scene.live.recorder.running, "it records")
    do()
    until(lambda: "Stop recording" in buttons(scene), "the button")
    press(scene.browser, "Stop recording")
    until(lambda: len(scene.stage.takes.names) > len(before), "there is a take")
    return scene.stage.takes.chosen


def test_record_trim_gesture_performance_film(scene):
    from selenium.webdriver import ActionChains

    first = record_take(scene, lambda: drag_bead(scene, 90))
    whole = scene.stage.takes.take
    open_tab(scene.browser, "Takes")
    until(lambda: first in scene.browser.page_source, "the take is shown")

    # Trim: the first end of the part moves to the right, while the hand is still at rest.
    thumb = until(lambda: visible_elements(scene, ".multi-slider-thumb"), "the ends of the part")[0]
    mouse = ActionChains(scene.browser).click_and_hold(thumb)
    for _ in range(4):
        mouse = mouse.move_by_offset(2, 0).pause(0.1)
    mouse.release().perform()
    until(lambda: scene.stage.takes.edits.start > 0.0, "it is trimmed")
    until(lambda: f"of {whole.duration:.2f} s" in page_text(scene.browser), "the part is told")

    visible_elements(scene, "input.mantine-TextInput-input")[0].click()
    ActionChains(scene.browser).send_keys("sweep").perform()
    until(lambda: scene.live.panel.takes.name_field.value == "sweep", "the name is typed")
    assert scene.performance.playing == ()  # typing presses no keys of gestures
    press(scene.browser, "Make a gesture of it")
    until(lambda: "sweep" in scene.stage.gesture_player.gestures, "it is a gesture")
    gesture = scene.stage.gesture_player.gestures["sweep"]
    left = whole.duration - scene.stage.takes.edits.start
    assert gesture.duration == pytest.approx(left, abs=0.02)

    # A performance: the gesture, by its button and by its key.
    open_tab(scene.browser, "Gestures")
    until(lambda: "sweep" in buttons(scene), "its button")
    press(scene.browser, "Home (H)")
    until(lambda: scene.performance.playing == (), "at rest")

    def perform() -> None:
        start = scene.performance.state.q_K
        press(scene.browser, "sweep")
        until(lambda: scene.performance.playing == ("sweep",), "the button plays it")
        until(lambda: np.abs(scene.performance.state.q_K - start).max() > 0.05, "the hand sweeps")
        scene.browser.execute_script("document.activeElement.blur()")
        ActionChains(scene.browser).send_keys("1").perform()
        until(lambda: scene.performance.playing == ("sweep",), "the key plays it")
        until(lambda: scene.performance.playing == (), "it ends")

    second = record_take(scene, perform)
    assert second != first
    take = scene.stage.takes.take
    hands = hands_of(scene.performance)
    assert np.abs(take.acc_K).max() <= hands.acceleration.max() * (1 + 1e-9)
    assert np.ptp(take.trajectory.q_K, axis=0).max() > 0.05

    open_tab(scene.browser, "Takes")
    until(lambda: second in scene.browser.page_source, "the take is shown")
    picture(scene.browser, "takes")
    press(scene.browser, "Film")
    film = scene.folder / f"{second}.mp4"
    until(film.is_file, "the film is written", patience=120.0)
    until(lambda: film.name in page_text(scene.browser), "the page says so")
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
    assert frames > 10 and seconds == pytest.approx(take.duration, abs=0.1)
    read = imageio_ffmpeg.read_frames(str(film))
    width, height = next(read)["size"]
    early, *_, late = (np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in read)
    assert np.abs(early.astype(int) - late).max() > 60


def test_the_metronome_is_heard(scene):
    open_tab(scene.browser, "Gestures")
    button = until(
        lambda: [
            button_element
            for button_element in scene.browser.find_elements("css selector", "button")
            if button_element.text == "Metronome"
        ],
        "its button",
    )[0]
    script = "return Number(document.documentElement.dataset.clicks)"
    assert scene.browser.execute_script(script) == 0
    button.click()  # a mouse's click, because browsers are silent before one
    until(lambda: scene.stage.gesture_player.metronome, "it is on")
    until(lambda: scene.browser.execute_script(script) >= 3, "three clicks")
    button.click()
    until(lambda: not scene.stage.gesture_player.metronome, "it is off")


def test_keys_are_heard_after_clicks(scene):
    """Buttons, boxes and lists do not keep the keyboard after a click."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    gesture_player = scene.stage.gesture_player
    gesture_player.add(
        fan.theatre.Gesture.from_points(
            scene.performance.marionette, {"line.up": [(0, 0), (1, 0.05), (2, 0)]}, name="hop"
        )
    )
    open_tab(scene.browser, "Gestures")
    until(lambda: "hop" in buttons(scene), "its button")
    visible_elements(scene, "input[type=checkbox]")[0].click()
    until(lambda: gesture_player.options.mirrored, "the box is ticked")
    ActionChains(scene.browser).send_keys("1").perform()
    until(lambda: scene.performance.playing, "the key plays it")
    next(button for button in visible_elements(scene, "button") if button.text == "Record").click()
    until(lambda: scene.live.recorder.running, "it records")
    ActionChains(scene.browser).send_keys(Keys.SPACE).send_keys("h").perform()
    until(lambda: not scene.performance.playing, "home: the keys have come")
    assert scene.live.recorder.running
    camera = np.array(scene.client.camera.position)
    ActionChains(scene.browser).key_down(Keys.SHIFT).send_keys("s").key_up(Keys.SHIFT).perform()
    until(lambda: np.linalg.norm(scene.client.camera.position - camera) > 0.1, "another view")


def test_the_panel_does_not_hide_the_gestures(scene):
    """All of the gestures' tab is above the fold of a window of 1280 x 720."""
    scene.browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": False},
    )
    try:
        open_tab(scene.browser, "Gestures")
        shown = until(
            lambda: [
                rectangle
                for rectangle in rectangles(scene.browser, "button")
                if rectangle["height"] > 0
            ],
            "buttons",
        )
        assert max(rectangle["bottom"] for rectangle in shown) < 720
    finally:
        scene.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
