"""Numbers and counts have bounds, and a number out of range hides no other mistake."""

from __future__ import annotations

import os

import pytest
from tests.puppet.toys import TEXT

from fantoccini.base.errors import PuppetError
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.marionette import loads as marionette
from fantoccini.model.puppet import Puppet, json_schema, load, loads
from fantoccini.model.puppet.quantities import QUANTITIES

EVERY = """\
puppet: p
gravity: [0, 0, -9.81]
floor: -1
bodies:
  - name: trunk
    joint: {type: free, damping: 0.1}
    mass: 1.5
    com: [0.01, 0, 0]
    inertia: [1.1, 1.2, 1.3]
    drag: {linear: 0.11, quadratic: 0.12, angular: 0.13}
    shapes: [{type: box, size: [0.21, 0.22, 0.23], at: [0.24, 0, 0], density: 300}]
  - name: ring
    parent: trunk
    joint: {type: revolute, axis: [0, 0, 1], at: [0.31, 0, 0], limits: {lower: -0.32},
      spring: {stiffness: 0.33, rest: 0.34}}
    shapes: [{type: capsule, from: [0.35, 0, 0], to: [0.36, 0, 0], radius: 0.37, mass: 0.38}]
  - name: cart
    joint: {type: prismatic, axis: [1, 0, 0], driven: true}
strings:
  - {name: s, path: [{body: ring, at: [0.41, 0, 0]}, {world: [0.42, 0, 3]}], length: 0.43,
     max_tension: 44.5, rewind_speed: 0.45}
  - {name: t, path: [{body: ring, at: [0, 0, 0]}, {world: [0, 0, 3]}], length: driven,
     chain: {pieces: 4, mass: 0.46, stiffness: 470.5, damping: 0.48}}
springs:
  - {name: w, between: [{body: trunk}, {world: [0, 0, 1]}], stiffness: 510.5, rest: 0.52,
     damping: 0.53}
drives:
  - {on: t.length, inertia: 0.61, gear: 6.25, drum: 0.63, friction: {viscous: 0.64, coulomb: 0.65,
     speed: 0.66}, motor: {type: dc, constant: 0.67, current: 0.68, resistance: 0.69,
     voltage: 0.71}, control: {type: pd, stiffness: 0.72, damping: 0.73}}
  - {on: cart, mass: 0.74, control: {type: computed_torque, bandwidth: 7.5, damping_ratio: 0.76}}
pose: {ring: 0.77, trunk.x: 0.78, trunk.rotation: [0.79, 0, 0]}
"""

NUMBERS = """\
0.1} 1.5 0.01 1.1 0.11 0.12 0.13 0.21 0.24 300 0.31 -0.32 0.33 0.34 0.35 0.37 0.38 0.41
0.42 0.43 44.5 0.45 0.46 470.5 0.48 510.5 0.52 0.53 0.61 6.25 0.63 0.64 0.65 0.66 0.67 0.68 0.69
0.71 0.72 0.73 0.74 7.5 0.76 0.77 0.78 0.79 -9.81"""


def mistakes(text: str) -> list[tuple[int | None, str, str]]:
    with pytest.raises(PuppetError) as caught:
        loads(text, "bad.yaml")
    return [(p.line, p.key, p.message) for p in caught.value.mistakes]


def test_the_text_with_a_number_of_every_kind_is_a_puppet():
    assert loads(EVERY).name == "p"


@pytest.mark.parametrize("size", ["1e103", "-1e103", "1e-109"])
@pytest.mark.parametrize("number", NUMBERS.split())
def test_every_number_is_bounded(number, size):
    """Radii such as 1e103 and 1e-109 are refused.

    Positions, moments of inertia and angles may be tiny, but nothing may be huge.
    """
    assert EVERY.count(number) == 1
    text = EVERY.replace(number, size + "}" * number.endswith("}"))
    line = EVERY[: EVERY.index(number)].count("\n") + 1
    if size == "1e-109":
        try:
            puppet = marionette(text)
        except PuppetError as error:
            assert [p.line for p in error.mistakes] == [line]
        else:
            check_mass_matrix(puppet.puppet, puppet.tree)
        return
    located = mistakes(text)
    assert (located[0][0], len({at for at, _, _ in located})) == (line, 1)
    assert any("allowed" in text or "needed" in text for _, _, text in located)


