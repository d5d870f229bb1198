"""A scene in a viser server: built once, then moved with a few numbers for each moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.tree import WORLD
from fantoccini.view.camera import Camera, fit, point_of_view
from fantoccini.view.meshes import triangles
from fantoccini.view.scene import Scene
from fantoccini.view.shapes import handles
from fantoccini.view.silhouettes import Solid
from fantoccini.view.theme import Theme, mix
from fantoccini.web.moment import Moment
from fantoccini.web.poses import place
from fantoccini.web.strings import Colours, Strings

if TYPE_CHECKING:
    import viser

VIEWS = ("front", "side", "three-quarter", "top")
"""Points of view that a page has buttons for."""

_OPENING = np.radians(30.0)
_ASPECT = 1.25
"""Width over height that a whole puppet is to fit into; in wider windows there is the panel."""
_ELEVATIONS = {"three-quarter": 22.0, "top": 78.0}
"""Elevations of views from which hands are seen that move in a level plane [deg]."""


@dataclass(frozen=True)
class View:
    """A place to look from.

    Attributes:
        eye: (3,) [m].
        target: (3,) [m].
    """

    eye: np.ndarray
    target: np.ndarray


class Stage:
    """What a page shows of a scene.

    Args:
        server: of viser.
        scene: puppet, strings, floor, obstacles.
        theme: the look.
        top: upper end of the tension scale [N]; by default from the motion.
        quantum: places are rounded to this [m]; files are smaller for it. 0 leaves them alone.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        scene: Scene,
        theme: Theme,
        top: float | None = None,
        quantum: float = 0.0,
    ):
        self.server, self.scene, self.theme = server, scene, theme
        self.colours = Colours(scene, theme, scene.tension_top() if top is None else top)
        self._quantum = quantum
        self._nodes: list[Any] = []
        self._links: dict[int, Any] = {}
        with server.atomic():
            self._set_up_world()
            self._set_up_links()
            self._strings = Strings(server, scene, theme, self.colours, quantum)
            self._nodes += self._strings.nodes
        self._last = np.full((len(scene.tree.links), 7), np.nan)

    def show(self, moment: Moment) -> None:
        """Moves everything to where it is at a moment; one bundle of messages."""
        with self.server.atomic():
            self._move_links(moment.poses)
            self._strings.show(moment)

    def show_floor(self, visible: bool) -> None:
        """Shows or hides the floor."""
        self._floor.visible = visible

    def show_shadows(self, visible: bool) -> None:
        """Shows or hides shadows; without a graphics card they cost most of a frame."""
        self.server.scene.configure_default_lights(cast_shadow=visible)

    def show_obstacles(self, visible: bool) -> None:
        """Shows or hides what stands in the world."""
        for node in self._obstacles:
            node.visible = visible

    @property
    def has_obstacles(self) -> bool:
        """Whether anything stands in the world."""
        return bool(self._obstacles)

    def clear(self) -> None:
        """Takes everything out of the page."""
        with self.server.atomic():
            # Children go first: viser removes them with their parents.
            for node in reversed(self._nodes):
                node.remove()

    def view(self, name: str, aspect: float = _ASPECT) -> View:
        """The point of view of this name that has the whole motion in the window.

        Args:
            name: one of :data:`VIEWS`.
            aspect: width over height of the window.
        """
        scene = self.scene
        centres, radii = scene.balls()
        centres = np.concatenate([centres, self._feet(centres)])
        radii = np.concatenate([radii, np.zeros(len(centres) - len(radii))])
        preset = "front" if name == "top" else name
        azimuth, elevation = point_of_view(preset, centres, scene.plane)
        elevation = np.radians(_ELEVATIONS[name]) if name in _ELEVATIONS else elevation
        camera = fit(centres, radii, azimuth, elevation, aspect, _OPENING, margin=0.09)
        return View(camera.eye, _target(camera, 0.5 * (centres.min(axis=0) + centres.max(axis=0))))

    def look(self, camera: Any, name: str) -> None:
        """Points a camera of viser (a client's, or the initial one) from a preset."""
        aspect = getattr(camera, "aspect", _ASPECT)
        view = self.view(name, min(aspect, _ASPECT) if aspect > 0.0 else _ASPECT)
        camera.position, camera.look_at = view.eye, view.target
        camera.fov = float(_OPENING)

    # -- built once ----------------------------------------------------------------------------

    def _set_up_world(self) -> None:
        scene, theme, api = self.scene, self.theme, self.server.scene
        api.set_up_direction("+z")
        api.world_axes.visible = False
        api.set_background_image(_sky(theme), format="png")
        low, high = np.percentile(scene.balls()[0][:, :2], [2.0, 98.0], axis=0)
        reach = 1.6 * float((high - low).max()) + 1.6 * scene.size
        cell = _round_number(0.12 * scene.size)
        middle = np.round(0.5 * (low + high) / cell) * cell
        plane = mix(theme.bottom, theme.floor[:3], float(theme.floor[3]))
        self._floor = self._kept(
            api.add_grid(
                "/floor", width=6.0 * reach, height=6.0 * reach, plane="xy",
                position=(float(middle[0]), float(middle[1]), scene.floor),
                cell_size=cell, section_size=5.0 * cell,
                cell_color=_byte(mix(plane, theme.grid, 0.55)), section_color=_byte(theme.grid),
                cell_thickness=0.6, section_thickness=1.0, fade_distance=2.6 * reach,
                fade_strength=1.0, fade_from="camera", plane_color=_byte(plane),
                plane_opacity=1.0, shadow_opacity=0.45 if theme.name == "light" else 0.6,
            )
        )  # fmt: skip
        obstacles = [s for s in scene.solids if s.link == WORLD]
        self._obstacles = self._meshes("/obstacles", obstacles)

    def _set_up_links(self) -> None:
        scene = self.scene
        solids = [*scene.solids, *handles(scene.tree, self.theme, scene.size)]
        self._meshes("/hooks", [s for s in solids[len(scene.solids) :] if s.link == WORLD])
        for k, link in enumerate(scene.tree.links):
            carried = [s for s in solids if s.link == k]
            if not carried:
                continue
            name = f"/puppet/{link.name}"
            frame = self.server.scene.add_frame(name, show_axes=False)
            self._links[k] = self._kept(frame)
            self._meshes(name, carried)

    def _meshes(self, name: str, solids: list[Solid]) -> list[Any]:
        """One mesh for each colour and kind of shading of the solids of a link."""
        groups: dict[tuple, list[Solid]] = {}
        for solid in solids:
            sharp = solid.kind == "faces" and not solid.smooth
            groups.setdefault((*_byte(solid.colour), sharp), []).append(solid)
        nodes = []
        for n, ((*colour, sharp), same) in enumerate(groups.items()):
            parts = [triangles(solid) for solid in same]
            starts = np.cumsum([0, *(len(p.vertices) for p in parts)])[:-1]
            vertices = np.concatenate([p.vertices for p in parts]).astype(np.float32)
            faces = np.concatenate([p.faces + at for p, at in zip(parts, starts, strict=True)])
            nodes.append(
                self.server.scene.add_mesh_simple(
                    f"{name}/{n}", vertices, faces.astype(np.uint32), color=tuple(colour),
                    flat_shading=sharp, side="front",
                )
            )  # fmt: skip
        self._nodes += nodes
        return nodes

    def _kept(self, node: Any) -> Any:
        self._nodes.append(node)
        return node

    # -- moved every time ----------------------------------------------------------------------

    def _move_links(self, poses: np.ndarray) -> None:
        turned = Rotation.from_matrix(poses[:, :, :3]).as_quat(canonical=True)
        rows = np.concatenate([turned[:, [3, 0, 1, 2]], poses[:, :, 3]], axis=1)
        if self._quantum:
            rows[:, :4] = np.round(rows[:, :4], 4)
            rows[:, 4:] = np.round(rows[:, 4:] / self._quantum) * self._quantum
        changed = ~(np.abs(rows - self._last).max(axis=1) <= 1e-7)
        for k, node in self._links.items():
            if changed[k] and np.isfinite(rows[k]).all():
                place(node, rows[k, 4:], rows[k, :4])
        self._last = rows

    def _feet(self, centres: np.ndarray) -> np.ndarray:
        low = centres[:, 2] - self.scene.floor
        near = (low > 0.0) & (low < 0.25 * self.scene.size)
        return np.column_stack([centres[near, :2], np.full(near.sum(), self.scene.floor)])


def _target(camera: Camera, middle: np.ndarray) -> np.ndarray:
    """The point on the line of sight that the camera turns about."""
    ahead = -camera.axes[2]
    return camera.eye + ahead * float((middle - camera.eye) @ ahead)


def _sky(theme: Theme) -> np.ndarray:
    """(256, 2, 3) picture of the background, in 0 to 255."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    rows = mix(theme.top, theme.bottom, share)
    return np.round(255.0 * np.tile(rows, (1, 2, 1))).astype(np.uint8)


def _byte(colour: np.ndarray) -> tuple[int, int, int]:
    return tuple(round(255.0 * float(c)) for c in colour[:3])


def _round_number(x: float) -> float:
    unit = 10.0 ** np.floor(np.log10(x))
    return float(unit * max(f for f in (1.0, 2.0, 5.0) if f * unit <= x * (1.0 + 1e-9)))
