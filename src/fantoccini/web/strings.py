"""Strings in a viser server: those that pull by the colour of their tension, the others sagging.

A string that pulls keeps its length, so each of its spans is a node with a fixed line that is moved
like a body, and stays on the hand it pulls. The curve of a slack one changes; its node goes with
the string's first point.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.view import rope
from fantoccini.view.scene import Scene
from fantoccini.view.theme import Theme, mix
from fantoccini.web.moment import Moment
from fantoccini.web.poses import place, turned_to

if TYPE_CHECKING:
    import viser

_SAG = 30
"""Points on each segment of a slack string."""
_STEPS = 64
"""Colours from no tension to the largest."""
_STRETCH = 2e-4
"""A line is drawn anew when its length is off by more than this, of the puppet's size."""


class Colours:
    """Colours of the strings of a scene.

    Attributes:
        top: tension that has the last colour of the scale [N].

    Args:
        scene: whose strings they are.
        theme: the look.
        top: tension that has the last colour of the scale [N].
    """

    def __init__(self, scene: Scene, theme: Theme, top: float):
        self.top = top
        self._ramp = _bytes(theme.tension_colours(_STEPS))
        self.slack = _bytes(theme.slack)
        self._chains = [None if c is None else _bytes(c) for c in scene.chain_colours]
        self._own = [None if c is None else _bytes(c) for c in scene.colours]

    def of(self, string: int, tension: float | None) -> np.ndarray:
        """(3,) colour of a string that pulls, in 0 to 255."""
        if tension is None or not np.isfinite(tension):
            own = self._own[string]
            return self._ramp[0] if own is None else own
        return self._ramp[self._step(tension)]

    def of_chain(self, chain: int) -> np.ndarray:
        """(3,) colour of a string of masses and springs, in 0 to 255."""
        own = self._chains[chain]
        return self._ramp[0] if own is None else own

    def hexadecimal(self, tension: float) -> str:
        """Colour of a tension as ``#rrggbb``."""
        return "#" + "".join(f"{c:02x}" for c in self._ramp[self._step(tension)])

    def _step(self, tension: float) -> int:
        share = min(abs(tension) / self.top, 1.0) if self.top > 0.0 else 0.0
        return round(share * (len(self._ramp) - 1))


def _bytes(colour: np.ndarray) -> np.ndarray:
    return np.round(255.0 * np.asarray(colour, dtype=float)).astype(np.uint8)


class Strings:
    """The strings and springs of a scene.

    Attributes:
        nodes: of viser.

    Args:
        server: of viser.
        scene: whose strings they are.
        theme: the look.
        colours: of the strings.
        quantum: places are rounded to this [m]; 0 leaves them alone.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        scene: Scene,
        theme: Theme,
        colours: Colours,
        quantum: float,
    ):
        self._scene, self._colours, self._quantum = scene, colours, quantum
        self._owner = np.array(
            [s for s, p in enumerate(scene.points) for _ in range(p.shape[1] - 1)], dtype=int
        )
        none = np.zeros((1, 2, 3))
        add = server.scene.add_line_segments
        self._spans = [
            add(
                f"/strings/{scene.names[s]}/{n}", none, (0, 0, 0), thickness=3.0,
                thickness_units="screen", visible=False,
            )
            for n, s in enumerate(self._owner)
        ]  # fmt: skip
        self._drawn = np.zeros(len(self._owner))
        self._coloured = [b""] * len(self._owner)
        self._curves = [
            add(
                f"/strings/{name}/slack", none, tuple(map(int, colours.slack)), thickness=1.8,
                thickness_units="screen", visible=False,
            )
            for name in scene.names
        ]  # fmt: skip
        self.nodes: list[Any] = [*self._spans, *self._curves]
        self._springs = None
        if scene.springs:
            colour = _bytes(mix(theme.faint, theme.ink, 0.4))
            self._springs = add(
                "/springs", np.zeros((len(scene.springs), 2, 3)), tuple(map(int, colour)),
                thickness=4.0, thickness_units="screen",
            )  # fmt: skip
            self.nodes.append(self._springs)
        self._chains = [
            add(
                f"/chains/{n}", np.zeros((c.shape[1] - 1, 2, 3)),
                tuple(map(int, colours.of_chain(n))), thickness=3.0, thickness_units="screen",
            )
            for n, c in enumerate(scene.chains)
        ]  # fmt: skip
        self.nodes.extend(self._chains)

    def show(self, moment: Moment) -> None:
        """Draws the strings of a moment."""
        holds = np.asarray(moment.taut, dtype=bool) | np.array(self._scene.wires, dtype=bool)
        if self._spans:
            self._show_spans(moment, holds)
        self._show_curves(moment, holds)
        if self._springs is not None:
            ends = np.concatenate(moment.springs)
            if np.isfinite(ends).all():
                self._springs.points = self._rounded(ends).astype(np.float32)
        for node, points in zip(self._chains, moment.chains, strict=True):
            if np.isfinite(points).all():
                ends = np.stack([points[:-1], points[1:]], axis=1)
                node.points = self._rounded(ends).astype(np.float32)

    def _show_spans(self, moment: Moment, holds: np.ndarray) -> None:
        starts = np.concatenate([p[:-1] for p in moment.points])
        away = np.concatenate([p[1:] for p in moment.points]) - starts
        lengths = np.linalg.norm(away, axis=1)
        shown = holds[self._owner] & np.isfinite(lengths) & (lengths > 0.0)
        directions = away / np.where(shown, lengths, 1.0)[:, None]
        wxyz = turned_to(np.where(shown[:, None], directions, [1.0, 0.0, 0.0]))
        if self._quantum:
            wxyz = np.round(wxyz, 4)
        starts = self._rounded(starts)
        for n, node in enumerate(self._spans):
            if node.visible != bool(shown[n]):
                node.visible = bool(shown[n])
            if not shown[n]:
                continue
            place(node, starts[n], wxyz[n])
            if abs(lengths[n] - self._drawn[n]) > _STRETCH * self._scene.size:
                self._drawn[n] = lengths[n]
                node.points = np.array([[[0, 0, 0], [lengths[n], 0, 0]]], dtype=np.float32)
            s = self._owner[n]
            tension = None if moment.tension is None else float(moment.tension[s])
            colour = self._colours.of(s, tension)
            if colour.tobytes() != self._coloured[n]:
                self._coloured[n] = colour.tobytes()
                node.colors = colour

    def _show_curves(self, moment: Moment, holds: np.ndarray) -> None:
        for s, node in enumerate(self._curves):
            shown = not holds[s] and bool(np.isfinite(moment.points[s]).all())
            if node.visible != shown:
                node.visible = shown
            if not shown:
                continue
            line = rope.path(moment.points[s], float(moment.lengths[s]), _SAG)
            if self._scene.ground:
                line = np.maximum(line, [-np.inf, -np.inf, self._scene.floor])
            line = self._rounded(line)
            place(node, line[0])
            away = (line - line[0]).astype(np.float32)
            node.points = np.stack([away[:-1], away[1:]], axis=1)

    def _rounded(self, places: np.ndarray) -> np.ndarray:
        return np.round(places / self._quantum) * self._quantum if self._quantum else places
