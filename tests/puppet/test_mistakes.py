"""All mistakes of a file are reported at once, with file, line, key and the allowed values."""

from __future__ import annotations

import json

import pytest

from fantoccini.base.errors import PuppetError
from fantoccini.model.puppet import Body, Box, Joint, Puppet, load, loads

GOOD = """\
puppet: p
bodies:
  - name: arm
    joint: {type: revolute, axis: [0, 1, 0]}
    mass: 1
    inertia: [1, 1, 1]
"""


def mistakes(text: str | bytes) -> list[tuple[int | None, str, str]]:
    """(line, key, message) of each mistake in a text."""
    with pytest.raises(PuppetError) as caught:
        loads(text, "bad.yaml")
    for problem in caught.value.mistakes:
        assert problem.file == "bad.yaml"
        assert "\n" not in str(problem)
    return [(p.line, p.key, p.message) for p in caught.value.mistakes]


# Text after GOOD (six lines), then line, key and a part of the message.
AFTER = [
    ("flor: 1", 7, "flor", "not known; did you mean 'floor'?"),
    ("gravity: [0, 0]", 7, "gravity", "found 2 entries; needed: a list of 3 numbers"),
    ("gravity: down", 7, "gravity", "needed: a list of 3 numbers"),
    ("gravity: [0, 0, .inf]", 7, "gravity[2]", "found inf; needed: a finite number"),
    ("gravity:\n  - 0\n  - 0\n  - .nan", 10, "gravity[2]", "found nan; needed: a finite number"),
    ("floor: '1'", 7, "floor", "found '1'; needed: a number"),
    ("floor: true", 7, "floor", "found true; needed: a number"),
    ("floor: {parameter: f, value: 0}", 7, "floor", "a parameter cannot stand here"),
    ("springs: 3", 7, "springs", "found 3; needed: a list"),
    ("strings: [3]", 7, "strings[0]", "found 3; needed: a mapping"),
    # strings
    ("strings:\n  - name: s\n    length: 1", 8, "strings[0].path", "missing"),
    (
        "strings:\n  - name: s\n    length: 1\n    path: [{body: arm}]",
        10,
        "strings[0].path",
        "found a list of 1; needed: at least 2",
    ),
    (
        "strings:\n  - name: s\n    length: 1\n    path:\n      - {body: arm}\n      - {body: amr}",
        12,
        "strings[0].path[1].body",
        "no body is called 'amr'; did you mean 'arm'?",
    ),
    (
        "strings:\n  - name: s\n    length: 1\n    path: [{body: arm}, {body: arm, at: [0, 0, 0]}]",
        10,
        "strings[0].path",
        "all points lie on 'arm': its length is zero",
    ),
    (
        "strings:\n  - {name: s, length: 1, path: [{world: [0, 0, 1]}, {world: [0, 0, 2]}]}",
        8,
        "strings[0].path",
        "all points lie in the world: its length can never change",
    ),
    (
        "strings:\n  - {name: s, length: 1, path: [{world: [0, 0, 1]}, {body: arm}, {body: arm}]}",
        8,
        "strings[0].path[2]",
        "the same point as the one before it",
    ),
    (
        "strings:\n  - {name: s, length: 0, path: [{world: [0, 0, 1]}, {body: arm}]}",
        8,
        "strings[0].length",
        "found 0; needed: a positive number",
    ),
    (
        "strings:\n  - {name: s, length: drivn, path: [{world: [0, 0, 1]}, {body: arm}]}",
        8,
        "strings[0].length",
        "needed: a positive number [m], or driven",
    ),
    (
        "strings:\n  - {name: s, length: 1, path: [{driven: [y, x]}, {body: arm}]}",
        8,
        "strings[0].path[0].driven",
        "in this order",
    ),
    (
        "strings:\n  - {name: s, length: 1, path: [{driven: [x]}, {driven: [x]}]}",
        8,
        "strings[0].path[1].driven",
        "both ends are driven",
    ),
    (
        "strings:\n- {name: s, length: 1, path: [{body: arm}, {driven: [x]}, {world: [0, 0, 1]}]}",
        8,
        "strings[0].path[1].driven",
        "only a string's two ends",
    ),
    (
        "strings:\n  - {name: s, length: 1, path: [{body: world}, {body: arm}]}",
        8,
        "strings[0].path[0].body",
        "write {world: [x, y, z]} instead",
    ),
    (
        "strings:\n  - {name: s, length: 1, path: [{body: arm, world: [0, 0, 1]}, {body: arm}]}",
        8,
        "strings[0].path[0]",
        "exactly one of body, world, driven",
    ),
    (
        "strings:\n  - {name: s, wire: 1, length: 1, path: [{world: [0, 0, 1]}, {body: arm}]}",
        8,
        "strings[0].wire",
        "found 1; needed: true or false",
    ),
    (
        "strings:\n  - {name: arm, length: 1, path: [{world: [0, 0, 1]}, {body: arm}]}",
        8,
        "strings[0].name",
        "the name 'arm' is taken by bodies[0].name",
    ),
    # springs
    (
        "springs: [{name: k, between: [{driven: [x]}, {body: arm}], stiffness: 1, rest: 1}]",
        7,
        "springs[0].between[0].driven",
        "cannot be driven",
    ),
    (
        "springs: [{name: k, between: [{world: [0, 0, 1]}, {body: arm}], stiffness: -1, rest: 1}]",
        7,
        "springs[0].stiffness",
        "found -1; needed: zero or a positive number",
    ),
    # pose
    ("pose: {amr: 1}", 7, "pose.amr", "no coordinate is called 'amr'; did you mean 'arm'?"),
    ("pose: {arm: [1, 0, 0, 0]}", 7, "pose.arm", "needed: a number"),
    ("pose: {arm: 30 degrees}", 7, "pose.arm", "30 deg or 0.5 rad"),
    # mirror
    (
        "mirror: {plane: xz, from: left, to: right}",
        7,
        "mirror.from",
        "no body, string or spring has 'left' in its name",
    ),
    ("mirror: {plane: zx, from: ar, to: br}", 7, "mirror.plane", "found 'zx'; allowed: xy, yz, xz"),
    ("mirror: {plane: xz, from: arm, to: arm}", 7, "mirror.to", "for both from and to"),
    ("mirror: {plane: xz, from: arm, to: 'a b'}", 7, "mirror.to", "is not a valid name"),
    # obstacles
    ("obstacles: [{name: o, type: sphere, radius: 1, mass: 1}]", 7, "obstacles[0].mass", "nothing"),
    ("obstacles: [{name: arm, type: sphere, radius: 1}]", 7, "obstacles[0].name", "taken"),
    ("obstacles: [{type: sphere, radius: 0}]", 7, "obstacles[0].radius", "positive"),
    # YAML
    ("puppet: q", 7, "puppet", "given twice; the first is in line 1"),
    ("floor: !!float 1", 7, "floor", "tags are not read"),
    ("<<: {floor: 1}", 7, "['<<']", "merge keys are not read"),
    ("---\npuppet: q", 7, "", "a second document"),
    ("\tfloor: 1", 7, "bodies[0]", "not YAML: found a tab; YAML is indented with spaces"),
    (
        "colours: {a: #ff0000}",
        7,
        "colours.a",
        'found no value: # begins a comment; write "#ff0000"',
    ),
    ("colours:\n  a: #b53", 8, "colours.a", 'found no value: # begins a comment; write "#b53"'),
    ("floor: 1: 2", 7, "", "not YAML: mapping values are not allowed here"),
    ("? [a, b]\n: 1", 7, "", "a key must be a word"),
    ("floor: *missing", 7, "floor", "needs an anchor before it"),
]


