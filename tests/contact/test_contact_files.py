"""The key `contact` of puppet and scene files, and the pairs that it selects."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import fantoccini as fan
from fantoccini.app.cli.app import app
from fantoccini.base.errors import PuppetError
from fantoccini.model.puppet import loads

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

ARM = """
puppet: arm
floor: 0
contact: CONTACT
obstacles:
- {name: post, type: sphere, radius: 0.1, at: [2, 0, 0]}
bodies:
- name: upper
  joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, 1]}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0.3, 0, 0], radius: 0.02, mass: 1}]
- name: fore
  parent: upper
  joint: {type: revolute, axis: [0, 1, 0], at: [0.3, 0, 0]}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0.3, 0, 0], radius: 0.02, mass: 1}]
- name: hand
  parent: fore
  joint: {type: revolute, axis: [0, 1, 0], at: [0.35, 0, 0]}
  shapes: [{type: sphere, radius: 0.03, mass: 0.2}]
"""
BALL = """
puppet: PUPPET
contact: CONTACT
bodies:
- name: body
  joint: {type: free}
  shapes: [{type: sphere, radius: 0.1, mass: 1}]
"""


def arm(contact: str) -> fan.Marionette:
    return fan.loads(ARM.replace("CONTACT", contact))


def names(marionette: fan.Marionette) -> set[tuple[str, str]]:
    contacts = marionette.contacts
    assert contacts is not None
    return set(contacts.names)


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        ("3", "contact: found 3; needed: a mapping"),
        ("{friction: -1}", "contact.friction: found -1; needed: a number of at least 0"),
        ("{restitution: 1.5}", "contact.restitution: found 1.5"),
        ("{meets: [roof]}", "contact.meets[0]: found 'roof'; allowed: floor, obstacles, props"),
        ("{pairs: [{between: [hand, floor]}]}", "this pair changes nothing"),
        (
            "{pairs: [{between: [hand, flor], meet: false}]}",
            "contact.pairs[0].between[1]: no body, obstacle, prop or puppet is called 'flor'; "
            "did you mean 'floor'?",
        ),
    ],
)
def test_a_mistake_is_located(contact, message):
    with pytest.raises(PuppetError) as error:
        loads(ARM.replace("CONTACT", contact))
    assert message in str(error.value)
    assert "<string>:4" in str(error.value)


def test_info_lists_contact_pairs(tmp_path):
    (tmp_path / "arm.yaml").write_text(ARM.replace("CONTACT", "{meets: [floor], friction: 0.25}"))
    shown = CliRunner().invoke(app, ["info", str(tmp_path / "arm.yaml")])
    assert "contact with floor: friction 0.25, restitution 0, 0 pairs" in shown.stdout


def test_neighbours_do_not_touch_and_all_others_do():
    assert arm("false").contacts is None
    links = {("hand", "upper")}
    standing = {(body, o) for body in ("upper", "fore", "hand") for o in ("post", "floor")}
    assert names(arm("true")) == links | standing


def test_groups_and_pairs_select_contacts_and_friction():
    chosen = arm(
        "{friction: 0.2, meets: [floor], pairs: [{between: [floor, hand], friction: 0.9, "
        "restitution: 0.3}, {between: [upper, floor], meet: false}, {between: [post, fore], "
        "restitution: 1}]}"
    ).contacts
    rules = zip(chosen.friction, chosen.restitution, strict=True)
    rules_of_pairs = dict(zip(chosen.names, rules, strict=True))
    assert rules_of_pairs == {
        ("fore", "floor"): (0.2, 0.0),
        ("hand", "floor"): (0.9, 0.3),
        ("fore", "post"): (0.2, 1.0),
    }


def test_bodies_of_one_tree_that_overlap_at_the_pose_of_the_file_do_not_touch():
    """The hand is folded back onto the upper arm."""
    near = ARM.replace("CONTACT", "true").replace("at: [0.35, 0, 0]", "at: [0.25, 0, 0]")
    assert ("hand", "upper") in names(fan.loads(near))
    assert ("hand", "upper") not in names(fan.loads(near + "pose: {fore: 179 deg}\n"))


def scene(tmp_path, first: str, second: str, own: str = "") -> str:
    for name, contact in (("a", first), ("b", second)):
        text = BALL.replace("PUPPET", name).replace("CONTACT", contact)
        (tmp_path / f"{name}.yaml").write_text(text)
    path = tmp_path / "scene.yaml"
    path.write_text(
        f"scene: two\nfloor: 0\n{own}puppets:\n- {{name: a, puppet: a.yaml}}\n"
        "- {name: b, puppet: b.yaml, at: [1, 0, 0]}\n"
        "props:\n- {name: crate, shapes: [{type: box, size: [0.1, 0.1, 0.1], mass: 1}]}\n"
    )
    return str(path)


def test_a_scene_takes_the_rules_of_its_puppets_or_has_its_own(tmp_path):
    pairs = "{pairs: [{between: [body, floor], friction: 0.9}]}"
    shared = fan.load(scene(tmp_path, pairs, "true")).contacts
    assert set(shared.names) == {
        ("a.body", "floor"),
        ("b.body", "floor"),
        ("b.body", "a.body"),
        ("crate", "a.body"),
        ("crate", "b.body"),
        ("crate", "floor"),
    }
    friction = dict(zip(shared.names, shared.friction, strict=True))
    assert friction["a.body", "floor"] == 0.9
    assert friction["b.body", "floor"] == 0.5
    with pytest.raises(PuppetError, match="a, b differ in contact; give the scene its own"):
        fan.load(scene(tmp_path, "{friction: 0.1}", "true"))
    own = "contact: {friction: 0.7, pairs: [{between: [a, crate], meet: false}]}\n"
    scene_made = fan.load(scene(tmp_path, "{friction: 0.1}", "true", own)).contacts
    assert np.all(scene_made.friction == 0.7)
    assert ("crate", "a.body") not in scene_made.names


def staged(places: dict, pair: dict) -> fan.Marionette:
    """Arms at places, a crate and a wall, with a pair that has its own rule."""
    arm = loads(ARM.replace("CONTACT", "true"))
    box = {"type": "box", "size": [0.1, 0.1, 0.1]}
    return fan.Marionette(
        fan.Scene.model_validate(
            {
                "scene": "s",
                "contact": {"friction": 0.2, "pairs": [pair]},
                "puppets": [
                    {"name": name, "puppet": arm} | place for name, place in places.items()
                ],
                "props": [{"name": "crate", "at": [9, 0, 1], "shapes": [box | {"mass": 1}]}],
                "obstacles": [box | {"name": "wall", "at": [0, 9, 0]}],
            }
        )
    )


@pytest.mark.parametrize("between", ["p floor", "crate p", "p p", "p wall", "crate wall"])
@pytest.mark.parametrize("rule", [{"friction": 0.9}, {"meet": False}])
@pytest.mark.parametrize(
    "place", [{}, {"at": [2, 0, 0], "orientation": {"axis": [0, 0, 1], "angle": 1}}]
)
def test_a_puppets_name_has_one_meaning_in_any_company(between, rule, place):
    """Names of parts have no prefix in a scene of one puppet."""
    pair = {"between": between.split()} | rule
    rules_of_scenes = []
    for others in {}, {"q": {"at": [50, 0, 0]}}:
        contacts = staged({"p": place} | others, pair).contacts
        rubs = zip(contacts.names, contacts.friction, strict=True)
        rules_of_scenes.append(
            {
                frozenset(name.removeprefix("p.") for name in names): friction
                for names, friction in rubs
                if not any(name.startswith("q.") for name in names)
            }
        )
    assert rules_of_scenes[0] == rules_of_scenes[1]
    unruled = staged({"p": place}, {"between": ["floor", "floor"], "meet": False}).contacts
    assert len(rules_of_scenes[0]) < len(unruled.names) or 0.9 in rules_of_scenes[0].values()


def test_a_puppet_named_as_one_of_its_bodies_is_in_no_pair_by_that_name():
    text = (
        "scene: s\nfloor: 0\ncontact:\n  pairs:\n  - {between: [WHAT, floor], meet: false}\n"
        "puppets:\n- {name: torso, puppet: marionette}\n"
    )
    with pytest.raises(PuppetError, match=r"<string>:7: puppets\[0\].name: the name 'torso' is"):
        fan.loads(text.replace("WHAT", "torso"))
    left = fan.loads(text.replace("WHAT", "skull")).contacts.names
    assert ("torso", "floor") in left and ("skull", "floor") not in left


def test_an_unknown_name_in_a_scenes_pair_is_located(tmp_path):
    own = "contact:\n  pairs:\n" + "".join(
        f"  - {{between: [a, {name}], friction: 1}}\n" for name in ("floor", "crat")
    )
    with pytest.raises(PuppetError) as error:
        fan.load(scene(tmp_path, "true", "true", own))
    text = "scene.yaml:6: contact.pairs[1].between[1]: no body, obstacle, prop or puppet is called "
    assert text + "'crat'; did you mean 'crate'?" in str(error.value)


TWINS = """
puppet: twins
floor: 0
mirror: {plane: xz, from: left, to: right}
contact: {pairs: [{between: [left_foot, floor], friction: 0.9}]}
bodies:
- {name: left_foot, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
pose: {left_foot.y: 0.2}
"""


def test_the_twin_of_a_pair_has_its_rules():
    contacts = fan.loads(TWINS).contacts
    friction = dict(zip(contacts.names, contacts.friction, strict=True))
    assert friction["right_foot", "floor"] == friction["left_foot", "floor"] == 0.9
    assert friction["right_foot", "left_foot"] == 0.5


def test_floor_is_the_name_of_the_floor():
    with pytest.raises(PuppetError, match="found 'floor', which is the floor's name in contact"):
        loads(ARM.replace("CONTACT", "true").replace("name: post", "name: floor"))


def test_a_body_on_a_fixed_joint_belongs_to_its_parent():
    """The cuff, fixed near the elbow, does not touch the upper arm across the joint."""
    cuff = """
- name: cuff
  parent: fore
  joint: {type: fixed, at: [0.06, 0, 0]}
  shapes: [{type: sphere, radius: 0.01, mass: 0.01}]
"""
    pairs = names(fan.loads(ARM.replace("CONTACT", "true") + cuff))
    assert not {("cuff", "upper"), ("cuff", "fore")} & pairs
    assert not [pair for pair in pairs if set(pair) == {"cuff", "hand"}]
    assert ("cuff", "floor") in pairs


def test_the_place_of_a_puppet_does_not_change_its_contacts():
    """Two free bodies overlap slightly at the pose of their file: they may touch nevertheless."""
    pair = loads("""
puppet: pair
contact: true
bodies:
- {name: a, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
pose: {b.x: 0.1999}
""")
    for at in ([0, 0, 0], [1, 0, 0]):
        member = {"name": "one", "puppet": pair, "at": at}
        scene_made = fan.Marionette(fan.Scene.model_validate({"scene": "s", "puppets": [member]}))
        assert ("b", "a") in names(scene_made)


def test_false_of_one_puppet_and_rules_of_another_differ(tmp_path):
    with pytest.raises(PuppetError, match="a, b differ in contact"):
        fan.load(scene(tmp_path, "false", "true"))
    assert fan.load(scene(tmp_path, "false", "false")).contacts is None


def test_pairs_name_an_obstacle_that_two_copies_share(tmp_path):
    (tmp_path / "arm.yaml").write_text(
        ARM.replace("CONTACT", "{pairs: [{between: [hand, post], friction: 0.9}]}")
    )
    (tmp_path / "scene.yaml").write_text(
        "scene: two\npuppets:\n- {name: a, puppet: arm.yaml}\n- {name: b, puppet: arm.yaml}\n"
    )
    contacts = fan.load(tmp_path / "scene.yaml").contacts
    friction = dict(zip(contacts.names, contacts.friction, strict=True))
    assert friction["a.hand", "a.post"] == friction["b.hand", "a.post"] == 0.9


def test_rules_need_no_compilation():
    """Friction does not affect compiled code."""
    first, other = (loads(ARM.replace("CONTACT", c)) for c in ("true", "{friction: 0.9}"))
    assert first.canonical(values=False) == other.canonical(values=False)
    assert first.canonical() != other.canonical()


def test_obstacles_and_floors_need_no_compilation():
    """They are arguments of a run."""
    body = "{name: a, shapes: [{type: sphere, radius: 1}]}"
    plain = f"puppet: ball\ncontact: true\nbodies: [{body}]\n"
    wall = "obstacles: [{name: wall, type: box, size: [1, 1, 1]}]\n"
    texts = {loads(plain + more).canonical(values=False) for more in ("", "floor: 0\n", wall)}
    assert len(texts) == 1
