"""Forces of contacts on a page: arrows at the contact points.

A contact is a point at which two solids touch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fantoccini.app.pages.scene_state import SceneState
from fantoccini.output.view import Geometry, Theme, to_bytes

if TYPE_CHECKING:
    import viser


class _Shape(NamedTuple):
    """Sizes of an arrow, relative to the puppet's size."""

    shaft: float = 0.003
    head: float = 0.008
    head_length: float = 0.02


_SHAPE = _Shape()


class Forces:
    """Arrows of contact forces, in the same colour as in pictures.

    Attributes:
        node: node of viser.

    Args:
        server: server of viser.
        geometry: geometry, for the size of the arrows.
        theme: theme, for the colour of the arrows.
    """

    def __init__(self, server: viser.ViserServer, geometry: Geometry, theme: Theme):
        self._visible, self._arrows = False, np.zeros((0, 2, 3), dtype=np.float32)
        size = geometry.size
        self.node = server.scene.add_arrows(
            "/forces",
            self._arrows,
            to_bytes(theme.force),
            visible=False,
            shaft_radius=_SHAPE.shaft * size,
            head_radius=_SHAPE.head * size,
            head_length=_SHAPE.head_length * size,
        )

    def set_visible(self, visible: bool) -> None:
        """Shows or hides the arrows."""
        self._visible = visible
        self._draw()

    def show(self, scene: SceneState) -> None:
        """Draws the forces of a state of the scene."""
        if scene.arrows is not None:
            finite = np.isfinite(scene.arrows).all(axis=(1, 2))
            self._arrows = scene.arrows[finite].astype(np.float32)
            self._draw()

    def _draw(self) -> None:
        visible = self._visible and len(self._arrows) > 0
        if visible:
            self.node.points = self._arrows
        if self.node.visible != visible:
            self.node.visible = visible
