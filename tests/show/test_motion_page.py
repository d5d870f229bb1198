"""Pages that play a motion, in a real browser: a replay, and one file from disk.

Without Chromium the tests are skipped.
"""

from __future__ import annotations

import json
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
from tests.show.toys import TOY

import fantoccini as fan
from fantoccini.app.pages.nodes import SceneNodes
from fantoccini.app.pages.replay import ResampledRun
from fantoccini.app.pages.server import Server
from fantoccini.output.view.theme import LIGHT

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

RED = (192, 32, 32)

SCRUB = """
const field = document.querySelector("input");
Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(field, arguments[0]);
field.dispatchEvent(new Event("input", {bubbles: true}));
"""
"""Script that types a time into the player of an exported page, at once."""


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    """A run of the toy."""
    marionette = fan.loads(TOY)
    x0 = marionette.rest({"line.x": 0.0})
    moves = fan.Input.waypoints(marionette, {"line.x": [(0.0, 0.0), (0.6, 0.25), (1.2, -0.25)]})
    return fan.simulate(marionette, x0, moves, t_end=2.0)


def test_a_replay_plays_the_motion(browser, swing):
    with fan.show(swing, port=0, browser=False, wait=False) as page:
        page.view.nodes.show_shadows(False)
        browser.get(page.url)
        until(lambda: count_similar_pixels(picture(browser), RED) > 200, "the puppet is seen")
        first = page.view.t
        until(lambda: page.view.t != first, "it plays")
        press(browser, "Pause")
        until(lambda: not page.view.playing, "a pause")
        page.view.seek(0.0)
        until(lambda: "0.000" in browser.page_source, "the slider follows")
        early = picture(browser, "replay")
        page.view.seek(0.9)
        until(lambda: np.abs(picture(browser).astype(int) - early).max() > 60, "another time")
        assert "kinetic" in page_text(browser)


def test_a_file_plays_from_disk_without_a_network(browser, swing, tmp_path):
    path = fan.show(swing, html=tmp_path / "swing.html")
    assert path.stat().st_size < 1.4e6
    browser.get_log("performance")
    browser.get(path.as_uri())
    until(lambda: count_similar_pixels(picture(browser), RED) > 200, "the puppet is seen")
    early = picture(browser, "html")
    assert count_colours(early) > 100
    until(lambda: np.abs(picture(browser).astype(int) - early).max() > 60, "it moves")
    until(
        lambda: (
            " N" in browser.execute_script("return document.getElementById('readings').innerText")
        ),
        "tensions",
    )
    asked = [
        message["params"]["request"]["url"]
        for entry in browser.get_log("performance")
        if (message := json.loads(entry["message"])["message"])["method"]
        == "Network.requestWillBeSent"
    ]
    assert path.as_uri() in asked
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []

    check_consistency(browser, swing)


def settled_picture(browser) -> np.ndarray:
    """Picture above the player's bar, in which a caret blinks, after a few more frames."""
    browser.execute_async_script(
        "const done = arguments[0];"
        "const frames = (n) => n ? requestAnimationFrame(() => frames(n - 1)) : done();"
        "frames(10);"
    )
    return picture(browser)[:-70].astype(int)


def check_consistency(browser, swing):
    """Bodies, strings, clock and numbers of an exported page belong to one time."""
    motion = ResampledRun.from_run(fan.loads(TOY), swing, rate=60.0)
    server = Server("toy", LIGHT, port=0)
    view = SceneNodes(server.viser, motion.geometry, LIGHT).view("three-quarter")
    server.stop()
    camera = SimpleNamespace(
        position=view.eye,
        look_at=view.target,
        up_direction=np.array([0.0, 0.0, 1.0]),
        fov=np.radians(30.0),
    )
    seen = {}
    for t in (0.6, 1.3, 0.6):  # on, and back
        browser.execute_script(SCRUB, str(t))
        check_time(browser, t, motion, swing, camera)
        # viser's player may be one frame away from the typed time: outlines then differ by some
        # hundred pixels. A misplaced ball differs by its area, some three thousand.
        shot = settled_picture(browser)
        off = np.abs(shot - seen.setdefault(t, shot)).max(axis=2) > 30
        assert off.sum() < 400
    elsewhere = np.abs(seen[0.6] - seen[1.3]).max(axis=2) > 30
    assert elsewhere.sum() > 2000


def check_time(
    browser, t: float, motion: ResampledRun, swing: fan.Trajectory, camera: SimpleNamespace
):
    """Clock, tension, ball and string of an exported page belong to a time [s]."""
    k = motion.frame_index(t)
    says = "return ['clock', 'readings'].map(n => document.getElementById(n).innerText)"

    def told() -> bool:
        clock, readings = browser.execute_script(says)
        if clock == f"{t:.1f} s" and f"{motion.geometry.tension[k, 0]:.2f} N" in readings:
            return True
        # A busy page may lose the typed time, and play on.
        browser.execute_script(SCRUB, str(t))
        return False

    until(told, f"time and tension of {t} s")
    ball, (*_, end) = swing.resample([t]).q_D[0, :3], motion.geometry.points[0][k]

    def drawn() -> bool:
        pixels, rect = picture(browser, f"html-{t}"), canvas(browser)

        def about(point: np.ndarray) -> np.ndarray:
            x, y = pixel(SimpleNamespace(camera=camera), point, rect)
            return pixels[round(y) - 3 : round(y) + 4, round(x) - 3 : round(x) + 4]

        string = about(0.5 * (ball + end)).astype(int)
        reddish = (string[..., 0] - string[..., 1]).max() > 60
        return count_similar_pixels(about(ball), RED) > 40 and reddish

    until(drawn, f"ball and string of {t} s")
