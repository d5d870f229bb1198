"""Tabs of a live page's panel on which gestures and takes are played."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from fantoccini.app.live.holder import Viewer
from fantoccini.app.live.stage import Stage
from fantoccini.app.live.takes import Edits
from fantoccini.app.pages import note
from fantoccini.theatre.perform import RANGE

if TYPE_CHECKING:
    import viser

_IN_A_ROW = 3
"""Gestures."""
KEYS = "1234567890ZXCVUIJK"
"""Keys of gestures, in their order; those after the last have none."""
_NONE = "none yet"


class StageActions(Protocol):
    """The interface of :class:`fantoccini.app.live.live.Live` that the tabs act on."""

    stage: Stage

    def later(self, viewer: Viewer | None, do: Callable[[], None]) -> bool: ...


class GesturesTab:
    """Buttons and keys of gestures, how they are played, and the beat.

    Args:
        live: what the buttons act on.
        gui: of the server.
        tab: of the panel.
        command: adds a key: what it does in words, the key, and what it does.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        command: Callable[[str, str, Callable[[], None]], Any],
    ):
        self._live, self._gui, self._tab, self._command = live, gui, tab, command
        self._made: list[Any] = []
        self._names: tuple[str, ...] | None = None
        manner, instrument = live.stage.instrument.manner, live.stage.instrument
        with tab:
            self._about = gui.add_html("")
            home = gui.add_button(
                "Home (H)",
                icon="home",
                color="gray",
                hint="Takes back all gestures; without any, the hands go to the start",
            )
            home.on_click(lambda e: live.later(e.client_id, self._go_home))
            boxes = (
                ("Mirrored", "mirrored", "Left and right change places"),
                ("Again", "again", "Begin again at the end, until pressed once more"),
                ("On the beat", "on_beat", "Begin on the next beat"),
            )
            for label, name, hint in boxes:
                self._sets(gui.add_checkbox(label, False, hint=hint), manner, name)
            self._sets(gui.add_slider("Size", 0.25, 2.0, 0.05, 1.0), manner, "size")
            self._sets(gui.add_slider("Speed", 0.5, 2.0, 0.05, 1.0), manner, "speed")
            self._bpm = gui.add_slider(
                "Beats a minute", RANGE.slowest, RANGE.fastest, 1.0, instrument.tempo.bpm
            )
            beat = gui.add_button_group("B M", ("Tap", "Metronome"), hint="Tap on every beat")
        command("Home: take back all gestures", "H", self._go_home)
        command("Tap the beat", "B", self._tap)
        command("Metronome on or off", "M", self._click)

        async def set_bpm(event: Any) -> None:
            if event.client_id is not None:
                bpm = float(self._bpm.value)
                if not live.later(event.client_id, lambda: instrument.set_tempo(bpm)):
                    self._bpm.value = float(round(instrument.tempo.bpm))

        async def pressed(event: Any) -> None:
            do = self._tap if event.target.value == "Tap" else self._click
            live.later(event.client_id, do)

        self._bpm.on_update(set_bpm)
        beat.on_click(pressed)

    def build(self) -> None:
        """Shows buttons of the gestures that there are now."""
        names = tuple(self._live.stage.instrument.gestures)
        if names == self._names:
            return
        self._names = names
        for one in self._made:
            one.remove()
        self._made.clear()
        with self._tab:
            for k in range(0, len(names), _IN_A_ROW):
                self._add_row(k, names[k : k + _IN_A_ROW])
        for key, name in zip(KEYS, names, strict=False):
            self._made.append(self._command(f"Gesture: {name}", key, partial(self._press, name)))

    def update(self) -> None:
        """Shows what is played, and the tempo where it has been tapped."""
        instrument = self._live.stage.instrument
        if not instrument.gestures:
            said = "No bundled gesture is for these strings: make one of a take."
        elif instrument.playing:
            said = f"Plays {', '.join(instrument.playing)}"
        else:
            said = "A button or its key plays a gesture on top of what you hold."
        if instrument.metronome:
            said = f"{_dots(instrument.beat)} {said}"
        self._say("; ".join((said, *instrument.problems)))
        bpm = float(round(instrument.tempo.bpm))
        if abs(self._bpm.value - bpm) >= 1.0:
            self._bpm.value = bpm

    # -- inside ------------------------------------------------------------------------------

    def _say(self, words: str) -> None:
        content = note(words)
        if self._about.content != content:
            self._about.content = content

    def _add_row(self, first: int, names: tuple[str, ...]) -> None:
        keys = " ".join(KEYS[first : first + len(names)])
        row = self._gui.add_button_group(keys or " ", names, order=-1000.0 + first)

        async def pressed(event: Any) -> None:
            name = str(event.target.value)
            self._live.later(event.client_id, lambda: self._press(name))

        row.on_click(pressed)
        self._made.append(row)

    def _press(self, name: str) -> None:
        self._live.stage.instrument.press(name)

    def _go_home(self) -> None:
        self._live.stage.instrument.go_home()

    def _tap(self) -> None:
        self._live.stage.instrument.tap()
        self._live.stage.sounds.changed()

    def _click(self) -> None:
        instrument = self._live.stage.instrument
        instrument.metronome = not instrument.metronome
        self._live.stage.sounds.changed()

    def _sets(self, control: Any, manner: Any, name: str) -> None:
        """Sets an attribute of the manner to what a control says."""

        async def changed(event: Any) -> None:
            if event.client_id is None:
                return
            value = control.value
            if not self._live.later(event.client_id, lambda: setattr(manner, name, value)):
                control.value = getattr(manner, name)

        control.on_update(changed)


