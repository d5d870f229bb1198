"""The models of gymnasium, dm_control and MuJoCo's menagerie have MuJoCo's accelerations."""

from __future__ import annotations

import mujoco
import pytest
from benchmarks.exchange import models

from fantoccini.exchange import import_model

OFF = {
    "actuators": "actuator", "equalities": "equality", "fluid": "option", "gravcomp": "body",
    "frictionloss": "joint", "springs of ball joints": "joint",
}  # fmt: skip
"""What is off in MuJoCo -> kind of the notes about it."""


@pytest.mark.parametrize("model", models.MODELS)
def test_accelerations_agree(model):
    """To 1e-9 of the largest. The report names whatever was off in MuJoCo."""
    found = models.agreement(model, states=2)
    assert found.error < 1e-9
    kinds = {note.kind for note in import_model(models.path_of(model)).report}
    assert {OFF.get(word, "tendon") for word in found.off} <= kinds


def test_there_are_twenty_of_them():
    moving = {m for m in models.MODELS if mujoco.MjModel.from_xml_path(str(models.path_of(m))).nv}
    assert len(moving) >= 20


def test_ball_in_cup_hangs_on_its_string():
    """A limited tendon is a string of the same length."""
    path = models.path_of("dm_control/suite/ball_in_cup.xml")
    m = mujoco.MjModel.from_xml_path(str(path))
    made = import_model(path)
    assert f"length: {m.tendon_range[m.tendon('string').id, 1]:g}" in made.text
