"""A file of several pieces has the contacts of separate shapes: a glTF of boxes and box shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.meshes.written import UP, Writer

import fantoccini as fan
from contact.bodies import stepped, thrown

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

BODY = """
puppet: table
floor: 0
contact: {friction: 0.4}
obstacles: [{name: post, type: box, size: [0.1, 1, 0.2], at: [0.7, 0, 0]}]
bodies:
- name: body
  joint: {type: free}
  shapes:
SHAPES
"""
BOXES = [
    ((0.75, 0.5, 0.0625), (0.0, 0.0, 0.25)),
    ((0.0625, 0.0625, 0.25), (-0.25, 0.125, 0.09375)),
    ((0.125, 0.0625, 0.25), (0.25, 0.0, 0.09375)),
]
"""Sizes and centres, z up: a table with two legs that touch its board. Binary fractions are
exact in files.
"""


def table(folder: Path, shapes: list[str], more: str = "") -> fan.Marionette:
    path = folder / "table.yaml"
    lines = "\n".join(f"  - {shape}" for shape in shapes)
    path.write_text(BODY.replace("SHAPES", lines) + more)
    return fan.load(path)


@pytest.fixture
def tables(tmp_path: Path) -> tuple[fan.Marionette, fan.Marionette]:
    """The table as boxes, and as one file."""
    writer = Writer()
    writer.boxes(*((np.abs(UP.T @ size), UP.T @ at) for size, at in BOXES))
    writer.save(tmp_path / "table.glb")
    boxes = [
        f"{{type: box, size: {list(size)}, at: {list(at)}, density: 40}}" for size, at in BOXES
    ]
    mesh = ["{type: mesh, file: table.glb, density: 40}"]
    return table(tmp_path, boxes), table(tmp_path, mesh)


def test_mass_and_centre_are_those_of_the_boxes(tables):
    boxes, mesh = tables
    assert mesh.mass == pytest.approx(boxes.mass, rel=1e-12)
    x = thrown(boxes, {"body.z": 1.0}, {"body.x": 0.4, "body.wx": 1.0, "body.wz": -2.0})
    for model in tables:
        # In free flight, accelerations depend on all of mass, centre and inertia.
        run = fan.simulate(model, x, t_end=0.2, method="event")
        if model is boxes:
            first = run
    assert np.max(np.abs(run.q_D[-1] - first.q_D[-1])) < 1e-10


def test_it_lands_slides_and_rests_as_the_boxes_do(tables):
    """Dropped with a turn, so that a leg lands first; it slides to the post and comes to rest."""
    runs = []
    for model in tables:
        x0 = thrown(model, {"body.z": 0.12}, {"body.x": 0.8, "body.wy": 0.6, "body.wx": 0.3})
        runs.append(stepped(model, x0, 1.0, 1e-3))
    boxes, mesh = runs
    landed = np.max(boxes.q_D[:, 2]) - np.min(boxes.q_D[:, 2])
    assert landed > 0.05 and np.ptp(boxes.q_D[:, 0]) > 0.05
    # Rounding grows through the impacts; then the table jams between floor and post, where rows of
    # contact yield slightly, and forces are one of many solutions.
    before = boxes.t < 0.8
    assert np.max(np.abs(boxes.q_D - mesh.q_D)[before]) < 1e-12
    assert np.max(np.abs(boxes.v_D - mesh.v_D)[before]) < 1e-10
    assert np.max(np.abs(boxes.q_D - mesh.q_D)) < 1e-6
    force = mesh.contact.force_on("body", len(mesh))[-1]
    assert force[2] == pytest.approx(9.81 * tables[1].mass, rel=1e-3)


def test_a_ball_rolls_between_the_legs(tables, tmp_path):
    """Pieces are not merged: a ball passes between the legs, impossible for a hull."""
    more = (
        "- name: ball\n  joint: {type: free}\n  shapes: [{type: sphere, radius: 0.05, mass: 0.1}]\n"
        "pose: {ball.y: -0.6, ball.z: 0.05, body.z: 0.032}\n"
    )
    (tmp_path / "with").mkdir()
    model = table(tmp_path, ["{type: mesh, file: table.glb, density: 40}"], more)
    assert "body" in [body.name for body in model.puppet.bodies]
    x0 = thrown(model, {}, {"ball.y": 2.0, "ball.wx": -40.0})
    run = stepped(model, x0, 0.5, 1e-3)
    y = run.q_D[:, list(run.coordinates.q_D).index("ball.y")]
    assert y[-1] > 0.3
