"""Arrows of contact forces in pictures."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import fantoccini as fan
from fantoccini.app.cli.app import app
from fantoccini.output.view import film, strip
from fantoccini.output.view.geometry import run_geometry

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

BLOCK = """
puppet: block
floor: 0
contact: CONTACT
bodies:
- {name: body, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 2}]}
"""


@pytest.fixture(scope="module")
def block() -> tuple[fan.Marionette, fan.Trajectory]:
    puppet = fan.loads(BLOCK.replace("CONTACT", "true"))
    x0 = puppet.state({"body.z": 0.06})
    return puppet, fan.simulate(puppet, x0, t_end=0.2, method="timestepping")


def test_arrows_begin_at_the_points_and_carry_the_weight(block):
    """They are proportional to the forces; arrows of impacts are shortened."""
    marionette, run = block
    geometry = run_geometry(marionette, run, forces=True)
    assert len(geometry.arrows) == len(run)
    assert len(geometry.arrows[0]) == 0
    last = geometry.arrows[-1]
    assert np.array_equal(last[:, 0], run.contact.at_sample(len(run) - 1).point)
    force, along = run.contact.at_sample(len(run) - 1).force, last[:, 1] - last[:, 0]
    assert np.allclose(along / np.linalg.norm(along[0]), force / np.linalg.norm(force[0]))
    lengths = np.linalg.norm(np.diff(np.concatenate(geometry.arrows), axis=1), axis=2)
    assert lengths.max() <= 0.3 * geometry.size + 1e-12
    assert np.mean(lengths < 0.1501 * geometry.size) >= 0.9
    assert run_geometry(marionette, run).arrows == ()


def test_strips_and_films_draw_them(block, tmp_path):
    marionette, run = block
    sizes = []
    for forces in (False, True):
        path = strip(
            marionette, run, tmp_path / f"{forces}.svg", n=2, times=[0.0, 0.2], forces=forces
        )
        sizes.append(path.read_text().count("<path"))
    assert sizes[1] > sizes[0]
    video = film(marionette, run, tmp_path / "block.mp4", fps=10, size=(160, 120), forces=True)
    assert video.stat().st_size > 0


def test_the_command_line_draws_them(tmp_path, monkeypatch):
    """The command says what the arrows need, and where the option applies."""
    monkeypatch.chdir(tmp_path)
    for name, contact in (("block", "true"), ("free", "false")):
        (tmp_path / f"{name}.yaml").write_text(BLOCK.replace("CONTACT", contact))
    about = ["--method", "timestepping", "--duration", "0.1", "--forces"]
    done = CliRunner().invoke(app, ["simulate", "block.yaml", *about, "--out", "a.png"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a.png").stat().st_size > 0
    numbers = CliRunner().invoke(app, ["simulate", "block.yaml", *about, "--out", "a.csv"])
    assert numbers.exit_code == 2
    assert "applies to a strip or a film" in numbers.output
    free = CliRunner().invoke(app, ["simulate", "free.yaml", *about, "--out", "b.png"])
    assert free.exit_code == 2


def test_forces_need_a_run_with_contact_and_matplotlib(block, tmp_path):
    marionette, run = block
    with pytest.raises(ValueError, match="use renderer='matplotlib'"):
        film(marionette, run, tmp_path / "a.mp4", renderer="pyvista", forces=True)
    free = fan.loads(BLOCK.replace("CONTACT", "false"))
    falls = fan.simulate(free, free.state({"body.z": 1.0}), t_end=0.1)
    with pytest.raises(ValueError, match="no contact"):
        strip(free, falls, tmp_path / "a.png", forces=True)
