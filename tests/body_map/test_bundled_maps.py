"""Body maps of the bundled puppets and scenes, and bundled machines that have none."""

from __future__ import annotations

import pytest
from tests.body_map.limbs import limbs

import fantoccini as fan
from fantoccini.base.errors import StateError, UnknownNameError

pytestmark = pytest.mark.medium

MARIONETTE = {
    "arm_left": (("upper_arm_left", "forearm_left"), ("hand_left",)),
    "arm_right": (("upper_arm_right", "forearm_right"), ("hand_right",)),
    "leg_left": (("thigh_left", "shin_left"), ("knee_left",)),
    "leg_right": (("thigh_right", "shin_right"), ("knee_right",)),
}


def test_the_bundled_marionette():
    body_map = fan.puppets.marionette().body_map
    assert body_map.trunk == ("torso",)
    assert body_map.head is not None
    assert (body_map.head.body, body_map.head.end) == ("skull", (0.0, 0.0, 0.137))
    assert limbs(body_map) == MARIONETTE
    assert body_map.parts["arm_left"].end == (0.0, 0.0, -0.09)
    x, y, z = body_map.parts["leg_right"].end
    assert abs(x) < 0.02 and abs(y) < 0.01 and z == pytest.approx(-0.14, abs=0.005)
    assert body_map.facing == (1.0, 0.0, 0.0)
    assert body_map.carrying == ("shoulder_left", "shoulder_right")
    assert body_map.looking == ("head",)
    assert (body_map.control, body_map.doubts) == ("", ())


def test_the_bundled_marionette_on_its_bar():
    body_map = fan.puppets.marionette_bar().body_map
    assert limbs(body_map) == MARIONETTE
    assert (body_map.control, body_map.doubts) == ("bar", ())


def test_the_stand_has_two_strings_to_a_hand_and_one_to_both_knees():
    body_map = fan.puppets.stand6().body_map
    assert body_map.strings_of("arm_left") == ("hand_inner_left", "hand_outer_left")
    assert body_map.strings_of("leg_left") == body_map.strings_of("leg_right") == ("knees",)
    assert body_map.carrying == ("hang_left", "hang_right")


@pytest.mark.slow
def test_scenes_have_a_map_for_each_puppet():
    assert limbs(fan.puppets.promenade().body_map) == MARIONETTE
    visit = fan.puppets.visit()
    with pytest.raises(StateError, match="pierrot, columbine"):
        _ = visit.body_map
    with pytest.raises(UnknownNameError, match="pierro"):
        visit.body_map_of("pierrotta")
    body_map = visit.body_map_of("columbine")
    assert body_map.carrying == ("columbine.shoulder_left", "columbine.shoulder_right")
    assert body_map.parts["arm_left"].bodies[1] == "columbine.forearm_left"
    assert body_map.facing == (1.0, 0.0, 0.0)  # in the frame of her torso, which is turned


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("arm2d", "no two branches of its bodies (upper, lower) are alike"),
        ("crane", "no two branches of its bodies (load) are alike"),
        ("string_pendulum", "has no body map"),
    ],
)
def test_cranes_and_arms_have_no_map_and_are_not_compiled(name, reason, monkeypatch):
    puppet = getattr(fan.puppets, name)()
    monkeypatch.setattr(type(puppet.libraries), "library", property(lambda self: 1 / 0))
    with pytest.raises(StateError) as error:
        _ = puppet.body_map
    assert reason in str(error.value)
    assert "give it under `rig`" in str(error.value)


FOUR = ("leg_front_left", "leg_front_right", "leg_hind_left", "leg_hind_right")
TWO = ("leg_left", "leg_right")
OTHERS = {
    "dachshund": (("chest", "rump"), (*FOUR, "tail"), ("withers", "croup")),
    "heron": (("body",), ("wing_left", "wing_right", *TWO, "neck"), ("back_left", "back_right")),
    "dragon": (
        ("chest", "hips"),
        ("wing_left", "wing_right", *FOUR, "neck", "tail"),
        ("withers_left", "loin", "withers_right"),
    ),
    "hans": (("chest", "pelvis"), ("arm_left", "arm_right", *TWO), ("collar_left", "collar_right")),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_animals_and_a_boy_with_a_waist(name):
    body_map = getattr(fan.puppets, name)().body_map
    trunk, parts, carrying = OTHERS[name]
    assert (body_map.trunk, tuple(body_map.parts)) == (trunk, parts)
    assert body_map.head is not None and body_map.head.body == "head"
    assert (body_map.facing, body_map.carrying) == ((1.0, 0.0, 0.0), carrying)
    for part, limb in body_map.parts.items():
        side = part.rpartition("_")[2]
        assert side not in ("left", "right") or limb.bodies[-1].endswith(side)