def test_a_number_out_of_range_says_the_range():
    (problem,) = mistakes(EVERY.replace("0.37", "1e103"))
    assert problem[1:] == ("bodies[1].shapes[0].radius", "found 1e+103; allowed: 1e-06 to 1e+06 m")
    (problem,) = mistakes(EVERY.replace("510.5", "{parameter: k, value: 1e300}"))
    assert problem[1] == "springs[0].stiffness"
    assert problem[2].startswith("found 1e+300; allowed: 0, or 1e-12 to 1e+12")


def test_editors_know_the_ranges():
    definitions = json_schema()["$defs"]
    radius = definitions["Sphere"]["properties"]["radius"]
    length = QUANTITIES["length"]
    assert (radius["minimum"], radius["maximum"]) == (length.min_size, length.max_size)
    number, _ = definitions["Spring"]["properties"]["stiffness"]["oneOf"]
    assert (number["minimum"], number["maximum"]) == (0.0, QUANTITIES["stiffness"].max_size)


def test_parameters_keep_to_the_ranges():
    """Ranges are checked when parameters are changed later, too."""
    puppet = marionette(EVERY.replace("510.5", "{parameter: k, value: 10}"))
    with pytest.raises(PuppetError, match="found 1e\\+300; allowed"):
        puppet.with_parameters({"k": 1e300})


def test_a_huge_integer_in_python_is_a_mistake():
    with pytest.raises(PuppetError, match="needed: a finite number"):
        Puppet(puppet="p", bodies=[{"name": "a", "mass": 10**400}])


def test_directions_may_have_any_length():
    """They are normalised."""
    text = EVERY.replace("axis: [0, 0, 1]", "axis: [0, 0, 1e300]")
    assert loads(text).bodies[1].joint.axis == (0.0, 0.0, 1.0)
    text = EVERY.replace("axis: [0, 0, 1]", "axis: [0, 5e-324, 5e-324]")
    assert loads(text).bodies[1].joint.axis == pytest.approx((0.0, 0.5**0.5, 0.5**0.5))


def test_a_number_out_of_range_hides_no_other_mistake():
    """Incompatible keys of a string are reported together with a negative length."""
    bad = EVERY.replace("length: 0.43", "length: -1, wire: true").replace("1.5", "-2")
    messages = {key: text for _, key, text in mistakes(bad)}
    assert messages["strings[0].length"] == "found -1; needed: a positive number"
    assert messages["bodies[0].mass"] == "found -2; needed: zero or a positive number"
    assert "a wire neither bounces nor slips" in messages["strings[0]"]
    bad = bad.replace("inertia: [1.1", "inertia: [9.9")
    assert (
        "no solid has one that is larger"
        in {key: text for _, key, text in mistakes(bad)}["bodies[0].inertia"]
    )
    idle = EVERY.replace(
        "springs:", "  - {name: u, length: -1, path: [{body: idle}, {world: [0, 0, 1]}]}\nsprings:"
    ).replace("strings:", "  - {name: idle, joint: {type: free}}\nstrings:")
    assert [key for _, key, _ in mistakes(idle)] == ["bodies[3].joint", "strings[2].length"]


@pytest.mark.parametrize("file", ["loop.stl", "folder/a.stl"])
def test_a_mesh_in_a_circle_of_links_is_a_located_mistake(tmp_path, file):
    """It is no internal error."""
    os.symlink("loop.stl", tmp_path / "back.stl")
    os.symlink("back.stl", tmp_path / "loop.stl")
    os.symlink("other", tmp_path / "folder")
    os.symlink("folder", tmp_path / "other")
    text = f"puppet: p\nbodies:\n  - name: a\n    shapes: [{{type: mesh, file: {file}}}]\n"
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(PuppetError) as caught:
        load(tmp_path / "p.yaml")
    (problem,) = caught.value.mistakes
    assert (problem.line, problem.key) == (4, "bodies[0].shapes[0].file")


def test_a_mesh_that_is_too_large_with_its_scale_is_a_mistake(tmp_path):
    corners = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"]
    faces = ["1 3 2", "1 2 4", "1 4 3", "2 3 4"]
    lines = [*(f"v {c}" for c in corners), *(f"f {f}" for f in faces)]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    mesh = "shapes: [{type: mesh, file: a.obj, scale: 1e8, density: 1}]"
    with pytest.raises(PuppetError, match=r"measures 1e\+08 m with its scale; allowed: 1e-06 to"):
        loads(f"puppet: p\nbodies:\n  - name: a\n    {mesh}\n", folder=tmp_path)


