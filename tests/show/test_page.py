"""Pages in a real browser: drags and buttons act on the puppet, with visible effect.

Without Chromium the tests are skipped. Pictures are written to the folder of the environment
variable FANTOCCINI_SCREENSHOTS, if any.
"""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest
from tests.show.browser import (
    canvas,
    count_colours,
    count_similar_pixels,
    page_text,
    picture,
    pixel,
    press,
    until,
)
from tests.show.toys import BAR, GREEN, WRONG, toy

import fantoccini as fan

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

RED, GREENISH = (192, 32, 32), (32, 160, 32)


@pytest.fixture(scope="module")
def scene(browser, tmp_path_factory):
    """A live page in the browser."""
    folder = tmp_path_factory.mktemp("page")
    file = toy(folder)
    page = fan.show(file, port=0, browser=False, wait=False, record_to=folder)
    page.view.panel.views.shadows_box.value = False  # software draws them slowly
    browser.get(page.url)
    clients = page.server.viser.get_clients
    until(clients, "the page connects")
    scene_parts = SimpleNamespace(
        browser=browser,
        page=page,
        live=page.view,
        performance=page.view.performance,
        folder=folder,
        file=file,
        client=next(iter(clients().values())),
    )
    until(lambda: count_similar_pixels(picture(browser), RED) > 200, "the puppet is seen")
    yield scene_parts
    page.close()


@pytest.fixture(autouse=True)
def free_strings(request):
    """Every test begins with free strings, and with running time."""
    if "scene" in request.fixturenames:
        live = request.getfixturevalue("scene").live
        live.holder.release(live.holder.viewer)
        if live.paused:
            live.pause()


PAD = """
window.stick = {axes: [0, 0, 0, 0], down: [], gone: false};
navigator.getGamepads = () => window.stick.gone ? [] : [{
  axes: window.stick.axes,
  buttons: [...Array(16).keys()].map((n) => ({pressed: window.stick.down.includes(n)})),
}];
"""
"""A gamepad controlled by a test."""


def at_rest(scene) -> bool:
    """Whether the puppet is at rest."""
    x = scene.performance.state
    return np.abs(x.v_D).max() < 0.05 and not x.v_K.any()


def test_the_puppet_is_seen_with_its_numbers(scene):
    pixels = picture(scene.browser, "live")
    assert count_colours(pixels) > 150
    assert count_similar_pixels(pixels, RED) > 200
    text = until(
        lambda: (t := page_text(scene.browser)) and "N" in t and "line" in t and t, "numbers"
    )
    assert scene.browser.title == "toy"
    weight = 0.3 * 9.81
    assert abs(scene.performance.tension[0] - weight) < 0.02 * weight
    assert f"{scene.performance.tension[0]:.1f}" in text


def test_a_bead_is_dragged_and_the_puppet_follows(scene, monkeypatch):
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    monkeypatch.setattr(scene.live.holder, "max_idle_time", 60.0)  # a slow machine releases later
    until(lambda: at_rest(scene), "the puppet hangs still")
    before = scene.performance.place("line")[0]
    bob = scene.performance.state.q_D[:3].copy()
    x, y = pixel(scene.client, before, canvas(scene.browser))
    mouse = ActionBuilder(scene.browser, duration=50)
    mouse.pointer_action.move_to_location(round(x), round(y)).pause(1.0).pointer_down().pause(0.5)
    for k in range(1, 9):
        mouse.pointer_action.move_to_location(round(x + 10 * k), round(y)).pause(0.1)
    mouse.perform()
    until(
        lambda: np.linalg.norm(scene.performance.place("line")[0] - before) > 0.1, "the end moves"
    )
    # The place 80 pixels to the right is still under the mouse.
    until(
        lambda: (
            abs(
                pixel(scene.client, scene.performance.target("line")[0], canvas(scene.browser))[0]
                - (x + 80.0)
            )
            < 8.0
        ),
        "the end is wanted under the mouse",
    )
    assert scene.live.holder.viewer == scene.client.client_id
    picture(scene.browser, "dragged")
    mouse = ActionBuilder(scene.browser)
    mouse.pointer_action.pointer_up()
    mouse.perform()
    until(lambda: np.linalg.norm(scene.performance.state.q_D[:2] - bob[:2]) > 0.05, "the bob")
    assert scene.performance.place("line")[0][2] == before[2]


def test_a_slider_winds_the_string(scene):
    from selenium.webdriver.common.keys import Keys

    before = scene.performance.length("line")
    slider = scene.browser.find_elements("css selector", "[role=slider]")[0]
    slider.send_keys(Keys.ARROW_LEFT * 25)
    until(lambda: scene.performance.length("line") < before - 0.015, "the string is wound in")


