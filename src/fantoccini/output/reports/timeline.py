"""Timeline of a play: the cues of every player, acts, captions and refused cues.

A cue is a line of the play: a verb with its player and time. A lane is a row of bars that do not
overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.reports.panels import FIGURE_WIDTH
from fantoccini.output.view import LIGHT, RED, blank_figure, one_line, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fantoccini.theatre.plays import CueOfPlay, Play

_LANE_HEIGHT = 21
"""Height of a lane [px]."""
_MAX_ROW_TIME = 60.0
"""Longest duration of a row [s]."""
_CROSS_WIDTH = 0.025
"""Width of the cross of a refused cue, with its number, relative to the row."""
_LETTER_WIDTH = 5.6
"""Mean width of a letter [px]."""

Bar = tuple[float, float, str]
"""Start and end [s], and the text in the bar."""


def draw_timeline(play: Play) -> Figure:
    """Figure of a play's timeline, in rows of at most a minute."""
    end = play.duration
    rows = max(1, int(np.ceil(end / _MAX_ROW_TIME - 1e-9)))
    row_time = end / rows
    lanes = _lanes(play, _CROSS_WIDTH * row_time)
    captions = _stack_bars(
        [(caption.start, caption.end, str(caption)) for caption in play.score.captions]
    )
    n_lanes = sum(len(player_lanes) for player_lanes in lanes.values()) + len(captions)
    left = 20.0 + 7.0 * max(len(one_line(name, 18)) for name in (*lanes, "captions"))
    height = rows * (_LANE_HEIGHT * n_lanes + 74)
    figure = blank_figure((FIGURE_WIDTH, height), facecolor=LIGHT.upper_background)
    for row, axes in enumerate(figure.subplots(rows, 1, squeeze=False)[:, 0]):
        low = height - (row + 1) * (_LANE_HEIGHT * n_lanes + 74) + 40
        axes.set_position(
            (
                left / FIGURE_WIDTH,
                low / height,
                (FIGURE_WIDTH - left - 14) / FIGURE_WIDTH,
                _LANE_HEIGHT * n_lanes / height,
            )
        )
        begin = row * row_time
        axes.set_xlim(begin, begin + row_time)
        axes.set_ylim(n_lanes, 0.0)
        style_axes(axes, LIGHT, "x")
        axes.set_xlabel("time [s]", color=LIGHT.text, fontsize=8, labelpad=1.0)
        px_per_second = (FIGURE_WIDTH - left - 14) / row_time
        _draw_acts(axes, play, begin, begin + row_time, px_per_second)
        _draw_players(axes, play, lanes, px_per_second)
        _draw_captions(axes, captions, n_lanes - len(captions), px_per_second)
        ticks, labels, y = list[float](), list[str](), 0
        for name, count in (
            *((k, len(player_lanes)) for k, player_lanes in lanes.items()),
            *([("captions", len(captions))] if captions else []),
        ):
            ticks.append(y + 0.5 * count)
            labels.append(one_line(name, 18))
            y += count
            axes.axhline(y, color=LIGHT.grid, linewidth=0.5)
        axes.set_yticks(ticks, labels)
        axes.tick_params(axis="y", length=0.0)
        for text in axes.get_yticklabels():
            text.set_parse_math(False)
    return figure


def _lanes(play: Play, cross_width: float) -> dict[str, list[list[tuple[CueOfPlay, Bar]]]]:
    """Player -> lanes of its cues; cues in one lane do not overlap.

    Args:
        play: the compiled play.
        cross_width: width of the cross of a refused cue, with the number before it [s].
    """
    lanes: dict[str, list[list[tuple[CueOfPlay, Bar]]]] = {}
    for name in play.cast.players:
        player_lanes: list[list[tuple[CueOfPlay, Bar]]] = [[]]
        for cue in play.cues:
            if name not in cue.who:
                continue
            marks = cue.marks.get(name)
            if cue.refused or marks is None:
                bar = cue.wanted - cross_width, cue.wanted + 0.4 * cross_width, f"{cue.number}"
            else:
                bar = marks["start"], marks["end"], f"{cue.number} {cue.action}"
            free_lanes = [
                lane for lane in player_lanes if not lane or lane[-1][1][1] <= bar[0] + 1e-9
            ]
            if not free_lanes:
                player_lanes.append([])
                free_lanes = player_lanes[-1:]
            free_lanes[0].append((cue, bar))
        lanes[name] = player_lanes
    return lanes


