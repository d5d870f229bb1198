"""Tabs of a live page's panel for gestures and takes.

A gesture is a short motion of strings, a take a recording for editing, and an overdub a recording
of some strings while a take moves the others. A lane is here a string or joint that moves in a
take.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from fantoccini.app.live.holder import Viewer
from fantoccini.app.live.stage import Stage
from fantoccini.app.live.takes import Edits
from fantoccini.app.pages import note_html
from fantoccini.theatre.perform import TEMPO_RANGE

if TYPE_CHECKING:
    import viser

_BUTTONS_PER_ROW = 3
"""Number of gesture buttons in a row."""
GESTURE_KEYS = "1234567890ZXCVUIJK"
"""Keys of the gestures, in order; further gestures have no key."""
_NO_TAKE = "none yet"


class StageActions(Protocol):
    """Interface of :class:`fantoccini.app.live.live.Live` for the tabs."""

    stage: Stage

    def enqueue(self, viewer: Viewer | None, action: Callable[[], None]) -> bool: ...


class GesturesTab:
    """Buttons and keys of gestures, their options, and the beat.

    Args:
        live: live puppet on which the buttons act.
        gui: controls of the server.
        tab: tab of the panel.
        add_key: adds a key, given a description, the key, and its action.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        add_key: Callable[[str, str, Callable[[], None]], Any],
    ):
        self._live, self._gui, self._tab, self._add_key = live, gui, tab, add_key
        self._removable: list[Any] = []
        self._names: tuple[str, ...] | None = None
        options, player = live.stage.gesture_player.options, live.stage.gesture_player
        with tab:
            self._status = gui.add_html("")
            home = gui.add_button(
                "Home (H)",
                icon="home",
                color="gray",
                hint="Ends all gestures; if there are none, the hands go to the start",
            )
            home.on_click(lambda e: live.enqueue(e.client_id, self._go_home))
            box_texts = (
                ("Mirrored", "mirrored", "Exchange left and right"),
                ("Again", "repeat", "Repeat until the button is pressed again"),
                ("On the beat", "on_beat", "Begin on the next beat"),
            )
            for label, name, hint in box_texts:
                self._bind_option(gui.add_checkbox(label, False, hint=hint), options, name)
            self._bind_option(gui.add_slider("Size", 0.25, 2.0, 0.05, 1.0), options, "size")
            self._bind_option(gui.add_slider("Speed", 0.5, 2.0, 0.05, 1.0), options, "speed")
            self._bpm = gui.add_slider(
                "Beats a minute", TEMPO_RANGE.slowest, TEMPO_RANGE.fastest, 1.0, player.tempo.bpm
            )
            beat = gui.add_button_group("B M", ("Tap", "Metronome"), hint="Tap on every beat")
        add_key("Home: end all gestures", "H", self._go_home)
        add_key("Tap the beat", "B", self._tap)
        add_key("Metronome on or off", "M", self._toggle_metronome)

        async def set_bpm(event: Any) -> None:
            if event.client_id is not None:
                bpm = float(self._bpm.value)
                if not live.enqueue(event.client_id, lambda: player.set_tempo(bpm)):
                    self._bpm.value = float(round(player.tempo.bpm))

        async def handle_press(event: Any) -> None:
            action = self._tap if event.target.value == "Tap" else self._toggle_metronome
            live.enqueue(event.client_id, action)

        self._bpm.on_update(set_bpm)
        beat.on_click(handle_press)

    def build(self) -> None:
        """Shows buttons for the current gestures."""
        names = tuple(self._live.stage.gesture_player.gestures)
        if names == self._names:
            return
        self._names = names
        for button in self._removable:
            button.remove()
        self._removable.clear()
        with self._tab:
            for k in range(0, len(names), _BUTTONS_PER_ROW):
                self._add_row(k, names[k : k + _BUTTONS_PER_ROW])
        for key, name in zip(GESTURE_KEYS, names, strict=False):
            self._removable.append(
                self._add_key(f"Gesture: {name}", key, partial(self._press, name))
            )

    def update(self) -> None:
        """Shows the gestures that are played, and the tempo if it has been tapped."""
        player = self._live.stage.gesture_player
        if not player.gestures:
            text = "No bundled gesture fits these strings: make one from a take."
        elif player.playing:
            text = f"Plays {', '.join(player.playing)}"
        else:
            text = "A button or its key plays a gesture, added to your own motion."
        if player.metronome:
            text = f"{_dots(player.beat)} {text}"
        self._set_text("; ".join((text, *player.problems)))
        bpm = float(round(player.tempo.bpm))
        if abs(self._bpm.value - bpm) >= 1.0:
            self._bpm.value = bpm

    # -- inside ------------------------------------------------------------------------------

    def _set_text(self, text: str) -> None:
        content = note_html(text)
        if self._status.content != content:
            self._status.content = content

    def _add_row(self, first: int, names: tuple[str, ...]) -> None:
        keys = " ".join(GESTURE_KEYS[first : first + len(names)])
        row = self._gui.add_button_group(keys or " ", names, order=-1000.0 + first)

        async def handle_press(event: Any) -> None:
            name = str(event.target.value)
            self._live.enqueue(event.client_id, lambda: self._press(name))

        row.on_click(handle_press)
        self._removable.append(row)

    def _press(self, name: str) -> None:
        self._live.stage.gesture_player.press(name)

    def _go_home(self) -> None:
        self._live.stage.gesture_player.go_home()

    def _tap(self) -> None:
        self._live.stage.gesture_player.tap()
        self._live.stage.sounds.changed()

    def _toggle_metronome(self) -> None:
        player = self._live.stage.gesture_player
        player.metronome = not player.metronome
        self._live.stage.sounds.changed()

    def _bind_option(self, control: Any, options: Any, name: str) -> None:
        """Binds an option of the gestures to a control."""

        async def handle_change(event: Any) -> None:
            if event.client_id is None:
                return
            value = control.value
            if not self._live.enqueue(event.client_id, lambda: setattr(options, name, value)):
                control.value = getattr(options, name)

        control.on_update(handle_change)


