"""The forces of contacts in a viser server: arrows at the points that push."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fantoccini.app.pages.moment import Moment
from fantoccini.output.view import Geometry, Theme, to_bytes

if TYPE_CHECKING:
    import viser


class _Shape(NamedTuple):
    """Sizes of an arrow, relative to the puppet's."""

    shaft: float = 0.003
    head: float = 0.008
    head_length: float = 0.02


_SHAPE = _Shape()


class Forces:
    """Arrows of the forces of contacts, in the colour of those in pictures.

    Attributes:
        node: of viser.

    Args:
        server: of viser.
        geometry: for their size.
        theme: for their colour.
    """

    def __init__(self, server: viser.ViserServer, geometry: Geometry, theme: Theme):
        self._wanted, self._arrows = False, np.zeros((0, 2, 3), dtype=np.float32)
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

    def want(self, wanted: bool) -> None:
        """Shows or hides them."""
        self._wanted = wanted
        self._draw()

    def show(self, moment: Moment) -> None:
        """Draws the forces of a moment."""
        if moment.arrows is not None:
            finite = np.isfinite(moment.arrows).all(axis=(1, 2))
            self._arrows = moment.arrows[finite].astype(np.float32)
            self._draw()

    def _draw(self) -> None:
        shown = self._wanted and len(self._arrows) > 0
        if shown:
            self.node.points = self._arrows
        if self.node.visible != shown:
            self.node.visible = shown
