"""Tab of a live page's panel for playing a score.

A score times gestures in lanes, whose offsets add up; a cue is one of its lines, and a mark a named
time. GO ends a wait.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from fantoccini.app.live.perform_tabs import StageActions
from fantoccini.output.html import element, line_elements, to_html
from fantoccini.output.view import Theme, to_hex
from fantoccini.theatre.gestures import Score

if TYPE_CHECKING:
    import viser


class _Sizes(NamedTuple):
    """Sizes of the drawing [px], and limits of its contents."""

    width: int = 296
    row: int = 26
    bar: int = 12
    letter: float = 5.2  # Width of a letter of a gesture's name
    max_items: int = 200  # Largest number of gestures, and of marks and waits
    max_changes: int = 12  # Lines about changes to the score


_SIZES = _Sizes()


class ScoreTab:
    """Timeline of a score, with its marks and captions, and GO.

    Args:
        live, gui, tab, add_key: see :class:`fantoccini.app.live.perform_tabs.GesturesTab`.
        theme: colours.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        add_key: Callable[[str, str, Callable[[], None]], Any],
        theme: Theme,
    ):
        self._live, self._gui, self._tab, self._theme = live, gui, tab, theme
        self._removable: list[Any] = []
        self._score: Score | None = None
        with tab:
            self._changes = gui.add_html("", visible=False)
            self._status = gui.add_html("")
            self._go = gui.add_button(
                "GO (Space)",
                icon="player-skip-forward",
                color="green",
                hint="Begin, or continue after a wait",
            )
            self._play = gui.add_button("Play (Y)", icon="player-play")
            stop = gui.add_button("Stop", icon="player-stop", color="gray")
        self._go.on_click(lambda e: live.enqueue(e.client_id, live.stage.go))
        self._play.on_click(lambda e: live.enqueue(e.client_id, live.stage.play_score))
        stop.on_click(lambda e: live.enqueue(e.client_id, live.stage.stop_score))
        add_key("GO: begin or continue the score", "space", live.stage.go)
        add_key("Play or pause the score", "Y", live.stage.play_score)

    def build(self) -> None:
        """Shows the timeline of the current score."""
        score = self._live.stage.score
        if score is self._score:
            return
        self._score = score
        for node in self._removable:
            node.remove()
        self._removable.clear()
        changes = () if score is None else tuple(map(str, score.changes))
        self._changes.content, self._changes.visible = _changes_html(changes), bool(changes)
        if score is None:
            return
        mark_times = {**score.marks, **{wait.name: wait.t for wait in score.waits}}
        mark_times = dict(sorted(mark_times.items(), key=lambda entry: entry[1]))
        with self._tab:
            self._time = self._gui.add_slider("Time [s]", 0.0, round(score.duration, 2), 0.01, 0.0)
            self._timeline = self._gui.add_html("")
            self._removable += [self._time, self._timeline]
            if mark_times:
                mark_buttons = self._gui.add_button_group("Go to", ("start", *mark_times))
                mark_buttons.on_click(self._go_to)
                self._removable.append(mark_buttons)
        self._time.on_update(self._seek_slider)

    def update(self) -> None:
        """Shows the current place in the score."""
        score = self._score
        if score is None:
            return
        voice = self._live.stage.performance.score
        t = 0.0 if voice is None else voice.t
        if abs(self._time.value - round(t, 2)) > 0.005:
            self._time.value = round(t, 2)
        content = timeline_svg(score, t, self._theme)
        if self._timeline.content != content:
            self._timeline.content = content
        status = _status_html(score, t, None if voice is None else voice.conductor.waiting)
        if self._status.content != status:
            self._status.content = status
        is_running = voice is not None and voice.running and not voice.conductor.done
        label = "Pause (Y)" if is_running else "Play (Y)"
        if self._play.label != label:
            self._play.label = label
            self._play.icon = "player-pause" if is_running else "player-play"

    # -- inside ------------------------------------------------------------------------------

    async def _go_to(self, event: Any) -> None:
        name = str(event.target.value)
        target = 0.0 if name == "start" else name
        self._live.enqueue(event.client_id, lambda: self._live.stage.seek(target))

    async def _seek_slider(self, event: Any) -> None:
        if event.client_id is not None:
            t = float(self._time.value)
            self._live.enqueue(event.client_id, lambda: self._live.stage.seek(t))


