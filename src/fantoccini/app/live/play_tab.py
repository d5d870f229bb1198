"""Tab of a live page's panel for directing a play."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from fantoccini.app.live.perform_tabs import StageActions
from fantoccini.output.html import element, lines, to_html
from fantoccini.theatre.perform import LivePlay
from fantoccini.theatre.plays import CueOfPlay

if TYPE_CHECKING:
    import viser

_MAX_CUE_TEXT = 44
"""Largest length of a cue in the list [characters]."""


class PlayTab:
    """Acts, cues and their state, GO and the other buttons of a live play.

    Args:
        live, gui, tab, command: see :class:`fantoccini.app.live.perform_tabs.GesturesTab`.
        show: the live play.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        command: Callable[[str, str, Callable[[], None]], Any],
        show: LivePlay,
    ):
        self._live, self._show = live, show
        buttons: tuple[tuple[str, str, str, str, str, Callable[[], None]], ...] = (
            (
                "GO (Space)",
                "space",
                "player-skip-forward",
                "green",
                "Begins the play, or the next cue",
                show.go,
            ),
            ("Hold (Y)", "Y", "player-pause", "gray", "Hold or continue", self._hold),
            ("Skip (K)", "K", "player-track-next", "gray", "Go to the next cue", show.skip),
            ("Repeat (J)", "J", "reload", "gray", "Repeat the current cue", show.repeat),
            ("All stop (I)", "I", "hand-stop", "red", "Stop all hands at once", show.panic),
        )
        self._labels: dict[str, Any] = {}
        with tab:
            self._about = gui.add_html("")
            for label, key, icon, colour, hint, do in buttons:
                button = gui.add_button(label, icon=icon, color=colour, hint=hint)
                button.on_click(partial(self._queue, do))
                command(f"Play: {hint}", key, partial(self._run_action, do))
                self._labels[label] = button
            self._players = {}
            for player in show.play.cast.players:
                button = gui.add_button(
                    f"Take {player}",
                    icon="hand-grab",
                    color="gray",
                    hint="Move this player yourself, or return it to the play",
                )
                button.on_click(partial(self._queue, partial(self._take, player)))
                self._players[player] = button
            names = {_listed(cue): cue.number for cue in show.play.cues if not cue.refused}
            if names:
                which = gui.add_dropdown("Cue", tuple(names))
                start = gui.add_button("Start this cue", icon="player-play", color="gray")
                start.on_click(
                    lambda e: self._queue(lambda: show.start(names[str(which.value)]), e)
                )
            self._list = gui.add_html("")

    def update(self) -> None:
        """Shows the current place in the play."""
        show = self._show
        about = _about(show, self._live.stage.messages)
        for part, content in ((self._about, about), (self._list, _cues(show))):
            if part.content != content:
                part.content = content
        hold = self._labels["Hold (Y)"]
        label = "Go on (Y)" if show.is_held else "Hold (Y)"
        if hold.label != label:
            hold.label, hold.icon = label, "player-play" if show.is_held else "player-pause"
        for player, button in self._players.items():
            label = f"Give {player} back" if player in show.taken else f"Take {player}"
            if button.label != label:
                button.label = label

    # -- inside ------------------------------------------------------------------------------

    def _queue(self, do: Callable[[], None], event: Any) -> None:
        self._live.later(event.client_id, partial(self._run_action, do))

    def _run_action(self, do: Callable[[], None]) -> None:
        do()
        self._live.stage.sounds.changed()

    def _hold(self) -> None:
        (self._show.resume if self._show.is_held else self._show.hold)()

    def _take(self, player: str) -> None:
        (self._show.give if player in self._show.taken else self._show.take)(player)


def _listed(cue: CueOfPlay) -> str:
    return f"{cue.number} {cue.description}"[:_MAX_CUE_TEXT]


def _about(show: LivePlay, messages: str) -> str:
    """Time, act, state, next cue and captions, as HTML."""
    t, play = show.t, show.play
    act = [name for name, start in play.acts.items() if start <= t]
    where = f"{act[-1]}, " if act else ""
    state = ""
    if show.voice is None:
        state = "; stands by for GO"
    elif show.done:
        state = "; is over"
    elif show.is_held:
        state = "; is held"
    elif show.waiting is not None:
        state = "; waits for GO"
    cue, status_lines = show.standing_by, list[str]()
    if cue is not None:
        released = ", GO is given" if show.released else ""
        status_lines.append(f"GO begins {cue.number} {cue.description}{released}")
    status_lines += [line for line in (show.message, messages) if line]
    rows = [element("div", f"{where}{t:.1f} s of {play.duration:.1f} s{state}")]
    rows += [element("div", line, style="opacity:0.75") for line in status_lines]
    captions = lines(map(str, play.score.captions_at(t)))
    rows.append(element("div", *captions, style="min-height:1.4em;font-size:1.25em"))
    return to_html(element("div", *rows, style="padding:0 0.5em;font-size:0.85em;line-height:1.45"))


def _cues(show: LivePlay) -> str:
    """All acts and cues with their times, as HTML."""
    current, next_cue = {cue.number for cue in show.playing_cues}, show.standing_by
    rows, act = [], ""
    for cue in show.play.cues:
        if cue.act != act:
            act = cue.act
            start = show.play.acts.get(act, 0.0)
            head = element("b", act), f" {start:.1f} s"
            rows.append(element("div", *head, style="margin-top:0.5em"))
        go = " \N{BLACK RIGHT-POINTING TRIANGLE}" if cue.go else ""
        line = f"{cue.number}{go} {cue.start:.1f} s\N{EN SPACE}{cue.description}"
        if cue.refused:
            reason = element("div", cue.refused, style="padding-left:1.2em")
            rows.append(element("div", element("s", line), reason, style="opacity:0.45"))
            continue
        style = "background:rgba(70,160,90,0.25);" if cue.number in current else ""
        if next_cue is not None and cue.number == next_cue.number:
            style += "border-left:3px solid #46a05a;"
        rows.append(element("div", line, style=f"padding-left:0.3em;{style}"))
    style = "padding:0 0.5em;font-size:0.82em;line-height:1.4;overflow-wrap:anywhere"
    return to_html(element("div", *rows, style=style))
