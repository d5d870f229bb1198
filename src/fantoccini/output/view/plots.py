"""Plots of a run against time: tensions, active set, energy ledger, driven coordinates.

The active set is the set of taut strings, and the ledger the table of energies and work. q_K are
the driven coordinates, the ends and lengths of strings. In names, D stands for dynamic coordinates,
which move by the equations of motion. At a catch, a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import rotation
from fantoccini.output.view.drawing import blank_figure, one_line, style_axes
from fantoccini.output.view.pictures import check_picture_path, save_figure
from fantoccini.output.view.theme import Theme, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fantoccini.motion import Trajectory

Styles = dict[str, dict[str, Any]]
"""Colour and dashes of each string's lines."""

MAX_LINES = 24
"""Largest number of driven coordinates that are drawn."""
_LENGTH_SUFFIX = ".length"
"""Ending of the name of a driven length."""
_MIN_MOVE = 1e-9
"""Smallest range of a coordinate that moves [m or rad]."""
_LEGEND_SIZE = 8.0
"""Font size of legends [pt]."""
_ROW_GAP = 0.3
"""Distance between two rows of a legend, relative to the font size."""
_LEGEND_MARGIN = 14.0
"""Distance of legends from the panels and the figure's edge, together [px]."""
_MIN_PANEL_WIDTH = 0.25
"""Smallest width of a panel, relative to the figure."""


def plot(
    run: Trajectory,
    path: str | os.PathLike[str] | None = None,
    theme: str | Theme = "light",
    size: tuple[int, int] = (1100, 1000),
    scale: float = 2.0,
) -> Figure:
    """Plots of a run against time, as one matplotlib figure.

    From the top: tensions; active set, with marks at catches; energy ledger, with potential energy
    relative to the start; driven lengths; the other driven coordinates, of which those that move
    if lengths are driven; driven orientations, as rotation vectors. Empty panels are left out.

    Args:
        run: the motion.
        path: file for the figure (``.png``, ``.svg`` or ``.pdf``); None writes none.
        theme: ``light``, ``dark``, or a Theme.
        size: width and height [px].
        scale: pixels of the file per pixel of ``size``.

    Returns:
        The figure, which a notebook displays.
    """
    picture_path = None if path is None else check_picture_path(path)
    theme = theme_of(theme)
    strings = run.tension.names
    figure = blank_figure(size, facecolor=theme.upper_background)
    left = (60.0 + 6.3 * max((len(one_line(n, 24)) for n in strings), default=4)) / size[0]
    styles = {name: line_style(theme, k) for k, name in enumerate(strings)}
    panels: list[tuple[float, Callable[[Axes], None]]] = []
    if strings:
        panels.append((3.0, lambda axes: _draw_tensions(axes, run, styles, theme)))
        height = min(3.4, 0.7 + 0.2 * len(strings))
        panels.append((height, lambda axes: _draw_active_set(axes, run, styles, theme)))
    panels.append((2.4, lambda axes: _draw_energy(axes, run, theme)))
    lengths, others = _driven_scalars(run)
    if lengths:
        panels.append((2.4, lambda axes: _draw_driven(axes, run, lengths, styles, theme)))
    if others:
        panels.append((2.4, lambda axes: _draw_driven(axes, run, others, styles, theme)))
    if run.coordinates.quaternions_K:
        panels.append((2.0, lambda axes: _draw_rotations(axes, run, theme)))
    ratios = [ratio for ratio, _ in panels]
    panel_axes = figure.subplots(
        len(panels),
        1,
        sharex=True,
        squeeze=False,
        gridspec_kw={
            "height_ratios": ratios,
            "left": left,
            "right": 0.83,
            "top": 0.935,
            "bottom": 0.06,
            "hspace": 0.16,
        },
    )[:, 0]
    for axes, (_, draw) in zip(panel_axes, panels, strict=True):
        draw(axes)
        style_axes(axes, theme, "x")
        for text in (*axes.get_yticklabels(), *axes.get_xticklabels()):
            text.set_parse_math(False)
    fit_legends(list(panel_axes))
    panel_axes[-1].set_xlabel("time [s]", color=theme.text)
    start, stop = float(run.t[0]), float(run.t[-1])
    panel_axes[-1].set_xlim(start, stop if stop > start else start + 1.0)
    title = one_line(run.puppet.name if run.puppet else "")
    figure.text(
        left,
        0.962,
        title,
        color=theme.text,
        fontsize=12,
        weight="bold",
        parse_math=False,
        usetex=False,
    )
    if picture_path is not None:
        save_figure(figure, picture_path, scale)
    return figure


