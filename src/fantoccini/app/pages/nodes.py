"""Nodes of a geometry on a page: built once, then moved for every state of the scene.

A geometry contains the shapes, strings and marks of a scene; a node is an object that viser draws.
A link is a body on its joint. A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fantoccini.app.pages.forces import Forces
from fantoccini.app.pages.scene_state import SceneState
from fantoccini.app.pages.strings import Colours, Strings
from fantoccini.app.pages.viser_private import move_node
from fantoccini.base import rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.view import (
    Camera,
    Geometry,
    Solid,
    Theme,
    TriangleMesh,
    coloured_surfaces,
    fit_camera,
    handle_solids,
    mix_colours,
    point_of_view,
    round_down,
    to_bytes,
)

if TYPE_CHECKING:
    import viser

VIEWS = ("front", "side", "three-quarter", "top")
"""Points of view that have buttons on the page."""

Viewpoint: TypeAlias = str | tuple[float, float]
"""One of :data:`VIEWS`, or azimuth and elevation [deg]."""

_FIELD_OF_VIEW = np.radians(30.0)
"""Vertical field of view of the camera [rad]."""
_ASPECT = 1.25
"""Ratio of width to height that the puppet must fit: the panel covers the rest of wider windows."""
_ELEVATIONS = {"three-quarter": 22.0, "top": 78.0}
"""Elevations of views that show hands moving in a horizontal plane [deg]."""
_MIN_CHANGE = 1e-7
"""Change of a number of a link's pose above which the link is moved on the page [m or 1]."""


@dataclass(frozen=True)
class View:
    """Point of view.

    Attributes:
        eye: (3,) position of the eye [m].
        target: (3,) point in the middle of the picture [m].
    """

    eye: np.ndarray
    target: np.ndarray


