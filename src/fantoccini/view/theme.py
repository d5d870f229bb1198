"""Colours of the pictures, and the few operations on colours that they need.

Colours are arrays of red, green, blue in [0, 1]; a fourth number is opacity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.errors import UnknownNameError

WOOD = ("#c8553d", "#e0b07c", "#3f6c8f", "#d9a066", "#8f5a3c", "#6c8f5a")
"""Colours of shapes that have none: by distance from the puppet's root."""

_DASHES = ((), (4.0, 2.0), (1.0, 1.5), (6.0, 2.0, 1.0, 2.0))
"""Of lines in plots; an empty one is solid."""

STONE = "#b4aea0"
"""Colour of obstacles."""


def rgb(text: str) -> np.ndarray:
    """(3,) colour of ``#rrggbb``."""
    return np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


def mix(a: np.ndarray, b: np.ndarray, share) -> np.ndarray:
    """Colour between a (share 0) and b (share 1)."""
    return a + (b - a) * share


@dataclass(frozen=True)
class Theme:
    """The look of a picture.

    Attributes:
        name: of the theme.
        top, bottom: background at its upper and lower edge.
        floor: colour and opacity (4,) of the spot of light on the floor.
        grid: colour of the floor's lines.
        shadow: colour of shadows.
        shadow_opacity: of one layer of a shadow.
        ink, faint: colours of text and of lesser text and rules.
        slack: colour of a slack string.
        handle: colour of a driven string end.
        outline: how dark outlines are, 0 black to 1 the shape's own colour.
        ramp: (name, from, to): matplotlib's colour map for tension and the part of it in use.
        cycle: colours of lines in plots, which people tell apart who see red and green, or blue and
            yellow, alike.
    """

    name: str
    top: np.ndarray
    bottom: np.ndarray
    floor: np.ndarray
    grid: np.ndarray
    shadow: np.ndarray
    shadow_opacity: float
    ink: np.ndarray
    faint: np.ndarray
    slack: np.ndarray
    handle: np.ndarray
    outline: float
    ramp: tuple[str, float, float]
    cycle: tuple[str, ...]

    def colour(self, k: int) -> str:
        """Colour of line k of a plot, as ``#rrggbb``."""
        return self.cycle[k % len(self.cycle)]

    def dashes(self, k: int) -> tuple[float, ...]:
        """Dashes and gaps of line k, in widths; lines of one colour have different ones."""
        return _DASHES[k // len(self.cycle) % len(_DASHES)]

    def tension_colours(self, n: int = 256) -> np.ndarray:
        """(n, 3) colours from no tension to the largest."""
        from matplotlib import colormaps

        name, start, stop = self.ramp
        return colormaps[name](np.linspace(start, stop, n))[:, :3]


LIGHT = Theme(
    name="light",
    top=rgb("#fdfcf9"),
    bottom=rgb("#e6e2d8"),
    floor=np.array([1.0, 1.0, 1.0, 0.55]),
    grid=rgb("#c9c3b4"),
    shadow=rgb("#4a4334"),
    shadow_opacity=0.042,
    ink=rgb("#2b2a28"),
    faint=rgb("#8a857a"),
    slack=rgb("#9c988f"),
    handle=rgb("#8f7a55"),
    outline=0.40,
    ramp=("plasma", 0.0, 0.86),
    cycle=(
        "#1b6ca8", "#ff7800", "#a54bff", "#87001e", "#b4a569", "#a55a69", "#4b00a5", "#3cb4c3",
        "#a596ff", "#c31e00", "#78005a", "#2d00ff",
    ),
)

DARK = Theme(
    name="dark",
    top=rgb("#14171f"),
    bottom=rgb("#252a36"),
    floor=np.array([0.62, 0.66, 0.76, 0.20]),
    grid=rgb("#3d4454"),
    shadow=rgb("#05060a"),
    shadow_opacity=0.075,
    ink=rgb("#eceae4"),
    faint=rgb("#8e93a0"),
    slack=rgb("#7d828f"),
    handle=rgb("#c9ab74"),
    outline=0.26,
    ramp=("plasma", 0.30, 1.0),
    cycle=(
        "#6cb4ee", "#964b00", "#780fff", "#ffe187", "#87a569", "#874b87", "#96ff00", "#3c694b",
        "#d2f0c3", "#7878ff", "#4bffff", "#b4a51e",
    ),
)

THEMES = {"light": LIGHT, "dark": DARK}


def theme_of(theme: str | Theme) -> Theme:
    """The theme of this name, or the theme itself."""
    if isinstance(theme, Theme):
        return theme
    if theme not in THEMES:
        raise UnknownNameError("theme", theme, THEMES)
    return THEMES[theme]
