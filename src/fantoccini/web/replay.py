"""A page that plays a motion back: timeline, speed, tension and energy in step with it."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.view.scene import Scene, scene_of
from fantoccini.view.theme import Theme
from fantoccini.web.moment import moment_of
from fantoccini.web.panel import Plot, Views, bars, note, text
from fantoccini.web.server import Server
from fantoccini.web.stage import Stage
from fantoccini.web.tree import Growth

if TYPE_CHECKING:
    from fantoccini.marionette import Marionette
    from fantoccini.motion import EventRecord, Trajectory

RATE = 60.0
"""Frames that are sent each second."""

SPEEDS = {"1/8": 0.125, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "4": 4.0}

_FINEST = 240.0
_MOST_FRAMES = 40_000
_PLOT_POINTS = 240
_PLOT_EVERY = 0.1
_NUMBERS_EVERY = 0.1
_LISTED = 8
"""Events that are listed at a time."""
_MOST_MARKS = 30
_TOLD = {
    "catch": "catches", "release": "goes slack", "limit_on": "reaches its limit",
    "limit_off": "leaves its limit", "accumulation": "catches ever faster", "slip": "slips",
    "grip": "grips",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Film:
    """A motion at even times, ready to be shown.

    Attributes:
        run: as it came.
        scene: of its frames.
        events: without breakpoints of the inputs.
    """

    run: Trajectory
    scene: Scene
    events: tuple[EventRecord, ...]

    @classmethod
    def of(cls, marionette: Marionette, run: Trajectory, rate: float | None = None) -> Film:
        """The motion at ``rate`` frames a second, or as many as are worth having."""
        if rate is None:
            rate = min(_FINEST, _MOST_FRAMES / max(run.duration, 1e-9))
        frames = max(1, round(run.duration * rate))
        times = np.linspace(run.t[0], run.t[-1], frames + 1)
        events = tuple(e for e in run.events if e.kind != "breakpoint")
        return cls(run, scene_of(marionette, run.resample(times)), events)

    @property
    def start(self) -> float:
        """First time [s]."""
        return float(self.scene.t[0])

    @property
    def end(self) -> float:
        """Last time [s]."""
        return float(self.scene.t[-1])

    def frame(self, t: float) -> int:
        """The frame of a time."""
        share = (t - self.start) / max(self.end - self.start, 1e-12)
        return int(np.clip(round(share * (len(self.scene.t) - 1)), 0, len(self.scene.t) - 1))


class Replay:
    """Plays a motion on a page.

    Attributes:
        t: the time that is shown [s].
        playing: whether it goes on.

    Args:
        server: of the page.
        film: what to play.
        theme: the look.
        growth: tree of the plan that the motion comes from, or None.
    """

    def __init__(self, server: Server, film: Film, theme: Theme, growth: Growth | None = None):
        self.server, self.film, self.theme = server, film, theme
        self.stage = Stage(server.viser, film.scene, theme)
        if growth is not None:
            growth.add_to(server.viser, theme, film.scene.size)
        self.stage.look(server.viser.initial_camera, "three-quarter")
        self.t, self.playing, self.speed = film.start, True, 1.0
        self._shown = -1
        self._due = {"plot": 0.0, "numbers": 0.0}
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._set_up_panel()
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)

    def start(self) -> None:
        """Begins to play."""
        self._thread.start()

    def stop(self) -> None:
        """Ends playing and the server."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self.server.stop()

    def seek(self, t: float) -> None:
        """Shows another time [s]."""
        with self._lock:
            self.t = float(np.clip(t, self.film.start, self.film.end))

    # -- panel ---------------------------------------------------------------------------------

    def _set_up_panel(self) -> None:
        gui, film = self.server.viser.gui, self.film
        gui.add_html(note(_about(film)))
        span = film.end - film.start
        self._slider = gui.add_slider(
            "Time", film.start, max(film.end, film.start + 1e-3), max(1e-3, round(span / 2000, 3)),
            film.start, marks=_marks(film),
        )  # fmt: skip
        self._slider.on_update(self._slid)
        self._play = gui.add_button("Pause", icon="player-pause")
        self._play.on_click(lambda _: self._toggle())
        steps = gui.add_button_group("Step", ("|<", "<", ">", ">|"), hint="Events and frames")
        steps.on_click(lambda event: self._step(event.target.value))
        self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")
        self._speed.on_update(lambda _: setattr(self, "speed", SPEEDS[self._speed.value]))
        self._loop = gui.add_checkbox("Loop", True)
        self._views = Views(gui, lambda: self.stage)
        self._views.apply()
        self._plot_t = np.linspace(film.start, film.end, _PLOT_POINTS)
        coarse = film.run.resample(self._plot_t)
        self._tensions = np.minimum(coarse.tension.values, 10.0 * self.stage.colours.top).T
        stored = [coarse.ledger["kinetic"], coarse.ledger["potential"]]
        stored[1] = stored[1] - stored[1].min()
        self._energies = np.array([*stored, stored[0] + stored[1]])
        if film.scene.names:
            with gui.add_folder("Tension"):
                self._bars = gui.add_html("")
                self._tension = Plot(
                    gui, film.scene.names, self.theme, "N", (film.start, film.end),
                    (0.0, 1.05 * self.stage.colours.top), mark=True,
                )  # fmt: skip
        with gui.add_folder("Energy"):
            self._energy = Plot(
                gui, ("kinetic", "potential", "sum"), self.theme, "J", (film.start, film.end),
                _scale(self._energies), mark=True, height=140,
            )  # fmt: skip
            gui.add_html(_legend(("kinetic", "potential", "sum"), self.theme.cycle))
        self._listing = None
        if film.events:
            with gui.add_folder("Events"):
                self._listing = gui.add_html("")
        gui.add_command("Play or pause", hotkey="P").on_trigger(lambda _: self._toggle())
        for label, key, what in (
            ("Step back", "A", "<"), ("Step on", "D", ">"),
            ("Event before", "W", "|<"), ("Next event", "S", ">|"),
        ):  # fmt: skip
            gui.add_command(label, hotkey=key).on_trigger(lambda _, what=what: self._step(what))

    def _slid(self, event: Any) -> None:
        if event.client is not None:  # a person, not this program
            self._pause()
            self.seek(self._slider.value)

    def _toggle(self) -> None:
        if self.playing:
            self._pause()
            return
        if self.t >= self.film.end:
            self.seek(self.film.start)
        self.playing = True
        self._play.label, self._play.icon = "Pause", "player-pause"

    def _pause(self) -> None:
        self.playing = False
        self._play.label, self._play.icon = "Play", "player-play"

    def _step(self, what: str) -> None:
        self._pause()
        if what in ("<", ">"):
            self.seek(self.t + (1.0 if what == ">" else -1.0) / RATE)
            return
        times = [e.t for e in self.film.events]
        near = 1e-6
        if what == ">|":
            self.seek(min((t for t in times if t > self.t + near), default=self.film.end))
        else:
            self.seek(max((t for t in times if t < self.t - near), default=self.film.start))

    # -- playing -------------------------------------------------------------------------------

    def _run(self) -> None:
        last = time.perf_counter()
        while not self._end.wait(max(0.0, 1.0 / RATE - (time.perf_counter() - last))):
            now = time.perf_counter()
            if self.playing:
                self._go_on((now - last) * self.speed)
            last = now
            self._show(now)

    def _go_on(self, duration: float) -> None:
        with self._lock:
            self.t += duration
            if self.t < self.film.end:
                return
            self.t = self.film.start if self._loop.value else self.film.end
        if not self._loop.value:
            self._pause()

    def _show(self, now: float) -> None:
        k = self.film.frame(self.t)
        if k == self._shown:
            return
        moment = moment_of(self.film.scene, k)
        with self.server.viser.atomic():
            self.stage.show(moment)
            if now >= self._due["numbers"]:
                self._due["numbers"] = now + _NUMBERS_EVERY
                self._slider.value = round(self.t, 3)
                if self.film.scene.names:
                    self._bars.content = bars(self.film.scene.names, moment, self.stage)
                if self._listing is not None:
                    self._listing.content = _listed(self.film.events, self.t)
            if now >= self._due["plot"]:
                self._due["plot"] = now + _PLOT_EVERY
                if self.film.scene.names:
                    self._tension.draw(self._plot_t, self._tensions, self.t)
                self._energy.draw(self._plot_t, self._energies, self.t)
                self._shown = k


