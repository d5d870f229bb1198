"""Strings on a page: taut ones coloured by tension, slack ones sagging.

Each span of a taut string is a node with a fixed line, which is moved like a body. The curve of a
slack string is sent again whenever it changes, relative to the string's first point.

A span is the part of a string between two points of its path. A wire is a string that also pushes;
a chain consists of point masses and springs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fantoccini.app.pages.scene_state import SceneState
from fantoccini.app.pages.viser_private import move_node
from fantoccini.base import rotation
from fantoccini.output.view import Geometry, Theme, mix_colours, to_bytes, to_hex

if TYPE_CHECKING:
    import viser


class _Resolution(NamedTuple):
    """Resolution of strings."""

    sag_points: int = 30  # Points on each segment of a slack string
    colours: int = 64  # Colours from zero to the largest tension
    stretch: float = 2e-4
    """Error of a line's length, relative to the puppet's size, above which it is sent again."""


_RESOLUTION = _Resolution()


class Colours:
    """Colours of a geometry's strings.

    Attributes:
        full_scale: tension with the last colour of the scale [N].
    """

    def __init__(self, geometry: Geometry, theme: Theme, full_scale: float):
        self.full_scale = full_scale
        self._ramp = theme.tension_colours(_RESOLUTION.colours)
        self._chain_colours, self._string_colours = geometry.chain_colours, geometry.colours

    def string_colour(self, string: int, tension: float | None) -> tuple[int, int, int]:
        """Colour of a taut string, from 0 to 255."""
        if tension is None or not np.isfinite(tension):
            return self._own_colour(self._string_colours[string])
        return to_bytes(self._ramp[self._ramp_index(tension)])

    def chain_colour(self, chain: int) -> tuple[int, int, int]:
        """Colour of a chain, from 0 to 255."""
        return self._own_colour(self._chain_colours[chain])

    def hexadecimal(self, tension: float) -> str:
        """Colour of a tension as ``#rrggbb``."""
        return to_hex(self._ramp[self._ramp_index(tension)])

    def _own_colour(self, colour: np.ndarray | None) -> tuple[int, int, int]:
        return to_bytes(self._ramp[0] if colour is None else colour)

    def _ramp_index(self, tension: float) -> int:
        share = min(abs(tension) / self.full_scale, 1.0) if self.full_scale > 0.0 else 0.0
        return round(share * (len(self._ramp) - 1))


class Strings:
    """Nodes of a geometry's strings, springs and chains.

    Attributes:
        nodes: nodes of viser.

    Args:
        server: server of viser.
        geometry: geometry with the strings.
        theme: theme, for the colours of springs.
        colours: colours of the strings.
        rounding_step: step to which positions are rounded [m]; 0 for none.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        geometry: Geometry,
        theme: Theme,
        colours: Colours,
        rounding_step: float,
    ):
        self._geometry, self._colours, self._rounding_step = geometry, colours, rounding_step
        self._string_of_span = np.array(
            [s for s, p in enumerate(geometry.points) for _ in range(p.shape[1] - 1)], dtype=int
        )

        def add_segments(
            name: str, n: int, colour: tuple[int, int, int], width: float, visible: bool = True
        ) -> viser.LineSegmentsHandle:
            return server.scene.add_line_segments(
                name,
                np.zeros((n, 2, 3)),
                colour,
                thickness=width,
                thickness_units="screen",
                visible=visible,
            )

        self._spans = [
            add_segments(f"/strings/{geometry.names[s]}/{n}", 1, (0, 0, 0), 3.0, False)
            for n, s in enumerate(self._string_of_span)
        ]
        self._drawn_lengths = np.zeros(len(self._string_of_span))
        self._drawn_colours: list[tuple[int, int, int] | None] = [None] * len(self._string_of_span)
        slack = to_bytes(theme.slack)
        self._slack_curves = [
            add_segments(f"/strings/{name}/slack", 1, slack, 1.8, False) for name in geometry.names
        ]
        self.nodes: list[viser.LineSegmentsHandle] = [*self._spans, *self._slack_curves]
        self._springs = None
        if geometry.springs:
            colour = to_bytes(mix_colours(theme.muted, theme.text, 0.4))
            self._springs = add_segments("/springs", len(geometry.springs), colour, 4.0)
            self.nodes.append(self._springs)
        self._chains = [
            add_segments(f"/chains/{n}", c.shape[1] - 1, colours.chain_colour(n), 3.0)
            for n, c in enumerate(geometry.chains)
        ]
        self.nodes.extend(self._chains)

    def show(self, scene: SceneState) -> None:
        """Draws the strings of a state of the scene."""
        is_taut = np.asarray(scene.taut, dtype=bool) | np.array(self._geometry.wires, dtype=bool)
        if self._spans:
            self._show_spans(scene, is_taut)
        self._show_curves(scene, is_taut)
        if self._springs is not None:
            ends = np.concatenate(scene.springs)
            if np.isfinite(ends).all():
                self._springs.points = self._rounded(ends).astype(np.float32)
        for node, points in zip(self._chains, scene.chains, strict=True):
            if np.isfinite(points).all():
                ends = np.stack([points[:-1], points[1:]], axis=1)
                node.points = self._rounded(ends).astype(np.float32)

    def _show_spans(self, scene: SceneState, is_taut: np.ndarray) -> None:
        starts = np.concatenate([p[:-1] for p in scene.points])
        offsets = np.concatenate([p[1:] for p in scene.points]) - starts
        lengths = np.linalg.norm(offsets, axis=1)
        visible = is_taut[self._string_of_span] & np.isfinite(lengths) & (lengths > 0.0)
        directions = offsets / np.where(visible, lengths, 1.0)[:, None]
        x_axis = np.array([1.0, 0.0, 0.0])
        wxyz = rotation.shortest(x_axis, np.where(visible[:, None], directions, x_axis))
        if self._rounding_step:
            wxyz = np.round(wxyz, 4)
        starts = self._rounded(starts)
        for n, node in enumerate(self._spans):
            if node.visible != bool(visible[n]):
                node.visible = bool(visible[n])
            if not visible[n]:
                continue
            move_node(node, starts[n], wxyz[n])
            if abs(lengths[n] - self._drawn_lengths[n]) > _RESOLUTION.stretch * self._geometry.size:
                self._drawn_lengths[n] = lengths[n]
                node.points = np.array([[[0, 0, 0], [lengths[n], 0, 0]]], dtype=np.float32)
            s = self._string_of_span[n]
            tension = None if scene.tension is None else float(scene.tension[s])
            colour = self._colours.string_colour(s, tension)
            if colour != self._drawn_colours[n]:
                self._drawn_colours[n] = colour
                node.colors = np.array(colour, dtype=np.uint8)

    def _show_curves(self, scene: SceneState, is_taut: np.ndarray) -> None:
        for s, node in enumerate(self._slack_curves):
            visible = not is_taut[s] and bool(np.isfinite(scene.points[s]).all())
            if node.visible != visible:
                node.visible = visible
            if not visible:
                continue
            curve = self._rounded(
                self._geometry.slack_curve(
                    scene.points[s], float(scene.lengths[s]), _RESOLUTION.sag_points
                )
            )
            move_node(node, curve[0])
            offsets = (curve - curve[0]).astype(np.float32)
            node.points = np.stack([offsets[:-1], offsets[1:]], axis=1)

    def _rounded(self, positions: np.ndarray) -> np.ndarray:
        return (
            np.round(positions / self._rounding_step) * self._rounding_step
            if self._rounding_step
            else positions
        )
