"""Pictures are not empty, have the right size, and show names as plain text."""

import dataclasses
import itertools
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread

from fantoccini.base.errors import PictureError
from fantoccini.model.puppet import loads
from fantoccini.motion.columns import Columns
from fantoccini.output import view
from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import compose_polygons
from fantoccini.output.view.drawing import PictureOptions, fit_layout, one_line
from fantoccini.output.view.films import Frames
from fantoccini.output.view.geometry import run_geometry, state_geometry
from fantoccini.output.view.pictures import strip_figure
from fantoccini.output.view.theme import DARK
from view.still_life import StillLife, bundled_still_life, swinging_motion

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

HOSTILE = r"$\frac{_^ \input{x} <b>&amp; 100%"


def edge_share(path):
    """Share of pixels that differ from their left neighbour."""
    pixels = imread(path)[..., :3]
    return np.mean(np.abs(np.diff(pixels, axis=1)).max(axis=2) > 0.02)


@pytest.mark.parametrize("name", ["arm2d", "crane", "marionette", "marionette_bar", "stand6"])
def test_a_state_is_drawn(tmp_path, name):
    m = bundled_still_life(name)
    run = swinging_motion(m)
    target = view.draw(
        m, run.state(20), tmp_path / "a.png", run.tension.values[20], size=(300, 400), scale=1.0
    )
    assert imread(target).shape[:2] == (400, 300)
    assert edge_share(target) > 0.005
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_strip_has_its_size(tmp_path, swung):
    target = view.strip(*swung, tmp_path / "a.png", n=4, size=(800, 400), scale=1.5)
    assert imread(target).shape[:2] == (600, 1200)
    assert edge_share(target) > 0.01


@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_vector_formats(tmp_path, swung, ending):
    target = view.strip(*swung, tmp_path / f"a.{ending}", n=3, times="even")
    head = target.read_bytes()[:100]
    assert head.startswith(b"<?xml" if ending == "svg" else b"%PDF")


def test_pose_times(swung):
    m, run = swung
    for how in ("poses", "events", "even"):
        times = view.pose_times(m, run, 6, how)
        assert len(times) == 6
        assert (np.diff(times) > 0.0).all()
        assert times[0] == 0.0
        assert times[-1] == 1.0
    caught = run.events[0].t
    assert np.abs(view.pose_times(m, run, 6, "events") - caught).min() < 0.01
    assert view.pose_times(m, run, 3, [0.5, 0.2]).tolist() == [0.2, 0.5]
    with pytest.raises(ValueError, match="poses, events, even"):
        view.pose_times(m, run, 5, "odd")


def test_a_strip_leaves_out_no_long_part(swung):
    """A nod in the first 2.7 s of 7 s was left out for the walk after it."""
    m, run = swung
    late = np.where(np.arange(len(run)) < 25, 0, np.arange(len(run)))
    still = replace(run, q_D=np.array(run.q_D)[late])  # it moves in the last part only
    for n in (4, 5, 6, 9):
        times = view.pose_times(m, still, n)
        assert len(times) == n
        assert np.diff(times).max() <= 1.5 / (n - 1) + 0.01


def test_the_scale_of_a_strip_tells_of_a_short_peak(tmp_path, swung, monkeypatch):
    """The scale ended at 4 N although the tension peaked at 8.87 N between the drawn times."""
    m, run = swung
    values = np.array(run.tension.values)
    t = np.array(run.t)
    values[17, 0], t[17] = 5.0 * values.max(), t[16] + 1e-7  # between the times of the scale
    t[18] = t[16] + 2e-7
    peaked = replace(run, t=t, tension=Columns(run.tension.names, values, "string"))
    options = PictureOptions.resolve("auto", "all", "light", None)
    texts = [x.get_text() for x in strip_figure(m, peaked, 3, "even", options).axes[0].texts]
    (end,) = [text for text in texts if text.endswith(" N")]
    assert end.startswith("\N{GREATER-THAN OR EQUAL TO} ")