@pytest.mark.parametrize(("text", "line", "key", "message"), AFTER)
def test_a_mistake_is_located(text: str, line: int, key: str, message: str) -> None:
    found_mistakes = mistakes(GOOD + text + "\n")
    assert [(a, b) for a, b, m in found_mistakes if message in m] == [(line, key)], found_mistakes


# Text of bodies[0] below its name (in line 3), then line, key, message.
IN_BODY = [
    ("mass: -1", 4, "mass", "found -1; needed: zero or a positive number"),
    ("mass: .nan", 4, "mass", "found nan; needed: a finite number"),
    ("mass: {parameter: m, value: -2}", 4, "mass", "found -2; needed: zero or a positive"),
    ("mass: {parameter: m}", 4, "mass.value", "missing"),
    ("mass: {parametr: m, value: 1}", 4, "mass.parametr", "did you mean 'parameter'?"),
    ("mass: {parameter: 'm*/', value: 1}", 4, "mass.parameter", "a name is up to 64 letters"),
    ("mass: 5 kg", 4, "mass", "found '5 kg'; needed: a number"),
    ("inertia: [1, 1, 2.1]", 4, "inertia", "larger than the sum of the other two"),
    ("inertia: [1, 1, -1]", 4, "inertia", "found a principal moment of -1"),
    ("inertia: [1, 1, 1, 3, 0, 0]", 4, "inertia", "found a principal moment of -2"),
    ("inertia: [1, 1, 1, 0]", 4, "inertia", "a list of 3 or 6 numbers"),
    ("parent: b", 4, "parent", "no body is called 'b'"),
    ("parent: a", 4, "parent", "form a cycle: a -> a"),
    ("drag: {linear: -1}", 4, "drag.linear", "found -1"),
    ("joint: {type: revolut}", 4, "joint.type", "did you mean 'revolute'?"),
    ("joint: {type: revolute}", 4, "joint.axis", "a revolute joint needs this key"),
    ("joint: {type: translation}", 4, "joint.axes", "a translation joint needs this key"),
    ("joint: {type: translation, axes: []}", 4, "joint.axes", "one or more of x, y, z"),
    ("joint: {type: translation, axes: [x, w]}", 4, "joint.axes[1]", "found 'w'; allowed: x, y, z"),
    ("joint: {axis: [0, 0, 1]}", 4, "joint.type", "missing"),
    ("at: [0, 0, 1]", 4, "at", "a body is placed by its joint: joint: {at: [x, y, z]"),
    ("mirror: true", 4, "mirror", "a key of the puppet file as a whole: mirror: {plane: xz, from"),
    (
        "joint: {type: revolute, axis: [0, 1, 0], limits: [-1, 1]}",
        4,
        "joint.limits",
        "found a list; needed: {lower: ..., upper: ...}",
    ),
    ("joint: {type: revolute, axis: [0, 0, 0]}", 4, "joint.axis", "zero length"),
    ("joint: {type: ball, axis: [0, 0, 1]}", 4, "joint.axis", "found in a ball joint"),
    ("joint: {type: fixed, damping: 1}", 4, "joint.damping", "found in a fixed joint"),
    ("joint: {type: fixed, driven: true}", 4, "joint.driven", "found in a fixed joint"),
    ("joint: {type: ball, damping: -1}", 4, "joint.damping", "found -1"),
    ("joint: {type: ball, driven: true, damping: 1}", 4, "joint.damping", "a driven joint"),
    (
        "joint:\n      type: revolute\n      axis: [0, 0, 1]\n      driven: true\n"
        "      limits: {lower: 0}",
        8,
        "joint.limits",
        "a driven joint",
    ),
    (
        "joint: {type: revolute, axis: [0, 0, 1], limits: {lower: 1, upper: 10 deg}}",
        4,
        "joint.limits",
        "lower must be below upper",
    ),
    (
        "joint: {type: revolute, axis: [0, 0, 1], limits: {}}",
        4,
        "joint.limits",
        "needed: lower, upper or both",
    ),
    (
        "joint: {type: prismatic, axis: [0, 0, 1], limits: {upper: 10 deg}}",
        4,
        "joint.limits",
        "a length in metres",
    ),
    (
        "joint: {type: revolute, axis: [0, 0, 1], spring: {stiffness: -1}}",
        4,
        "joint.spring.stiffness",
        "found -1",
    ),
    ("joint: {type: ball, spring: {stiffness: 1, rest: 1}}", 4, "joint.spring", "has no rest"),
    ("joint: {type: free, spring: {stiffness: 1}}", 4, "joint.spring", "found in a free joint"),
    ("joint: {type: ball, cone: {max: 0, axis: [1, 0, 0]}}", 4, "joint.cone.max", "180 deg"),
    ("joint: {type: ball, cone: {max: 1, axis: [0, 0, 0]}}", 4, "joint.cone.axis", "zero length"),
    ("joint: {type: ball, twist: {lower: -1}}", 4, "joint.twist", "needed: axis, or a cone"),
    ("joint: {type: free}", 4, "joint", "moves no mass"),
    ("joint: {type: fixed, name: b.c}", 4, "joint.name", "found 'b.c'; a name is"),
    (
        "joint: {type: fixed, orientation: {quaternion: [0, 0, 0, 0]}}",
        4,
        "joint.orientation.quaternion",
        "zero length",
    ),
    ("joint: {type: fixed, orientation: {}}", 4, "joint.orientation", "exactly one of"),
    ("joint: {type: fixed, orientation: {angle: 1}}", 4, "joint.orientation", "exactly one of"),
    (
        "joint: {type: fixed, orientation: {rpy: [0, 0, 1], axis: [0, 0, 1], angle: 1}}",
        4,
        "joint.orientation",
        "exactly one of",
    ),
    ("shapes: [{type: blob}]", 4, "shapes[0].type", "found 'blob'; allowed: capsule, box"),
    ("shapes: [{radius: 1}]", 4, "shapes[0].type", "missing"),
    ("shapes:\n      - {type: sphere, radius: -1}", 5, "shapes[0].radius", "positive"),
    ("shapes: [{type: sphere, radius: 1, density: -1}]", 4, "shapes[0].density", "found -1"),
    ("shapes: [{type: sphere, radius: 1, mass: 1, density: 1}]", 4, "shapes[0].density", "allowed"),
    ("shapes: [{type: sphere, radius: 1, raduis: 1}]", 4, "shapes[0].raduis", "'radius'"),
    ("shapes: [{type: sphere, radius: 1, size: 1}]", 4, "shapes[0].size", "not known"),
    ("shapes: [{type: box, size: [1, 0, 1]}]", 4, "shapes[0].size[1]", "positive"),
    ("shapes: [{type: sphere, radius: 1, colour: red}]", 4, "shapes[0].colour", "'#c08040'"),
    ("shapes: [{type: capsule, from: [0, 0, 0], radius: 1}]", 4, "shapes[0].to", "missing"),
    ("shapes: [{type: mesh, file: ../a.stl}]", 4, "shapes[0].file", "inside the puppet file's"),
    ("shapes: [{type: mesh, file: /a.stl}]", 4, "shapes[0].file", "inside the puppet file's"),
    ("shapes: [{type: mesh, file: 'C:\\a.stl'}]", 4, "shapes[0].file", "inside the puppet file's"),
    ("shapes: [{type: mesh, file: no.stl}]", 4, "shapes[0].file", "found no file 'no.stl'"),
    ("shapes: [{type: mesh, file: a.exe}]", 4, "shapes[0].file", "allowed: .stl, .obj, .ply"),
]


