"""Lines that a motion is compared with, in strips and films."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.image import imread

import fantoccini as fan
from fantoccini.output import view


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
    red, green, blue = (255.0 * imread(path)[..., i] for i in range(3))
    return int(np.sum((green > red + 60.0) & (green > blue + 20.0)))


def test_guides_are_drawn(made, tmp_path):
    arm, run = made
    green = []
    for name, guides in (("with", hand_guide), ("without", None)):
        path = view.strip(arm, run, tmp_path / f"{name}.png", n=2, times="even", guides=guides)
        green.append(guide_pixels(path))
    assert green[0] > 500 > green[1]


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
