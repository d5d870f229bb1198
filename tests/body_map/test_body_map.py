"""Body maps: trunk, head and limbs are told from tree, shapes and strings, not from names."""

from __future__ import annotations

import json

import pytest
from tests.body_map import zoo
from tests.body_map.limbs import limbs

import fantoccini as fan
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import rig_of
from fantoccini.model.puppet import load, loads, plain

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]


@pytest.fixture(scope="module")
def puppets() -> dict[str, Marionette]:
    """Puppets of the tests, each with its library."""
    all_puppets = (zoo.hans(), zoo.waisted(), zoo.dachshund(), zoo.heron(), zoo.spider())
    return {puppet.name: Marionette(puppet) for puppet in all_puppets}


def test_names_do_not_matter(puppets):
    body_map = puppets["hans"].body_map
    assert body_map.trunk == ("rumpf",)
    assert body_map.head is not None and body_map.head.body == "kopf"
    assert limbs(body_map) == {
        "arm_left": (("oberarm_links", "unterarm_links"), ("armfaden_links",)),
        "arm_right": (("oberarm_rechts", "unterarm_rechts"), ("armfaden_rechts",)),
        "leg_left": (("oberschenkel_links", "unterschenkel_links"), ("beinfaden_links",)),
        "leg_right": (("oberschenkel_rechts", "unterschenkel_rechts"), ("beinfaden_rechts",)),
    }
    assert body_map.carrying == ("tragfaden_links", "tragfaden_rechts")
    assert (body_map.facing, body_map.doubts) == ((1.0, 0.0, 0.0), ())


def test_a_head_on_a_pair_of_strings_ends_in_the_plane_of_symmetry():
    """Its end was the tie of the right string."""
    text = fan.puppets.path("marionette").read_text()
    single = """  - name: head
    path: [{body: skull, at: [0, 0, 0.137]}, {driven: [x, y], at: [0, 0, 1.2]}]"""
    pair = """  - name: head_left
    path: [{body: skull, at: [0, 0.03, 0.137]}, {driven: [x, y], at: [0, 0.03, 1.2]}]"""
    assert single in text and "  head.length" in text
    text = text.replace(single, pair).replace("  head.length", "  head_left.length")
    body_map = Marionette(loads(text)).body_map
    assert body_map.looking == ("head_left", "head_right")
    assert body_map.head is not None
    assert body_map.head.end == pytest.approx((0.0, 0.0, 0.137), abs=1e-9)


def test_a_waist(puppets):
    body_map = puppets["waisted"].body_map
    assert body_map.trunk == ("pelvis", "chest")
    assert body_map.head is not None and body_map.head.body == "pate"
    assert limbs(body_map) == {
        "arm_left": (("ua_l", "fa_l"), ("h_l",)),
        "arm_right": (("ua_r", "fa_r"), ("h_r",)),
        "leg_left": (("ul_l", "ll_l"), ("k_l",)),
        "leg_right": (("ul_r", "ll_r"), ("k_r",)),
    }
    assert body_map.carrying == ("s_l", "s_r")
    assert (body_map.facing, body_map.doubts) == ((1.0, 0.0, 0.0), ())


def test_a_dachshund_that_looks_along_y(puppets):
    body_map = puppets["dachshund"].body_map
    assert body_map.facing == (0.0, 1.0, 0.0)
    assert body_map.head is not None and body_map.head.body == "face"
    assert limbs(body_map) == {
        "leg_front_left": (("paw1",), ("f",)),
        "leg_front_right": (("paw0",), ("e",)),
        "leg_hind_left": (("paw3",), ("h",)),
        "leg_hind_right": (("paw2",), ("g",)),
        "neck": (("nape",), ()),
        "tail": (("wag",), ("i",)),
    }
    assert (set(body_map.carrying), body_map.looking) == ({"b", "c", "d"}, ("a",))


def test_a_bird_that_looks_along_minus_x(puppets):
    body_map = puppets["heron"].body_map
    assert body_map.facing == (-1.0, 0.0, 0.0)
    assert body_map.head is not None and body_map.head.body == "crest"
    assert limbs(body_map) == {
        "wing_left": (("inner_r", "outer_r"), ("tip_r",)),
        "wing_right": (("inner_l", "outer_l"), ("tip_l",)),
        "leg_left": (("up_r", "down_r"), ("leg_r",)),
        "leg_right": (("up_l", "down_l"), ("leg_l",)),
        "neck": (("neck1", "neck2"), ()),
        "tail": (("fan",), ("tailstring",)),
    }
    assert body_map.looking == ("beakstring",)


def test_a_spider_on_six_legs_whose_abdomen_could_be_its_head(puppets):
    body_map = puppets["spider"].body_map
    ranks, sides = ("front", "middle", "hind"), ("left", "right")
    assert list(body_map.parts) == [f"leg_{rank}_{side}" for rank in ranks for side in sides]
    assert body_map.head is not None and body_map.head.body == "abdomen"
    assert body_map.doubt("head") == "it is as high as the trunk; it could be a tail"
    assert body_map.parts["leg_front_left"].bodies == ("femur2q", "tibia2q")
    assert body_map.parts["leg_hind_right"].bodies == ("femur0p", "tibia0p")


def test_a_puppet_turned_in_its_scene_has_the_same_map(puppets):
    turned = {
        "scene": "turned",
        "puppets": [
            {
                "name": "dog",
                "puppet": puppets["dachshund"].puppet,
                "orientation": {"axis": [0, 0, 1], "angle": 2.1},
            }
        ],
    }
    assert Marionette(fan.Scene.model_validate(turned)).body_map == puppets["dachshund"].body_map


@pytest.mark.parametrize("name", ["hans", "waisted", "dachshund", "heron", "spider"])
def test_a_map_written_into_the_file_is_read_back(name, puppets):
    marionette = puppets[name]
    rig = rig_of(marionette.body_map)
    again = Marionette(marionette.puppet.model_copy(update={"rig": rig})).body_map
    assert again.parts == marionette.body_map.parts
    assert (again.trunk, again.head) == (marionette.body_map.trunk, marionette.body_map.head)
    assert again.strings_of("trunk") == marionette.body_map.carrying
    assert again.doubts == ()


def test_a_lost_arm_is_doubtful():
    data = plain(load(fan.puppets.path("marionette")).expanded())
    gone = ("upper_arm_right", "forearm_right", "hand_right")
    for key in ("bodies", "strings"):
        data[key] = [part for part in data[key] if part["name"] not in gone]
    data["pose"] = {
        k: v for k, v in data["pose"].items() if k.split(".")[0] not in (*gone, "elbow_right")
    }
    body_map = Marionette(loads(json.dumps(data))).body_map
    assert "no twin" in body_map.doubt("arm_left")
    assert body_map.doubt("leg_left") == ""


def test_without_front_and_back_the_direction_is_doubtful():
    bodies = [
        zoo.body("plate", "world", [0, 0, 0], zoo.box([0.1, 0.1, 0.02]), joint={"type": "free"})
    ]
    strings = [zoo.string("m", "plate", [0, 0, 0.01])]
    for name, y in (("u", 0.05), ("v", -0.05)):
        bodies.append(zoo.body(name, "plate", [0, y, 0], zoo.rod([0, 0, -0.1]), joint=zoo.ball()))
        strings.append(zoo.string(f"lift_{name}", name, [0, 0, -0.09]))
    body_map = Marionette(zoo.puppet("plate", bodies, strings, {"plate": 0.2})).body_map
    assert "do not distinguish front and back" in body_map.doubt("facing")
    assert body_map.facing == (1.0, 0.0, 0.0)