@pytest.mark.parametrize(("text", "line", "key", "message"), IN_BODY)
def test_a_mistake_in_a_body_is_located(text: str, line: int, key: str, message: str) -> None:
    found_mistakes = mistakes(f"puppet: p\nbodies:\n  - name: a\n    {text}\n")
    assert [(a, b) for a, b, m in found_mistakes if message in m] == [(line, f"bodies[0].{key}")], (
        found_mistakes
    )


NAMES = ["", "a.b", "a b", "1a", "a'", 'a"', "a\n", "a*/", "$(rm)", "a;b", "`a`", "ä", "a" * 65]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_could_be_more_than_names_are_refused(name: str) -> None:
    text = f"puppet: {json.dumps(name)}\nbodies:\n  - name: {json.dumps(name)}\n"
    found_mistakes = mistakes(text)
    assert [(line, key) for line, key, _ in found_mistakes] == [
        (1, "puppet"),
        (3, "bodies[0].name"),
    ]
    assert all("a name is up to 64 letters, digits, - and _" in m for _, _, m in found_mistakes)


def test_the_name_of_the_world_is_taken() -> None:
    (found_mistakes,) = mistakes("puppet: p\nbodies:\n  - name: world\n")
    assert found_mistakes[:2] == (3, "bodies[0].name")


