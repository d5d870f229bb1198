"""Report of a stand's check: one self-contained page with pictures.

A stand is the machine that moves a puppet, and an axis one of its motors. A margin is the remaining
part of a bound, such as the torque.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.output.html import Page, Table, write_page
from fantoccini.output.reports import stand_plots
from fantoccini.stand import QUANTITIES, lost_step_lines, remedies

if TYPE_CHECKING:
    from fantoccini.stand import SlowedRun, StandCheck

MAX_LISTED_LIMITS = 12
"""Largest number of broken limits that are listed."""


def stand_report(
    check: StandCheck,
    path: str | os.PathLike[str],
    slower: tuple[SlowedRun | None, str] | None = None,
) -> Path:
    """Writes the report of a stand's check: one HTML file, pictures included.

    It has the verdict, broken limits and remedies, the margins of every axis, motion and torque
    over time, and torque against speed with the torque available.

    Args:
        check: result of :func:`fantoccini.stand.check_stand`.
        path: path that ends in ``.html``.
        slower: result of :func:`fantoccini.stand.find_slower_tempo`; left out by default.

    Returns:
        The path of the page.

    Raises:
        ValueError: the path has another ending.
        PictureError: it cannot be written.
    """
    return write_page(path, lambda: _page(check, slower))


def _page(check: StandCheck, slower: tuple[SlowedRun | None, str] | None) -> Page:
    stand = check.map.stand
    page = Page(f"{stand.name}: check", stand.name)
    page.text(stand.about)
    page.text(_key_numbers(check))
    page.verdict(check.summary(), check.ok)
    for note in check.notes:
        page.note(note)
    if check.broken:
        page.section("Broken limits")
        page.table(_broken_limits_table(check))
        if check.lost:
            page.subsection("Lost steps")
            page.items(lost_step_lines(check))
        page.section("Remedies")
        page.items(remedies(check))
    if slower is not None:
        page.subsection("A slower tempo, simulated again")
        page.text(slower[1])
        if slower[0] is not None:
            page.table(_slower_table(check, slower[0]))
    page.section("Margins")
    page.note(
        "Distance from every bound at the worst moment, in per cent of the bound; for travel, "
        "the distance from the nearer end in per cent of the travel. A catch is a string that "
        "snaps taut; its bound is the impulse at which a stepper motor loses steps."
    )
    page.drawing(stand_plots.margin_figure(check), f"Margins of the axes of {stand.name}", 0.8)
    page.table(margin_table(check))
    page.section("Torque against speed")
    page.note(
        "At the motor. Grey: available torque. A point beyond it means lost steps, or a motor that "
        "lags."
    )
    page.plots(
        (figure, f"Torque and speed of {', '.join(names)}")
        for figure, names in stand_plots.torque_figures(check)
    )
    page.section("Over time")
    page.note(
        "Dashed: bounds. Red: violations. Torques that the motion does not determine are left out."
    )
    page.plots(
        (figure, f"Motion and torque of {', '.join(names)}")
        for figure, names in stand_plots.time_figures(check)
    )
    page.note(
        "All of this is computed, for winches without slip or lag; nothing was measured on a "
        "machine."
    )
    return page


def _key_numbers(check: StandCheck) -> str:
    run = check.run
    puppet = "" if run.puppet is None else f" of {run.puppet.name}"
    return (
        f"{run.duration:.1f} s{puppet}, method {run.method}; {len(check.axes)} axes, which move "
        f"{len(check.map.names)} driven coordinates."
    )


def _broken_limits_table(check: StandCheck) -> Table:
    lines = tuple(
        (
            f"{limit.broken:.3f}",
            limit.axis,
            limit.quantity,
            f"{limit.value:.4g}",
            f"{limit.bound:.4g}",
            limit.unit,
            f"{limit.t:.3f}",
            limit.excess_text,
        )
        for limit in check.broken[:MAX_LISTED_LIMITS]
    )
    header = (
        "first at [s]>",
        "axis",
        "quantity",
        "needed>",
        "available>",
        "unit",
        "worst at [s]>",
        "over>",
    )
    return Table(header, lines, frozenset(range(len(lines))))


def margin_table(check: StandCheck) -> Table:
    """Margin of every axis and quantity [%]."""
    checked = {limit.quantity for limit in check.limits} | {"torque"}
    quantities = [q for q in QUANTITIES if q in checked]
    lines, red_lines = [], set()
    for i, axis in enumerate(check.axes):
        limits = check.limits_of_axis(axis.name)
        cells = [check.margin_text(axis.name, q) for q in quantities]
        lines.append((axis.name, axis.kind, *cells))
        if any(limit.broken is not None for limit in limits.values()):
            red_lines.add(i)
    header = ("axis", "motor", *(f"{q} [%]>" for q in quantities))
    return Table(header, tuple(lines), frozenset(red_lines))


def _slower_table(check: StandCheck, slowed_run: SlowedRun) -> Table:
    rows: list[Sequence[str]] = []
    for axis in check.axes:
        limits, slowed_limits = (
            check.limits_of_axis(axis.name),
            slowed_run.check.limits_of_axis(axis.name),
        )
        worst = min(limits.values(), key=lambda limit: limit.margin)
        slowed_limit = slowed_limits.get(worst.quantity)
        margin = "" if slowed_limit is None else f"{slowed_limit.margin:.0f}"
        rows.append((axis.name, worst.quantity, f"{worst.margin:.0f}", margin))
    header = ("axis", "smallest margin", "now [%]>", f"{slowed_run.factor:.3g} times as long [%]>")
    return Table(header, tuple(tuple(row) for row in rows))