def _dots(beat: int) -> str:
    """Four beats, with the present one."""
    return "".join("\N{BLACK CIRCLE}" if k == beat % 4 else "\N{WHITE CIRCLE}" for k in range(4))


class TakesTab:
    """Takes: chosen, edited, played, overdubbed, kept, made into gestures and films.

    Attributes:
        choice: list of the takes.
        part_of: name of the take whose part is shown.
        stretch: slider of the factor of its duration.
        again: box that lets it begin again.
        name_field: name of the gesture that it becomes.
        lane_boxes: boxes of an overdub by lane.

    Args:
        live, gui, tab, command: see :class:`GesturesTab`.
        theme: name of the theme of films.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        command: Callable[[str, str, Callable[[], None]], Any],
        theme: str,
    ):
        self._live, self._gui, self._theme = live, gui, theme
        self._part: Any = None
        self._shown: tuple[str, ...] = ()
        self.part_of, self._tab = "", tab
        self.lane_boxes: dict[str, Any] = {}
        with tab:
            self._about = gui.add_html("")
            self.choice = gui.add_dropdown("Take", (_NONE,), hint="The newest first")
            self._play = gui.add_button(
                "Play (L)",
                icon="player-play",
                hint="From its start; ends the score and gestures that are played",
            )
            self.again = gui.add_checkbox("Loop", False, hint="Again and again, joined smoothly")
            with gui.add_folder("Edit"):
                self._editing = gui.add_html("")
                self._smooth = gui.add_slider(
                    "Smooth [s]", 0.0, 1.0, 0.02, 0.0, hint="Averages the hands' paths"
                )
                self.stretch = gui.add_slider(
                    "Stretch", 0.25, 4.0, 0.05, 1.0, hint="How many times as long"
                )
                self._keep = gui.add_button_group("Save as", ("New take", "Film"))
            with gui.add_folder("Gesture"):
                self.name_field = gui.add_text("Name", "", hint="Letters, digits, _ and -")
                make = gui.add_button("Make a gesture of it", color="gray")
            self._armed = gui.add_folder("Overdub", expand_by_default=False)
            with self._armed:
                gui.add_html(
                    note("Ticked strings are in your hands, the take moves the others."),
                    order=-2000.0,
                )
                overdub = gui.add_button("Overdub (O)", icon="player-record", color="red")
        self._play.on_click(lambda e: live.later(e.client_id, self._play_take))
        make.on_click(lambda e: live.later(e.client_id, self._make))
        overdub.on_click(lambda e: live.later(e.client_id, self._overdub))
        self.choice.on_update(self._choose)
        self.again.on_update(self._loop)
        for control in (self._smooth, self.stretch):
            control.on_update(self._edit)
        self._keep.on_click(self._save)
        command("Play or stop the take", "L", self._play_take)
        command("Overdub the take", "O", self._overdub)

    def build(self) -> None:
        """Shows boxes of the lanes that there are now."""
        stage = self._live.stage
        if stage.performance.lanes == tuple(self.lane_boxes):
            return
        for box in self.lane_boxes.values():
            box.remove()
        with self._armed:
            self.lane_boxes = {
                lane: self._gui.add_checkbox(lane, lane in stage.armed, order=-1000.0 + k)
                for k, lane in enumerate(stage.performance.lanes)
            }
        for lane, box in self.lane_boxes.items():
            box.on_update(self._arms(lane, box))

    def update(self) -> None:
        """Shows the takes that there are now, and what becomes of the chosen one."""
        takes = self._live.stage.takes
        names = takes.names or (_NONE,)
        if names != self._shown:
            self._shown = names
            self.choice.options = names
        if takes.chosen != self.part_of and takes.take is not None:
            self._show_chosen()
        said = self._said()
        if self._about.content != said:
            self._about.content = said
        playing = self._live.stage.performance.take_time is not None
        label = "Stop (L)" if playing else "Play (L)"
        if self._play.label != label:
            self._play.label = label
            self._play.icon = "player-stop" if playing else "player-play"

    # -- inside ------------------------------------------------------------------------------

    def _said(self) -> str:
        stage = self._live.stage
        take, t = stage.takes.take, stage.performance.take_time
        if take is None:
            said = "Record one, or choose one."
        else:
            edits = stage.takes.edits
            said = f"{take.duration:.2f} s"
            if edits.start > 0.0 or edits.end < take.duration:
                said = f"{edits.start:.2f} s to {edits.end:.2f} s of {said}"
            if t is not None:
                said = f"Plays {t:.1f} s of {stage.takes.edited().duration:.1f} s"
        return note("; ".join(part for part in (said, stage.worker.status) if part))

    def _show_chosen(self) -> None:
        """Sets the controls to the chosen take, without edits."""
        takes = self._live.stage.takes
        take = takes.take
        assert take is not None
        self.part_of = takes.chosen
        if self._part is not None:
            self._part.remove()
        length = max(take.duration, 0.02)
        self._part = self._add_part(length)
        self.choice.value = takes.chosen
        self._smooth.value, self.stretch.value = 0.0, 1.0

    def _add_part(self, length: float) -> Any:
        with self._tab:
            part = self._gui.add_multi_slider(
                "Part [s]",
                0.0,
                round(length, 2),
                0.01,
                (0.0, round(length, 2)),
                min_range=0.05,
                order=self.again.order + 0.5,
                hint="Start and end",
            )
        part.on_update(self._edit)
        return part

    async def _choose(self, event: Any) -> None:
        name = str(self.choice.value)
        if event.client_id is None or name == _NONE:
            return
        if not self._live.later(event.client_id, lambda: self._chosen(name)):
            self._show_name(name)

    def _chosen(self, name: str) -> None:
        try:
            self._live.stage.takes.choose(name)
        finally:
            self._show_name(name)

    def _show_name(self, said: str) -> None:
        """Shows which take is chosen where the list says another."""
        chosen = self._live.stage.takes.chosen or self._shown[0]
        if chosen != said:
            self.choice.value = chosen

    async def _edit(self, event: Any) -> None:
        if event.client_id is None or self._part is None:
            return
        start, end = map(float, self._part.value)
        takes = self._live.stage.takes
        if end >= self._part.max and takes.take is not None:
            end = takes.take.duration  # the slider rounds
        edits = Edits(start, end, self._smooth.value, self.stretch.value)
        if not self._live.later(event.client_id, lambda: setattr(takes, "edits", edits)):
            kept, most = takes.edits, self._part.max
            self._part.value = min(kept.start, most), min(kept.end, most)
            self._smooth.value, self.stretch.value = kept.smooth, kept.stretch

    async def _loop(self, event: Any) -> None:
        wanted = self.again.value
        if event.client_id is not None and not self._live.later(event.client_id, lambda: None):
            self.again.value = not wanted

    async def _save(self, event: Any) -> None:
        takes = self._live.stage.takes
        film = event.target.value == "Film"
        do = (lambda: takes.film(self._theme)) if film else takes.keep
        self._live.later(event.client_id, do)

    def _play_take(self) -> None:
        self._live.stage.play_take(self.again.value)

    def _overdub(self) -> None:
        self._live.stage.overdub()

    def _make(self) -> None:
        stage = self._live.stage
        stage.instrument.add(stage.takes.gesture(self.name_field.value.strip()))
        self.name_field.value = ""

    def _arms(self, lane: str, box: Any) -> Callable[[Any], Any]:
        async def arm(event: Any) -> None:
            if event.client_id is None:
                return
            armed = self._live.stage.armed
            change = partial(armed.add if box.value else armed.discard, lane)
            if not self._live.later(event.client_id, change):
                box.value = lane in armed

        return arm