def test_a_cycle_of_parents_is_reported_once() -> None:
    text = "puppet: p\nbodies:\n" + "".join(
        f"  - {{name: {a}, parent: {b}}}\n" for a, b in ("ab", "bc", "ca", "dc")
    )
    assert mistakes(text) == [(3, "bodies[0].parent", "the parents form a cycle: a -> b -> c -> a")]


def test_a_joint_may_carry_its_own_body_s_name_but_no_other() -> None:
    text = """\
puppet: p
bodies:
  - name: a
    joint: {type: fixed, name: a}
  - name: b
    joint: {type: fixed, name: a}
"""
    (found_mistakes,) = mistakes(text)
    assert found_mistakes[:2] == (6, "bodies[1].joint.name")


def test_one_parameter_has_one_value() -> None:
    text = GOOD.replace("mass: 1", "mass: {parameter: m, value: 1}")
    text += "gravity: [0, {parameter: m, value: 2}, 0]\n"
    (found_mistakes,) = mistakes(text)
    assert found_mistakes[:2] == (7, "gravity[1]")
    assert "is 2 here but 1 in bodies[0].mass" in found_mistakes[2]


def test_limits_of_the_mirror() -> None:
    text = """\
puppet: p
mirror: {plane: xz, from: left, to: right}
bodies:
  - name: a_left
  - name: a_right
  - name: b_left
    joint: {type: fixed, name: hinge}
  - name: c
    joint: {type: fixed, name: c_left}
"""
    found_mistakes = [(line, key) for line, key, _ in mistakes(text)]
    assert found_mistakes == [
        (4, "bodies[0].name"),
        (7, "bodies[2].joint.name"),
        (9, "bodies[3].joint.name"),
    ]


