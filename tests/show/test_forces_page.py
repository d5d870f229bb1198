"""The forces of contacts on pages, live and replayed."""

from __future__ import annotations

import numpy as np
import pytest
from tests.show.browser import chrome, count_similar_pixels, picture, until

import fantoccini as fan
from fantoccini.app.pages.scene_state import scene_at_sample

pytestmark = pytest.mark.slow

BLOCK = """
puppet: block
floor: 0
contact: true
bodies:
- name: body
  joint: {type: free}
  shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 2, colour: "#c02020"}]
strings:
- name: line
  path: [{body: body, at: [0, 0, 0.05]}, {driven: [x, y], at: [0, 0, 0.6]}]
  length: driven
pose: {body.z: 0.05, line.length: 0.52}
"""
WEIGHT = 2 * 9.81


@pytest.fixture(scope="module")
def block():
    return fan.loads(BLOCK)


@pytest.fixture(scope="module")
def run(block):
    return fan.simulate(block, block.state(), t_end=0.5, method="timestepping")


def set_checkbox(show, wanted: bool) -> None:
    """Tick or clear the box, as a viewer does."""
    views = show.views if hasattr(show, "views") else show.panel.views
    views.forces_box.value = wanted
    views.apply()


def node_of(show):
    return show.nodes.forces.node


def test_a_performance_names_contacts(block):
    live = fan.Performance(block, block.state())
    live.advance(0.2)
    assert live.contact.names == (("body", "floor"),)
    assert live.contact.force.sum(axis=0) == pytest.approx([0, 0, WEIGHT], abs=1e-6)
    live.wind("line", 0.42)
    live.advance(0.5)
    assert len(live.contact) == 0
    assert fan.Performance(fan.puppets.arm2d()).contact is None


def test_a_live_page_draws_them(block):
    with fan.show(block, port=0, browser=False, wait=False) as page:
        live = page.view
        live.performance.advance(0.1)
        until(lambda: not node_of(live).visible, "hidden at first")
        assert live.panel.views.forces_box.visible
        set_checkbox(live, True)
        until(lambda: node_of(live).visible, "arrows")
        points = node_of(live).points
        assert points.shape == (4, 2, 3)
        along = points[:, 1] - points[:, 0]
        # A quarter of the weight at each corner, or another share: four long arrows together.
        size = live.nodes.geometry.size
        assert along.sum(axis=0) == pytest.approx([0, 0, 4 * 0.15 * size], abs=1e-3 * size)
        live.performance.wind("line", 0.42)
        until(lambda: not node_of(live).visible, "lifted, nothing touches")


def test_a_page_without_contact_has_no_box():
    with fan.show(fan.puppets.arm2d(), port=0, browser=False, wait=False) as page:
        assert not page.view.panel.views.forces_box.visible
        set_checkbox(page.view, True)
        assert not page.view.panel.forces


def test_a_replay_draws_them_as_pictures_do(run):
    with fan.show(run, port=0, browser=False, wait=False) as page:
        replay = page.view
        replay.playing = False
        replay.seek(0.4)
        set_checkbox(replay, True)
        until(lambda: node_of(replay).visible, "arrows")
        k = replay.motion.frame_index(0.4)
        until(lambda: replay.shown == k, "that time")
        wanted = scene_at_sample(replay.motion.geometry, k).arrows
        assert node_of(replay).points == pytest.approx(wanted, abs=1e-6)
        set_checkbox(replay, False)
        assert not node_of(replay).visible


def test_a_browser_shows_them(run):
    with chrome() as browser, fan.show(run, port=0, browser=False, wait=False) as page:
        page.view.nodes.show_shadows(False)
        page.view.playing = False
        page.view.seek(0.4)
        browser.get(page.url)
        until(
            lambda: count_similar_pixels(picture(browser), (192, 32, 32)) > 200, "the block is seen"
        )
        without = picture(browser).astype(int)
        set_checkbox(page.view, True)
        until(lambda: count_changed_pixels(browser, without) > 150, "the arrows are seen")
        picture(browser, "forces")
        set_checkbox(page.view, False)
        until(lambda: count_changed_pixels(browser, without) < 75, "they are gone")


def test_an_exported_page_has_them_on_request(run, tmp_path):
    path = tmp_path / "block.html"
    with chrome() as browser:

        def scene() -> np.ndarray:
            browser.get(path.as_uri())
            until(
                lambda: count_similar_pixels(picture(browser), (192, 32, 32)) > 200,
                "the block is seen",
            )
            until(lambda: seconds(browser) > 0.1, "it plays")
            return picture(browser, "html-forces").astype(int)

        fan.show(run, html=path)
        without = scene()
        fan.show(run, html=path, forces=True)
        scene()
        until(lambda: count_changed_pixels(browser, without) > 150, "the arrows are seen")


def seconds(browser) -> float:
    """Time of an exported page's player [s]."""
    clock = "return document.getElementById('clock').innerText"
    return float(browser.execute_script(clock).removesuffix(" s") or 0)


def test_files_without_forces_to_draw_are_refused(tmp_path):
    pendulum = fan.puppets.string_pendulum()
    swing = fan.simulate(pendulum, pendulum.rest(), t_end=0.1)
    with pytest.raises(ValueError, match="has no contact"):
        fan.show(swing, html=tmp_path / "swing.html", forces=True)
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match="html=FILE"):
        fan.show(swing, forces=True, browser=False, wait=False)


def count_changed_pixels(browser, before: np.ndarray) -> int:
    """Number of different pixels in the scene, left of the panel."""
    left = slice(320, 610)
    return int(np.sum(np.abs(picture(browser) - before)[:, left].max(axis=2) > 60))