def test_a_mistake_of_a_twin_is_found_where_its_original_stands():
    """The mistake has the line and the index of the original."""
    text = TEXT + "  - {name: stay_left, length: 1, path: [{body: bob_left}, {body: bob_right}]}\n"
    assert mistakes(text) == [
        (
            11,
            "strings[1].path",
            "in its mirrored twin stay_right: all points lie on 'bob_right': its length is zero",
        )
    ]


POSES = [
    ("wing_left: 1", "the joint of wing_left is called flap_left; did you mean 'flap_left'?"),
    ("wing_right: 1", "the joint of wing_right is called flap_right; did you mean 'flap_right'?"),
    ("kite.x: 1", "the joint of kite is called sky; did you mean 'sky.x'?"),
    ("hand: 1", "did you mean 'hand.length'?"),
    ("flap_lft: 1", "did you mean 'flap_left'?"),
]


@pytest.mark.parametrize(("entry", "hint"), POSES)
def test_a_body_is_taken_for_its_joint(entry, hint):
    """The hint for `pose.wing_left` is its joint `flap_left`, not the similar `tip_left`."""
    text = f"""\
puppet: p
mirror: {{plane: xz, from: left, to: right}}
bodies:
  - name: wing_left
    joint: {{name: flap_left, type: revolute, axis: [1, 0, 0]}}
    shapes: [{{type: sphere, radius: 0.1, mass: 1}}]
  - name: tip_left
    parent: wing_left
    joint: {{type: revolute, axis: [1, 0, 0], at: [0, 1, 0]}}
    shapes: [{{type: sphere, radius: 0.1, mass: 1}}]
  - name: kite
    joint: {{name: sky, type: free}}
    shapes: [{{type: sphere, radius: 0.1, mass: 1}}]
strings:
  - {{name: hand, path: [{{body: kite}}, {{world: [0, 0, 1]}}], length: driven}}
pose: {{{entry}}}
"""
    ((line, _, message),) = mistakes(text)
    assert (line, message.endswith(hint)) == (16, True), message


@pytest.mark.parametrize(
    ("found", "meant"),
    [("hinge", "revolute"), ("slider", "prismatic"), ("spherical", "ball"), ("Weld", "fixed")],
)
def test_words_of_other_programs_are_known(found, meant):
    """For `hinge`, the hint is `revolute`."""
    ((_, key, message),) = mistakes(EVERY.replace("type: revolute", f"type: {found}"))
    assert key == "bodies[1].joint.type"
    assert message.endswith(f"free; did you mean {meant!r}?")
    text = EVERY.replace("type: box", "type: cuboid")
    ((_, _, message),) = mistakes(text)
    assert message.endswith("did you mean 'box'?")


OVER_LIMIT = [
    ("bodies:\n" + "  - {name: a, mass: 1}\n" * 1001, "bodies", "found 1001 bodies, strings"),
    (
        "bodies: [{name: a, mass: 1}]\nstrings:\n"
        + "  - {name: s, path: [{body: a}, {world: [0, 0, 1]}], length: 1, chain: {pieces: 200, "
        "mass: 1, stiffness: 1}}\n" * 6,
        "strings",
        "found 1201 bodies, strings, springs and masses of chains; allowed: 1000",
    ),
]


def test_a_number_out_of_range_beside_an_unknown_name():
    """Both mistakes are reported."""
    bad = EVERY.replace("parent: trunk", "parent: nobody").replace("0.37", "-1")
    keys = [key for _, key, _ in mistakes(bad)]
    assert keys == ["bodies[1].parent", "bodies[1].shapes[0].radius"]


@pytest.mark.parametrize(("text", "key", "message"), OVER_LIMIT, ids=["bodies", "chains"])
def test_bodies_and_masses_of_chains_are_counted(text, key, message):
    """Too many are refused early: ten chains of 200 pieces would take 41 s and 1.9 GB."""
    messages = {at: sentence for _, at, sentence in mistakes("puppet: p\n" + text)}
    assert message in messages[key]


def test_searches_for_nearest_names_are_bounded(monkeypatch):
    """Only shown names are searched: for 20,000 unknown parents all would take 15 s."""
    from fantoccini.base.documents import located
    from fantoccini.model.puppet import parts

    asked = []
    real = parts.did_you_mean
    for module in (parts, located):
        monkeypatch.setattr(module, "did_you_mean", lambda *names: asked.append(1) or real(*names))
    bodies = "".join(f"  - {{name: a{i}, parent: b{i}, kolour: 1}}\n" for i in range(300))
    reported = mistakes(f"puppet: p\nbodies:\n{bodies}")
    assert reported[-1][2] == "and 500 more"
    assert len(asked) <= 200
