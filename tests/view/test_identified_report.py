"""The page of an identification."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from benchmarks.identify.cases import arm, record
from PIL import Image

import fantoccini as fan
from fantoccini.base.errors import PictureError
from fantoccini.lab.identification.judging import column_fits, doubts
from fantoccini.lab.identification.unit_names import channel_units, units
from fantoccini.output import reports
from fantoccini.output.reports import identified_plots
from fantoccini.output.view.theme import RED

pytestmark = pytest.mark.medium

HOSTILE = """<script>alert('$x^$')</script>" onerror="alert(1)"""
_VOID = {"meta", "img"}


class Page(HTMLParser):
    """Tables, words and pictures of a page with properly nested tags."""

    def __init__(self, text: str):
        super().__init__()
        self.open_tags: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.sources: list[str] = []
        self.tags: set[str] = set()
        self.words = ""
        self.feed(text)
        assert not self.open_tags

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        assert not any(name.startswith("on") for name, _ in attrs)
        if tag == "img":
            self.sources.append(dict(attrs)["src"])
        elif tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag not in _VOID:
            self.open_tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open_tags.pop() == tag

    def handle_data(self, data):
        if self.open_tags and self.open_tags[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data
        elif "style" not in self.open_tags:
            self.words += data

    def rows(self, table: int) -> dict[str, dict[str, str]]:
        """First cell -> heading -> cell."""
        head, *lines = self.tables[table]
        return {line[0]: dict(zip(head, line, strict=True)) for line in lines}


@pytest.fixture(scope="module")
def identified():
    """Result for an arm with gaps, outliers, a marker of a hostile name, and a weighed mass."""
    data = record(arm(), 10.0, 3, gaps=0.1, outliers=0.005, known={"upper_mass": 0.002})
    markers = [replace(m, name=HOSTILE) if m.name == "tip" else m for m in data.markers]
    named = {name.replace("tip.", f"{HOSTILE}."): x for name, x in data.columns.items()}
    return fan.identify(
        replace(data, columns=named, markers=markers, name="a <b>record</b> & more")
    )


@pytest.fixture(scope="module")
def page(identified, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "page.html"
    assert reports.identified_report(identified, path) == path
    return Page(path.read_text(encoding="utf-8"))


def test_nothing_is_loaded_and_names_are_text(page):
    assert not page.tags & {"script", "link", "iframe", "b", "object"}
    assert "a <b>record</b> & more" in page.words
    assert f"{HOSTILE}.x" in page.tables[1][7][0]
    assert len(page.sources) == 4  # correlations, residuals, jumps, channels
    for source in page.sources:
        kind, data = re.fullmatch(r"data:image/(svg\+xml|png);base64,(.+)", source).groups()
        content = base64.b64decode(data, validate=True)
        if kind == "png":
            pixels = np.asarray(Image.open(io.BytesIO(content)).convert("L"))
            assert np.mean(pixels < 200) > 0.005
        else:
            assert b"<svg" in content and b"alert" in content and b"<script" not in content


def test_the_table_has_the_numbers_found(identified, page):
    rows, unit = page.rows(0), units(identified.record)
    assert tuple(rows) == identified.names
    for name, begin in zip(identified.names, identified.record.initial_values, strict=True):
        row, deviation = rows[name], identified.deviation(name)
        assert abs(float(row["estimate"]) - identified[name]) < 0.06 * deviation
        ends = [float(x) for x in row["95 % interval"].split(" to ")]
        assert np.max(np.abs(np.subtract(ends, identified.interval(name)))) < 0.06 * deviation
        assert np.isclose(float(row["standard deviation"]), deviation, rtol=0.05)
        assert np.isclose(float(row["start value"]), begin, rtol=1e-5)
        assert row["unit"] == unit[name] != ""
    share = (identified.deviation("upper_mass") / 0.002) ** 2
    assert 0.1 < share < 1.0
    assert rows["upper_mass"]["prior"] == "± 0.002"
    assert rows["upper_mass"]["prior share"] == f"{100 * share:.0f} %"
    assert rows["tie"]["prior"] == rows["tie"]["prior share"] == ""


def test_the_table_has_every_column(identified, page):
    rows, rms = page.rows(1), identified.rms()
    assert list(rows) == list(rms) == list(identified.record.channels.names)
    for name, row in rows.items():
        assert np.isclose(float(row["root mean square"]), rms[name], rtol=5e-3)
        assert np.isclose(float(row["noise"]), identified.noise[name], rtol=5e-3)
        assert int(row["samples"]) == np.sum(np.isfinite(identified.record.columns[name]))
    listed = sum(int(row["outliers"]) for row in rows.values())
    assert listed == len(identified.outliers) > 5
    worst = max(identified.outliers, key=lambda outlier: abs(outlier.residual))
    assert f"{worst.column} at {worst.t:.3f} s {worst.residual:+.1f}" in page.words


def test_parts_of_a_result_are_consistent(identified):
    data = identified.record
    samples = identified.predicted + identified.residuals
    finite = np.isfinite(samples)
    indices = np.searchsorted(data.t, identified.t)
    assert np.allclose(samples[finite], data.values[indices][finite], rtol=0, atol=1e-12)
    assert np.all(np.isfinite(identified.predicted)) and not np.all(finite)
    assert identified.jumps.shape == (
        len(identified.starts) - 1,
        2 * data.marionette.coordinates.n_vD,
    )
    counted = identified.jumps[~np.isin(identified.starts[:-1], identified.rejected)]
    assert np.isclose(identified.drift, np.sqrt(np.median(counted**2)))
    assert identified.allowed == (5e-4, 5e-3)


def test_plots_show_samples_gaps_and_outliers(identified):
    names = identified.record.channels.names
    figures = list(identified_plots.channel_figures(identified))
    panels = [axes for figure, _ in figures for axes in figure.axes if axes.get_visible()]
    assert [name for _, part in figures for name in part] == list(names)
    circles = 0
    for j, axes in enumerate(panels):
        dots, outliers, line = sorted(
            axes.lines, key=lambda artist: ".o-".index(_marker_or_style(artist))
        )
        samples = identified.predicted[:, j] + identified.residuals[:, j]
        assert np.array_equal(dots.get_ydata(), samples, equal_nan=True)
        assert np.allclose(line.get_ydata(), identified.predicted[:, j])
        assert axes.get_title(loc="left").endswith(f"[{channel_units(identified.record)[j]}]")
        circles += len(outliers.get_xdata())
        assert outliers.get_color() == RED
        hidden = np.sum(np.isnan(identified.residuals[:, j])) / 60.0
        spans = [p.get_width() for p in axes.patches if p.get_facecolor()[0] < 0.7 and p.get_x()]  # type: ignore[attr-defined]
        grey = [w for w in spans if w > 0.2]
        assert len(grey) == 1 and abs(grey[0] - hidden) < 0.05
    assert circles == len(identified.outliers)


def _marker_or_style(line):
    return line.get_marker() if line.get_marker() != "None" else line.get_linestyle()


def test_long_pauses_break_lines():
    t = np.array([0.0, 0.1, 0.2, 1.2, 1.3])
    x, y = identified_plots.with_gaps(t, t)
    assert np.isnan(x[3]) and np.isnan(y[3]) and len(x) == 6


def test_undetermined_numbers_are_reported(tmp_path):
    """Without a known mass, the scale of masses and damping is free."""
    data = record(arm(), 6.0, 4)
    free = replace(data, unknown=[*data.unknown, fan.lab.Unknown("lower_mass")])
    result = fan.identify(free)
    page = Page(reports.identified_report(result, tmp_path / "x.html").read_text(encoding="utf-8"))
    rows = page.rows(0)
    assert rows["upper_mass"]["estimate"] == rows["lower_mass"]["estimate"] == "undetermined"
    assert rows["upper_mass"]["95 % interval"] == ""
    assert str(result.combinations[0]) in page.words and "reason" in page.words
    assert any("does not determine" in doubt for doubt in doubts(result))


def test_doubts_are_on_the_page(identified, tmp_path):
    """Slowly varying prediction errors are not noise."""
    wave = 3e-3 * np.sin(2.0 * identified.t)[:, None]
    bent = replace(identified, residuals=identified.residuals + wave)
    assert doubts(bent) and all(column.is_correlated for column in column_fits(bent))
    page = Page(reports.identified_report(bent, tmp_path / "x.html").read_text(encoding="utf-8"))
    for doubt in doubts(bent):
        assert doubt in page.words
    assert "No reason for doubt" not in page.words


def test_segments_that_do_not_count_are_shaded(identified):
    lost = replace(identified, rejected=tuple(identified.starts[[5, 9]].tolist()))
    (figure, _), *_ = identified_plots.residual_figures(lost)
    red = [p for p in figure.axes[0].patches if p.get_facecolor()[0] > 0.6 and p.get_x() > 0]  # type: ignore[attr-defined]
    assert np.allclose([p.get_x() for p in red], identified.starts[[5, 9]] + identified["delay"])  # type: ignore[attr-defined]
    assert np.allclose([p.get_width() for p in red], 0.25)  # type: ignore[attr-defined]


def test_a_record_of_one_segment_has_a_page(tmp_path):
    data = record(arm(), 2.0, 4)
    result = fan.identify(data, segment=4.0)
    assert len(result.starts) == 1 and len(result.jumps) == 0
    once = replace(result, rejected=(float(result.starts[0]),))
    page = Page(reports.identified_report(once, tmp_path / "x.html").read_text(encoding="utf-8"))
    assert len(page.sources) == 3 and "Jumps" not in page.words


def test_errors_of_writing_a_page(identified, tmp_path):
    with pytest.raises(ValueError, match="ends in"):
        reports.identified_report(identified, tmp_path / "page.pdf")
    with pytest.raises(PictureError, match="no folder"):
        reports.identified_report(identified, tmp_path / "no" / "page.html")