def line_style(theme: Theme, k: int) -> dict[str, Any]:
    """Colour and dashes of line k of a plot."""
    dashes = theme.dashes(k)
    return {"color": theme.colour(k), "linestyle": (0, dashes) if dashes else "-"}


def _draw_tensions(axes: Axes, run: Trajectory, styles: Styles, theme: Theme) -> None:
    values = run.tension.values
    undetermined, label = np.zeros(len(run), dtype=bool), "tension [N]"
    for k, name in enumerate(run.tension.names):
        axes.plot(run.t, values[:, k], **styles[name], linewidth=1.2, label=name)
        if run.undetermined is not None:
            undetermined |= run.undetermined.flags(name)
    if np.any(undetermined):
        spans = _true_intervals(run.t, undetermined)
        axes.broken_barh(
            spans,
            (0.0, 1.0),
            transform=axes.get_xaxis_transform(),
            facecolor=theme.muted,
            alpha=0.18,
            linewidth=0.0,
        )
        label += "\ngrey: some undetermined"
    axes.set_ylabel(label, color=theme.text)
    use_powers_of_ten(axes, theme)
    finite = np.abs(values[np.isfinite(values)])
    if finite.size and finite.max() > 0.0:
        # Short peaks may exceed the limit, so that the other values remain legible.
        high = min(finite.max(), 2.5 * max(np.percentile(finite, 99.5), 1e-12))
        low = min(0.0, float(values[np.isfinite(values)].min()))
        axes.set_ylim(1.06 * low, 1.06 * high)
    add_legend(axes, theme)


