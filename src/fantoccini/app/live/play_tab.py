"""Tab of a live page's panel for directing a play.

A cue is a line of the play: a verb with its player and time. GO starts the next one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from fantoccini.app.live.perform_tabs import StageActions
from fantoccini.output.html import element, line_elements, to_html
from fantoccini.theatre.perform import LivePlay
from fantoccini.theatre.plays import CueOfPlay

if TYPE_CHECKING:
    import viser

_MAX_CUE_TEXT = 44
"""Largest length of a cue in the list [characters]."""


class PlayTab:
    """Acts, cues and their state, GO and the other buttons of a live play.

    Args:
        live, gui, tab, add_key: see :class:`fantoccini.app.live.perform_tabs.GesturesTab`.
        live_play: the live play.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        add_key: Callable[[str, str, Callable[[], None]], Any],
        live_play: LivePlay,
    ):
        self._live, self._live_play = live, live_play
        buttons: tuple[tuple[str, str, str, str, str, Callable[[], None]], ...] = (
            (
                "GO (Space)",
                "space",
                "player-skip-forward",
                "green",
                "Begins the play, or the next cue",
                live_play.go,
            ),
            ("Hold (Y)", "Y", "player-pause", "gray", "Hold or continue", self._hold),
            ("Skip (K)", "K", "player-track-next", "gray", "Go to the next cue", live_play.skip),
            ("Repeat (J)", "J", "reload", "gray", "Repeat the current cue", live_play.repeat),
            ("All stop (I)", "I", "hand-stop", "red", "Stop all hands at once", live_play.panic),
        )
        self._labels: dict[str, Any] = {}
        with tab:
            self._status = gui.add_html("")
            for label, key, icon, colour, hint, action in buttons:
                button = gui.add_button(label, icon=icon, color=colour, hint=hint)
                button.on_click(partial(self._queue, action))
                add_key(f"Play: {hint}", key, partial(self._run_action, action))
                self._labels[label] = button
            self._players = {}
            for player in live_play.play.cast.players:
                button = gui.add_button(
                    f"Take {player}",
                    icon="hand-grab",
                    color="gray",
                    hint="Move this player yourself, or return it to the play",
                )
                button.on_click(partial(self._queue, partial(self._take, player)))
                self._players[player] = button
            names = {_cue_label(cue): cue.number for cue in live_play.play.cues if not cue.refused}
            if names:
                cue_choice = gui.add_dropdown("Cue", tuple(names))
                start = gui.add_button("Start this cue", icon="player-play", color="gray")
                start.on_click(
                    lambda e: self._queue(lambda: live_play.start(names[str(cue_choice.value)]), e)
                )
            self._list = gui.add_html("")

    def update(self) -> None:
        """Shows the current place in the play."""
        live_play = self._live_play
        status = _status_html(live_play, self._live.stage.messages)
        for widget, content in ((self._status, status), (self._list, _cues_html(live_play))):
            if widget.content != content:
                widget.content = content
        hold = self._labels["Hold (Y)"]
        label = "Go on (Y)" if live_play.is_held else "Hold (Y)"
        if hold.label != label:
            hold.label, hold.icon = label, "player-play" if live_play.is_held else "player-pause"
        for player, button in self._players.items():
            label = f"Give {player} back" if player in live_play.taken else f"Take {player}"
            if button.label != label:
                button.label = label

    # -- inside ------------------------------------------------------------------------------

    def _queue(self, action: Callable[[], None], event: Any) -> None:
        self._live.enqueue(event.client_id, partial(self._run_action, action))

    def _run_action(self, action: Callable[[], None]) -> None:
        action()
        self._live.stage.sounds.changed()

    def _hold(self) -> None:
        (self._live_play.resume if self._live_play.is_held else self._live_play.hold)()

    def _take(self, player: str) -> None:
        (self._live_play.give if player in self._live_play.taken else self._live_play.take)(player)


def _cue_label(cue: CueOfPlay) -> str:
    return f"{cue.number} {cue.description}"[:_MAX_CUE_TEXT]


def _status_html(live_play: LivePlay, messages: str) -> str:
    """Time, act, state, next cue and captions, as HTML."""
    t, play = live_play.t, live_play.play
    begun_acts = [name for name, start in play.acts.items() if start <= t]
    act_text = f"{begun_acts[-1]}, " if begun_acts else ""
    state = ""
    if live_play.voice is None:
        state = "; stands by for GO"
    elif live_play.done:
        state = "; is over"
    elif live_play.is_held:
        state = "; is held"
    elif live_play.waiting is not None:
        state = "; waits for GO"
    cue, status_lines = live_play.standing_by, list[str]()
    if cue is not None:
        go_text = ", GO is given" if live_play.released else ""
        status_lines.append(f"GO begins {cue.number} {cue.description}{go_text}")
    status_lines += [line for line in (live_play.message, messages) if line]
    rows = [element("div", f"{act_text}{t:.1f} s of {play.duration:.1f} s{state}")]
    rows += [element("div", line, style="opacity:0.75") for line in status_lines]
    captions = line_elements(map(str, play.score.captions_at(t)))
    rows.append(element("div", *captions, style="min-height:1.4em;font-size:1.25em"))
    return to_html(element("div", *rows, style="padding:0 0.5em;font-size:0.85em;line-height:1.45"))


def _cues_html(live_play: LivePlay) -> str:
    """All acts and cues with their times, as HTML."""
    current, next_cue = {cue.number for cue in live_play.playing_cues}, live_play.standing_by
    rows, act = [], ""
    for cue in live_play.play.cues:
        if cue.act != act:
            act = cue.act
            start = live_play.play.acts.get(act, 0.0)
            heading = element("b", act), f" {start:.1f} s"
            rows.append(element("div", *heading, style="margin-top:0.5em"))
        go_sign = " \N{BLACK RIGHT-POINTING TRIANGLE}" if cue.go else ""
        line = f"{cue.number}{go_sign} {cue.start:.1f} s\N{EN SPACE}{cue.description}"
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
