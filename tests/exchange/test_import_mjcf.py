"""Models in MJCF become puppets with MuJoCo's accelerations; the report names the rest."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import mujoco
import numpy as np
import pytest
from benchmarks.exchange import models

import fantoccini as fan
from fantoccini.base.errors import ExchangeError, UnknownNameError
from fantoccini.dynamics.mujoco import mjcf
from fantoccini.output.exchange import ImportedPuppet, import_model
from harness import Model, State
from oracles import random_models, random_trees

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets, pytest.mark.long]

ROUNDING = 1e-11
"""Tolerance of accelerations, relative to the largest."""


def import_text(text: str, folder: Path, **more) -> ImportedPuppet:
    path = folder / "model.xml"
    path.write_text(text)
    return import_model(path, **more)


def random_states(puppet_import: ImportedPuppet, m: mujoco.MjModel, n: int):
    """Pairs of the puppet's state and MuJoCo's data, evaluated without constraints."""
    model = Model.of(fan.model.loads(puppet_import.text))
    q, v = models.mujoco_indices(puppet_import, m, model.table)
    rng, d = np.random.default_rng(1), mujoco.MjData(m)
    for _ in range(n):
        d.qpos[:] = m.qpos0 + rng.uniform(-1.0, 1.0, m.nq)
        mujoco.mj_normalizeQuat(m, d.qpos)
        d.qvel[:] = rng.normal(size=m.nv)
        mujoco.mj_forward(m, d)
        q_K, v_K = np.array(model.table.start_K), np.zeros(model.table.n_vK)
        yield model, State(d.qpos[q].copy(), d.qvel[v].copy(), q_K, v_K, v_K), d, v


@pytest.mark.parametrize("seed", range(12))
def test_accelerations_and_tendons_agree(seed, tmp_path):
    """References, springs, armatures, and joints about several points of one body."""
    text = random_models.mjcf(seed)
    puppet_import, m = import_text(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    assert list(models.switch_off_features(m)) == ["actuators"][: m.nu]
    assert {note.kind for note in puppet_import.report} <= {"actuator"}
    for model, x, d, v in random_states(puppet_import, m, 3):
        acc = model.acceleration(x)
        assert np.abs(acc - d.qacc[v]).max() < ROUNDING * np.abs(d.qacc).max()
        h = model.call("rows", x)["h"]
        own = [m.tendon(s.name).id for s in model.tree.strings]
        assert np.allclose(h, d.ten_length[own] - m.tendon_range[own, 1], rtol=0, atol=1e-12)
        h_later = model.call("rows", model.moved(x, 1e-6))["h"]
        assert np.allclose((h_later - h) / 1e-6, d.ten_velocity[own], atol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_a_puppet_is_restored_from_mjcf(seed, tmp_path):
    """Cones become strings of the same length; names lose their dots."""
    puppet_import = random_trees.description(seed, 8, driven=0.0, strings=2, limits=True)
    for string in puppet_import["strings"]:
        string["path"] = [{k: v for k, v in p.items() if k != "driven"} for p in string["path"]]
        for point in string["path"]:
            if "body" not in point and "world" not in point:
                point["world"] = point.pop("at")
        string["length"] = 1.5
    puppet_import["strings"][0]["wire"] = True
    for body in puppet_import["bodies"]:
        if body["joint"]["type"] == "ball":
            body["joint"].pop("spring", None)
        body["joint"].pop("twist", None)
    model = Model(puppet_import)
    text = mjcf(fan.Marionette(model.puppet))
    back = import_text(text, tmp_path)
    m = mujoco.MjModel.from_xml_string(text)
    list(models.switch_off_features(m))
    assert {note.message.split(" ")[0] for note in back.report} <= {"is"}  # renamed
    for again, x, d, v in random_states(back, m, 2):
        acc = again.acceleration(x)
        assert np.abs(acc - d.qacc[v]).max() < 1e-9 * np.abs(d.qacc).max()
        names = [s.name for s in again.tree.strings]
        own = {m.tendon(t).name.replace(".", "_"): t for t in range(m.ntendon)}
        max_lengths = m.tendon_range[:, 1].copy()
        max_lengths[m.tendon("s0").id] = 1.5
        h, ends = again.call("rows", x)["h"], d.ten_length - max_lengths
        assert np.allclose(h[: len(names)], [ends[own[n]] for n in names], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["arm2d", "arm3d", "string_pendulum", "marionette"])
def test_a_bundled_puppet_is_restored(name, tmp_path):
    """The re-imported puppet, with its hands at rest, keeps its accelerations and string lengths.

    Drag is exported as actuators, which the import leaves out: with drag it starts at rest.
    """
    puppet = getattr(fan.puppets, name)()
    own = Model.of(puppet.puppet)
    x = own.random(0, moving_inputs=False)
    speed = 0.0 if any(any(link.drag) for link in own.tree.links) else 1.0
    x = State(x.q_D, speed * x.v_D, np.array(own.table.start_K) + 0.1, x.v_K, x.acc_K)
    back = Model.of(fan.model.loads(import_text(mjcf(puppet, x.q_K), tmp_path).text))
    q, v = (
        [theirs.index(n if n in theirs else n.replace(".", "_")) for n in names]
        for names, theirs in ((own.table.q_D, back.table.q_D), (own.table.v_D, back.table.v_D))
    )
    none = np.zeros(0)
    y = State(np.zeros(len(q)), np.zeros(len(v)), none, none, none)
    y.q_D[q], y.v_D[v] = x.q_D, x.v_D
    acc = own.acceleration(x)
    assert np.allclose(back.acceleration(y)[v], acc, rtol=0, atol=1e-9 * np.abs(acc).max())
    h, names = own.call("rows", x)["h"], [s.name for s in back.tree.strings]
    for string, gap in zip(own.tree.strings, h, strict=False):
        again = back.call("rows", y)["h"][names.index(string.name)]
        assert again == pytest.approx(gap, abs=1e-12)


QUICK_MODELS = ("reacher", "cartpole", "ball_in_cup", "hopper")


@pytest.mark.parametrize(
    "model", [m for m in models.MODELS if m.split("/")[-1][:-4] in QUICK_MODELS]
)
def test_small_models_agree(model):
    assert models.measure_agreement(model, states=2).error < 1e-9


CONNECTED = """
<mujoco>
  <worldbody>
    <body name="a" pos="0 0 1">
      <joint name="ja" axis="0 1 0" pos="0 0 0.1"/><geom type="capsule" size="0.05 0.3"/>
      <body name="b" pos="0 0 -0.6" quat="1 0.2 0 0.1">
        <joint name="jb" type="ball"/><geom type="box" size="0.1 0.2 0.3"/>
        <site name="here" pos="0.1 0 -0.2"/>
      </body>
    </body>
    <body name="c" pos="0.5 0 1"><freejoint name="jc"/><geom size="0.1"/>
      <site name="there" pos="0 0.1 0" quat="1 0 0.3 0"/></body>
  </worldbody>
  <equality><connect name="pin" body1="b" body2="c" anchor="0 0 -0.2"/></equality>
