"""Page that replays a motion, with a timeline, tensions and energies.

An event is a change of the run, such as a catch, at which a slack string becomes taut; the slip is
the length that a winch has let out, and the ledger the table of energies and work.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fantoccini.app.pages.loop import REFRESH, PageLoop
from fantoccini.app.pages.nodes import SceneNodes
from fantoccini.app.pages.panel import Plot, Views, dotted_name, note_html, tension_table_html
from fantoccini.app.pages.plan_tree import PlanTree
from fantoccini.app.pages.scene_state import scene_at_sample
from fantoccini.app.pages.server import Server
from fantoccini.output.html import Content, element, to_html
from fantoccini.output.view import Geometry, Theme, run_geometry

if TYPE_CHECKING:
    import viser

    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.motion import EventRecord, Trajectory

_SPEED_FACTORS = {"1/8": 0.125, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "4": 4.0}


class _Limits(NamedTuple):
    """Limits of the frames, points and events that are kept and shown."""

    max_rate: float = 240.0  # Resampled frames per second: enough for slow motion at 1/4
    max_frames: int = 40_000  # Resampled frames: memory
    plot_points: int = 240  # Points of a line: pixels of a plot
    listed_events: int = 8  # Events that are listed at a time
    max_marks: int = 30  # Marks on the slider; more are not legible


_LIMITS = _Limits()

EVENT_TEXTS = {
    "catch": "catches",
    "release": "goes slack",
    "limit_on": "reaches its limit",
    "limit_off": "leaves its limit",
    "accumulation": "catches at shrinking intervals",
    "slip": "slips",
    "grip": "grips",
    "touch": "touch",
    "lift": "part",
    "slide": "slide",
    "stick": "stick",
}


@dataclass(frozen=True, eq=False)
class ResampledRun:
    """Motion at evenly spaced times.

    Attributes:
        run: the original run.
        geometry: geometry at the times of the frames.
        events: events, without breakpoints of the inputs.
    """

    run: Trajectory
    geometry: Geometry
    events: tuple[EventRecord, ...]

    @classmethod
    def from_run(
        cls,
        marionette: Marionette,
        run: Trajectory,
        rate: float | None = None,
        forces: bool | None = None,
    ) -> ResampledRun:
        """The motion at ``rate`` frames per second, by default up to 240.

        ``forces``: whether to compute contact forces; by default if the puppet has contacts.
        """
        if rate is None:
            rate = min(_LIMITS.max_rate, _LIMITS.max_frames / max(run.duration, 1e-9))
        n_frames = max(1, round(run.duration * rate))
        times = np.linspace(run.t[0], run.t[-1], n_frames + 1)
        events = tuple(e for e in run.events if e.kind != "breakpoint")
        resampled = run.resample(times)
        forces = run.contact is not None if forces is None else forces
        return cls(run, run_geometry(marionette, resampled, forces), events)

    @property
    def start(self) -> float:
        """First time [s]."""
        return float(self.geometry.t[0])

    @property
    def end(self) -> float:
        """Last time [s]."""
        return float(self.geometry.t[-1])

    def frame_index(self, t: float) -> int:
        """Index of the frame at a time."""
        share = (t - self.start) / max(self.end - self.start, 1e-12)
        return int(np.clip(round(share * (len(self.geometry.t) - 1)), 0, len(self.geometry.t) - 1))


class Replay(PageLoop):
    """Replay of a motion on a page.

    Attributes:
        t: shown time [s].
        playing: whether the motion is playing.
        shown: index of the shown frame; -1 before the first.
        views: buttons for the camera, and checkboxes for the parts of the world to show.

    Args:
        server: server of the page.
        motion: motion to replay.
        theme: colours.
        tree: search tree of the plan with this motion, or None.
    """

    def __init__(
        self, server: Server, motion: ResampledRun, theme: Theme, tree: PlanTree | None = None
    ):
        super().__init__("replay")
        self.server, self.motion, self.theme = server, motion, theme
        self.nodes = SceneNodes(server.viser, motion.geometry, theme)
        if tree is not None:
            tree.add_to(server.viser, theme, motion.geometry.size)
        self.nodes.aim_camera(server.viser.initial_camera, "three-quarter")
        self.t, self.playing, self.speed = motion.start, True, 1.0
        self.shown = -1
        self._next_update = {"plot": 0.0, "numbers": 0.0}
        self._lock = threading.Lock()
        self._set_up_panel()

    def seek(self, t: float) -> None:
        """Shows another time [s]."""
        with self._lock:
            self.t = float(np.clip(t, self.motion.start, self.motion.end))

    # -- panel ---------------------------------------------------------------------------------

    def _set_up_panel(self) -> None:
        gui, motion = self.server.viser.gui, self.motion
        gui.add_html(note_html(_summary_text(motion)))
        time_range = motion.start, motion.end
        self._slider = gui.add_slider(
            "Time",
            time_range[0],
            max(time_range[1], time_range[0] + 1e-3),
            max(1e-3, round((time_range[1] - time_range[0]) / 2000, 3)),
            time_range[0],
            marks=_slider_marks(motion),
        )
        self._slider.on_update(self._slider_moved)
        self._play = gui.add_button("Pause", icon="player-pause")
        self._play.on_click(lambda _: self._toggle())
        step_buttons = gui.add_button_group(
            "Step", ("|<", "<", ">", ">|"), hint="Events and frames"
        )
        step_buttons.on_click(lambda event: self._step(event.target.value))
        self._speed = gui.add_dropdown("Speed", tuple(_SPEED_FACTORS), initial_value="1")
        self._speed.on_update(lambda _: setattr(self, "speed", _SPEED_FACTORS[self._speed.value]))
        self._loop = gui.add_checkbox("Loop", True)
        self.views = Views(gui, lambda: self.nodes, lambda: motion.run.contact is not None)
        self.views.apply()
        self._plot_t = np.linspace(*time_range, _LIMITS.plot_points)
        plotted_run = motion.run.resample(self._plot_t)
        self._tensions = np.minimum(
            plotted_run.tension.values, 10.0 * self.nodes.colours.full_scale
        ).T
        energies = [plotted_run.ledger["kinetic"], plotted_run.ledger["potential"]]
        energies[1] = energies[1] - energies[1].min()
        self._energies = np.array([*energies, energies[0] + energies[1]])
        if motion.geometry.names:
            with gui.add_folder("Tension"):
                self._bars = gui.add_html("")
                self._tension = Plot(
                    gui,
                    motion.geometry.names,
                    self.theme,
                    "N",
                    time_range,
                    (0.0, 1.05 * self.nodes.colours.full_scale),
                    mark=True,
                )
        with gui.add_folder("Energy"):
            self._energy = Plot(
                gui,
                ("kinetic", "potential", "sum"),
                self.theme,
                "J",
                time_range,
                _value_range(self._energies),
                mark=True,
                height=140,
            )
            gui.add_html(_legend(("kinetic", "potential", "sum"), self.theme.line_colours))
        self._event_list = None
        if motion.events:
            with gui.add_folder("Events"):
                self._event_list = gui.add_html("")
        gui.add_command("Play or pause", hotkey="P").on_trigger(lambda _: self._toggle())
        for label, key, step in (
            ("Step back", "A", "<"),
            ("Step forward", "D", ">"),
            ("Previous event", "W", "|<"),
            ("Next event", "S", ">|"),
        ):
            gui.add_command(label, hotkey=key).on_trigger(lambda _, step=step: self._step(step))

    def _slider_moved(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        if event.client is not None:  # a viewer, not this program
            self._pause()
            self.seek(self._slider.value)

    def _toggle(self) -> None:
        if self.playing:
            self._pause()
            return
        if self.t >= self.motion.end:
            self.seek(self.motion.start)
        self.playing = True
        self._play.label, self._play.icon = "Pause", "player-pause"

    def _pause(self) -> None:
        self.playing = False
        self._play.label, self._play.icon = "Play", "player-play"

    def _step(self, step: str) -> None:
        self._pause()
        if step in ("<", ">"):
            self.seek(self.t + (1.0 if step == ">" else -1.0) / REFRESH.rate)
            return
        times = [e.t for e in self.motion.events]
        tolerance = 1e-6
        if step == ">|":
            self.seek(min((t for t in times if t > self.t + tolerance), default=self.motion.end))
        else:
            self.seek(max((t for t in times if t < self.t - tolerance), default=self.motion.start))

    def _finish(self) -> None:
        """Does nothing: there is no unfinished work."""

    # -- playing -------------------------------------------------------------------------------

    def _run(self) -> None:
        last_time = time.perf_counter()
        while not self._end.wait(max(0.0, 1.0 / REFRESH.rate - (time.perf_counter() - last_time))):
            now = time.perf_counter()
            if self.playing:
                self._advance((now - last_time) * self.speed)
            last_time = now
            self._show(now)

    def _advance(self, duration: float) -> None:
        with self._lock:
            self.t += duration
            if self.t < self.motion.end:
                return
            self.t = self.motion.start if self._loop.value else self.motion.end
        if not self._loop.value:
            self._pause()

    def _show(self, now: float) -> None:
        k = self.motion.frame_index(self.t)
        if k == self.shown:
            return
        scene = scene_at_sample(self.motion.geometry, k)
        with self.server.viser.atomic():
            self.nodes.show(scene)
            if now >= self._next_update["numbers"]:
                self._next_update["numbers"] = now + REFRESH.numbers
                self._slider.value = round(self.t, 3)
                if self.motion.geometry.names:
                    self._bars.content = tension_table_html(
                        self.motion.geometry.names, scene, self.nodes
                    )
                if self._event_list is not None:
                    self._event_list.content = events_html(self.motion.events, self.t)
            if now >= self._next_update["plot"]:
                self._next_update["plot"] = now + REFRESH.numbers
                if self.motion.geometry.names:
                    self._tension.draw(self._plot_t, self._tensions, self.t)
                self._energy.draw(self._plot_t, self._energies, self.t)
                self.shown = k


def _value_range(values: np.ndarray) -> tuple[float, float]:
    """Range of all values, with a margin."""
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _summary_text(motion: ResampledRun) -> str:
    run = motion.run
    reason = "" if run.status.name == "DONE" else f"; {run.status.message}"
    events = f"{len(motion.events)} events" if run.events_recorded else "events not recorded"
    return f"{run.duration:.2f} s, {events}, by {run.method}{reason}"


def _slider_marks(motion: ResampledRun) -> tuple[float, ...] | None:
    times = [e.t for e in motion.events if e.kind in ("catch", "slip", "accumulation")]
    return tuple(round(t, 3) for t in times) if 0 < len(times) <= _LIMITS.max_marks else None


def events_html(events: Sequence[EventRecord], t: float) -> str:
    """The last events before a time, and the next one, as HTML."""
    n_past = sum(e.t <= t + 1e-9 for e in events)
    first = max(0, min(n_past - _LIMITS.listed_events + 2, len(events) - _LIMITS.listed_events))
    rows = []
    for n, event in enumerate(events[first : first + _LIMITS.listed_events], start=first):
        text = f"{event.name} {EVENT_TEXTS.get(event.kind, event.kind)}"
        if event.impulse > 0.0:
            text += f", {event.impulse:.3g} N s"
        weight = "font-weight:600" if n == n_past - 1 else ""
        shade = "" if n < n_past else "opacity:0.45;"
        rows.append(element("div", f"{event.t:.3f} s \N{EN SPACE}{text}", style=shade + weight))
    return to_html(element("div", *rows, style="padding:0 0.5em;font-size:0.82em;line-height:1.5"))


def _legend(names: Sequence[str], colours: Sequence[str]) -> str:
    dots: list[Content] = []
    for name, colour in zip(names, colours, strict=False):
        dots += [*dotted_name(name, colour), "\N{EM SPACE}"]
    return to_html(element("div", *dots[:-1], style="padding:0 0.5em;font-size:0.82em"))
