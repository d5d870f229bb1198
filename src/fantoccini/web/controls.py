"""What a person takes hold of: a bead for every handle, rings for those that turn, sliders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.perform import Handle, Performance
from fantoccini.view.theme import Theme, mix, rgb
from fantoccini.web.drag import follow
from fantoccini.web.holder import Viewer
from fantoccini.web.labels import heights
from fantoccini.web.poses import place
from fantoccini.web.stage import View

if TYPE_CHECKING:
    import viser

_LAG = 0.02
"""A handle that is so far from where it is wanted, of the puppet's size, is said to lag."""
_WARNING = rgb("#d64545")

Act = Callable[[Viewer | None, Callable[[], None]], bool]
"""Does something for a viewer who may; whether it did."""


@dataclass
class _Grab:
    """A bead in a viewer's hand.

    Attributes:
        anchor: (3,) where the bead was taken [m].
        position: (3,) where the handle was wanted then [m].
        length: of the string that ends there, then [m]; None where it cannot be wound.
    """

    anchor: np.ndarray
    position: np.ndarray
    length: float | None


class Controls:
    """Beads, rings and sliders of a performance.

    Attributes:
        selected: name of the handle that keys and gamepad move, or None where there is none.

    Args:
        server: of viser.
        performance: what is moved.
        theme: the look.
        size: of the puppet [m].
        view: where the puppet is looked at from at first.
        act: asks whether a viewer may, and does it.
        winds: whether a bead that is dragged winds its string, without Shift.
        let_go: told that a viewer's hand is off what it dragged.
        folder: where the sliders go.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        performance: Performance,
        theme: Theme,
        size: float,
        view: View,
        act: Act,
        winds: Callable[[], bool],
        let_go: Callable[[Viewer], None],
        folder: Any,
    ):
        self._server, self._performance, self._theme = server, performance, theme
        self._size, self._act, self._winds, self._let_go = size, act, winds, let_go
        self._handles = {handle.name: handle for handle in performance.handles}
        self._beads: dict[str, Any] = {}
        self._labels: dict[str, Any] = {}
        self._rings: dict[str, Any] = {}
        self._turned: dict[str, Viewer] = {}
        self._sliders: dict[str, Any] = {}
        self._shown: dict[str, float] = {}
        self._grabs: dict[tuple[Viewer, str], _Grab] = {}
        self._last = np.full((len(self._handles), 3), np.nan)
        self.selected = next(iter(self._handles), None)
        places = np.array([performance.place(name)[0] for name in self._handles])
        self._above = heights(tuple(self._handles), places, view, size)
        with server.atomic():
            for n, handle in enumerate(performance.handles):
                self._add_handle(n, handle)
            self._add_marks()
            self._show_selected()
            with folder:
                for name, (low, high) in performance.lengths.items():
                    self._add_slider(name, low, high)

    def remove(self) -> None:
        """Takes everything out of the page."""
        for node in (
            *self._beads.values(), *self._labels.values(), *self._rings.values(),
            *self._sliders.values(), self._ghosts, self._leads,
        ):  # fmt: skip
            node.remove()

    def select(self, name: str | None) -> None:
        """Chooses the handle that keys and gamepad move, and whose rings are shown."""
        if name in self._handles:
            self.selected = name
            self._show_selected()

    def select_next(self, by: int) -> None:
        """Chooses another handle."""
        names = list(self._handles)
        if names:
            self.select(names[(names.index(self.selected) + by) % len(names)])

    @property
    def handle(self) -> Handle | None:
        """The handle that is selected."""
        return self._handles.get(self.selected)

    def wind(self, name: str, by: float) -> None:
        """Winds a string in (``by`` < 0) or out; nothing where it cannot be wound [m]."""
        if name in self._performance.lengths:
            self._performance.wind(name, self._performance.wanted_length(name) + by)

    def show_names(self, visible: bool) -> None:
        """Shows or hides the names of the handles."""
        for label in self._labels.values():
            label.visible = visible

    # -- every frame ---------------------------------------------------------------------------

    def update(self, poses: np.ndarray) -> None:
        """Moves beads to where the handles are.

        Args:
            poses: (n_links, 3, 4) of the links.
        """
        places = poses[[handle.link for handle in self._handles.values()], :, 3]
        changed = ~(np.abs(places - self._last).max(axis=1, initial=0.0) < 1e-6)
        for n, name in enumerate(self._handles):
            if changed[n]:
                place(self._beads[name], places[n])
                place(self._labels[name], places[n] + [0.0, 0.0, self._above[n]])
        self._last = places

    def mark(self, lagging: dict[str, str]) -> None:
        """Shows where handles are wanted that are elsewhere, and which of them are held back.

        Args:
            lagging: names of handles and strings that cannot do what is asked, and why.
        """
        behind, leads = [], []
        for (name, handle), here in zip(self._handles.items(), self._last, strict=True):
            wanted, wxyz = self._performance.target(name)
            self._beads[name].color = self._colour(name, name in lagging)
            if len(handle.axes) and np.linalg.norm(wanted - here) > _LAG * self._size:
                behind.append(wanted)
                leads.append((here, wanted))
            ring = self._rings.get(name)
            if ring is not None and name not in self._turned:
                ring.position, ring.wxyz = wanted, wxyz
        self._show_marks(behind, leads)

    def update_sliders(self) -> None:
        """Sets the sliders to the lengths that are wanted, where these are news.

        A viewer may just have moved a slider, and is not overruled by what was wanted before.
        """
        for name, slider in self._sliders.items():
            wanted = round(self._performance.wanted_length(name), 4)
            if abs(self._shown[name] - wanted) > 6e-4:
                slider.value = self._shown[name] = wanted

    # -- inside --------------------------------------------------------------------------------

    def _add_handle(self, n: int, handle: Handle) -> None:
        position, wxyz = self._performance.place(handle.name)
        bead = self._server.scene.add_icosphere(
            f"/handles/{n}", radius=0.017 * self._size, subdivisions=3, position=position,
            color=self._colour(handle.name, False), cast_shadow=False,
        )  # fmt: skip
        bead.on_click(lambda event, name=handle.name: self.select(name))
        if len(handle.axes):
            for modifier in (None, "shift"):
                bead.on_drag("left", modifier=modifier)(self._dragged(handle))
        self._beads[handle.name] = bead
        self._labels[handle.name] = self._server.scene.add_label(
            f"/names/{n}", handle.name, anchor="bottom-center",
            position=position + np.array([0.0, 0.0, self._above[n]]),
        )  # fmt: skip
        if len(handle.turns):
            ring = self._server.scene.add_transform_controls(
                f"/rings/{n}", scale=0.16 * self._size, line_width=2.0,
                disable_axes=not len(handle.axes), disable_sliders=True, depth_test=False,
                opacity=0.75, position=position, wxyz=wxyz,
            )  # fmt: skip
            ring.on_update(self._turned_ring(handle))
            self._rings[handle.name] = ring

    def _add_slider(self, name: str, low: float, high: float) -> None:
        wanted = self._performance.wanted_length(name)
        slider = self._server.gui.add_slider(
            name, round(low, 3), round(high, 3), 0.001, round(wanted, 3), hint="Length [m]"
        )
        self._shown[name] = slider.value

        @slider.on_update
        async def _(event: Any) -> None:
            if event.client_id is None:
                return
            value = slider.value
            if not self._act(event.client_id, lambda: self._performance.wind(name, value)):
                slider.value = round(self._performance.wanted_length(name), 3)

        self._sliders[name] = slider

    def _add_marks(self) -> None:
        none = np.zeros((1, 2, 3))
        scene = self._server.scene
        colour = tuple(round(255.0 * float(c)) for c in _WARNING)
        self._leads = scene.add_line_segments(
            "/lag/leads", none, colour, thickness=1.5, thickness_units="screen", visible=False
        )
        self._ghosts = scene.add_point_cloud(
            "/lag/wanted", np.zeros((1, 3), dtype=np.float32), colour,
            point_size=0.02 * self._size, point_shape="circle", visible=False,
        )  # fmt: skip

    def _show_selected(self) -> None:
        """Rings about one handle at a time, so that they do not lie in one another."""
        for name, ring in self._rings.items():
            ring.visible = name == self.selected
        for name, label in self._labels.items():
            label.font_screen_scale = 1.0 if name == self.selected else 0.85

    def _show_marks(self, behind: list, leads: list) -> None:
        for node in (self._ghosts, self._leads):
            if node.visible != bool(behind):
                node.visible = bool(behind)
        if behind:
            self._ghosts.points = np.array(behind, dtype=np.float32)
            self._leads.points = np.array(leads, dtype=np.float32)

    def _colour(self, name: str, lags: bool) -> tuple[int, int, int]:
        accent = rgb(self._theme.cycle[0])
        colour = mix(self._theme.handle, np.ones(3), 0.15)
        if lags:
            colour = _WARNING
        elif name == self.selected or any(held == name for _, held in list(self._grabs)):
            colour = accent
        return tuple(round(255.0 * float(c)) for c in colour)

    def _dragged(self, handle: Handle) -> Callable:
        name = handle.name

        async def dragged(event: Any) -> None:
            key = (event.client_id, name)
            if event.phase == "end":
                self._grabs.pop(key, None)
                self._let_go(event.client_id)
                return
            grab = self._grabs.get(key)
            if grab is None:
                if not self._act(event.client_id, lambda: self.select(name)):
                    return
                winds = name in self._performance.lengths
                grab = self._grabs[key] = _Grab(
                    np.array(event.start_position), self._performance.target(name)[0],
                    self._performance.wanted_length(name) if winds else None,
                )  # fmt: skip
            camera, mouse = event.client.camera, np.array(event.end_position, dtype=float)
            eye = np.array(camera.position, dtype=float)
            if not np.isfinite([mouse, eye, grab.anchor]).all():
                return
            if grab.length is not None and (event.modifier == "shift" or self._winds()):
                length = grab.length - float((mouse - grab.anchor) @ upwards(camera))
                self._act(event.client_id, lambda: self._performance.wind(name, length))
                return
            by = follow(handle.axes, eye, grab.position, grab.anchor, mouse)
            self._act(event.client_id, lambda: self._performance.move(name, grab.position + by))

        return dragged

    def _turned_ring(self, handle: Handle) -> Callable:
        name = handle.name

        async def turned(event: Any) -> None:
            position, wxyz = np.array(event.target.position), np.array(event.target.wxyz)
            viewer = event.client_id
            done = self._act(viewer, lambda: self._performance.move(name, position, wxyz))
            # While a viewer turns the ring, it is where that viewer sees it.
            if done and event.phase != "end":
                self._turned[name] = viewer
            elif self._turned.get(name) == viewer:
                del self._turned[name]
            if event.phase == "end":
                self._let_go(viewer)

        return turned


def sight(camera: Any) -> np.ndarray:
    """(3,) unit vector of the line of sight of a viewer's camera."""
    ahead = np.asarray(camera.look_at, dtype=float) - np.asarray(camera.position, dtype=float)
    size = float(np.linalg.norm(ahead))
    return ahead / size if size > 1e-9 else np.array([-1.0, 0.0, 0.0])


def upwards(camera: Any) -> np.ndarray:
    """(3,) unit vector that points up in the picture of a viewer's camera."""
    ahead = sight(camera)
    up = np.asarray(camera.up_direction, dtype=float)
    up = up - (up @ ahead) * ahead
    size = float(np.linalg.norm(up))
    return up / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