def test_time_is_paused_and_advanced_by_steps(scene):
    press(scene.browser, "Pause")
    until(lambda: scene.live.paused, "a pause")
    t = scene.performance.t
    until(lambda: "Go on" in page_text(scene.browser), "the button says so")
    assert scene.performance.t == t
    press(scene.browser, "Step")
    until(lambda: scene.performance.t > t, "a step")
    assert scene.performance.t == pytest.approx(t + 1 / 60, abs=1e-9)
    press(scene.browser, "Go on")
    until(lambda: scene.performance.t > t + 0.2, "time")


def test_keys_move_the_handle_that_is_selected(scene):
    from selenium.webdriver import ActionChains

    scene.browser.execute_script("document.activeElement.blur()")
    before = scene.performance.target("line")[0]
    ActionChains(scene.browser).send_keys("dd").perform()
    until(lambda: np.linalg.norm(scene.performance.target("line")[0] - before) > 0.01, "a push")
    ActionChains(scene.browser).send_keys("r").perform()
    until(lambda: np.allclose(scene.performance.target("line")[0], [0, 0, 1]), "a reset")


def test_a_parameter_changes_during_a_performance(scene):
    from selenium.webdriver.common.keys import Keys

    until(lambda: at_rest(scene), "the puppet hangs still")
    slider = scene.browser.find_elements("css selector", "[role=slider]")[-1]
    t = scene.performance.t
    slider.send_keys(Keys.ARROW_RIGHT * 40)
    until(lambda: scene.performance.marionette.p[0] > 0.4, "the ball is heavier")
    mass = float(scene.performance.marionette.p[0])
    until(lambda: scene.performance.t > t + 0.3, "the puppet keeps moving")
    until(
        lambda: (
            scene.performance.marionette.p[0]
            == pytest.approx(float(slider.get_attribute("aria-valuenow")))
        ),
        "the slider shows its value",
    )
    mass = float(scene.performance.marionette.p[0])
    until(lambda: abs(scene.performance.tension[0] - 9.81 * mass) < 0.03 * 9.81 * mass, "weight")
    assert np.isfinite(scene.performance.state.q_D).all()


def test_a_recording_is_whole_on_disk_and_replays(scene):
    press(scene.browser, "Record")
    until(lambda: scene.live.recorder.running, "recording")
    began = scene.performance.t
    scene.performance.move("line", [0.1, 0.05, 1.0])
    until(lambda: scene.performance.t > began + 0.6, "time")
    press(scene.browser, "Stop recording")
    path = until(lambda: next(iter(scene.folder.glob("toy-*.npz")), None), "a file")
    until(lambda: path.name in page_text(scene.browser), "the page says where")
    recording = fan.theatre.Recording.load(path)
    assert recording.duration > 0.4
    again = recording.replay()
    assert np.array_equal(again.q_D, recording.trajectory.q_D)
    assert np.ptp(again.q_K[:, 0]) > 0.05


def test_saving_the_file_reloads_the_puppet(scene):
    scene.performance.move("line", [0.1, 0.0, 1.0])
    until(lambda: abs(scene.performance.place("line")[0][0] - 0.1) < 1e-3, "the end is there")
    scene.file.write_text(WRONG, encoding="utf-8")
    until(lambda: "The file has errors" in page_text(scene.browser), "mistakes are reported")
    text = page_text(scene.browser)
    assert "toy.yaml:8" in text and "<img src=x" in text  # as text
    assert scene.browser.execute_script("return document.querySelector('img[src=x]')") is None
    assert count_similar_pixels(picture(scene.browser, "mistakes"), RED) > 200
    scene.file.write_text(GREEN, encoding="utf-8")
    until(
        lambda: count_similar_pixels(picture(scene.browser), GREENISH) > 200,
        "the new puppet is seen",
    )
    picture(scene.browser, "reloaded")
    assert "The file has errors" not in page_text(scene.browser)
    assert scene.performance.place("line")[0][0] == pytest.approx(0.1, abs=1e-3)
    assert np.isfinite(scene.performance.state.q_D).all()


def test_one_viewer_holds_the_strings(scene):
    assert scene.live.act("somebody else", lambda: None)
    t = scene.performance.t
    press(scene.browser, "Pause")
    until(lambda: "Another viewer holds the strings" in page_text(scene.browser), "a notice")
    assert not scene.live.paused
    until(lambda: scene.live.holder.viewer is None, "hands are off")
    press(scene.browser, "Pause")
    until(lambda: scene.live.paused, "the strings are free")
    assert scene.performance.t >= t


def test_a_reopened_tab_shows_the_same_puppet(scene):
    before = scene.performance.t
    scene.browser.refresh()
    until(
        lambda: count_similar_pixels(picture(scene.browser), GREENISH) > 200,
        "the puppet is seen again",
    )
    clients = scene.page.server.viser.get_clients
    until(lambda: len(clients()) == 1, "the old tab is gone")
    assert scene.performance.t > before


