"""Panel of a live page: buttons, sliders, numbers, and errors in the puppet file.

A handle is a driven string end, or a body on a driven joint, and a take a recording for editing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

import numpy as np

from fantoccini.app.live.controls import WARNING_COLOUR, Controls
from fantoccini.app.live.holder import Holder, HolderLine, Viewer
from fantoccini.app.live.perform_tabs import GesturesTab, TakesTab
from fantoccini.app.live.play_tab import PlayTab
from fantoccini.app.live.recorder import Recorder
from fantoccini.app.live.score_tab import ScoreTab
from fantoccini.app.live.stage import Stage
from fantoccini.app.pages import (
    VIEWS,
    Plot,
    SceneNodes,
    SceneState,
    Views,
    note_html,
    tension_table_html,
)
from fantoccini.base import UNSOUND
from fantoccini.output.html import Content, element, line_elements, to_html
from fantoccini.output.view import Theme, to_hex
from fantoccini.theatre.perform import Balance, Performance

if TYPE_CHECKING:
    import viser

Node = TypeVar("Node")

SPEED_FACTORS = {"1": 1.0, "1/2": 0.5, "1/4": 0.25, "1/8": 0.125, "1/16": 0.0625}
_PUSH_PER_KEY = 0.012
"""Motion of a handle for each press of a key, relative to the puppet's size."""
_HINT = "Drag a bead to move it, or a body to pull it."
_HINT_WINDS = (
    "Drag a bead to move it, or a body to pull it. Dragging a bead up or down with Shift winds its "
    "string."
)
_KEYS = (
    "F and G choose a handle, A D W S move it, Q E wind its string, P pauses, N steps, R resets, "
    "T records; Shift with F, S, Q, T and the arrow keys turn the camera. Gestures: keys beside "
    "the buttons; H home, B taps the beat, M metronome, L plays the take, O overdubs, Space GO. "
    "A gamepad works, too."
)
_RED = to_hex(WARNING_COLOUR)


class LiveActions(Protocol):
    """Interface of :class:`fantoccini.app.live.live.Live` for the panel."""

    stage: Stage
    performance: Performance
    nodes: SceneNodes
    controls: Controls
    holder: Holder
    paused: bool
    time_factor: float

    @property
    def recorder(self) -> Recorder: ...
    @property
    def balance(self) -> Balance | None: ...
    def set_balance(self, balance_on: bool) -> None: ...
    def act(self, viewer: Viewer | None, action: Callable[[], object]) -> bool: ...
    def enqueue(self, viewer: Viewer | None, action: Callable[[], None]) -> bool: ...
    def pause(self) -> None: ...
    def step(self) -> None: ...
    def reset(self) -> None: ...
    def record(self) -> None: ...
    def push(self, right: float, up: float, camera: viser.CameraHandle | None = None) -> None: ...
    def wind(self, change: float) -> None: ...
    def set_parameters(self, values: dict[str, float]) -> None: ...


