"""Scene files: puppets, props, obstacles and a floor, read into one puppet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import fantoccini as fan
from fantoccini.base.errors import PuppetError
from fantoccini.model.puppet import Puppet, loads
from fantoccini.model.scene import assembled, json_schema, load, loads as loads_scene
from fantoccini.output.view.geometry import state_geometry

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

BODY = """
puppet: {name}
bodies:
  - {{name: a, joint: {{type: free}}, shapes: [{{type: sphere, radius: 0.1, mass: 1}}]}}
strings:
  - {{name: hand, path: [{{body: a}}, {{driven: [x, z], at: [0, 0, 1]}}], length: driven}}
  - {{name: peg, path: [{{body: a}}, {{world: [0, 0, 2]}}], length: {{parameter: l, value: 2}}}}
"""
DUET = """
scene: duet
floor: 0.1
puppets:
  - {name: one, puppet: a.yaml, at: [1, 0, 0]}
  - name: two
    puppet: a.yaml
    orientation: {axis: [0, 0, 1], angle: 90 deg}
    pose: {a.x: 0.5, hand.length: 0.9}
    parameters: {l: 3}
props:
  - {name: ball, shapes: [{type: sphere, radius: 0.1, mass: 0.2}], at: [0, 0, 0.2]}
obstacles:
  - {name: table, type: box, size: [1, 1, 0.1]}
"""


def puppet(name: str, rest: str = "") -> Puppet:
    """A puppet of one fixed body."""
    return loads(f"puppet: {name}\nbodies: [{{name: a}}]\n{rest}")


def written(folder: Path, text: str = DUET, body: str = BODY) -> Path:
    """Path of the scene's file, with its puppet in another file."""
    (folder / "a.yaml").write_text(body.format(name="arm"))
    (folder / "duet.yaml").write_text(text)
    return folder / "duet.yaml"


def test_a_scene_is_one_puppet_whose_names_begin_with_its_members(tmp_path) -> None:
    scene = fan.load(written(tmp_path))
    table = scene.coordinates
    assert scene.name == "duet" and scene.puppet.members == ("one", "two")
    assert table.q_K == (
        "one.hand.x",
        "one.hand.z",
        "one.hand.length",
        "two.hand.x",
        "two.hand.z",
        "two.hand.length",
    )
    assert table.q_D[:3] == ("one.a.x", "one.a.y", "one.a.z") and "ball.qw" in table.q_D
    x = scene.state({"one.a.z": 0.1})
    assert x["two.a.x"] == 0.5 and x["ball.z"] == 0.2 and x["two.hand.length"] == 0.9
    assert scene.tree.parameters == {"one.l": 2.0, "two.l": 3.0}
    assert scene.puppet.floor == 0.1 and [o.name for o in scene.puppet.obstacles] == ["table"]


def test_its_text_reads_as_an_equal_puppet(tmp_path) -> None:
    puppet = load(written(tmp_path))
    assert loads(puppet.to_yaml()) == puppet


def test_places_and_orientations_are_those_of_the_members(tmp_path) -> None:
    scene = fan.load(written(tmp_path))
    x = scene.state()
    tree = scene.tree
    links = [link.name for link in tree.links]
    poses = dict(zip(links, scene.poses(x.q_D, x.q_K), strict=True))
    assert np.allclose(poses["one.a"][:, 3], [1.0, 0.0, 0.0])
    assert np.allclose(poses["two.a"][:, 3], [0.0, 0.5, 0.0], atol=1e-15)
    points = scene.string_points(x.q_D, x.q_K)
    assert np.allclose(points["two.peg"][1], [0.0, 0.0, 2.0], atol=1e-15)
    assert np.allclose(points["one.hand"][1], [1.0, 0.0, 1.0])


def test_a_member_may_be_a_bundled_puppet_and_a_scene_of_one_keeps_short_names() -> None:
    scene = fan.loads("scene: solo\npuppets: [{name: pierrot, puppet: arm2d, at: [0, 1, 0]}]")
    assert scene.coordinates.q_D == fan.puppets.arm2d().coordinates.q_D
    assert scene.puppet.members == ()


