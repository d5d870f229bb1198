"""Forces of viewers on bodies: a rubber band between the body and the mouse.

F = k (mouse - point),  |F| <= F_max

k is the stiffness of the rubber band, F_max its largest force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fantoccini.app.live.holder import Viewer
from fantoccini.app.pages import SceneNodes
from fantoccini.base import FantocciniError
from fantoccini.model.tree import Role
from fantoccini.output.view import Theme, rgb, to_bytes
from fantoccini.theatre.perform import Performance

if TYPE_CHECKING:
    import viser


class _RubberBand(NamedTuple):
    """Constants of the rubber band."""

    full_stretch: float = 0.4  # Stretch at which the force is the puppet's weight [puppet sizes]
    max_force: float = 0.5  # Largest force [weights of the puppet]


_RUBBER_BAND = _RubberBand()


@dataclass
class _Pull:
    """Pull of a viewer on a body.

    Attributes:
        viewer: the viewer.
        attachment: (3,) point of the body, in its frame [m].
        mouse: (3,) position of the mouse in the world frame [m].
    """

    viewer: Viewer
    attachment: np.ndarray
    mouse: np.ndarray


class BodyPulls:
    """Pulls of all viewers.

    Args:
        server: server of viser.
        performance: performance with the bodies.
        nodes: nodes of the bodies on the page.
        theme: colours.
        act: performs an action for a viewer, if permitted.
        release: called when a viewer releases a body.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        performance: Performance,
        nodes: SceneNodes,
        theme: Theme,
        act: Callable[[Viewer | None, Callable[[], object]], bool],
        release: Callable[[Viewer], None],
    ):
        self._performance, self._act, self._release = performance, act, release
        marionette = performance.marionette
        weight, size = marionette.weight or 1.0, nodes.geometry.size
        self._stiffness, self._max_force = (
            weight / (_RUBBER_BAND.full_stretch * size),
            _RUBBER_BAND.max_force * weight,
        )
        self._links = {
            link.name: k
            for k, link in enumerate(marionette.tree.links)
            if link.role is Role.DYNAMIC and nodes.bodies.get(k)
        }
        self._pulls: dict[str, _Pull] = {}
        for name, k in self._links.items():
            for mesh in nodes.bodies[k]:
                mesh.on_drag("left")(self._drag_handler(name))
        self._line = server.scene.add_line_segments(
            "/pull",
            np.zeros((1, 2, 3)),
            to_bytes(rgb(theme.line_colours[0])),
            thickness=2.0,
            thickness_units="screen",
            visible=False,
        )

    def remove(self) -> None:
        """Ends all pulls, and removes the line from the page; the nodes remove the meshes."""
        for name in list(self._pulls):
            self._end_pull(name)
        self._line.remove()

    def update(self, poses: np.ndarray) -> None:
        """Updates the forces on the held bodies, for link poses (n_links, 3, 4)."""
        lines = []
        for name, pull in list(self._pulls.items()):
            pose = poses[self._links[name]]
            point = pose[:, :3] @ pull.attachment + pose[:, 3]
            force = self._stiffness * (pull.mouse - point)
            force *= min(1.0, self._max_force / max(float(np.linalg.norm(force)), 1e-12))
            try:
                self._performance.push(name, force, pull.attachment)
            except FantocciniError:
                self._end_pull(name)
                raise
            lines.append((point, pull.mouse))
        if self._line.visible != bool(lines):
            self._line.visible = bool(lines)
        if lines:
            self._line.points = np.array(lines, dtype=np.float32)

    def _end_pull(self, name: str) -> None:
        pull = self._pulls.pop(name, None)
        if pull is not None:
            self._performance.push(name, None)
            self._release(pull.viewer)

    def _drag_handler(self, name: str) -> Callable[[Any], Any]:
        async def handle_drag(event: Any) -> None:
            pull, viewer = self._pulls.get(name), event.client_id
            if event.phase == "end":
                if pull is not None and pull.viewer == viewer:
                    self._end_pull(name)
                return
            mouse = np.array(event.end_position, dtype=float)
            start = np.array(event.start_position, dtype=float)
            if not np.isfinite([mouse, start]).all():
                return
            if pull is None:
                x = self._performance.state
                pose = self._performance.marionette.pose(x, name)
                pull = _Pull(viewer, pose[:3, :3].T @ (start - pose[:3, 3]), mouse)
            if pull.viewer != viewer:
                return

            def apply() -> None:
                pull.mouse = mouse
                self._pulls[name] = pull

            self._act(viewer, apply)

        return handle_drag