class LivePanel:
    """Panel of a live page.

    Attributes:
        lengths: folder of the sliders of strings.
        views: boxes for the parts of the world to show.
        takes: tab of the takes.
        handle_choice: list of the handles; None without handles.

    Args:
        live: live puppet on which the buttons act.
        server: server of viser.
        theme: colours.
    """

    def __init__(self, live: LiveActions, server: viser.ViserServer, theme: Theme):
        self._live, self._gui, self._theme = live, server.gui, theme
        self._message = ""
        self._mistakes_by_file: dict[str, tuple[str, ...]] = {}
        self._removable: list[Any] = []
        gui = server.gui
        self._status = gui.add_html("", order=-4.0)
        self._holder_line = HolderLine(server, order=-3.0)
        self._mistakes = gui.add_html("", order=-2.0, visible=False)
        self._hint = gui.add_html("", order=-1.0)
        self._pause = gui.add_button("Pause", icon="player-pause")
        step_buttons = gui.add_button_group("Time", ("Step", "Reset"))
        self._record = gui.add_button("Record", icon="player-record", color="red")
        tabs = gui.add_tab_group()
        # The page opens with the first tab: a performance needs GO, the cue and the caption.
        self._play: PlayTab | None = None
        self._score: ScoreTab | None = None
        if live.stage.live_play is not None:
            self._play = PlayTab(
                live, gui, tabs.add_tab("Play"), self._command, live.stage.live_play
            )
        elif live.stage.score is not None:
            self._score = ScoreTab(live, gui, tabs.add_tab("Score"), self._command, theme)
        self._strings = tabs.add_tab("Strings")
        with self._strings:
            self._balance = gui.add_checkbox(
                "Let the hands balance it", False, hint="They keep it where it is now"
            )
            self._balance.on_update(self._set_balance)
            with gui.add_folder("Speed and view", expand_by_default=False):
                self._speed = gui.add_dropdown("Speed", tuple(SPEED_FACTORS), initial_value="1")
                self.views = Views(gui, lambda: live.nodes, self._has_contact)
                self._names = gui.add_checkbox("Names", True, hint="Names of the handles")
                self._names.on_update(lambda _: live.controls.show_names(self._names.value))
        gestures, takes = tabs.add_tab("Gestures"), tabs.add_tab("Takes")
        self._gestures = GesturesTab(live, gui, gestures, self._command)
        self.takes = TakesTab(live, gui, takes, self._command, theme.name)
        self._pause.on_click(lambda e: live.enqueue(e.client_id, live.pause))
        self._record.on_click(lambda e: live.enqueue(e.client_id, live.record))
        step_buttons.on_click(
            lambda e: live.enqueue(
                e.client_id, live.step if e.target.value == "Step" else live.reset
            )
        )
        self._speed.on_update(self._set_speed)
        self._add_keys()

    def build(self, nodes: SceneNodes) -> None:
        """Adds the parts that depend on the puppet."""
        with self._strings:
            self._build_strings(nodes)
        self._gestures.build()
        self.takes.build()
        if self._score is not None:
            self._score.build()

    def _build_strings(self, nodes: SceneNodes) -> None:
        gui, live = self._gui, self._live
        self._nodes = nodes
        self.views.apply()
        names = nodes.geometry.names
        can_wind = bool(live.performance.lengths)
        self._hint.content = note_html(_HINT_WINDS if can_wind else _HINT)
        handles = tuple(handle.name for handle in live.performance.handles)
        self.handle_choice: viser.GuiDropdownHandle[str] | None = None
        self._wind_box: viser.GuiCheckboxHandle | None = None
        self._shown_handle: str | None = None
        if handles:
            choice = gui.add_dropdown("Handle", handles, hint="F and G choose")
            self.handle_choice = self._register(choice)
            self._shown_handle = self.handle_choice.value
            self.handle_choice.on_update(self._choose)
        if can_wind:
            self._wind_box = self._register(
                gui.add_checkbox("Drag winds", False, hint="Dragging winds strings without Shift")
            )
        self.lengths = self._register(gui.add_folder("String lengths [m]", visible=can_wind))
        if names:
            tension = self._register(gui.add_folder("Tension"))
            with tension:
                self._bars = gui.add_html("")
                self._plot = Plot(
                    gui,
                    names,
                    self._theme,
                    "N",
                    (-10.0, 0.0),
                    (0.0, 1.05 * nodes.colours.full_scale),
                )
        values = live.performance.marionette.tree.parameters
        if values:
            with self._register(gui.add_folder("Parameters")):
                current = dict(zip(values, live.performance.marionette.p, strict=True))
                for name, value in current.items():
                    self._add_parameter(name, float(value))
        with self._register(gui.add_folder("Keys", expand_by_default=False)):
            gui.add_html(note_html(_KEYS))

    @property
    def forces(self) -> bool:
        """Whether the forces of contacts are shown."""
        return self.views.forces

    @property
    def drag_winds(self) -> bool:
        """Whether dragging a bead winds its string, without Shift."""
        return self._wind_box is not None and self._wind_box.value

    def set_up(self, controls: Controls) -> None:
        """Applies the boxes to new beads and rings."""
        controls.show_names(self._names.value)

    def clear(self) -> None:
        """Removes the parts that depend on the puppet."""
        for node in self._removable:
            node.remove()
        self._removable.clear()

    def report(self, message: str) -> None:
        """Shows a message, until the next one."""
        self._message = message

    def show_paused(self, paused: bool) -> None:
        """Labels the button with its next action."""
        self._pause.label = "Go on" if paused else "Pause"
        self._pause.icon = "player-play" if paused else "player-pause"

    def show_balance(self, on: bool) -> None:
        """Ticks or clears the box for balancing."""
        if self._balance.value != on:
            self._balance.value = on

    def show_mistakes(self, kind: str, mistakes: tuple[str, ...]) -> None:
        """Shows the mistakes in the file of the puppet or of the score."""
        self._mistakes_by_file = {**self._mistakes_by_file, kind: mistakes}
        with_mistakes = {
            kind: lines_of_file
            for kind, lines_of_file in self._mistakes_by_file.items()
            if lines_of_file
        }
        self._mistakes.visible = bool(with_mistakes)
        unchanged_text = "; ".join(f"the {kind} is unchanged" for kind in with_mistakes)
        box_style = (
            f"margin:0 0.5em;padding:0.5em 0.7em;border-left:4px solid {_RED};"
            "background:rgba(214,69,69,0.12);font-size:0.82em;overflow-wrap:anywhere"
        )
        heading = element("b", f"The file has errors; {unchanged_text}.")
        rows = line_elements(line for mistakes in with_mistakes.values() for line in mistakes)
        self._mistakes.content = to_html(element("div", heading, *rows, style=box_style))

    def update(
        self, scene: SceneState, lagging: dict[str, str], history: tuple[np.ndarray, np.ndarray]
    ) -> None:
        """Shows new numbers.

        Args:
            scene: current state of the scene.
            lagging: handles and strings that cannot follow -> reason.
            history: times relative to now [s] and tensions [N].
        """
        self._status.content = self._status_html(scene, lagging)
        self._holder_line.update(self._live.holder.viewer)
        selected = self._live.controls.selected
        # Only changes are sent: a viewer may just have chosen another handle.
        if self.handle_choice is not None and self._shown_handle != selected:
            self.handle_choice.value = self._shown_handle = selected
        self._record.label = "Stop recording" if self._live.recorder.running else "Record"
        self._gestures.build()
        self._gestures.update()
        self.takes.update()
        if self._score is not None:
            self._score.build()
            self._score.update()
        if self._play is not None:
            self._play.update()
        if self._nodes.geometry.names:
            self._bars.content = tension_table_html(self._nodes.geometry.names, scene, self._nodes)
            t, tension = history
            self._plot.draw(t, np.minimum(tension, 10.0 * self._nodes.colours.full_scale))

    # -- inside --------------------------------------------------------------------------------

    def _has_contact(self) -> bool:
        return self._live.performance.contact is not None

    def _status_html(self, scene: SceneState, lagging: dict[str, str]) -> str:
        live = self._live
        clock_parts: list[Content] = [f"{scene.t:.1f} s"]
        if live.paused:
            clock_parts.append(", paused")
        elif live.time_factor != 1.0:
            clock_parts.append(f", {live.time_factor:g} times as fast")
        if live.recorder.running:
            recorded = f"\N{BLACK CIRCLE} recording {live.recorder.time:.1f} s"
            clock_parts += [" \N{EN SPACE}", element("span", recorded, style=f"color:{_RED}")]
        rows = [element("div", *clock_parts)]
        if live.balance is not None:
            rows.append(element("div", f"The hands balance it: {live.balance.summary}"))
        if (status := live.performance.status) in UNSOUND:
            rows.append(element("div", status.message, style=f"color:{_RED}"))
        for name, reason in lagging.items():
            rows.append(element("div", f"{name}: {reason}", style=f"color:{_RED}"))
        for message in dict.fromkeys((live.recorder.status, self._message)):
            if message:
                rows.append(element("div", message, style="opacity:0.75;overflow-wrap:anywhere"))
        style = "padding:0 0.5em;font-size:0.85em;line-height:1.45"
        return to_html(element("div", *rows, style=style))

    def _choose(self, event: Any) -> None:
        if event.client_id is not None:
            name = event.target.value
            self._live.enqueue(None, lambda: self._live.controls.select(name))

    async def _set_balance(self, event: Any) -> None:
        # Asynchronous, because viser calls it at once, with the value of the click.
        if event.client_id is None:
            return
        live, balance = self._live, self._balance.value
        if not live.enqueue(event.client_id, lambda: live.set_balance(balance)):
            self._balance.value = not balance

    def _set_speed(self, event: Any) -> None:
        if event.client_id is None:
            return
        time_factor = SPEED_FACTORS[self._speed.value]
        if not self._live.act(
            event.client_id, lambda: setattr(self._live, "time_factor", time_factor)
        ):
            self._speed.value = next(
                k for k, v in SPEED_FACTORS.items() if v == self._live.time_factor
            )

    def _add_parameter(self, name: str, value: float) -> None:
        low, high = (0.2 * value, 3.0 * value) if value else (-1.0, 1.0)
        low, high = min(low, high), max(low, high)
        slider = self._gui.add_slider(name, low, high, (high - low) / 280.0, value)

        def handle_slider(event: Any) -> None:
            if event.client_id is None:
                return
            live, value = self._live, float(slider.value)
            if not live.enqueue(event.client_id, lambda: live.set_parameters({name: value})):
                marionette = live.performance.marionette
                slider.value = float(marionette.p[list(marionette.tree.parameters).index(name)])

        slider.on_update(handle_slider)

    def _add_keys(self) -> None:
        live = self._live

        def add_key(label: str, key: str, action: Callable[[viser.CameraHandle], None]) -> None:
            command = self._gui.add_command(label, hotkey=key)
            command.on_trigger(lambda e: live.enqueue(e.client_id, lambda: action(e.client.camera)))

        add_key("Pause or continue", "P", lambda _: live.pause())
        add_key("Step", "N", lambda _: live.step())
        add_key("Reset", "R", lambda _: live.reset())
        add_key("Record or stop", "T", lambda _: live.record())
        add_key("Next handle", "F", lambda _: live.controls.select_next(1))
        add_key("Previous handle", "G", lambda _: live.controls.select_next(-1))
        for label, key, right, up in (
            ("left", "A", -_PUSH_PER_KEY, 0.0),
            ("right", "D", _PUSH_PER_KEY, 0.0),
            ("up or away", "W", 0.0, _PUSH_PER_KEY),
            ("down or near", "S", 0.0, -_PUSH_PER_KEY),
        ):
            add_key(f"Handle {label}", key, partial(live.push, right, up))
        add_key("Wind in", "E", lambda _: live.wind(-_PUSH_PER_KEY))
        add_key("Wind out", "Q", lambda _: live.wind(_PUSH_PER_KEY))
        # Not Shift with a digit: browsers name that key by its character, such as `!`.
        for key, view in zip("FSQT", VIEWS, strict=True):
            camera = self._gui.add_command(
                f"Camera: {view}", hotkey=cast(Any, key), modifier="shift"
            )
            camera.on_trigger(lambda e, view=view: live.nodes.aim_camera(e.client.camera, view))

    def _command(self, label: str, key: str, action: Callable[[], None]) -> Any:
        """Adds a key whose action runs in the loop's thread."""
        command = self._gui.add_command(label, hotkey=cast(Any, key))
        command.on_trigger(lambda e: self._live.enqueue(e.client_id, action))
        return command

    def _register(self, node: Node) -> Node:
        self._removable.append(node)
        return node
