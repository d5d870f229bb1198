"""Tab of a live page's panel for playing a score."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from fantoccini.app.live.perform_tabs import StageActions
from fantoccini.output.html import element, lines, to_html
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
        live, gui, tab, command: see :class:`fantoccini.app.live.perform_tabs.GesturesTab`.
        theme: colours.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        command: Callable[[str, str, Callable[[], None]], Any],
        theme: Theme,
    ):
        self._live, self._gui, self._tab, self._theme = live, gui, tab, theme
        self._removable: list[Any] = []
        self._score: Score | None = None
        with tab:
            self._changes = gui.add_html("", visible=False)
            self._about = gui.add_html("")
            self._go = gui.add_button(
                "GO (Space)",
                icon="player-skip-forward",
                color="green",
                hint="Begin, or continue after a wait",
            )
            self._play = gui.add_button("Play (Y)", icon="player-play")
            stop = gui.add_button("Stop", icon="player-stop", color="gray")
        self._go.on_click(lambda e: live.later(e.client_id, live.stage.go))
        self._play.on_click(lambda e: live.later(e.client_id, live.stage.play_score))
        stop.on_click(lambda e: live.later(e.client_id, live.stage.stop_score))
        command("GO: begin or continue the score", "space", live.stage.go)
        command("Play or pause the score", "Y", live.stage.play_score)

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
        places = {**score.marks, **{wait.name: wait.t for wait in score.waits}}
        places = dict(sorted(places.items(), key=lambda place: place[1]))
        with self._tab:
            self._time = self._gui.add_slider("Time [s]", 0.0, round(score.duration, 2), 0.01, 0.0)
            self._line = self._gui.add_html("")
            self._removable += [self._time, self._line]
            if places:
                where = self._gui.add_button_group("Go to", ("start", *places))
                where.on_click(self._go_to)
                self._removable.append(where)
        self._time.on_update(self._slid)

    def update(self) -> None:
        """Shows the current place in the score."""
        score = self._score
        if score is None:
            return
        playing = self._live.stage.performance.score
        t = 0.0 if playing is None else playing.t
        if abs(self._time.value - round(t, 2)) > 0.005:
            self._time.value = round(t, 2)
        content = drawing(score, t, self._theme)
        if self._line.content != content:
            self._line.content = content
        status = _status_html(score, t, None if playing is None else playing.conductor.waiting)
        if self._about.content != status:
            self._about.content = status
        runs = playing is not None and playing.running and not playing.conductor.done
        label = "Pause (Y)" if runs else "Play (Y)"
        if self._play.label != label:
            self._play.label = label
            self._play.icon = "player-pause" if runs else "player-play"

    # -- inside ------------------------------------------------------------------------------

    async def _go_to(self, event: Any) -> None:
        name = str(event.target.value)
        to = 0.0 if name == "start" else name
        self._live.later(event.client_id, lambda: self._live.stage.seek(to))

    async def _slid(self, event: Any) -> None:
        if event.client_id is not None:
            t = float(self._time.value)
            self._live.later(event.client_id, lambda: self._live.stage.seek(t))


def drawing(score: Score, t: float, theme: Theme) -> str:
    """Lanes with gestures, marks, waits and the current time, as SVG."""
    lanes = tuple(dict.fromkeys(cue.lane for cue in score.cues))
    scale, row, ink = _SIZES.width / score.duration, _SIZES.row, to_hex(theme.text)
    top = row * len(lanes)
    parts = [
        element("text", lane, x="0", y=f"{row * k + 9}", opacity="0.6")
        for k, lane in enumerate(lanes)
    ]
    for cue in score.cues[: _SIZES.max_items]:
        k = lanes.index(cue.lane)
        x, y, width = cue.start * scale, row * k + 11, max((cue.end - cue.start) * scale - 1.0, 1.5)
        bar = {"x": f"{x:.1f}", "y": f"{y}", "width": f"{width:.1f}", "height": f"{_SIZES.bar}"}
        shade = "0.9" if cue.start <= t < cue.end else "0.45"
        parts.append(element("rect", **bar, rx="2", fill=theme.colour(k), opacity=shade))
        if len(cue.gesture) * _SIZES.letter < width:
            parts.append(element("text", cue.gesture, x=f"{x + 3:.1f}", y=f"{y + 9}"))
    names = [(at, name, "3 2") for name, at in score.marks.items()]
    names += [(wait.t, wait.name, "") for wait in score.waits]
    for at, name, dash in sorted(names)[: _SIZES.max_items]:
        x = min(at, score.duration) * scale
        near_end = x > 0.7 * _SIZES.width
        place = {"x": f"{x + (-3 if near_end else 3):.1f}", "y": f"{top + 9}"}
        line = _upright(x, top + 10, ink)
        parts += [
            element("line", **line, opacity="0.5", stroke_dasharray=dash),
            element("text", name, **place, text_anchor="end" if near_end else "start"),
        ]
    parts.append(element("line", **_upright(t * scale, top, ink), stroke_width="1.6"))
    box = f"-4 0 {_SIZES.width + 8} {top + 14}"
    style = "width:100%;display:block"
    return to_html(element("svg", *parts, viewBox=box, style=style, font_size="9", fill=ink))


def _upright(x: float, height: int, ink: str) -> dict[str, str]:
    """Attributes of a vertical line from the top."""
    place = f"{x:.1f}"
    return {"x1": place, "x2": place, "y1": "0", "y2": f"{height}", "stroke": ink}


def _changes_html(changes: tuple[str, ...]) -> str:
    """Changes to the score, as HTML."""
    listed = list(changes[: _SIZES.max_changes])
    if len(changes) > len(listed):
        listed.append(f"and {len(changes) - len(listed)} more")
    box = (
        "margin:0 0.5em;padding:0.4em 0.7em;border-left:4px solid #d9a23b;"
        "font-size:0.82em;overflow-wrap:anywhere"
    )
    head = element("b", "Changes to the score:")
    return to_html(element("div", head, *lines(listed), style=box))


def _status_html(score: Score, t: float, waiting: Any) -> str:
    """Time, beat and caption, as HTML."""
    where = f"{score.name}: {t:.1f} s of {score.duration:.1f} s"
    if score.tempo is not None:
        where += f", beat {t / score.beat:.1f}"
    if waiting is not None:
        where += f"; waits at {waiting.name} for GO"
    cues = ", ".join(dict.fromkeys(cue.gesture for cue in score.cues if cue.start <= t < cue.end))
    captions = lines(map(str, score.captions_at(t)))
    rows = [
        element("div", where),
        element("div", cues or "\N{NO-BREAK SPACE}", style="opacity:0.75"),
        element("div", *captions, style="min-height:1.4em;font-size:1.25em"),
    ]
    return to_html(element("div", *rows, style="padding:0 0.5em;font-size:0.85em;line-height:1.45"))
