"""The tab of a live page's panel on which a play is directed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from fantoccini.app.live.perform_tabs import StageActions
from fantoccini.app.pages import text
from fantoccini.theatre.perform import Show
from fantoccini.theatre.plays import CueOfPlay

if TYPE_CHECKING:
    import viser

_NAME = 44
"""Characters of a cue in the list."""


class PlayTab:
    """Acts and cues, which one is on, GO and the other buttons of a show.

    Args:
        live, gui, tab, command: see :class:`fantoccini.app.live.perform_tabs.GesturesTab`.
        show: that is directed.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        command: Callable[[str, str, Callable[[], None]], Any],
        show: Show,
    ):
        self._live, self._show = live, show
        acts: tuple[tuple[str, str, str, str, str, Callable[[], None]], ...] = (
            (
                "GO (Space)",
                "space",
                "player-skip-forward",
                "green",
                "Begins the play, or the cue that stands by",
                show.go,
            ),
            ("Hold (Y)", "Y", "player-pause", "gray", "The hands rest; goes on", self._hold),
            ("Skip (K)", "K", "player-track-next", "gray", "To the next cue", show.skip),
            ("Repeat (J)", "J", "reload", "gray", "The present cue once more", show.repeat),
            ("All stop (I)", "I", "hand-stop", "red", "All hands stop at once", show.panic),
        )
        self._labels: dict[str, Any] = {}
        with tab:
            self._about = gui.add_html("")
            for label, key, icon, colour, hint, do in acts:
                button = gui.add_button(label, icon=icon, color=colour, hint=hint)
                button.on_click(partial(self._asked, do))
                command(f"Play: {hint}", key, partial(self._do, do))
                self._labels[label] = button
            self._players = {}
            for who in show.play.cast.players:
                button = gui.add_button(
                    f"Take {who}",
                    icon="hand-grab",
                    color="gray",
                    hint="Into your hands, or back to the play",
                )
                button.on_click(partial(self._asked, partial(self._take, who)))
                self._players[who] = button
            names = {_listed(cue): cue.number for cue in show.play.cues if not cue.refused}
            if names:
                which = gui.add_dropdown("Cue", tuple(names))
                start = gui.add_button("Start this cue", icon="player-play", color="gray")
                start.on_click(
                    lambda e: self._asked(lambda: show.start(names[str(which.value)]), e)
                )
            self._list = gui.add_html("")

    def update(self) -> None:
        """Shows where in the play it is."""
        show = self._show
        about = _about(show, self._live.stage.messages)
        for part, content in ((self._about, about), (self._list, _cues(show))):
            if part.content != content:
                part.content = content
        hold = self._labels["Hold (Y)"]
        label = "Go on (Y)" if show.held else "Hold (Y)"
        if hold.label != label:
            hold.label, hold.icon = label, "player-play" if show.held else "player-pause"
        for who, button in self._players.items():
            label = f"Give {who} back" if who in show.taken else f"Take {who}"
            if button.label != label:
                button.label = label

    # -- inside ------------------------------------------------------------------------------

    def _asked(self, do: Callable[[], None], event: Any) -> None:
        self._live.later(event.client_id, partial(self._do, do))

    def _do(self, do: Callable[[], None]) -> None:
        do()
        self._live.stage.sounds.changed()

    def _hold(self) -> None:
        (self._show.resume if self._show.held else self._show.hold)()

    def _take(self, who: str) -> None:
        (self._show.give if who in self._show.taken else self._show.take)(who)


def _listed(cue: CueOfPlay) -> str:
    return f"{cue.number} {cue.what}"[:_NAME]


def _about(show: Show, messages: str) -> str:
    """Time, act, what is on and what stands by, and the caption, as HTML."""
    t, play = show.t, show.play
    act = [name for name, start in play.acts.items() if start <= t]
    where = f"{text(act[-1])}, " if act else ""
    state = ""
    if show.voice is None:
        state = "; stands by for GO"
    elif show.done:
        state = "; is over"
    elif show.held:
        state = "; is held"
    elif show.waiting is not None:
        state = "; waits for GO"
    cue, lines = show.standing_by, []
    if cue is not None:
        given = ", GO is given" if show.released else ""
        lines.append(f"GO begins {cue.number} {text(cue.what)}{given}")
    lines += [text(line) for line in (show.message, messages) if line]
    words = "<br>".join(text(str(one)) for one in play.score.captions_at(t))
    return (
        '<div style="padding:0 0.5em;font-size:0.85em;line-height:1.45">'
        f"<div>{where}{t:.1f} s of {play.duration:.1f} s{state}</div>"
        + "".join(f'<div style="opacity:0.75">{line}</div>' for line in lines)
        + f'<div style="min-height:1.4em;font-size:1.25em">{words}</div></div>'
    )


def _cues(show: Show) -> str:
    """All acts and cues with their times, as HTML."""
    on, waits = {cue.number for cue in show.on}, show.standing_by
    rows, act = [], ""
    for cue in show.play.cues:
        if cue.act != act:
            act = cue.act
            start = show.play.acts.get(act, 0.0)
            rows.append(f'<div style="margin-top:0.5em"><b>{text(act)}</b> {start:.1f} s</div>')
        go = " &#9654;" if cue.go else ""
        line = f"{cue.number}{go} {cue.start:.1f} s&ensp;{text(cue.what)}"
        if cue.refused:
            rows.append(
                f'<div style="opacity:0.45"><s>{line}</s><div style="padding-left:1.2em">'
                f"{text(cue.refused)}</div></div>"
            )
            continue
        look = "background:rgba(70,160,90,0.25);" if cue.number in on else ""
        if waits is not None and cue.number == waits.number:
            look += "border-left:3px solid #46a05a;"
        rows.append(f'<div style="padding-left:0.3em;{look}">{line}</div>')
    return (
        '<div style="padding:0 0.5em;font-size:0.82em;line-height:1.4;overflow-wrap:anywhere">'
        f"{''.join(rows)}</div>"
    )
