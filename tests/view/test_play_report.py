"""Report of a play: self-contained, with the figures, and no text is cut off."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np
import pytest
from tests.plays.tiny import OPTIONAL_TOUCHING_CUES, TOUCHING_CUES, write_play

import fantoccini as fan
from fantoccini.output import reports
from fantoccini.output.reports.stage_plan import draw_stage_plan
from fantoccini.output.reports.timeline import draw_timeline, shorten
from fantoccini.output.view.stills import ActStills
from fantoccini.theatre.plays import clearances, make_stage_plan

pytestmark = pytest.mark.medium


class Page(HTMLParser):
    """Tables as lists of cells, tags with their attributes, and words of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.lines: list[list[str]] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self._cell = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag == "tr":
            self.lines.append([])
        if tag in ("td", "th"):
            self.lines[-1].append("")
        self._cell = tag in ("td", "th") or (self._cell and tag not in ("p", "h1", "h2"))

    def handle_endtag(self, tag):
        self._cell = self._cell and tag not in ("td", "th")

    def handle_data(self, data):
        self.words += data
        if self._cell:
            self.lines[-1][-1] += data


@pytest.fixture(scope="module")
def verification(tmp_path_factory) -> fan.theatre.Verification:
    play = fan.load_play(write_play(tmp_path_factory.mktemp("play")))
    return fan.theatre.verify_play(play)