</mujoco>"""


@pytest.mark.parametrize(
    ("kind", "count", "extent", "length"),
    [
        ("connect", 3, 2.0, 1.0),
        ("weld", 6, 50.0, 1.0),
        ("connect", 3, 0.5, 0.1),
        ("weld", 6, 0.099, 0.01),
        ("weld", 6, 1e-5, 0.001),
        ("connect", 3, "inf", 1.0),
    ],
)
def test_bodies_are_held_by_wires(kind, count, extent, length, tmp_path):
    """At rest, accelerations are those of MuJoCo's constraint in the rigid limit:

    M a + bias = J^T f, J a = 0.
    """
    text = CONNECTED.replace("<connect", f"<{kind}")
    text = text.replace("  <equality", f'  <statistic extent="{extent}"/> <equality')
    puppet_import, m = import_text(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    assert [str(n) for n in puppet_import.report if n.kind == "equality"] == [
        f"{tmp_path / 'model.xml'}:14: equality pin: {kind}: is {count} wires of {length:g} m here"
    ]
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    puppet = fan.loads(puppet_import.text)
    q, v = models.mujoco_indices(puppet_import, m, puppet.coordinates)
    d = mujoco.MjData(m)
    mujoco.mj_forward(m, d)  # the zero pose satisfies the constraint
    J, M = d.efc_J.reshape(count, m.nv), np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, d, M)
    W = np.linalg.solve(M, J.T)
    rigid = d.qacc_smooth - W @ np.linalg.solve(J @ W, J @ d.qacc_smooth)
    x = puppet.state(dict(zip(puppet.coordinates.q_D, d.qpos[q], strict=True)))
    assert np.abs(rigid - d.qacc_smooth).max() > 1.0
    acc = puppet.forward_dynamics(x).acc_D
    assert np.allclose(acc, rigid[v], rtol=0, atol=1e-9 * np.abs(rigid).max())


@pytest.mark.parametrize("kind", ["connect", "weld"])
def test_constraints_may_name_two_sites(kind, tmp_path):
    """The wires' gaps are those of MuJoCo's sites, for any places of the bodies."""
    sites = 'site1="here" site2="there"'
    text = CONNECTED.replace('body1="b" body2="c" anchor="0 0 -0.2"', sites)
    text = text.replace("<connect", f"<{kind}")
    puppet_import, m = import_text(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    for model, x, d, _ in random_states(puppet_import, m, 2):
        here, there = d.site("here").xpos, d.site("there").xpos
        R, S = (d.site(name).xmat.reshape(3, 3).T for name in ("here", "there"))
        gaps = np.linalg.norm(here - (there + S), axis=1) - 1.0
        if kind == "weld":
            ends = there + S + S[[1, 2, 0]]
            gaps = [*gaps, *np.linalg.norm(here + R - ends, axis=1) - 1.0]
        assert np.allclose(model.call("rows", x)["h"], gaps, rtol=0, atol=1e-12)


REST = """<mujoco model="re st"><compiler angle="radian"/>
  <option density="1.2" gravity="0 0 -9.81"/>
  <worldbody>
    <light name="sun" pos="0 0 3"/>
    <geom name="ground" type="plane" size="1 1 1" pos="0 0 -0.5"/>
    <geom name="wall" type="box" size="0.1 1 1" pos="1 0 0"/>
    <body name="hand" mocap="true" pos="0 0 2"><geom size="0.02"/></body>
    <body name="hip" pos="0 0 1">
      <joint name="hip" type="hinge" axis="0 1 0" frictionloss="0.3" range="-1 1" limited="true"/>
      <geom type="cylinder" size="0.1 0.3"/>
      <site name="top" pos="0 0 0.3"/><site name="end" pos="0 0 -0.3"/>
      <body name="left.foot" pos="0 0 -0.5">
        <joint name="knee" type="ball" stiffness="2" limited="true" range="0 0.5"/>
        <geom type="ellipsoid" size="0.1 0.2 0.3" rgba="1 0 0 1"/>
        <site name="toe"/>
      </body>
    </body>
    <site name="hook" pos="0 0 2"/>
  </worldbody>
  <tendon>
    <spatial name="hand" limited="true" range="0 1.2">
      <site site="top"/><site site="hook"/></spatial>
    <spatial name="idle"><site site="top"/><site site="hook"/></spatial>
    <spatial name="inner" limited="true" range="0 1"><site site="top"/><site site="end"/></spatial>
    <fixed name="sum" limited="true" range="0 1"><joint joint="hip" coef="1"/></fixed>
    <spatial name="pulled" limited="true" range="0 1"><site site="top"/><site site="hook"/>
      <pulley divisor="2"/><site site="toe"/><site site="hook"/></spatial>
  </tendon>
  <actuator><motor name="m" joint="hip"/></actuator>
  <sensor><jointpos name="angle" joint="hip"/></sensor>
  <keyframe><key name="bent" qpos="0.5 1 0 0 0"/></keyframe>
