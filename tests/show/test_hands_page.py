"""A page in a real browser: keys, drags, and small windows."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest
from tests.show.browser import (
    canvas,
    count_similar_pixels,
    page_text,
    picture,
    pixel,
    rectangles,
    until,
)
from tests.show.toys import toy

import fantoccini as fan

pytestmark = pytest.mark.slow

RED = (192, 32, 32)


@pytest.fixture(scope="module")
def scene(browser, tmp_path_factory):
    """A live page in the browser."""
    folder = tmp_path_factory.mktemp("page")
    page = fan.show(toy(folder), port=0, browser=False, wait=False, record_to=folder)
    page.view.panel.views.shadows_box.value = False  # software draws them slowly
    browser.get(page.url)
    clients = page.server.viser.get_clients
    until(
        lambda: clients() and count_similar_pixels(picture(browser), RED) > 200,
        "the puppet is seen",
    )
    page.view.pause()  # targets still count, and nothing has to be drawn
    yield SimpleNamespace(
        browser=browser,
        page=page,
        live=page.view,
        performance=page.view.performance,
        client=next(iter(clients().values())),
    )
    page.close()


def drag(scene, monkeypatch, down: int) -> np.ndarray:
    """Drag the bead down by pixels; return its motion in the picture, right and down."""
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    monkeypatch.setattr(scene.live.holder, "max_idle_time", 60.0)
    live, performance = scene.live, scene.performance
    performance.reset()
    rectangle = canvas(scene.browser)
    x, y = (round(c) for c in pixel(scene.client, performance.place("line")[0], rectangle))
    mouse = ActionBuilder(scene.browser, duration=50)
    mouse.pointer_action.move_to_location(x, y).pause(1.0).pointer_down().pause(0.5)
    for k in range(1, 9):
        mouse.pointer_action.move_to_location(x, y + round(down * k / 8)).pause(0.1)
    mouse.perform()
    until(lambda: (live.holder.viewer, live.jobs.empty()) == (scene.client.client_id, True), "it")
    since = [time.monotonic(), np.zeros(3)]

    def settled() -> bool:
        """Whether all pending changes have arrived."""
        now = performance.target("line")[0]
        if np.array_equal(now, [0, 0, 1]) or not np.array_equal(now, since[1]):
            since[:] = time.monotonic(), now
        return time.monotonic() > since[0] + 2.0

    until(settled, "the end is wanted elsewhere")
    after = pixel(scene.client, performance.target("line")[0], rectangle)
    mouse = ActionBuilder(scene.browser)
    mouse.pointer_action.pointer_up()
    mouse.perform()
    until(lambda: live.holder.viewer is None, "the strings are free")
    return np.array(after) - (x, y)


def test_a_bead_stays_under_a_mouse_that_goes_down(scene, monkeypatch):
    """120 px down moved the bead 33 px up in the initial view of a page."""
    right, down = drag(scene, monkeypatch, 120)
    assert abs(right) < 8.0
    assert down == pytest.approx(120.0, abs=10.0)


def test_a_bead_never_moves_against_the_mouse(scene, monkeypatch):
    """This holds if the hand's plane is above the eye and seen from below, too."""
    press_view(scene, "front")
    right, down = drag(scene, monkeypatch, 80)
    assert abs(right) < 8.0
    assert 20.0 < down < 90.0
    press_view(scene, "three-quarter")


def press_view(scene, name: str) -> None:
    before = np.array(scene.client.camera.position)
    scene.live.nodes.aim_camera(scene.client.camera, name)
    until(lambda: np.linalg.norm(scene.client.camera.position - before) > 0.1, "another view")


def test_keys_move_the_handle_and_not_the_camera(scene):
    """W, A, S, D, E, Q also moved viser's camera; ten taps lost the puppet."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    scene.browser.execute_script("document.activeElement.blur()")
    camera = np.array(scene.client.camera.position)
    direction = np.array(scene.client.camera.look_at)
    home, length = scene.performance.target("line")[0], scene.performance.target_length("line")
    for key in "dwe":
        keys = ActionChains(scene.browser)
        for _ in range(10):
            keys.key_down(key).pause(0.05).key_up(key)
        keys.perform()
    until(lambda: np.linalg.norm(scene.performance.target("line")[0] - home) > 0.1, "it moves")
    until(lambda: scene.performance.target_length("line") < length - 0.05, "it winds")
    keys = ActionChains(scene.browser)
    for key in "asq":
        keys.key_down(key).pause(0.3).key_up(key)
    keys.perform()
    assert np.allclose(scene.client.camera.position, camera)
    assert np.allclose(scene.client.camera.look_at, direction)
    # An arrow key, which is not a command, turns the camera: earlier messages have arrived.
    keys = ActionChains(scene.browser)
    keys.key_down(Keys.ARROW_LEFT).pause(0.5).key_up(Keys.ARROW_LEFT).perform()
    until(lambda: not np.allclose(scene.client.camera.position, camera), "the camera turns")
    scene.performance.reset()


def test_strings_are_wound_without_scrolling(browser, tmp_path):
    """The strings' sliders were below the fold in a window of 1280 x 720."""
    with (
        fan.show(
            fan.puppets.marionette(), port=0, browser=False, wait=False, record_to=tmp_path
        ) as page,
        window(browser, 1280, 720),
    ):
        page.view.nodes.show_shadows(False)
        page.view.pause()
        browser.get(page.url)
        n = len(page.view.performance.lengths)

        def lie_above_the_fold() -> bool:
            sliders = rectangles(browser, "[role=slider]")
            return len(sliders) >= n and all(slider["bottom"] < 700 for slider in sliders[:n])

        until(lie_above_the_fold, "the sliders are seen")  # after the layout of the page
        until(lambda: "with Shift" in page_text(browser), "how strings are wound is told")


def test_a_phone_shows_the_puppet_and_not_the_panel(browser, tmp_path):
    """The panel hid the puppet on a phone."""
    with (
        fan.show(toy(tmp_path), port=0, browser=False, wait=False, record_to=tmp_path) as page,
        window(browser, 390, 844, mobile=True),
    ):
        page.view.nodes.show_shadows(False)
        page.view.pause()
        browser.get(page.url)
        bar = 'div[style*="fixed"][style*="max-height: 60%"]'
        until(lambda: rectangles(browser, bar), "the panel")
        until(lambda: rectangles(browser, bar)[0]["height"] < 70, "it folds")
        until(
            lambda: count_similar_pixels(picture(browser, "phone"), RED) > 100, "the puppet is seen"
        )
        clients = page.server.viser.get_clients
        client = until(lambda: next(iter(clients().values()), None), "it is connected")
        rectangle = canvas(browser)
        for place in (page.view.performance.place("line")[0], [0.0, 0.0, 0.33]):
            x, y = pixel(client, np.array(place), rectangle)
            assert 0 < x < 390 and 0 < y < rectangles(browser, bar)[0]["y"]
        browser.find_element("css selector", f'{bar} div[style*="cursor: pointer"]').click()
        until(lambda: rectangles(browser, bar)[0]["height"] > 200, "it unfolds")
        until(lambda: "Drag winds" in page_text(browser), "strings are wound without Shift")


class window:
    """Context with a window of this size."""

    def __init__(self, browser, width: int, height: int, mobile: bool = False):
        self._browser = browser
        self._size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}

    def __enter__(self) -> None:
        self._browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", self._size)

    def __exit__(self, *_: object) -> None:
        self._browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
