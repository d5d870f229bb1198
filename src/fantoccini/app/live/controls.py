"""Controls of a live page: a bead for every handle, rings for handles that turn, sliders.

A handle is a driven string end, or a body on a driven joint, that a hand can hold.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fantoccini.app.live.drag import drag_displacement
from fantoccini.app.live.holder import Viewer
from fantoccini.app.pages import View, handle_label_heights, move_node
from fantoccini.output.view import Theme, mix_colours, rgb, to_bytes
from fantoccini.theatre.perform import Handle, Performance

if TYPE_CHECKING:
    import viser


class _Thresholds(NamedTuple):
    """Thresholds for changes on the page."""

    lag: float = 0.02
    """Distance from the target above which a handle is marked, relative to the puppet's size."""
    position: float = 1e-6  # Smallest motion of a bead that is sent [m]
    length: float = 6e-4
    """Smallest change of a length that moves its slider, just over half its step [m]."""


_THRESHOLDS = _Thresholds()

WARNING_COLOUR = rgb("#d64545")
"""Colour of handles that lag behind their targets."""

RunAction = Callable[[Viewer | None, Callable[[], object]], bool]
"""Performs an action for a viewer, if permitted; returns whether it was performed."""

DragHandler = Callable[[Any], Coroutine[Any, Any, None]]


@dataclass
class _Grab:
    """A viewer's grip on a bead.

    Attributes:
        anchor: (3,) point at which the bead was grabbed [m].
        position: (3,) target of the handle at that time [m].
        length: length of the handle's string at that time [m]; None if it cannot be wound.
    """

    anchor: np.ndarray
    position: np.ndarray
    length: float | None