def test_a_gamepad_moves_winds_pauses_and_records(scene):
    browser, performance, live = scene.browser, scene.performance, scene.live
    script = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": PAD})

    def set_gamepad(**state) -> None:
        browser.execute_script("Object.assign(window.stick, arguments[0])", state)

    try:
        browser.refresh()
        until(lambda: browser.execute_script("return window.stick !== undefined"), "a gamepad")
        start = performance.target("line")[0]
        set_gamepad(axes=[1, 0, 0, 0])
        until(lambda: np.linalg.norm(performance.target("line")[0] - start) > 0.05, "it moves")
        set_gamepad(axes=[0.05, 0, 0, 0])  # no stick rests exactly at 0
        until(lambda: not live.pads.sticks.moved, "the stick is let go")
        rest = performance.target("line")[0]
        length = performance.target_length("line")
        set_gamepad(axes=[0, 0, 0, -1])
        until(lambda: performance.target_length("line") < length - 0.03, "the string is wound in")
        set_gamepad(gone=True)  # as when the gamepad loses its radio
        until(lambda: not live.pads.sticks.moved, "no stick is moved")
        length = performance.target_length("line")
        assert np.array_equal(performance.target("line")[0], rest)
        set_gamepad(gone=False, axes=[0, 0, 0, 0])
        for button, holds in (
            (9, lambda: live.paused),
            (9, lambda: not live.paused),
            (3, lambda: live.recorder.running),
            (3, lambda: not live.recorder.running),
        ):
            set_gamepad(down=[button])
            until(holds, f"button {button}")
            set_gamepad(down=[])
            until(lambda: not live.pads.sticks.buttons, "the button is up")
        assert performance.target_length("line") == length
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)


def test_two_tabs_compete_for_the_strings(scene, monkeypatch):
    from selenium.webdriver.common.keys import Keys

    monkeypatch.setattr(scene.live.holder, "max_idle_time", 60.0)
    browser, performance = scene.browser, scene.performance
    clients = scene.page.server.viser.get_clients
    first = browser.current_window_handle

    def slide(keys: str):
        slider = browser.find_elements("css selector", "[role=slider]")[0]
        slider.send_keys(keys)
        return slider

    browser.switch_to.new_window("tab")
    second = browser.current_window_handle
    browser.get(scene.page.url)
    until(lambda: len(clients()) == 2, "a second tab")
    until(lambda: browser.find_elements("css selector", "[role=slider]"), "its panel")
    before = performance.target_length("line")
    slide(Keys.ARROW_LEFT * 5)
    until(lambda: performance.target_length("line") < before - 0.003, "it winds")
    time.sleep(0.5)  # pending changes
    held = performance.target_length("line")
    browser.switch_to.window(first)
    slider = slide(Keys.ARROW_RIGHT * 9)
    until(lambda: "Another viewer holds the strings" in page_text(browser), "the other is notified")
    until(lambda: float(slider.get_attribute("aria-valuenow")) == pytest.approx(held), "snaps back")
    assert performance.target_length("line") == held
    browser.switch_to.window(second)
    browser.close()
    browser.switch_to.window(first)
    until(lambda: len(clients()) == 1 and scene.live.holder.viewer is None, "the holder is gone")
    slide(Keys.ARROW_RIGHT * 5)
    until(lambda: performance.target_length("line") > held, "the other takes over")


def test_rings_turn_a_bar(browser, tmp_path):
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    page = fan.show(fan.loads(BAR), port=0, browser=False, wait=False, record_to=tmp_path)
    page.view.nodes.show_shadows(False)
    with page:
        browser.get(page.url)
        performance, clients = page.view.performance, page.server.viser.get_clients
        until(
            lambda: clients() and count_similar_pixels(picture(browser), RED) > 200,
            "the puppet is seen",
        )
        client = next(iter(clients().values()))
        home, _ = performance.place("bar")
        radius, rectangle = 0.65 * page.view.controls.rings["bar"].scale, canvas(browser)

        def seen(angle: float) -> tuple[int, int]:
            """A place on the ring about x, in the quarter from y to z."""
            point = home + radius * np.array([0.0, np.cos(angle), np.sin(angle)])
            x, y = pixel(client, point, rectangle)
            return round(x), round(y)

        mouse = ActionBuilder(browser, duration=50)
        mouse.pointer_action.move_to_location(*seen(0.5)).pause(1.0).pointer_down().pause(0.5)
        for angle in np.linspace(0.5, 1.0, 6):
            mouse.pointer_action.move_to_location(*seen(angle)).pause(0.1)
        mouse.perform()
        until(lambda: performance.place("bar")[1][1] > 0.1, "the bar rolls")
        picture(browser, "rings")
        assert page.view.holder.viewer == client.client_id
        mouse = ActionBuilder(browser)
        mouse.pointer_action.pointer_up()
        mouse.perform()
        until(lambda: page.view.holder.viewer is None, "the strings are free")
        # Half an angle of 0.5, only about x.
        assert performance.target("bar")[1] == pytest.approx(
            [np.cos(0.25), np.sin(0.25), 0.0, 0.0], abs=0.05
        )
        assert np.allclose(performance.target("bar")[0], home, atol=1e-6)