def _dots(beat: int) -> str:
    """Four dots, with the current beat filled."""
    return "".join("\N{BLACK CIRCLE}" if k == beat % 4 else "\N{WHITE CIRCLE}" for k in range(4))


class TakesTab:
    """Controls to choose, edit, play, overdub and save takes, and to make gestures and films.

    Attributes:
        choice: list of the takes.
        part_of: name of the take whose part is shown.
        stretch: slider for the factor on its duration.
        repeat: box for repetition.
        name_field: field for the name of a gesture.
        lane_boxes: boxes of an overdub by lane.

    Args:
        live, gui, tab, add_key: see :class:`GesturesTab`.
        theme: name of the theme of films.
    """

    def __init__(
        self,
        live: StageActions,
        gui: viser.GuiApi,
        tab: Any,
        add_key: Callable[[str, str, Callable[[], None]], Any],
        theme: str,
    ):
        self._live, self._gui, self._theme = live, gui, theme
        self._part: Any = None
        self._shown: tuple[str, ...] = ()
        self.part_of, self._tab = "", tab
        self.lane_boxes: dict[str, Any] = {}
        with tab:
            self._status = gui.add_html("")
            self.choice = gui.add_dropdown("Take", (_NO_TAKE,), hint="The newest first")
            self._play = gui.add_button(
                "Play (L)",
                icon="player-play",
                hint="From its start; ends the score and all gestures",
            )
            self.repeat = gui.add_checkbox("Loop", False, hint="Repeat, joined smoothly")
            with gui.add_folder("Edit"):
                self._editing = gui.add_html("")
                self._smooth = gui.add_slider(
                    "Smooth [s]", 0.0, 1.0, 0.02, 0.0, hint="Averages the hands' paths"
                )
                self.stretch = gui.add_slider(
                    "Stretch", 0.25, 4.0, 0.05, 1.0, hint="Factor on the duration"
                )
                self._save_buttons = gui.add_button_group("Save as", ("New take", "Film"))
            with gui.add_folder("Gesture"):
                self.name_field = gui.add_text("Name", "", hint="Letters, digits, _ and -")
                make = gui.add_button("Make a gesture of it", color="gray")
            self._overdub_folder = gui.add_folder("Overdub", expand_by_default=False)
            with self._overdub_folder:
                gui.add_html(
                    note_html("You move the ticked strings, the take moves the others."),
                    order=-2000.0,
                )
                overdub = gui.add_button("Overdub (O)", icon="player-record", color="red")
        self._play.on_click(lambda e: live.enqueue(e.client_id, self._play_take))
        make.on_click(lambda e: live.enqueue(e.client_id, self._make_gesture))
        overdub.on_click(lambda e: live.enqueue(e.client_id, self._overdub))
        self.choice.on_update(self._choose)
        self.repeat.on_update(self._handle_loop)
        for control in (self._smooth, self.stretch):
            control.on_update(self._edit)
        self._save_buttons.on_click(self._save)
        add_key("Play or stop the take", "L", self._play_take)
        add_key("Overdub the take", "O", self._overdub)

    def build(self) -> None:
        """Shows boxes for the current lanes."""
        stage = self._live.stage
        if stage.performance.lanes == tuple(self.lane_boxes):
            return
        for box in self.lane_boxes.values():
            box.remove()
        with self._overdub_folder:
            self.lane_boxes = {
                lane: self._gui.add_checkbox(lane, lane in stage.armed, order=-1000.0 + k)
                for k, lane in enumerate(stage.performance.lanes)
            }
        for lane, box in self.lane_boxes.items():
            box.on_update(self._arm_handler(lane, box))

    def update(self) -> None:
        """Shows the current takes, and the state of the chosen one."""
        takes = self._live.stage.takes
        names = takes.names or (_NO_TAKE,)
        if names != self._shown:
            self._shown = names
            self.choice.options = names
        if takes.chosen != self.part_of and takes.take is not None:
            self._show_chosen()
        text = self._status_html()
        if self._status.content != text:
            self._status.content = text
        playing = self._live.stage.performance.take_time is not None
        label = "Stop (L)" if playing else "Play (L)"
        if self._play.label != label:
            self._play.label = label
            self._play.icon = "player-stop" if playing else "player-play"

    # -- inside ------------------------------------------------------------------------------

    def _status_html(self) -> str:
        stage = self._live.stage
        take, t = stage.takes.take, stage.performance.take_time
        if take is None:
            text = "Record a take, or choose one."
        else:
            edits = stage.takes.edits
            text = f"{take.duration:.2f} s"
            if edits.start > 0.0 or edits.end < take.duration:
                text = f"{edits.start:.2f} s to {edits.end:.2f} s of {text}"
            if t is not None:
                text = f"Plays {t:.1f} s of {stage.takes.edited().duration:.1f} s"
        return note_html("; ".join(part for part in (text, stage.worker.status) if part))

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
                order=self.repeat.order + 0.5,
                hint="Start and end",
            )
        part.on_update(self._edit)
        return part

    async def _choose(self, event: Any) -> None:
        name = str(self.choice.value)
        if event.client_id is None or name == _NO_TAKE:
            return
        if not self._live.enqueue(event.client_id, lambda: self._choose_take(name)):
            self._show_name(name)

    def _choose_take(self, name: str) -> None:
        try:
            self._live.stage.takes.choose(name)
        finally:
            self._show_name(name)

    def _show_name(self, shown_name: str) -> None:
        """Corrects the list if it shows another take than the chosen one."""
        chosen = self._live.stage.takes.chosen or self._shown[0]
        if chosen != shown_name:
            self.choice.value = chosen

    async def _edit(self, event: Any) -> None:
        if event.client_id is None or self._part is None:
            return
        start, end = map(float, self._part.value)
        takes = self._live.stage.takes
        if end >= self._part.max and takes.take is not None:
            end = takes.take.duration  # the slider rounds
        edits = Edits(start, end, self._smooth.value, self.stretch.value)
        if not self._live.enqueue(event.client_id, lambda: setattr(takes, "edits", edits)):
            current, longest = takes.edits, self._part.max
            self._part.value = min(current.start, longest), min(current.end, longest)
            self._smooth.value, self.stretch.value = current.smooth, current.stretch

    async def _handle_loop(self, event: Any) -> None:
        loop = self.repeat.value
        if event.client_id is not None and not self._live.enqueue(event.client_id, lambda: None):
            self.repeat.value = not loop

    async def _save(self, event: Any) -> None:
        takes = self._live.stage.takes
        is_film = event.target.value == "Film"
        action = (lambda: takes.film(self._theme)) if is_film else takes.save_as_new
        self._live.enqueue(event.client_id, action)

    def _play_take(self) -> None:
        self._live.stage.play_take(self.repeat.value)

    def _overdub(self) -> None:
        self._live.stage.overdub()

    def _make_gesture(self) -> None:
        stage = self._live.stage
        stage.gesture_player.add(stage.takes.make_gesture(self.name_field.value.strip()))
        self.name_field.value = ""

    def _arm_handler(self, lane: str, box: Any) -> Callable[[Any], Any]:
        async def arm(event: Any) -> None:
            if event.client_id is None:
                return
            armed = self._live.stage.armed
            change = partial(armed.add if box.value else armed.discard, lane)
            if not self._live.enqueue(event.client_id, change):
                box.value = lane in armed

        return arm