def _stack_bars(bars: Sequence[Bar]) -> list[list[Bar]]:
    """The bars in lanes in which they do not overlap."""
    lanes: list[list[Bar]] = []
    for bar in sorted(bars):
        for lane in lanes:
            if lane[-1][1] <= bar[0] + 1e-9:
                lane.append(bar)
                break
        else:
            lanes.append([bar])
    return lanes


def _draw_acts(axes: Axes, play: Play, begin: float, end: float, px_per_second: float) -> None:
    """Draws acts as lines with their names above; ``px_per_second`` in px/s, as below."""
    act_times = [*play.acts.values(), play.duration]
    for k, (name, start) in enumerate(play.acts.items()):
        act_end = act_times[k + 1]
        if act_end <= begin or start >= end:
            continue
        axes.axvspan(
            start, act_end, color=LIGHT.grid, alpha=0.25 * (k % 2), linewidth=0.0, zorder=0.2
        )
        axes.axvline(start, color=LIGHT.muted, linewidth=0.8, zorder=1.0)
        visible_start = max(start, begin)
        text = shorten(name, (min(act_end, end) - visible_start) * px_per_second - 6.0)
        annotation = axes.annotate(
            text,
            (visible_start, 0.0),
            (3.0, 4.0),
            textcoords="offset points",
            fontsize=9,
            color=LIGHT.text,
            weight="bold",
            ha="left",
            va="bottom",
            annotation_clip=False,
        )
        annotation.set_parse_math(False)


def _draw_players(
    axes: Axes,
    play: Play,
    lanes: dict[str, list[list[tuple[CueOfPlay, Bar]]]],
    px_per_second: float,
) -> None:
    y = 0
    for k, player_lanes in enumerate(lanes.values()):
        for lane in player_lanes:
            for cue, bar in lane:
                if cue.refused:
                    _draw_refused(axes, cue, y)
                else:
                    _draw_bar(axes, bar, y, LIGHT.colour(k), px_per_second)
                    if cue.go:
                        axes.plot(bar[0], y + 0.5, "|", color=LIGHT.text, markersize=14.0)
            y += 1


def _draw_captions(axes: Axes, lanes: list[list[Bar]], y: int, px_per_second: float) -> None:
    for lane in lanes:
        for bar in lane:
            _draw_bar(axes, bar, y, "#8a857a", px_per_second)
        y += 1


def _draw_bar(axes: Axes, bar: Bar, y: int, colour: str, px_per_second: float) -> None:
    begin, end, label = bar
    low, high = axes.get_xlim()
    if end <= low or begin >= high:
        return
    axes.barh(
        y + 0.5, end - begin, 0.8, begin, color=colour, alpha=0.28, edgecolor=colour, linewidth=0.8
    )
    visible_start = max(begin, low)
    text = shorten(label, (min(end, high) - visible_start) * px_per_second - 5.0)
    annotation = axes.annotate(
        text,
        (visible_start, y + 0.5),
        (2.5, 0.0),
        textcoords="offset points",
        fontsize=7.5,
        color=LIGHT.text,
        ha="left",
        va="center",
        clip_on=True,
    )
    annotation.set_parse_math(False)


def _draw_refused(axes: Axes, cue: CueOfPlay, y: int) -> None:
    low, high = axes.get_xlim()
    if not low <= cue.wanted <= high:
        return
    axes.plot(cue.wanted, y + 0.5, "x", color=RED, markersize=6.0, clip_on=False, zorder=4.0)
    axes.annotate(
        f"{cue.number}",
        (cue.wanted, y + 0.5),
        (-5.0, 0.0),
        textcoords="offset points",
        fontsize=7.5,
        color=RED,
        ha="right",
        va="center",
        zorder=4.0,
    )


def shorten(label: str, width: float) -> str:
    """The text, shortened to a width [px]; of a cue at least the number is kept, if it fits."""
    max_letters = int(width / _LETTER_WIDTH)
    text = one_line(label, 80)
    if len(text) <= max_letters:
        return text
    number = text.split(" ")[0]
    return (
        one_line(text, max_letters)
        if max_letters > len(number) + 3
        else number
        if max_letters >= len(number)
        else ""
    )