@pytest.fixture(scope="module")
def text(verification, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("report") / "page.html"
    shares = []
    assert (
        reports.play_report(verification, path, progress=lambda at: shares.append(at.share)) == path
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def test_the_page_is_self_contained(page, text):
    sources = [known.get("src") or known.get("href") for tag, known in page.tags]
    kinds = [source.split(";")[0] for source in sources if source is not None]
    assert sorted(kinds) == ["data:image/png", "data:image/svg+xml", "data:image/svg+xml"]
    assert not {"script", "link", "iframe"} & {tag for tag, _ in page.tags}
    assert "url(" not in text and "@import" not in text


def test_names_are_escaped(page):
    assert "First <act>" in page.words
    assert "Two <b>balls</b> & their hops." in page.words
    assert not {"act", "b"} & {tag for tag, _ in page.tags}


def test_the_page_has_the_cue_times(page):
    assert ["1", "14", "hop.yaml", "one", "0.50", "0.50", "+0", "hands", ""] in page.lines
    assert any(line[:4] == ["2", "15", "hop.yaml (top)", "two"] for line in page.lines)
    assert "Every cue is done as written" in page.words


def test_the_page_has_the_measured_figures(page, verification):
    for name, tension in verification.tension.items():
        (line,) = [cells for cells in page.lines if cells[0] == name and len(cells) == 5]
        assert float(line[1]) == pytest.approx(tension, abs=0.006)
        assert float(line[2]) == pytest.approx(100.0 * tension / (0.2 * 9.81), abs=0.6)
    speed, bound, change, _ = verification.peaks["one.hold.length"]
    (line,) = [cells for cells in page.lines if cells[0] == "one.hold" and len(cells) == 7]
    assert [float(line[k]) for k in (1, 2, 4)] == pytest.approx([speed, bound, change], abs=0.006)
    (low, high), _ = verification.space
    assert ["x", f"{low + 0.0:.3f} to {high + 0.0:.3f}", "anywhere"] in page.lines


def test_the_least_clearances_are_those_of_the_run(verification, page):
    run = verification.run
    nearest = {
        frozenset(approach.owners): approach
        for approach in clearances(verification.play.cast, run)
        if not approach.is_of_string
    }
    first, second = (
        run.q_D[:, [run.coordinates.q_D.index(f"{name}.ball.{x}") for x in "xyz"]]
        for name in ("one", "two")
    )
    apart = np.linalg.norm(first - second, axis=1).min() - 0.1
    assert nearest[frozenset(("one", "two"))].distance == pytest.approx(apart, abs=1e-4)
    floor = nearest[frozenset(("one", "floor"))]
    assert floor.distance == pytest.approx(first[:, 2].min() - 0.05, abs=1e-4)
    block = nearest[frozenset(("two", "block"))].distance
    assert block == pytest.approx(np.hypot(0.35, 0.15) - 0.05, abs=2e-3)
    assert any(line[:2] == ["one - floor", "one.ball"] for line in page.lines)


def test_a_failing_play_is_reported_first(tmp_path):
    verification = fan.theatre.verify_play(fan.load_play(write_play(tmp_path, TOUCHING_CUES)))
    text = reports.play_report(verification, tmp_path / "page.html").read_text(encoding="utf-8")
    assert 'class="verdict fails">1 of 2 cues cannot be done as written' in text
    assert f"{tmp_path / 'tiny.yaml'}:15: acts[0].cues[1]: one: sway.yaml cannot be done" in text
    assert '<tr class="wrong"><td class="r">2</td><td class="r">15</td>' in text


def test_remarks_are_not_counted_as_cues_that_cannot_be_done(tmp_path):
    """Regression: the report said that a cue cannot be done, the terminal that all can."""
    path = write_play(tmp_path, TOUCHING_CUES)
    play = fan.load_play(path, within=0.0)
    verification = fan.theatre.verify_play(play)
    assert not play.refused and len(play.remarks) >= 2  # it was stopped, and something touches
    assert play.remarks == play.deviations == play.changes
    text = reports.play_report(verification, tmp_path / "page.html").read_text(encoding="utf-8")
    assert play.counts == f"2 of 2 cues can be done, {len(play.remarks)} remarks"
    assert f'class="verdict fails">{play.counts}' in text
    assert "cues cannot be done" not in text
    left = fan.load_play(write_play(tmp_path, OPTIONAL_TOUCHING_CUES))
    assert left.counts == "1 of 2 cues can be done, 1 left out" and not left.remarks
    text = reports.play_report(fan.theatre.verify_play(left), tmp_path / "page.html").read_text()
    assert 'class="verdict holds">1 of 2 cues can be done, 1 left out' in text


def texts_within(figure) -> list[str]:
    """Texts of a figure; fails if one of them is cut off."""
    figure.canvas.draw()
    whole, words = figure.bbox, []
    for axes in figure.axes:
        ticks = [
            tick.label1
            for axis in (axes.xaxis, axes.yaxis)
            for tick in axis.get_major_ticks()
            if axis.get_view_interval().min() <= tick.get_loc() <= axis.get_view_interval().max()
        ]
        for label in (*axes.texts, axes.xaxis.label, axes.yaxis.label, *ticks):
            if not label.get_text() or not label.get_visible():
                continue
            box = label.get_window_extent()
            assert whole.x0 <= box.x0 and box.x1 <= whole.x1, label.get_text()
            assert whole.y0 <= box.y0 and box.y1 <= whole.y1, label.get_text()
            words.append(label.get_text())
    return words


def test_the_drawings_name_everything_and_cut_nothing(verification):
    play = verification.play
    assert {"one", "two", "here", "there", "block"} <= set(
        texts_within(draw_stage_plan(play, verification.space))
    )
    words = texts_within(draw_timeline(play))
    assert {"First <act>", "one", "two", "captions", "1 hop.yaml", "one: <Hop> & hop"} <= set(words)
    stills = texts_within(ActStills(play, verification.run).of_act("First <act>"))
    assert [stills.count(name) for name in ("one", "two")] == [8, 8]


def test_the_plan_view_shows_all_things_on_the_stage(verification):
    plan_view = make_stage_plan(verification.play)
    assert plan_view.marks == {"here": (0.0, -0.3), "there": (0.0, 0.3)}
    (polygon,) = plan_view.obstacles["block"]
    np.testing.assert_allclose(polygon.min(axis=0), [-0.45, -0.15], atol=1e-9)
    np.testing.assert_allclose(polygon.max(axis=0), [-0.35, 0.15], atol=1e-9)


def test_labels_are_shortened_to_fit():
    assert shorten("12 walks to the door", 200.0) == "12 walks to the door"
    assert shorten("12 walks to the door", 60.0).startswith("12 walk")
    assert shorten("12 walks to the door", 15.0) == "12"
    assert shorten("12 walks to the door", 5.0) == ""


def test_paths_of_other_files_are_refused(verification, tmp_path):
    with pytest.raises(ValueError, match=r"a report ends in \.html, not in '\.pdf'"):
        reports.play_report(verification, tmp_path / "page.pdf")
    with pytest.raises(fan.errors.PictureError, match="there is no folder"):
        reports.play_report(verification, tmp_path / "no" / "page.html")