def test_a_plot_shows_every_string(tmp_path, swung):
    _, run = swung
    figure = view.plot(run, tmp_path / "a.png", scale=1.0)
    assert imread(tmp_path / "a.png").shape[:2] == (1000, 1100)
    tension, modes = figure.axes[:2]
    assert [line.get_label() for line in tension.lines] == list(run.tension.names)
    assert [text.get_text() for text in modes.get_yticklabels()] == list(run.tension.names)


def test_plots_without_driven_lengths(tmp_path):
    m = bundled_still_life("marionette_bar")
    view.plot(swinging_motion(m), tmp_path / "a.svg")


BARE = (
    "puppet: bare\n"
    "bodies:\n"
    "  - {name: rod, joint: {type: revolute, axis: [0, 1, 0]}, shapes: [{type: capsule,\n"
    "     from: [0, 0, 0], to: [0, 0, -1], radius: 0.05, mass: 1}]}\n"
)


def test_missing_parts_of_a_puppet_are_not_plotted():
    figure = view.plot(swinging_motion(StillLife(loads(BARE))))
    assert [axes.get_ylabel() for axes in figure.axes] == ["energy [J]"]
    labels = [
        axes.get_ylabel()
        for axes in view.plot(swinging_motion(bundled_still_life("string_pendulum"))).axes
    ]
    assert labels == ["tension [N]", "", "energy [J]"]


def test_labels_of_small_numbers_stay_on_the_sheet():
    run = swinging_motion(bundled_still_life("arm2d"))
    run = dataclasses.replace(run, q_K=7.9e-4 + 1e-5 * run.q_K)
    figure = view.plot(run)
    figure.canvas.draw()
    for axes in figure.axes:
        assert axes.yaxis.label.get_window_extent().x0 > 0.0


def dangling_rod(factor):
    """A rod on a string, scaled by this factor, beside a ball at rest."""
    ball = f"type: sphere, radius: {0.1 * factor}, at: [{0.4 * factor}, 0, 0]"
    return StillLife(
        loads(
            "puppet: rod\n"
            f"obstacles: [{{name: ball, {ball}}}]\n"
            "bodies:\n"
            "  - {name: rod, joint: {type: free}, shapes: [{type: capsule, from: [0, 0, 0],\n"
            f"     to: [0, 0, {-0.4 * factor}], radius: {0.03 * factor}, mass: 1}}]}}\n"
            "strings:\n"
            "  - {name: line, path: [{body: rod},"
            f" {{driven: [x], at: [0, 0, {0.6 * factor}]}}],\n"
            "     length: driven}\n"
        )
    )


@pytest.mark.parametrize("factor", [1e-4, 1e-3, 50.0])
def test_size_does_not_matter(tmp_path, factor):
    """Pixels agree to rounding, except for the floor's lines, whose distances are round numbers."""
    pictures = []
    for each in (1.0, factor):
        m = dangling_rod(each)
        x = m.start()
        geometry, layout = still_layout(m, x)
        pictures.append([p.outline for p in compose_polygons(geometry, 0, layout)])
        view.draw(m, x, tmp_path / "a.png", size=(200, 200), scale=1.0)
        assert edge_share(tmp_path / "a.png") > 0.005
    assert len(pictures[0]) == len(pictures[1])
    for picture, other in zip(*pictures, strict=True):
        assert np.allclose(picture, other, atol=0.05)


def still_layout(m, x):
    geometry = state_geometry(m, x)
    return geometry, fit_layout(
        geometry, Viewport(0.0, 0.0, 300.0, 300.0), PictureOptions.resolve()
    )