class SceneNodes:
    """Nodes of viser that show a geometry on a page.

    Attributes:
        bodies: meshes of the links that have shapes, by index.
        forces: arrows of contact forces.

    Args:
        server: server of viser.
        geometry: puppet, strings, floor, obstacles.
        theme: colours.
        full_scale: upper end of the tension scale [N]; by default from the motion.
        rounding_step: step to which positions are rounded, for smaller files [m]; 0 for none.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        geometry: Geometry,
        theme: Theme,
        full_scale: float | None = None,
        rounding_step: float = 0.0,
    ):
        self.server, self.geometry, self.theme = server, geometry, theme
        self.colours = Colours(
            geometry, theme, geometry.tension_full_scale() if full_scale is None else full_scale
        )
        self._rounding_step = rounding_step
        self._nodes: list[viser.SceneNodeHandle] = []
        self._links: dict[int, viser.FrameHandle] = {}
        self.bodies: dict[int, list[viser.MeshHandle]] = {}
        with server.atomic():
            self._set_up_world()
            self._set_up_links()
            self._strings = Strings(server, geometry, theme, self.colours, rounding_step)
            self._nodes += self._strings.nodes
            self.forces = Forces(server, geometry, theme)
            self._nodes.append(self.forces.node)
        self._shown_poses = np.full((len(geometry.tree.links), 7), np.nan)

    def show(self, scene: SceneState) -> None:
        """Shows a state of the scene, in one bundle of messages."""
        with self.server.atomic():
            self._move_links(scene.poses)
            self._strings.show(scene)
            self.forces.show(scene)

    def show_floor(self, visible: bool) -> None:
        """Shows or hides the floor."""
        self._floor.visible = visible

    def show_shadows(self, visible: bool) -> None:
        """Shows or hides shadows, which are slow without a graphics card."""
        self.server.scene.configure_default_lights(cast_shadow=visible)

    def show_obstacles(self, visible: bool) -> None:
        """Shows or hides obstacles."""
        for node in self._obstacles:
            node.visible = visible

    def show_forces(self, visible: bool) -> None:
        """Shows or hides the forces of contacts."""
        self.forces.set_visible(visible)

    @property
    def has_obstacles(self) -> bool:
        """Whether the world has obstacles."""
        return bool(self._obstacles)

    def clear(self) -> None:
        """Removes everything from the page."""
        with self.server.atomic():
            # Children first: viser removes them with their parents.
            for node in reversed(self._nodes):
                node.remove()

    def view(self, viewpoint: Viewpoint, aspect: float = _ASPECT) -> View:
        """Point of view with the whole motion in the window."""
        geometry = self.geometry
        centres, radii = geometry.with_shadows(*geometry.balls())
        preset = "front" if viewpoint == "top" else viewpoint
        azimuth, elevation = point_of_view(preset, centres, geometry.plane)
        if isinstance(viewpoint, str) and viewpoint in _ELEVATIONS:
            elevation = np.radians(_ELEVATIONS[viewpoint])
        camera = fit_camera(centres, radii, azimuth, elevation, aspect, _FIELD_OF_VIEW, margin=0.09)
        return View(camera.eye, _target(camera, 0.5 * (centres.min(axis=0) + centres.max(axis=0))))

    def aim_camera(
        self,
        camera: viser.CameraHandle | viser.InitialCameraConfig,
        viewpoint: Viewpoint,
        covered: float = 0.0,
    ) -> None:
        """Points a camera of viser as in a view.

        Args:
            camera: camera of a client, or the initial one.
            viewpoint: see :meth:`view`.
            covered: share of the window's width that the panel covers, at the right.
        """
        aspect = getattr(camera, "aspect", _ASPECT)
        free_aspect = aspect * (1.0 - covered)
        view = self.view(viewpoint, min(free_aspect, _ASPECT) if free_aspect > 0.0 else _ASPECT)
        sight = view.target - view.eye
        right = np.cross(sight, [0.0, 0.0, 1.0])  # as long as the sight if that is level
        shift = covered * aspect * np.tan(0.5 * _FIELD_OF_VIEW) * right
        camera.position, camera.look_at = view.eye + shift, view.target + shift
        camera.fov = float(_FIELD_OF_VIEW)

    # -- built once ----------------------------------------------------------------------------

    def _set_up_world(self) -> None:
        geometry, theme, api = self.geometry, self.theme, self.server.scene
        api.set_up_direction("+z")
        api.world_axes.visible = False
        api.set_background_image(_sky(theme), format="png")
        low, high = geometry.ground_box()
        extent = 1.6 * float((high - low).max()) + 1.6 * geometry.size
        cell_size = round_down(0.12 * geometry.size)
        centre = np.round(0.5 * (low + high) / cell_size) * cell_size
        floor_colour = mix_colours(theme.lower_background, theme.floor[:3], float(theme.floor[3]))
        self._floor = api.add_grid(
            "/floor",
            width=6.0 * extent,
            height=6.0 * extent,
            plane="xy",
            position=(float(centre[0]), float(centre[1]), geometry.floor),
            cell_size=cell_size,
            section_size=5.0 * cell_size,
            cell_color=to_bytes(mix_colours(floor_colour, theme.grid, 0.55)),
            section_color=to_bytes(theme.grid),
            cell_thickness=0.6,
            section_thickness=1.0,
            fade_distance=2.6 * extent,
            fade_strength=1.0,
            fade_from="camera",
            plane_color=to_bytes(floor_colour),
            plane_opacity=1.0,
            shadow_opacity=0.45 if theme.name == "light" else 0.6,
        )
        self._nodes.append(self._floor)
        obstacles = [s for s in geometry.solids if s.link == WORLD]
        self._obstacles = self._meshes("/obstacles", obstacles)

    def _set_up_links(self) -> None:
        geometry = self.geometry
        solids = [*geometry.solids, *handle_solids(geometry.tree, self.theme, geometry.size)]
        self._meshes("/hooks", [s for s in solids[len(geometry.solids) :] if s.link == WORLD])
        for k, link in enumerate(geometry.tree.links):
            solids_of_link = [s for s in solids if s.link == k]
            if not solids_of_link:
                continue
            name = f"/puppet/{link.name}"
            self._links[k] = self.server.scene.add_frame(name, show_axes=False)
            self._nodes.append(self._links[k])
            self.bodies[k] = self._meshes(name, solids_of_link)

    def _meshes(self, name: str, solids: list[Solid]) -> list[viser.MeshHandle]:
        """Adds a mesh for each colour and kind of shading."""
        groups: dict[tuple[tuple[int, int, int], bool], list[TriangleMesh]] = {}
        for solid in solids:
            flat = solid.kind == "faces" and not solid.smooth
            for shade, surface in coloured_surfaces(solid):
                groups.setdefault((to_bytes(shade), flat), []).append(surface)
        nodes = []
        for n, ((colour, flat), surfaces) in enumerate(groups.items()):
            first_vertices = np.cumsum([0, *(len(p.vertices) for p in surfaces)])[:-1]
            vertices = np.concatenate([p.vertices for p in surfaces]).astype(np.float32)
            faces = np.concatenate(
                [p.faces + first for p, first in zip(surfaces, first_vertices, strict=True)]
            )
            nodes.append(
                self.server.scene.add_mesh_simple(
                    f"{name}/{n}",
                    vertices,
                    faces.astype(np.uint32),
                    color=colour,
                    flat_shading=flat,
                    side="front",
                )
            )
        self._nodes += nodes
        return nodes

    # -- moved for every state -----------------------------------------------------------------

    def _move_links(self, poses: np.ndarray) -> None:
        values = np.concatenate([rotation.quaternion(poses[:, :, :3]), poses[:, :, 3]], axis=1)
        if self._rounding_step:
            values[:, :4] = np.round(values[:, :4], 4)
            values[:, 4:] = np.round(values[:, 4:] / self._rounding_step) * self._rounding_step
        changed = ~(np.abs(values - self._shown_poses).max(axis=1) <= _MIN_CHANGE)
        for k, node in self._links.items():
            if changed[k] and np.isfinite(values[k]).all():
                move_node(node, values[k, 4:], values[k, :4])
        self._shown_poses = values


def _target(camera: Camera, middle: np.ndarray) -> np.ndarray:
    """Point on the line of sight about which the camera turns."""
    direction = -camera.axes[2]
    return camera.eye + direction * float((middle - camera.eye) @ direction)


def _sky(theme: Theme) -> np.ndarray:
    """(256, 2, 3) pixels of the background, from 0 to 255."""
    share = np.linspace(0.0, 1.0, 256)[:, None, None]
    rows = mix_colours(theme.upper_background, theme.lower_background, share)
    return np.round(255.0 * np.tile(rows, (1, 2, 1))).astype(np.uint8)
