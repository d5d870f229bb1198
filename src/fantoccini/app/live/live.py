"""Page with a live puppet whose strings every viewer can move.

A handle is a driven string end, or a body on a driven joint, that a viewer can drag. q_D and q_K
are the dynamic and driven coordinates.
"""

from __future__ import annotations

import queue
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fantoccini.app.live import midi, pad, sound
from fantoccini.app.live.body_pulls import BodyPulls
from fantoccini.app.live.controls import Controls, line_of_sight
from fantoccini.app.live.drag import push_displacement
from fantoccini.app.live.holder import Holder, Viewer, holder_text
from fantoccini.app.live.live_panel import LivePanel
from fantoccini.app.live.recorder import Recorder
from fantoccini.app.live.stage import Stage
from fantoccini.app.live.watched_file import WatchedFile, load_compiled
from fantoccini.app.pages import (
    REFRESH,
    Handler,
    PageLoop,
    SceneNodes,
    SceneState,
    Server,
    Viewpoint,
    scene_of_state,
)
from fantoccini.base import FantocciniError
from fantoccini.dynamics.derivatives import motion_at
from fantoccini.output.view import AUDIENCE, Geometry, Theme, force_arrows, state_geometry
from fantoccini.theatre.perform import Balance, LivePlay, Performance

if TYPE_CHECKING:
    import viser


class _Timing(NamedTuple):
    """Times of a live page."""

    max_frame: float = 0.1
    """Largest simulated time per frame [s]: after a longer one the puppet slows down."""
    history: float = 10.0  # Length of the plot [s]
    samples: float = 0.05  # Interval of the plot's samples [s]
    refusals: float = 2.0  # Interval between notices to a viewer who may not move the strings [s]
    pad_speed: float = 0.5
    """Speed of a handle at full deflection of a stick, relative to the puppet's size [1/s]."""


_TIMING = _Timing()
_PANEL_WIDTH = 340.0
"""Width of viser's panel with its margins [px]."""
_FULL_FORCE = 0.25
"""Force with a long arrow, relative to the puppet's weight, which several points carry."""


