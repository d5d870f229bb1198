"""Properties of a puppet: values, round trips, names, parameters, schema."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation
from tests.puppet.strategies import files

from fantoccini import puppets
from fantoccini.base.documents import Orientation
from fantoccini.base.documents.located import Located, validate
from fantoccini.model.puppet import Body, Box, Joint, Puppet, json_schema, load, loads

pytestmark = pytest.mark.medium

ARM = """\
puppet: arm
gravity: [0, 0, {parameter: g, value: -9.81}]
bodies:
  - name: upper
    joint: {name: shoulder, type: revolute, axis: [0, -2, 0], damping: 1e-3}
    mass: {parameter: m1, value: 0.5}
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
  - name: lower
    parent: upper
    joint: {type: ball, at: [0.3, 0, 0]}
    mass: {parameter: m2, value: 0.25}
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
    com: [{parameter: m1, value: 0.5}, 0, 0]
strings:
  - name: hand
    path: [{body: lower}, {driven: [x], at: [0.3, 0, 1]}]
    length: driven
pose: {shoulder: 90 deg, lower.rotation: [0, 0, 3.141592653589793], hand.length: 1}
"""


def test_values_are_normalised() -> None:
    arm = loads(ARM)
    assert arm.bodies[0].joint.axis == (0.0, -1.0, 0.0)
    assert arm.pose["shoulder"] == np.pi / 2
    np.testing.assert_allclose(arm.pose["lower.rotation"], (0, 0, 0, 1), atol=1e-15)
    assert arm.strings[0].length == "driven"
    assert arm.bodies[0].joint.at == (0.0, 0.0, 0.0)


def test_parameters_come_in_the_order_of_the_file_s_sections() -> None:
    assert loads(ARM).parameters() == {"g": -9.81, "m1": 0.5, "m2": 0.25}
    assert list(loads(ARM).parameters()) == ["g", "m1", "m2"]


def test_names_are_located() -> None:
    arm = loads(ARM, "arm.yaml")
    assert [arm.locate(n)[1] for n in ("upper", "shoulder", "lower", "hand")] == [4, 5, 8, 15]
    assert arm.locate("nobody") == ("arm.yaml", None)
    assert arm.name == "arm"


@pytest.mark.parametrize("name", puppets.names())
def test_bundled_puppets_survive_a_round_trip(name: str) -> None:
    puppet = load(puppets.path(name))
    again = loads(puppet.to_yaml())
    assert again == puppet
    assert again.canonical() == puppet.canonical()
    assert hash(again) == hash(puppet)
    assert pickle.loads(pickle.dumps(puppet)) == puppet


@settings(max_examples=60, deadline=None)
@given(files())
def test_any_puppet_survives_a_round_trip(data: dict) -> None:
    puppet = validate(Puppet, Located(data))
    again = loads(puppet.to_yaml())
    assert again == puppet
    assert again.to_yaml() == puppet.to_yaml()
    assert again.canonical() == puppet.canonical()
    full = puppet.expanded()
    assert loads(full.to_yaml()) == full
    assert full.expanded() is full


def test_the_canonical_text_tells_puppets_apart() -> None:
    texts = {loads(ARM.replace("0.5", x)).canonical() for x in ("0.5", "0.50", "0.51")}
    assert len(texts) == 2


def test_a_puppet_can_be_built_in_python() -> None:
    body = Body(
        name="a",
        joint=Joint(type="revolute", axis=np.array([0.0, 3.0, 0.0])),
        shapes=[Box(size=(1, 2, 3), mass=1)],
    )
    puppet = Puppet(puppet="p", bodies=[body])
    assert puppet.bodies[0].joint.axis == (0.0, 1.0, 0.0)
    assert puppet.locate("a") == ("<python>", None)
    assert loads(puppet.to_yaml()) == puppet


ORIENTATIONS = [
    ({"quaternion": (np.cos(0.3), 0, 0, np.sin(0.3))}, "z", 0.6),
    ({"axis": (0, 0, 5), "angle": 0.6}, "z", 0.6),
    ({"rpy": (0, "30 deg", 0)}, "y", np.pi / 6),
    ({"rpy": ("0.2 rad", 0, 0)}, "x", 0.2),
]


@pytest.mark.parametrize(("given", "axis", "angle"), ORIENTATIONS)
def test_orientations(given: dict, axis: str, angle: float) -> None:
    expected = Rotation.from_euler(axis, angle).as_matrix()
    np.testing.assert_allclose(Orientation(**given).matrix, expected, atol=1e-15)


def test_rpy_turns_about_fixed_axes() -> None:
    expected = Rotation.from_euler("xyz", (0.1, 0.2, 0.3)).as_matrix()
    np.testing.assert_allclose(Orientation(rpy=(0.1, 0.2, 0.3)).matrix, expected, atol=1e-15)


def test_the_json_schema_knows_every_key_and_describes_it() -> None:
    schema = json_schema()
    json.dumps(schema)
    assert set(schema["properties"]) == {
        "puppet",
        "gravity",
        "bodies",
        "strings",
        "springs",
        "drives",
        "mirror",
        "pose",
        "contact",
        "obstacles",
        "floor",
        "members",
        "props",
        "rig",
        "rigs",
    }
    assert set(schema["required"]) == {"puppet", "bodies"}
    kinds = schema["$defs"]["Joint"]["properties"]["type"]["enum"]
    assert kinds == ["fixed", "revolute", "prismatic", "translation", "ball", "free"]
    for name, part in {**schema["$defs"], "Puppet": schema}.items():
        assert part["additionalProperties"] is False, name
        undescribed = [k for k, v in part["properties"].items() if "description" not in v]
        assert undescribed in ([], ["type"]), name
    assert "from" in schema["$defs"]["Capsule"]["properties"]
