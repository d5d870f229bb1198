"""Pictures by pyvista: things at the places of the quick renderer, in colour, on the same floor."""

from __future__ import annotations

import sys
from ctypes.util import find_library

import imageio_ffmpeg
import numpy as np
import pytest
from matplotlib.image import imread

from fantoccini.base.errors import MissingLibraryError
from fantoccini.output import view
from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.drawing import PictureOptions, fit_layout
from fantoccini.output.view.geometry import run_geometry
from fantoccini.output.view.studio import Studio
from view.still_life import bundled_still_life, swinging_motion

SIZE = (300, 400)


@pytest.fixture
def installed():
    pytest.importorskip("pyvista", reason="the extra 'pyvista' is not installed")
    if not any(find_library(name) for name in ("EGL", "OSMesa")):
        pytest.skip("no Mesa: docs/install.md has the packages that pyvista draws with")


def test_without_pyvista_the_error_says_how_to_get_it(tmp_path, swung, monkeypatch):
    m, run = swung
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingLibraryError, match=r"fantoccini\[pyvista\]"):
        view.draw(m, run.state(0), tmp_path / "a.png", renderer="pyvista")
    with pytest.raises(MissingLibraryError, match=r"fantoccini\[pyvista\]"):
        view.film(m, run, tmp_path / "a.mp4", renderer="pyvista")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_renderer_is_refused(tmp_path, swung):
    m, run = swung
    with pytest.raises(ValueError, match="matplotlib or pyvista"):
        view.draw(m, run.state(0), tmp_path / "a.png", renderer="crayon")


def test_links_are_photographed_where_the_camera_projects_them(installed, swung):
    """The window is the sheet, and the viewport an off-centre part of it."""
    geometry = run_geometry(*swung)
    viewport = Viewport(20.0, 70.0, 240.0, 300.0)
    layout = fit_layout(geometry, viewport, PictureOptions.resolve())
    studio = Studio(geometry, layout, SIZE)
    shots = [studio.render(k) for k in (0, 20)]
    studio.close()
    assert shots[0].shape == (*SIZE[::-1], 4)
    assert np.any(shots[0] != shots[1])
    names = [link.name for link in geometry.tree.links]
    for k, shot in zip((0, 20), shots, strict=True):
        for solid in geometry.solids:
            pose = geometry.poses[k][solid.link]
            middle = pose[:, :3] @ solid.axis.mean(axis=0) + pose[:, 3]
            x, y, _ = layout.camera.project(middle, viewport)
            assert shot[int(SIZE[1] - y), int(x), 3] > 0.9, names[solid.link]
        # Nothing is outside of the silhouette's rectangle.
        assert shot[: SIZE[1] - 370, :, 3].max() == 0.0 and shot[:, 261:, 3].max() == 0.0


def test_a_picture_and_a_film(installed, tmp_path, swung):
    m, run = swung
    quick, photographed = (
        imread(
            view.draw(
                m,
                run.state(20),
                tmp_path / f"{renderer}.png",
                run.tension.values[20],
                size=SIZE,
                scale=1.0,
                renderer=renderer,
            )
        )[..., :3]
        for renderer in view.RENDERERS
    )
    apart = np.abs(quick - photographed).max(axis=2)
    assert 0.001 < np.mean(apart > 0.05) < 0.2  # only solids and strings differ
    film = view.film(m, run, tmp_path / "a.mp4", fps=5, size=(160, 120), renderer="pyvista")
    assert imageio_ffmpeg.count_frames_and_secs(str(film))[0] == 5


@pytest.mark.parametrize("name", ["string_pendulum", "crane", "marionette_bar"])
def test_other_puppets_are_photographed(installed, tmp_path, name):
    m = bundled_still_life(name)
    run = swinging_motion(m)
    target = view.draw(
        m, run.state(5), tmp_path / "a.png", size=SIZE, scale=1.0, theme="dark", renderer="pyvista"
    )
    assert np.ptp(imread(target)[..., :3]) > 0.3