</mujoco>"""


def test_the_report_names_parts_without_a_counterpart(tmp_path):
    puppet_import = import_text(REST, tmp_path)
    file = tmp_path / "model.xml"
    notes = {str(note).removeprefix(f"{file}:") for note in puppet_import.report}
    assert notes == {
        "4: light sun: left out",
        "9: joint hip: has frictionloss, left out",
        "12: body left.foot: is called left_foot here",
        "13: joint knee: has a spring with the same stiffness for small angles only",
        "13: joint knee: is limited to 0.5 rad, left out: `cone` limits the swing",
        "21: tendon hand: is called hand_2 here",
        "23: tendon idle: left out: nothing limits its length, and it has no stiffness or damping",
        "24: tendon inner: left out: its length never changes",
        "25: tendon sum: left out: it is a sum of joint positions; strings run through points",
        "26: tendon pulled: left out: it has pulleys that divide its force",
        "29: actuator m: left out: the joint or body that it moves is free",
        "30: sensor angle: left out",
        "31: key bent: left out: the puppet starts in another pose",
        " option density: 1.2, left out: bodies have `drag` instead",
        " contact: left out: add `contact: true`, and keep bodies apart",
    }


def test_the_puppet_is_readable(tmp_path):
    """Comments stand above changes; a held body is driven; the wall is an obstacle."""
    puppet_import = import_text(REST, tmp_path)
    puppet_import.save(tmp_path / "out.yaml")
    puppet = fan.model.load(tmp_path / "out.yaml")
    bodies = {body.name: body for body in puppet.bodies}
    assert list(bodies) == ["hand", "hip", "left_foot"] and puppet.name == "re_st"
    assert bodies["hand"].joint.driven and puppet.pose == {"hand.z": 2.0}
    assert puppet.floor == -0.5 and [o.name for o in puppet.obstacles] == ["wall"]
    assert (bodies["hip"].joint.limits.lower, bodies["hip"].joint.limits.upper) == (-1.0, 1.0)
    shape = bodies["hip"].shapes[0]
    assert np.allclose(fan.model.puppet.shapes.load_mesh(shape).extents, [0.2, 0.2, 0.6])
    assert bodies["left_foot"].shapes[0].colour == "#ff0000"
    assert [s.name for s in puppet.strings] == ["hand_2"]
    lines = puppet_import.text.splitlines()
    for comment, part in (
        ("# joint hip: has frictionloss, left out", "- name: hip"),
        ("# body left.foot: is called left_foot here", "- name: left_foot"),
        ("# tendon hand: is called hand_2 here", "- {name: hand_2"),
    ):
        assert part in lines[next(i for i, line in enumerate(lines) if comment in line) + 1]
    assert "#   camera" not in puppet_import.text and "#   light sun: left out" in lines


def test_a_keyframe_is_the_pose(tmp_path):
    puppet_import = import_text(REST, tmp_path, keyframe="bent")
    assert "pose: {hand.z: 2, hip: 0.5}" in puppet_import.text
    assert not any(note.kind == "key" for note in puppet_import.report)
    with pytest.raises(UnknownNameError, match="did you mean 'bent'"):
        import_text(REST, tmp_path, keyframe="bend")


BALL = '<worldbody><body><joint type="ball"/><geom size="0.1"/></body></worldbody>'

WRONG = {
    "no XML": ("nope", ":1: is not XML"),
    "cut off": ("<mujoco>\n<worldbody>", ":2: is not XML: no element found"),
    "another root": ("<sdf/>", ":1: begins with <sdf>; needed: <mujoco>"),
    "entities": ('<!DOCTYPE a [<!ENTITY x "y">]>\n<mujoco/>', ":1: found a document type"),
    "an unknown element": ("<mujoco>\n<wrldbody/></mujoco>", ":2: MuJoCo says: XML Error"),
    "an asset that is not there": (
        f'<mujoco><asset><mesh file="no.stl"/></asset>{BALL}</mujoco>',
        "no.stl",
    ),
    "a file that is not there": (
        '<mujoco>\n<include file="no.xml"/></mujoco>',
        ":2: include: found no file 'no.xml'",
    ),
    "no mass": ("<mujoco>\n<worldbody><body>\n<joint/></body></worldbody></mujoco>", "mass"),
    "no bodies": ("<mujoco/>", "found no bodies"),
    "too deep": ("<mujoco>\n" + "<body>" * 300, ":2: nested deeper than 200 levels"),
    "a macro": ('<robot name="a" xmlns:xacro="x">\n<xacro:if/></robot>', ":2: found a macro"),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_file_is_a_located_mistake(text, message, tmp_path):
    with pytest.raises(ExchangeError) as caught:
        import_text(text, tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "model.xml"))
    assert message in str(caught.value)


def test_a_missing_file_is_a_mistake(tmp_path):
    for path, kind in ((tmp_path, "a folder"), (tmp_path / "none.xml", "nothing")):
        with pytest.raises(ExchangeError, match=f"found {kind} here"):
            import_model(path)


def test_files_are_not_replaced_without_force(tmp_path):
    puppet_import = import_text(REST, tmp_path)
    puppet_import.save(tmp_path / "a.yaml")
    (tmp_path / "a.yaml").write_text("mine")
    with pytest.raises(ExchangeError, match="exists already"):
        puppet_import.save(tmp_path / "a.yaml")
    (tmp_path / "b_meshes").mkdir()
    (tmp_path / "b_meshes" / "cylinder.stl").touch()
    with pytest.raises(ExchangeError, match=r"cylinder\.stl: exists already; .* \(--force"):
        puppet_import.save(tmp_path / "b.yaml")
    assert (tmp_path / "a.yaml").read_text() == "mine" and not (tmp_path / "b.yaml").exists()
    (tmp_path / "c_meshes").touch()
    with pytest.raises(ExchangeError, match="c_meshes: is a file"):
        puppet_import.save(tmp_path / "c.yaml", force=True)
    puppet_import.save(tmp_path / "a.yaml", force=True)
    assert (tmp_path / "a.yaml").read_text() == puppet_import.text.replace(
        "re_st_meshes/", "a_meshes/"
    )
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        puppet_import.save(tmp_path / "none" / "a.yaml")


@pytest.mark.parametrize("flag", ["equality", "constraint"])
def test_flags_disable_constraints(flag, tmp_path):
    tendon = '<spatial name="rod"><site site="here"/><site site="there"/></spatial>'
    text = CONNECTED.replace("</equality>", '<tendon name="keep" tendon1="rod"/></equality>')
    text = text.replace("</mujoco>", f"<tendon>{tendon}</tendon></mujoco>")
    text = text.replace('name="ja"', 'name="ja" limited="true" range="-1 1"')
    off = text.replace("<mujoco>", f'<mujoco><option><flag {flag}="disable"/></option>')
    for model, strings, n_notes in ((text, 4, 1), (off, 0, 2)):
        puppet_import = import_text(model, tmp_path)
        puppet = fan.model.loads(puppet_import.text)
        assert len(puppet.strings) == strings
        assert len([n for n in puppet_import.report if n.kind == "equality"]) == n_notes
        limited = model is text or flag == "equality"
        assert (puppet.bodies[0].joint.limits is not None) == limited


def test_a_colour_of_a_geom_precedes_its_material(tmp_path):
    puppet_import = import_text(
        '<mujoco><asset><material name="red" rgba="1 0 0 1"/><material name="no" rgba="1 0 0 0"/>'
        '</asset><worldbody><body><freejoint/><geom size="0.1" material="red"/>'
        '<geom size="0.2" material="red" rgba="0 0 1 1"/>'
        '<geom size="0.3" material="no" rgba="0 1 0 1"/>'
        '<geom size="0.4" material="no"/></body></worldbody></mujoco>',
        tmp_path,
    )
    shapes = fan.model.loads(puppet_import.text).bodies[0].shapes
    assert [s.colour for s in shapes] == ["#ff0000", "#0000ff", "#00ff00"]


def test_a_keyframe_moves_mocap_bodies(tmp_path):
    hand = 'mpos="0.1 0 1.5" mquat="0 1 0 0" qvel="0 1 0 0"'
    puppet_import = import_text(REST.replace('qpos="0.5 1 0 0 0"', hand), tmp_path, keyframe="bent")
    puppet_import.save(tmp_path / "out.yaml")
    pose = fan.model.load(tmp_path / "out.yaml").pose
    assert pose["hand.x"] == 0.1 and pose["hand.z"] == 1.5
    assert tuple(pose["hand.rotation"]) == (0, 1, 0, 0)
    notes = [str(note).partition(":31: ")[2] for note in puppet_import.report if note.kind == "key"]
    assert notes == ["key bent: has velocities, left out"]


def test_a_winch_has_a_note_about_its_import(tmp_path):
    winch = '<actuator><position tendon="idle"/></actuator>'
    puppet_import = import_text(REST.replace("<sensor>", f"{winch}<sensor>"), tmp_path)
    (note,) = (note for note in puppet_import.report if note.what == "tendon idle")
    assert note.message.endswith("; inputs can change the length of a string with `length: driven`")


def test_a_tendon_with_play_keeps_its_damping(tmp_path):
    tendon = (
        '<tendon><spatial name="t" springlength="0.1 0.3" stiffness="5" damping="0.4">'
        '<site site="here"/><site site="there"/></spatial></tendon></mujoco>'
    )
    puppet_import = import_text(CONNECTED.replace("</mujoco>", tendon), tmp_path)
    (spring,) = fan.model.loads(puppet_import.text).springs
    assert (spring.stiffness, spring.damping) == (0.0, 0.4)
    assert "has a spring with play from 0.1 to 0.3 m, left out" in puppet_import.text


def test_names_are_data(tmp_path):
    """No name of a model reaches the puppet unchanged: not as YAML, comment or path."""
    odd = "../x: {y}&#10;&#x2028;puppet: z&#13;: &quot;  - name: w"
    text = (
        f'<mujoco model="{odd}"><asset><mesh name="{odd}" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
        f'</asset><worldbody><body name="{odd}"><joint name="{odd}" frictionloss="1"/>'
        f'<geom type="mesh" mesh="{odd}"/></body></worldbody></mujoco>'
    )
    puppet_import = import_text(text, tmp_path)
    puppet_import.save(tmp_path / "out.yaml")
    puppet = fan.model.load(tmp_path / "out.yaml")
    assert len(puppet.bodies) == 1 and len(puppet.bodies[0].shapes) == 1
    assert all(part.parent.parent == tmp_path for part in tmp_path.rglob("*.stl"))
    assert puppet.name != "z" and all(str(note).isprintable() for note in puppet_import.report)


def test_a_tendon_of_kept_length_is_a_wire(tmp_path):
    """Its length is that of the zero pose, plus polycoef."""
    tendon = '<spatial name="rod"><site site="here"/><site site="there"/></spatial>'
    text = CONNECTED.replace(
        '<connect name="pin" body1="b" body2="c" anchor="0 0 -0.2"/>',
        '<tendon name="keep" tendon1="rod" polycoef="0.05 0 0 0 0"/>',
    ).replace("</mujoco>", f"<tendon>{tendon}</tendon></mujoco>")
    puppet_import, m = import_text(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    assert not any(note.kind in ("equality", "tendon") for note in puppet_import.report)
    (rod,) = fan.model.loads(puppet_import.text).strings
    assert rod.wire and rod.length == pytest.approx(m.tendon_length0[0] + 0.05, abs=1e-12)


SEVERAL_CONTROLS = """<mujoco><worldbody>
  <body><joint name="a" armature="0.1"/><geom size="0.1"/>
    <body><joint name="b" type="ball" armature="0.1"/><geom size="0.1"/>
      <body><joint name="c"/><geom size="0.1"/></body></body></body></worldbody>
