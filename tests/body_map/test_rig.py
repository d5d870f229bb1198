"""The section `rig` of a puppet file: entries that replace the guess, mirror, mistakes."""

from __future__ import annotations

import json
from typing import Any

import pytest

import fantoccini as fan
from fantoccini.base.errors import PuppetError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import rig_of
from fantoccini.model.puppet import Rig, json_schema, load, loads, plain

pytestmark = pytest.mark.medium


def plain_rig(**entries: Any) -> Any:
    """A rig with a few entries."""
    return Rig(**entries)


def test_a_mirrored_rig_gives_one_side():
    marionette = fan.puppets.marionette()
    rig = rig_of(marionette.body_map, marionette.puppet.mirror)
    assert [limb.bodies[0] for limb in rig.limbs] == ["upper_arm_left", "thigh_left"]
    assert rig.carrying == ("shoulder_left",)
    puppet = loads(json.dumps(plain(marionette.puppet) | {"rig": plain(rig)}))
    assert Marionette(puppet).body_map == marionette.body_map
    assert Marionette(puppet.expanded()).body_map == marionette.body_map


def test_a_member_keeps_the_rig_of_its_file():
    marionette = fan.puppets.marionette()
    puppet = marionette.puppet.model_copy(update={"rig": plain_rig(looking=("hand_left",))})
    two = [{"name": name, "puppet": puppet, "at": [k, 0, 0]} for k, name in enumerate("ab")]
    scene = Marionette(fan.Scene.model_validate({"scene": "two", "puppets": two}))
    assert scene.body_map_of("b").looking == ("b.hand_left", "b.hand_right")


def test_a_few_lines_change_the_guess():
    marionette = fan.puppets.marionette()
    entries = {"facing": (-1.0, 0.0, 0.0), "looking": ("hand_left",)}
    puppet = marionette.puppet.model_copy(update={"rig": plain_rig(**entries)})
    body_map = Marionette(puppet).body_map
    assert body_map.looking == ("hand_left", "hand_right")
    assert body_map.parts["arm_left"].bodies[0] == "upper_arm_right"


def test_the_map_does_not_change_the_compiled_code():
    puppet = load(fan.puppets.path("marionette"))
    other = puppet.model_copy(update={"rig": plain_rig(looking=("head",))})
    assert puppet.canonical(values=False) == other.canonical(values=False)
    assert puppet.canonical() != other.canonical()


RIG = """
puppet: sheet
bodies:
  - {name: trunk, joint: {type: free}, mass: 1, inertia: [1, 1, 1]}
  - {name: a, parent: trunk, mass: 1, inertia: [1, 1, 1], joint: {name: ja, type: ball}}
  - {name: b, parent: trunk, mass: 1, inertia: [1, 1, 1], joint: {name: jb, type: ball}}
strings:
  - {name: s, path: [{body: a}, {world: [0, 0, 1]}], length: 1}
rig:
"""


WRONG = {
    "carrying: [t]": "sheet.yaml:10: rig.carrying[0]: no string is called 't'",
    "head: {body: c, end: [0, 0, 1]}": "sheet.yaml:10: rig.head.body: no body is called 'c'",
    "limbs: [{kind: leg, side: left, bodies: [a], end: [0, 0, 1]}]": (
        "sheet.yaml:10: rig.limbs: found limbs without trunk and facing"
    ),
    "trunk: [trunk]": "sheet.yaml:10: rig.trunk: found trunk without limbs",
    "facing: [0, 0, 0]": "sheet.yaml:10: rig.facing: ",
    "{trunk: [trunk], facing: [1, 0, 0], limbs: [{kind: fin, bodies: [a], end: [0, 0, 1]}]}": (
        "sheet.yaml:10: rig.limbs[0].kind: found 'fin'; allowed: arm, leg, wing, tail, neck"
    ),
    "{trunk: [trunk], facing: [1, 0, 0], limbs: [{kind: leg, bodies: [a, b], end: [0, 0, 1]}]}": (
        "sheet.yaml:10: rig.limbs[0].bodies[1]: 'b' does not hang on 'a', the body before it"
    ),
    "{trunk: [trunk], facing: [1, 0, 0], limbs: [{kind: leg, bodies: [trunk], end: [0, 0, 1]}]}": (
        "sheet.yaml:10: rig.limbs[0].bodies[0]: the body 'trunk' belongs to the trunk already"
    ),
}


@pytest.mark.parametrize("entry", WRONG)
def test_mistakes_name_their_lines(entry):
    with pytest.raises(PuppetError) as error:
        loads(RIG + f"  {entry}\n", name="sheet.yaml")
    assert WRONG[entry] in str(error.value)


def test_a_limb_with_twins_has_a_side():
    data = plain(load(fan.puppets.path("marionette")))
    limb = {"kind": "arm", "bodies": ["upper_arm_left"], "end": [0, 0, 0]}
    data["rig"] = {"trunk": ["torso"], "facing": [1, 0, 0], "limbs": [limb]}
    with pytest.raises(PuppetError, match="bodies have mirrored twins; needed: left or right"):
        loads(json.dumps(data))


def test_the_json_schema_has_the_rig():
    schema = json_schema()
    assert "rig" in schema["properties"]
    assert schema["$defs"]["RigLimb"]["properties"]["kind"]["enum"] == [
        "arm",
        "leg",
        "wing",
        "tail",
        "neck",
    ]
