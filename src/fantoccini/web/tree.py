"""The tree of a plan in the scene: its nodes as dots, the way that was taken as a line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.view.theme import Theme, rgb

if TYPE_CHECKING:
    import viser

    from fantoccini.planning import PlanResult

_MOST_DOTS = 20_000
_WAY = rgb("#2b6cb0")


@dataclass(frozen=True, eq=False)
class Growth:
    """Where a plan looked, and where it goes.

    Attributes:
        nodes: (n, 3) where a point of the puppet is at the nodes of the tree [m].
        way: (m, 3) where it goes along the plan [m].
    """

    nodes: np.ndarray
    way: np.ndarray

    @classmethod
    def of(cls, plan: PlanResult) -> Growth:
        """The growth of a plan."""
        nodes, way = plan.traces()
        return cls(nodes, way)

    def add_to(self, server: viser.ViserServer, theme: Theme, size: float) -> None:
        """Adds dots and line to the scene.

        Args:
            server: of viser.
            theme: the look.
            size: of the motion [m].
        """
        shown = self.nodes[np.unique(np.linspace(0, len(self.nodes) - 1, _MOST_DOTS).astype(int))]
        colour = tuple(round(255.0 * float(c)) for c in theme.faint)
        server.scene.add_point_cloud(
            "/plan/tree", shown.astype(np.float32), colour, point_size=0.005 * size,
            point_shape="circle",
        )  # fmt: skip
        if len(self.way) > 1:
            server.scene.add_line_segments(
                "/plan/way", np.stack([self.way[:-1], self.way[1:]], axis=1),
                tuple(round(255.0 * float(c)) for c in _WAY), thickness=2.5,
                thickness_units="screen",
            )  # fmt: skip
