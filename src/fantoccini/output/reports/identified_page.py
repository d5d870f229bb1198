"""Report of an identification: one self-contained page with pictures.

An identification estimates numbers of a puppet from a record of its motion, cut into segments that
are simulated separately. A jump is the difference of two segments where they meet.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.lab.identification import (
    biased_jumps,
    column_fits,
    doubts,
    jump_names,
    prior_shares,
    units,
)
from fantoccini.output.html import Page, Table, write_page
from fantoccini.output.reports import identified_plots

if TYPE_CHECKING:
    from fantoccini.lab.identification import IdentificationResult

MAX_LISTED = 12
"""Largest number of outliers and of pairs that are listed."""
_HIGH_CORRELATION = 0.9
"""Correlation of two unknowns above which the pair is listed."""
_LARGE_JUMP = 3.0
"""Jump relative to the drift above which it is listed."""
_HIGH_PRIOR_SHARE = 0.9
"""Share of prior knowledge above which an estimate is marked: the record adds little."""


def identified_report(result: IdentificationResult, path: str | os.PathLike[str]) -> Path:
    """Writes the report of an identification: one HTML file, pictures included.

    It has the estimates with their intervals, combinations that the record does not determine,
    reasons for doubt, and plots: samples and predictions, residuals, jumps between segments,
    correlations.

    Args:
        result: result of :func:`fantoccini.identify`.
        path: path that ends in ``.html``.

    Returns:
        The path of the page.

    Raises:
        ValueError: the path has another ending.
        PictureError: it cannot be written.
    """
    return write_page(path, lambda: _page(result))


def _page(result: IdentificationResult) -> Page:
    record, reasons = result.record, doubts(result)
    title = record.name or record.marionette.name
    verdict = (
        f"{len(reasons)} reason{'s' * (len(reasons) > 1)} for doubt"
        if reasons
        else "No reason for doubt: the residuals look like noise"
    )
    page = Page(f"{title}: identification", title)
    page.text(_key_numbers(result))
    page.verdict(f"{verdict}.", not reasons)
    page.items(reasons)
    page.section("Numbers")
    page.table(number_table(result))
    page.note(_prior_note(result))
    page.note(_fixed_note(result))
    page.note(
        "The intervals account for noise only: they assume that every other number of the "
        "puppet's file is right. An error there that the estimates can compensate leaves no "
        "trace on this page."
    )
    _add_undetermined(page, result)
    _add_correlations(page, result)
    _add_residuals(page, result)
    _add_jumps(page, result)
    page.section("Samples and predictions")
    page.note(
        "Dots: samples. Line: prediction with the estimates. Red circles: outliers. Grey: "
        "times without samples. Red bands: rejected segments."
    )
    page.plots(
        (figure, f"Samples and predictions of {', '.join(names)}")
        for figure, names in identified_plots.channel_figures(result)
    )
    return page


def _key_numbers(result: IdentificationResult) -> str:
    record = result.record
    return (
        f"{result.t[-1] - result.t[0]:.1f} s of the puppet {record.marionette.name}, "
        f"{len(result.t)} instants, {int(np.sum(np.isfinite(result.residuals)))} samples in "
        f"{len(column_fits(result))} columns; {len(result.names)} unknowns, "
        f"{len(result.starts)} segments. chi2 {result.chi2:.3f}, drift {result.drift:.2g}."
    )


def _prior_note(result: IdentificationResult) -> str:
    if not prior_shares(result):
        return ""
    return (
        "Prior: the standard deviation of the start value. Prior share: the share of prior "
        "knowledge in the estimate; red if the record adds little."
    )


def _fixed_note(result: IdentificationResult) -> str:
    """Parameters that were not estimated, and coordinates that the inputs do not move."""
    marionette = result.record.marionette
    unknowns = {unknown.name for unknown in result.record.unknowns}
    fixed = [
        f"{name} {marionette.p[k]:g}"
        for name, k in marionette.parameter_index.items()
        if name not in unknowns
    ]
    text = f"Parameters not estimated: {', '.join(fixed)}. " if fixed else ""
    if constant := result.record.constant_inputs:
        text += f"The inputs do not move {', '.join(constant)}."
    return text


def number_table(result: IdentificationResult) -> Table:
    """Estimates with their intervals, start values and prior knowledge."""
    unit_by_name, shares = units(result.record), prior_shares(result)
    rows: list[tuple[str, ...]] = []
    red_rows = set()
    priors = [unknown.known for unknown in result.record.unknowns]
    priors += [None] * (len(result.names) - len(priors))
    for i, (name, value, deviation, start_value, prior) in enumerate(
        zip(
            result.names,
            result.values.tolist(),
            result.deviations.tolist(),
            result.record.initial_values.tolist(),
            priors,
            strict=True,
        )
    ):
        determined = math.isfinite(deviation)
        low, high = result.interval(name)
        if not determined or shares.get(name, 0.0) > _HIGH_PRIOR_SHARE:
            red_rows.add(i)
        rows.append(
            (
                name,
                round_to_deviation(value, deviation) if determined else "undetermined",
                unit_by_name[name],
                f"{round_to_deviation(low, deviation)} to {round_to_deviation(high, deviation)}"
                if determined
                else "",
                f"{deviation:.2g}" if determined else "",
                f"{start_value:.6g}",
                "" if prior is None else f"± {prior:.3g}",
                "" if prior is None else f"{100.0 * shares[name]:.0f} %",
            )
        )
    header: tuple[str, ...] = (
        "",
        "estimate>",
        "unit",
        "95 % interval>",
        "standard deviation>",
        "start value>",
        "prior>",
        "prior share>",
    )
    if not shares:
        header, rows = header[:-2], [row[:-2] for row in rows]
    return Table(header, tuple(rows), frozenset(red_rows))


def round_to_deviation(x: float, deviation: float) -> str:
    """A number, rounded to two digits of its standard deviation."""
    if not (math.isfinite(deviation) and deviation > 0.0):
        return f"{x:.6g}"
    digits = 1 - math.floor(math.log10(deviation))
    return f"{x:.{digits}f}" if 0 <= digits <= 9 else f"{x:.6g}"


def _add_undetermined(page: Page, result: IdentificationResult) -> None:
    """Adds the combinations of numbers that the record does not determine."""
    if not result.combinations:
        return
    page.section("Undetermined combinations")
    page.note(
        "A change along one of these does not change the predictions. Shares are relative changes; "
        "for positions in units of 1 cm, for the delay in units of 10 ms. Weigh or measure a part, "
        "or record a tension; --suggest searches for a more informative motion."
    )
    page.items(str(combination) for combination in result.combinations)


def _add_correlations(page: Page, result: IdentificationResult) -> None:
    n, C = len(result.names), result.correlation
    if n < 2:
        return
    pairs = sorted(
        ((i, k) for i in range(n) for k in range(i) if abs(C[i, k]) > _HIGH_CORRELATION),
        key=lambda pair: -abs(C[pair]),
    )
    lines = [f"{result.names[k]} and {result.names[i]}: {C[i, k]:+.3f}" for i, k in pairs]
    page.section("Correlations of the numbers' errors")
    page.note(
        "If the correlation of two numbers is near +1 or -1, the record determines only one "
        "combination of them; measuring one gives the other."
    )
    page.items(lines[:MAX_LISTED])
    share = max(0.3, min(0.7, 0.032 * (n + 5)))
    page.drawing(identified_plots.correlation_figure(result), "Correlations of the unknowns", share)


def _add_residuals(page: Page, result: IdentificationResult) -> None:
    """Adds the residuals: table, plots and outliers."""
    outliers = [
        f"{outlier.column} at {outlier.t:.3f} s {outlier.residual:+.1f}"
        for outlier in sorted(result.outliers, key=lambda outlier: -abs(outlier.residual))[
            :MAX_LISTED
        ]
    ]
    if n_more := len(result.outliers) - len(outliers):
        outliers.append(f"and {n_more} more")
    page.section("Residuals")
    page.note(
        "Sample minus prediction, outliers included. For pure noise, 95 % are within two standard "
        "deviations and neighbours are not correlated."
    )
    page.table(residual_table(result))
    page.note(
        "In units of the noise, over the record's time. The band is two standard deviations; lines "
        f"are means over {identified_plots.AVERAGING_TIME:g} s, near 0 if the model is right. "
        "Red circles: outliers; those beyond 5 are drawn at the edge. Red bands: rejected "
        "segments. Right: histogram, and the density of normal noise."
    )
    page.plots(
        (figure, f"Residuals of {', '.join(names)}")
        for figure, names in identified_plots.residual_figures(result)
    )
    page.text(f"Outliers, in standard deviations: {', '.join(outliers)}." if outliers else "")


def residual_table(result: IdentificationResult) -> Table:
    """Residuals of every column."""
    rows = tuple(
        (
            column.name,
            str(column.samples),
            f"{column.rms:.3g}",
            f"{column.noise:.3g}",
            "given" if column.given else "estimated",
            column.unit,
            f"{100.0 * column.within_two:.1f} %",
            "" if math.isnan(column.correlation) else f"{column.correlation:+.2f}",
            str(column.outliers),
        )
        for column in column_fits(result)
    )
    red_rows = frozenset(k for k, column in enumerate(column_fits(result)) if column.doubtful)
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
    return Table(header, rows, red_rows)


def _largest_jumps(result: IdentificationResult) -> str:
    """Sentence about the largest jumps, one for each time."""
    sizes, names = np.abs(result.jumps), jump_names(result)
    largest = np.max(sizes, axis=1)
    indices = [k for k in np.argsort(-largest) if largest[k] > _LARGE_JUMP][:MAX_LISTED]
    jump_texts = [
        f"{largest[k]:.0f} at {result.starts[k + 1] + result.delay:.2f} s "
        f"({names[int(np.argmax(sizes[k]))]})"
        for k in indices
    ]
    return f"The largest, relative to the drift: {', '.join(jump_texts)}." if jump_texts else ""


def _add_jumps(page: Page, result: IdentificationResult) -> None:
    """Adds the jumps between segments, which show where the model is wrong."""
    if len(result.starts) < 2:
        return
    rejected_times = [f"{t + result.delay:.2f} s" for t in result.rejected[:MAX_LISTED]]
    n_more = len(result.rejected) - len(rejected_times)
    remainder = f" and {n_more} more." if n_more else "."
    page.section("Jumps between segments")
    page.note(
        "Jump: the difference between the start of a segment and the end of the previous one, "
        f"relative to the allowed drift, {1e3 * result.allowed[0]:g} mm or mrad and "
        f"{1e3 * result.allowed[1]:g} per second. Jumps are well below 1 where the model is "
        "complete, and show when and where it is not: a single large one is a catch in another "
        "order; a coordinate of one colour is a wrong force or position."
    )
    page.items(str(line) for line in biased_jumps(result)[:MAX_LISTED])
    page.text(_largest_jumps(result))
    page.text(
        f"Rejected segments, from: {', '.join(rejected_times)}{remainder}" if rejected_times else ""
    )
    page.plots([(identified_plots.jump_figure(result), "Jumps between segments, by coordinate")])
