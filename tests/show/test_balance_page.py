"""Hands that balance a live puppet, and bodies that viewers pull."""

from __future__ import annotations

import numpy as np
import pytest
from tests.show.browser import chrome, page_text, picture, until
from tests.show.toys import TOY
from tests.show.viewer import Viewer

import fantoccini as fan
from fantoccini.base.errors import StateError

pytestmark = pytest.mark.slow

BODY = "/puppet/lower/0"


@pytest.fixture
def page(tmp_path):
    shown = fan.show(
        fan.puppets.arm2d(), port=0, browser=False, wait=False, record_to=tmp_path, balance=True
    )
    yield shown
    shown.close()


def tip(performance) -> np.ndarray:
    pose = performance.marionette.pose(performance.state, "lower")
    return pose[:3, 3] + pose[:3, :3] @ [0.1, 0.0, 0.0]


def test_a_body_is_pulled_at_and_let_go_while_the_hands_balance_it(page):
    live = page.view
    performance = live.performance
    with Viewer(page.url) as viewer:
        viewer.wait_for_text("updates,", 120.0)  # compiling takes its time
        assert "The hands balance it" in viewer.text
        home = tip(performance)
        target = home + np.array([0.3, 0.0, 0.0])
        viewer.drag("start", BODY, home, home)
        viewer.drag("update", BODY, home, target)
        until(lambda: (tip(performance) - home)[0] > 0.01, "the arm follows the mouse")
        assert live.holder.viewer is not None
        push = performance.pushes["lower"]
        assert np.linalg.norm(push.force) <= 0.5 * performance.marionette.weight * (1.0 + 1e-9)
        viewer.drag("end", BODY, home, target)
        until(lambda: not performance.pushes, "it is let go")
        until(lambda: live.holder.viewer is None, "the strings are free")
        until(lambda: np.linalg.norm(tip(performance) - home) < 5e-3, "it is back")


def test_the_box_gives_the_hands_back_and_a_reset_keeps_them_balancing(page):
    live = page.view
    with Viewer(page.url) as viewer:
        live.enqueue(None, live.reset)
        until(lambda: live.balance is not None, "hands that still balance", 120.0)
        viewer.tick("Let the hands balance it", False)
        until(lambda: live.balance is None, "hands with targets")
        viewer.tick("Let the hands balance it", True)
        until(lambda: live.balance is not None, "hands that balance", 120.0)


def test_a_second_click_during_the_first_is_not_lost(page):
    live = page.view
    with Viewer(page.url) as viewer:
        for on in (False, True) * 20:
            viewer.tick("Let the hands balance it", on)
            until(lambda on=on: (live.balance is not None) == on, f"the box that says {on}", 10.0)


def test_a_puppet_with_a_slipping_winch_names_the_reason(tmp_path):
    toy = fan.loads(TOY.replace("length: driven", "length: driven\n    max_tension: 50"))
    with pytest.raises(StateError, match="may slip"):
        fan.show(toy, port=0, browser=False, wait=False, record_to=tmp_path, balance=True)
    page = fan.show(toy, port=0, browser=False, wait=False, record_to=tmp_path)
    with page, Viewer(page.url) as viewer:
        viewer.tick("Let the hands balance it", True)
        viewer.wait_for_text("may slip")
        assert page.view.balance is None


def test_a_motion_is_not_balanced(tmp_path):
    arm = fan.puppets.arm2d()
    run = fan.simulate(arm, arm.rest(), t_end=0.1)
    with pytest.raises(ValueError, match="live"):
        fan.show(run, port=0, browser=False, wait=False, record_to=tmp_path, balance=True)


def test_the_page_reports_the_balance(page):
    with chrome() as browser:
        page.view.panel.views.shadows_box.value = False
        browser.get(page.url)
        until(lambda: "updates" in page_text(browser), "the page tells of updates", 120.0)
        picture(browser, "balance")