def test_the_mirror_does_not_negate_parameters() -> None:
    text = """\
puppet: p
mirror: {plane: xz, from: left, to: right}
bodies:
  - name: a_left
    joint:
      type: fixed
      at: [{parameter: x, value: 1}, {parameter: y, value: 1}, 0]
"""
    assert [f[:2] for f in mistakes(text)] == [(7, "bodies[0].joint.at[1]")]


def test_start_values_of_strings() -> None:
    text = (
        GOOD
        + """\
strings:
  - {name: s, length: driven, path: [{body: arm}, {driven: [x], at: [0, 0, 1]}]}
  - {name: t, length: 1, path: [{body: arm}, {world: [0, 0, 1]}]}
pose:
  s.length: -1
  s.x: 1
  t.length: 1
"""
    )
    found_mistakes = mistakes(text)
    assert [(line, key) for line, key, _ in found_mistakes] == [
        (11, "pose.s.length"),
        (12, "pose.s.x"),
        (13, "pose.t.length"),
    ]
    assert "`at`" in found_mistakes[1][2]


def test_all_mistakes_of_a_file_are_reported_at_once_and_in_file_order() -> None:
    text = """\
puppet: "p q"
gravty: [0, 0, -9.81]
bodies:
  - name: a
    parent: b
    mass: -1
    joint: {type: hinge}
    shapes:
      - {type: box, size: [1, 1]}
  - name: a
strings:
  - name: s
    path: [{body: c}, {world: [0, 0]}]
    length: 0
pose: {z: 1}
"""
    keys = [(line, key) for line, key, _ in mistakes(text)]
    assert keys == [
        (1, "puppet"),
        (2, "gravty"),
        (5, "bodies[0].parent"),
        (6, "bodies[0].mass"),
        (7, "bodies[0].joint.type"),
        (9, "bodies[0].shapes[0].size"),
        (10, "bodies[1].name"),
        (13, "strings[0].path[1].world"),
        (13, "strings[0].path[0].body"),
        (14, "strings[0].length"),
        (15, "pose.z"),
    ]


def test_a_missing_file_and_a_folder(tmp_path) -> None:
    for path, word in ((tmp_path / "no.yaml", "nothing"), (tmp_path, "a folder")):
        with pytest.raises(PuppetError, match=word):
            load(path)


def test_messages_name_the_file_and_the_line(tmp_path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(GOOD.replace("mass: 1", "mass: -1"))
    with pytest.raises(PuppetError) as caught:
        load(path)
    assert str(caught.value) == (
        f"{path}:5: bodies[0].mass: found -1; needed: zero or a positive number"
    )


def test_a_puppet_built_in_python_is_checked_in_the_same_way() -> None:
    arm = Body(name="arm", parent="trunk", joint=Joint(type="ball"), shapes=[Box(size=[1, 1, 1])])
    with pytest.raises(PuppetError) as caught:
        Puppet(puppet="p", bodies=[arm, {"name": "b", "mass": -1}], pose={"elbow": 1}, flor=0)
    problems = caught.value.mistakes
    assert {p.file for p in problems} == {"<python>"}
    assert {p.line for p in problems} == {None}
    assert [p.key for p in problems] == ["bodies[1].mass", "flor", "bodies[0].parent", "pose.elbow"]
