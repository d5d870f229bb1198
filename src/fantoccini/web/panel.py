"""What stands beside the scene: numbers, plots, and the buttons that every page has.

Text of puppets goes into HTML through :func:`text` only, and never into markdown, which a page
would run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.view.theme import Theme
from fantoccini.web.moment import Moment
from fantoccini.web.stage import VIEWS, Stage

if TYPE_CHECKING:
    import viser

_BAR = (
    '<div style="display:grid;grid-template-columns:minmax(4.5em,auto) 1fr 4.6em;'
    'gap:0.28em 0.6em;align-items:center;font-size:0.84em;line-height:1.25">'
)
_SIDE = "0.5em"


def text(words: object) -> str:
    """Plain text as HTML: nothing in it is markup."""
    return escape(
        "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in str(words))
    )


def note(words: str) -> str:
    """A line of lesser text, as HTML; ``words`` is plain text."""
    return f'<div style="padding:0 {_SIDE};font-size:0.82em;opacity:0.75">{text(words)}</div>'


def bars(names: Sequence[str], moment: Moment, stage: Stage) -> str:
    """Every string with its tension as a bar and a number, as HTML.

    The dot before a name has the colour of the string's line in the plot.

    Args:
        names: of the strings.
        moment: now.
        stage: whose colours are used.
    """
    rows = []
    for s, name in enumerate(names):
        pull = None if moment.tension is None else float(moment.tension[s])
        holds = bool(moment.taut[s]) or stage.scene.wires[s]
        if pull is None or not np.isfinite(pull):
            share, colour, number = 0.0, "transparent", "taut" if holds else "slack"
        elif holds:
            share = min(abs(pull) / stage.colours.top, 1.0)
            colour, number = stage.colours.hexadecimal(pull), f"{pull:.2f} N"
        else:
            share, colour, number = 0.0, "transparent", "slack"
        rows.append(
            f'<div><span style="color:{stage.theme.colour(s)}">&#9679;</span> {text(name)}</div>'
            '<div style="background:rgba(128,128,128,0.16);border-radius:3px;height:0.62em">'
            f'<div style="width:{100.0 * share:.1f}%;height:100%;border-radius:3px;'
            f'background:{colour}"></div></div>'
            f'<div style="text-align:right;font-variant-numeric:tabular-nums'
            f'{";opacity:0.55" if number == "slack" else ""}">{number}</div>'
        )
    return f'<div style="padding:0.1em {_SIDE}">{_BAR}{"".join(rows)}</div></div>'


class Views:
    """Buttons for the camera, and what is shown of the world.

    Args:
        gui: of the server.
        stage: gives the stage that is shown now.
    """

    def __init__(self, gui: viser.GuiApi, stage: Callable[[], Stage]):
        self._stage = stage
        buttons = gui.add_button_group("Camera", VIEWS)

        @buttons.on_click
        def _(event: Any) -> None:
            if event.client is not None:
                stage().look(event.client.camera, event.target.value)

        self._floor = gui.add_checkbox("Floor", True)
        self._obstacles = gui.add_checkbox("Obstacles", True)
        self._shadows = gui.add_checkbox(
            "Shadows", True, hint="Without a graphics card the page is faster without them"
        )
        for box in (self._floor, self._shadows):
            box.on_update(lambda _: self.apply())
        self._obstacles.on_update(lambda _: self.apply())

    def apply(self) -> None:
        """Shows and hides what the boxes say."""
        stage = self._stage()
        stage.show_floor(self._floor.value)
        stage.show_shadows(self._shadows.value)
        stage.show_obstacles(self._obstacles.value)
        self._obstacles.visible = stage.has_obstacles


class Plot:
    """Lines against time, with a mark at the present.

    Args:
        gui: of the server.
        names: of the lines; plain text.
        theme: the look.
        label: unit of the values.
        span: first and last time [s].
        scale: lower and upper end of the values.
        mark: draw a mark at the present.
        height: [px].
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        names: Sequence[str],
        theme: Theme,
        label: str,
        span: tuple[float, float],
        scale: tuple[float, float],
        mark: bool = False,
        height: int = 170,
    ):
        self._mark = mark
        ink = _css(theme.ink)
        grid = {"stroke": "rgba(128,128,128,0.18)", "width": 1}
        series: list[dict] = [{"label": "t [s]"}]
        series += [
            {
                "label": name,
                "stroke": theme.colour(k),
                "width": 1.6,
                "points": {"show": False},
                "dash": [3.0 * dash for dash in theme.dashes(k)],
            }
            for k, name in enumerate(names)
        ]
        if mark:
            series.append({"label": "now", "stroke": ink, "width": 1.4, "points": {"show": False}})
        # A scale that follows the values would be led astray by the mark, which is mostly nothing.
        values = {"auto": False, "range": list(scale)}
        zeros = tuple(np.zeros(2) for _ in series[1:])
        self._node = gui.add_uplot(
            (np.array(span, dtype=float), *zeros), tuple(series),
            scales={"x": {"time": False, "auto": False, "range": list(span)}, "y": values},
            axes=(
                {"stroke": ink, "grid": grid, "size": 26},
                {"stroke": ink, "grid": grid, "size": 46, "label": label, "labelSize": 16},
            ),
            legend={"show": False}, cursor={"show": False}, height=height,
        )  # fmt: skip

    def draw(self, t: np.ndarray, values: np.ndarray, now: float | None = None) -> None:
        """New lines.

        Args:
            t: (n,) times [s].
            values: (n_names, n).
            now: the present [s].
        """
        lines = [np.asarray(row, dtype=float) for row in values]
        if self._mark:
            lines.append(_spike(t, values, t[0] if now is None else now))
        self._node.data = (np.asarray(t, dtype=float), *lines)


def _spike(t: np.ndarray, values: np.ndarray, now: float) -> np.ndarray:
    """(n,) nothing, but for two neighbours about the present: a line that stands almost upright."""
    mark = np.full(len(t), np.nan)
    k = int(np.clip(np.searchsorted(t, now), 1, len(t) - 1))
    finite = values[np.isfinite(values)]
    mark[k - 1], mark[k] = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    return mark


def _css(colour: np.ndarray) -> str:
    return "#" + "".join(f"{round(255.0 * float(c)):02x}" for c in colour[:3])