def test_obstacles_of_a_puppet_stand_where_it_is_placed(tmp_path) -> None:
    table = "obstacles:\n  - {{name: wall, type: box, size: [2, 1, 1], at: [1, 0, 0]}}\n"
    table += "  - {{name: pole, type: capsule, from: [1, 0, 0], to: [1, 0, 1], radius: 0.1}}\n"
    puppet = load(written(tmp_path, body=BODY + table))
    stand = {o.name: o for o in puppet.obstacles}
    assert np.allclose(stand["one.wall"].at, [2.0, 0.0, 0.0])
    assert np.allclose(stand["two.wall"].at, [0.0, 1.0, 0.0])
    turned = stand["two.wall"].orientation.matrix @ [2.0, 1.0, 1.0]
    assert np.allclose(np.abs(turned), [1.0, 2.0, 1.0])
    assert np.allclose(stand["two.pole"].to, [0.0, 1.0, 1.0])


def test_meshes_are_found_from_the_scene(tmp_path) -> None:
    folder = tmp_path / "puppets" / "meshes"
    folder.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "box.stl")
    (folder.parent / "stone.yaml").write_text(
        "puppet: stone\nbodies: [{name: a, joint: {type: free}, shapes: "
        "[{type: mesh, file: meshes/box.stl, density: 1000}]}]\n"
    )
    scene = tmp_path / "scenes" / "s.yaml"
    scene.parent.mkdir()
    scene.write_text("scene: s\npuppets: [{name: stone, puppet: ../puppets/stone.yaml}]\n")
    marionette = fan.load(scene)
    assert marionette.mass == pytest.approx(6.0)
    assert marionette.puppet.bodies[0].shapes[0].path.is_file()


def test_puppets_built_in_python_make_a_scene() -> None:
    table = "obstacles: [{name: table, type: box, size: [1, 1, 1]}]"
    scene = fan.Scene.of(puppet("p", table), puppet("q", table), puppet("r", "floor: 1"))
    stage = assembled(scene)
    assert (stage.name, stage.floor) == ("p_q_r", 1.0)
    assert len(stage.obstacles) == 1  # the same table
    assert fan.Scene.of(puppet("p"), puppet("q"), name="stage").name == "stage"
    with pytest.raises(PuppetError, match="needs a puppet"):
        fan.Scene.of()


def test_a_hand_may_move_on_any_body() -> None:
    """`parent` of a driven end: the hand's axes turn with the carriage on which it moves."""
    text = BODY.format(name="p").replace("{driven: [x, z], at", "{driven: [x, z], parent: b, at")
    text = text.replace("bodies:", "bodies:\n  - {name: b, joint: {type: fixed, at: [3, 0, 0]}}")
    scene = fan.loads(text)
    x = scene.state()
    assert np.allclose(next(iter(scene.string_points(x.q_D, x.q_K).values()))[1], [3.0, 0.0, 1.0])


MISTAKES = [
    ("name: two", "name: one", "duet.yaml:5: puppets[0].name: the name 'one' is used 2 times"),
    ("name: ball", "name: world", "duet.yaml:12: props[0].name: found 'world'"),
    ("a.yaml, at", "b.yaml, at", "duet.yaml:5: puppets[0].puppet: found 'b.yaml'; there is no"),
    ("a.x: 0.5", "a.q: 0.5", "duet.yaml:9: puppets[1].pose.a.q: no coordinate is called 'a.q'"),
    ("{l: 3}", "{m: 3}", "duet.yaml:10: puppets[1].parameters.m: arm has no such parameter"),
    ("{l: 3}", "{l: -3}", "duet.yaml:10: puppets[1].parameters: strings[1].length: found -3"),
    ("floor", "flor", "duet.yaml:3: flor: this key is not known; did you mean 'floor'?"),
    ("shapes: [{type: sphere, radius: 0.1, mass: 0.2}]", "shapes: []", "duet.yaml:12: props[0].sh"),
    ("a.yaml, at", "duet.yaml, at", "duet.yaml:5: puppets[0].puppet: found 'duet.yaml', which is"),
    ("at: [1, 0, 0]", "at: [{parameter: x, value: 1}, 0, 0]", "duet.yaml:5: puppets[0].at[0]: fou"),
    (", mass: 0.2}", "}", "duet.yaml:12: props[0]: this prop has no mass; give it a mass"),
    ("puppets:", "puppet:", "duet.yaml:4: puppet: this key is not known; did you mean 'puppets'?"),
]