def test_the_tension_bars_texts_keep_apart():
    """This holds for any largest tension and for small films."""
    m = bundled_still_life("marionette")
    for size in ((320, 240), (160, 120), (960, 720)):
        for factor in (1e-5, 1.0, 1000.0, 1e6):
            run = swinging_motion(m)
            peak = np.where(np.arange(len(run)) == 20, 1.7, 1.0)[:, None]
            tension = dataclasses.replace(run.tension, values=run.tension.values * factor * peak)
            geometry = run_geometry(m, dataclasses.replace(run, tension=tension))
            texts = Frames(geometry, PictureOptions.resolve(theme=DARK, size=size)).sheet.axes.texts
            boxes = [text.get_window_extent() for text in texts if text.get_text()]
            assert all(b.x0 >= 0.0 and b.x1 <= size[0] for b in boxes)
            assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_names_are_plain_text(tmp_path):
    m = StillLife(
        loads(
            "puppet: tame\n"
            "bodies:\n"
            "  - name: a_b_c\n"
            "    joint: {type: free}\n"
            "    shapes: [{type: sphere, radius: 0.1, mass: 1}]\n"
            "strings:\n"
            "  - {name: s_1_2, path: [{body: a_b_c}, {world: [0, 0, 1]}], length: 1.2}\n"
        )
    )
    m.tree = dataclasses.replace(m.tree, name=HOSTILE)
    run = swinging_motion(m)
    view.draw(m, run.state(0), tmp_path / "a.png", size=(200, 200))
    run = dataclasses.replace(run, puppet=SimpleNamespace(name=HOSTILE))
    assert view.plot(run, tmp_path / "b.png").texts[0].get_text() == HOSTILE
    view.strip(m, run, tmp_path / "c.svg", n=2)
    assert one_line("a\n\x1b[31m\tb  c") == "a [31m b c"
    assert len(one_line("x" * 200)) == 60


def test_bodies_without_shapes_and_springs_are_drawn(tmp_path):
    m = StillLife(
        loads(
            "puppet: bare\n"
            "bodies:\n"
            "  - {name: rod, joint: {type: revolute, axis: [0, 1, 0]}, mass: 1, com: [0, 0, -1],\n"
            "     inertia: [0.1, 0.1, 0.1]}\n"
            "springs:\n"
            "  - {name: s, between: [{body: rod, at: [0, 0, -1]}, {world: [1, 0, -1]}],\n"
            "     stiffness: 1, rest: 1}\n"
        )
    )
    x = (
        swinging_motion(bundled_still_life("arm2d"))
        .state(0)
        .replace(
            q_D=np.zeros(1),
            v_D=np.zeros(1),
            q_K=np.zeros(0),
            v_K=np.zeros(0),
            taut=np.zeros(0, bool),
        )
    )
    target = view.draw(m, x, tmp_path / "a.png", size=(300, 300), scale=1.0)
    assert edge_share(target) > 0.005


def test_unwritable_pictures_are_an_error(tmp_path, swung):
    m, run = swung
    with pytest.raises(ValueError, match=r"\.png, \.svg, \.pdf"):
        view.draw(m, run.state(0), tmp_path / "a.bmp")
    with pytest.raises(PictureError, match="no folder"):
        view.draw(m, run.state(0), tmp_path / "none" / "a.png")
    with pytest.raises(ValueError, match="focus"):
        view.draw(m, run.state(0), tmp_path / "a.png", focus="feet")


def test_matplotlib_and_ffmpeg_wait_for_the_first_picture():
    code = (
        "import sys, fantoccini.output.view\n"
        "late = ('matplotlib', 'imageio_ffmpeg', 'trimesh', 'pyvista')\n"
        "print([m for m in late if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_no_display_and_no_pyplot(tmp_path):
    code = (
        "import sys\n"
        "from view.still_life import bundled_still_life, swinging_motion\n"
        "from fantoccini.output import view\n"
        "m = bundled_still_life('string_pendulum')\n"
        f"view.draw(m, swinging_motion(m).state(0), {str(tmp_path / 'a.png')!r}, size=(100, 100))\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    environment = {"PYTHONPATH": ":".join(p for p in sys.path if p), "MPLBACKEND": "TkAgg"}
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
    )
    assert result.stdout.strip() == "False"
