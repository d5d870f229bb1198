"""A page with a puppet that is alive: whoever looks at it can take its strings in hand."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.errors import FantocciniError
from fantoccini.perform import Performance
from fantoccini.view.scene import Scene, scene_at
from fantoccini.view.theme import Theme
from fantoccini.web import pad
from fantoccini.web.audience import holds
from fantoccini.web.board import Board
from fantoccini.web.controls import Controls, sight
from fantoccini.web.drag import nudge
from fantoccini.web.holder import Holder, Viewer
from fantoccini.web.moment import Moment, moment_at
from fantoccini.web.server import Server, Visitor
from fantoccini.web.source import Source
from fantoccini.web.stage import Stage
from fantoccini.web.take import Take

RATE = 60.0
"""Updates of the page each second."""
_LONGEST = 0.1
"""A frame that took longer makes the puppet slower, not jumpier [s]."""
_NUMBERS_EVERY = 0.1
_MARKS_EVERY = 1.0 / 15.0
_HISTORY = 10.0
"""Length of the plot [s]."""
_SAMPLES_EVERY = 0.05
_SAID_EVERY = 2.0
_PAD_SPEED = 0.5
"""A stick that is pushed fully moves a handle so fast, of the puppet's size [1/s]."""


class Live:
    """A puppet that is alive on a page.

    One thread does everything to the puppet and the page; what viewers do waits in a queue, or is
    a target that the puppet's hands go to.

    Attributes:
        performance: the puppet in somebody's hands.
        stage: what the page shows.
        controls: what a person takes hold of.
        holder: who holds the strings.
        paused: whether time stands still.
        factor: how fast time goes; below 1 is slow motion.

    Args:
        performance: the puppet.
        theme: the look.
        record_to: folder for recordings.
        file: the puppet's file, which is read again when it is saved; or None.
    """

    def __init__(
        self, performance: Performance, theme: Theme, record_to: Path, file: Path | None = None
    ):
        self.performance, self.theme = performance, theme
        self.holder = Holder()
        self.paused, self.factor = False, 1.0
        self._take = Take(performance, record_to)
        self._source = None if file is None else Source(file)
        self._pads = pad.Pads()
        self._jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._past: deque[tuple[float, np.ndarray]] = deque()
        self._said: dict[Viewer, float] = {}
        self._eye: Any = None
        self._due = {"numbers": 0.0, "marks": 0.0, "sample": 0.0}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)

    @property
    def script(self) -> str:
        """What the page needs to know of gamepads."""
        return pad.SCRIPT

    @property
    def visitors(self) -> dict[str, Visitor]:
        """Websockets of our own."""
        return {pad.PATH: self._pads.visit}

    def open(self, server: Server) -> None:
        """Builds the page."""
        self.server = server
        self.board = Board(self, server.viser, self.theme)
        self._build()
        self.stage.look(server.viser.initial_camera, "three-quarter")
        server.viser.on_client_connect(self._fit)
        server.viser.on_client_disconnect(lambda client: self.holder.leave(client.client_id))

    def start(self) -> None:
        """Begins to live."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the page; a recording that goes on is written first."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self._take.finish()
        self.server.stop()

    @property
    def recording(self) -> bool:
        """Whether what happens is recorded."""
        return self._take.running

    @property
    def take_time(self) -> float:
        """Of the recording that goes on [s]."""
        return self.performance.t - self._take.began

    @property
    def take_said(self) -> str:
        """What became of the last recording."""
        return self._take.said

    # -- what viewers do -----------------------------------------------------------------------

    def act(self, viewer: Viewer | None, do: Callable[[], None]) -> bool:
        """Does something to the puppet for a viewer, when it may; whether it did."""
        if viewer is not None and not self.holder.claim(viewer):
            self._refuse(viewer)
            return False
        try:
            do()
        except FantocciniError as error:
            self.board.say(str(error))
            return False
        return True

    def later(self, viewer: Viewer | None, do: Callable[[], None]) -> bool:
        """As :meth:`act`, but in the thread that does everything, between two frames."""
        return self.act(viewer, lambda: self._jobs.put(do))

    def pause(self) -> None:
        """Time stands still, or goes on."""
        self.paused = not self.paused
        self.board.show_paused(self.paused)

    def step(self) -> None:
        """A frame at a time."""
        if not self.paused:
            self.pause()
        self.performance.advance(1.0 / RATE)

    def reset(self) -> None:
        """Back to the start."""
        self.performance.reset()
        self._past.clear()

    def record(self) -> None:
        """Begins a recording, or ends and writes it."""
        if self._take.running:
            self._take.end()
        else:
            self._take.begin()

    def push(self, right: float, up: float, camera: Any = None) -> None:
        """Moves the selected handle as seen by a viewer, in parts of the puppet's size."""
        handle = self.controls.handle
        if handle is None:
            return
        size = self.stage.scene.size
        by = nudge(handle.axes, self._sight(camera), right * size, up * size)
        position, _ = self.performance.target(handle.name)
        self.performance.move(handle.name, position + by)

    def wind(self, by: float) -> None:
        """Winds the string of the selected handle in or out, in parts of the puppet's size."""
        if self.controls.selected is not None:
            self.controls.wind(self.controls.selected, by * self.stage.scene.size)

    def set_parameters(self, values: dict[str, float]) -> None:
        """Goes on with other parameters."""
        self._told(self.performance.set_parameters(values))

    # -- the loop ------------------------------------------------------------------------------

    def _run(self) -> None:
        last = time.perf_counter()
        while not self._end.is_set():
            self._work(last + 1.0 / RATE)
            now = time.perf_counter()
            duration, last = min(now - last, _LONGEST), now
            self._safely(partial(self._frame, now, duration))

    def _work(self, until: float) -> None:
        """Does what waits, until the next frame is due."""
        while not self._end.is_set():
            left = until - time.perf_counter()
            try:
                job = self._jobs.get(timeout=left) if left > 0.0 else self._jobs.get_nowait()
            except queue.Empty:
                return
            self._safely(job)

    def _safely(self, do: Callable[[], None]) -> None:
        """Does something; a fault is told on the page, and the puppet lives on."""
        try:
            do()
        except FantocciniError as error:
            self.board.say(str(error))
        except Exception as error:
            self.board.say(f"a fault of fantoccini itself: {type(error).__name__}: {error}")

    def _frame(self, now: float, duration: float) -> None:
        self._follow_pads(duration)
        if not self.paused:
            self.performance.advance(duration * self.factor)
        moment = self._moment()
        self._remember(now, moment)
        with self.server.viser.atomic():
            self.stage.show(moment)
            self.controls.update(moment.poses)
            if now >= self._due["marks"]:
                self._due["marks"] = now + _MARKS_EVERY
                self.controls.mark(self.performance.lagging)
            if now >= self._due["numbers"]:
                self._due["numbers"] = now + _NUMBERS_EVERY
                self.controls.update_sliders()
                self.board.update(moment, self.performance.lagging, self._history())
        # viser would wait for more, and send two frames as one.
        self.server.viser.flush()
        self._take.look()
        self._look_at_file(now)

    def _moment(self) -> Moment:
        p = self.performance
        return moment_at(p.marionette, p.state, p.tension)

    def _remember(self, now: float, moment: Moment) -> None:
        if self.paused or now < self._due["sample"]:
            return
        self._due["sample"] = now + _SAMPLES_EVERY
        self._past.append((moment.t, moment.tension))
        while self._past[-1][0] - self._past[0][0] > _HISTORY or self._past[0][0] > moment.t:
            self._past.popleft()

    def _history(self) -> tuple[np.ndarray, np.ndarray]:
        """Times before now (n,) [s] and tensions (n_strings, n) [N]."""
        if len(self._past) < 2:
            return np.array([-_HISTORY, 0.0]), np.zeros((len(self.stage.scene.names), 2))
        t = np.array([at for at, _ in self._past])
        return t - t[-1], np.array([tension for _, tension in self._past]).T

    def _follow_pads(self, duration: float) -> None:
        pressed, sticks = self._pads.pressed(), self._pads.sticks
        if not pressed and not sticks.moved:
            return
        # One person with a mouse and a gamepad is one viewer.
        clients = list(self.server.viser.get_clients())
        viewer = clients[0] if len(clients) == 1 else self._pads.name
        for button, do in (
            (pad.NEXT, lambda: self.controls.select_next(1)),
            (pad.BEFORE, lambda: self.controls.select_next(-1)),
            (pad.PAUSE, self.pause), (pad.RESET, self.reset), (pad.RECORD, self.record),
        ):  # fmt: skip
            if button in pressed:
                self.act(viewer, do)
        if sticks.moved:
            far = _PAD_SPEED * duration
            self.act(viewer, lambda: self.push(far * sticks.right, far * sticks.away))
            self.act(viewer, lambda: self.wind(-far * sticks.up))

    # -- another puppet ------------------------------------------------------------------------

    def _look_at_file(self, now: float) -> None:
        if self._source is None:
            return
        news = self._source.news(now)
        if news is None:
            return
        self.board.show_mistakes(news.mistakes)
        if news.marionette is None:
            return
        lost = self.performance.replace(news.marionette)
        self._past.clear()
        with self.server.viser.atomic():
            self._clear()
            self._build()
        self._told(("the puppet was read again", *lost))

    def _build(self) -> None:
        scene = self._scene()
        self.stage = Stage(self.server.viser, scene, self.theme, 1.5 * scene.tension_top())
        self.board.build(self.stage)
        self.controls = Controls(
            self.server.viser, self.performance, self.theme, scene.size,
            self.stage.view("three-quarter"), self.act,
            lambda: self.board.drag_winds, self.holder.leave, self.board.lengths,
        )  # fmt: skip
        self.board.set_up(self.controls)
        self.stage.show(self._moment())

    def _clear(self) -> None:
        self.controls.remove()
        self.board.clear()
        self.stage.clear()

    def _scene(self) -> Scene:
        p = self.performance
        return scene_at(p.marionette, p.state, self._resting())

    def _resting(self) -> np.ndarray:
        """(n_strings,) tensions that say what is much for this puppet [N]."""
        p = self.performance
        tension = np.asarray(p.tension, dtype=float)
        if tension.any():
            return tension
        _, forces = p.marionette.forward_dynamics(p.state)
        return np.asarray(forces)[: len(p.marionette.tree.strings)]

    # -- telling -------------------------------------------------------------------------------

    def _told(self, lost: tuple[str, ...]) -> None:
        if lost:
            self.board.say("; ".join(lost))

    def _refuse(self, viewer: Viewer) -> None:
        now = time.monotonic()
        if now - self._said.get(viewer, -np.inf) < _SAID_EVERY:
            return
        self._said[viewer] = now
        client = self.server.viser.get_clients().get(viewer)
        if client is not None:
            client.add_notification(
                "Somebody else holds the strings", f"{holds(self.holder.viewer, viewer)}.",
                auto_close_seconds=3.0, color="yellow",
            )  # fmt: skip

    def _fit(self, client: Any) -> None:
        """A narrow window, as of a phone, looks from farther away."""
        if client.camera.aspect < 1.0:
            self.stage.look(client.camera, "three-quarter")

    def _sight(self, camera: Any) -> np.ndarray:
        if camera is not None:
            self._eye = sight(camera)
        if self._eye is None:
            view = self.stage.view("three-quarter")
            self._eye = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
        return self._eye
