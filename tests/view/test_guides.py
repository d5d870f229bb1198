"""Lines that a motion is compared with, in strips and films."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.image import imread

import fantoccini as fan
from fantoccini.model.puppet import bundled_files
from fantoccini.output import view
from fantoccini.output.view import theme

PUPPETS = bundled_files.path("hans").parent


@pytest.fixture(scope="module")
def made():
    arm = fan.puppets.arm2d()
    return arm, fan.simulate(arm, arm.rest(), t_end=0.2)


def hand_guide(times):
    """A line from the floor to the hand, one for each time."""
    ends = np.array([[-0.3, 0.0, 0.1], [0.3, 0.0, 0.9]])
    return [np.repeat(ends[None], len(times), axis=0)]


def guide_pixels(path) -> int:
    """Pixels of the colour of guides."""
    return int(np.sum(np.linalg.norm(imread(path)[..., :3] - theme.LIGHT.guide, axis=2) < 0.05))


def test_guides_are_drawn(made, tmp_path):
    arm, run = made
    pixels = []
    for name, guides in (("with", hand_guide), ("without", None)):
        path = view.strip(arm, run, tmp_path / f"{name}.png", n=2, times="even", guides=guides)
        pixels.append(guide_pixels(path))
    assert pixels[0] > 500 and pixels[1] == 0


@pytest.mark.parametrize("look", theme.THEMES.values(), ids=theme.THEMES)
def test_guides_have_no_colour_of_a_costume_or_a_tension(look):
    text = "".join(path.read_text("utf-8") for path in PUPPETS.glob("*.yaml"))
    costumes = [theme.rgb(colour) for colour in re.findall("#[0-9a-f]{6}", text)]
    assert len(costumes) > 100
    for colour in (*costumes, *look.tension_colours(), look.slack, look.handle, look.force):
        assert np.linalg.norm(colour - look.guide) > 0.4, theme.to_hex(colour)


def test_a_picture_frames_its_guides(made, tmp_path):
    arm, run = made

    def far(times):
        return [line + np.array([4.0, 0.0, 0.0]) for line in hand_guide(times)]

    path = view.strip(arm, run, tmp_path / "far.png", n=1, times=[0.1], guides=far)
    assert guide_pixels(path) > 50


@pytest.mark.parametrize(
    ("lines", "shape"), [(np.zeros((1, 3)), r"\(1, 3\)"), (np.zeros((2, 1, 3)), r"\(2, 1, 3\)")]
)
def test_lines_of_another_shape_are_refused(made, tmp_path, lines, shape):
    arm, run = made
    with pytest.raises(ValueError, match=rf"a guide has the shape {shape}; it must be \(2, n, 3\)"):
        view.strip(arm, run, tmp_path / "x.png", n=2, times="even", guides=lambda _: [lines])
    assert not (tmp_path / "x.png").exists()
