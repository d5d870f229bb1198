"""Strings as line segments: those that pull by the colour of their tension, the others sagging."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.view import rope
from fantoccini.view.scene import Scene
from fantoccini.view.theme import Theme

_SAG = 22
"""Points on each segment of a slack string."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Line segments and their colours.

    Attributes:
        points: (n, 2, 3) ends [m].
        colours: (n, 2, 3) in 0 to 255, linear.
    """

    points: np.ndarray
    colours: np.ndarray


class Colours:
    """Colours of the strings of a scene.

    Args:
        scene: whose strings they are.
        theme: the look.
        top: tension that has the last colour of the scale [N].
    """

    def __init__(self, scene: Scene, theme: Theme, top: float):
        self.top = top
        self._seen = theme.tension_colours()
        self._ramp = linear(self._seen)
        self.slack = linear(theme.slack)
        self._own = [None if c is None else linear(c) for c in scene.colours]

    def of(self, string: int, tension: float | None) -> np.ndarray:
        """(3,) colour of a string that pulls, in 0 to 255, linear."""
        if tension is None or not np.isfinite(tension):
            own = self._own[string]
            return self._ramp[0] if own is None else own
        return self._ramp[self._place(tension)]

    def hexadecimal(self, tension: float) -> str:
        """Colour of a tension as ``#rrggbb``."""
        seen = np.round(255.0 * self._seen[self._place(tension)]).astype(int)
        return "#" + "".join(f"{c:02x}" for c in seen)

    def _place(self, tension: float) -> int:
        share = min(abs(tension) / self.top, 1.0) if self.top > 0.0 else 0.0
        return round(share * (len(self._seen) - 1))


def linear(colour: np.ndarray) -> np.ndarray:
    """Colours in 0 to 255 as viser's lines take them: proportional to light, not as on a screen."""
    colour = np.asarray(colour, dtype=float)
    light = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)


def split(
    scene: Scene,
    colours: Colours,
    points: list[np.ndarray],
    lengths: np.ndarray,
    taut: np.ndarray,
    tension: np.ndarray | None,
) -> tuple[Segments, Segments]:
    """The strings of one moment as segments: those that pull, and those that sag.

    Args:
        scene: what does not change.
        colours: of its strings.
        points: of each string, (n_points, 3) [m].
        lengths: (n_strings,) with what winches have let out [m].
        taut: (n_strings,) modes.
        tension: (n_strings,) [N], or None when unknown.
    """
    pulling, sagging = ([], []), ([], [])
    for s, line in enumerate(points):
        holds = bool(taut[s]) or scene.wires[s]
        if not np.isfinite(line).all():
            continue
        if holds:
            colour = colours.of(s, None if tension is None else float(tension[s]))
        else:
            colour = colours.slack
            line = rope.path(line, float(lengths[s]), _SAG)
            if scene.ground:
                line = np.maximum(line, [-np.inf, -np.inf, scene.floor])
        kept = pulling if holds else sagging
        kept[0].append(np.stack([line[:-1], line[1:]], axis=1))
        kept[1].append(np.broadcast_to(colour, (len(line) - 1, 2, 3)))
    return _joined(pulling), _joined(sagging)


def _joined(parts: tuple[list, list]) -> Segments:
    if not parts[0]:
        return Segments(np.zeros((0, 2, 3)), np.zeros((0, 2, 3), dtype=np.uint8))
    return Segments(np.concatenate(parts[0]), np.concatenate(parts[1]).astype(np.uint8))
