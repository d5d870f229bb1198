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
from fantoccini.lab.identification.judging import columns, doubts
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
        self.open: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.sources: list[str] = []
        self.tags: set[str] = set()
        self.words = ""
        self.feed(text)
        assert not self.open

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
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data
        elif "style" not in self.open:
            self.words += data

    def rows(self, table: int) -> dict[str, dict[str, str]]:
        """First cell -> heading -> cell."""
        head, *lines = self.tables[table]
        return {line[0]: dict(zip(head, line, strict=True)) for line in lines}


@pytest.fixture(scope="module")
def found():
    """Result for an arm with gaps, outliers, a marker of a hostile name, and a weighed mass."""
    data = record(arm(), 10.0, 3, gaps=0.1, outliers=0.005, known={"upper_mass": 0.002})
    markers = [replace(m, name=HOSTILE) if m.name == "tip" else m for m in data.markers]
    named = {name.replace("tip.", f"{HOSTILE}."): x for name, x in data.columns.items()}
    return fan.identify(
        replace(data, columns=named, markers=markers, name="a <b>record</b> & more")
    )


@pytest.fixture(scope="module")
def read(found, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "page.html"
    assert reports.identified_report(found, path) == path
    return Page(path.read_text(encoding="utf-8"))


def test_nothing_is_loaded_and_names_are_text(read):
    assert not read.tags & {"script", "link", "iframe", "b", "object"}
    assert "a <b>record</b> & more" in read.words
    assert f"{HOSTILE}.x" in read.tables[1][7][0]
    assert len(read.sources) == 4  # correlations, residuals, jumps, channels
    for source in read.sources:
        kind, data = re.fullmatch(r"data:image/(svg\+xml|png);base64,(.+)", source).groups()
        content = base64.b64decode(data, validate=True)
        if kind == "png":
            pixels = np.asarray(Image.open(io.BytesIO(content)).convert("L"))
            assert np.mean(pixels < 200) > 0.005
        else:
            assert b"<svg" in content and b"alert" in content and b"<script" not in content


def test_the_table_has_the_numbers_found(found, read):
    rows, unit = read.rows(0), units(found.record)
    assert tuple(rows) == found.names
    for name, begin in zip(found.names, found.record.initial_values, strict=True):
        row, deviation = rows[name], found.deviation(name)
        assert abs(float(row["estimate"]) - found[name]) < 0.06 * deviation
        ends = [float(x) for x in row["95 % interval"].split(" to ")]
        assert np.max(np.abs(np.subtract(ends, found.interval(name)))) < 0.06 * deviation
        assert np.isclose(float(row["standard deviation"]), deviation, rtol=0.05)
        assert np.isclose(float(row["start value"]), begin, rtol=1e-5)
        assert row["unit"] == unit[name] != ""
    share = (found.deviation("upper_mass") / 0.002) ** 2
    assert 0.1 < share < 1.0
    assert rows["upper_mass"]["prior"] == "± 0.002"
    assert rows["upper_mass"]["prior share"] == f"{100 * share:.0f} %"
    assert rows["tie"]["prior"] == rows["tie"]["prior share"] == ""


def test_the_table_has_every_column(found, read):
    rows, rms = read.rows(1), found.rms()
    assert list(rows) == list(rms) == list(found.record.channels.names)
    for name, row in rows.items():
        assert np.isclose(float(row["root mean square"]), rms[name], rtol=5e-3)
        assert np.isclose(float(row["noise"]), found.noise[name], rtol=5e-3)
        assert int(row["samples"]) == np.sum(np.isfinite(found.record.columns[name]))
    listed = sum(int(row["outliers"]) for row in rows.values())
    assert listed == len(found.outliers) > 5
    worst = max(found.outliers, key=lambda one: abs(one.residual))
    assert f"{worst.column} at {worst.t:.3f} s {worst.residual:+.1f}" in read.words


def test_parts_of_a_result_are_consistent(found):
    data = found.record
    samples = found.predicted + found.residuals
    there = np.isfinite(samples)
    at = np.searchsorted(data.t, found.t)
    assert np.allclose(samples[there], data.values[at][there], rtol=0, atol=1e-12)
    assert np.all(np.isfinite(found.predicted)) and not np.all(there)
    assert found.jumps.shape == (len(found.starts) - 1, 2 * data.marionette.coordinates.n_vD)
    counted = found.jumps[~np.isin(found.starts[:-1], found.lost)]
    assert np.isclose(found.drift, np.sqrt(np.median(counted**2)))
    assert found.allowed == (5e-4, 5e-3)


def test_plots_show_samples_gaps_and_outliers(found):
    names = found.record.channels.names
    figures = list(identified_plots.channels(found))
    panels = [axes for figure, _ in figures for axes in figure.axes if axes.get_visible()]
    assert [name for _, part in figures for name in part] == list(names)
    circles = 0
    for j, axes in enumerate(panels):
        dots, outliers, line = sorted(axes.lines, key=lambda one: ".o-".index(_look(one)))
        seen = found.predicted[:, j] + found.residuals[:, j]
        assert np.array_equal(dots.get_ydata(), seen, equal_nan=True)
        assert np.allclose(line.get_ydata(), found.predicted[:, j])
        assert axes.get_title(loc="left").endswith(f"[{channel_units(found.record)[j]}]")
        circles += len(outliers.get_xdata())
        assert outliers.get_color() == RED
        hidden = np.sum(np.isnan(found.residuals[:, j])) / 60.0
        spans = [p.get_width() for p in axes.patches if p.get_facecolor()[0] < 0.7 and p.get_x()]
        grey = [w for w in spans if w > 0.2]
        assert len(grey) == 1 and abs(grey[0] - hidden) < 0.05
    assert circles == len(found.outliers)


def _look(line):
    return line.get_marker() if line.get_marker() != "None" else line.get_linestyle()


def test_long_pauses_break_lines():
    t = np.array([0.0, 0.1, 0.2, 1.2, 1.3])
    x, y = identified_plots.broken(t, t)
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


def test_doubts_are_on_the_page(found, tmp_path):
    """Slowly varying prediction errors are not noise."""
    wave = 3e-3 * np.sin(2.0 * found.t)[:, None]
    bent = replace(found, residuals=found.residuals + wave)
    assert doubts(bent) and all(column.alike for column in columns(bent))
    page = Page(reports.identified_report(bent, tmp_path / "x.html").read_text(encoding="utf-8"))
    for doubt in doubts(bent):
        assert doubt in page.words
    assert "No reason for doubt" not in page.words


def test_segments_that_do_not_count_are_shaded(found):
    lost = replace(found, lost=tuple(found.starts[[5, 9]].tolist()))
    (figure, _), *_ = identified_plots.residuals(lost)
    red = [p for p in figure.axes[0].patches if p.get_facecolor()[0] > 0.6 and p.get_x() > 0]
    assert np.allclose([p.get_x() for p in red], found.starts[[5, 9]] + found["delay"])
    assert np.allclose([p.get_width() for p in red], 0.25)


def test_a_record_of_one_segment_has_a_page(tmp_path):
    data = record(arm(), 2.0, 4)
    result = fan.identify(data, segment=4.0)
    assert len(result.starts) == 1 and len(result.jumps) == 0
    once = replace(result, lost=(float(result.starts[0]),))
    page = Page(reports.identified_report(once, tmp_path / "x.html").read_text(encoding="utf-8"))
    assert len(page.sources) == 3 and "Jumps" not in page.words


def test_errors_of_writing_a_page(found, tmp_path):
    with pytest.raises(ValueError, match="ends in"):
        reports.identified_report(found, tmp_path / "page.pdf")
    with pytest.raises(PictureError, match="no folder"):
        reports.identified_report(found, tmp_path / "no" / "page.html")
