"""The tab of a live page's panel on which a score is played."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from fantoccini.app.live.perform_tabs import StageActions
from fantoccini.app.pages import text
from fantoccini.output.view import Theme, to_hex
from fantoccini.theatre.gestures import Score

if TYPE_CHECKING:
    import viser


class _Sizes(NamedTuple):
    """Of the drawing [px], and how much is drawn."""

    width: int = 296
    row: int = 26
    bar: int = 12
    letter: float = 5.2  # Width of a letter of a gesture's name
    most: int = 200  # Gestures, marks and waits, each
    changes: int = 12  # Lines about what is not as it is written


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
        self._made: list[Any] = []
        self._score: Score | None = None
        with tab:
            self._changes = gui.add_html("", visible=False)
            self._about = gui.add_html("")
            self._go = gui.add_button(
                "GO (Space)",
                icon="player-skip-forward",
                color="green",
                hint="Begins; goes on where it waits",
            )
            self._play = gui.add_button("Play (Y)", icon="player-play")
            stop = gui.add_button("Stop", icon="player-stop", color="gray")
        self._go.on_click(lambda e: live.later(e.client_id, live.stage.go))
        self._play.on_click(lambda e: live.later(e.client_id, live.stage.play_score))
        stop.on_click(lambda e: live.later(e.client_id, live.stage.stop_score))
        command("GO: the score begins or goes on", "space", live.stage.go)
        command("Play or pause the score", "Y", live.stage.play_score)

    def build(self) -> None:
        """Shows the timeline of the score that there is now."""
        score = self._live.stage.score
        if score is self._score:
            return
        self._score = score
        for one in self._made:
            one.remove()
        self._made.clear()
        changes = () if score is None else tuple(map(str, score.changes))
        self._changes.content, self._changes.visible = _changed(changes), bool(changes)
        if score is None:
            return
        places = {**score.marks, **{wait.name: wait.t for wait in score.waits}}
        places = dict(sorted(places.items(), key=lambda one: one[1]))
        with self._tab:
            self._time = self._gui.add_slider("Time [s]", 0.0, round(score.duration, 2), 0.01, 0.0)
            self._line = self._gui.add_html("")
            self._made += [self._time, self._line]
            if places:
                where = self._gui.add_button_group("Go to", ("start", *places))
                where.on_click(self._go_to)
                self._made.append(where)
        self._time.on_update(self._slid)

    def update(self) -> None:
        """Shows where in the score it is."""
        score = self._score
        if score is None:
            return
        playing = self._live.stage.performance.score
        t = 0.0 if playing is None else playing.t
        if abs(self._time.value - round(t, 2)) > 0.005:
            self._time.value = round(t, 2)
        drawn = drawing(score, t, self._theme)
        if self._line.content != drawn:
            self._line.content = drawn
        said = _said(score, t, None if playing is None else playing.conductor.waiting)
        if self._about.content != said:
            self._about.content = said
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
    """Lanes with their gestures, marks and waits, and where it is, as SVG."""
    lanes = tuple(dict.fromkeys(one.lane for one in score.cues))
    scale, row, ink = _SIZES.width / score.duration, _SIZES.row, to_hex(theme.ink)
    top = row * len(lanes)
    parts = []
    for k, lane in enumerate(lanes):
        parts.append(f'<text x="0" y="{row * k + 9}" opacity="0.6">{text(lane)}</text>')
    for one in score.cues[: _SIZES.most]:
        k = lanes.index(one.lane)
        x, y, wide = one.start * scale, row * k + 11, max((one.end - one.start) * scale - 1.0, 1.5)
        now = one.start <= t < one.end
        parts.append(
            f'<rect x="{x:.1f}" y="{y}" width="{wide:.1f}" height="{_SIZES.bar}" rx="2" '
            f'fill="{theme.colour(k)}" opacity="{0.9 if now else 0.45}"/>'
        )
        if len(one.gesture) * _SIZES.letter < wide:
            parts.append(f'<text x="{x + 3:.1f}" y="{y + 9}">{text(one.gesture)}</text>')
    names = [(at, name, "3 2") for name, at in score.marks.items()]
    names += [(wait.t, wait.name, "") for wait in score.waits]
    for at, name, dash in sorted(names)[: _SIZES.most]:
        x = min(at, score.duration) * scale
        end = "end" if x > 0.7 * _SIZES.width else "start"
        parts.append(
            f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{top + 10}" stroke="{ink}" opacity="0.5" '
            f'stroke-dasharray="{dash}"/><text x="{x + (-3 if end == "end" else 3):.1f}" '
            f'y="{top + 9}" text-anchor="{end}">{text(name)}</text>'
        )
    x = t * scale
    parts.append(
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{top}" stroke="{ink}" stroke-width="1.6"/>'
    )
    return (
        f'<svg viewBox="-4 0 {_SIZES.width + 8} {top + 14}" style="width:100%;display:block" '
        f'font-size="9" fill="{ink}">{"".join(parts)}</svg>'
    )


def _changed(changes: tuple[str, ...]) -> str:
    """What is not as it is written, as HTML."""
    lines = list(changes[: _SIZES.changes])
    if len(changes) > len(lines):
        lines.append(f"and {len(changes) - len(lines)} more")
    return (
        '<div style="margin:0 0.5em;padding:0.4em 0.7em;border-left:4px solid #d9a23b;'
        'font-size:0.82em;overflow-wrap:anywhere"><b>Not as it is written:</b>'
        f"{''.join(f'<div>{text(line)}</div>' for line in lines)}</div>"
    )


def _said(score: Score, t: float, waiting: Any) -> str:
    """Time, beat and caption, as HTML."""
    where = f"{t:.1f} s of {score.duration:.1f} s"
    if score.tempo is not None:
        where += f", beat {t / score.beat:.1f}"
    if waiting is not None:
        where += f"; waits at {text(waiting.name)} for GO"
    words = "<br>".join(text(str(one)) for one in score.captions_at(t))
    cues = ", ".join(dict.fromkeys(one.gesture for one in score.cues if one.start <= t < one.end))
    return (
        f'<div style="padding:0 0.5em;font-size:0.85em;line-height:1.45"><div>{text(score.name)}: '
        f'{where}</div><div style="opacity:0.75">{text(cues) or "&nbsp;"}</div>'
        f'<div style="min-height:1.4em;font-size:1.25em">{words}</div></div>'
    )