<actuator>
  <orientation joint="b" kp="1"/>
  <dcmotor joint="a" resistance="1" motorconst="0.1"/>
  <motor name="m" joint="c" gear="3" armature="0.01" damping="0.02"/>
</actuator></mujoco>"""


@pytest.mark.parametrize("left", [(), ("orientation",), ("dcmotor",), ("motor",)])
def test_actuators_of_several_controls_are_left_out_one_by_one(left, tmp_path):
    text = "\n".join(
        row
        for row in SEVERAL_CONTROLS.splitlines()
        if not row.strip().startswith(tuple(f"<{tag}" for tag in left))
    )
    puppet_import, m = import_text(text, tmp_path), mujoco.MjModel.from_xml_string(text)
    text = "left out: the joint or body that it moves is free"
    notes = [note for note in puppet_import.report if text in note.message]
    assert len(notes) == m.nactuator == 3 - len(left)
    c = fan.model.loads(puppet_import.text).bodies[2].joint
    # The motor's own gear, squared, independent of earlier actuators.
    wanted = (0.0, 0.0) if "motor" in left else (9 * 0.01, 9 * 0.02)
    assert (float(c.armature or 0), float(c.damping or 0)) == pytest.approx(wanted)


HINGED = "<worldbody><body><joint name='j'/><geom size='1'/></body></worldbody>"
BOMBS = {
    "a height field": "<asset><hfield name='a' nrow='20000' ncol='20000' size='1 1 1 1'/></asset>",
    "several": "<asset>"
    + "".join(f"<hfield name='{k}' nrow='4000' ncol='4000' size='1 1 1 1'/>" for k in range(5))
    + "</asset>",
    "a texture": "<asset><texture name='a' type='2d' builtin='flat' width='20000' height='20000'/>"
    "</asset>",
    "a cube": "<asset><texture name='a' type='cube' builtin='flat' width='9000' height='9000'/>"
    "</asset>",
    "a sky": "<asset><texture type='skybox' builtin='flat' width='9000' height='54000'/></asset>",
    "a texture by default": "<default><texture width='20000' height='20000' builtin='flat'/>"
    "</default><asset><texture type='2d' name='a'/></asset>",
    "by a class": "<default><default class='x'><texture width='20000' height='20000' "
    "builtin='flat'/></default></default><asset>"
    "<texture class='x' type='2d' name='a'/></asset>",
    "user data": "<size nuserdata='100000000'/>",
    "user data of bodies": "<size nuser_body='100000000'/>",
    "user data of geoms": "<size nuser_geom='50000000'/>" + HINGED,
    "user data of sensors": "<size nuser_sensor='100000000'/><sensor><clock/></sensor>",
    "keys": "<size nkey='100000000'/>" + HINGED,
    "a sensor": "<sensor><user dim='100000000'/></sensor>",
    "contacts": HINGED.replace("<geom", "<geom name='g'")
    + "<sensor><contact geom1='g' num='100000000'/></sensor>",
    "a camera": "<worldbody><camera name='c' resolution='20000 20000'/></worldbody>"
    "<sensor><rangefinder camera='c'/></sensor>",
    "a mesh": "<asset><mesh name='m' builtin='supersphere' params='20000 1 1'/></asset>",
    "a plate": "<asset><mesh name='m' builtin='plate' params='20000 20000'/></asset>",
    "a cone": "<asset><mesh name='m' builtin='cone' params='3000000 1'/></asset>",
    "samples": HINGED + "<actuator><motor joint='j' nsample='16000000' delay='1'/></actuator>",
    "samples of a sensor": "<sensor><clock nsample='16000000' delay='1'/></sensor>",
    "activations": HINGED + "<actuator><general joint='j' dyntype='user' actdim='100000000'/>"
    "</actuator>",
    "exponents": "<size nuserdata='1e8'/>",
}


@pytest.mark.parametrize("text", BOMBS.values(), ids=BOMBS)
def test_a_short_model_that_needs_gigabytes_is_refused(text, tmp_path, monkeypatch):
    """The model is refused before MuJoCo reads it."""
    monkeypatch.setattr(mujoco.MjSpec, "from_file", None)
    with pytest.raises(ExchangeError, match=r"model\.xml:1: .*MuJoCo would need [\d,]+ MB"):
        import_text(f"<mujoco>{text}</mujoco>", tmp_path)


def test_images_are_measured_before_mujoco_unpacks_them(tmp_path):
    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", 30000, 30000, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    png += chunk(b"IDAT", zlib.compress(bytes(10**6)))
    folder = tmp_path / "pictures"
    folder.mkdir()
    (folder / "a.png").write_bytes(png + chunk(b"IEND", b""))
    for asset in (
        "<texture type='2d' name='a' file='a.png'/>",
        "<texture type='cube' name='a' fileright='a.png'/>",
        "<hfield name='a' file='a.png' size='1 1 1 1'/>",
    ):
        text = f"<mujoco><compiler assetdir='pictures'/><asset>{asset}</asset></mujoco>"
        with pytest.raises(ExchangeError, match="MuJoCo would need"):
            import_text(text, tmp_path)


def test_models_of_ordinary_size_are_not_refused(tmp_path):
    text = """<mujoco><size nuserdata="1000" nuser_geom="10" nkey="20" memory="100M"/>
      <default><texture width="512" height="512"/></default>
      <asset><texture type="skybox" builtin="gradient" width="800" height="800"/>
      <texture name="g" type="2d" builtin="checker" width="300" height="300"/>
      <hfield name="h" nrow="100" ncol="100" size="1 1 1 1"/>
      <mesh name="m" builtin="supersphere" params="20 1 1"/></asset>
      <worldbody><camera resolution="1920 1080"/><body><joint/><geom type="mesh" mesh="m"/></body>
      </worldbody></mujoco>"""
    assert import_text(text, tmp_path).text
