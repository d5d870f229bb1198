"""Search tree of a plan on a page: nodes as dots, the path as a line.

A node of the tree is a state that the search has reached.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view import MAX_DOTS, PATH_COLOUR, Theme, spread_indices, to_bytes

if TYPE_CHECKING:
    import viser

    from fantoccini.control.planning import PlanResult


@dataclass(frozen=True, eq=False)
class PlanTree:
    """Positions of a point of the puppet in a search tree.

    Attributes:
        nodes: (n, 3) positions at the nodes of the tree [m].
        path: (m, 3) positions along the plan [m].
    """

    nodes: np.ndarray
    path: np.ndarray

    @classmethod
    def from_plan(cls, plan: PlanResult) -> PlanTree:
        """The tree of a plan."""
        nodes, path = plan.traces()
        return cls(nodes, path)

    def add_to(self, server: viser.ViserServer, theme: Theme, size: float) -> None:
        """Adds dots and line to a page; ``size`` is that of the geometry [m]."""
        dots = self.nodes[spread_indices(len(self.nodes), MAX_DOTS)].astype(np.float32)
        server.scene.add_point_cloud(
            "/plan/tree", dots, to_bytes(theme.muted), point_size=0.005 * size, point_shape="circle"
        )
        if len(self.path) > 1:
            server.scene.add_line_segments(
                "/plan/way",
                np.stack([self.path[:-1], self.path[1:]], axis=1),
                to_bytes(PATH_COLOUR),
                thickness=2.5,
                thickness_units="screen",
            )
