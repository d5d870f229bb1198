"""Solids and strings rendered by pyvista: smooth shading, strings as tubes.

Background, floor, shadows and captions are those of the matplotlib renderer. pyvista is imported
when the first studio is created; with Mesa's EGL or OSMesa it needs no display.

A depth buffer, unlike a painting order, decides for every pixel what is nearest.
"""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import MissingLibraryError
from fantoccini.model.tree import WORLD
from fantoccini.output.view.compose import Layout, string_lines
from fantoccini.output.view.geometry import Geometry
from fantoccini.output.view.meshes import TriangleMesh, triangulate
from fantoccini.output.view.silhouettes import Solid

if TYPE_CHECKING:
    import pyvista

RENDERERS = ("matplotlib", "pyvista")
"""Renderers of solids and strings."""

_LIGHTS = (((-0.8, 0.9, 0.7), 0.85), ((0.9, 0.2, 0.6), 0.25), ((0.2, -0.7, 0.4), 0.12))
"""Key, fill and floor light: its direction in camera axes (right, up, back), its intensity."""

_OVERSAMPLING = 2
"""Number of rendered pixels along each side of a pixel of the picture."""


def check_renderer(renderer: str) -> str:
    """Returns the renderer, if it is available.

    Raises:
        ValueError: there is no renderer with this name.
        MissingLibraryError: pyvista was chosen and is not installed.
    """
    if renderer not in RENDERERS:
        raise ValueError(f"there is no renderer {renderer!r}; use {' or '.join(RENDERERS)}")
    if renderer == "pyvista":
        _pyvista()
    return renderer


class Studio:
    """Renderer of a geometry.

    Args:
        geometry: geometry to show.
        layout: camera, theme and viewport.
        size: width and height of the sheet that contains the viewport [px].
        scale: pixels of the picture per pixel of the sheet.
    """

    def __init__(
        self, geometry: Geometry, layout: Layout, size: tuple[int, int], scale: float = 1.0
    ):
        self._pv = _pyvista()
        self.geometry, self.layout = geometry, layout
        window = [round(n * scale) * _OVERSAMPLING for n in size]
        self._plotter = self._pv.Plotter(off_screen=True, window_size=window, lighting="none")
        self._plotter.set_background("black")
        for direction, brightness in _LIGHTS:
            light = self._pv.Light(light_type="camera light", intensity=brightness)
            light.position = direction
            self._plotter.add_light(light)
        solids = [*geometry.solids, *layout.handles]
        self._actors = [(solid, self._actor(solid)) for solid in solids]
        self.aim(layout, size)

    def render(self, k: int) -> np.ndarray:
        """(height, width, 4) pixels in [0, 1] of the geometry at ``t[k]``, rows from the top."""
        poses = self.geometry.poses[k]
        for solid, actor in self._actors:
            pose = np.eye(3, 4) if solid.link == WORLD else poses[solid.link]
            actor.visibility = bool(np.isfinite(pose).all())
            if actor.visibility:
                actor.user_matrix = np.vstack([pose, [0.0, 0.0, 0.0, 1.0]])
        self._add_strings(k)
        self._plotter.renderer.ResetCameraClippingRange()
        self._plotter.render()  # otherwise the first screenshot is empty
        rendering = self._plotter.screenshot(transparent_background=True, return_img=True)
        offsets = [slice(k, None, _OVERSAMPLING) for k in range(_OVERSAMPLING)]
        pixels = sum(
            rendering[rows, columns].astype(np.float32) for rows in offsets for columns in offsets
        )
        # Colours at edges are premultiplied by opacity; matplotlib expects straight ones.
        pixels[..., :3] /= np.maximum(pixels[..., 3:], 1.0)
        pixels[..., 3] /= 255.0 * _OVERSAMPLING**2
        return np.minimum(pixels, 1.0, out=pixels)

    def close(self) -> None:
        """Releases the window's memory."""
        self._plotter.close()

    def _actor(self, solid: Solid) -> pyvista.Actor:
        mesh = triangulate(solid)
        surface = self._surface(mesh)
        shading: dict[str, object] = {"color": solid.colour}
        if (colours := solid.most_detailed.colours) is not None:
            surface.cell_data["colour"] = np.round(255.0 * colours).astype(np.uint8)
            shading = {"scalars": "colour", "rgb": True}
        return self._plotter.add_mesh(
            surface,
            **shading,
            smooth_shading=mesh.normals is not None,
            ambient=0.24,
            diffuse=0.90,
            specular=0.45,
            specular_power=28.0,
            render=False,
        )

    def _surface(self, mesh: TriangleMesh) -> pyvista.PolyData:
        surface = self._pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
        if mesh.normals is not None:
            surface.point_data.active_normals = mesh.normals
        return surface

    def _add_strings(self, k: int) -> None:
        """Adds strings and springs as tubes, as wide in the picture as matplotlib's lines."""
        camera, viewport = self.layout.camera, self.layout.viewport
        tubes = self._pv.MultiBlock()
        for line in string_lines(self.geometry, k, self.layout):
            depth = float(camera.to_camera(line.points)[:, 2].mean())
            radius = 0.5 * line.width / camera.scale(depth, viewport)
            tube = self._pv.lines_from_points(line.points).tube(radius=radius, n_sides=8)
            colour = np.round(255.0 * line.colour).astype(np.uint8)
            tube["colour"] = np.tile(colour, (tube.n_points, 1))
            tubes.append(tube)
        if len(tubes):
            self._plotter.add_mesh(
                tubes.combine().extract_surface(algorithm=None),
                name="strings",
                scalars="colour",
                rgb=True,
                ambient=0.75,
                diffuse=0.3,
                smooth_shading=False,
                render=False,
                reset_camera=False,
            )

    def aim(self, layout: Layout, size: tuple[int, int]) -> None:
        """Sets a layout's camera, with its view widened from the viewport to the sheet."""
        self.layout = layout
        source, viewport, (width, height) = self.layout.camera, self.layout.viewport, size
        camera = self._plotter.camera
        camera.position = source.eye
        camera.focal_point = source.eye - source.axes[2]
        camera.up = source.axes[1]
        half_angle = np.arctan(source.tangent * height / viewport.height)
        camera.view_angle = float(np.degrees(2.0 * half_angle))
        camera.SetWindowCenter(
            1.0 - (2.0 * viewport.x + viewport.width) / width,
            1.0 - (2.0 * viewport.y + viewport.height) / height,
        )


def _pyvista() -> ModuleType:
    try:
        import pyvista
        from vtkmodules.vtkCommonCore import vtkLogger
    except ImportError:
        raise MissingLibraryError("renderer='pyvista'", "pyvista", "pyvista") from None
    # Without a display VTK warns before it falls back to off-screen rendering.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    return pyvista
