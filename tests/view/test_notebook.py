"""Notebook displays: a picture and tables, without compilation, without markup from a file."""

from __future__ import annotations

import base64
import dataclasses
import io
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.image import imread

import fantoccini as fan
from fantoccini.motion import Trajectory
from fantoccini.output.view import notebook
from view.still_life import bundled_still_life, swinging_motion

pytestmark = pytest.mark.medium

MAX_DISPLAY_LENGTH = 300_000
"""Largest length of a display [characters]."""

HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)>&amp;\x1b[31m"


class Page(HTMLParser):
    """Tags, texts and images of a page; fails at tags that are not nested properly."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.texts, self.images, self.open_tags = set(), [], [], []
        self.feed(text)
        self.close()
        assert self.open_tags == []

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag == "img":
            self.images.append(dict(attrs))
        else:
            self.open_tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open_tags.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def pixels(image):
    head, data = image["src"].split(",")
    assert head == "data:image/png;base64"
    return imread(io.BytesIO(base64.b64decode(data)))


@pytest.mark.parametrize("name", fan.puppets.names())
def test_a_puppet_is_shown_and_nothing_is_compiled_for_it(name):
    marionette = getattr(fan.puppets, name)()
    text = marionette._repr_html_()
    assert len(text) < MAX_DISPLAY_LENGTH
    assert not {"library", "equations"} & set(vars(marionette))
    page = Page(text)
    assert page.tags <= {"div", "img", "table", "tr", "td", "th"}
    assert np.ptp(pixels(page.images[0])[..., :3]) > 0.5
    cell = page.texts.index("degrees of freedom") + 1
    assert page.texts[cell] == str(marionette.coordinates.n_vD)
    assert {s.name for s in marionette.tree.strings} <= set(page.texts)


def test_entries_beyond_a_table_are_counted():
    page = Page(fan.puppets.marionette()._repr_html_())
    driven = page.texts.index("head.x")
    more = page.texts.index("and 5 more", driven)
    assert (more - driven) // 2 == 16  # of 21


def test_a_run_is_shown_with_its_summary():
    run = swinging_motion(bundled_still_life("marionette"))
    text = run._repr_html_()
    assert len(text) < MAX_DISPLAY_LENGTH
    page = Page(text)
    assert np.ptp(pixels(page.images[0])[..., :3]) > 0.5
    for expected in ("duration", "1 s", "event", run.status.message, "1 catch", *run.tension.names):
        assert expected in page.texts


def test_a_run_of_an_unknown_puppet_is_plotted():
    run = swinging_motion(bundled_still_life("arm2d"))
    strip = Page(run._repr_html_()).images
    for unknown in (
        dataclasses.replace(run, puppet=None),
        dataclasses.replace(run, puppet=bundled_still_life("crane").puppet),
    ):
        page = Page(unknown._repr_html_())
        assert page.images[0]["alt"] == "the run against time"
    assert strip[0]["alt"] == "poses of the run"


def test_poses_that_do_not_fit_the_file_are_not_drawn():
    """For example, a parameter had another value in the run."""
    run = swinging_motion(bundled_still_life("arm2d"))
    shorter = run.q_K - np.array([0.0, 0.2])
    page = Page(dataclasses.replace(run, q_K=shorter)._repr_html_())
    assert page.images[0]["alt"] == "the run against time"


def test_names_cannot_inject_markup():
    marionette = fan.puppets.arm2d()
    links = tuple(dataclasses.replace(link, name=HOSTILE) for link in marionette.tree.links)
    strings = tuple(dataclasses.replace(s, name=HOSTILE) for s in marionette.tree.strings)
    values = {**marionette.tree.parameters, HOSTILE: 1.0}
    tree = dataclasses.replace(
        marionette.tree, name=HOSTILE, links=links, strings=strings, parameters=values
    )
    puppet = marionette.puppet.model_copy(update={"puppet": HOSTILE})
    for name, value in (("tree", tree), ("puppet", puppet), ("p", np.ones(len(values)))):
        object.__setattr__(marionette, name, value)
    run = swinging_motion(bundled_still_life("arm2d"))
    tension, taut = (dataclasses.replace(x, names=(HOSTILE,)) for x in (run.tension, run.taut))
    run = dataclasses.replace(
        run, method=HOSTILE, tension=tension, taut=taut, causes=(HOSTILE,), puppet=None
    )
    for text in (notebook.puppet_html(marionette), run._repr_html_()):
        page = Page(text)
        assert page.tags <= {"div", "img", "table", "tr", "td", "th"}
        assert all(set(image) == {"alt", "width", "style", "src"} for image in page.images)
        assert "<script" not in text and "\x1b" not in text
        assert any("<script>alert(1)" in shown for shown in page.texts)


def test_a_picture_that_fails_leaves_the_tables(monkeypatch):
    def fail(*args, **options):
        raise RuntimeError("no")

    monkeypatch.setattr(notebook, "state_figure", fail)
    page = Page(fan.puppets.arm2d()._repr_html_())
    assert page.images == []
    assert page.texts[:3] == ["arm2d", "degrees of freedom", "2"]


def test_a_failing_display_is_none_and_not_an_error(monkeypatch):
    assert notebook.puppet_html(object()) is None
    monkeypatch.setattr(Trajectory, "summary", lambda self: {})
    assert swinging_motion(bundled_still_life("arm2d"))._repr_html_() is None
