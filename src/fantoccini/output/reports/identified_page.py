"""The report of an identification: one page with pictures that needs nothing else."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.lab.identification import columns, doubts, from_before, jump_names, leaning, units
from fantoccini.output.html import Page, Table, write_page
from fantoccini.output.reports import identified_plots

if TYPE_CHECKING:
    from fantoccini.lab.identification import Identified

MAX_NAMED = 12
"""Outliers and pairs that are listed."""
_CLOSE = 0.9
"""Correlation of two unknowns that is named."""
_HIGH = 3.0
"""Jump over the drift that is named."""
_TOLD_BEFORE = 0.9
"""Part of what is known of a number that was known beforehand, from which on it is marked."""


def identified_report(found: Identified, path: str | os.PathLike[str]) -> Path:
    """Writes the report of an identification: one HTML file, pictures included.

    It has the numbers with their intervals, what the record cannot tell apart, reasons for doubt,
    and plots: samples and predictions, residuals, jumps between segments, correlations.

    Args:
        found: as :func:`fantoccini.identify` gives it.
        path: ends in ``.html``.

    Returns:
        The path of the page.

    Raises:
        ValueError: the path has another ending.
        PictureError: it cannot be written.
    """
    return write_page(path, lambda: _page(found))


def _page(found: Identified) -> Page:
    record, reasons = found.record, doubts(found)
    title = record.name or record.marionette.name
    verdict = (
        f"{len(reasons)} reason{'s' * (len(reasons) > 1)} for doubt"
        if reasons
        else "Nothing speaks against it: what is left looks like noise"
    )
    page = Page(f"{title}: identification", title)
    page.text(_facts(found))
    page.verdict(f"{verdict}.", not reasons)
    page.items(reasons)
    page.section("Numbers")
    page.table(number_table(found))
    page.note(_before(found))
    page.note(_held(found))
    page.note(
        "The intervals are of noise alone, for a puppet that is as its file says in all that "
        "was not looked for. A wrong number there that those found can make up for leaves no "
        "trace on this page."
    )
    _apart(page, found)
    _correlated(page, found)
    _explained(page, found)
    _jumps(page, found)
    page.section("Samples and predictions")
    page.note(
        "Dots: samples. Line: the puppet with the numbers found. Red circles: outliers. Grey: "
        "where the channel was not seen. Red bands: segments that do not count."
    )
    page.plots(
        (figure, f"Samples and predictions of {', '.join(names)}")
        for figure, names in identified_plots.channels(found)
    )
    return page


def _facts(found: Identified) -> str:
    record = found.record
    return (
        f"{found.t[-1] - found.t[0]:.1f} s of the puppet {record.marionette.name}, "
        f"{len(found.t)} instants, {int(np.sum(np.isfinite(found.residuals)))} samples in "
        f"{len(columns(found))} columns; {len(found.names)} numbers looked for, in "
        f"{len(found.starts)} segments. chi2 {found.chi2:.3f}, drift {found.drift:.2g}."
    )


def _before(found: Identified) -> str:
    if not from_before(found):
        return ""
    return (
        "Known before: the standard deviation of where the search began. From before: the part of "
        "what is known now that was known without the record; red where the record adds little."
    )


def _held(found: Identified) -> str:
    """What was not looked for, though it could have been."""
    looked, marionette = {one.name for one in found.record.unknowns}, found.record.marionette
    held = [
        f"{name} {marionette.p[k]:g}"
        for name, k in marionette.parameter_index.items()
        if name not in looked
    ]
    text = f"Parameters held as they were: {', '.join(held)}. " if held else ""
    if still := found.record.still:
        text += f"The inputs do not move {', '.join(still)}."
    return text


def number_table(found: Identified) -> Table:
    """What was found, beside where the search began and what was known."""
    unit, before = units(found.record), from_before(found)
    rows: list[tuple[str, ...]] = []
    wrong = set()
    known = [one.known for one in found.record.unknowns]
    known += [None] * (len(found.names) - len(known))
    for i, (name, x, d, begin, given) in enumerate(
        zip(
            found.names,
            found.values.tolist(),
            found.deviations.tolist(),
            found.record.begin.tolist(),
            known,
            strict=True,
        )
    ):
        told = math.isfinite(d)
        low, high = found.interval(name)
        if not told or before.get(name, 0.0) > _TOLD_BEFORE:
            wrong.add(i)
        rows.append(
            (
                name,
                rounded(x, d) if told else "not told",
                unit[name],
                f"{rounded(low, d)} to {rounded(high, d)}" if told else "",
                f"{d:.2g}" if told else "",
                f"{begin:.6g}",
                "" if given is None else f"± {given:.3g}",
                "" if given is None else f"{100.0 * before[name]:.0f} %",
            )
        )
    header: tuple[str, ...] = (
        "",
        "found>",
        "unit",
        "95 % interval>",
        "standard deviation>",
        "began at>",
        "known before>",
        "from before>",
    )
    if not before:
        header, rows = header[:-2], [row[:-2] for row in rows]
    return Table(header, tuple(rows), frozenset(wrong))


def rounded(x: float, deviation: float) -> str:
    """A number to two digits of its standard deviation."""
    if not (math.isfinite(deviation) and deviation > 0.0):
        return f"{x:.6g}"
    digits = 1 - math.floor(math.log10(deviation))
    return f"{x:.{digits}f}" if 0 <= digits <= 9 else f"{x:.6g}"


def _apart(page: Page, found: Identified) -> None:
    """Numbers that cannot be told apart."""
    if not found.combinations:
        return
    page.section("What could not be told apart")
    page.note(
        "Along each of these, what was measured stays as it is. Shares are relative changes; of "
        "places in steps of 1 cm, of the delay in steps of 10 ms. Weigh or measure one part, or "
        "record a tension; --suggest looks for a motion that tells more."
    )
    page.items(str(combination) for combination in found.combinations)


def _correlated(page: Page, found: Identified) -> None:
    n, C = len(found.names), found.correlation
    if n < 2:
        return
    pairs = sorted(
        ((i, k) for i in range(n) for k in range(i) if abs(C[i, k]) > _CLOSE),
        key=lambda pair: -abs(C[pair]),
    )
    lines = [f"{found.names[k]} and {found.names[i]}: {C[i, k]:+.3f}" for i, k in pairs]
    page.section("Correlations of the numbers' errors")
    page.note(
        "Two numbers near +1 or -1 are told well in one combination only; measuring one of "
        "them tells the other."
    )
    page.items(lines[:MAX_NAMED])
    share = max(0.3, min(0.7, 0.032 * (n + 5)))
    page.drawing(identified_plots.correlations(found), "Correlations of the unknowns", share)


def _explained(page: Page, found: Identified) -> None:
    """Residuals: a table, plots, and outliers."""
    far = [
        f"{outlier.column} at {outlier.t:.3f} s {outlier.residual:+.1f}"
        for outlier in sorted(found.outliers, key=lambda each: -abs(each.residual))[:MAX_NAMED]
    ]
    if more := len(found.outliers) - len(far):
        far.append(f"and {more} more")
    page.section("Residuals")
    page.note(
        "Sample less prediction, outliers included. Noise leaves 95 % within two standard "
        "deviations, and neighbours that do not resemble one another."
    )
    page.table(residual_table(found))
    page.note(
        "Over the noise, by the record's clock. The band is two standard deviations; lines are "
        f"means over {identified_plots.MEAN:g} s, which stay near 0 where the model is right. "
        "Red circles: outliers, those beyond 5 at the edge. Red bands: segments that do not "
        "count. Right: histogram, and the curve of normal noise."
    )
    page.plots(
        (figure, f"Residuals of {', '.join(names)}")
        for figure, names in identified_plots.residuals(found)
    )
    page.text(f"Outliers, in standard deviations: {', '.join(far)}." if far else "")


def residual_table(found: Identified) -> Table:
    """What is left of every column."""
    rows = tuple(
        (
            one.name,
            str(one.samples),
            f"{one.rms:.3g}",
            f"{one.noise:.3g}",
            "given" if one.given else "estimated",
            one.unit,
            f"{100.0 * one.within:.1f} %",
            "" if math.isnan(one.neighbours) else f"{one.neighbours:+.2f}",
            str(one.outliers),
        )
        for one in columns(found)
    )
    wrong = frozenset(k for k, one in enumerate(columns(found)) if one.doubtful)
    header = (
        "column",
        "samples>",
        "root mean square>",
        "noise>",
        "",
        "unit",
        "within 2>",
        "correlation of neighbours>",
        "outliers>",
    )
    return Table(header, rows, wrong)


def _highest(found: Identified) -> str:
    """The highest jumps, one for each time."""
    sizes, names = np.abs(found.jumps), jump_names(found)
    most = np.max(sizes, axis=1)
    high = [k for k in np.argsort(-most) if most[k] > _HIGH][:MAX_NAMED]
    words = [
        f"{most[k]:.0f} at {found.starts[k + 1] + found.delay:.2f} s "
        f"({names[int(np.argmax(sizes[k]))]})"
        for k in high
    ]
    return f"The highest, over the drift: {', '.join(words)}." if words else ""


def _jumps(page: Page, found: Identified) -> None:
    """Jumps between segments, which show where the model is wrong."""
    if len(found.starts) < 2:
        return
    lost = [f"{t + found.delay:.2f} s" for t in found.lost[:MAX_NAMED]]
    more = len(found.lost) - len(lost)
    rest = f" and {more} more." if more else "."
    page.section("Jumps between segments")
    page.note(
        "Every segment begins a little off where the one before ended. Over the drift that was "
        f"allowed, {1e3 * found.allowed[0]:g} mm or mrad and {1e3 * found.allowed[1]:g} a "
        "second, jumps are well below 1 where the model leaves nothing out. They say when and "
        "where it does: a single high one is a catch in another order, a coordinate of one "
        "colour a force or a place that is wrong."
    )
    page.items(str(line) for line in leaning(found)[:MAX_NAMED])
    page.text(_highest(found))
    page.text(f"Segments that do not count, from: {', '.join(lost)}{rest}" if lost else "")
    page.plots([(identified_plots.jumps(found), "Jumps between segments, by coordinate")])
