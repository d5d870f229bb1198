"""Lines of plots are distinct for everybody, and plots show every driven coordinate."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from fantoccini.model.puppet import loads
from fantoccini.output import view
from fantoccini.output.view.theme import DARK, LIGHT, rgb
from view.still_life import StillLife, bundled_still_life, swinging_motion

BALL = """\
puppet: ball
bodies:
  - name: ball
    joint: {type: translation, axes: [x, y, z]}
    shapes: [{type: sphere, radius: 0.05, mass: 0.2}]
strings:
"""

CROSS = """\
  - name: cross
    joint: {type: free, driven: true}
    shapes: [{type: box, size: [0.2, 0.02, 0.01]}]
strings:
  - {name: line, path: [{body: ball}, {body: cross}], length: driven}
pose: {cross.z: 0.5}
"""

# Machado, Oliveira and Fernandes (2009): sight without one kind of cone, in linear RGB.
CONES_OF_VISION = {
    "all cones": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colour: np.ndarray) -> np.ndarray:
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def lab(colour: np.ndarray, eye) -> np.ndarray:
    """CIE L*a*b* of a colour (3,) as an eye sees it."""
    xyz = XYZ @ np.clip(np.array(eye) @ linear(colour), 0, 1) / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=lambda theme: theme.name)
@pytest.mark.parametrize("eye", CONES_OF_VISION)
def test_twelve_lines_have_colours_that_everybody_distinguishes(theme, eye):
    """Regression: two of nine strings had one colour. A difference of 10 is seen at a glance."""
    assert len(theme.line_colours) >= 12
    seen = [lab(rgb(colour), CONES_OF_VISION[eye]) for colour in theme.line_colours[:12]]
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 15.0
    light = [XYZ[1] @ linear(rgb(colour)) for colour in theme.line_colours]
    behind = XYZ[1] @ linear(theme.upper_background)
    for y in light:
        assert (max(y, behind) + 0.05) / (min(y, behind) + 0.05) > 2.0


def test_more_lines_have_dashes():
    """Beyond the number of colours, lines of one colour have different dashes."""
    styles = {(LIGHT.colour(k), LIGHT.dashes(k)) for k in range(48)}
    assert len(styles) == 48
    assert all(LIGHT.dashes(k) == () for k in range(12))


def test_a_bar_that_turns_is_in_the_plot():
    """Regression: plots left out bar.rotation."""
    m = bundled_still_life("marionette_bar")
    run = swinging_motion(m)
    q_K = np.array(run.q_K)
    (q, _), angle = run.coordinates.quaternions_K[0], 0.5 * run.t
    q_K[:, q : q + 4] = np.column_stack([np.cos(angle), 0 * angle, np.sin(angle), 0 * angle])
    run = replace(run, q_K=q_K)
    figure = view.plot(run)
    lines = {line.get_label(): line for axes in figure.axes for line in axes.get_lines()}
    assert lines["bar.rotation y"].get_ydata()[[0, -1]] == pytest.approx([0.0, 1.0])
    assert np.abs(lines["bar.rotation x"].get_ydata()).max() < 1e-9
    assert {"bar.x", "bar.y", "bar.z"} <= set(lines)


def test_a_control_that_moves_is_in_the_plot_beside_lengths():
    """Plots left out the place of a control whose strings are wound."""
    m = StillLife(loads(BALL.replace("strings:", CROSS)))
    run = swinging_motion(m)
    q_K = np.array(run.q_K)
    names = list(run.coordinates.q_K)
    q_K[:, names.index("cross.x")] = 0.2 * run.t
    figure = view.plot(replace(run, q_K=q_K))
    panels = {axes.get_ylabel(): axes for axes in figure.axes}
    (line,) = panels["driven [m or rad]"].get_lines()
    assert line.get_label() == "cross.x" and line.get_ydata()[-1] == pytest.approx(0.2)
    assert [x.get_label() for x in panels["driven length [m]"].get_lines()] == ["line"]
    figure = view.plot(run)
    assert "driven [m or rad]" not in [axes.get_ylabel() for axes in figure.axes]


def many_strings(n: int) -> StillLife:
    """A ball on strings with long names, each on a winch of its own."""
    rows = "".join(
        f"  - {{name: columbine_shoulder_{k}, path: [{{body: ball}}, {{world: [0, 0, 1]}}], "
        "length: driven}\n"
        for k in range(n)
    )
    return StillLife(loads(BALL + rows))


@pytest.mark.parametrize(
    "m", [bundled_still_life("marionette_bar"), many_strings(1), many_strings(21)]
)
def test_legends_are_inside_the_figure(m, tmp_path):
    """Regression: the legend of 21 inputs was cut off at the right."""
    figure = view.plot(swinging_motion(m), tmp_path / "plot.png", scale=1.0)
    boxes = [axes.get_legend() for axes in figure.axes if axes.get_legend() is not None]
    assert boxes
    for axes in figure.axes:
        box = axes.get_legend()
        if box is not None:
            extent, panel = box.get_window_extent(), axes.get_window_extent()
            assert panel.x1 < extent.x0 and extent.x1 < figure.bbox.x1
            assert extent.height < 1.1 * panel.height
    assert len({round(axes.get_position().x1, 9) for axes in figure.axes}) == 1