@pytest.mark.parametrize(("good", "bad", "message"), MISTAKES)
def test_mistakes_stand_at_their_lines(tmp_path, good: str, bad: str, message: str) -> None:
    path = written(tmp_path, DUET.replace(good, bad, 1))
    with pytest.raises(PuppetError) as caught:
        load(path)
    assert f"{tmp_path}/{message}" in str(caught.value)


def test_names_of_the_scene_are_not_those_of_its_only_puppets_parts(tmp_path) -> None:
    (tmp_path / "a.yaml").write_text(BODY.format(name="arm"))
    prop = "props: [{name: peg, shapes: [{type: sphere, radius: 1, mass: 1}]}]"
    for member, rest, message in (
        ("name: a, at: [1, 0, 0]", "", "2: puppets[0].name: the name 'a' is taken by a part"),
        ("name: one", prop, "3: props[0].name: the name 'peg' is taken by a part"),
    ):
        text = f"scene: s\npuppets: [{{{member}, puppet: a.yaml}}]\n{rest}\n"
        with pytest.raises(PuppetError) as caught:
            loads_scene(text, "s.yaml", tmp_path)
        assert str(caught.value).startswith(f"s.yaml:{message}")
    # Without a placement, the puppet's own name is not a body.
    assert loads_scene("scene: s\npuppets: [{name: a, puppet: a.yaml}]\n", folder=tmp_path)


@pytest.mark.parametrize(
    ("end", "length", "message"),
    [
        ("body: one.b", "1", r"duet.yaml:14: strings\[0\].path\[1\].body: no body is called"),
        ("driven: [x]", "1", r"duet.yaml:14: strings\[0\].path\[1\].driven: found a driven end"),
        ("body: one.a", "driven", r"duet.yaml:14: strings\[0\].length: found 'driven'"),
    ],
)
def test_strings_of_a_scene_are_checked_at_their_lines(tmp_path, end, length, message) -> None:
    string = f"strings:\n  - {{name: tie, path: [{{body: ball}}, {{{end}}}], length: {length}}}\n"
    with pytest.raises(PuppetError, match=message):
        load(written(tmp_path, DUET.replace("obstacles:", string + "obstacles:")))


def test_mistakes_in_a_members_file_are_its_own(tmp_path) -> None:
    with pytest.raises(PuppetError, match=r"a\.yaml:4: bodies\[0\].joint.type: found 'fre'"):
        load(written(tmp_path, body=BODY.replace("type: free", "type: fre")))


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (("p", ""), ("p", ""), "the name 'p' is used 2 times"),
        (("p", ""), ("q", "gravity: [0, 0, -1.62]"), r"differ in gravity: .* \(p\), .* \(q\)"),
        (("p", "floor: 0"), ("q", "floor: 1"), "differ in floor: .* give the scene its own"),
    ],
)
def test_puppets_that_do_not_go_together(first, second, message: str) -> None:
    with pytest.raises(PuppetError, match=message):
        assembled(fan.Scene.of(puppet(*first), puppet(*second)))


def test_things_are_located_where_they_are_written(tmp_path) -> None:
    puppet = load(written(tmp_path))
    assert puppet.locate("two.peg") == (str(tmp_path / "a.yaml"), 7)
    assert puppet.locate("ball") == (str(tmp_path / "duet.yaml"), 12)


def test_a_puppet_file_refuses_a_name_with_a_dot() -> None:
    for text in ("name: a.b", "name: b.a.c"):
        with pytest.raises(PuppetError, match="a name is up to 64 letters"):
            loads(BODY.format(name="p").replace("name: a,", f"{text},", 1))


def test_the_schema_names_the_keys() -> None:
    schema = json_schema()
    assert schema["title"] == "fantoccini scene"
    assert {"scene", "puppets", "props", "obstacles", "floor"} <= set(schema["properties"])


def test_loads_reads_both_kinds() -> None:
    assert loads_scene(BODY.format(name="p")).name == "p"
    assert loads_scene("scene: s\npuppets: [{name: a, puppet: arm2d}]").name == "s"


def test_the_frame_on_which_a_puppet_stands_is_not_drawn(tmp_path) -> None:
    scene = fan.load(written(tmp_path))
    drawn = state_geometry(scene, scene.state())
    frames = {i for i, link in enumerate(scene.tree.links) if link.name in ("one", "two")}
    assert len(frames) == 2 and not frames & {solid.link for solid in drawn.solids}
    assert len(drawn.names) == 4
