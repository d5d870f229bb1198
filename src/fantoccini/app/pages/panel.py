"""Side panel: numbers, plots, and the buttons that all pages have.

Texts from puppet files become HTML only through elements, which escape them. They are never passed
to the page as markdown, in which a browser would run code.

A taut string pulls, a slack one does not; a wire also pushes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.app.pages.nodes import VIEWS, SceneNodes
from fantoccini.app.pages.scene_state import SceneState
from fantoccini.output.html import Content, element, to_html
from fantoccini.output.view import Theme, to_hex

if TYPE_CHECKING:
    import viser

_SIDE_PADDING = "0.5em"
_GRID_STYLE = (
    "display:grid;grid-template-columns:minmax(4.5em,auto) 1fr 4.6em;"
    "gap:0.28em 0.6em;align-items:center;font-size:0.84em;line-height:1.25"
)


def note_html(text: str) -> str:
    """Line of secondary text, as HTML."""
    return to_html(
        element("div", text, style=f"padding:0 {_SIDE_PADDING};font-size:0.82em;opacity:0.75")
    )


def dotted_name(name: str, colour: str) -> list[Content]:
    """A dot in a colour, followed by a name."""
    return [element("span", "\N{BLACK CIRCLE}", style=f"color:{colour}"), f" {name}"]


def tension_table_html(names: Sequence[str], scene: SceneState, nodes: SceneNodes) -> str:
    """HTML table of the strings: name with a coloured dot, and tension as a bar and a number."""
    cells = []
    for s, name in enumerate(names):
        tension = None if scene.tension is None else float(scene.tension[s])
        is_taut = bool(scene.taut[s]) or nodes.geometry.wires[s]
        if tension is None or not np.isfinite(tension):
            share, colour, number_text = 0.0, "transparent", "taut" if is_taut else "slack"
        elif is_taut:
            share = min(abs(tension) / nodes.colours.full_scale, 1.0)
            colour, number_text = nodes.colours.hexadecimal(tension), f"{tension:.2f} N"
        else:
            share, colour, number_text = 0.0, "transparent", "slack"
        fill_style = f"width:{100.0 * share:.1f}%;height:100%;border-radius:3px;background:{colour}"
        bar_style = "background:rgba(128,128,128,0.16);border-radius:3px;height:0.62em"
        number_style = "text-align:right;font-variant-numeric:tabular-nums"
        slack_style = ";opacity:0.55" if number_text == "slack" else ""
        cells += [
            element("div", *dotted_name(name, nodes.theme.colour(s))),
            element("div", element("div", style=fill_style), style=bar_style),
            element("div", number_text, style=number_style + slack_style),
        ]
    table = element("div", *cells, style=_GRID_STYLE)
    return to_html(element("div", table, style=f"padding:0.1em {_SIDE_PADDING}"))


class Views:
    """Buttons for the camera, and checkboxes for the parts of the world that are shown.

    Attributes:
        shadows_box, forces_box: checkboxes for shadows and for contact forces.

    Args:
        gui: panel of the server, to which controls are added.
        nodes: returns the current nodes.
        has_contact: returns whether the puppet has contacts.
    """

    def __init__(
        self, gui: viser.GuiApi, nodes: Callable[[], SceneNodes], has_contact: Callable[[], bool]
    ):
        self._nodes, self._has_contact = nodes, has_contact
        gui.add_button_group("Camera", VIEWS).on_click(self._aim_camera)
        self._floor = gui.add_checkbox("Floor", True)
        self._obstacles = gui.add_checkbox("Obstacles", True)
        self.shadows_box = gui.add_checkbox(
            "Shadows", True, hint="Without a graphics card the page is faster without them"
        )
        self.forces_box = gui.add_checkbox("Forces", False, hint="Forces of contacts, as arrows")
        for box in (self._floor, self.shadows_box, self._obstacles, self.forces_box):
            box.on_update(lambda _: self.apply())

    def apply(self) -> None:
        """Shows and hides parts of the world according to the boxes."""
        nodes = self._nodes()
        nodes.show_floor(self._floor.value)
        nodes.show_shadows(self.shadows_box.value)
        nodes.show_obstacles(self._obstacles.value)
        nodes.show_forces(self.forces)
        self._obstacles.visible = nodes.has_obstacles
        self.forces_box.visible = self._has_contact()

    @property
    def forces(self) -> bool:
        """Whether the forces of contacts are shown."""
        return self.forces_box.value and self._has_contact()

    def _aim_camera(self, event: viser.GuiEvent[viser.GuiButtonGroupHandle[str]]) -> None:
        if event.client is not None:
            self._nodes().aim_camera(event.client.camera, event.target.value)


class Plot:
    """Plot of lines against time, with a mark at the current time.

    Args:
        gui: panel of the server, to which controls are added.
        names: names of the lines, as plain text.
        theme: colours.
        label: unit of the values, as a label of their axis.
        time_range: first and last time [s].
        value_range: lower and upper end of the values.
        mark: whether to mark the current time.
        height: height of the plot [px].
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        names: Sequence[str],
        theme: Theme,
        label: str,
        time_range: tuple[float, float],
        value_range: tuple[float, float],
        mark: bool = False,
        height: int = 170,
    ):
        self._mark = mark
        text_colour = to_hex(theme.text)
        grid = {"stroke": "rgba(128,128,128,0.18)", "width": 1}
        series: list[dict[str, Any]] = [{"label": "t [s]"}]
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
            series.append(
                {"label": "now", "stroke": text_colour, "width": 1.4, "points": {"show": False}}
            )
        # The scale is fixed, because viser derives no range from the mark, which is mostly NaN.
        values = {"auto": False, "range": list(value_range)}
        zeros = tuple(np.zeros(2) for _ in series[1:])
        self._node = gui.add_uplot(
            (np.array(time_range, dtype=float), *zeros),
            tuple(series),
            scales={"x": {"time": False, "auto": False, "range": list(time_range)}, "y": values},
            axes=(
                {"stroke": text_colour, "grid": grid, "size": 26},
                {"stroke": text_colour, "grid": grid, "size": 46, "label": label, "labelSize": 16},
            ),
            legend={"show": False},
            cursor={"show": False},
            height=height,
        )

    def draw(self, t: np.ndarray, values: np.ndarray, now: float | None = None) -> None:
        """Draws values (n_names, n) at times (n,), with the mark at ``now`` [s]."""
        lines = [np.asarray(row, dtype=float) for row in values]
        if self._mark:
            lines.append(_time_mark(t, values, t[0] if now is None else now))
        self._node.data = (np.asarray(t, dtype=float), *lines)


def _time_mark(t: np.ndarray, values: np.ndarray, now: float) -> np.ndarray:
    """(n,) an almost vertical line at the current time: NaN except at two neighbouring times."""
    mark = np.full(len(t), np.nan)
    k = int(np.clip(np.searchsorted(t, now), 1, len(t) - 1))
    finite = values[np.isfinite(values)]
    mark[k - 1], mark[k] = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    return mark