def _scale(values: np.ndarray) -> tuple[float, float]:
    """Ends of a scale that holds all values."""
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _about(film: Film) -> str:
    run = film.run
    ended = "" if run.status.name == "DONE" else f"; {run.status.message}"
    return f"{run.duration:.2f} s, {len(film.events)} events, by {run.method}{ended}"


def _marks(film: Film) -> tuple[float, ...] | None:
    caught = [e.t for e in film.events if e.kind in ("catch", "slip", "accumulation")]
    return tuple(round(t, 3) for t in caught) if 0 < len(caught) <= _MOST_MARKS else None


def _listed(events: Sequence[EventRecord], t: float) -> str:
    """The last events before a time, and the next, as HTML."""
    past = sum(e.t <= t + 1e-9 for e in events)
    first = max(0, min(past - _LISTED + 2, len(events) - _LISTED))
    rows = []
    for n, event in enumerate(events[first : first + _LISTED], start=first):
        words = f"{event.name} {_TOLD.get(event.kind, event.kind)}"
        if event.impulse > 0.0:
            words += f", {event.impulse:.3g} N s"
        weight = "font-weight:600" if n == past - 1 else ""
        shade = "" if n < past else "opacity:0.45;"
        rows.append(f'<div style="{shade}{weight}">{event.t:.3f} s &ensp;{text(words)}</div>')
    return f'<div style="padding:0 0.5em;font-size:0.82em;line-height:1.5">{"".join(rows)}</div>'


def _legend(names: Sequence[str], cycle: Sequence[str]) -> str:
    dots = "&emsp;".join(
        f'<span style="color:{colour}">&#9679;</span> {text(name)}'
        for name, colour in zip(names, cycle, strict=False)
    )
    return f'<div style="padding:0 0.5em;font-size:0.82em">{dots}</div>'