def _draw_active_set(axes: Axes, run: Trajectory, styles: Styles, theme: Theme) -> None:
    names = run.taut.names
    for k, name in enumerate(names):
        axes.broken_barh(
            _true_intervals(run.t, run.taut.values[:, k]),
            (k - 0.32, 0.64),
            facecolor=styles[name]["color"],
            linewidth=0.0,
            alpha=0.85,
        )
        catch_times = [
            e.t for e in run.events if e.kind in ("catch", "accumulation") and e.name == name
        ]
        axes.plot(
            catch_times,
            np.full(len(catch_times), k + 0.0),
            linestyle="",
            marker="v",
            markersize=4.5,
            color=theme.text,
            markeredgecolor=theme.upper_background,
            markeredgewidth=0.5,
            clip_on=False,
        )
    axes.set_yticks(range(len(names)), [one_line(n, 24) for n in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.text(
        1.012,
        0.98,
        "bar: taut\ngap: slack\n\N{BLACK DOWN-POINTING TRIANGLE} catch",
        transform=axes.transAxes,
        va="top",
        color=theme.muted,
        fontsize=8,
        parse_math=False,
    )


def _draw_energy(axes: Axes, run: Trajectory, theme: Theme) -> None:
    n_lines = 0
    for name in run.ledger.names:
        values = run.ledger[name]
        label = name
        if name == "potential":
            values, label = values - values[0], "potential - start"
        if np.any(np.abs(values) > 0.0):
            axes.plot(run.t, values, linewidth=1.2, label=label, **line_style(theme, n_lines))
            n_lines += 1
    axes.axhline(0.0, color=theme.muted, linewidth=0.6)
    axes.set_ylabel("energy [J]", color=theme.text)
    use_powers_of_ten(axes, theme)
    add_legend(axes, theme)


def _driven_scalars(run: Trajectory) -> tuple[list[int], list[int]]:
    """Indices in q_K of driven lengths, and of other scalars to draw.

    Of the others, those at rest are left out if lengths are driven.
    """
    names = run.coordinates.q_K
    # Orientations have their own panel.
    in_quaternions = {q + i for q, _ in run.coordinates.quaternions_K for i in range(4)}
    lengths = [k for k, name in enumerate(names) if name.endswith(_LENGTH_SUFFIX)]
    others = [k for k in range(len(names)) if k not in {*lengths, *in_quaternions}]
    if lengths:
        others = [k for k in others if np.ptp(run.q_K[:, k]) > _MIN_MOVE]
    return lengths, others


def _draw_driven(
    axes: Axes, run: Trajectory, indices: list[int], styles: Styles, theme: Theme
) -> None:
    """Panel of driven coordinates; either all of them are lengths, or none is."""
    names = list(run.coordinates.q_K)
    is_length = names[indices[0]].endswith(_LENGTH_SUFFIX)
    label = "driven length [m]" if is_length else "driven [m or rad]"
    driven_by = {command: name for name, command in run.coordinates.commands.items()}
    for n, k in enumerate(indices[:MAX_LINES]):
        name = driven_by.get(names[k], names[k])
        owner = name.removesuffix(_LENGTH_SUFFIX)
        style = styles.get(owner, line_style(theme, n))
        if name == names[k]:
            axes.plot(run.t, run.q_K[:, k], **style, linewidth=1.2, label=owner)
            continue
        actual = run.q_D[:, run.coordinates.q_D.index(name)]
        axes.plot(run.t, actual, **style, linewidth=1.2, label=owner)
        axes.plot(
            run.t,
            run.q_K[:, k],
            color=style["color"],
            linewidth=1.0,
            linestyle=(0, (3, 2)),
            label=f"{owner}, command",
        )
    axes.set_ylabel(label, color=theme.text)
    use_powers_of_ten(axes, theme)
    add_legend(axes, theme)


def _draw_rotations(axes: Axes, run: Trajectory, theme: Theme) -> None:
    names = run.coordinates.q_K
    for n, (q, _) in enumerate(run.coordinates.quaternions_K[: MAX_LINES // 3]):
        orientations = rotation.continuous(run.q_K[:, q : q + 4])
        sine = np.linalg.norm(orientations[:, 1:], axis=1)
        angle = 2.0 * np.arctan2(sine, orientations[:, 0])
        vector = orientations[:, 1:] * (angle / np.where(sine > 1e-12, sine, 1.0))[:, None]
        for i, axis in enumerate("xyz"):
            label = f"{names[q].rsplit('.', 1)[0]}.rotation {axis}"
            style = line_style(theme, 3 * n + i)
            axes.plot(run.t, vector[:, i], **style, linewidth=1.2, label=label)
    axes.set_ylabel("driven\nrotation [rad]", color=theme.text)
    use_powers_of_ten(axes, theme)
    add_legend(axes, theme)


def use_powers_of_ten(axes: Axes, theme: Theme) -> None:
    """Writes the power of ten of very small and large numbers above the axis, to save width."""
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4))
    axes.yaxis.get_offset_text().set(color=theme.text, fontsize=8)


def _true_intervals(t: np.ndarray, flags: np.ndarray) -> list[tuple[float, float]]:
    """(start, duration) of each interval of true values; a value holds until the next sample."""
    steps = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    ends = np.append(t, t[-1])
    return [(float(t[a]), float(ends[b] - t[a])) for a, b in steps.reshape(-1, 2)]


def add_legend(axes: Axes, theme: Theme) -> None:
    """Adds the legend at the right of the axes, with as many columns as their height requires."""
    line_handles, labels = axes.get_legend_handles_labels()
    if not line_handles:
        return
    row_height = (1.0 + _ROW_GAP) * _LEGEND_SIZE * axes.figure.dpi / 72.0
    rows = max(1, int(axes.get_window_extent().height / row_height))
    legend_box = axes.legend(
        line_handles,
        [one_line(x, 24) for x in labels],
        loc="upper left",
        bbox_to_anchor=(1.005, 1.03),
        frameon=False,
        fontsize=_LEGEND_SIZE,
        labelcolor=theme.text,
        handlelength=1.3,
        borderaxespad=0.0,
        labelspacing=_ROW_GAP,
        columnspacing=1.0,
        ncols=math.ceil(len(line_handles) / rows),
    )
    for text in legend_box.get_texts():
        text.set_parse_math(False)
        text.set_usetex(False)


def fit_legends(panels: Sequence[Axes]) -> None:
    """Narrows panels, all to the same right end, until the legends beside them are in the figure.

    Panels keep at least a quarter of the figure's width.
    """
    boxes = [box for axes in panels if (box := axes.get_legend()) is not None]
    if not boxes:
        return
    figure_width = panels[0].figure.bbox.width
    right = (
        1.0 - (max(box.get_window_extent().width for box in boxes) + _LEGEND_MARGIN) / figure_width
    )
    for axes in panels:
        position = axes.get_position()
        width = max(min(position.width, right - position.x0), _MIN_PANEL_WIDTH)
        axes.set_position((position.x0, position.y0, width, position.height))
