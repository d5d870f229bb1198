"""A puppet as MJCF: accelerations, lengths and limits agree; unsupported parts are refused."""

from __future__ import annotations

import sys
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import ExchangeError, MissingLibraryError
from fantoccini.dynamics.mujoco import MuJoCoPuppet, mjcf
from harness import Model, State
from oracles import random_trees

FLAGS = mujoco.mjtDisableBit


def tree(seed: int, dof: int = 9) -> Model:
    """A random tree that MuJoCo supports: no driven ball or free joints, no quadratic drag."""
    description = random_trees.description(seed, dof, strings=3, limits=True, drag=True)
    for body in description["bodies"]:
        joint = body["joint"]
        body.get("drag", {}).pop("quadratic", None)
        if joint["type"] in ("ball", "free"):
            joint["driven"] = False
        if joint["type"] != "fixed" and not joint.get("driven"):
            joint["armature"] = 0.1
        if joint["type"] == "ball":
            joint["spring"] = {"stiffness": 3.0}
    return Model(description)


def evaluated_data(puppet: MuJoCoPuppet, x: State) -> mujoco.MjData:
    """MuJoCo's data at a state."""
    puppet.set_dynamic(x.q_D, x.v_D)
    puppet.set_driven(x.q_K, x.v_K, x.acc_K)
    puppet.evaluate()
    return puppet.data


@pytest.mark.parametrize("seed", range(8))
def test_accelerations_agree(seed):
    """Accelerations agree with strings and limits off; driven joints have the prescribed ones."""
    model = tree(seed, 6 + seed)
    puppet, x = MuJoCoPuppet(fan.Marionette(model.puppet), 1e-3), model.random(seed)
    puppet.model.opt.disableflags |= FLAGS.mjDSBL_LIMIT
    data, acc = evaluated_data(puppet, x), model.acceleration(x)
    assert np.abs(data.qacc[puppet.v_D] - acc).max() < 1e-7 * max(1.0, np.abs(acc).max())
    # The puppet's forces change a driven joint's acceleration by about a millionth.
    assert np.allclose(data.qacc[puppet.v_K], x.acc_K, atol=1e-4 * max(1.0, np.abs(acc).max()))


@pytest.mark.parametrize("seed", range(8))
def test_tendons_have_the_gaps_of_strings_and_limits(seed):
    """The tendon of a twist limit also lengthens at the rate of the limit's gap, scaled."""
    model, speed = tree(seed), 1e-6
    puppet, x = MuJoCoPuppet(fan.Marionette(model.puppet), 1e-3), model.random(seed)
    data, parts = evaluated_data(puppet, x), model.tree
    h, h_later = (model.call("rows", at)["h"] for at in (x, model.moved(x, speed)))
    max_lengths, hdot = puppet.model.tendon_range[:, 1], (h_later - h) / speed
    tendon_gaps = data.ten_length - max_lengths
    assert np.allclose(tendon_gaps[puppet.strings], h[: len(parts.strings)], atol=1e-10)
    for i, limit in enumerate(parts.limits, len(parts.strings)):
        if limit.side == "cone":
            t = puppet.model.tendon(limit.name).id
            assert (data.ten_length[t] ** 2 - max_lengths[t] ** 2) / 2 == pytest.approx(
                h[i], abs=1e-12
            )
    for i, t, scale in zip(
        puppet.twists.row_indices, puppet.twists.tendons, puppet.twists.scale, strict=True
    ):
        i += len(parts.strings)
        assert tendon_gaps[t] == pytest.approx(scale * h[i], abs=1e-12)
        assert data.ten_velocity[t] == pytest.approx(scale * hdot[i], abs=1e-4)


def test_fixed_ends_have_no_joints():
    """String ends are fixed to the world, and strings have their lengths at the given q_K."""
    arm = fan.puppets.arm3d()
    x = arm.rest({"hand.x": 0.3, "hand.length": 1.32})
    model = mujoco.MjModel.from_xml_string(mjcf(arm, x.q_K))
    assert (model.nq, model.nv, model.nu) == (5, 4, 0)
    data = mujoco.MjData(model)
    data.qpos[:] = x.q_D
    mujoco.mj_forward(model, data)
    assert model.tendon_range[model.tendon("hand").id, 1] == 1.32
    assert data.tendon("hand").length == pytest.approx(1.32, abs=1e-9)


def test_the_text_is_indented_and_its_numbers_keep_every_digit():
    mass = {"parameter": "m", "value": 1.0}
    bob = {"name": "bob", "joint": {"type": "ball"}, "mass": mass, "inertia": [1, 1, 1]}
    puppet = fan.loads(str({"puppet": "bob", "bodies": [bob]}))
    text = mjcf(puppet.with_parameters({"m": 1.0 / 3.0}))
    assert "\n    <body " in text
    assert ElementTree.fromstring(text).find(".//inertial").get("mass") == repr(1.0 / 3.0)


@pytest.mark.parametrize(
    ("string", "body", "named"),
    [
        ({"max_tension": 3.0}, {}, "line: has max_tension"),
        ({"restitution": 0.5}, {}, "line: has restitution"),
        ({}, {"drag": {"quadratic": 0.1}}, "bob: has quadratic drag"),
        ({}, {"parent": "bar"}, "grip: has a driven rotation"),
    ],
)
def test_an_unsupported_part_is_named_with_its_line(string, body, named):
    bar = {"name": "bar", "joint": {"name": "grip", "type": "free", "driven": True}}
    bob = {"name": "bob", "joint": {"type": "ball"}, "mass": 1.0, "inertia": [1, 1, 1], **body}
    ends = [{"body": "bob"}, {"world": [0, 0, 1]}]
    description = {
        "puppet": "odd",
        "bodies": [*([bar] if "parent" in body else []), bob],
        "strings": [{"name": "line", "path": ends, "length": 1.0, **string}],
    }
    with pytest.raises(ExchangeError, match=rf"^\S+:\d+: {named}: MuJoCo"):
        mjcf(fan.loads(str(description)))


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'fantoccini\[mujoco\]'"):
        MuJoCoPuppet(fan.puppets.arm3d(), 1e-3)