class Controls:
    """Beads, rings and sliders of a performance.

    Attributes:
        selected: name of the handle that keys and gamepad move, or None where there is none.
        labels, rings: labels and rings by handle.
        sliders: sliders by string.
        grabs: viewer and handle -> grip on its bead.
        turning_viewers: handle -> viewer who turns it.

    Args:
        server: server of viser.
        performance: performance to control.
        theme: colours.
        size: size of the puppet [m].
        view: initial point of view.
        act: performs an action for a viewer, if permitted.
        drag_winds: returns whether dragging a bead winds its string even without Shift.
        release: called when a viewer releases a control.
        folder: folder for the sliders.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        performance: Performance,
        theme: Theme,
        size: float,
        view: View,
        act: RunAction,
        drag_winds: Callable[[], bool],
        release: Callable[[Viewer], None],
        folder: viser.GuiFolderHandle,
    ):
        self._server, self._performance, self._theme = server, performance, theme
        self._size, self._act, self._drag_winds, self._release = size, act, drag_winds, release
        self._handles = {handle.name: handle for handle in performance.handles}
        self._beads: dict[str, viser.IcosphereHandle] = {}
        self.labels: dict[str, viser.LabelHandle] = {}
        self.rings: dict[str, viser.TransformControlsHandle] = {}
        self.turning_viewers: dict[str, Viewer] = {}
        self.sliders: dict[str, viser.GuiSliderHandle[float]] = {}
        self._shown_lengths: dict[str, float] = {}
        self.grabs: dict[tuple[Viewer, str], _Grab] = {}
        self._shown_positions = np.full((len(self._handles), 3), np.nan)
        self.selected: str | None = next(iter(self._handles), None)
        positions = np.array([performance.place(name)[0] for name in self._handles])
        self._label_heights = handle_label_heights(tuple(self._handles), positions, view, size)
        with server.atomic():
            for n, handle in enumerate(performance.handles):
                self._add_handle(n, handle)
            self._add_marks()
            self._show_selected()
            with folder:
                for name, (low, high) in performance.lengths.items():
                    self._add_slider(name, low, high)

    def remove(self) -> None:
        """Removes everything from the page."""
        for node in (
            *self._beads.values(),
            *self.labels.values(),
            *self.rings.values(),
            *self.sliders.values(),
            self._target_dots,
            self._lag_lines,
        ):
            node.remove()

    def select(self, name: str | None) -> None:
        """Selects the handle that keys and gamepad move, and whose rings are shown."""
        if name in self._handles:
            self.selected = name
            self._show_selected()

    def select_next(self, step: int) -> None:
        """Selects another handle."""
        names = list(self._handles)
        if self.selected is not None:
            self.select(names[(names.index(self.selected) + step) % len(names)])

    @property
    def handle(self) -> Handle | None:
        """The selected handle."""
        return None if self.selected is None else self._handles[self.selected]

    def wind(self, name: str, change: float) -> None:
        """Winds a string in (``change`` < 0) or out [m], if it can be wound."""
        if name in self._performance.lengths:
            self._performance.wind(name, self._performance.target_length(name) + change)

    def show_names(self, visible: bool) -> None:
        """Shows or hides the names of the handles."""
        for label in self.labels.values():
            label.visible = visible

    # -- every frame ---------------------------------------------------------------------------

    def update(self, poses: np.ndarray) -> None:
        """Moves beads to their handles, by link poses (n_links, 3, 4)."""
        positions = poses[[handle.link for handle in self._handles.values()], :, 3]
        changed = ~(
            np.abs(positions - self._shown_positions).max(axis=1, initial=0.0)
            < _THRESHOLDS.position
        )
        for n, name in enumerate(self._handles):
            if changed[n]:
                move_node(self._beads[name], positions[n])
                move_node(self.labels[name], positions[n] + [0.0, 0.0, self._label_heights[n]])
        self._shown_positions = positions

    def mark_lag(self, lagging: dict[str, str]) -> None:
        """Marks targets that handles have not reached, and handles that cannot follow.

        Args:
            lagging: handles and strings that cannot follow -> reason.
        """
        targets: list[np.ndarray] = []
        lag_lines: list[tuple[np.ndarray, np.ndarray]] = []
        for (name, handle), position in zip(
            self._handles.items(), self._shown_positions, strict=True
        ):
            target, wxyz = self._performance.aim(name)
            self._beads[name].color = self._colour(name, name in lagging)
            if (
                len(handle.axes)
                and np.linalg.norm(target - position) > _THRESHOLDS.lag * self._size
            ):
                targets.append(target)
                lag_lines.append((position, target))
            ring = self.rings.get(name)
            if ring is not None and name not in self.turning_viewers:
                ring.position, ring.wxyz = target, wxyz
        self._show_marks(targets, lag_lines)

    def update_sliders(self) -> None:
        """Sets the sliders of target lengths that have changed.

        Others stay: a viewer may just have moved them.
        """
        for name, slider in self.sliders.items():
            length = round(self._performance.target_length(name), 4)
            if abs(self._shown_lengths[name] - length) > _THRESHOLDS.length:
                slider.value = self._shown_lengths[name] = length

    # -- nodes --------------------------------------------------------------------------------

    def _add_handle(self, n: int, handle: Handle) -> None:
        position, wxyz = self._performance.place(handle.name)
        bead = self._server.scene.add_icosphere(
            f"/handles/{n}",
            radius=0.017 * self._size,
            subdivisions=3,
            position=position,
            color=self._colour(handle.name, False),
            cast_shadow=False,
        )
        bead.on_click(lambda event, name=handle.name: self.select(name))
        if len(handle.axes):
            for modifier in (None, "shift"):
                bead.on_drag("left", modifier=modifier)(self._drag_handler(handle))
        self._beads[handle.name] = bead
        self.labels[handle.name] = self._server.scene.add_label(
            f"/names/{n}",
            handle.name,
            anchor="bottom-center",
            position=position + np.array([0.0, 0.0, self._label_heights[n]]),
        )
        if len(handle.turn_axes):
            ring = self._server.scene.add_transform_controls(
                f"/rings/{n}",
                scale=0.16 * self._size,
                line_width=2.0,
                disable_axes=not len(handle.axes),
                disable_sliders=True,
                depth_test=False,
                opacity=0.75,
                position=position,
                wxyz=wxyz,
            )
            ring.on_update(self._ring_handler(handle))
            self.rings[handle.name] = ring

    def _add_slider(self, name: str, low: float, high: float) -> None:
        length = self._performance.target_length(name)
        slider = self._server.gui.add_slider(
            name, round(low, 3), round(high, 3), 0.001, round(length, 3), hint="Length [m]"
        )
        self._shown_lengths[name] = slider.value

        async def handle_slider(event: Any) -> None:
            if event.client_id is None:
                return
            value = slider.value
            if not self._act(event.client_id, lambda: self._performance.wind(name, value)):
                slider.value = round(self._performance.target_length(name), 3)

        slider.on_update(handle_slider)
        self.sliders[name] = slider

    def _add_marks(self) -> None:
        zero = np.zeros((1, 2, 3))
        api = self._server.scene
        colour = to_bytes(WARNING_COLOUR)
        self._lag_lines = api.add_line_segments(
            "/lag/leads", zero, colour, thickness=1.5, thickness_units="screen", visible=False
        )
        self._target_dots = api.add_point_cloud(
            "/lag/wanted",
            np.zeros((1, 3), dtype=np.float32),
            colour,
            point_size=0.02 * self._size,
            point_shape="circle",
            visible=False,
        )

    def _show_selected(self) -> None:
        """Shows the rings of the selected handle only: those of several would overlap."""
        for name, ring in self.rings.items():
            ring.visible = name == self.selected
        for name, label in self.labels.items():
            label.font_screen_scale = 1.0 if name == self.selected else 0.85

    def _show_marks(
        self, targets: list[np.ndarray], lag_lines: list[tuple[np.ndarray, np.ndarray]]
    ) -> None:
        for node in (self._target_dots, self._lag_lines):
            if node.visible != bool(targets):
                node.visible = bool(targets)
        if targets:
            self._target_dots.points = np.array(targets, dtype=np.float32)
            self._lag_lines.points = np.array(lag_lines, dtype=np.float32)

    def _colour(self, name: str, lags: bool) -> tuple[int, int, int]:
        if lags:
            return to_bytes(WARNING_COLOUR)
        if name == self.selected or any(grabbed == name for _, grabbed in list(self.grabs)):
            return to_bytes(rgb(self._theme.line_colours[0]))
        return to_bytes(mix_colours(self._theme.handle, np.ones(3), 0.15))

    def _drag_handler(self, handle: Handle) -> DragHandler:
        name = handle.name

        async def handle_drag(event: Any) -> None:
            key = (event.client_id, name)
            if event.phase == "end":
                self.grabs.pop(key, None)
                self._release(event.client_id)
                return
            grab = self.grabs.get(key)
            if grab is None:
                if not self._act(event.client_id, lambda: self.select(name)):
                    return
                can_wind = name in self._performance.lengths
                grab = self.grabs[key] = _Grab(
                    np.array(event.start_position),
                    self._performance.target(name)[0],
                    self._performance.target_length(name) if can_wind else None,
                )
            camera, mouse = event.client.camera, np.array(event.end_position, dtype=float)
            eye = np.array(camera.position, dtype=float)
            if not np.isfinite([mouse, eye, grab.anchor]).all():
                return
            if grab.length is not None and (event.modifier == "shift" or self._drag_winds()):
                length = grab.length - float((mouse - grab.anchor) @ up_direction(camera))
                self._act(event.client_id, lambda: self._performance.wind(name, length))
                return
            displacement = drag_displacement(handle.axes, eye, grab.position, grab.anchor, mouse)
            self._act(
                event.client_id, lambda: self._performance.move(name, grab.position + displacement)
            )

        return handle_drag

    def _ring_handler(self, handle: Handle) -> DragHandler:
        name = handle.name

        async def handle_ring(event: Any) -> None:
            position, wxyz = np.array(event.target.position), np.array(event.target.wxyz)
            viewer = event.client_id
            moved = self._act(viewer, lambda: self._performance.move(name, position, wxyz))
            # While a viewer turns the ring, nothing else moves it.
            if moved and event.phase != "end":
                self.turning_viewers[name] = viewer
            elif self.turning_viewers.get(name) == viewer:
                del self.turning_viewers[name]
            if event.phase == "end":
                self._release(viewer)

        return handle_ring


def line_of_sight(camera: viser.CameraHandle) -> np.ndarray:
    """(3,) unit vector along the line of sight of a viewer's camera."""
    direction = np.asarray(camera.look_at, dtype=float) - np.asarray(camera.position, dtype=float)
    size = float(np.linalg.norm(direction))
    return direction / size if size > 1e-9 else np.array([-1.0, 0.0, 0.0])


def up_direction(camera: viser.CameraHandle) -> np.ndarray:
    """(3,) unit vector that points up in the picture of a viewer's camera."""
    direction = line_of_sight(camera)
    up = np.asarray(camera.up_direction, dtype=float)
    up = up - (up @ direction) * direction
    size = float(np.linalg.norm(up))
    return up / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