def timeline_svg(score: Score, t: float, theme: Theme) -> str:
    """Lanes with gestures, marks, waits and the current time, as SVG."""
    lanes = tuple(dict.fromkeys(cue.lane for cue in score.cues))
    scale, row, text_colour = _SIZES.width / score.duration, _SIZES.row, to_hex(theme.text)
    lanes_height = row * len(lanes)
    elements = [
        element("text", lane, x="0", y=f"{row * k + 9}", opacity="0.6")
        for k, lane in enumerate(lanes)
    ]
    for cue in score.cues[: _SIZES.max_items]:
        k = lanes.index(cue.lane)
        x, y, width = cue.start * scale, row * k + 11, max((cue.end - cue.start) * scale - 1.0, 1.5)
        bar = {"x": f"{x:.1f}", "y": f"{y}", "width": f"{width:.1f}", "height": f"{_SIZES.bar}"}
        shade = "0.9" if cue.start <= t < cue.end else "0.45"
        elements.append(element("rect", **bar, rx="2", fill=theme.colour(k), opacity=shade))
        if len(cue.gesture) * _SIZES.letter < width:
            elements.append(element("text", cue.gesture, x=f"{x + 3:.1f}", y=f"{y + 9}"))
    names = [(time, name, "3 2") for name, time in score.marks.items()]
    names += [(wait.t, wait.name, "") for wait in score.waits]
    for time, name, dash in sorted(names)[: _SIZES.max_items]:
        x = min(time, score.duration) * scale
        near_end = x > 0.7 * _SIZES.width
        position = {"x": f"{x + (-3 if near_end else 3):.1f}", "y": f"{lanes_height + 9}"}
        line = _vertical_line(x, lanes_height + 10, text_colour)
        elements += [
            element("line", **line, opacity="0.5", stroke_dasharray=dash),
            element("text", name, **position, text_anchor="end" if near_end else "start"),
        ]
    elements.append(
        element("line", **_vertical_line(t * scale, lanes_height, text_colour), stroke_width="1.6")
    )
    view_box = f"-4 0 {_SIZES.width + 8} {lanes_height + 14}"
    style = "width:100%;display:block"
    return to_html(
        element("svg", *elements, viewBox=view_box, style=style, font_size="9", fill=text_colour)
    )


def _vertical_line(x: float, height: int, colour: str) -> dict[str, str]:
    """Attributes of a vertical line from the top."""
    x_text = f"{x:.1f}"
    return {"x1": x_text, "x2": x_text, "y1": "0", "y2": f"{height}", "stroke": colour}


def _changes_html(changes: tuple[str, ...]) -> str:
    """Changes to the score, as HTML."""
    shown_changes = list(changes[: _SIZES.max_changes])
    if len(changes) > len(shown_changes):
        shown_changes.append(f"and {len(changes) - len(shown_changes)} more")
    box_style = (
        "margin:0 0.5em;padding:0.4em 0.7em;border-left:4px solid #d9a23b;"
        "font-size:0.82em;overflow-wrap:anywhere"
    )
    heading = element("b", "Changes to the score:")
    return to_html(element("div", heading, *line_elements(shown_changes), style=box_style))


def _status_html(score: Score, t: float, waiting: Any) -> str:
    """Time, beat and caption, as HTML."""
    position_text = f"{score.name}: {t:.1f} s of {score.duration:.1f} s"
    if score.tempo is not None:
        position_text += f", beat {t / score.beat:.1f}"
    if waiting is not None:
        position_text += f"; waits at {waiting.name} for GO"
    cues = ", ".join(dict.fromkeys(cue.gesture for cue in score.cues if cue.start <= t < cue.end))
    captions = line_elements(map(str, score.captions_at(t)))
    rows = [
        element("div", position_text),
        element("div", cues or "\N{NO-BREAK SPACE}", style="opacity:0.75"),
        element("div", *captions, style="min-height:1.4em;font-size:1.25em"),
    ]
    return to_html(element("div", *rows, style="padding:0 0.5em;font-size:0.85em;line-height:1.45"))
