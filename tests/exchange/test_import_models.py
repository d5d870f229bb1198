"""The models of gymnasium, dm_control and MuJoCo's menagerie have MuJoCo's accelerations."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from benchmarks.exchange import models

import fantoccini as fan
from fantoccini.output.exchange import import_model

pytestmark = pytest.mark.slow

OFF = {
    "actuators": "actuator",
    "equalities": "equality",
    "fluid": "option",
    "gravcomp": "body",
    "frictionloss": "joint",
    "springs of ball joints": "joint",
}
"""Disabled part of MuJoCo -> kind of the notes about it."""


@pytest.mark.parametrize("model", models.MODELS)
def test_accelerations_agree(model):
    """Errors are below 1e-9 of the largest. The report names everything disabled in MuJoCo."""
    agreement = models.measure_agreement(model, states=2)
    assert agreement.error < 1e-9
    kinds = {note.kind for note in import_model(models.path_of(model)).report}
    assert {OFF.get(word, "tendon") for word in agreement.off} <= kinds


def test_there_are_twenty_of_them():
    moving = {m for m in models.MODELS if mujoco.MjModel.from_xml_path(str(models.path_of(m))).nv}
    assert len(moving) >= 20


def test_ball_in_cup_hangs_on_its_string():
    """A limited tendon is a string of the same length."""
    path = models.path_of("dm_control/suite/ball_in_cup.xml")
    m = mujoco.MjModel.from_xml_path(str(path))
    puppet_import = import_model(path)
    assert f"length: {m.tendon_range[m.tendon('string').id, 1]:g}" in puppet_import.text


def test_compiled_accelerations_agree(tmp_path):
    path = models.path_of("gymnasium/envs/mujoco/assets/hopper.xml")
    m = mujoco.MjModel.from_xml_path(str(path))
    list(models.switch_off_features(m))
    puppet_import, d = import_model(path), mujoco.MjData(m)
    puppet_import.save(tmp_path / "hopper.yaml")
    hopper = fan.load(tmp_path / "hopper.yaml")
    q, v = models.mujoco_indices(puppet_import, m, hopper.coordinates)
    d.qpos[:], d.qvel[:] = [0.1, 1.3, 0.2, -0.3, -0.5, 0.4], [0.5, -0.2, 1.0, 2.0, -1.0, 0.7]
    mujoco.mj_forward(m, d)
    values = dict(zip(hopper.coordinates.q_D, d.qpos[q], strict=True))
    values |= {f"v:{n}": x for n, x in zip(hopper.coordinates.v_D, d.qvel[v], strict=True)}
    acc = hopper.forward_dynamics(hopper.state(values)).acc_D
    assert np.allclose(acc, d.qacc[v], rtol=0, atol=1e-9 * np.abs(d.qacc).max())