class Live(PageLoop):
    """Live puppet on a page.

    One thread changes the puppet and the page. Actions of viewers are queued for it, or set targets
    for the puppet's hands.

    Attributes:
        performance: the puppet with hands on its strings.
        nodes: nodes of the drawn scene.
        controls: beads, rings and sliders.
        body_pulls: bodies that viewers pull.
        panel: buttons, sliders, numbers.
        stage: gestures, takes, a score, and their sound.
        pads: gamepads.
        jobs: queued calls between two frames.
        holder: holder of the strings.
        paused: whether the time is paused.
        time_factor: speed of time; below 1 is slow motion.

    Args:
        performance: the puppet.
        theme: colours.
        record_to: folder for recordings.
        file: the puppet's file, which is loaded again when it changes; or None.
        score: file of a score, or None.
        live_play: a play to perform on the page, or None.

    Raises:
        FileError: the score has mistakes.
    """

    def __init__(
        self,
        performance: Performance,
        theme: Theme,
        record_to: Path,
        file: Path | None = None,
        score: Path | None = None,
        live_play: LivePlay | None = None,
    ):
        super().__init__("live")
        self.performance, self.theme = performance, theme
        self.holder = Holder()
        self.paused, self.time_factor = False, 1.0
        self.stage = Stage(performance, record_to, file, score, live_play)
        self._file = None if file is None else WatchedFile(file, load_compiled)
        self.pads, self._midi = pad.Pads(), midi.Midi(self._go)
        self.jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._tension_history: deque[tuple[float, np.ndarray]] = deque()
        self._refused: dict[Viewer, float] = {}
        self._sight: np.ndarray | None = None
        self._viewpoint: Viewpoint = "three-quarter" if live_play is None else AUDIENCE
        self._next_update = {"numbers": 0.0, "marks": 0.0, "sample": 0.0}

    @property
    def handlers(self) -> dict[str, Handler]:
        """Additional websockets of the page."""
        return {
            pad.PATH: self.pads.serve,
            sound.PATH: self.stage.sounds.serve,
            midi.PATH: self._midi.serve,
        }

    @property
    def recorder(self) -> Recorder:
        """Recorder of the performance."""
        return self.stage.recorder

    def open(self, server: Server) -> None:
        """Builds the page."""
        self.server = server
        self.panel = LivePanel(self, server.viser, self.theme)
        self._build()
        self.nodes.aim_camera(server.viser.initial_camera, self._viewpoint)
        server.viser.on_client_connect(self._fit)
        server.viser.on_client_disconnect(lambda client: self.holder.release(client.client_id))

    def _finish(self) -> None:
        self.performance.set_hand_law(None)
        self.stage.finish()

    # -- actions of viewers --------------------------------------------------------------------

    def act(self, viewer: Viewer | None, action: Callable[[], object]) -> bool:
        """Performs an action for a viewer, if permitted; returns whether it was performed."""
        if viewer is not None and not self.holder.claim(viewer):
            self._refuse(viewer)
            return False
        try:
            action()
        except FantocciniError as error:
            self.panel.report(str(error))
            return False
        return True

    def enqueue(self, viewer: Viewer | None, action: Callable[[], None]) -> bool:
        """Queues an action as in :meth:`act` for the loop's thread, between two frames."""
        return self.act(viewer, lambda: self.jobs.put(action))

    def pause(self) -> None:
        """Pauses or resumes the time."""
        self.paused = not self.paused
        self.panel.show_paused(self.paused)

    def step(self) -> None:
        """Pauses, and advances by one frame."""
        if not self.paused:
            self.pause()
        (self.stage.live_play or self.performance).advance(1.0 / REFRESH.rate)

    def reset(self) -> None:
        """Returns to the start."""
        balanced = self.balance is not None
        (self.stage.live_play or self.performance).reset()
        self._tension_history.clear()
        self.set_balance(balanced)

    @property
    def balance(self) -> Balance | None:
        """Controller of the hands while they balance the puppet, or None."""
        law = self.performance.law
        return law if isinstance(law, Balance) else None

    def set_balance(self, balance_on: bool) -> None:
        """Lets the hands balance the puppet at its current place, or follow their targets again."""
        # Shown first, so that a click after the change is not undone.
        self.panel.show_balance(balance_on)
        try:
            self.performance.set_hand_law(
                Balance(self.performance, threaded=True) if balance_on else None
            )
        except Exception:
            self.panel.show_balance(self.balance is not None)
            raise

    def record(self) -> None:
        """Starts a recording, or ends and writes it."""
        self.stage.record()

    def push(self, right: float, up: float, camera: viser.CameraHandle | None = None) -> None:
        """Moves the selected handle in a viewer's picture, in units of the puppet's size."""
        handle = self.controls.handle
        if handle is None:
            return
        size = self.nodes.geometry.size
        displacement = push_displacement(
            handle.axes, self._line_of_sight(camera), right * size, up * size
        )
        position, _ = self.performance.target(handle.name)
        self.performance.move(handle.name, position + displacement)

    def wind(self, change: float) -> None:
        """Winds the string of the selected handle, in units of the puppet's size."""
        if self.controls.selected is not None:
            self.controls.wind(self.controls.selected, change * self.nodes.geometry.size)

    def set_parameters(self, values: dict[str, float]) -> None:
        """Continues with other parameter values."""
        self._report(self.performance.set_parameters(values))

    # -- the loop ------------------------------------------------------------------------------

    def _run(self) -> None:
        last = time.perf_counter()
        while not self._end.is_set():
            self._work(last + 1.0 / REFRESH.rate)
            now = time.perf_counter()
            duration, last = min(now - last, _TIMING.max_frame), now
            self._safely(partial(self._frame, now, duration))

    def _work(self, until: float) -> None:
        """Runs queued jobs until the next frame is due, at least those that wait already."""
        n_waiting = self.jobs.qsize()
        while not self._end.is_set():
            remaining = until - time.perf_counter()
            if remaining <= 0.0 and n_waiting <= 0:  # many jobs must not stop the puppet
                return
            try:
                job = self.jobs.get(timeout=max(remaining, 0.0))
            except queue.Empty:
                return
            n_waiting -= 1
            self._safely(job)

    def _safely(self, action: Callable[[], None]) -> None:
        """Runs something; errors are shown on the page and do not end the loop."""
        try:
            action()
        except FantocciniError as error:
            self.panel.report(str(error))
        except Exception as error:
            self.panel.report(f"internal error: {type(error).__name__}: {error}")

    def _frame(self, now: float, duration: float) -> None:
        self._follow_pads(duration)
        if not self.paused:
            self.body_pulls.update(self._poses())
            (self.stage.live_play or self.performance).advance(duration * self.time_factor)
        self.stage.time_factor = 0.0 if self.paused else self.time_factor
        self.stage.mark_frame()
        scene = self._scene_state()
        self._remember(now, scene)
        with self.server.viser.atomic():
            self.nodes.show(scene)
            self.controls.update(scene.poses)
            if now >= self._next_update["marks"]:
                self._next_update["marks"] = now + REFRESH.marks
                self.controls.mark_lag(self.performance.lagging)
            if now >= self._next_update["numbers"]:
                self._next_update["numbers"] = now + REFRESH.numbers
                self.controls.update_sliders()
                self.panel.update(scene, self.performance.lagging, self._history())
        # Otherwise viser waits for more messages and merges two frames.
        self.server.viser.flush()
        self.recorder.poll()
        self._poll_file(now)

    def _poses(self) -> np.ndarray:
        x = self.performance.state
        return np.asarray(self.performance.marionette.poses(x.q_D, x.q_K))

    def _scene_state(self) -> SceneState:
        p = self.performance
        arrows, contact = None, p.contact if self.panel.forces else None
        if contact is not None:
            long_arrow_force = _FULL_FORCE * (p.marionette.weight or 1.0)
            arrows = force_arrows(contact, long_arrow_force, self.nodes.geometry.size)
        return scene_of_state(p.marionette, p.state, p.tension, arrows)

    def _remember(self, now: float, scene: SceneState) -> None:
        if self.paused or now < self._next_update["sample"] or scene.tension is None:
            return
        self._next_update["sample"] = now + _TIMING.samples
        self._tension_history.append((scene.t, scene.tension))
        while (
            self._tension_history[-1][0] - self._tension_history[0][0] > _TIMING.history
            or self._tension_history[0][0] > scene.t
        ):
            self._tension_history.popleft()

    def _history(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) relative to now [s] and tensions (n_strings, n) [N]."""
        if len(self._tension_history) < 2:
            return np.array([-_TIMING.history, 0.0]), np.zeros((len(self.nodes.geometry.names), 2))
        t = np.array([sample_time for sample_time, _ in self._tension_history])
        return t - t[-1], np.array([tension for _, tension in self._tension_history]).T

    def _viewer(self, device: str) -> Viewer:
        """Viewer that uses a device: with a single client, that client."""
        clients = list(self.server.viser.get_clients())
        return clients[0] if len(clients) == 1 else device

    def _go(self) -> None:
        self.enqueue(self._viewer("midi"), self.stage.go)

    def _follow_pads(self, duration: float) -> None:
        pressed, sticks = self.pads.pressed(), self.pads.sticks
        if not pressed and not sticks.moved:
            return
        viewer = self._viewer(self.pads.name)
        for button, action in (
            (pad.NEXT, lambda: self.controls.select_next(1)),
            (pad.PREVIOUS, lambda: self.controls.select_next(-1)),
            (pad.PAUSE, self.pause),
            (pad.RESET, self.reset),
            (pad.RECORD, self.record),
        ):
            if button in pressed:
                self.act(viewer, action)
        if sticks.moved:
            distance = _TIMING.pad_speed * duration
            self.act(viewer, lambda: self.push(distance * sticks.right, distance * sticks.away))
            self.act(viewer, lambda: self.wind(-distance * sticks.up))

    # -- another puppet ------------------------------------------------------------------------

    def _poll_file(self, now: float) -> None:
        score_mistakes = self.stage.poll(now)
        if score_mistakes is not None:
            self.panel.show_mistakes("score", score_mistakes)
        reloaded = None if self._file is None else self._file.poll(now)
        if reloaded is None:
            return
        self.panel.show_mistakes("puppet", reloaded.mistakes)
        if reloaded.content is None:
            return
        losses = self.stage.replace(reloaded.content)
        if self.stage.score is not None:
            self.panel.show_mistakes("score", ())
        self._tension_history.clear()
        with self.server.viser.atomic():
            self._clear()
            self._build()
        self._report(("the puppet file was loaded again", *losses))

    def _build(self) -> None:
        geometry = self._geometry()
        full_scale = 1.5 * geometry.tension_full_scale()
        self.nodes = SceneNodes(self.server.viser, geometry, self.theme, full_scale)
        self.panel.build(self.nodes)
        self.controls = Controls(
            self.server.viser,
            self.performance,
            self.theme,
            geometry.size,
            self.nodes.view(self._viewpoint),
            self.act,
            lambda: self.panel.drag_winds,
            self.holder.release,
            self.panel.lengths,
        )
        self.body_pulls = BodyPulls(
            self.server.viser,
            self.performance,
            self.nodes,
            self.theme,
            self.act,
            self.holder.release,
        )
        self.panel.set_up(self.controls)
        self.nodes.show(self._scene_state())

    def _clear(self) -> None:
        self.controls.remove()
        self.body_pulls.remove()
        self.panel.clear()
        self.nodes.clear()

    def _geometry(self) -> Geometry:
        p = self.performance
        return state_geometry(p.marionette, p.state, self._typical_tensions())

    def _typical_tensions(self) -> np.ndarray:
        """(n_strings,) typical tensions of the puppet, for the scale [N]."""
        p = self.performance
        tension = np.asarray(p.tension, dtype=float)
        if tension.any():
            return tension
        forces = motion_at(p.marionette, p.state).tension
        return np.asarray(forces)[: len(p.marionette.tree.strings)]

    # -- reports and views ---------------------------------------------------------------------

    def _report(self, messages: tuple[str, ...]) -> None:
        if messages:
            self.panel.report("; ".join(messages))

    def _refuse(self, viewer: Viewer) -> None:
        now = time.monotonic()
        if now - self._refused.get(viewer, -np.inf) < _TIMING.refusals:
            return
        self._refused[viewer] = now
        client = self.server.viser.get_clients().get(viewer)
        if client is not None:
            client.add_notification(
                "Another viewer holds the strings",
                f"{holder_text(self.holder.viewer, viewer)}.",
                auto_close_seconds=3.0,
                color="yellow",
            )

    def _fit(self, client: viser.ClientHandle) -> None:
        """Fits the view into a client's window, when the client has taken the initial view."""
        initial = np.array(self.server.viser.initial_camera.look_at)
        fitted = Event()

        def fit(camera: viser.CameraHandle) -> None:
            # The initial view would replace one that is set earlier.
            if not fitted.is_set() and np.allclose(camera.look_at, initial, atol=1e-3):
                fitted.set()
                self._fit_camera(camera)

        client.camera.on_update(fit)
        fit(client.camera)

    def _fit_camera(self, camera: viser.CameraHandle) -> None:
        """Moves the camera of a narrow window, such as a phone's, farther away.

        In a wide one, the panel must not cover a play's stage.
        """
        if camera.aspect < 1.0:
            self.nodes.aim_camera(camera, self._viewpoint)
        elif self.stage.live_play is not None:
            covered = min(_PANEL_WIDTH / max(camera.image_width, 1), 0.5)
            self.nodes.aim_camera(camera, self._viewpoint, covered)

    def _line_of_sight(self, camera: viser.CameraHandle | None) -> np.ndarray:
        """(3,) line of sight of a camera; without one, of the last camera or the initial view."""
        if camera is not None:
            self._sight = line_of_sight(camera)
        if self._sight is None:
            view = self.nodes.view(self._viewpoint)
            self._sight = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
        return self._sight
