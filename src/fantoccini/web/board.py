"""The panel beside a puppet that is alive: buttons, sliders, numbers, and what is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.view.theme import Theme
from fantoccini.web.audience import Audience
from fantoccini.web.moment import Moment
from fantoccini.web.panel import Plot, Views, bars, note, text
from fantoccini.web.stage import VIEWS, Stage

if TYPE_CHECKING:
    import viser

    from fantoccini.web.controls import Controls
    from fantoccini.web.live import Live

SPEEDS = {"1": 1.0, "1/2": 0.5, "1/4": 0.25, "1/8": 0.125, "1/16": 0.0625}
_PUSH = 0.012
"""A key moves a handle so far, of the puppet's size."""
_HINT = "Drag a bead to move it."
_HINT_WINDS = "Drag a bead to move it; Shift and drag up or down winds its string."
_KEYS = (
    "F and G choose a handle, A D W S move it, Q E wind its string, P pauses, N steps, R resets, "
    "T records, 1 to 4 and the arrow keys turn the camera. A gamepad works too."
)
_RED = "#d64545"


class Board:
    """What stands beside the puppet.

    Attributes:
        lengths: folder of the sliders of strings.

    Args:
        live: what the buttons act on.
        server: of viser.
        theme: the look.
    """

    def __init__(self, live: Live, server: viser.ViserServer, theme: Theme):
        self._live, self._gui, self._theme = live, server.gui, theme
        self._said = ""
        self._made: list[Any] = []
        gui = server.gui
        # What each viewer is told for itself stands second.
        self._status = gui.add_html("", order=-4.0)
        self._audience = Audience(server, order=-3.0)
        self._mistakes = gui.add_html("", order=-2.0, visible=False)
        self._hint = gui.add_html("", order=-1.0)
        self._pause = gui.add_button("Pause", icon="player-pause")
        steps = gui.add_button_group("Time", ("Step", "Reset"))
        self._record = gui.add_button("Record", icon="player-record", color="red")
        with gui.add_folder("Speed and view", expand_by_default=False):
            self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")
            self._views = Views(gui, lambda: live.stage)
            self._names = gui.add_checkbox("Names", True, hint="Of the handles")
            self._names.on_update(lambda _: live.controls.show_names(self._names.value))
        self._pause.on_click(lambda e: live.later(e.client_id, live.pause))
        self._record.on_click(lambda e: live.later(e.client_id, live.record))
        steps.on_click(
            lambda e: live.later(e.client_id, live.step if e.target.value == "Step" else live.reset)
        )
        self._speed.on_update(self._set_speed)
        self._add_keys()

    def build(self, stage: Stage) -> None:
        """What depends on the puppet."""
        gui, live = self._gui, self._live
        self._stage = stage
        self._views.apply()
        names = stage.scene.names
        winds = bool(live.performance.lengths)
        self._hint.content = note(_HINT_WINDS if winds else _HINT)
        handles = tuple(handle.name for handle in live.performance.handles)
        self._handle = self._winds = self._shown = None
        if handles:
            self._handle = self._keep(gui.add_dropdown("Handle", handles, hint="F and G choose"))
            self._shown = self._handle.value
            self._handle.on_update(self._choose)
        if winds:
            self._winds = self._keep(
                gui.add_checkbox("Drag winds", False, hint="Dragging winds strings without Shift")
            )
        self.lengths = self._keep(gui.add_folder("String lengths [m]", visible=winds))
        if names:
            tension = self._keep(gui.add_folder("Tension"))
            with tension:
                self._bars = gui.add_html("")
                self._plot = Plot(
                    gui, names, self._theme, "N", (-10.0, 0.0), (0.0, 1.05 * stage.colours.top)
                )
        values = live.performance.marionette.tree.parameters
        if values:
            with self._keep(gui.add_folder("Parameters")):
                current = dict(zip(values, live.performance.marionette.p, strict=True))
                for name, value in current.items():
                    self._add_parameter(name, float(value))
        with self._keep(gui.add_folder("Keys", expand_by_default=False)):
            gui.add_html(note(_KEYS))

    @property
    def drag_winds(self) -> bool:
        """Whether a bead that is dragged winds its string, without Shift."""
        return self._winds is not None and self._winds.value

    def set_up(self, controls: Controls) -> None:
        """Brings new beads and rings to what the boxes say."""
        controls.show_names(self._names.value)

    def clear(self) -> None:
        """Takes out what depends on the puppet."""
        for node in self._made:
            node.remove()
        self._made.clear()

    def say(self, words: str) -> None:
        """Says something under the buttons, until something else is said."""
        self._said = words

    def show_paused(self, paused: bool) -> None:
        """Says on the button what it would do."""
        self._pause.label = "Go on" if paused else "Pause"
        self._pause.icon = "player-play" if paused else "player-pause"

    def show_mistakes(self, mistakes: tuple[str, ...]) -> None:
        """Shows what is wrong with the puppet's file, or nothing."""
        self._mistakes.visible = bool(mistakes)
        lines = "".join(f"<div>{text(line)}</div>" for line in mistakes)
        self._mistakes.content = (
            f'<div style="margin:0 0.5em;padding:0.5em 0.7em;border-left:4px solid {_RED};'
            'background:rgba(214,69,69,0.12);font-size:0.82em;overflow-wrap:anywhere">'
            f"<b>The file holds mistakes; the puppet goes on as it was.</b>{lines}</div>"
        )

    def update(
        self, moment: Moment, lagging: dict[str, str], history: tuple[np.ndarray, np.ndarray]
    ) -> None:
        """New numbers.

        Args:
            moment: now.
            lagging: names of handles and strings that cannot do what is asked, and why.
            history: times before now [s] and tensions [N].
        """
        self._status.content = self._about(moment, lagging)
        self._audience.tell(self._live.holder.viewer)
        selected = self._live.controls.selected
        # Only news goes to the list: a viewer may just have chosen, and is not overruled.
        if self._handle is not None and self._shown != selected:
            self._handle.value = self._shown = selected
        running = self._live.recording
        self._record.label = "Stop recording" if running else "Record"
        if self._stage.scene.names:
            self._bars.content = bars(self._stage.scene.names, moment, self._stage)
            t, tension = history
            self._plot.draw(t, np.minimum(tension, 10.0 * self._stage.colours.top))

    # -- inside --------------------------------------------------------------------------------

    def _about(self, moment: Moment, lagging: dict[str, str]) -> str:
        live = self._live
        clock = f"{moment.t:.1f} s"
        if live.paused:
            clock += ", paused"
        elif live.factor != 1.0:
            clock += f", {live.factor:g} times as fast"
        if live.recording:
            clock += (
                f' &ensp;<span style="color:{_RED}">&#9679; recording {live.take_time:.1f} s</span>'
            )
        lines = [f"<div>{clock}</div>"]
        lines += [
            f'<div style="color:{_RED}">{text(name)}: {text(why)}</div>'
            for name, why in lagging.items()
        ]
        lines += [
            f'<div style="opacity:0.75;overflow-wrap:anywhere">{text(said)}</div>'
            for said in dict.fromkeys((live.take_said, self._said))
            if said
        ]
        return (
            f'<div style="padding:0 0.5em;font-size:0.85em;line-height:1.45">{"".join(lines)}</div>'
        )

    def _choose(self, event: Any) -> None:
        if event.client_id is not None:
            name = self._handle.value
            self._live.later(None, lambda: self._live.controls.select(name))

    def _set_speed(self, event: Any) -> None:
        if event.client_id is None:
            return
        factor = SPEEDS[self._speed.value]
        if not self._live.act(event.client_id, lambda: setattr(self._live, "factor", factor)):
            self._speed.value = next(k for k, v in SPEEDS.items() if v == self._live.factor)

    def _add_parameter(self, name: str, value: float) -> None:
        low, high = (0.2 * value, 3.0 * value) if value else (-1.0, 1.0)
        low, high = min(low, high), max(low, high)
        slider = self._gui.add_slider(name, low, high, (high - low) / 280.0, value)

        @slider.on_update
        def _(event: Any) -> None:
            if event.client_id is None:
                return
            live = self._live
            if not live.later(
                event.client_id, lambda: live.set_parameters({name: float(slider.value)})
            ):
                tree = live.performance.marionette.tree
                slider.value = float(
                    live.performance.marionette.p[list(tree.parameters).index(name)]
                )

    def _add_keys(self) -> None:
        live = self._live

        def acts(label: str, key: str, do: Any) -> None:
            command = self._gui.add_command(label, hotkey=key)
            command.on_trigger(lambda e: live.later(e.client_id, lambda: do(e.client.camera)))

        acts("Pause or go on", "P", lambda _: live.pause())
        acts("Step", "N", lambda _: live.step())
        acts("Reset", "R", lambda _: live.reset())
        acts("Record or stop", "T", lambda _: live.record())
        acts("Next handle", "F", lambda _: live.controls.select_next(1))
        acts("Handle before", "G", lambda _: live.controls.select_next(-1))
        for label, key, right, up in (
            ("left", "A", -_PUSH, 0.0), ("right", "D", _PUSH, 0.0),
            ("up or away", "W", 0.0, _PUSH), ("down or near", "S", 0.0, -_PUSH),
        ):  # fmt: skip
            acts(f"Handle {label}", key, lambda c, r=right, u=up: live.push(r, u, c))
        acts("Wind in", "E", lambda _: live.wind(-_PUSH))
        acts("Wind out", "Q", lambda _: live.wind(_PUSH))
        for n, view in enumerate(VIEWS, start=1):
            self._gui.add_command(f"Camera: {view}", hotkey=str(n)).on_trigger(
                lambda e, view=view: live.stage.look(e.client.camera, view)
            )

    def _keep(self, node: Any) -> Any:
        self._made.append(node)
        return node
