"""Themes and colour conversions.

A colour is an array of red, green, blue in [0, 1]; a fourth number is the opacity.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import UnknownNameError

WOOD_COLOURS = ("#c8553d", "#e0b07c", "#3f6c8f", "#d9a066", "#8f5a3c", "#6c8f5a")
"""Default colours of shapes, by the depth of their link in the tree."""

_DASHES = ((), (4.0, 2.0), (1.0, 1.5), (6.0, 2.0, 1.0, 2.0))
"""Dash patterns of lines in plots; the empty pattern is a solid line."""

RED = "#b3261e"
"""Colour of violations in plots of reports."""

STONE_COLOUR = "#b4aea0"
"""Colour of obstacles."""


def rgb(text: str) -> np.ndarray:
    """(3,) colour of a text ``#rrggbb``."""
    return np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


def to_bytes(colour: np.ndarray) -> tuple[int, int, int]:
    """Red, green and blue, from 0 to 255."""
    red, green, blue = (round(255.0 * float(c)) for c in colour[:3])
    return red, green, blue


def to_hex(colour: np.ndarray) -> str:
    """The colour as ``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*to_bytes(colour))


def mix_colours(a: np.ndarray, b: np.ndarray, share: float | np.ndarray) -> np.ndarray:
    """Linear interpolation from a (share 0) to b (share 1)."""
    return a + (b - a) * share


@dataclass(frozen=True)
class Theme:
    """Colours of a picture.

    Attributes:
        name: ``light`` or ``dark``, for the bundled themes.
        upper_background, lower_background: background at its upper and lower edge.
        floor: (4,) colour and opacity of the spot of light on the floor.
        grid, shadow, slack, handle: colours of the floor's lines, shadows, slack strings, and
            driven string ends.
        shadow_opacity: opacity of one layer of a shadow.
        text, muted: colours of text, and of secondary text and rules.
        outline: factor on a shape's colour for its outline.
        tension_map: matplotlib's colour map for tension, and the part of it in use.
        line_colours: colours of lines in plots, also distinct for colour-blind readers.
        force: colour of arrows of forces, different from all tension colours.
        guide: colour of guides, different from all tension colours and from usual costumes.
        thread: colour of strings without a colour of their own, or None for colours by tension.
    """

    name: str
    upper_background: np.ndarray
    lower_background: np.ndarray
    floor: np.ndarray
    grid: np.ndarray
    shadow: np.ndarray
    shadow_opacity: float
    text: np.ndarray
    muted: np.ndarray
    slack: np.ndarray
    handle: np.ndarray
    outline: float
    tension_map: tuple[str, float, float]
    line_colours: tuple[str, ...]
    force: np.ndarray = field(default_factory=lambda: rgb("#00855a"))
    guide: np.ndarray = field(default_factory=lambda: rgb("#00b7eb"))
    thread: np.ndarray | None = None

    def colour(self, k: int) -> str:
        """Colour of line k of a plot, as ``#rrggbb``."""
        return self.line_colours[k % len(self.line_colours)]

    def dashes(self, k: int) -> tuple[float, ...]:
        """Dashes and gaps of line k, in line widths; they differ between lines of one colour."""
        return _DASHES[k // len(self.line_colours) % len(_DASHES)]

    def tension_colours(self, n: int = 256) -> np.ndarray:
        """(n, 3) colours, from zero to the largest tension."""
        from matplotlib import colormaps

        name, start, stop = self.tension_map
        return colormaps[name](np.linspace(start, stop, n))[:, :3]


LIGHT = Theme(
    name="light",
    upper_background=rgb("#fdfcf9"),
    lower_background=rgb("#e6e2d8"),
    floor=np.array([1.0, 1.0, 1.0, 0.55]),
    grid=rgb("#c9c3b4"),
    shadow=rgb("#4a4334"),
    shadow_opacity=0.042,
    text=rgb("#2b2a28"),
    muted=rgb("#8a857a"),
    slack=rgb("#9c988f"),
    handle=rgb("#8f7a55"),
    outline=0.40,
    tension_map=("plasma", 0.0, 0.86),
    line_colours=(
        "#1b6ca8",
        "#ff7800",
        "#a54bff",
        "#87001e",
        "#b4a569",
        "#a55a69",
        "#4b00a5",
        "#3cb4c3",
        "#a596ff",
        "#c31e00",
        "#78005a",
        "#2d00ff",
    ),
)

DARK = Theme(
    name="dark",
    upper_background=rgb("#14171f"),
    lower_background=rgb("#252a36"),
    floor=np.array([0.62, 0.66, 0.76, 0.20]),
    grid=rgb("#3d4454"),
    shadow=rgb("#05060a"),
    shadow_opacity=0.075,
    text=rgb("#eceae4"),
    muted=rgb("#8e93a0"),
    slack=rgb("#7d828f"),
    handle=rgb("#c9ab74"),
    outline=0.26,
    tension_map=("plasma", 0.30, 1.0),
    line_colours=(
        "#6cb4ee",
        "#964b00",
        "#780fff",
        "#ffe187",
        "#87a569",
        "#874b87",
        "#96ff00",
        "#3c694b",
        "#d2f0c3",
        "#7878ff",
        "#4bffff",
        "#b4a51e",
    ),
    force=rgb("#3ddc97"),
)

THEMES = {"light": LIGHT, "dark": DARK}


def theme_of(theme: str | Theme) -> Theme:
    """The theme with this name, or the given theme."""
    if isinstance(theme, Theme):
        return theme
    if theme not in THEMES:
        raise UnknownNameError("theme", theme, THEMES)
    return THEMES[theme]
